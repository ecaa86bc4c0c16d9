//! Times the whole stage on a scene of the paper's size: 150 000 Gaussians, 30 000 of them edited, 20 views, 60 times, 676×507.
//!
//! `cargo run --release -p cuar --example paper_scale [samples] [memory in MiB]`
#![expect(clippy::print_stdout, reason = "a measurement for people")]

use cuar::{NoObserver, RefineOptions, Views, refine};
use gs_core::{Camera, DynamicScene, SceneError, Splats, TimeRange};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, Part, SynthScene, demo};
use std::error::Error;
use std::time::Instant;

/// A scene whose edited splats have degree-2 and -3 colours that nothing ever supervised.
#[derive(Debug)]
struct Unsupervised {
    scene: SynthScene,
    sh: Vec<[f32; 3]>,
}

impl Unsupervised {
    fn new(scene: SynthScene, edited: &[bool]) -> Self {
        let mut sh = scene.frame1().sh.clone();
        let coeffs = scene.frame1().sh_coeffs();
        let mut random = 1_u32;
        for (own, _) in sh.chunks_exact_mut(coeffs).zip(edited).filter(|(_, edited)| **edited) {
            for value in own[4..].as_flattened_mut() {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *value += (random >> 8) as f32 / (1_u32 << 24) as f32 - 0.5;
            }
        }
        Self { scene, sh }
    }
}

impl DynamicScene for Unsupervised {
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
        out.sh.clone_from(&self.sh);
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (samples, memory) = (number(240)?, number(2048)? << 20);

    let params = DemoParams { num_splats: 150_000, sh_degree: 3, ..DemoParams::default() };
    let scene = demo(&params)?;
    // as many of the upper body's splats as the paper's edits have
    let mut left = 30_000;
    let upper = |part: Part| {
        !matches!(part, Part::ThighL | Part::ThighR | Part::ShinL | Part::ShinR)
            && Part::FIGURE.contains(&part)
    };
    let edited: Vec<bool> = scene
        .rows()
        .iter()
        .map(|row| {
            let take = upper(row.part) && left > 0;
            left -= usize::from(take);
            take
        })
        .collect();
    let scene = Unsupervised::new(scene, &edited);
    let cameras: Vec<Camera> = (0..21)
        .map(|k| {
            let (sin, cos) = (f64::from(k - 10) * 0.08).sin_cos();
            let eye = [4.4 * sin, 1.6, 4.4 * cos];
            Camera::look_at(eye, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], 0.5, 676, 507)
        })
        .collect();
    let times = TimeRange::UNIT.frames(60);
    let views = Views { cameras: &cameras, times: &times, held_out: &[10] };
    let options = RefineOptions { samples, memory, ..RefineOptions::default() };
    let begun = Instant::now();
    let refined =
        refine(&CpuRasterizer::default(), &scene, &edited, &views, &options, None, &mut NoObserver)?;
    let report = &refined.report;
    println!(
        "{} splats, {} edited, {} seen; {} images, {} kept prepared, {} MiB",
        scene.num_splats(),
        report.num_edited,
        report.num_visible,
        report.samples.len(),
        report.num_cached,
        report.bytes >> 20
    );
    println!("whole stage {:.1} s", begun.elapsed().as_secs_f64());
    for (part, secs) in &report.timings {
        println!("  {part:<9} {secs:7.1} s");
    }
    println!("loss {:.6} → {:.6}", report.loss_before, report.loss_after);
    println!("held-out loss {:.6} → {:.6}", report.held_out_before, report.held_out_after);
    for warning in &report.warnings {
        println!("note: {warning}");
    }
    Ok(())
}
