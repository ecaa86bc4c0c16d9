//! [`Source`]: per-splat inputs of supervised images.

use crate::{
    RefineOptions,
    flow::affine_motion,
    warp::{FirstFrame, WARP_CHANNELS},
};
use gs_core::{Camera, Splats, visible_share};
use rayon::prelude::*;

/// Inputs of samples.
pub(crate) struct Source<'a, R> {
    pub raster: &'a R,
    pub options: &'a RefineOptions,
    pub edited: &'a [bool],
    /// Row among the edited splats, or `u32::MAX`.
    pub row_of: &'a [u32],
    pub first: &'a Splats,
}

/// Channels composited to make a sample: those of the warp, flags of edited splats, their
/// visibility in frame 1, and the difference between their colours in frame 1 and now.
pub(crate) const CHANNELS: usize = WARP_CHANNELS + 5;
pub(crate) const EDITED: usize = WARP_CHANNELS;
pub(crate) const KNOWN_SHARE: usize = WARP_CHANNELS + 1;
pub(crate) const COLOR_CHANGE: usize = WARP_CHANNELS + 2;

impl<R> Source<'_, R> {
    /// `[N,CHANNELS]` at the time of `splats`, 0 for splats that are not `needed`; `colors` are
    /// their colours now.
    pub(crate) fn features(
        &self,
        splats: &Splats,
        camera: &Camera,
        frame: &FirstFrame,
        colors: &[Option<[f32; 3]>],
        needed: impl Fn(usize) -> bool + Sync,
    ) -> Vec<f32> {
        let enough = self.options.warp_params.min_visible_share;
        let mut features = vec![0.0_f32; splats.len() * CHANNELS];
        features.par_chunks_mut(CHANNELS).with_min_len(1024).enumerate().for_each(|(i, out)| {
            if !needed(i) {
                return;
            }
            if let Some(back) = affine_motion(camera, splats, self.first, i) {
                out[..2].copy_from_slice(&back.shift);
                out[2..6].copy_from_slice(&back.linear);
                out[6..9].copy_from_slice(&back.place);
                out[9] = back.place.iter().map(|x| x * x).sum();
            }
            if let (Some(now), Some(then)) = (colors[i], frame.colors[i]) {
                if !self.edited[i] {
                    // not to be refined: its current colour is correct
                    out[KNOWN_SHARE] = 1.0;
                } else if let Some(&weight) = frame.splat_weights.get(i) {
                    let known = visible_share(splats, i, weight, camera, enough);
                    out[KNOWN_SHARE] = known;
                    for channel in 0..3 {
                        out[COLOR_CHANGE + channel] = known * (then[channel] - now[channel]);
                    }
                }
            }
            out[EDITED] = f32::from(u8::from(self.edited[i]));
            if !out.iter().all(|value| value.is_finite()) {
                out.fill(0.0);
            }
        });
        features
    }
}
