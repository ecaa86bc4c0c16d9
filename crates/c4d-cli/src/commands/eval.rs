//! `c4d eval`: measures a run, or compares a scene with ground truth.

mod ablation;
mod judges;
mod measure;

pub(super) use measure::{Evaluated, Wanted, evaluate};

use crate::args::{EvalArgs, Global, JudgeArg};
use crate::console::Console;
use crate::device::Device;
use crate::evaluation;
use crate::failure::{Failure, Outcome};
use crate::output::{existing, output_failure, refuse_overlap};
use crate::still;
use gs_io::AtomicFile;
use measure::view_flags;
use serde_json::Value;
use std::io::Write;
use std::path::Path;

pub(crate) fn run(args: &EvalArgs, global: &Global, console: &Console) -> Outcome {
    if args.ablation {
        return ablation::run(args, global, console);
    }
    if args.edited.is_some() {
        return Err(Failure::usage("--edited applies to --ablation only").next("Add --ablation."));
    }
    if let [judge, folder] = &args.emit[..] {
        return emit(args, judge, Path::new(folder), global, console);
    }
    let judged = args.ingest.as_deref().map(judges::ingest).transpose()?;
    let wanted = Wanted::of(args, console)?;
    let output = match &args.output {
        Some(path) => {
            refuse_overlap(path, std::slice::from_ref(&args.run))?;
            let file = AtomicFile::create(path, existing(global))
                .map_err(|error| output_failure(&error))?;
            Some((path, file))
        }
        None => None,
    };
    let Evaluated { mut document, items } =
        evaluate(&args.run, &args.measure, &wanted, args.part, global, console)?;
    if let Some(judged) = &judged {
        document["judged"] = Value::Array(judged.clone());
    }
    if let Some((path, mut file)) = output {
        let text = serde_json::to_string_pretty(&document).map_err(Failure::failed)?;
        writeln!(file, "{text}").map_err(|error| Failure::write(path, &error))?;
        file.commit().map_err(|error| output_failure(&error))?;
        console.wrote(path);
    }
    console.report(|| document);
    console.result(evaluation::table(&items));
    for score in judged.iter().flatten() {
        let text = |name: &str| evaluation::number(score[name].as_f64().unwrap_or(f64::NAN));
        console.result(format!(
            "judged: {} {} ±{} of {}",
            score["id"].as_str().unwrap_or_default(),
            text("value"),
            text("std"),
            text("count")
        ));
    }
    Ok(())
}

/// Writes the input of a learned judge.
fn emit(
    args: &EvalArgs,
    judge: &str,
    folder: &Path,
    global: &Global,
    console: &Console,
) -> Outcome {
    let judge = <JudgeArg as clap::ValueEnum>::from_str(judge, true).map_err(|_unknown| {
        Failure::usage(format!("--emit {judge}: expected editscore or vebench"))
    })?;
    let opened = still::open(&args.run, None, global, console)?;
    let Some(source) = &opened.original else {
        return Err(Failure::usage(format!(
            "{} is not a run: there is nothing to compare it with",
            args.run.display()
        ))
        .next("Specify the folder that c4d propagate wrote."));
    };
    refuse_overlap(folder, &opened.roots)?;
    let at = evaluation::viewpoints(&view_flags(&args.measure), &opened, console)?;
    let case = judges::Case {
        source: source.as_ref(),
        scene: opened.scene.as_ref(),
        at: &at,
        background: args.measure.background.unwrap_or(opened.background),
        prompt: args.prompt.as_deref().unwrap_or_default(),
    };
    let count = judges::emit(judge, folder, &case, global, &Device::open(global.gpu)?)?;
    console.output(folder, &[("jobs", count)]);
    Ok(())
}
