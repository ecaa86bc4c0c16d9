//! [`RunFiles`]: the stored files of a run folder.

use super::files::{CONFIG, REFINE_REPORT, REPORT, SCENE};
use super::{RunConfig, Stored, source_path};
use crate::failure::{Failure, Outcome};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Refuses a path that is not a folder with at least one of the files of a run.
pub(crate) fn check_is_folder(run: &Path) -> Outcome {
    if [CONFIG, SCENE].iter().any(|name| run.join(name).exists()) {
        return Ok(());
    }
    Err(Failure::bad_input(format!("{} is not a run folder", run.display()))
        .next("Specify the folder that c4d propagate wrote."))
}

/// The reports of a run, for `--json`: `run` and, if it was refined, `refine`.
pub(crate) fn reports(run: &Path) -> Value {
    let read = |file: &str| -> Option<Value> {
        serde_json::from_slice(&gs_io::read_file(&run.join(file)).ok()?).ok()
    };
    let found = [("run", read(REPORT)), ("refine", read(REFINE_REPORT))];
    found.into_iter().filter_map(|(name, report)| Some((name.to_owned(), report?))).collect()
}

/// A run as stored.
#[derive(Debug)]
pub(crate) struct RunFiles {
    pub(crate) config: RunConfig,
    pub(crate) stored: Stored,
    /// Path of its source.
    pub(crate) source: PathBuf,
}

impl RunFiles {
    /// Reads the files of the run folder `path`.
    pub(crate) fn read(path: &Path) -> Outcome<Self> {
        let read = |name: &str| {
            let file = path.join(name);
            let bytes = gs_io::read_file(&file).map_err(|error| {
                Failure::bad_input(format!("cannot read {}: {error}", file.display()))
                    .next("A run folder contains scene.c4d, c4d.toml and run.json; write it again with c4d propagate.")
            })?;
            match gs_io::UnsupportedFormat::stand_in(&bytes) {
                Some(found) => Err(Failure::bad_input(format!(
                    "{}: is {}, not the file itself",
                    file.display(),
                    found.name
                ))
                .next(found.next)),
                None => Ok(bytes),
            }
        };
        let text = String::from_utf8(read(CONFIG)?)
            .map_err(|error| damaged(path, CONFIG, &error.to_string()))?;
        let config: RunConfig =
            toml::from_str(&text).map_err(|error| damaged(path, CONFIG, error.message()))?;
        config.check().map_err(|what| damaged(path, CONFIG, &what))?;
        let stored =
            Stored::deserialize(&read(SCENE)?).map_err(|what| damaged(path, SCENE, &what))?;
        let source = source_path::locate(path, &config)?;
        Ok(Self { config, stored, source })
    }
}

/// Failure for a damaged file of a run.
pub(crate) fn damaged(path: &Path, name: &str, what: &str) -> Failure {
    Failure::bad_input(format!("{}: {what}", path.join(name).display()))
        .next("The file is damaged or from a different version; run c4d propagate again.")
}
