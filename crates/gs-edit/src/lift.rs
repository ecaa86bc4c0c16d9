//! Selection of splats from masks drawn in pictures.

use crate::error::EditError;
use gs_core::{Camera, Image, RasterError, Rasterizer, RenderGrads, Splats, UpstreamGrads};

/// Share of a splat's visible weight that must lie in the masks.
const MIN_SHARE: f32 = 0.5;

/// Flags of the splats in the masks, `[N]`: those with `Σ m α T > ½ Σ α T` over all pixels of all
/// views, where `α T` is the splat's weight in a pixel and `m` the mask there, 0 to 1. Splats that
/// are invisible in all views are not selected. A mask has one channel and the size of its camera.
///
/// # Errors
/// If the size of a mask differs from that of its camera, or the rasteriser fails.
pub fn lift_masks<R: Rasterizer>(
    rasterizer: &R,
    splats: &Splats,
    views: &[(Camera, Image)],
    progress: &dyn Fn(usize),
) -> Result<Vec<bool>, EditError> {
    let num = splats.len();
    let (mut inside, mut all) = (vec![0.0_f32; num], vec![0.0_f32; num]);
    let mut prepared = None;
    let (mut planes, mut sums) = (UpstreamGrads::default(), RenderGrads::default());
    for (done, (camera, mask)) in views.iter().enumerate() {
        let pixels = camera.width as usize * camera.height as usize;
        if mask.data.len() != pixels {
            let (what, found, expected) = ("mask", mask.data.len(), pixels);
            return Err(RasterError::Shape { what, found, expected }.into());
        }
        let state = match prepared.take() {
            Some(mut state) => {
                rasterizer.prepare_into(splats, camera, &mut state)?;
                prepared.insert(state)
            }
            None => prepared.insert(rasterizer.prepare(splats, camera)?),
        };
        planes.v_features.clear();
        planes.v_features.extend(mask.data.iter().flat_map(|&m| [m, 1.0]));
        rasterizer.lift_into(state, splats, &planes, 2, &mut sums)?;
        for (row, sums) in sums.v_features.chunks_exact(2).enumerate() {
            inside[row] += sums[0];
            all[row] += sums[1];
        }
        progress(done + 1);
    }
    Ok(inside.iter().zip(all).map(|(inside, all)| *inside > MIN_SHARE * all).collect())
}
