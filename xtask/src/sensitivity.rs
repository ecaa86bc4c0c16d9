//! Sensitivity to the parameters of the default motion model: the factor on the end-point error
//! when one of them is halved or doubled. Draws `docs/images/sensitivity.svg` and prints a table.
//!
//! Scenes are those of `gs-synth` with seeds that no other measurement uses, and robots, which were
//! not used for tuning ([`crate::robots`]). Errors are those of edited splats.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "scenes are single precision, counts are small"
)]

use crate::robots::Robot;
use crate::workspace::workspace;
use amg::{MotionGuide, MotionOptions, MotionParams, propagate};
use anyhow::{Result, anyhow};
use gs_core::DynamicScene;
use gs_synth::{TruthCase, TruthScene, motion_error_of};
use plotters::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Cases in which the motion is ambiguous.
const CASES: [&str; 10] = [
    "clothing",
    "graft-wings",
    "graft-block",
    "graft-stick",
    "blocky",
    "touch-and-part",
    "stretching-cloth",
    "floaters-outliers",
    "noisy-reconstruction",
    "everything",
];
const TIMES: [f32; 4] = [0.25, 0.5, 0.75, 1.0];
/// First seed; the benchmark uses seeds from 0.
const FIRST_SEED: u64 = 20;
/// Robots per seed, so that their mean varies about as much as that of the ten cases.
const ROBOTS: u64 = 4;

