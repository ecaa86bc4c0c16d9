//! Proves whole steps on the device against the same steps on the CPU: its rasteriser, `cuar`'s
//! objective and `cuar`'s Adam.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[path = "../../gs-raster-wgpu/tests/common/mod.rs"]
mod common;

use common::{MODES, Mode, cloud, noise, raster};
use cuar::loss::{LossWeights, Objective, Shape};
use gs_core::{
    Camera, RasterError, Rasterizer, RenderParams, Splats, UpstreamGrads, sh::num_coeffs,
};
use gs_raster_cpu::CpuRasterizer;
use gs_raster_wgpu::{GpuContext, GpuOptions, Group, WgpuRasterizer};
use gs_train_wgpu::{Rates, Targets, TrainOptions, Trainer, Weights};

const DEGREE: usize = 2;
const SIZE: [u32; 2] = [67, 45];
const COLORS: Rates = Rates {
    sh_dc: 0.02,
    sh_rest: 0.005,
    means: 0.0,
    quats: 0.0,
    log_scales: 0.0,
    opacity_logits: 0.0,
};

fn options(rates: Rates) -> TrainOptions {
    let LossWeights { eta, zeta } = LossWeights::default();
    let params = RenderParams { background: [0.2, 0.1, 0.3], depth: false, ..Default::default() };
    TrainOptions { weights: Weights::refinement(eta, zeta), rates, params }
}

/// Splats, and others whose renders are the targets.
fn scene() -> (Splats, Splats) {
    let splats = cloud(2, 400, DEGREE, -2.5);
    let mut truth = splats.clone();
    for (value, n) in truth.sh.as_flattened_mut().iter_mut().zip(noise(9, splats.sh.len() * 3)) {
        *value += 0.3 * n;
    }
    (splats, truth)
}

fn cameras() -> Vec<Camera> {
    [0.3, -0.5]
        .map(|x| {
            let eye = [x, 0.2, -4.0];
            Camera::look_at(eye, [0.0; 3], [0.0, 1.0, 0.1], 0.8, SIZE[0], SIZE[1])
        })
        .to_vec()
}

/// Warp, original, fore, back of one view.
struct View {
    camera: Camera,
    images: [Vec<f32>; 4],
}

fn views(splats: &Splats, truth: &Splats, params: &RenderParams) -> Vec<View> {
    let cpu = CpuRasterizer::default();
    cameras()
        .into_iter()
        .map(|camera| {
            let render = |splats: &Splats| {
                let mut prepared = cpu.prepare(splats, &camera).unwrap();
                cpu.forward(&mut prepared, splats, &[], params).unwrap().rgb
            };
            let pixels = (SIZE[0] * SIZE[1]) as usize;
            let fore: Vec<f32> = (0..pixels).map(|p| f32::from(u8::from(p % 67 < 40))).collect();
            let back = fore.iter().enumerate().map(|(p, m)| if p % 5 == 0 { 0.0 } else { 1.0 - m });
            let back = back.collect();
            // Not the splats' own render: L1 has a kink where both agree.
            let original =
                render(splats).into_iter().zip(noise(7, 3 * pixels)).map(|(x, n)| x + 0.2 * n);
            View { images: [render(truth), original.collect(), fore, back], camera }
        })
        .collect()
}

