//! [`StageTimes`]: times of the stages of the last calls.

use std::time::Instant;

/// Wall-clock seconds of the stages of the last preparation, forward pass and backward pass.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageTimes {
    /// Projection of every splat.
    pub project: f64,
    /// Depth sort, and gathering in depth order.
    pub sort: f64,
    /// Tile lists.
    pub bin: f64,
    /// Colours and opacities of every splat.
    pub shade: f64,
    /// Tiles: compositing.
    pub composite: f64,
    /// Interleaving the planes of all tiles into images.
    pub assemble: f64,
    /// Tiles: gradients of their entries.
    pub differentiate: f64,
    /// Sums per splat over tiles.
    pub collect: f64,
    /// Chain rule of every splat.
    pub chain: f64,
}

/// Runs `work` and stores its duration in `seconds`.
pub(crate) fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let value = work();
    *seconds = start.elapsed().as_secs_f64();
    value
}
