//! Makes a part of the images of a refinement, for `c4d gather`.

use super::errors::{check, failed};
use super::task::Task;
use crate::args::Global;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::output::{existing, output_failure, refuse_overlap};
use crate::part::{PartFolder, PartRecord, Share};
use crate::progress::StageProgress;
use crate::run_folder::{Checkpoint, KeptImages, MadeFrom, REFINE_IMAGES, SCENE, fingerprint};
use cuar::{RefineObserver, RefineProgress, ViewTime, make_images};
use gs_io::AtomicDir;
use gs_raster_cpu::CpuRasterizer;
use serde_json::json;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Renders the images in `share` for the refinement `begun` and writes them to a folder. The run is
/// not changed.
pub(super) fn write(
    (run, output): (&PathBuf, &Path),
    share: Share,
    begun: &Checkpoint,
    global: &Global,
    console: &Console,
) -> Outcome {
    let Checkpoint { preset, settings, flags, .. } = begun;
    let flags = &flags.absolute()?;
    check(flags, *preset, settings, global)?;
    refuse_overlap(output, std::slice::from_ref(run))?;
    let folder =
        AtomicDir::create(output, existing(global)).map_err(|error| output_failure(&error))?;
    let Some(task) = Task::open(run, *preset, settings, flags, global, console)? else {
        return Err(Failure::usage(format!("{}: nothing was edited", run.display()))
            .next("There is nothing to refine, and no part to make."));
    };
    let mut keep = Keep {
        folder: folder.path(),
        made_from: task.made_from()?,
        images: None,
        count: 0,
        console,
        progress: None,
        failure: None,
    };
    let Task { scene, edited, options, .. } = &task;
    let (before, views) = (task.before(), task.views());
    let range = |count: usize| share.range(count);
    let made = match &task.device {
        Device::Cpu => {
            let raster = CpuRasterizer::default();
            make_images(&raster, scene, &before, edited, &views, options, &range, &mut keep)
        }
        #[cfg(feature = "gpu")]
        Device::Gpu(raster) => {
            make_images(raster, scene, &before, edited, &views, options, &range, &mut keep)
        }
    };
    let Keep { made_from, progress, failure, count, .. } = keep;
    if let Some(progress) = progress {
        progress.finish();
    }
    let all = made.map_err(|error| failed(run, failure, error))?;
    let facts = [
        ("command", json!("refine")),
        ("run", json!(fingerprint(&[run.join(SCENE)])?)),
        ("images", json!(all)),
        ("made from", json!(made_from)),
        ("preset", json!(preset)),
        ("settings", json!(settings)),
        ("flags", json!(flags)),
    ];
    let work = facts.map(|(name, value)| (name.to_owned(), value)).into_iter().collect();
    PartFolder::write(PartRecord::new(share, work), folder.path())?;
    folder.commit().map_err(|error| output_failure(&error))?;
    console.note(format!("{share}: {count} of {all} images"));
    console.output(output, &[("images", count)]);
    Ok(())
}

/// Writes images as they are rendered. The first failed write ends the work.
struct Keep<'a> {
    folder: &'a Path,
    made_from: MadeFrom,
    images: Option<KeptImages>,
    count: usize,
    console: &'a Console,
    progress: Option<StageProgress>,
    failure: Option<Failure>,
}

impl RefineObserver for Keep<'_> {
    fn progress(&mut self, now: &RefineProgress) {
        let begin = || self.console.progress(now.stage, now.total as u64);
        self.progress.get_or_insert_with(begin).set(now.done as u64);
    }

    fn begin_images(&mut self, fingerprint: u64) {
        self.made_from.fingerprint = fingerprint;
        let path = self.folder.join(REFINE_IMAGES);
        let file = File::options().read(true).write(true).create_new(true).open(&path);
        let images = file
            .map_err(|error| Failure::write(&path, &error))
            .and_then(|file| KeptImages::of_file(file, &self.made_from));
        match images {
            Ok(images) => self.images = Some(images),
            Err(failure) => self.failure = Some(failure),
        }
    }

    fn store_image(&mut self, at: ViewTime, bytes: &[u8]) {
        let Some(images) = &mut self.images else { return };
        match images.put(at, bytes) {
            Ok(()) => self.count += 1,
            Err(error) => {
                let path = self.folder.join(REFINE_IMAGES);
                self.failure.get_or_insert_with(|| Failure::write(&path, &error));
            }
        }
    }

    fn cancelled(&mut self) -> bool {
        self.failure.is_some()
    }
}
