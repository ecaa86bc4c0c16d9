//! Times the whole stage on a scene of the paper's size: 150 000 Gaussians, about 26 000 of them
//! edited, 20 views, 60 times, 676×507.
//!
//! `cargo run --release --example paper_scale [samples] [memory in MiB] [flaws|flawless] [both|view]`;
//! `view` omits the evidence: only view dependence, as in the paper.
#![expect(clippy::print_stdout, reason = "prints its results")]

#[path = "../tests/suite/common/mod.rs"]
mod common;

use common::{Flaws, case, flicker, psnr};
use cuar::{
    Backend, BeforeEdit, NoRefineObserver, RefineOptions, RefinePreset, Views, refine_edit,
};
use gs_core::{DynamicScene, TimeRange};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, demo};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (samples, memory) = (number(RefineOptions::default().samples)?, number(2048)? << 20);

    let flaws = match std::env::args().nth(3).as_deref() {
        // colours that frame 1 shows are correct by definition: their noise must not change
        Some("flawless") => Flaws { interior: false, unseen_sh: 0.0, noise: 0.1 },
        _ => Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 },
    };
    let case = case(150_000, 3, 20, (676, 507), flaws);
    let times = TimeRange::UNIT.frames(60);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    let mut options = RefineOptions { samples, memory, ..RefineOptions::default() };
    if std::env::args().nth(4).as_deref() == Some("view") {
        options.evidence = RefineOptions::preset(RefinePreset::Paper).evidence;
    }
    let raster = CpuRasterizer::default();
    let source = demo(&DemoParams { num_splats: 150_000, sh_degree: 3, ..DemoParams::default() })?;
    let before = BeforeEdit { scene: &source, source_rows: &case.truth.source_rows };
    let backend = Backend { raster: &raster, descent: None };
    let (begun, worked) = (Instant::now(), processor_secs());
    let none = &mut NoRefineObserver;
    let refined =
        refine_edit(backend, &case.scene, &before, &case.edited, &views, &options, None, none)?;
    let (secs, worked) = (begun.elapsed().as_secs_f64(), processor_secs() - worked);
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
    println!("whole stage {secs:.1} s, processor {worked:.1} s");
    println!("{:?}", report.repair);
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
    let scene = refined.scene(&case.scene);
    let after = psnr(&scene, &case, &case.held_out, &times);
    println!("held-out PSNR inside the mask {:.2} → {:.2} dB", before[0], after[0]);
    println!("held-out PSNR outside the mask {:.3} → {:.3} dB", before[1], after[1]);
    let clip = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
    let [shaky, calm, truth] = [&case.scene as &dyn DynamicScene, &scene, &case.truth]
        .map(|scene| flicker(scene, &case, &case.held_out[..1], &clip));
    println!("held-out flicker {shaky:.2} → {calm:.2} levels, truth {truth:.2}");
    Ok(())
}

/// Processor time of this process so far, seconds; 0 if the system does not report it.
fn processor_secs() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // fields 14 and 15, in hundredths; the second field is a name with any characters
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}
