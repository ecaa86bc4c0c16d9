//! [`Iteration`]: the save of a model folder to open.

use crate::cfg_args;
use crate::error::IoError;
use crate::fs::list_names;
use crate::fs::text;
use std::path::{Path, PathBuf};

/// Training stage in which an iteration was saved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Before the deformation was trained; static.
    Coarse,
    /// With deformation.
    Fine,
}

/// A saved iteration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Iteration {
    /// The model folder, which contains `cfg_args`.
    pub(crate) model: PathBuf,
    /// The folder of the iteration.
    pub(crate) dir: PathBuf,
    /// 0 if the folder's name has no number, as in `iteration_best`.
    pub(crate) number: u64,
    pub(crate) stage: Stage,
    /// Notes about other saves.
    pub(crate) notes: Vec<String>,
}

/// Stage and number of a folder of `point_cloud`: `iteration_<n>`, `coarse_iteration_<n>`, or a
/// name without a number.
fn stage_and_number(name: &str) -> (Stage, Option<u64>) {
    let (stage, rest) = match name.strip_prefix("coarse") {
        Some(rest) => (Stage::Coarse, rest.trim_start_matches('_')),
        None => (Stage::Fine, name),
    };
    let digits = rest
        .strip_prefix("iteration_")
        .filter(|digits| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()));
    (stage, digits.and_then(|digits| digits.parse().ok()))
}

/// The newest iteration of the fine stage in numeric order, or the requested one.
/// Folders without a number (`iteration_best`) are used only if none has one, saves
/// of the coarse stage only if there are no others.
pub(crate) fn find(dir: &Path, wanted: Option<u64>) -> Result<Iteration, IoError> {
    if let Some(iteration) = as_iteration(dir) {
        return Ok(iteration);
    }
    let saves = dir.join("point_cloud");
    if !saves.is_dir() {
        return Err(IoError::content(
            &saves,
            "is missing, and with it the splats (point_cloud/iteration_N/point_cloud.ply); copy it from the machine that trained the model",
        ));
    }
    let (mut found, incomplete): (Vec<_>, Vec<_>) = list_names(&saves)?
        .into_iter()
        .map(|name| (stage_and_number(&name), name))
        .partition(|(_, name)| saves.join(name).join("point_cloud.ply").is_file());
    // Fine before coarse, then the highest number, any number before none, then by name.
    found.sort_by_key(|((stage, number), _)| (*stage == Stage::Fine, *number));
    let chosen = match wanted {
        Some(_) => found.iter().rev().find(|((_, number), _)| *number == wanted),
        None => found.last(),
    };
    let Some(((stage, number), name)) = chosen else {
        let available: Vec<&str> = found.iter().map(|(_, name)| name.as_str()).collect();
        let what = match (wanted, available.is_empty()) {
            (Some(wanted), false) => {
                format!("has no iteration {wanted}; it has {}", available.join(", "))
            }
            _ => "contains no iteration_N/point_cloud.ply, so the splats are missing; copy that file from the machine that trained the model".to_owned(),
        };
        return Err(IoError::content(&saves, what));
    };
    let mut notes = Vec::new();
    if wanted.is_none() {
        let newer = |((stage, other), _): &&((Stage, Option<u64>), String)| {
            *stage == Stage::Fine && other.is_some() && other > number
        };
        for (_, newer) in incomplete.iter().filter(newer) {
            notes.push(format!(
                "{newer} is newer but contains no point_cloud.ply: {name} is used instead"
            ));
        }
        let unnumbered: Vec<&str> = found
            .iter()
            .filter(|((stage, number), other)| {
                *stage == Stage::Fine && number.is_none() && other != name
            })
            .map(|(_, name)| name.as_str())
            .collect();
        if !unnumbered.is_empty() {
            notes.push(format!(
                "{name} is used, not {}; pass the path of {} to use the latter",
                unnumbered.join(" or "),
                saves.join(unnumbered[0]).display()
            ));
        }
    }
    let (number, stage) = (number.unwrap_or(0), *stage);
    Ok(Iteration { model: dir.to_owned(), dir: saves.join(name), number, stage, notes })
}

/// The iteration, if the path is that of an iteration's folder.
fn as_iteration(dir: &Path) -> Option<Iteration> {
    // Made absolute first, because `.` and `..` have neither name nor parent.
    let dir =
        if dir.join("point_cloud.ply").is_file() { dir.canonicalize().ok()? } else { return None };
    let (stage, number) = stage_and_number(dir.file_name()?.to_str()?);
    let saves = dir.parent()?;
    // A folder without a number is an iteration only inside `point_cloud`.
    if number.is_none() && saves.file_name()? != "point_cloud" {
        return None;
    }
    let model = saves.parent()?.to_owned();
    Some(Iteration { model, dir, number: number.unwrap_or(0), stage, notes: Vec::new() })
}

