//! The run folder: everything `c4d propagate` made, small, and enough to open the edited scene again.
//!
//! | file | content |
//! |---|---|
//! | `scene.c4d` | safetensors: the edited splats of the edit frame, the sparse binding to the source, refined colours |
//! | `c4d.toml` | resolved configuration: inputs with fingerprints, options, seed, version |
//! | `run.json` | what happened: counts, convergence, timings, warnings |
//! | `refine.json` | report of the refinement |
//! | `refine.state`, `refine.images` | its checkpoint and its images while it is unfinished |
//!
//! The source scene is referred to, not copied; its fingerprint is checked when the run is opened.

mod checkpoint;
mod config;
mod fingerprint;
#[cfg(test)]
mod hostile;
mod kept_images;
mod scene_file;

pub(crate) use checkpoint::Checkpoint;
pub(crate) use config::{RefineConfig, RunConfig};
pub(crate) use fingerprint::fingerprint;
pub(crate) use kept_images::{KeptImages, MadeFrom};
pub(crate) use scene_file::{RefinedRows, Stored};

use crate::args::Global;
use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use crate::field::NetworkField;
use crate::passes::Mask;
use crate::scene::{self, Opened};
use amg::{EditedScene, RowKind};
use gs_io::SceneKind;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Edited scene, safetensors.
pub(crate) const SCENE: &str = "scene.c4d";
/// Resolved configuration.
pub(crate) const CONFIG: &str = "c4d.toml";
/// Report of the run.
pub(crate) const REPORT: &str = "run.json";
/// Report of the refinement.
pub(crate) const REFINE_REPORT: &str = "refine.json";
/// Checkpoint of an unfinished refinement.
pub(crate) const REFINE_STATE: &str = "refine.state";
/// Images of an unfinished refinement.
pub(crate) const REFINE_IMAGES: &str = "refine.images";
/// Previews of a refinement.
pub(crate) const PREVIEWS: &str = "previews";

/// Refuses what is not a folder.
pub(crate) fn check_is_folder(run: &Path) -> Outcome {
    if run.is_dir() {
        return Ok(());
    }
    Err(Failure::bad_input(format!("{} is not a run folder", run.display()))
        .next("Give the folder that c4d propagate wrote."))
}

/// A run as stored, with its source opened.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) config: RunConfig,
    pub(crate) stored: Stored,
    pub(crate) source: Opened,
}

/// Reads a run and opens its source.
pub(crate) fn load(path: &Path, global: &Global, console: &Console) -> Outcome<Loaded> {
    load_within(path, &[], global, console)
}