/// The same on the CPU: losses of every step, and where the splats end.
fn train_cpu(
    splats: &Splats,
    views: &[View],
    options: &TrainOptions,
    steps: usize,
    skip: impl Fn(usize) -> bool + Copy,
) -> (Vec<f64>, Splats) {
    let (cpu, mut splats, rates) = (CpuRasterizer::default(), splats.clone(), options.rates);
    let weights = LossWeights::default();
    let (width, height) = (SIZE[0] as usize, SIZE[1] as usize);
    let mut objective = Objective::<f32>::new(width, height, width * height, weights);
    let n = splats.len();
    let mut adams = [3, 4, 3, 1, 3 * num_coeffs(DEGREE)].map(|c| cuar::Adam::<f32>::new(n * c));
    let mut sh_rates = vec![rates.sh_rest; 3 * num_coeffs(DEGREE)];
    sh_rates[..3].fill(rates.sh_dc);
    let mut losses = Vec::new();
    for step in 0..steps {
        let View { camera, images: [warp, original, fore, back] } = &views[step % views.len()];
        let mut prepared = cpu.prepare(&splats, camera).unwrap();
        let render = cpu.forward(&mut prepared, &splats, &[], &options.params).unwrap();
        let targets = cuar::loss::Targets { original, warp, fore, back };
        let mut v_rgb = Vec::new();
        let parts = objective.evaluate(&render.rgb, &targets, Shape::Exact, &mut v_rgb, None);
        losses.push(parts.total(weights));
        let upstream = UpstreamGrads { v_rgb, ..Default::default() };
        let g = cpu.backward(&mut prepared, &splats, &[], &options.params, &upstream).unwrap();
        let [means, quats, scales, opacities, harmonics] = &mut adams;
        means.step(
            splats.means.as_flattened_mut(),
            g.v_means.as_flattened(),
            &[rates.means; 3],
            skip,
        );
        quats.step(
            splats.quats.as_flattened_mut(),
            g.v_quats.as_flattened(),
            &[rates.quats; 4],
            skip,
        );
        let v_scales = g.v_log_scales.as_flattened();
        scales.step(splats.log_scales.as_flattened_mut(), v_scales, &[rates.log_scales; 3], skip);
        opacities.step(
            &mut splats.opacity_logits,
            &g.v_opacity_logits,
            &[rates.opacity_logits],
            skip,
        );
        harmonics.step(splats.sh.as_flattened_mut(), g.v_sh.as_flattened(), &sh_rates, skip);
    }
    (losses, splats)
}

/// Losses of every step, and where the splats end.
fn train_gpu(
    raster: &WgpuRasterizer,
    splats: &Splats,
    views: &[View],
    options: &TrainOptions,
    steps: usize,
    skip: &[bool],
) -> Result<(Vec<f64>, Splats), RasterError> {
    let mut trainer = Trainer::new(raster.clone(), DEGREE, *options, skip)?;
    let mut first = raster.prepare(splats, &views[0].camera)?;
    raster.upload_appearance(&mut first, splats, &[], trainer.params())?;
    let mut prepared = Vec::new();
    for view in &views[1..] {
        prepared.push(raster.prepare_view(&mut first, &view.camera)?);
    }
    prepared.insert(0, first);
    let mut targets = Vec::new();
    for view in views {
        let mut own = Targets::default();
        own.upload(raster.context(), SIZE, view.images.each_ref().map(|image| &image[..]))?;
        targets.push(own);
    }
    let mut losses = Vec::new();
    for step in 0..steps {
        let view = step % views.len();
        trainer.step(&mut prepared[view], &targets[view])?;
        let own = trainer.losses()?;
        assert_eq!(own.steps, 1, "one step since the losses were read");
        losses.push(f64::from(own.total));
    }
    let mut out = splats.clone();
    // Any view will do: they share their parameters.
    raster.read_parameters(&prepared[views.len() - 1], &mut out)?;
    Ok((losses, out))
}

/// Mean absolute difference over the mean absolute way travelled.
fn deviation(a: &[f32], b: &[f32], start: &[f32]) -> f32 {
    let sum = |x: &[f32], y: &[f32]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).sum::<f32>();
    sum(a, b) / sum(b, start).max(1e-9)
}

