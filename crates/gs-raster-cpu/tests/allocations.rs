//! A frame allocates nothing once the buffers have grown. Uses one thread, so that the counter
//! covers all work and no thread-pool queues.

#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use gs_core::{Camera, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads};
use gs_raster_cpu::CpuRasterizer;

fn splats(count: usize) -> Splats {
    let phase = |i: usize, k: usize| ((i * 37 + k * 101) % 89) as f32 / 44.0 - 1.0;
    Splats {
        means: (0..count).map(|i| [0, 1, 2].map(|k| phase(i, k))).collect(),
        quats: (0..count).map(|i| [3, 4, 5, 6].map(|k| phase(i, k))).collect(),
        log_scales: (0..count).map(|i| [7, 8, 9].map(|k| phase(i, k) - 3.0)).collect(),
        opacity_logits: (0..count).map(|i| 3.0 * phase(i, 10)).collect(),
        sh: (0..4 * count).map(|i| [11, 12, 13].map(|k| phase(i, k))).collect(),
        sh_degree: 1,
    }
}

#[test]
fn frames_allocate_nothing() {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    let splats = splats(5000);
    let features = vec![0.5_f32; 2 * splats.len()];
    let params = RenderParams::default();
    let raster = CpuRasterizer::default();
    let look = |x: f64| Camera::look_at([x, 0.1, -4.0], [0.0; 3], [0.0, -1.0, 0.0], 0.8, 200, 120);
    let (mut out, mut grads) = (RenderOutput::default(), RenderGrads::default());
    let mut prepared = raster.prepare(&splats, &look(0.2)).unwrap();
    let upstream = UpstreamGrads {
        v_rgb: vec![0.1; 200 * 120 * 3],
        v_features: vec![0.1; 200 * 120 * 2],
        ..UpstreamGrads::default()
    };
    let mut frame = |camera: &Camera| {
        raster.prepare_into(&splats, camera, &mut prepared).unwrap();
        raster.forward_into(&mut prepared, &splats, &features, &params, &mut out).unwrap();
        for colors in [false, true] {
            let arguments = (&splats, &features[..], &params, &upstream);
            let (splats, features, params, upstream) = arguments;
            if colors {
                raster
                    .backward_colors_into(
                        &mut prepared,
                        splats,
                        features,
                        params,
                        upstream,
                        &mut grads,
                    )
                    .unwrap();
            } else {
                raster
                    .backward_into(&mut prepared, splats, features, params, upstream, &mut grads)
                    .unwrap();
            }
        }
    };
    let cameras = [look(0.2), look(-0.3), look(0.2)];
    let first = allocation_counter::measure(|| frame(&cameras[0]));
    let is_large = first.count_total > 20 && first.bytes_total > 1 << 20;
    assert!(is_large, "control: the first frame does allocate, {first:?}");
    for camera in &cameras[1..] {
        frame(camera);
    }
    for camera in &cameras {
        let later = allocation_counter::measure(|| frame(camera));
        assert_eq!(later.count_total, 0, "a frame of sizes seen before: {later:?}");
    }
}
