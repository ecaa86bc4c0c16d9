//! Loss over wall time, and error against ground truth, for both solvers and both warps.
//!
//! `cargo run --release -p cuar --example compare_solvers [brief | paper | warps]`; `brief` runs
//! only the defaults, a run without prior, and Adam; `paper` varies the parts of the paper's
//! preset; `warps` only compares the targets of the warps with ground truth.
#![expect(clippy::print_stdout, reason = "prints its results")]

#[path = "../tests/suite/common/mod.rs"]
mod common;

use common::{Flaws, case, flicker, psnr};
use cuar::loss::LossWeights;
use cuar::{
    AdamParams, NoRefineObserver, Preview, RefineObserver, RefineOptions, RefinePreset,
    RegressionParams, Solver, Views, WarpForm, WarpParams, refine,
};
use gs_core::{Image, TimeRange};
use gs_raster_cpu::CpuRasterizer;
use std::error::Error;

/// Compares the targets and the renders of images with ground truth: squared errors and their
/// number.
struct Judge<'a> {
    case: &'a common::Case,
    sums: [f64; 3],
}

impl RefineObserver for Judge<'_> {
    fn preview(&mut self, preview: &Preview) {
        let truth =
            common::render(&self.case.truth, preview.time, &self.case.cameras[preview.view]);
        for (p, _) in preview.mask.data.iter().enumerate().filter(|(_, mask)| **mask > 0.0) {
            let (x, y) = (p % preview.mask.width, p / preview.mask.width);
            let there = truth.pixel(x + preview.origin[0], y + preview.origin[1]);
            for channel in 0..3 {
                let error =
                    |image: &Image| f64::from(image.pixel(x, y)[channel] - there[channel]).powi(2);
                self.sums[0] += error(&preview.target);
                self.sums[1] += error(&preview.before);
                self.sums[2] += 1.0;
            }
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    let case = case(12_000, 3, 8, (320, 240), flaws);
    let times = TimeRange::UNIT.frames(31);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    let (eval, clip) = ([0.13, 0.37, 0.61, 0.83], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]);
    let before = psnr(&case.scene, &case, &case.held_out, &eval);
    let shaky = flicker(&case.scene, &case, &case.held_out, &clip);
    let calm = flicker(&case.truth, &case, &case.held_out, &clip);
    println!(
        "before: PSNR inside {:.2}, outside {:.2}; flicker {shaky:.3} (truth {calm:.3})",
        before[0], before[1]
    );

    let usual = RegressionParams::default();
    let regression = |passes: usize, prior: f64| {
        Solver::Regression(RegressionParams { passes, prior, ..RegressionParams::default() })
    };
    let adam = |steps: usize, faster: f32| {
        let usual = AdamParams::default();
        let (rate_dc, rate_rest) = (usual.rate_dc * faster, usual.rate_rest * faster);
        Solver::Adam(AdamParams { steps, rate_dc, rate_rest })
    };
    let best = WarpParams::default();
    let all = WarpParams { slack: None, ..best };
    let mut runs = Vec::new();
    for passes in [2, 4, 8, 16] {
        let name = format!("regression {passes} passes");
        runs.push((name, regression(passes, usual.prior), WarpForm::Backward, best));
    }
    for prior in [0.3, 0.003] {
        let name = format!("regression 8 passes, prior {prior}");
        runs.push((name, regression(8, prior), WarpForm::Backward, best));
    }
    for passes in [2, 4, 8] {
        runs.push((
            format!("regression {passes} passes, no prior"),
            regression(passes, 0.0),
            WarpForm::Backward,
            best,
        ));
    }
    for steps in [200, 1000, 3000] {
        runs.push((format!("Adam {steps} steps"), adam(steps, 1.0), WarpForm::Backward, best));
        runs.push((
            format!("Adam {steps} steps, 10 × rate"),
            adam(steps, 10.0),
            WarpForm::Backward,
            best,
        ));
    }
    runs.push((
        "regression, no slack".to_owned(),
        regression(8, usual.prior),
        WarpForm::Backward,
        all,
    ));
    runs.push((
        "regression, paper warp".to_owned(),
        regression(8, usual.prior),
        WarpForm::Paper,
        all,
    ));
    runs.push(("Adam, paper warp".to_owned(), adam(3000, 1.0), WarpForm::Paper, all));
    let mut runs: Vec<(String, RefineOptions)> = runs
        .into_iter()
        .map(|(name, solver, warp, warp_params)| {
            (name, RefineOptions { solver, warp, warp_params, ..RefineOptions::default() })
        })
        .collect();
    let paper = RefineOptions::preset(RefinePreset::Paper);
    runs.push(("--preset paper".to_owned(), paper.clone()));
    let never = WarpParams { min_known_color: 2.0, ..best };
    runs.push((
        "regression, surfaces only".to_owned(),
        RefineOptions { warp_params: never, ..RefineOptions::default() },
    ));
    let asked = std::env::args().nth(1);
    if asked.as_deref() == Some("paper") {
        runs.retain(|(name, _)| name == "--preset paper");
        let floor = RefineOptions::default().min_uncertainty;
        let adam = |steps| {
            let usual = AdamParams::default();
            Solver::Adam(AdamParams { steps, ..usual })
        };
        for (name, options) in [
            ("paper, 300 steps", RefineOptions { solver: adam(300), ..paper.clone() }),
            ("paper, our floor", RefineOptions { min_uncertainty: floor, ..paper.clone() }),
            ("paper, edited frame kept", RefineOptions { keep_first_frame: true, ..paper.clone() }),
            ("paper, our warp", RefineOptions { warp: WarpForm::Backward, ..paper.clone() }),
            (
                "paper, no SSIM",
                RefineOptions {
                    weights: LossWeights { eta: 0.0, ..LossWeights::default() },
                    ..paper.clone()
                },
            ),
        ] {
            runs.push((name.to_owned(), options));
        }
    }
    if asked.as_deref() == Some("warps") {
        runs.clear();
    }
    if asked.as_deref() == Some("brief") {
        let kept = [
            "regression 2 passes",
            "regression 8 passes",
            "regression 4 passes, no prior",
            "Adam 3000 steps",
            "--preset paper",
            "regression, surfaces only",
        ];
        runs.retain(|(name, _)| kept.contains(&name.as_str()));
    }
    for (name, warp) in [("backward", WarpForm::Backward), ("paper", WarpForm::Paper)] {
        let mut judge = Judge { case: &case, sums: [0.0; 3] };
        let solver = adam(80, 0.0);
        let options = RefineOptions {
            samples: 80,
            warp,
            warp_params: all,
            solver,
            preview_secs: Some(0.0),
            ..RefineOptions::default()
        };
        let raster = CpuRasterizer::default();
        let report =
            refine(&raster, &case.scene, &case.edited, &views, &options, None, &mut judge)?.report;
        let [target, before, count] = judge.sums;
        let psnr = |sum: f64| -10.0 * (sum / count.max(1.0)).log10();
        println!(
            "supervision of the {name} warp: {:.2} dB relative to the ground truth, on {:.0} % of the mask; render before refinement: {:.2} dB",
            psnr(target),
            100.0 * report.supervision.supervised() as f64
                / report.supervision.masked.max(1) as f64,
            psnr(before)
        );
    }
    for (name, options) in runs {
        let options = RefineOptions { samples: 80, ..options };
        let raster = CpuRasterizer::default();
        let refined = refine(
            &raster,
            &case.scene,
            &case.edited,
            &views,
            &options,
            None,
            &mut NoRefineObserver,
        )?;
        let scene = refined.scene(&case.scene);
        let after = psnr(&scene, &case, &case.held_out, &eval);
        let report = &refined.report;
        let solve = report.timings.iter().find(|(part, _)| *part == "solve").map_or(0.0, |t| t.1);
        println!(
            "{name:34} {solve:6.2} s  loss {:.6} → {:.6}  held-out {:.6} → {:.6}  PSNR {:+.2} inside {:+.2} outside  flicker {:.3}",
            report.loss_before,
            report.loss_after,
            report.held_out_before,
            report.held_out_after,
            after[0] - before[0],
            after[1] - before[1],
            flicker(&scene, &case, &case.held_out, &clip),
        );
    }
    Ok(())
}
