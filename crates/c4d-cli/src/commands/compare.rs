//! `c4d compare`: runs side by side in one page.

mod numbers;
mod sections;
mod settings;

use crate::args::{CompareArgs, Global};
use crate::commands::eval::{self, Wanted};
use crate::console::Console;
use crate::device::Device;
use crate::evaluation;
use crate::failure::{Failure, Outcome};
use crate::output::{existing, output_failure, refuse_overlap};
use crate::report::{MAX_BYTES, Page};
use crate::run_folder::check_is_folder;
use crate::still;
use gs_io::AtomicFile;
use numbers::Numbers;
use sections::{Look, Picture};
use std::io::Write;
use std::path::Path;

/// Factors by which pictures shrink until the page is small enough.
const SHRINK: [f64; 4] = [1.0, 0.7, 0.5, 0.35];

pub(crate) fn run(args: &CompareArgs, global: &Global, console: &Console) -> Outcome {
    for run in &args.runs {
        check_is_folder(run)?;
    }
    refuse_overlap(&args.output, &args.runs)?;
    if !args.numbers.is_empty() && args.numbers.len() != args.runs.len() {
        return Err(Failure::usage(format!(
            "--numbers has {} files for {} runs",
            args.numbers.len(),
            args.runs.len()
        ))
        .next("Pass one metrics.json per run, in the same order."));
    }
    let mut file = AtomicFile::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let names = names(&args.runs);
    let mut measured = Vec::new();
    if args.numbers.is_empty() {
        let wanted = Wanted::core()?;
        for run in &args.runs {
            let found = eval::evaluate(run, &args.measure, &wanted, None, global, console)?;
            measured.push(Numbers::of(found.document, run)?);
        }
    } else {
        for path in &args.numbers {
            measured.push(Numbers::read(path)?);
        }
    }
    numbers::refuse_other_parameters(&measured, &names)?;
    let device = Device::open(global.gpu)?;
    let mut pictures = Vec::new();
    for run in &args.runs {
        pictures.push(still::open(run, None, global, console)?);
    }
    let truth = match &args.measure.truth {
        Some(path) if path.exists() && !evaluation::holds_images(path) => {
            Some(still::open(path, None, global, console)?)
        }
        _ => None,
    };
    let look = Look {
        runs: pictures.iter().zip(&names).map(|(opened, name)| Picture { opened, name }).collect(),
        truth: truth.as_ref(),
        numbers: &measured,
        device: &device,
    };
    let title = if names.len() == 1 { names[0].clone() } else { names.join(", ") };
    let mut html = String::new();
    for shrink in SHRINK {
        let mut page = Page::default();
        page.section("first", "Largest differences", &look.first(shrink)?);
        page.section("sheet", "Over time", &look.sheet(shrink)?);
        page.section("curves", "Curves", &look.curves());
        page.section("numbers", "Numbers", &look.table(false));
        page.section("cost", "Cost", &look.table(true));
        page.section("settings", "Settings that differ", &settings::differing(&args.runs, &names));
        page.section("warnings", "Warnings", &settings::warnings(&args.runs, &names));
        html = page.html(&title, &measured[0].subtitle());
        if html.len() <= MAX_BYTES {
            break;
        }
    }
    if html.len() > MAX_BYTES {
        return Err(Failure::failed(format!(
            "the page would have {} bytes, more than {MAX_BYTES}",
            html.len()
        ))
        .next("Compare fewer runs."));
    }
    file.write_all(html.as_bytes()).map_err(|error| Failure::write(&args.output, &error))?;
    file.commit().map_err(|error| output_failure(&error))?;
    console.note(format!("{} runs, {:.1} MB", names.len(), html.len() as f64 / 1e6));
    console.output(&args.output, &[]);
    Ok(())
}

/// The shortest distinct names of the runs.
fn names(runs: &[std::path::PathBuf]) -> Vec<String> {
    let parts = |run: &Path, count: usize| -> String {
        let all: Vec<String> =
            run.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
        all[all.len().saturating_sub(count)..].join("/")
    };
    let longest = runs.iter().map(|run| run.components().count()).max().unwrap_or(1);
    for count in 1..=longest {
        let names: Vec<String> = runs.iter().map(|run| parts(run, count)).collect();
        if (0..names.len()).all(|i| !names[..i].contains(&names[i])) {
            return names;
        }
    }
    (1..).zip(runs).map(|(k, run)| format!("{k}: {}", run.display())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_runs_are_distinct() {
        let of = |runs: &[&str]| names(&runs.iter().map(Into::into).collect::<Vec<_>>());
        assert_eq!(of(&["a/run", "b"]), ["run", "b"], "last parts");
        assert_eq!(of(&["a/run", "b/run"]), ["a/run", "b/run"], "more where needed");
        assert_eq!(of(&["run", "run"]), ["1: run", "2: run"], "equal names");
    }
}
