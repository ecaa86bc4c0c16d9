//! Messages about a written export.

use crate::args::ExportArgs;
use crate::console::Console;
use gs_io::FormatLosses;
use std::path::Path;
use std::time::Duration;

/// Losses of a sequence of 32-bit floats.
pub(super) fn plain_losses(args: &ExportArgs, available: usize) -> FormatLosses {
    let mut losses = FormatLosses::none();
    if let Some(degree) = args.sh_degree.filter(|&degree| degree < available) {
        losses.push(format!("SH degree {available} becomes {degree}"));
    }
    losses
}

/// Prints the size, the losses and the path of the output.
pub(super) fn note_written(
    output: &Path,
    elapsed: Duration,
    what: &str,
    losses: &FormatLosses,
    console: &Console,
) {
    let megabytes = size(output) as f64 / 1e6;
    console.note(format!("{megabytes:.1} MB in {:.1} s: {what}", elapsed.as_secs_f64()));
    note_losses(losses, console);
    console.output(output, &[]);
}

/// Prints the losses.
pub(crate) fn note_losses(losses: &FormatLosses, console: &Console) {
    for sentence in losses.sentences() {
        console.note(format!("not kept: {sentence}"));
    }
}

/// Size of a file, or of the files in a folder, bytes.
fn size(path: &Path) -> u64 {
    let of = |path: &Path| std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| of(&entry.path())).sum(),
        Err(_no_folder) => of(path),
    }
}
