//! Loss against wall time, and what it is worth against the truth, of both solvers and both warps.
//!
//! `cargo run --release -p cuar --example compare_solvers [brief]`; `brief` leaves out all but the defaults, a run without prior, and Adam.
#![expect(clippy::print_stdout, reason = "a measurement for people")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Flaws, case, flicker, psnr};
use cuar::{
    AdamParams, NoObserver, Preset, RefineOptions, RegressionParams, Solver, Views, WarpForm,
    WarpParams, refine,
};
use gs_core::TimeRange;
use gs_raster_cpu::CpuRasterizer;
use std::error::Error;

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
        Solver::Adam(AdamParams { steps, rate_dc, rate_rest, ..usual })
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
    runs.push(("--preset paper".to_owned(), RefineOptions::preset(Preset::Paper)));
    if std::env::args().nth(1).as_deref() == Some("brief") {
        let kept = [
            "regression 2 passes",
            "regression 8 passes",
            "regression 4 passes, no prior",
            "Adam 3000 steps",
            "--preset paper",
        ];
        runs.retain(|(name, _)| kept.contains(&name.as_str()));
    }
    for (name, options) in runs {
        let options = RefineOptions { samples: 80, ..options };
        let raster = CpuRasterizer::default();
        let refined =
            refine(&raster, &case.scene, &case.edited, &views, &options, None, &mut NoObserver)?;
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
