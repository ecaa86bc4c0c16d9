//! Very large counts: a dispatch folded into two dimensions, lists that fill a binding of the
//! default size completely, a million splats. Slow, so it runs only if `C4D_SLOW_TESTS` is set.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{Mode, camera, cloud, raster};
use gs_core::{Camera, Rasterizer, RenderParams, Splats};
use gs_raster_cpu::CpuRasterizer;

fn compare(splats: &Splats, camera: &Camera) {
    let params = RenderParams { background: [0.1, 0.2, 0.3], ..RenderParams::default() };
    let gpu = raster(Mode::Portable);
    let mut prepared = gpu.prepare(splats, camera).unwrap();
    let ours = gpu.forward(&mut prepared, splats, &[], &params).unwrap();
    let cpu = CpuRasterizer::default();
    let mut prepared = cpu.prepare(splats, camera).unwrap();
    let theirs = cpu.forward(&mut prepared, splats, &[], &params).unwrap();
    let off = ours.rgb.iter().zip(&theirs.rgb).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
    assert!(off * 1000 <= ours.rgb.len(), "{off} of {} values differ", ours.rgb.len());
}

#[test]
fn large_counts() {
    if std::env::var_os("C4D_SLOW_TESTS").is_none() {
        eprintln!("set C4D_SLOW_TESTS to run this");
        return;
    }
    // 16384 splats on all of 1024 tiles: 2^24 pairs of 8 bytes, which is 128 MiB and more than
    // 65535 groups of 256.
    let mut covering = cloud(20, 16_384, 0, 1.5);
    for (mean, logit) in covering.means.iter_mut().zip(&mut covering.opacity_logits) {
        *mean = [mean[0] * 0.1, mean[1] * 0.1, mean[2] + 2.0];
        *logit = -6.5 + 0.3 * *logit;
    }
    let view = camera(512, 512);
    let gpu = raster(Mode::Portable);
    let mut prepared = gpu.prepare(&covering, &view).unwrap();
    gpu.finish_preparation(&mut prepared).unwrap();
    assert_eq!(gpu.stages(&mut prepared).unwrap().num_rect_isects, 1 << 24, "pairs");
    compare(&covering, &view);
    covering.push_from(&covering.clone(), 0);
    let mut prepared = gpu.prepare(&covering, &view).unwrap();
    let error = gpu.finish_preparation(&mut prepared).unwrap_err().to_string();
    assert!(error.contains("16778240 (splat, tile) pairs"), "one splat more: {error}");

    compare(&cloud(21, 1_000_000, 1, -6.0), &camera(320, 240));
}