#[test]
fn color_steps_are_those_of_the_cpu() {
    let (splats, truth) = scene();
    let options = options(COLORS);
    let views = views(&splats, &truth, &options.params);
    let skip: Vec<bool> = (0..splats.len()).map(|row| row % 4 == 1).collect();
    let (expected, end) = train_cpu(&splats, &views, &options, 12, |row| skip[row]);
    assert!(expected[10] < 0.9 * expected[0], "the steps lead down: {expected:?}");
    for mode in MODES {
        let raster = raster(mode);
        let (losses, got) = train_gpu(&raster, &splats, &views, &options, 12, &skip).unwrap();
        for (step, (a, b)) in losses.iter().zip(&expected).enumerate() {
            assert!((a - b).abs() < 2e-3 * b, "{mode:?}, step {step}: {a} {b}");
        }
        let (a, b, c) = (got.sh.as_flattened(), end.sh.as_flattened(), splats.sh.as_flattened());
        // Adam takes the sign of gradients that are almost zero: single values may differ, not
        // many.
        let apart = deviation(a, b, c);
        assert!(apart < 0.02, "{mode:?}: {apart}");
        let coeffs = splats.sh_coeffs();
        for row in (1..splats.len()).step_by(4) {
            let rows = row * coeffs..(row + 1) * coeffs;
            assert_eq!(got.sh[rows.clone()], splats.sh[rows], "{mode:?}: row {row} was to stay");
        }
        assert_eq!(got.means, splats.means, "{mode:?}: geometry stays");
        assert_eq!(got.opacity_logits, splats.opacity_logits, "{mode:?}: opacity stays");
    }
}

/// A wrong rate is noticed by the comparison above.
#[test]
fn other_rates_end_elsewhere() {
    let (splats, truth) = scene();
    let (own, other) = (options(COLORS), options(Rates { sh_dc: 0.021, ..COLORS }));
    let views = views(&splats, &truth, &own.params);
    let (_, end) = train_cpu(&splats, &views, &own, 12, |_| false);
    let raster = raster(Mode::Portable);
    let (_, got) = train_gpu(&raster, &splats, &views, &other, 12, &[]).unwrap();
    let (a, b, c) = (got.sh.as_flattened(), end.sh.as_flattened(), splats.sh.as_flattened());
    assert!(deviation(a, b, c) > 0.02, "a rate 5 % off is seen");
}

#[test]
fn steps_of_all_groups_are_those_of_the_cpu() {
    let (splats, mut truth) = scene();
    for (value, n) in truth.means.as_flattened_mut().iter_mut().zip(noise(8, 3 * splats.len())) {
        *value += 0.02 * n;
    }
    let options = options(Rates {
        means: 1e-3,
        quats: 2e-3,
        log_scales: 5e-3,
        opacity_logits: 0.02,
        ..COLORS
    });
    let views = views(&splats, &truth, &options.params);
    let (expected, end) = train_cpu(&splats, &views, &options, 6, |_| false);
    for mode in [Mode::Portable, Mode::Native] {
        let raster = raster(mode);
        let (losses, got) = train_gpu(&raster, &splats, &views, &options, 6, &[]).unwrap();
        for (step, (a, b)) in losses.iter().zip(&expected).enumerate() {
            assert!((a - b).abs() < 5e-3 * b, "{mode:?}, step {step}: {a} {b}");
        }
        for (what, a, b, c) in [
            (
                "means",
                got.means.as_flattened(),
                end.means.as_flattened(),
                splats.means.as_flattened(),
            ),
            (
                "quats",
                got.quats.as_flattened(),
                end.quats.as_flattened(),
                splats.quats.as_flattened(),
            ),
            (
                "scales",
                got.log_scales.as_flattened(),
                end.log_scales.as_flattened(),
                splats.log_scales.as_flattened(),
            ),
            ("opacities", &got.opacity_logits, &end.opacity_logits, &splats.opacity_logits),
            ("sh", got.sh.as_flattened(), end.sh.as_flattened(), splats.sh.as_flattened()),
        ] {
            let apart = deviation(a, b, c);
            assert!(apart < 0.05, "{mode:?}, {what}: {apart}");
        }
    }
}

