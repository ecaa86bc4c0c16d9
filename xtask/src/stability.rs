//! Sensitivity to the transport weights (the supplement's figure): end-point error and
//! correspondences of the paper preset over λ₀ and λ₁ = λ₂, on scenes with known motion. Draws
//! `docs/stability.svg` and prints the numbers.

use crate::workspace::workspace;
use amg::{MotionGuide, MotionOptions, MotionPreset, PaperParams};
use anyhow::{Result, anyhow};
use gs_core::DynamicScene;
use gs_synth::{TruthCase, TruthScene};
use plotters::prelude::*;
use std::sync::Arc;

const ENTROPY: [f64; 5] = [0.05, 0.1, 0.15, 0.2, 0.3];
const MARGINALS: [f64; 4] = [0.6, 1.0, 3.0, 11.0];
const CASES: [TruthCase; 2] = [TruthCase::Clothing, TruthCase::GraftWings];
const SPLATS: usize = 5000;
const TIMES: [f32; 4] = [0.25, 0.5, 0.75, 1.0];

/// Result of one setting.
struct Point {
    lambda0: f64,
    lambda12: f64,
    /// Mean end-point error, % of the figure's size.
    epe: f64,
    /// Fraction of edited splats with the same strongest source
    /// as at the paper's weights (0.1, 1, 1).
    same: f64,
}

pub(crate) fn run() -> Result<()> {
    let mut curves = Vec::new();
    for case in CASES {
        let scene = gs_synth::build(case, 0, SPLATS)?;
        let reference = solve(&scene, [0.1, 1.0, 1.0])?.1;
        let mut points = Vec::new();
        for lambda12 in MARGINALS {
            for lambda0 in ENTROPY {
                let (epe, sources) = solve(&scene, [lambda0, lambda12, lambda12])?;
                let same = sources.iter().zip(&reference).filter(|(a, b)| a == b).count();
                let same = same as f64 / reference.len().max(1) as f64;
                points.push(Point { lambda0, lambda12, epe, same });
            }
        }
        print(case, &points);
        curves.push((case, points));
    }
    let path = workspace().join("docs/stability.svg");
    draw(&path, &curves).map_err(|error| anyhow!("{}: {error}", path.display()))?;
    eprintln!("{}", path.display());
    Ok(())
}

/// End-point error, and the strongest source of each edited splat.
fn solve(scene: &TruthScene, lambdas: [f64; 3]) -> Result<(f64, Vec<Option<u32>>)> {
    let mut options = MotionOptions::preset(MotionPreset::Paper);
    options.guide = MotionGuide::Paper(PaperParams { lambdas, ..PaperParams::default() });
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
    let edited = Arc::new(scene.edited.splats.clone());
    let found = amg::propagate(source, edited, &options, &|_, _| {})?.scene;
    let sources = (0..scene.edited.splats.len()).map(|row| found.binding().heaviest(row)).collect();
    Ok((gs_synth::motion_error(&found, &scene.edited.truth, &TIMES)?.epe, sources))
}

#[expect(clippy::print_stdout, reason = "the table is what the command is run for")]
fn print(case: TruthCase, points: &[Point]) {
    println!("\n{case}: end-point error, % (share of equal correspondences)\n");
    let head: Vec<String> = ENTROPY.iter().map(|l| format!("λ₀ = {l}")).collect();
    println!("| λ₁ = λ₂ | {} |\n|---|{}", head.join(" | "), "---|".repeat(head.len()));
    for row in points.chunks(ENTROPY.len()) {
        let cells: Vec<String> =
            row.iter().map(|p| format!("{:.3} ({:.2})", p.epe, p.same)).collect();
        println!("| {} | {} |", row[0].lambda12, cells.join(" | "));
    }
}

fn draw(
    path: &std::path::Path,
    curves: &[(TruthCase, Vec<Point>)],
) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::new(path, (900, 360)).into_drawing_area();
    area.fill(&WHITE)?;
    for (panel, (case, points)) in area.split_evenly((1, curves.len())).iter().zip(curves) {
        let top = points.iter().map(|p| p.epe).fold(0.0, f64::max) * 1.4;
        let title = format!("{case}: end-point error, % of the figure");
        let mut chart = ChartBuilder::on(panel)
            .caption(title, ("sans-serif", 15))
            .margin(10)
            .x_label_area_size(34)
            .y_label_area_size(44)
            .build_cartesian_2d(0.0..0.32, 0.0..top)?;
        chart.configure_mesh().light_line_style(TRANSPARENT).x_desc("λ0").draw()?;
        for (k, row) in points.chunks(ENTROPY.len()).enumerate() {
            let colour = Palette99::pick(k).stroke_width(2);
            let label = format!("λ1 = λ2 = {}", row[0].lambda12);
            chart
                .draw_series(LineSeries::new(row.iter().map(|p| (p.lambda0, p.epe)), colour))?
                .label(label)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour));
        }
        chart.configure_series_labels().border_style(BLACK).draw()?;
    }
    area.present()?;
    Ok(())
}
