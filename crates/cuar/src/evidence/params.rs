//! [`EvidenceParams`].

use gs_fit::votes::Votes;

/// Parameters of [`crate::Evidence`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvidenceParams {
    /// Visible share of a splat's weight ([`crate::first_frame_shares`]) up to which frame 1 does
    /// not supervise it. Default 0.1.
    pub hidden: f32,
    /// Share from which it is fully supervised. Default 0.3.
    pub supervised: f32,
    /// Minimum change of base colour, summed over the channels, that counts as an edit. Default
    /// 0.02 (5 of 255).
    pub min_change: f32,
    /// Standard deviation of the shares of red and green in the base colour, between splats of one
    /// material. Default 0.04.
    pub hue_spread: f32,
    /// Standard deviation of the logarithm of brightness between them: light and shadow. Default
    /// 0.7.
    pub light_spread: f32,
    /// Standard deviation of the relative change of distance of two splats on one body. Default
    /// 0.08.
    pub strain: f64,
    /// Minimum share of the surface around a splat that the edit changed. Default 0.5.
    pub min_agreement: f32,
}

impl Default for EvidenceParams {
    fn default() -> Self {
        Self {
            hidden: Votes::HIDDEN,
            supervised: 0.3,
            min_change: 0.02,
            hue_spread: 0.04,
            light_spread: 0.7,
            strain: 0.08,
            min_agreement: 0.5,
        }
    }
}
