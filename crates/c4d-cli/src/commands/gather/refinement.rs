//! Joins the images of `c4d refine --part`, and refines the run with them.

use crate::args::Global;
use crate::commands::refine;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::output::output_failure;
use crate::part::{Part, PartRecord, broken};
use crate::run_folder::{
    self, Checkpoint, KeptImages, MadeFrom, REFINE_IMAGES, SCENE, fingerprint,
};
use gs_io::FolderUpdate;
use serde::de::DeserializeOwned;
use std::path::Path;

pub(super) fn join(
    parts: &[Part<Vec<String>>],
    run: &Path,
    global: &Global,
    console: &Console,
) -> Outcome {
    let (first, record, _) = &parts[0];
    run_folder::check_is_folder(run)?;
    if record.work("run").as_str() != Some(&fingerprint(&[run.join(SCENE)])?) {
        return Err(Failure::usage(format!(
            "{} is not the run of which {} is a part, or has changed since",
            run.display(),
            first.display()
        ))
        .next("Pass the run of c4d refine RUN --part K/N as -o RUN; if it was changed, make the parts again."));
    }
    let made_from: MadeFrom = read(record, "made from", first)?;
    let device = Device::open(global.gpu)?.describe();
    if device != made_from.device {
        return Err(Failure::usage(format!(
            "the parts were made on {}, this is {device}",
            made_from.device
        ))
        .next(
            "Choose the same device with --gpu, here or for the parts: images differ by rounding.",
        ));
    }
    let count: usize = read(record, "images", first)?;
    let begun = Checkpoint {
        preset: read(record, "preset", first)?,
        settings: read(record, "settings", first)?,
        flags: read(record, "flags", first)?,
        state: None,
        is_resumed: true,
    };
    let update = FolderUpdate::begin(run).map_err(|error| output_failure(&error))?;
    let mut images = KeptImages::open(&update, &made_from)?;
    for (path, record, files) in parts {
        let expected = record.range(count).len();
        let mut found = 0;
        if files.iter().any(|name| name == REFINE_IMAGES) {
            let refused = |error: std::io::Error| broken(path, &error.to_string());
            let file = gs_io::open_file(&path.join(REFINE_IMAGES)).map_err(refused)?;
            let part = KeptImages::read(file, &made_from).map_err(refused)?;
            let mut part =
                part.ok_or_else(|| broken(path, "its images belong to a different run"))?;
            for at in part.keys() {
                let bytes = part.get(at).ok_or_else(|| broken(path, "an image is damaged"))?;
                images
                    .put(at, &bytes)
                    .map_err(|error| Failure::write(&run.join(REFINE_IMAGES), &error))?;
                found += 1;
            }
        }
        if found != expected {
            return Err(broken(path, &format!("{found} images, expected {expected}")));
        }
    }
    drop(images);
    drop(update);
    refine::refine(run, begun, global, console)?;
    console.report(|| run_folder::reports(run));
    console.output(run, &[]);
    Ok(())
}

/// An entry of the record.
fn read<T: DeserializeOwned>(record: &PartRecord, name: &str, part: &Path) -> Outcome<T> {
    serde_json::from_value(record.work(name).clone())
        .map_err(|error| broken(part, &format!("{name}: {error}")))
}
