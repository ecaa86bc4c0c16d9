//! Effect of the evidence if an image editor missed splats that frame 1 hides: PSNR against the
//! true edit at held-out views, in pixels that motion reveals and elsewhere, inside the paper's
//! mask and outside it; also checks the limits of `tests/suite/common/limits.rs`.
//!
//! `cargo run --release --example hidden_splats [brief | cases | large | ablation | picture FILE]`;
//! `brief` has fewer splats, `picture` draws a crop before and after.
#![expect(clippy::print_stdout, reason = "prints its results")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "colours of 8 bits, and pixels inside the image"
)]

#[path = "../tests/suite/common/mod.rs"]
mod common;

use common::delivered::{Judge, cases, delivered, rings, with_unseen_sh, wrong_rows};
use common::limits;
use cuar::{
    AdamParams, Evidence, EvidenceParams, RefineOptions, RefinePreset, Repair, Solver, WarpForm,
};
use gs_core::DynamicScene;
use gs_raster_cpu::CpuRasterizer;
use gs_synth::UnseenColor;
use std::error::Error;
use std::time::Instant;

const EVAL: [f32; 4] = [0.2, 0.4, 0.6, 0.8];

fn main() -> Result<(), Box<dyn Error>> {
    let mode = std::env::args().nth(1).unwrap_or_else(|| "cases".to_owned());
    match mode.as_str() {
        "brief" => table(4_000, (120, 120)),
        "cases" => table(12_000, (240, 240)),
        "large" => table(60_000, (480, 480)),
        "ablation" => ablation(),
        "picture" => picture(&std::env::args().nth(2).ok_or("picture FILE")?),
        other => Err(format!("{other}: expected brief, cases, large, ablation or picture").into()),
    }
}

/// Every case: the true edit, and edits delivered with old, black and random colours on hidden
/// splats.
fn table(num_splats: usize, size: (u32, u32)) -> Result<(), Box<dyn Error>> {
    let raster = CpuRasterizer::default();
    println!("{num_splats} splats; PSNR, dB, before → after");
    let (mut broken, mut gains) = (Vec::new(), Vec::new());
    for (name, edits) in cases() {
        let case = delivered(name, &edits, num_splats, 1, |scene| rings(scene, size));
        let forms = [
            ("perfect", case.perfect()),
            ("old", case.with_unseen(UnseenColor::Source)),
            ("black", case.with_unseen(UnseenColor::Black)),
            ("random", case.with_unseen(UnseenColor::Random)),
        ];
        for (form, case) in forms {
            let clock = Instant::now();
            let params = EvidenceParams::default();
            let (scene, before) = (case.scene(), case.before());
            let evidence = Evidence::of(&raster, scene, &before, 0.0, &case.pictures, &params)?;
            let repair = Repair::of(&evidence, RefineOptions::default().min_uncertainty);
            let secs = clock.elapsed().as_secs_f64();
            let repaired = repair.scene(scene);
            let (then, now, mut missed) = limits::judged(&case, &repaired, &EVAL);
            if form == "perfect" {
                missed.extend(limits::broken_perfect(then, now));
            } else if then[0] < 100.0 {
                missed.extend(limits::broken_flicker(&case, &repaired));
                gains.push(now[0] - then[0]);
            }
            let found = wrong_rows(&case).map_or_else(String::new, |wrong| {
                let right = repair.rows.iter().filter(|&&row| wrong[row as usize]).count();
                format!("; {} wrong, {right} found", wrong.iter().filter(|wrong| **wrong).count())
            });
            println!(
                "{name}, {form}: revealed {:.2} → {:.2}, elsewhere {:.2} → {:.2}{found}; {} recoloured, {} faded, {} ambiguous; {secs:.2} s",
                then[0],
                now[0],
                then[1],
                now[1],
                repair.rows.len(),
                repair.faded.len(),
                evidence.num_ambiguous,
            );
            broken.extend(missed.into_iter().map(|limit| format!("{name}, {form}: {limit}")));
        }
    }
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    println!("revealed: {mean:+.2} dB in the mean of {} cases", gains.len());
    if mean < limits::MEAN_GAIN {
        broken.push(format!("{mean:.2} dB in the mean"));
    }
    for limit in &broken {
        println!("violated: {limit}");
    }
    if broken.is_empty() { Ok(()) } else { Err("limits are violated".into()) }
}

