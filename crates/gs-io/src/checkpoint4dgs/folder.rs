//! Which saved iteration of a model folder to open.

use super::Stage;
use crate::error::{IoError, list_names};
use std::path::{Path, PathBuf};

/// A saved iteration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Iteration {
    /// The model folder, where `cfg_args` lies.
    pub(crate) model: PathBuf,
    /// The folder of the iteration.
    pub(crate) dir: PathBuf,
    pub(crate) number: u64,
    pub(crate) stage: Stage,
    /// Newer iterations that hold no PLY.
    pub(crate) passed_over: Vec<String>,
}

/// `iteration_<n>` or `coarse_iteration_<n>`, digits only.
pub(super) fn parse_name(name: &str) -> Option<(Stage, u64)> {
    let (stage, digits) = match name.strip_prefix("coarse_iteration_") {
        Some(digits) => (Stage::Coarse, digits),
        None => (Stage::Fine, name.strip_prefix("iteration_")?),
    };
    let number =
        digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())??;
    Some((stage, number))
}

/// The newest iteration of the fine stage in numeric order, or the one asked for; saves of the coarse stage only when there is
/// nothing else.
pub(crate) fn find(dir: &Path, wanted: Option<u64>) -> Result<Iteration, IoError> {
    if let Some(iteration) = as_iteration(dir) {
        return Ok(iteration);
    }
    let saves = dir.join("point_cloud");
    if !saves.is_dir() {
        return Err(IoError::content(
            &saves,
            "is missing; expected a model folder of 4DGaussians or Swift4D with point_cloud/iteration_<n>/ inside",
        ));
    }
    let named = list_names(&saves)?;
    let (mut found, incomplete): (Vec<_>, Vec<_>) = named
        .into_iter()
        .filter_map(|name| parse_name(&name).map(|(stage, number)| (stage, number, name)))
        .partition(|(_, _, name)| saves.join(name).join("point_cloud.ply").is_file());
    // Fine beats coarse, then the higher number wins; equal numbers written differently by name.
    found.sort_by_key(|(stage, number, _)| (*stage == Stage::Fine, *number));
    let chosen = match wanted {
        Some(wanted) => found.iter().rev().find(|(_, number, _)| *number == wanted),
        None => found.last(),
    };
    let Some((stage, number, name)) = chosen else {
        let available: Vec<&str> = found.iter().map(|(_, _, name)| name.as_str()).collect();
        let what = match (wanted, available.is_empty()) {
            (Some(wanted), false) => {
                format!("has no iteration {wanted}; it has {}", available.join(", "))
            }
            _ => "holds no iteration_<n>/point_cloud.ply; was the model saved?".to_owned(),
        };
        return Err(IoError::content(&saves, what));
    };
    let passed_over = incomplete
        .into_iter()
        .filter(|(other_stage, other, _)| {
            wanted.is_none() && *other_stage == Stage::Fine && other > number
        })
        .map(|(_, _, name)| name)
        .collect();
    Ok(Iteration {
        model: dir.to_owned(),
        dir: saves.join(name),
        number: *number,
        stage: *stage,
        passed_over,
    })
}

/// A path straight to an iteration's folder.
fn as_iteration(dir: &Path) -> Option<Iteration> {
    // Made absolute first: `.` and `..` have no name and no parent to look at.
    let dir =
        if dir.join("point_cloud.ply").is_file() { dir.canonicalize().ok()? } else { return None };
    let (stage, number) = parse_name(dir.file_name()?.to_str()?)?;
    let model = dir.parent()?.parent()?.to_owned();
    Some(Iteration { model, dir, number, stage, passed_over: Vec::new() })
}

/// Whether a folder looks like a model folder or one of its iterations, fine or coarse.
pub(crate) fn looks_like_model(dir: &Path) -> bool {
    find(dir, None).is_ok()
}

/// First file of this name in an iteration of the folder.
pub(crate) fn has_in_iterations(dir: &Path, file: &str) -> bool {
    let saves = dir.join("point_cloud");
    dir.join(file).is_file()
        || list_names(&saves).is_ok_and(|names| {
            names
                .iter()
                .any(|name| parse_name(name).is_some() && saves.join(name).join(file).is_file())
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn newest_is_numeric_and_fine() {
        let dir = tempfile::tempdir().unwrap();
        let saves = dir.path().join("point_cloud");
        for name in ["iteration_7000", "iteration_20000", "coarse_iteration_99000", "iteration_x"] {
            fs::create_dir_all(saves.join(name)).unwrap();
            fs::write(saves.join(name).join("point_cloud.ply"), b"").unwrap();
        }
        fs::create_dir_all(saves.join("iteration_30000")).unwrap();
        let newest = find(dir.path(), None).unwrap();
        assert_eq!((newest.number, newest.stage), (20_000, Stage::Fine), "30000 has no PLY");
        assert_eq!(newest.passed_over, ["iteration_30000"], "and is reported");
        assert_eq!(find(dir.path(), Some(7000)).unwrap().number, 7000, "asked for");
        let error = find(dir.path(), Some(1)).unwrap_err().to_string();
        assert!(error.contains("no iteration 1") && error.contains("iteration_7000"), "{error}");
        let direct = find(&saves.join("iteration_7000"), None).unwrap();
        assert_eq!(direct.number, 7000, "straight to the folder");
        assert!(direct.model.join("point_cloud").is_dir(), "its model folder is found");
    }

    #[test]
    fn missing_parts_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let error = find(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("point_cloud") && error.contains("missing"), "{error}");
        fs::create_dir(dir.path().join("point_cloud")).unwrap();
        let error = find(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("no iteration_<n>/point_cloud.ply"), "{error}");
        assert_eq!(parse_name("iteration_"), None, "no digits");
        assert_eq!(parse_name("iteration_-1"), None, "sign");
    }
}
