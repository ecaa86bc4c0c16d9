//! [`TermWeights`]: weights of the terms of a refinement's loss.

use cuar::loss::LossWeights;

/// Weights of the terms of the loss, each a mean over all pixels and channels of the image.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct TermWeights {
    /// Weight of `mean fore·|render − warp|`.
    pub fore_l1: f32,
    /// Weight of `1 − mean SSIM(fore·render, fore·warp)`.
    pub fore_ssim: f32,
    /// Weight of `mean back·|render − original|`.
    pub back_l1: f32,
}

impl From<LossWeights> for TermWeights {
    /// Eqs. 18 and 20: `(1 − ζ)((1 − η)·L1 + η·(1 − SSIM)) + ζ·L1 of the background`.
    #[expect(clippy::cast_possible_truncation, reason = "weights of a loss in single precision")]
    fn from(LossWeights { eta, zeta }: LossWeights) -> Self {
        Self {
            fore_l1: ((1.0 - zeta) * (1.0 - eta)) as f32,
            fore_ssim: ((1.0 - zeta) * eta) as f32,
            back_l1: zeta as f32,
        }
    }
}
