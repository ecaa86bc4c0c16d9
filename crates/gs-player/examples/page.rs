//! Writes a page of the synthetic dancer before and after its edit, and prints its contents and
//! size.
//!
//! ```text
//! cargo run --release --example page -- dancer.html 100000 60
//! ```

#![expect(clippy::print_stdout, reason = "an example that prints its measurements")]

use gs_core::{Camera, DynamicScene};
use gs_player::{EncodeOptions, Page, PageScenes, encode, page};
use gs_synth::{DemoParams, apply_edits, demo, demo_edits};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let output = arguments.next().unwrap_or_else(|| "dancer.html".to_owned());
    let num_splats = arguments.next().map_or(Ok(5_000), |text| text.parse())?;
    let frames = arguments.next().map_or(Ok(24), |text| text.parse())?;
    let sh_degree = arguments.next().map_or(Ok(1), |text| text.parse())?;

    let original = demo(&DemoParams { num_splats, ..DemoParams::default() })?;
    let edited = apply_edits(&original, &demo_edits(), 7)?.truth;
    let times = original.time_range().frames(frames);
    let begun = Instant::now();
    let options = EncodeOptions { sh_degree, ..EncodeOptions::default() };
    let encoded = encode(&original, Some(&edited), &times, &options, &mut |_, _| {})?;
    let camera = Camera::look_at([0.0, 1.4, 4.2], [0.0, 0.9, 0.0], [0.0, 1.0, 0.0], 0.7, 960, 720);
    let text = page(
        &[PageScenes { encoded: &encoded, names: ["Original", "Edited"] }],
        &Page {
            title: "Dancer",
            fps: 30.0,
            camera: &camera,
            target: [0.0, 0.9, 0.0],
            up: [0.0, 1.0, 0.0],
            limits: None,
            background: [0.0; 3],
            poster: None,
        },
    )?;
    std::fs::write(&output, &text)?;
    let report = &encoded.report;
    println!(
        "{} frames of {} and {} splats: {} in both scenes, {} more with the same motion, {} move",
        report.frames,
        report.first,
        report.second,
        report.shared,
        report.same_motion,
        report.moving
    );
    let (still, moving) = report.position_error;
    println!("largest error of a coordinate: {still:.2e} of static splats, {moving:.2e} of moving");
    let megabytes = |bytes: usize| bytes as f64 / 1e6;
    println!(
        "payload: {:.3} MB, compressed {:.3} MB; page: {:.3} MB",
        megabytes(report.bytes.0),
        megabytes(report.bytes.1),
        megabytes(text.len())
    );
    println!("{:.2} s", begun.elapsed().as_secs_f64());
    Ok(())
}
