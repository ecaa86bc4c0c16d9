//! Seconds, memory and end-point error of the whole stage (estimate, then three frames) on a scene
//! with known motion: `cargo run --release -p amg --example sizes -- clothing 20000 best`. A
//! further number is how many edited splats there shall be: some are left out, or follow once more
//! a little beside; then there is no end-point error.

use amg::{MotionOptions, Preset, propagate};
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
    let preset = match word(2, "best").as_str() {
        "best" => Preset::Regions,
        "knn" => Preset::Knn,
        "paper" => Preset::Paper,
        other => return Err(format!("no preset `{other}`; there are best, knn and paper").into()),
    };
    let scene = gs_synth::build(case, 0, size)?;
    let asked = words.get(3).map(|n| n.parse::<usize>()).transpose()?;
    let splats = asked.map_or_else(|| scene.edited.splats.clone(), |n| resized(&scene, n));
    let (num_source, num_edited) = (scene.source.num_splats(), splats.len());
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source);
    let edited = Arc::new(splats);
    let before = peak_mib();

    let start = Instant::now();
    let found = propagate(source, edited, &MotionOptions::preset(preset), &|_, _| {})?;
    let mut frame = Splats::default();
    for t in [1.0 / 3.0, 2.0 / 3.0, 1.0] {
        found.scene.geometry_into(t, &mut frame)?;
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
        "{case:?} {preset:?}: {num_source} -> {num_edited} splats, {seconds:.2} s, peak {after} MiB ({before} of them \
         for the scene){error}"
    )?;
    for (step, seconds) in &found.report.timings {
        writeln!(out, "  {step}: {seconds:.3} s")?;
    }
    Ok(())
}

/// `count` edited splats: the first of them, then copies a thousandth of the figure beside.
fn resized(scene: &TruthScene, count: usize) -> Splats {
    let edited = &scene.edited.splats;
    let rows: Vec<usize> = (0..count).map(|i| i % edited.len()).collect();
    let mut splats = edited.select(&rows);
    for mean in splats.means.iter_mut().skip(edited.len()) {
        mean[0] += 1e-3 * scene.figure_size;
    }
    splats
}

/// Largest resident memory so far, where the system tells.
fn peak_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib / 1024)
}