fn load_within(
    path: &Path,
    runs: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<Loaded> {
    let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    if runs.contains(&real) {
        return Err(Failure::bad_input(format!("the run {} is its own source", path.display()))
            .next(format!(
                "Correct `source` in {}, or write the run anew with c4d propagate.",
                path.join(CONFIG).display()
            )));
    }
    let mut runs = runs.to_vec();
    runs.push(real);
    let read = |name: &str| {
        let file = path.join(name);
        let bytes = gs_io::read_file(&file).map_err(|error| {
            Failure::bad_input(format!("cannot read {}: {error}", file.display()))
                .next("A run folder holds scene.c4d, c4d.toml and run.json; write it anew with c4d propagate.")
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
    let stored = Stored::deserialize(&read(SCENE)?).map_err(|what| damaged(path, SCENE, &what))?;
    let source_path = locate_source(path, &config)?;
    let source_global =
        Global { iteration: config.iteration, set: config.set.clone(), ..global.clone() };
    let source = scene::open_within(&source_path, &runs, &source_global, console)?;
    if fingerprint(&source.files)? != config.source_sha256 {
        console.warn(format!(
            "{} has changed since {} was made: its motion may no longer fit the edit. Run c4d propagate again.",
            source_path.display(),
            path.display()
        ));
    }
    Ok(Loaded { config, stored, source })
}

fn damaged(path: &Path, name: &str, what: &str) -> Failure {
    Failure::bad_input(format!("{}: {what}", path.join(name).display()))
        .next("The file is damaged or of another version; write the run anew with c4d propagate.")
}

impl Loaded {
    /// The edited scene; with its refined colours, if it has any and they are wanted.
    pub(crate) fn scene(&self, path: &Path, refined: bool) -> Outcome<EditedScene> {
        let Stored { edited, binding, .. } = &self.stored;
        let rows = self.stored.refined.as_ref().filter(|_| refined);
        let edited = Arc::new(rows.map_or_else(|| edited.clone(), |rows| rows.apply(edited)));
        let (source, binding) = (self.source.scene.clone(), Arc::new(binding.clone()));
        let time = self.config.edit_time;
        match &self.source.network {
            Some(network) if binding.count(RowKind::Field) > 0 => {
                let field = Arc::new(NetworkField(network.clone()));
                EditedScene::with_field(source, edited, time, binding, field)
            }
            _ => {
                let aggregation =
                    self.config.aggregation().map_err(|what| damaged(path, CONFIG, &what))?;
                EditedScene::new(source, edited, time, binding, aggregation)
            }
        }
        .map_err(|error| damaged(path, SCENE, &chain(&error)))
    }
}

/// Opens a run as a scene: its source, the edited frame, and the binding between them.
pub(crate) fn open(
    path: &Path,
    runs: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<Opened> {
    let loaded = load_within(path, runs, global, console)?;
    let scene = loaded.scene(path, true)?;
    let Loaded { config, stored, source } = loaded;
    let count = |kind| stored.binding.count(kind);
    let rows = format!(
        "{} unchanged, {} recoloured, {} moved, {} blended, {} static",
        count(RowKind::Unchanged),
        count(RowKind::Recoloured),
        count(RowKind::Moved),
        count(RowKind::Blended),
        count(RowKind::Static)
    );
    let refined = stored.refined.as_ref().map_or("no".to_owned(), |refined| {
        format!("{} splats have new colours", refined.changed(&stored.edited))
    });
    let facts = vec![
        ("source", source.path.display().to_string()),
        ("edited", config.edited.display().to_string()),
        ("edit time", config.edit_time.to_string()),
        (
            "method",
            format!("{}, baseline {}, motion {}", config.preset, config.baseline, config.motion),
        ),
        ("rows", rows),
        ("refined", refined),
    ];
    let mut files = vec![path.join(SCENE)];
    files.extend(source.files);
    let mut roots = vec![path.to_owned()];
    roots.extend(source.roots);
    Ok(Opened {
        roots,
        edit_time: config.edit_time,
        scene: Arc::new(scene),
        network: None,
        kind: SceneKind::RunFolder,
        path: path.to_owned(),
        original: Some(source.scene),
        up: source.up,
        fps: source.fps,
        background: source.background,
        mask: config.refine.as_ref().map_or_else(Mask::default, RefineConfig::mask),
        facts,
        files,
    })
}

fn locate_source(run: &Path, config: &RunConfig) -> Outcome<PathBuf> {
    let beside = run.join(&config.source_from_run);
    if beside.exists() {
        return Ok(beside);
    }
    if config.source.exists() {
        return Ok(config.source.clone());
    }
    Err(Failure::bad_input(format!(
        "the source scene of {} is gone: neither {} nor {} exists",
        run.display(),
        beside.display(),
        config.source.display()
    ))
    .next(format!("Put it back, or correct `source` in {}.", run.join(CONFIG).display())))
}

/// `target` as seen from the folder `from`; both absolute. `target` itself when they share no root.
pub(crate) fn relative(from: &Path, target: &Path) -> PathBuf {
    let (from, target): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (from.components().collect(), target.components().collect());
    let shared = from.iter().zip(&target).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n(Component::ParentDir, from.len() - shared);
    up.chain(target[shared..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_paths() {
        let relative = |from: &str, target: &str| relative(Path::new(from), Path::new(target));
        assert_eq!(relative("/a/b/run", "/a/b/source"), Path::new("../source"), "siblings");
        assert_eq!(relative("/a/run", "/c/d"), Path::new("../../c/d"), "far");
    }
}