type Change = (&'static str, fn(&mut MotionParams, f64));

const CHANGES: [Change; 10] = [
    ("region_size", |p, by| p.region_size *= by),
    ("strain", |p, by| p.strain *= by),
    ("same_motion", |p, by| p.same_motion *= by),
    ("entropy", |p, by| p.entropy *= by),
    ("source_marginal", |p, by| p.source_marginal *= by),
    ("unmatched", |p, by| p.unmatched *= by),
    ("prior", |p, by| p.prior *= by),
    ("alignment", |p, by| p.alignment *= by),
    ("new_geometry", |p, by| p.new_geometry *= by),
    ("sources_per_row", |p, by| {
        p.sources_per_row = (p.sources_per_row as f64 * by).round() as usize;
    }),
];
const FACTORS: [f64; 2] = [0.5, 2.0];
const GENERATORS: [&str; 2] = ["gs-synth", "robots"];

/// Scenes of one seed, by generator.
struct Scenes {
    cases: Vec<TruthScene>,
    robots: Vec<Robot>,
}

/// Error factors for the scenes of one generator.
#[derive(Debug, Clone, PartialEq)]
struct Effect {
    /// Geometric mean over scenes and seeds.
    mean: f64,
    /// Smallest and largest geometric mean over the scenes of a seed.
    range: [f64; 2],
}

/// Effects of one parameter, `[generator][factor]`.
struct Row {
    name: &'static str,
    effects: [[Effect; 2]; 2],
}

/// Measures on `seeds` seeds with `size` source splats per scene.
pub(crate) fn run(size: usize, seeds: u64) -> Result<()> {
    let scenes = (FIRST_SEED..FIRST_SEED + seeds)
        .map(|seed| {
            let cases = CASES
                .iter()
                .map(|case| Ok(gs_synth::build(case.parse::<TruthCase>()?, seed, size)?));
            let robots = (0..ROBOTS).map(|k| Robot::new(ROBOTS * seed + k, size)).collect();
            Ok(Scenes { cases: cases.collect::<Result<_>>()?, robots })
        })
        .collect::<Result<Vec<Scenes>>>()?;
    let reference = errors(&scenes, &MotionParams::default())?;
    let mut rows = Vec::new();
    for (name, change) in CHANGES {
        let mut found = Vec::new();
        for by in FACTORS {
            let mut params = MotionParams::default();
            change(&mut params, by);
            found.push(errors(&scenes, &params)?);
        }
        let effect = |generator: usize, factor: usize| {
            effect(&found[factor][generator], &reference[generator])
        };
        let effects = [0, 1].map(|generator| [0, 1].map(|factor| effect(generator, factor)));
        eprintln!("{name}");
        rows.push(Row { name, effects });
    }
    print(&rows);
    let path = workspace().join("docs/images/sensitivity.svg");
    draw(&path, &rows).map_err(|error| anyhow!("{}: {error}", path.display()))?;
    eprintln!("{}", path.display());
    Ok(())
}

/// Logarithms of the end-point errors, `[generator][seed][scene]`.
fn errors(scenes: &[Scenes], params: &MotionParams) -> Result<[Vec<Vec<f64>>; 2]> {
    let options = MotionOptions::default().with_guide(MotionGuide::Regions(params.clone()));
    let mut found = [Vec::new(), Vec::new()];
    for Scenes { cases, robots } in scenes {
        let case = |scene: &TruthScene| -> Result<f64> {
            let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
            let edited = Arc::new(scene.edited.splats.clone());
            let found = propagate(source, edited, &options, &|_, _| {})?.scene;
            let truth = &scene.edited.truth;
            let kinds = found.binding().kinds().iter().zip(&truth.eval_mask);
            let open: Vec<bool> = kinds.map(|(kind, scored)| !kind.is_exact() && *scored).collect();
            Ok(motion_error_of(&found, truth, &TIMES, &open)?.epe.max(1e-9).ln())
        };
        let robot = |robot: &Robot| -> Result<f64> {
            let source: Arc<dyn DynamicScene> = Arc::clone(&robot.source) as _;
            let found = propagate(source, Arc::clone(&robot.edited), &options, &|_, _| {})?;
            Ok(robot.error(&found.scene)?.max(1e-9).ln())
        };
        found[0].push(cases.iter().map(case).collect::<Result<_>>()?);
        found[1].push(robots.iter().map(robot).collect::<Result<_>>()?);
    }
    Ok(found)
}

/// Ratio of `changed` to `reference`, both logarithms `[seed][scene]`.
fn effect(changed: &[Vec<f64>], reference: &[Vec<f64>]) -> Effect {
    let of_seed: Vec<f64> = changed
        .iter()
        .zip(reference)
        .map(|(changed, reference)| {
            let difference: f64 = changed.iter().zip(reference).map(|(c, r)| c - r).sum();
            difference / reference.len() as f64
        })
        .collect();
    let mean = of_seed.iter().sum::<f64>() / of_seed.len() as f64;
    let lowest = of_seed.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = of_seed.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Effect { mean: mean.exp(), range: [lowest.exp(), highest.exp()] }
}

#[expect(clippy::print_stdout, reason = "the table is what the command is run for")]
fn print(rows: &[Row]) {
    let [first, second] = GENERATORS;
    println!("| parameter | {first}: ×½, ×2 | {second}: ×½, ×2 |\n|---|---|---|");
    for row in rows {
        let cells = row.effects.each_ref().map(|effects| {
            let cell = |e: &Effect| format!("{:.2} ({:.2}–{:.2})", e.mean, e.range[0], e.range[1]);
            effects.each_ref().map(cell).join(", ")
        });
        println!("| `{}` | {} |", row.name, cells.join(" | "));
    }
}

/// One panel per generator: a row per parameter, factors on the error from left to right.
fn draw(path: &Path, rows: &[Row]) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::new(path, (900, 380)).into_drawing_area();
    area.fill(&WHITE)?;
    let all = || rows.iter().flat_map(|row| row.effects.iter().flatten()).flat_map(|e| e.range);
    let lowest = all().fold(0.8, f64::min) / 1.05;
    let highest = all().fold(1.25, f64::max) * 1.05;
    let bottom = rows.len() as f64;
    for (generator, panel) in area.split_evenly((1, GENERATORS.len())).iter().enumerate() {
        let title = format!("{}: factor on the error", GENERATORS[generator]);
        let mut chart = ChartBuilder::on(panel)
            .caption(title, ("sans-serif", 15))
            .margin(10)
            .x_label_area_size(34)
            .y_label_area_size(110)
            .build_cartesian_2d((lowest..highest).log_scale(), bottom - 0.5..-0.5)?;
        let name = |y: &f64| {
            let row = y.round() as usize;
            rows.get(row).map_or(String::new(), |row| row.name.to_owned())
        };
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_label_formatter(&|x| format!("{x:.2}"))
            .y_labels(rows.len() + 1)
            .y_label_formatter(&name)
            .draw()?;
        let vertical = [(1.0, -0.5), (1.0, bottom - 0.5)];
        chart.draw_series(LineSeries::new(vertical, BLACK))?;
        for (factor, label) in ["halved", "doubled"].into_iter().enumerate() {
            let colour = Palette99::pick(factor);
            let at = |k: usize| k as f64 - 0.15 + 0.3 * factor as f64;
            let effects: Vec<&Effect> =
                rows.iter().map(|row| &row.effects[generator][factor]).collect();
            chart.draw_series(effects.iter().enumerate().map(|(k, effect)| {
                let range = effect.range.map(|x| (x, at(k)));
                PathElement::new(range, colour.stroke_width(2))
            }))?;
            chart
                .draw_series(
                    effects
                        .iter()
                        .enumerate()
                        .map(|(k, effect)| Circle::new((effect.mean, at(k)), 4, colour.filled())),
                )?
                .label(label)
                .legend(move |(x, y)| Circle::new((x + 9, y), 4, colour.filled()));
        }
        chart.configure_series_labels().background_style(WHITE).border_style(BLACK).draw()?;
    }
    area.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_are_geometric_means_with_the_range_of_seeds() {
        let ln = |values: [[f64; 2]; 2]| values.map(|seed| seed.map(f64::ln).to_vec()).to_vec();
        let reference = ln([[1.0, 2.0], [1.0, 2.0]]);
        let found = effect(&ln([[2.0, 4.0], [0.5, 1.0]]), &reference);
        assert!((found.mean - 1.0).abs() < 1e-12, "twice and half: {found:?}");
        assert!((found.range[0] - 0.5).abs() < 1e-12, "{found:?}");
        assert!((found.range[1] - 2.0).abs() < 1e-12, "{found:?}");
    }

    /// The measurement must detect an important parameter: a region model with a useless
    /// tolerance has a larger error.
    #[test]
    fn a_useless_tolerance_raises_the_error() -> Result<()> {
        let robots = vec![Robot::new(5, 500)];
        let scenes = [Scenes { cases: Vec::new(), robots }];
        let reference = errors(&scenes, &MotionParams::default())?;
        let params = MotionParams { same_motion: 1.0, ..MotionParams::default() };
        let found = effect(&errors(&scenes, &params)?[1], &reference[1]);
        assert!(found.mean > 1.2, "{found:?}");
        Ok(())
    }
}
