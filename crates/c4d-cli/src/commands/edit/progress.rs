//! [`ProgressObserver`]: progress, checkpoints and previews of a running fit.

use super::checkpoint;
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::output::output_failure;
use crate::progress::StageProgress;
use crate::renderer::side_by_side;
use gs_fit::{FitObserver, FitPreview, FitProgress, FitState};
use gs_io::{AtomicDir, Existing, FolderUpdate};
use std::path::{Path, PathBuf};

/// Files of the folder next to the output while the fit runs.
const STATE: &str = "fit.state";
const PREVIEW: &str = "preview.png";
/// The record of files that `gs_io` keeps in folders it writes.
const RECORD: &str = ".c4d-files";

/// The folder `OUTPUT.fit`, which contains the checkpoint and the preview until the fit ends.
#[derive(Debug)]
pub(super) struct WorkFolder {
    path: PathBuf,
    update: FolderUpdate,
}

impl WorkFolder {
    /// Path of the folder.
    fn path_of(output: &Path) -> PathBuf {
        let mut name = output.as_os_str().to_owned();
        name.push(".fit");
        PathBuf::from(name)
    }

    /// Makes the folder; with `resume`, opens the existing one and reads its checkpoint.
    pub(super) fn open(
        output: &Path,
        resume: bool,
        overwrite: bool,
    ) -> Outcome<(Self, Option<FitState>)> {
        let path = Self::path_of(output);
        let state = path.join(STATE);
        let failed = |error: gs_io::IoError| output_failure(&error);
        if resume {
            if !state.is_file() {
                return Err(Failure::usage(format!(
                    "--resume: there is no unfinished fit of {}",
                    output.display()
                ))
                .next("Omit --resume."));
            }
            let state = checkpoint::read(&state)?;
            let update = FolderUpdate::begin(&path).map_err(failed)?;
            return Ok((Self { path, update }, Some(state)));
        }
        if state.is_file() && !overwrite {
            return Err(Failure::usage(format!(
                "{} contains an unfinished fit of {}",
                path.display(),
                output.display()
            ))
            .next("--resume continues it; -w starts again."));
        }
        let existing = if overwrite { Existing::Replace } else { Existing::Refuse };
        let folder = AtomicDir::create(&path, existing).map_err(failed)?;
        folder.commit().map_err(failed)?;
        let update = FolderUpdate::begin(&path).map_err(failed)?;
        Ok((Self { path, update }, None))
    }

    /// Removes the files of the fit, and the folder if it is then empty.
    pub(super) fn remove(self) {
        let Self { path, update } = self;
        for name in [STATE, PREVIEW, RECORD] {
            let _ = update.remove(name);
        }
        drop(update);
        let _ = std::fs::remove_dir(path);
    }
}

/// Shows progress, writes checkpoints and previews. The first write that fails ends the fit.
pub(super) struct ProgressObserver<'a> {
    pub(super) folder: &'a WorkFolder,
    pub(super) progress: StageProgress,
    pub(super) failure: Option<Failure>,
    /// Whether there is a checkpoint, of this fit or of the resumed one.
    pub(super) has_state: bool,
}

impl ProgressObserver<'_> {
    fn note_failure(&mut self, outcome: Outcome) {
        if let Err(failure) = outcome {
            self.failure.get_or_insert(failure);
        }
    }
}

impl FitObserver for ProgressObserver<'_> {
    fn progress(&mut self, now: &FitProgress) {
        self.progress.set(now.done as u64);
        if let Some(loss) = now.loss {
            self.progress.message(format!("loss {loss:.5}, {} splats", now.splats));
        }
    }

    fn carving(&mut self, done: usize, most: usize) {
        self.progress
            .message(format!("looking for removed objects, round {} of at most {most}", done + 1));
    }

    fn preview(&mut self, preview: &FitPreview) {
        let image = side_by_side(&side_by_side(&preview.original, &preview.target), &preview.now);
        let mut bytes = Vec::new();
        let outcome = images::write_png(&mut bytes, Path::new(PREVIEW), &image).and_then(|()| {
            let written = self.folder.update.write(PREVIEW, &bytes, false);
            written.map_err(|error| output_failure(&error))
        });
        self.note_failure(outcome);
    }

    fn checkpoint(&mut self, state: &FitState) {
        let outcome = checkpoint::encode(state).and_then(|bytes| {
            let written = self.folder.update.write(STATE, &bytes, self.has_state);
            written.map_err(|error| output_failure(&error))
        });
        self.has_state = true;
        self.note_failure(outcome);
    }

    fn cancelled(&mut self) -> bool {
        self.failure.is_some()
    }
}
