//! Refinement does not depend on the position and size of the scene.

use crate::common;
use crate::common::{Case, Flaws, case, render};
use cuar::{NoRefineObserver, RefineOptions, Views, refine};
use gs_core::{Camera, DynamicScene, SceneError, Splats, TimeRange};
use gs_raster_cpu::CpuRasterizer;

/// A scene scaled about the origin, then moved.
#[derive(Debug)]
struct Placed<'a> {
    scene: &'a dyn DynamicScene,
    scale: f64,
    shift: [f64; 3],
}

impl Placed<'_> {
    fn camera(&self, camera: &Camera) -> Camera {
        let mut camera = camera.clone();
        for row in &mut camera.viewmat[..3] {
            row[3] = self.scale * row[3] - (0..3).map(|k| row[k] * self.shift[k]).sum::<f64>();
        }
        camera.near *= self.scale;
        camera
    }
}

impl DynamicScene for Placed<'_> {
    fn num_splats(&self) -> usize {
        self.scene.num_splats()
    }
    fn sh_degree(&self) -> usize {
        self.scene.sh_degree()
    }
    fn time_range(&self) -> TimeRange {
        self.scene.time_range()
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.at_into(t, out)?;
        for mean in &mut out.means {
            *mean = [0, 1, 2].map(|k| (self.scale * f64::from(mean[k]) + self.shift[k]) as f32);
        }
        for log_scale in out.log_scales.as_flattened_mut() {
            *log_scale += (self.scale as f32).ln();
        }
        Ok(())
    }
}

/// Refines the case after this placement; returns the edited colours.
fn refined(case: &Case, scale: f64, shift: [f64; 3]) -> Vec<[f32; 3]> {
    let placed = Placed { scene: &case.scene, scale, shift };
    let cameras: Vec<Camera> = case.cameras.iter().map(|camera| placed.camera(camera)).collect();
    let times = TimeRange::UNIT.frames(5);
    let views = Views { cameras: &cameras, times: &times, held_out: &case.held_out };
    let options = RefineOptions { samples: 24, ..RefineOptions::default() };
    let raster = CpuRasterizer::default();
    let refined =
        refine(&raster, &placed, &case.edited, &views, &options, None, &mut NoRefineObserver)
            .unwrap();
    let mut first = case.scene.at(0.0).unwrap();
    refined.apply(&mut first);
    first.sh
}

/// PSNR between the pictures of the case with two sets of colours, dB.
fn agreement(case: &Case, a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let picture = |sh: &[[f32; 3]]| {
        let scene = common::Painted { truth: case.truth.clone(), sh: sh.to_vec() };
        [0.2, 0.7].map(|t| render(&scene, t, &case.cameras[0])).map(|image| image.data).concat()
    };
    let (a, b) = (picture(a), picture(b));
    let square = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    -10.0 * (square / a.len() as f64).log10()
}

#[test]
fn refinement_does_not_depend_on_scale_and_position() {
    let case = case(3_000, 1, 4, (120, 90), Flaws { interior: true, unseen_sh: 1.0, noise: 0.0 });
    let here = refined(&case, 1.0, [0.0; 3]);
    let control = agreement(&case, &here, &case.scene.sh);
    for (scale, shift) in [
        (0.001, [0.0; 3]),
        (1000.0, [0.0; 3]),
        (1.0, [1500.0, -800.0, 300.0]),
        (0.01, [-10.0, 15.0, 5.0]),
    ] {
        let there = agreement(&case, &here, &refined(&case, scale, shift));
        assert!(
            there > control + 15.0,
            "scale {scale}, shift {shift:?}: {there:.1} dB, the unrefined colours {control:.1} dB"
        );
    }
}
