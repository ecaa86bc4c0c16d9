//! Times the whole stage on a scene of the paper's size: 150 000 Gaussians, some 26 000 of them edited, 20 views, 60 times, 676×507.
//!
//! `cargo run --release -p cuar --example paper_scale [samples] [memory in MiB]`
#![expect(clippy::print_stdout, reason = "a measurement for people")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Flaws, case, psnr};
use cuar::{NoObserver, RefineOptions, Views, refine};
use gs_core::{DynamicScene, TimeRange};
use gs_raster_cpu::CpuRasterizer;
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (samples, memory) = (number(240)?, number(2048)? << 20);

    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    let case = case(150_000, 3, 20, (676, 507), flaws);
    let times = TimeRange::UNIT.frames(60);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    let options = RefineOptions { samples, memory, ..RefineOptions::default() };
    let raster = CpuRasterizer::default();
    let begun = Instant::now();
    let refined =
        refine(&raster, &case.scene, &case.edited, &views, &options, None, &mut NoObserver)?;
    let secs = begun.elapsed().as_secs_f64();
    let report = &refined.report;
    println!(
        "{} splats, {} edited, {} seen; {} images, {} kept prepared, {} MiB",
        case.scene.num_splats(),
        report.num_edited,
        report.num_visible,
        report.samples.len(),
        report.num_cached,
        report.bytes >> 20
    );
    println!("whole stage {secs:.1} s");
    for (part, secs) in &report.timings {
        println!("  {part:<9} {secs:7.1} s");
    }
    println!("loss {:.6} → {:.6}", report.loss_before, report.loss_after);
    println!("held-out loss {:.6} → {:.6}", report.held_out_before, report.held_out_after);
    for warning in &report.warnings {
        println!("note: {warning}");
    }
    let times = [0.13, 0.37, 0.61];
    let before = psnr(&case.scene, &case, &case.held_out, &times);
    let after = psnr(&refined.scene(&case.scene), &case, &case.held_out, &times);
    println!("held-out PSNR inside the mask {:.2} → {:.2} dB", before[0], after[0]);
    println!("held-out PSNR outside the mask {:.2} → {:.2} dB", before[1], after[1]);
    Ok(())
}
