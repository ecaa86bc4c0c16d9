//! Geometry is fitted only where new colours do not explain the pictures. Splats whose geometry
//! keeps its bits are recognised as the splats that they were, and keep their own motion.

use crate::FitError;
use crate::fit::Run;
use crate::votes::{LEAST_SEEN, lift};
use gs_core::{Rasterizer, RenderOutput};

/// Mean difference between render and pictures above which colours do not explain a splat's pixels,
/// 0 to 1. Smaller ones come from neighbours that are not fitted yet.
const UNEXPLAINED: f32 = 12.0 / 255.0;
/// Share of a splat's visible pixels that must be edited for its geometry to be fitted. Others are
/// selected because they lie beside an edit; they may belong to something that moves on its own.
const EDITED_SHARE: f32 = 0.5;

impl<R: Rasterizer + Sync> Run<'_, R> {
    /// Releases geometry and opacity of selected splats whose pixels were edited and still differ
    /// from the pictures, and of those that fade.
    pub(crate) fn release(&mut self) -> Result<(), FitError> {
        let params = self.params();
        let mut output = RenderOutput::default();
        // Visible pixels of each row, their differences, and how many of them were edited.
        let mut sums = vec![[0.0_f32; 3]; self.working.splats.len()];
        for v in self.edited.clone() {
            self.render(v, &params, &mut output)?;
            let view = &self.views[v];
            let pixels = output.rgb.chunks_exact(3).zip(view.target.chunks_exact(3)).enumerate();
            let planes: Vec<f32> = pixels
                .flat_map(|(p, (a, b))| {
                    // Renders are complete only there.
                    if !view.rect.contains(p % view.width, p / view.width) {
                        return [0.0; 3];
                    }
                    let difference =
                        (0..3).fold(0.0, |most, c| f32::max(most, (a[c] - b[c]).abs()));
                    [1.0, difference, f32::from(u8::from(view.changed[p]))]
                })
                .collect();
            let lifted = lift(self.raster, &self.subset.splats, &view.camera, planes, 3)?;
            for (&row, lifted) in view.rows.iter().zip(lifted.as_chunks::<3>().0) {
                for (sum, value) in sums[row as usize].iter_mut().zip(lifted) {
                    *sum += value;
                }
            }
        }
        let working = &mut self.working;
        for (row, [seen, difference, edited]) in sums.into_iter().enumerate() {
            let explained = seen <= LEAST_SEEN
                || difference <= UNEXPLAINED * seen
                || edited < EDITED_SHARE * seen;
            working.held[row] &= explained && !working.fading[row];
        }
        Ok(())
    }
}
