//! Uncovered background: a board slides away from a wall.

use cuar::loss::LossWeights;
use cuar::{NoRefineObserver, RefineOptions, Refined, Views, WarpParams, refine};
use gs_core::{Camera, DynamicScene, SceneError, Splats, TimeRange, sh};
use gs_raster_cpu::CpuRasterizer;

/// A red board slides away from a green wall that it hid in frame 1; all splats are edited, and
/// every colour depends on the view.
#[derive(Debug, Clone)]
pub struct Slide {
    splats: Splats,
    board: usize,
}

impl Slide {
    /// Colour of the board, RGB.
    pub const BOARD: [f32; 3] = [0.9, 0.1, 0.1];

    /// Three views of the board, side by side.
    pub fn cameras(width: u32, height: u32) -> Vec<Camera> {
        [-0.3, 0.0, 0.3]
            .map(|x| {
                let eye = [x, 0.0, 0.0];
                Camera::look_at(eye, [0.0, 0.0, 3.0], [0.0, -1.0, 0.0], 0.6, width, height)
            })
            .to_vec()
    }

    /// The refinement with the largest possible mask, with or without the occlusion test of the
    /// warp.
    pub fn refined(&self, tested: bool) -> Refined {
        let (cameras, times) = (Self::cameras(128, 96), TimeRange::UNIT.frames(9));
        let views = Views { cameras: &cameras, times: &times, held_out: &[] };
        let (never, usual) = (1e6, WarpParams::default());
        let warp_params = WarpParams {
            depth_tolerance: if tested { usual.depth_tolerance } else { never },
            spread_tolerance: if tested { usual.spread_tolerance } else { never },
            ..usual
        };
        let options = RefineOptions {
            min_uncertainty: 0.0,
            epsilon: 0.0,
            warp_params,
            // SSIM converges slowly in flat colours; without it, wrong colours appear within the
            // usual number of passes
            weights: LossWeights { eta: 0.0, ..LossWeights::default() },
            ..RefineOptions::default()
        };
        let (raster, edited) = (CpuRasterizer::default(), vec![true; self.num_splats()]);
        refine(&raster, self, &edited, &views, &options, None, &mut NoRefineObserver).unwrap()
    }

    pub fn new() -> Self {
        let mut splats = Splats::with_capacity(0, 1);
        let mut add = |mean: [f32; 3], rgb: [f32; 3], tilt: f32| {
            splats.means.push(mean);
            splats.quats.push([1.0, 0.0, 0.0, 0.0]);
            splats.log_scales.push([-2.6, -2.6, -5.0]);
            splats.opacity_logits.push(4.0);
            splats.sh.extend([sh::dc_from_rgb(rgb), [0.0; 3], [0.0; 3], [tilt, tilt, 0.0]]);
        };
        for k in 0..225 {
            let at = |k: i32| (k - 7) as f32 * 0.08;
            // the tilt makes colours uncertain once they move
            add([0.6 * at(k % 15), 0.6 * at(k / 15), 3.0], Self::BOARD, 0.6);
        }
        for k in 0..1225 {
            let at = |k: i32| (k - 17) as f32 * 0.1;
            add([at(k % 35), at(k / 35), 4.0], [0.1, 0.8, 0.1], 0.2);
        }
        Self { splats, board: 225 }
    }
}

impl DynamicScene for Slide {
    fn num_splats(&self) -> usize {
        self.splats.len()
    }
    fn sh_degree(&self) -> usize {
        1
    }
    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        out.clone_from(&self.splats);
        for mean in &mut out.means[..self.board] {
            mean[0] += 0.8 * t;
        }
        // a small motion, so that the wall's colour is also uncertain and masked
        for mean in &mut out.means[self.board..] {
            mean[1] += 0.05 * t;
        }
        Ok(())
    }
}
