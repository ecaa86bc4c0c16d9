//! How much the end-point error changes when one parameter of the motion model is halved or
//! doubled: `cargo run --release -p amg --example sensitivity -- 1000 2`, with the number of source
//! splats and of seeds. Prints a table of ratios, geometric means over cases of `gs-synth` and,
//! from another generator, over the goldens of `fixtures/amg`. Errors are those of edited splats.
#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests may fail loudly; sizes and lengths are small"
)]

#[path = "../tests/common/mod.rs"]
mod common;

use amg::{MotionGuide, MotionOptions, MotionParams, propagate};
use gs_core::DynamicScene;
use gs_synth::{TruthCase, TruthScene, build, motion_error_of};
use std::io::Write;
use std::sync::Arc;

/// Cases in which something has to be decided.
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
const EDITS: [&str; 4] = ["drift", "inflate", "graft", "all"];
const TIMES: [f32; 4] = [0.25, 0.5, 0.75, 1.0];
/// Seeds of the benchmark start at 0; these are others.
const FIRST_SEED: u64 = 20;

type Failure = Box<dyn std::error::Error>;
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
    ("sources_per_row", |p, by| p.sources_per_row = (p.sources_per_row as f64 * by) as usize),
];

fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| -> Result<u64, Failure> {
        Ok(words.get(i).map_or(Ok(default), |word| word.parse())?)
    };
    let (size, seeds) = (usize::try_from(number(0, 1000)?)?, number(1, 2)?);
    let mut scenes = Vec::new();
    for case in CASES {
        for seed in FIRST_SEED..FIRST_SEED + seeds {
            scenes.push(build(case.parse::<TruthCase>()?, seed, size)?);
        }
    }
    let (ours, theirs) = errors(&scenes, &MotionParams::default())?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "default: {}", listed(&ours, seeds, &theirs))?;
    writeln!(out, "\n| parameter | gs-synth: ×½, ×2 | goldens: ×½, ×2 |\n|---|---|---|")?;
    for (name, change) in CHANGES {
        let mut columns = [Vec::new(), Vec::new()];
        for by in [0.5, 2.0] {
            let mut params = MotionParams::default();
            change(&mut params, by);
            let (a, b) = errors(&scenes, &params)?;
            columns[0].push(format!("{:.2}", ratio(&a, &ours)));
            columns[1].push(format!("{:.2}", ratio(&b, &theirs)));
        }
        let [a, b] = columns.map(|column| column.join(", "));
        writeln!(out, "| `{name}` | {a} | {b} |")?;
        out.flush()?;
    }
    Ok(())
}

/// Geometric mean of the ratios.
fn ratio(found: &[f64], reference: &[f64]) -> f64 {
    let logs: f64 = found.iter().zip(reference).map(|(f, r)| (f / r).ln()).sum();
    (logs / found.len() as f64).exp()
}

fn listed(ours: &[f64], seeds: u64, theirs: &[f64]) -> String {
    let means = ours.chunks(seeds.max(1) as usize).map(|c| c.iter().sum::<f64>() / c.len() as f64);
    let ours = CASES.iter().zip(means).map(|(case, mean)| format!("{case} {mean:.3}"));
    let theirs = EDITS.iter().zip(theirs).map(|(edit, error)| format!("{edit} {error:.3}"));
    ours.chain(theirs).collect::<Vec<_>>().join(", ")
}

/// End-point errors of edited splats, % of the figure, of our scenes and of the goldens.
fn errors(scenes: &[TruthScene], params: &MotionParams) -> Result<(Vec<f64>, Vec<f64>), Failure> {
    let options =
        MotionOptions { guide: MotionGuide::Regions(params.clone()), ..MotionOptions::default() };
    let mut ours = Vec::new();
    for scene in scenes {
        let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
        let edited = Arc::new(scene.edited.splats.clone());
        let found = propagate(source, edited, &options, &|_, _| {})?;
        let truth = &scene.edited.truth;
        let kinds = found.scene.binding().kinds().iter().zip(&truth.eval_mask);
        let open: Vec<bool> = kinds.map(|(kind, scored)| !kind.is_exact() && *scored).collect();
        ours.push(motion_error_of(&found.scene, truth, &TIMES, &open)?.epe.max(1e-6));
    }
    let mut theirs = Vec::new();
    for name in EDITS {
        let (source, size) = common::golden_source();
        let edit = common::golden_edit(name);
        let splats = Arc::new(edit.splats.clone());
        let found = propagate(Arc::new(source), splats, &options, &|_, _| {})?;
        theirs.push(common::score(&found.scene, &edit, size).epe);
    }
    Ok((ours, theirs))
}
