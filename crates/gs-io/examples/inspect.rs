//! Prints the kind of a scene and the positions of its Gaussians over
//! time: `cargo run --example inspect -- PATH`.

use std::path::Path;

use gs_core::{DynamicScene, Splats};
use gs_io::{OpenOptions, open_scene};
use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: inspect <PATH>")?;
    let opened = open_scene(Path::new(&path), &OpenOptions::default())?;
    let scene: &dyn DynamicScene = &*opened.scene;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{path}: {}", opened.kind)?;
    writeln!(out, "  {} Gaussians, SH degree {}", scene.num_splats(), scene.sh_degree())?;
    match scene.num_frames() {
        Some(frames) => writeln!(out, "  {frames} frames")?,
        None => writeln!(out, "  continuous in time")?,
    }
    if let Some(report) = &opened.report {
        writeln!(out, "  iteration {}, heads {}", report.iteration, report.heads.join(", "))?;
        for flag in &report.flags {
            writeln!(out, "  {} = {} ({:?})", flag.name, flag.value, flag.origin)?;
        }
    }
    let mut splats = Splats::default();
    for t in [0.0, 0.5, 1.0] {
        scene.at_into(t, &mut splats)?;
        let count = splats.len() as f64;
        let mean: [f64; 3] = std::array::from_fn(|axis| {
            splats.means.iter().map(|mean| f64::from(mean[axis])).sum::<f64>() / count
        });
        writeln!(out, "  t = {t}: mean centre {mean:.5?}, first {:.5?}", splats.means[0])?;
    }
    for warning in opened.warnings.iter().chain(&opened.notes) {
        writeln!(out, "  note: {warning}")?;
    }
    Ok(())
}
