//! `c4d eval --ablation`: runs and measures the paper's ablations and the default.

use super::measure::{Evaluated, Wanted, evaluate};
use crate::args::{BaselineArg, EvalArgs, Global, MotionArg, PresetArg, RefineFlags};
use crate::commands::propagate::{self, Recorded};
use crate::commands::refine;
use crate::console::Console;
use crate::evaluation::{self, Item, Subject};
use crate::failure::{Failure, Outcome};
use crate::output::{existing, output_failure};
use crate::run_folder::{Checkpoint, RunFiles};
use crate::scene;
use crate::settings::{PropagateJob, Settings};
use amg::{MotionGuide, MotionOptions, MotionPreset, PaperParams};
use gs_core::DynamicScene;
use gs_io::AtomicDir;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

/// A way to propagate the edit.
struct Variant {
    /// Folder of its run.
    name: &'static str,
    /// Heading of its column.
    title: &'static str,
    preset: PresetArg,
    baseline: Option<BaselineArg>,
    refined: bool,
}

const fn variant(
    name: &'static str,
    title: &'static str,
    (preset, baseline): (PresetArg, Option<BaselineArg>),
    refined: bool,
) -> Variant {
    Variant { name, title, preset, baseline, refined }
}

const KNN: (PresetArg, Option<BaselineArg>) = (PresetArg::Paper, Some(BaselineArg::Knn));
const NETWORK: (PresetArg, Option<BaselineArg>) = (PresetArg::Paper, Some(BaselineArg::Deformnet));
const PAPER: (PresetArg, Option<BaselineArg>) = (PresetArg::Paper, None);
const DEFAULT: (PresetArg, Option<BaselineArg>) = (PresetArg::Default, None);

/// Variants in the paper's order. Its "w/o both" is DeformNet-Guide, its "w/ both" is the preset
/// `paper`.
const VARIANTS: [Variant; 7] = [
    variant("knn", "KNN-Guide", KNN, false),
    variant("without-both", "w/o both (DeformNet-Guide)", NETWORK, false),
    variant("cuar", "CUAR", NETWORK, true),
    variant("amg", "AMG", PAPER, false),
    variant("both", "both (preset paper)", PAPER, true),
    variant("default-motion", "default, w/o refinement", DEFAULT, false),
    variant("default", "default", DEFAULT, true),
];
/// Variants for scenes without a deformation network.
const WITHOUT_NETWORK: [Variant; 6] = [
    variant("without-both", "w/o both (KNN-Guide)", KNN, false),
    variant("cuar", "CUAR (KNN-Guide)", KNN, true),
    variant("amg", "AMG", PAPER, false),
    variant("both", "both (preset paper)", PAPER, true),
    variant("default-motion", "default, w/o refinement", DEFAULT, false),
    variant("default", "default", DEFAULT, true),
];

/// Transport weights `[λ0, λ1, λ2]`: the paper's, and those of its figure.
const LAMBDAS: [[f64; 3]; 7] = [
    [0.1, 1.0, 1.0],
    [0.05, 1.0, 1.0],
    [0.3, 1.0, 1.0],
    [0.1, 0.6, 1.0],
    [0.1, 11.0, 1.0],
    [0.1, 1.0, 0.6],
    [0.1, 1.0, 11.0],
];
/// Metrics in the table of the sweep.
const SWEPT: [&str; 6] =
    ["ndd_edit", "ndd_excess", "isometry_excess", "drift", "jitter_ratio", "entropy_perplexity"];

pub(super) fn run(args: &EvalArgs, global: &Global, console: &Console) -> Outcome {
    let (Some(edited), Some(output)) = (&args.edited, &args.output) else {
        return Err(Failure::usage("--ablation needs --edited FILE and -o FOLDER"));
    };
    let wanted = Wanted::of(args, console)?;
    let has_network = scene::open(&args.run, global, console)?.network.is_some();
    let variants: &[Variant] = if has_network { &VARIANTS } else { &WITHOUT_NETWORK };
    if !has_network {
        console.note(format!(
            "{} has no deformation network: KNN-Guide replaces the paper's DeformNet-Guide",
            args.run.display()
        ));
    }
    crate::output::refuse_overlap(output, &[args.run.clone(), edited.clone()])?;
    let folder =
        AtomicDir::create(output, existing(global)).map_err(|error| output_failure(&error))?;
    let within = Global { overwrite: false, ..global.clone() };
    let mut columns: Vec<(&str, Vec<Item>)> = Vec::new();
    let mut documents = serde_json::Map::new();
    for variant in variants {
        console.note(format!("{}:", variant.title));
        let run = folder.path().join(variant.name);
        make(variant, args, edited, &run, &within, console)?;
        let plain = Global { iteration: None, set: Vec::new(), ..within.clone() };
        let Evaluated { document, items } =
            evaluate(&run, &args.measure, &wanted, None, &plain, console)?;
        documents.insert(variant.name.to_owned(), document);
        columns.push((variant.title, items));
    }
    let mut text = evaluation::method_table("metric", &columns, &evaluation::SHOWN);
    let mut report = json!({ "schema": 1, "runs": documents });
    if args.sweep {
        let plain = Global { iteration: None, set: Vec::new(), ..within };
        let (table, values) = sweep(&folder.path().join("amg"), args, &plain, console)?;
        let _ = write!(text, "\n\n{table}");
        report["sweep"] = values;
    }
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).map_err(|error| Failure::write(&path, &error))
    };
    write("ablation.json", &serde_json::to_string_pretty(&report).map_err(Failure::failed)?)?;
    write("ablation.md", &text)?;
    folder.commit().map_err(|error| output_failure(&error))?;
    console.report(|| report);
    console.wrote(output);
    console.result(text);
    Ok(())
}