/// Hidden splats and view dependence together: ξ, evidence, both; solvers; the paper's warp.
fn ablation() -> Result<(), Box<dyn Error>> {
    let (name, edits) =
        cases().into_iter().find(|(name, _)| *name == "textured").ok_or("a case")?;
    let case = delivered(name, &edits, 12_000, 3, |_| {
        let (mut cameras, held_out) = common::cameras(8, 320, 240);
        let held = held_out.iter().map(|&view| cameras[view].clone()).collect();
        cameras.truncate(8);
        (cameras, held)
    });
    let scene = with_unseen_sh(&case, 1.5);
    let judge = Judge::of(&case, &scene, &EVAL);
    let then = judge.score(&scene).db();
    println!(
        "before: revealed {:.2}, elsewhere {:.2}, mask {:.2}, outside {:.2}",
        then[0], then[1], then[2], then[3]
    );
    let best = RefineOptions::default();
    let adam = Solver::Adam(AdamParams::default());
    let runs = [
        ("ξ alone, least squares", RefineOptions { evidence: None, ..best.clone() }),
        ("both, least squares (default)", best.clone()),
        ("both, Adam", RefineOptions { solver: adam, ..best.clone() }),
        (
            "both, least squares, warp as printed",
            RefineOptions { warp: WarpForm::Paper, ..best.clone() },
        ),
        ("--preset paper", RefineOptions::preset(RefinePreset::Paper)),
    ];
    let raster = CpuRasterizer::default();
    let params = EvidenceParams::default();
    let evidence = Evidence::of(&raster, &scene, &case.before(), 0.0, &case.pictures, &params)?;
    let repair = Repair::of(&evidence, best.min_uncertainty);
    let show = |name: &str, scene: &dyn DynamicScene, secs: f64| {
        let now = judge.score(scene).db();
        let broken = [limits::broken(then, now), limits::broken_flicker(&case, scene)].concat();
        println!(
            "{name}: revealed {:+.2}, elsewhere {:+.2}, mask {:+.2}, outside {:+.2} dB; {secs:.1} s; violated limits: {broken:?}",
            now[0] - then[0],
            now[1] - then[1],
            now[2] - then[2],
            now[3] - then[3]
        );
    };
    show("evidence alone", &repair.scene(&scene), 0.0);
    for (name, options) in runs {
        let clock = Instant::now();
        let refined = case.refined(&scene, 31, &options);
        let secs = clock.elapsed().as_secs_f64();
        show(name, &refined.scene(&scene), secs);
    }
    Ok(())
}

/// The crop of the right sleeve: as delivered, repaired, and ground truth.
fn picture(path: &str) -> Result<(), Box<dyn Error>> {
    let (name, edits) = cases().pop().ok_or("a case")?;
    let case = delivered(name, &edits, 30_000, 1, |scene| rings(scene, (320, 320)));
    let options = RefineOptions { samples: 40, ..RefineOptions::default() };
    let refined = case.refined(case.scene(), 31, &options);
    let camera = case.source.front_camera(900, 900);
    let (x, y, side) = (250, 180, 240_usize);
    let mut image = image::RgbImage::new(3 * side as u32, side as u32);
    let repaired = refined.scene(case.scene());
    let scenes: [&dyn DynamicScene; 3] = [case.scene(), &repaired, &case.truth.truth];
    for (k, scene) in scenes.into_iter().enumerate() {
        let shown = common::render(scene, 0.5, &camera);
        for row in 0..side {
            for column in 0..side {
                let pixel = shown.pixel(x + column, y + row);
                let rgb = [0, 1, 2].map(|c| (255.0 * pixel[c].clamp(0.0, 1.0)).round() as u8);
                image.put_pixel((k * side + column) as u32, row as u32, image::Rgb(rgb));
            }
        }
    }
    image.save(path)?;
    println!("{path}: as delivered, refined, truth");
    Ok(())
}
