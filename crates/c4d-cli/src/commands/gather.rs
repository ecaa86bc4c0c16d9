//! `c4d gather`: joins parts written with `--part`. The result equals that of the whole command.

mod images;
mod metrics;
mod refinement;

use crate::args::{GatherArgs, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::output::refuse_overlap;
use crate::part::{Part, PartFolder, in_order};
use serde_json::Value;

pub(crate) fn run(args: &GatherArgs, global: &Global, console: &Console) -> Outcome {
    for path in &args.parts {
        if !path.exists() {
            return Err(Failure::bad_input(format!("{}: no such part", path.display())));
        }
    }
    refuse_overlap(&args.output, &args.parts)?;
    if args.parts.iter().all(|path| path.is_file()) {
        let parts: Vec<Part<Value>> =
            args.parts.iter().map(|path| metrics::read(path)).collect::<Outcome<_>>()?;
        let parts = in_order(parts)?;
        return metrics::join(&parts, &args.output, global, console);
    }
    let mut parts = Vec::new();
    for path in &args.parts {
        if !PartFolder::is_at(path) {
            return Err(Failure::bad_input(format!(
                "{} is not a part; c4d render, eval and refine write parts with --part",
                path.display()
            ))
            .next("Pass the outputs of --part 1/N to --part N/N, and nothing else."));
        }
        let PartFolder { record, files } = PartFolder::read(path)?;
        parts.push((path.clone(), record, files.into_keys().collect::<Vec<String>>()));
    }
    let parts = in_order(parts)?;
    match parts[0].1.work("command").as_str() {
        Some("render") => images::join(&parts, &args.output, global, console),
        Some("refine") => refinement::join(&parts, &args.output, global, console),
        _ => Err(crate::part::broken(&parts[0].0, "its command is unknown")),
    }
}