/// Without losses being read, steps accumulate them; portable steps are the same from run to run.
#[test]
fn losses_are_read_occasionally_and_steps_repeat() {
    let (splats, truth) = scene();
    let options = options(COLORS);
    let views = views(&splats, &truth, &options.params);
    let raster = raster(Mode::Portable);
    let run = || {
        let mut trainer = Trainer::new(raster.clone(), DEGREE, options, &[]).unwrap();
        let mut prepared = raster.prepare(&splats, &views[0].camera).unwrap();
        raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
        let mut targets = Targets::default();
        let images = views[0].images.each_ref().map(|image| &image[..]);
        targets.upload(raster.context(), SIZE, images).unwrap();
        for _ in 0..5 {
            trainer.step(&mut prepared, &targets).unwrap();
        }
        let mut out = splats.clone();
        raster.read_parameters(&prepared, &mut out).unwrap();
        assert_eq!(trainer.optimizer(Group::Sh).unwrap().step, 5, "steps of the optimiser");
        assert!(trainer.optimizer(Group::Means).is_none(), "not trained");
        (trainer.losses().unwrap(), out)
    };
    let (losses, out) = run();
    assert_eq!(losses.steps, 5, "five steps");
    let (expected, _) = train_cpu(&splats, &views[..1], &options, 5, |_| false);
    let mean = expected.iter().sum::<f64>() / 5.0;
    assert!((f64::from(losses.total) - mean).abs() < 1e-3 * mean, "{} {mean}", losses.total);
    assert_eq!((losses, out), run(), "run to run");
}

/// Harmonics, their gradients and moments larger than a binding are split; nothing changes.
#[test]
fn splitting_changes_nothing() {
    let (size, options) = ([48, 40], options(COLORS));
    let splats = cloud(12, 1_500, 3, -3.0);
    let camera = Camera::look_at([0.3, 0.2, -4.0], [0.0; 3], [0.0, 1.0, 0.1], 0.8, 48, 40);
    let pixels = 48 * 40;
    let (warp, fore) = (vec![0.5; 3 * pixels], vec![1.0; pixels]);
    let end = |raster: &WgpuRasterizer| {
        let mut trainer = Trainer::new(raster.clone(), 3, options, &[]).unwrap();
        let mut prepared = raster.prepare(&splats, &camera).unwrap();
        raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
        let mut targets = Targets::default();
        targets.upload(raster.context(), size, [&warp, &[], &fore, &[]]).unwrap();
        for _ in 0..3 {
            trainer.step(&mut prepared, &targets).unwrap();
        }
        let mut out = splats.clone();
        raster.read_parameters(&prepared, &mut out).unwrap();
        (out, trainer.losses().unwrap())
    };
    let max_binding_bytes = Some(128 << 10);
    assert!(12 * splats.sh.len() > 2 * (128 << 10), "three bindings");
    let gpu = GpuOptions { portable: true, max_binding_bytes, ..GpuOptions::default() };
    let split = WgpuRasterizer::new(GpuContext::with_options(common::choice(), gpu).unwrap());
    let whole = end(&raster(Mode::Portable));
    assert_eq!(whole, end(&split), "split");
    assert_ne!(whole.0.sh, splats.sh, "it moves");
}

/// A million splats of degree 3 have 192 MB of harmonics, more than a default binding of 128 MiB.
/// Slow.
#[test]
fn a_million_splats_fit_default_limits() {
    if std::env::var_os("C4D_SLOW_TESTS").is_none() {
        eprintln!("set C4D_SLOW_TESTS to run this");
        return;
    }
    let options = options(COLORS);
    let splats = cloud(13, 1_000_000, 3, -6.0);
    let views = views(&splats, &splats, &options.params);
    let raster = raster(Mode::Portable);
    assert_eq!(raster.context().max_binding_bytes(), 128 << 20, "default limits");
    let mut trainer = Trainer::new(raster.clone(), 3, options, &[]).unwrap();
    let mut prepared = raster.prepare(&splats, &views[0].camera).unwrap();
    raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
    let mut targets = Targets::default();
    let images = views[0].images.each_ref().map(|image| &image[..]);
    targets.upload(raster.context(), SIZE, images).unwrap();
    for _ in 0..2 {
        trainer.step(&mut prepared, &targets).unwrap();
    }
    let mut out = splats.clone();
    raster.read_parameters(&prepared, &mut out).unwrap();
    let moved = |half: std::ops::Range<usize>| half.filter(|&k| out.sh[k] != splats.sh[k]).count();
    let middle = splats.sh.len() / 2;
    assert!(moved(0..middle) > 1000, "the first binding is trained");
    assert!(moved(middle..2 * middle) > 1000, "the second, too");
}

