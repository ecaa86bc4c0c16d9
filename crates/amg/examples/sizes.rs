//! Seconds, memory and end-point error of the motion stage on a scene with known motion:
//! `cargo run --release -p amg --example sizes -- CASE SPLATS METHOD [FRAMES [EDITED]]`, with the
//! number of source splats, `regions`, `knn` or `paper`, the number of frames evaluated (default 3)
//! and the number of edited splats. If EDITED is given, edited splats are omitted, or repeated with
//! a small offset, and there is no end-point error.

use amg::{MotionOptions, MotionPreset, propagate};
use gs_core::{DynamicScene, Splats};
use gs_synth::{TruthCase, TruthScene, motion_error};
use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize, default: &str| words.get(i).map_or(default, String::as_str).to_owned();
    let case: TruthCase = word(0, "clothing").parse()?;
    let size: usize = word(1, "2000").parse()?;
    let preset = match word(2, "regions").as_str() {
        "regions" => MotionPreset::Regions,
        "knn" => MotionPreset::Knn,
        "paper" => MotionPreset::Paper,
        other => {
            return Err(format!("unknown method `{other}`; expected regions, knn or paper").into());
        }
    };
    let scene = gs_synth::build(case, 0, size)?;
    let num_frames: usize = word(3, "3").parse()?;
    let asked = words.get(4).map(|n| n.parse::<usize>()).transpose()?;
    let splats = asked.map_or_else(|| scene.edited.splats.clone(), |n| resized(&scene, n));
    let (num_source, num_edited) = (scene.source.num_splats(), splats.len());
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source);
    let edited = Arc::new(splats);
    let before = peak_mib();

    let start = Instant::now();
    let found = propagate(source, edited, &MotionOptions::preset(preset), &|_, _| {})?;
    let estimated = start.elapsed().as_secs_f64();
    let mut frame = Splats::default();
    for i in 1..=num_frames {
        found.scene.geometry_into(i as f32 / num_frames as f32, &mut frame)?;
    }
    let seconds = start.elapsed().as_secs_f64();

    let after = peak_mib();
    let error = if asked.is_some() {
        String::new()
    } else {
        let error = motion_error(&found.scene, &scene.edited.truth, &[0.25, 0.5, 0.75, 1.0])?;
        format!(", EPE {:.3} %, p95 {:.2} %", error.epe, error.p95)
    };
    let mib = |peak: Option<u64>| peak.map_or_else(|| "unknown".to_owned(), |mib| mib.to_string());
    let (before, after) = (mib(before), mib(after));
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{case:?} {preset:?}: {num_source} -> {num_edited} splats, {num_frames} frames: \
         {estimated:.2} s and {:.2} s for the frames, peak {after} MiB ({before} of them for the \
         scene){error}",
        seconds - estimated
    )?;
    for (step, seconds) in &found.report.timings {
        writeln!(out, "  {step}: {seconds:.3} s")?;
    }
    Ok(())
}

/// `count` edited splats: the original ones, then copies displaced by a thousandth of the figure.
fn resized(scene: &TruthScene, count: usize) -> Splats {
    let edited = &scene.edited.splats;
    let rows: Vec<usize> = (0..count).map(|i| i % edited.len()).collect();
    let mut splats = edited.select(&rows);
    for mean in splats.means.iter_mut().skip(edited.len()) {
        mean[0] += 1e-3 * scene.figure_size;
    }
    splats
}

/// Peak resident memory, if the system reports it.
fn peak_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib / 1024)
}
