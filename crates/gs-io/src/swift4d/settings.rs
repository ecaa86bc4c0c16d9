//! [`Settings`]: the resolved flags of a training run.

use gs_deform::GridShape;

/// Resolved flags of a Swift4D training run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Settings {
    pub(super) shape: GridShape,
    pub(super) trunk_relu: bool,
    pub(super) dynamic_thro: f32,
    pub(super) frames: usize,
    pub(super) time_divisor: usize,
}
