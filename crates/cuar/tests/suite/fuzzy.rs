//! Broad splats that overlap in depth, as in captured scenes: there is no surface from which to
//! fetch colours, but frame 1 shows the splats.

use crate::common::{render, seen_basis, squared_error, uniform};
use cuar::{NoRefineObserver, RefineOptions, Refined, Views, WarpParams, artifact_mask, refine};
use gs_core::{Camera, DynamicScene, SceneError, Splats, TimeRange, sh};
use gs_raster_cpu::CpuRasterizer;

/// A cloud of translucent splats that drifts sideways.
#[derive(Debug, Clone)]
struct Cloud {
    splats: Splats,
}

impl DynamicScene for Cloud {
    fn num_splats(&self) -> usize {
        self.splats.len()
    }
    fn sh_degree(&self) -> usize {
        self.splats.sh_degree
    }
    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        out.clone_from(&self.splats);
        for mean in &mut out.means {
            mean[0] += 0.8 * t;
            mean[2] += 0.2 * t;
        }
        Ok(())
    }
}

const DEGREE: usize = 2;

fn cameras() -> Vec<Camera> {
    [-0.3, 0.1, 0.5]
        .map(|x| {
            let eye = [x, 0.0, 0.0];
            Camera::look_at(eye, [0.2, 0.0, 5.0], [0.0, -1.0, 0.0], 0.6, 128, 96)
        })
        .to_vec()
}

/// The ground truth, and a copy with errors in colours that the two training views of frame 1 do
/// not show.
fn clouds() -> [Cloud; 2] {
    let mut random = 3_u64;
    let mut splats = Splats::with_capacity(0, DEGREE);
    for _ in 0..500 {
        let [x, y, z, size, opacity] = [(); 5].map(|()| uniform(&mut random));
        splats.means.push([1.2 * x, 0.9 * y, 5.0 + 0.8 * z]);
        splats.quats.push([1.0, 0.3 * x, 0.3 * y, 0.3 * z]);
        splats.log_scales.push([-1.9 + 0.4 * size, -2.1, -2.3]);
        splats.opacity_logits.push(opacity - 0.5);
        splats.sh.push(sh::dc_from_rgb([(); 3].map(|()| 0.5 + 0.3 * uniform(&mut random))));
        splats.sh.resize(splats.means.len() * sh::num_coeffs(DEGREE), [0.0; 3]);
    }
    let truth = Cloud { splats };
    let mut spoiled = truth.clone();
    let seen_from = [cameras()[0].clone(), cameras()[2].clone()];
    let Splats { sh, means, .. } = &mut spoiled.splats;
    for (own, &mean) in sh.chunks_exact_mut(sh::num_coeffs(DEGREE)).zip(means.iter()) {
        let seen = seen_basis(DEGREE, mean, &seen_from);
        for channel in 0..3 {
            let mut extra: Vec<f32> = own.iter().map(|_| uniform(&mut random)).collect();
            for direction in &seen {
                let along: f32 = extra.iter().zip(direction).map(|(a, b)| a * b).sum();
                extra.iter_mut().zip(direction).for_each(|(a, b)| *a -= along * b);
            }
            own.iter_mut().zip(&extra).for_each(|(rgb, value)| rgb[channel] += value);
        }
    }
    [truth, spoiled]
}

fn run(scene: &Cloud, warp_params: WarpParams) -> Refined {
    let (cameras, times) = (cameras(), TimeRange::UNIT.frames(9));
    let views = Views { cameras: &cameras, times: &times, held_out: &[1] };
    let options = RefineOptions { warp_params, ..RefineOptions::default() };
    let (raster, edited) = (CpuRasterizer::default(), vec![true; scene.num_splats()]);
    refine(&raster, scene, &edited, &views, &options, None, &mut NoRefineObserver).unwrap()
}

#[test]
fn visible_splats_supervise_pixels_without_a_surface() {
    let [truth, spoiled] = clouds();
    let camera = &cameras()[1];
    let psnr = |scene: &dyn DynamicScene| {
        let mut sums = [(0.0, 0.0); 2];
        for t in [0.3, 0.6, 1.0] {
            let (now, then) = (spoiled.at(t).unwrap(), spoiled.at(0.0).unwrap());
            let raster = CpuRasterizer::default();
            let map = cuar::render_uncertainty(&raster, &now, &then, camera).unwrap();
            let mask = artifact_mask(&map, 0.5, 0.02);
            let [ours, theirs] = [render(scene, t, camera), render(&truth, t, camera)];
            for (sum, inside) in sums.iter_mut().zip([true, false]) {
                let (error, count) = squared_error(&ours, &theirs, &mask, inside);
                *sum = (sum.0 + error, sum.1 + count);
            }
        }
        sums.map(|(error, count)| -10.0 * f64::log10(error / count))
    };
    let before = psnr(&spoiled);

    let refined = run(&spoiled, WarpParams::default());
    let stats = refined.report.supervision;
    let after = psnr(&refined.scene(&spoiled));
    assert!(stats.surface < stats.masked / 10, "almost no surfaces: {stats:?}");
    assert!(stats.splat_colors > stats.masked / 2, "supervised by splat colours: {stats:?}");
    assert_eq!(
        stats.supervised() + stats.rejections.iter().sum::<u64>(),
        stats.masked,
        "all counted"
    );
    assert!(after[0] > before[0] + 3.0, "inside the mask: {before:?} → {after:?} dB");
    assert!(after[1] > before[1] - 0.05, "outside the mask: {before:?} → {after:?} dB");

    // negative control: with surfaces alone, few pixels are supervised, and little is repaired
    let control = run(&spoiled, WarpParams { min_known_color: 2.0, ..WarpParams::default() });
    let alone = psnr(&control.scene(&spoiled));
    assert!(control.report.supervision.splat_colors == 0, "{:?}", control.report.supervision);
    assert!(alone[0] < after[0] - 1.0, "by surfaces {alone:?}, by splats {after:?} dB");
}
