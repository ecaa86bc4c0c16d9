//! [`FitParams`]: parameters of the training.

/// Parameters of [`crate::fit_hexplane`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitParams {
    /// Optimiser steps of 2048 samples each. Default 600.
    pub steps: usize,
    /// Texels along each spatial axis of the coarse level; the fine one has twice as many. Default
    /// 48.
    pub resolution: usize,
    /// Texels along the time axis, of which the network uses the later half (its time runs from 0
    /// to 1 on an axis from −1 to 1). Default 49.
    pub time_resolution: usize,
    /// Number of evenly spaced training times. Default 25.
    pub num_times: usize,
    /// Random seed of weights and samples. Default 0.
    pub seed: u64,
}

impl Default for FitParams {
    fn default() -> Self {
        Self { steps: 600, resolution: 48, time_resolution: 49, num_times: 25, seed: 0 }
    }
}
