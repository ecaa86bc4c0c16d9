//! [`Suite`]: the TOML file.

use crate::evaluation;
use crate::failure::{Failure, Outcome};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Scenes, edits and methods. Paths are relative to the file; flags are those of the commands, and
/// paths in them are relative to the working folder.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Suite {
    /// Flags of `c4d eval` for every run.
    #[serde(default)]
    pub(super) eval: Vec<String>,
    /// Rows of the tables, as `c4d eval --metrics`.
    #[serde(default)]
    pub(super) metrics: Vec<String>,
    pub(super) scenes: Vec<SceneEntry>,
    pub(super) methods: Vec<MethodEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneEntry {
    pub(super) name: String,
    pub(super) path: PathBuf,
    /// Flags of `c4d propagate` for this scene.
    #[serde(default)]
    pub(super) flags: Vec<String>,
    /// Flags of `c4d eval` for this scene.
    #[serde(default)]
    pub(super) eval: Vec<String>,
    pub(super) edits: Vec<EditEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EditEntry {
    pub(super) name: String,
    pub(super) edited: PathBuf,
    /// Ground truth: the correct edited scene, or photographs.
    pub(super) truth: Option<PathBuf>,
    /// Flags of `c4d propagate` for this edit.
    #[serde(default)]
    pub(super) flags: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MethodEntry {
    pub(super) name: String,
    /// Flags of `c4d propagate`.
    #[serde(default)]
    pub(super) flags: Vec<String>,
}

impl Suite {
    pub(super) fn read(path: &Path) -> Outcome<Self> {
        let refused = |what: &dyn std::fmt::Display| {
            Failure::bad_input(format!("{}: {what}", path.display()))
        };
        let bytes = gs_io::read_file(path).map_err(|error| refused(&error))?;
        let text = String::from_utf8(bytes).map_err(|error| refused(&error))?;
        let mut suite: Self = toml::from_str(&text).map_err(|error| {
            refused(&error.to_string().trim_end()).next(
                "docs/SCALING.md describes the file: [[scenes]] with [[scenes.edits]], and [[methods]].",
            )
        })?;
        evaluation::chosen(&suite.metrics)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for scene in &mut suite.scenes {
            scene.path = folder.join(&scene.path);
            for edit in &mut scene.edits {
                edit.edited = folder.join(&edit.edited);
                edit.truth = edit.truth.as_ref().map(|truth| folder.join(truth));
            }
            unique(scene.edits.iter().map(|edit| edit.name.as_str()), "edits")
                .map_err(|what| refused(&format!("scene `{}`: {what}", scene.name)))?;
        }
        unique(suite.scenes.iter().map(|scene| scene.name.as_str()), "scenes")
            .map_err(|what| refused(&what))?;
        unique(suite.methods.iter().map(|method| method.name.as_str()), "methods")
            .map_err(|what| refused(&what))?;
        Ok(suite)
    }

    /// Ids of the metrics that the tables show.
    pub(super) fn shown(&self) -> Vec<&'static str> {
        if self.metrics.is_empty() {
            return evaluation::SHOWN.to_vec();
        }
        evaluation::chosen(&self.metrics).unwrap_or_default()
    }
}

/// Checks that names are unique and valid folder names.
fn unique<'a>(names: impl Iterator<Item = &'a str>, what: &str) -> Result<(), String> {
    let mut known = BTreeSet::new();
    for name in names {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || name.starts_with('.') || !name.chars().all(plain) {
            return Err(format!(
                "the name `{name}` among the {what}: expected letters, digits, - _ . (it names a folder)"
            ));
        }
        if !known.insert(name.to_ascii_lowercase()) {
            return Err(format!("two of the {what} are named `{name}`"));
        }
    }
    if known.is_empty() { Err(format!("no {what}")) } else { Ok(()) }
}
