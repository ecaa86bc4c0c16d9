//! Least-squares colours for fixed geometry.
//!
//! A pixel is linear in the colours of its splats: `C(p) = Σ_i w_i(p) c_i`. The changes `d` of the
//! base colours that explain the pictures solve `(Σ_v AᵀWA + λ) d = Σ_v AᵀW r`, `A` the blending
//! weights of a view, `W` the weights of its pixels, `r` picture minus render. Solved by conjugate
//! gradients; a product with the matrix is one forward and one backward pass over the views.

use crate::FitError;
use crate::fit::Run;
use crate::view::View;
use gs_core::{
    RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads,
};

/// Damping λ, pixels: the colour of a splat that covers less than this in all pictures together stays
/// near its initial value. With 2 pixels, only 5 to 10 % of the splats keep their geometry (case
/// `eight`).
const DAMPING: f32 = 0.05;
/// Conjugate gradients: maximum number of iterations, and the decrease of the residual at which
/// they end.
const ITERATIONS: usize = 20;
const CONVERGED: f64 = 1e-3;

/// One view of the system: its splats, and what the pixels depend on.
struct Equation<'a, P> {
    view: &'a View,
    splats: Splats,
    prepared: P,
}

impl<P> Equation<'_, P> {
    /// `AᵀW values`, added to `sums` (`[N,3]`); `values` are the colours of a pixel. The selection
    /// does not change pixels outside the view's tiles: their weight is 0.
    fn lift<R: Rasterizer<Prepared = P>>(
        &mut self,
        raster: &R,
        values: impl Fn(usize) -> [f32; 3] + Sync,
        sums: &mut [f32],
    ) -> Result<(), RasterError> {
        let View { tiles, weights, .. } = self.view;
        let (mut planes, mut grads) = (UpstreamGrads::default(), RenderGrads::default());
        self.view.fill_planes(tiles, &mut planes.v_features, |p| {
            let weight = weights.get(p).copied().unwrap_or(1.0);
            values(p).map(|value| weight * value)
        });
        raster.lift_into(&mut self.prepared, &self.splats, &planes, 3, &mut grads)?;
        for (&row, sum) in self.view.rows.iter().zip(grads.v_features.as_chunks::<3>().0) {
            for (k, sum) in sum.iter().enumerate() {
                sums[3 * row as usize + k] += sum;
            }
        }
        Ok(())
    }

    /// `A d`, `[H,W,3]`.
    fn blend<R: Rasterizer<Prepared = P>>(
        &mut self,
        raster: &R,
        colors: &[f32],
        output: &mut RenderOutput,
    ) -> Result<(), RasterError> {
        let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
        let features: Vec<f32> = self
            .view
            .rows
            .iter()
            .flat_map(|&row| colors[3 * row as usize..3 * row as usize + 3].iter().copied())
            .collect();
        raster.forward_into(&mut self.prepared, &self.splats, &features, &params, output)
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

impl<R: Rasterizer + Sync> Run<'_, R> {
    /// Changes of the base colours of the selected splats that explain the edited pictures with the
    /// current geometry, `[N,3]`; 0 for fading and unselected ones.
    pub(crate) fn color_changes(&self) -> Result<Vec<f32>, FitError> {
        let (raster, params) = (self.raster, self.params());
        let working = &self.working;
        let n = working.splats.len();
        let is_free = |i: usize| working.selected[i] && !working.fading[i] && !working.hidden[i];
        let mask = |values: &mut [f32]| {
            for (k, value) in values.iter_mut().enumerate() {
                if !is_free(k / 3) {
                    *value = 0.0;
                }
            }
        };
        let mut equations = Vec::with_capacity(self.edited.len());
        let (mut residual, mut scale) = (vec![0.0_f32; 3 * n], vec![0.0_f32; 3 * n]);
        let mut output = RenderOutput::default();
        for &v in &self.edited {
            let view = &self.views[v];
            let rows: Vec<usize> = view.rows.iter().map(|&row| row as usize).collect();
            let splats = working.splats.select(&rows);
            let mut prepared = raster.prepare_tiles(&splats, &view.camera, &view.tiles)?;
            raster.forward_into(&mut prepared, &splats, &[], &params, &mut output)?;
            let rgb = std::mem::take(&mut output.rgb);
            let mut equation = Equation { view, splats, prepared };
            let left = |p: usize| [0, 1, 2].map(|c| view.target[3 * p + c] - rgb[3 * p + c]);
            equation.lift(raster, left, &mut residual)?;
            equation.lift(raster, |_| [1.0; 3], &mut scale)?;
            equations.push(equation);
        }
        mask(&mut residual);
        let precondition = |values: &[f32]| -> Vec<f32> {
            values.iter().zip(&scale).map(|(value, scale)| value / (scale + DAMPING)).collect()
        };
        let mut found = vec![0.0_f32; 3 * n];
        let mut step = precondition(&residual);
        let mut size = dot(&residual, &step);
        let enough = CONVERGED * CONVERGED * size;
        for _ in 0..ITERATIONS {
            if size <= enough {
                break;
            }
            let mut product = vec![0.0_f32; 3 * n];
            for equation in &mut equations {
                equation.blend(raster, &step, &mut output)?;
                let blended = output.features.as_chunks::<3>().0;
                equation.lift(raster, |p| blended[p], &mut product)?;
            }
            for (product, step) in product.iter_mut().zip(&step) {
                *product += DAMPING * step;
            }
            mask(&mut product);
            #[expect(clippy::cast_possible_truncation, reason = "a factor of colours")]
            let length = (size / dot(&step, &product)) as f32;
            if !length.is_finite() {
                break;
            }
            for k in 0..3 * n {
                found[k] += length * step[k];
                residual[k] -= length * product[k];
            }
            let next = precondition(&residual);
            let new_size = dot(&residual, &next);
            #[expect(clippy::cast_possible_truncation, reason = "a factor of colours")]
            let ratio = (new_size / size) as f32;
            for (step, next) in step.iter_mut().zip(next) {
                *step = next + ratio * *step;
            }
            size = new_size;
        }
        Ok(found)
    }
}