/// Writes the run of a variant.
fn make(
    variant: &Variant,
    args: &EvalArgs,
    edited: &Path,
    run: &Path,
    global: &Global,
    console: &Console,
) -> Outcome {
    // The paper and its baselines estimate the motion of every splat.
    let motion = match variant.preset {
        PresetArg::Default => MotionArg::Edited,
        PresetArg::Paper => MotionArg::All,
    };
    let flags = RefineFlags {
        refine_cameras: args.measure.cameras.clone(),
        refine_size: args.refine_size.or(args.measure.size),
        samples: args.samples,
        ..RefineFlags::default()
    };
    let job = PropagateJob {
        scene: args.run.clone(),
        edited: edited.to_owned(),
        output: run.to_owned(),
        time: args.time,
        axes: None,
        no_refine: true,
        preset: variant.preset,
        baseline: variant.baseline,
        motion,
        follow: None,
        seed: 0,
        allow_far: true,
        dry_run: false,
        align: false,
        keep_rest: false,
        refine: flags.clone(),
        settings: Settings::default(),
    };
    let recorded = Recorded { scene: args.run.clone(), edited: edited.to_owned() };
    propagate::propagate(&job, &recorded, global, console)?;
    if variant.refined {
        let begun = Checkpoint::new(variant.preset, Settings::default().refine(), &flags);
        let plain = Global { iteration: None, set: Vec::new(), ..global.clone() };
        refine::refine(run, begun, &plain, console)?;
    }
    Ok(())
}

/// Metrics of the preset `paper` with other transport weights. `run` is a run of the edit.
fn sweep(
    run: &Path,
    args: &EvalArgs,
    global: &Global,
    console: &Console,
) -> Outcome<(String, Value)> {
    let opened = scene::open(run, global, console)?;
    let stored = RunFiles::read(run)?.stored;
    let Some(source) = &opened.original else { return Ok((String::new(), Value::Null)) };
    let times =
        crate::frames::times(opened.scene.as_ref(), &args.measure.times, args.measure.frames)?;
    let edited = Arc::new(stored.edited.clone());
    let mut columns: Vec<(String, Vec<Item>)> = Vec::new();
    let mut values = Vec::new();
    let mut progress = console.progress("sweep", LAMBDAS.len() as u64);
    for lambdas in LAMBDAS {
        let mut options = MotionOptions::preset(MotionPreset::Paper);
        options.edit_time = Some(opened.edit_time);
        options.guide = MotionGuide::Paper(PaperParams { lambdas, ..PaperParams::default() });
        let found = amg::propagate(Arc::clone(source), Arc::clone(&edited), &options, &|_, _| {})
            .map_err(Failure::failed)?;
        let scene: &dyn DynamicScene = &found.scene;
        let known = (source.as_ref(), edited.as_ref(), found.scene.binding().as_ref());
        let subject = Subject::new(scene, Some(known), opened.edit_time)?;
        let mut items = evaluation::motion(&subject, &times)?;
        items.extend(evaluation::matches(&subject, &Value::Null)?);
        let of = |id: &str| items.iter().find(|item| item.definition.id == id)?.value;
        values.push(json!({
            "lambdas": lambdas,
            "values": SWEPT.map(|id| (id.to_owned(), json!(of(id)))).into_iter().collect::<serde_json::Map<_, _>>(),
        }));
        columns.push((lambdas.map(|lambda| lambda.to_string()).join(", "), items));
        progress.step();
    }
    progress.finish();
    let ndd: Vec<f64> = columns
        .iter()
        .filter_map(|(_, items)| items.iter().find(|item| item.definition.id == "ndd_edit")?.value)
        .collect();
    let (low, high) =
        ndd.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), &v| (low.min(v), high.max(v)));
    let titled: Vec<(&str, Vec<Item>)> =
        columns.iter().map(|(title, items)| (title.as_str(), items.clone())).collect();
    let mut text = evaluation::method_table("λ0, λ1, λ2", &titled, &SWEPT);
    if low > 0.0 && low.is_finite() {
        let _ = write!(text, "\n\nLargest over smallest ndd_edit: {:.3}.", high / low);
    }
    Ok((text, Value::Array(values)))
}