/// An upload to one view does not change what the others look at.
#[test]
fn views_share_parameters_until_one_is_given_others() {
    let (splats, truth) = scene();
    let raster = raster(Mode::Portable);
    let params = RenderParams { depth: false, ..RenderParams::default() };
    let cameras = cameras();
    let mut first = raster.prepare(&splats, &cameras[0]).unwrap();
    let own = raster.forward(&mut first, &splats, &[], &params).unwrap();
    let mut second = raster.prepare_view(&mut first, &cameras[0]).unwrap();
    let mut out = gs_core::RenderOutput::default();
    raster.forward_resident_into(&mut second, &params, &mut out).unwrap();
    assert_eq!(own, out, "the same splats, nothing uploaded");
    raster.forward(&mut first, &truth, &[], &params).unwrap();
    raster.forward_resident_into(&mut second, &params, &mut out).unwrap();
    assert_eq!(own, out, "what the first was given later is its own");
}

#[test]
fn what_does_not_fit_is_refused() {
    let (splats, truth) = scene();
    let options = options(COLORS);
    let views = views(&splats, &truth, &options.params);
    let raster = raster(Mode::Portable);
    let mut trainer = Trainer::new(raster.clone(), DEGREE, options, &[false; 3]).unwrap();
    let mut prepared = raster.prepare(&splats, &views[0].camera).unwrap();
    let images = views[0].images.each_ref().map(|image| &image[..]);
    let mut targets = Targets::default();
    let step = |trainer: &mut Trainer, prepared: &mut _, targets: &Targets| {
        trainer.step(prepared, targets).unwrap_err().to_string()
    };
    let message = step(&mut trainer, &mut prepared, &targets);
    assert!(message.contains("width of the targets"), "no targets: {message}");
    let short = targets.upload(raster.context(), SIZE, [images[0], images[1], &[1.0], images[3]]);
    assert!(short.unwrap_err().to_string().contains("`fore`"), "a short mask");
    targets.upload(raster.context(), SIZE, images).unwrap();
    let message = step(&mut trainer, &mut prepared, &targets);
    assert!(message.contains("`skip` has 3 values, expected 400"), "{message}");
    let mut trainer = Trainer::new(raster.clone(), DEGREE, options, &[]).unwrap();
    let message = step(&mut trainer, &mut prepared, &targets);
    assert!(message.contains("without a preceding forward"), "no colours: {message}");
    let mut trainer = Trainer::new(raster.clone(), 1, options, &[]).unwrap();
    raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
    let message = step(&mut trainer, &mut prepared, &targets);
    assert!(message.contains("`parameters`"), "another degree: {message}");
    // Nothing visible, and no splats at all: losses of the background alone.
    for splats in [cloud(1, 3, DEGREE, -3.0), Splats::with_capacity(0, DEGREE)] {
        let away = Camera::look_at(
            [0.0, 0.0, -9.0],
            [0.0, 0.0, -18.0],
            [0.0, 1.0, 0.0],
            0.8,
            SIZE[0],
            SIZE[1],
        );
        let mut trainer = Trainer::new(raster.clone(), DEGREE, options, &[]).unwrap();
        let mut prepared = raster.prepare(&splats, &away).unwrap();
        raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
        trainer.step(&mut prepared, &targets).unwrap();
        assert!(trainer.losses().unwrap().total > 0.0, "{} splats", splats.len());
        let mut out = splats.clone();
        raster.read_parameters(&prepared, &mut out).unwrap();
        assert_eq!(out, splats, "no gradient, no step");
    }
}