/// Whether a folder looks like a model folder or one of its iterations, fine or coarse.
pub(crate) fn looks_like_model(dir: &Path) -> bool {
    find(dir, None).is_ok()
}

/// Whether an iteration of the folder contains a file of this name.
pub(crate) fn has_in_iterations(dir: &Path, file: &str) -> bool {
    let saves = dir.join("point_cloud");
    dir.join(file).is_file()
        || list_names(&saves)
            .is_ok_and(|names| names.iter().any(|name| saves.join(name).join(file).is_file()))
}

/// Whether an iteration of the folder contains a deformation, perhaps without splats.
pub(crate) fn has_network(dir: &Path) -> bool {
    DEFORMED.iter().any(|file| has_in_iterations(dir, file))
}

/// The newest `point_cloud.ply` of a plain 3DGS model: a folder with the layout of 4DGaussians
/// whose saves and settings contain no deformation. `None` for anything else.
pub(crate) fn still_model(dir: &Path) -> Option<PathBuf> {
    let iteration = find(dir, None).ok().filter(|iteration| iteration.stage == Stage::Fine)?;
    let moves = DEFORMED.iter().any(|file| {
        iteration.dir.join(file).is_file() || has_in_iterations(&iteration.model, file)
    });
    let path = iteration.model.join("cfg_args");
    let trained_to_move = || -> Option<bool> {
        let cfg = cfg_args::parse(&text::decode(&crate::fs::read_file(&path).ok()?)).ok()?;
        Some(DEFORMING.iter().any(|name| cfg.get(name).is_some()))
    };
    (!moves && !trained_to_move().unwrap_or(false)).then(|| iteration.dir.join("point_cloud.ply"))
}

/// Files that identify models with a deformation.
const DEFORMED: [&str; 4] =
    ["deformation.pth", "deformation_table.pth", "deformation_accum.pth", "FDHash.pth"];
/// Settings that identify their training.
const DEFORMING: [&str; 6] =
    ["kplanes_config", "net_width", "defor_depth", "dynamic_thro", "n_levels", "no_dx"];

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
        assert!(newest.notes[0].contains("iteration_30000 is newer"), "and is reported");
        assert!(newest.notes[1].contains("not iteration_x"), "{:?}", newest.notes);
        assert_eq!(find(dir.path(), Some(7000)).unwrap().number, 7000, "the requested iteration");
        let error = find(dir.path(), Some(1)).unwrap_err().to_string();
        assert!(error.contains("no iteration 1") && error.contains("iteration_7000"), "{error}");
        let direct = find(&saves.join("iteration_7000"), None).unwrap();
        assert_eq!(direct.number, 7000, "path of the iteration's folder");
        assert!(direct.model.join("point_cloud").is_dir(), "its model folder is found");
    }

    #[test]
    fn missing_parts_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let error = find(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("point_cloud") && error.contains("missing"), "{error}");
        fs::create_dir(dir.path().join("point_cloud")).unwrap();
        let error = find(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("no iteration_N/point_cloud.ply"), "{error}");
        assert_eq!(stage_and_number("iteration_"), (Stage::Fine, None), "no digits");
        assert_eq!(stage_and_number("iteration_-1"), (Stage::Fine, None), "sign");
        assert_eq!(stage_and_number("coarse_iteration_9"), (Stage::Coarse, Some(9)), "coarse");
    }

    #[test]
    fn unnumbered_iterations_are_found() {
        for name in ["iteration_best", "best", "iteration_30000_final"] {
            let dir = tempfile::tempdir().unwrap();
            let save = dir.path().join("point_cloud").join(name);
            fs::create_dir_all(&save).unwrap();
            fs::write(save.join("point_cloud.ply"), b"").unwrap();
            let found = find(dir.path(), None).unwrap();
            assert_eq!(
                (found.dir, found.number, found.stage),
                (save.clone(), 0, Stage::Fine),
                "{name}"
            );
            let direct = find(&save, None).unwrap();
            assert!(
                direct.model.join("point_cloud").is_dir(),
                "{name}: path of the iteration's \
                                      folder"
            );
        }
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("point_cloud.ply"), b"").unwrap();
        assert!(find(dir.path(), None).is_err(), "a frozen frame is not a model");
    }
}
