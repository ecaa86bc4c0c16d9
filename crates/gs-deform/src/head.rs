//! [`Head`]: the last layers of a deformation network.

use crate::Linear;

/// Two layers, each after a ReLU: `head(h) = W₃·relu(W₁·relu(h) + b₁) + b₃`.
#[derive(Debug, Clone, PartialEq)]
pub struct Head {
    /// Layer 1, `[W, W]`.
    pub hidden: Linear,
    /// Layer 3, `[outputs, W]`.
    pub out: Linear,
}
