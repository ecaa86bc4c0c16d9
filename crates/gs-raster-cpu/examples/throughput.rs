//! Evaluated pixel–splat samples per second and core, and their fraction of the roofline, on
//! realistic scenes. The fractions compare the best times of interleaved runs, so that load from
//! other programs affects both alike.
//!
//! `cargo run --release --example throughput [SCENE_INDEX]`
#![expect(clippy::print_stdout, reason = "an example reports to the terminal")]

use gs_core::{Rasterizer, RenderGrads, RenderOutput, RenderParams, UpstreamGrads};
use gs_raster_cpu::CpuRasterizer;
use std::hint::black_box;
use std::time::Instant;

#[path = "../benches/common/roofline.rs"]
mod roofline;
#[path = "../benches/common/scene.rs"]
mod scene;

const STAGES: [&str; 5] = ["roof", "prepare", "forward", "backward", "backward_colors"];

/// Stages of preparation, forward pass and backward pass.
const SPLIT: [&str; 9] = [
    "project",
    "sort",
    "bin",
    "shade",
    "composite",
    "assemble",
    "differentiate",
    "collect",
    "chain",
];

fn main() -> Result<(), gs_core::RasterError> {
    let only: Option<usize> = std::env::args().nth(1).and_then(|index| index.parse().ok());
    let cores = rayon::current_num_threads() as f64;
    for (index, (count, width, height)) in scene::SIZES.into_iter().enumerate() {
        if only.is_some_and(|only| only != index) {
            continue;
        }
        let splats = scene::splats(count, 1);
        let camera = scene::camera(width, height);
        let pixels = (width * height) as usize;
        let raster = CpuRasterizer::default();
        let params = RenderParams::default();
        let upstream =
            UpstreamGrads { v_rgb: scene::upstream(3 * pixels), ..UpstreamGrads::default() };
        let (mut out, mut grads) = (RenderOutput::default(), RenderGrads::default());
        let mut prepared = raster.prepare(&splats, &camera)?;
        let mut best = [f64::INFINITY; 5];
        let mut split = [f64::INFINITY; 9];
        for _ in 0..if count > 500_000 { 4 } else { 12 } {
            for (stage, best) in best.iter_mut().enumerate() {
                let start = Instant::now();
                match stage {
                    0 => _ = black_box(roofline::run()),
                    1 => raster.prepare_into(&splats, &camera, &mut prepared)?,
                    2 => raster.forward_into(&mut prepared, &splats, &[], &params, &mut out)?,
                    3 => raster.backward_into(
                        &mut prepared,
                        &splats,
                        &[],
                        &params,
                        &upstream,
                        &mut grads,
                    )?,
                    _ => raster.backward_colors_into(
                        &mut prepared,
                        &splats,
                        &[],
                        &params,
                        &upstream,
                        &mut grads,
                    )?,
                }
                *best = best.min(start.elapsed().as_secs_f64());
                if stage == 3 {
                    // Read before the colours-only pass overwrites some of them.
                    let t = prepared.stage_times();
                    let now = [
                        t.project,
                        t.sort,
                        t.bin,
                        t.shade,
                        t.composite,
                        t.assemble,
                        t.differentiate,
                        t.collect,
                        t.chain,
                    ];
                    for (split, now) in split.iter_mut().zip(now) {
                        *split = split.min(now);
                    }
                }
            }
        }
        let evaluated = prepared.num_evaluated() as f64;
        println!(
            "{count} splats, {width}x{height}: {} visible, {} of {} list entries, {:.0} samples per pixel",
            prepared.num_visible(),
            prepared.num_isects(),
            prepared.num_rect_isects(),
            evaluated / pixels as f64
        );
        let roof = roofline::SAMPLES as f64 / best[0];
        println!("  {:16} {:8.2} G samples/s on one core", STAGES[0], roof * 1e-9);
        for (stage, best) in STAGES.iter().zip(best).skip(1) {
            let rate = evaluated / best / cores;
            println!(
                "  {stage:16} {:8.2} ms  {:6.2} G samples/s and core, {:4.0} % of the roofline",
                best * 1e3,
                rate * 1e-9,
                100.0 * rate / roof
            );
        }
        for (name, seconds) in SPLIT.iter().zip(split) {
            let rate = evaluated / seconds / cores;
            let loops = matches!(*name, "composite" | "differentiate");
            let share = if loops {
                format!("{:4.0} % of the roofline", 100.0 * rate / roof)
            } else {
                String::new()
            };
            println!("    {name:14} {:8.2} ms  {share}", seconds * 1e3);
        }
    }
    Ok(())
}
