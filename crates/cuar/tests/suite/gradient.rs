//! From SH coefficients through the rasteriser to the whole loss (Eqs. 18–20), in double precision,
//! against difference quotients.

use cuar::loss::{L1Shape, LossWeights, Objective, Targets};
use gs_core::{Camera, Rasterizer, RenderParams, Splats, UpstreamGrads, sh};
use gs_raster_cpu::CpuRasterizer;

const SIZE: (usize, usize) = (32, 24);

fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f64 / (1_u64 << 24) as f64
}

/// Overlapping splats in front of the camera, away from cutoffs of colour (all well above 0).
fn splats(count: usize) -> Splats<f64> {
    let mut random = 3_u64;
    let mut next = |low: f64, high: f64| low + (high - low) * uniform(&mut random);
    let mut splats = Splats::<f64>::with_capacity(0, 2);
    for _ in 0..count {
        splats.means.push([next(-0.9, 0.9), next(-0.7, 0.7), next(3.0, 4.0)]);
        splats.quats.push([1.0, next(-0.5, 0.5), next(-0.5, 0.5), next(-0.5, 0.5)]);
        splats.log_scales.push([next(-2.2, -1.5), next(-2.2, -1.5), next(-2.2, -1.5)]);
        splats.opacity_logits.push(next(-1.0, 1.5));
        let base = [next(0.3, 0.9), next(0.3, 0.9), next(0.3, 0.9)];
        splats.sh.push(base.map(|c| (c - 0.5) / f64::from(sh::C0)));
        splats.sh.extend((1..9).map(|_| [next(-0.05, 0.05), next(-0.05, 0.05), next(-0.05, 0.05)]));
    }
    splats
}

struct Scene {
    camera: Camera,
    original: Vec<f64>,
    warp: Vec<f64>,
    fore: Vec<f64>,
    back: Vec<f64>,
}

impl Scene {
    fn new(splats: &Splats<f64>) -> Self {
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 3.5], [0.0, -1.0, 0.0], 0.6, 32, 24);
        let mut random = 9_u64;
        let [mut original, mut warp] = [(); 2].map(|()| render(splats, &camera));
        // residuals well away from the kink of L1
        let mut push = |value: &mut f64, minimum: f64| {
            let size = minimum + 0.1 * uniform(&mut random);
            *value += if uniform(&mut random) < 0.5 { -size } else { size };
        };
        for value in &mut original {
            push(value, 0.01);
        }
        for value in &mut warp {
            push(value, 0.02);
        }
        let flag = |on: bool| f64::from(u8::from(on));
        let pixels = 0..SIZE.0 * SIZE.1;
        let fore = pixels.clone().map(|p| flag(p % SIZE.0 < 17 && p % 7 != 0)).collect();
        let back = pixels.map(|p| flag(p % SIZE.0 >= 17)).collect();
        Self { camera, original, warp, fore, back }
    }

    fn loss(&self, render: &[f64], shape: L1Shape, v_render: &mut Vec<f64>) -> f64 {
        let targets = Targets {
            original: &self.original,
            warp: &self.warp,
            fore: &self.fore,
            back: &self.back,
        };
        let weights = LossWeights::default();
        let mut objective = Objective::new(SIZE.0, SIZE.1, SIZE.0 * SIZE.1, weights);
        objective.evaluate(render, &targets, shape, v_render, None).shaped_total(weights)
    }
}

fn render(splats: &Splats<f64>, camera: &Camera) -> Vec<f64> {
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(splats, camera).unwrap();
    raster.forward(&mut prepared, splats, &[], &RenderParams::default()).unwrap().rgb
}

#[test]
fn sh_gradient_of_the_loss_matches_differences() {
    let splats = splats(14);
    let scene = Scene::new(&splats);
    for shape in [L1Shape::Exact, L1Shape::Smooth(0.01)] {
        let raster = CpuRasterizer::default();
        let params = RenderParams::default();
        let mut prepared = raster.prepare(&splats, &scene.camera).unwrap();
        let image = raster.forward(&mut prepared, &splats, &[], &params).unwrap().rgb;
        let mut upstream = UpstreamGrads::default();
        scene.loss(&image, shape, &mut upstream.v_rgb);
        let grads = raster.backward(&mut prepared, &splats, &[], &params, &upstream).unwrap();
        let largest = grads.v_sh.iter().flatten().fold(0.0_f64, |a, g| a.max(g.abs()));
        assert!(largest > 1e-4, "the loss depends on the colours: {largest}");

        let value = |k: usize, channel: usize, by: f64| {
            let mut moved = splats.clone();
            moved.sh[k][channel] += by;
            scene.loss(&render(&moved, &scene.camera), shape, &mut Vec::new())
        };
        let step = 1e-5;
        let mut worst = 0.0_f64;
        for k in 0..splats.sh.len() {
            for channel in 0..3 {
                let numeric = (value(k, channel, step) - value(k, channel, -step)) / (2.0 * step);
                worst = worst.max((grads.v_sh[k][channel] - numeric).abs());
            }
        }
        assert!(worst < 1e-5 * largest, "{shape:?}: off by {:e} of the largest", worst / largest);
        // negative control: a gradient of something else is rejected
        let other = scene.loss(&image, L1Shape::Smooth(0.3), &mut upstream.v_rgb);
        let grads = raster.backward(&mut prepared, &splats, &[], &params, &upstream).unwrap();
        let numeric = (value(0, 0, step) - value(0, 0, -step)) / (2.0 * step);
        let apart = (grads.v_sh[0][0] - numeric).abs();
        assert!(other > 0.0 && apart > 1e-4 * largest, "{apart}");
    }
}
