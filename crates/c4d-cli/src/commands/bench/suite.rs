//! `c4d bench suite`: propagates every edit of every scene with every method, and writes tables.

mod file;
mod job;
mod tables;

use crate::args::{BenchSuiteArgs, Global};
use crate::console::Console;
use crate::failure::{Exit, Failure, Outcome};
use crate::output::output_failure;
use file::Suite;
use gs_io::FolderUpdate;
use job::{Job, Measured};
use serde_json::json;
use std::path::Path;

/// Names of the tables.
const TABLES: [&str; 2] = ["table.md", "table.csv"];

pub(crate) fn suite(args: &BenchSuiteArgs, global: &Global, console: &Console) -> Outcome {
    let suite = Suite::read(&args.suite)?;
    let jobs = Job::all(&suite, &args.output)?;
    let own = match args.part {
        Some(share) => &jobs[share.range(jobs.len())],
        None => &jobs[..],
    };
    // Detect a folder of other work before the first run, not after it.
    let found: Vec<Option<Measured>> =
        own.iter().map(|job| job.completed(global)).collect::<Outcome<_>>()?;
    let reused = found.iter().flatten().count();
    let step = console.of_step();
    let mut progress = console.progress("suite", own.len() as u64);
    let (mut measured, mut failed) = (Vec::new(), Vec::new());
    for (job, found) in own.iter().zip(found) {
        progress.message(job.name());
        match found.map_or_else(|| job.run(global, &step), Ok) {
            Ok(found) => measured.push(found),
            Err(failure) if failure.exit == Exit::Interrupted => return Err(failure),
            Err(failure) => {
                console.warn(format!("{}: {failure}", job.name()));
                failed.push(job.name());
            }
        }
        progress.step();
    }
    let computed = measured.len() - reused;
    progress.finish();
    console.note(format!("{computed} runs computed, {reused} reused, {} failed", failed.len()));
    if args.part.is_none() {
        let markdown = tables::markdown(&suite, &measured);
        write_tables(&args.output, [&markdown, &tables::csv(&suite, &measured)])?;
        console.result(markdown);
    }
    console.report(|| {
        json!({
            "runs": own.len(),
            "computed": computed,
            "reused": reused,
            "failed": failed,
            "measured": measured.iter().map(Measured::json).collect::<Vec<_>>(),
        })
    });
    console.output(&args.output, &[("runs", computed + reused)]);
    if failed.is_empty() {
        return Ok(());
    }
    Err(Failure::failed(format!("{} of {} runs failed: {}", failed.len(), own.len(), failed.join(", ")))
        .next("The warnings above give the reasons. Correct the file or the scene and repeat the command: completed runs are kept."))
}

/// Writes the tables; those of an earlier call are replaced.
fn write_tables(folder: &Path, texts: [&str; 2]) -> Outcome {
    std::fs::create_dir_all(folder).map_err(|error| Failure::write(folder, &error))?;
    let update = FolderUpdate::begin(folder).map_err(|error| output_failure(&error))?;
    for (name, text) in TABLES.into_iter().zip(texts) {
        let is_ours =
            std::fs::read_to_string(folder.join(name)).is_ok_and(|old| tables::is_table(&old));
        let written = update.write(name, text.as_bytes(), is_ours);
        written.map_err(|error| output_failure(&error))?;
    }
    Ok(())
}
