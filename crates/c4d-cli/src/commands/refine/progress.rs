//! [`ProgressObserver`]: progress, checkpoints and previews of a running refinement.

use crate::args::{PresetArg, RefineFlags};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::output::output_failure;
use crate::progress::StageProgress;
use crate::renderer::side_by_side;
use crate::run_folder::{Checkpoint, KeptImages, MadeFrom, PREVIEWS};
use crate::settings::RefineSettings;
use cuar::{Preview, RefineObserver, State, ViewTime};
use gs_io::FolderUpdate;
use std::path::Path;

/// Shows progress, writes checkpoints and previews. The first write that fails ends the refinement.
pub(super) struct ProgressObserver<'a> {
    pub(super) update: &'a FolderUpdate,
    pub(super) preset: PresetArg,
    pub(super) settings: &'a RefineSettings,
    pub(super) flags: &'a RefineFlags,
    pub(super) console: &'a Console,
    pub(super) made_from: MadeFrom,
    /// Images stored for a later `--resume`.
    pub(super) images: Option<KeptImages>,
    pub(super) progress: Option<(&'static str, StageProgress)>,
    pub(super) failure: Option<Failure>,
}

impl ProgressObserver<'_> {
    /// Ends the progress display; returns the failure that ended the refinement, if any.
    pub(super) fn finish(self) -> Option<Failure> {
        if let Some((_, progress)) = self.progress {
            progress.finish();
        }
        self.failure
    }

    fn note_failure(&mut self, outcome: Outcome) {
        if let Err(failure) = outcome {
            self.failure.get_or_insert(failure);
        }
    }
}

impl RefineObserver for ProgressObserver<'_> {
    fn progress(&mut self, now: &cuar::RefineProgress) {
        if self.progress.as_ref().is_none_or(|(stage, _)| *stage != now.stage)
            && let Some((_, finished)) = self
                .progress
                .replace((now.stage, self.console.progress(now.stage, now.total as u64)))
        {
            finished.finish();
        }
        if let Some((_, progress)) = &mut self.progress {
            progress.set(now.done as u64);
            if let Some(loss) = now.loss {
                progress.message(format!("loss {loss:.5}"));
            }
        }
    }

    fn preview(&mut self, preview: &Preview) {
        let name = format!("{PREVIEWS}/view_{:03}_t_{:.3}.png", preview.view, preview.time);
        let image = side_by_side(&side_by_side(&preview.before, &preview.now), &preview.target);
        let write = || -> Outcome {
            let mut bytes = Vec::new();
            images::write_png(&mut bytes, Path::new(&name), &image)?;
            self.update.write(&name, &bytes, false).map_err(|error| output_failure(&error))
        };
        self.note_failure(write());
    }

    fn begin_images(&mut self, fingerprint: u64) {
        self.made_from.fingerprint = fingerprint;
        match KeptImages::open(self.update, &self.made_from) {
            Ok(images) => {
                if images.len() > 0 {
                    self.console.note(format!("{} images already exist", images.len()));
                }
                self.images = Some(images);
            }
            Err(failure) => self.note_failure(Err(failure)),
        }
    }

    fn stored_image(&mut self, at: ViewTime) -> Option<Vec<u8>> {
        self.images.as_mut()?.get(at)
    }

    fn store_image(&mut self, at: ViewTime, bytes: &[u8]) {
        // The refinement does not need the images on disk; without them, resuming takes longer.
        if let Some(images) = &mut self.images
            && let Err(error) = images.put(at, bytes)
        {
            images.clear();
            self.images = None;
            self.console.note(format!("images are not stored for --resume: {error}"));
        }
    }

    fn checkpoint(&mut self, state: &State) {
        let outcome =
            Checkpoint::write(self.update, self.preset, self.settings, self.flags, Some(state));
        self.note_failure(outcome);
    }

    fn cancelled(&mut self) -> bool {
        self.failure.is_some()
    }
}
