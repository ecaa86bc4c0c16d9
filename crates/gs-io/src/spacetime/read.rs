//! Reading PLY files.

use super::SpacetimeError;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::model_folder;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::ply;
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use gs_core::sh;
use gs_deform::{Polynomial, PolynomialScene};
use std::path::{Path, PathBuf};

/// Columns in addition to those of 3DGS.
const COLUMNS: [&str; 15] = [
    "trbf_center",
    "trbf_scale",
    "motion_0",
    "motion_1",
    "motion_2",
    "motion_3",
    "motion_4",
    "motion_5",
    "motion_6",
    "motion_7",
    "motion_8",
    "omega_0",
    "omega_1",
    "omega_2",
    "omega_3",
];

/// Whether a PLY with these columns besides those of 3DGS is
/// from Spacetime Gaussians, lite or full.
pub(crate) fn has_columns(extra_columns: &[String]) -> bool {
    let has = |name: &str| extra_columns.iter().any(|column| column == name);
    has("trbf_center") && has("motion_0")
}

/// Opens a PLY file, or a model folder with such files in `point_cloud/iteration_N`.
///
/// # Errors
/// If the file cannot be read, lacks columns, or is of the full model.
pub fn open(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let (path, mut facts, mut notes) = locate(path, options)?;
    let bytes = read_bytes(&path)?;
    let read = ply::read(&bytes).map_err(IoError::format(&path))?;
    if read.extra_columns.iter().any(|column| column == "f_t_0" || column == "f_dc_3") {
        return Err(IoError::format(&path)(SpacetimeError::FullModel));
    }
    let columns = ply::read_columns(&bytes, &COLUMNS).map_err(IoError::format(&path))?;
    let mut motions: Vec<Polynomial> = (0..read.splats.len())
        .map(|row| {
            let value = |column: usize| columns[column][row];
            let three = |first: usize| [0, 1, 2].map(|k| value(first + k));
            Polynomial {
                velocity: [three(2), three(5), three(8)],
                omega: [0, 1, 2, 3].map(|k| value(11 + k)),
                centre: value(0),
                width: value(1).exp(),
            }
        })
        .collect();
    let broken = |row: usize| {
        // A width beyond single precision means that the splat does not fade.
        let finite = columns.iter().all(|column| column[row].is_finite());
        !finite || motions[row].width == 0.0
    };
    let mut splats = read.splats;
    let coeffs = splats.sh_coeffs();
    for dc in splats.sh.iter_mut().step_by(coeffs) {
        *dc = sh::dc_from_rgb(*dc);
    }
    let Sanitized { splats, kept, report } =
        repair::sanitize_with(splats, options.damage, broken).map_err(IoError::damaged(&path))?;
    if let Some(kept) = kept {
        motions = kept.into_iter().map(|row| motions[row]).collect();
    }
    notes.extend(read.notes);
    facts.push(("motion", "one cubic per splat (lite model)".to_owned()));
    let scene = PolynomialScene::new(splats, motions).map_err(IoError::format(&path))?;
    Ok(OpenedScene {
        facts,
        notes,
        repair: report,
        ..OpenedScene::new(SceneKind::Spacetime, scene, vec![path])
    })
}

type Facts = Vec<(&'static str, String)>;

/// The file, with facts and warnings about its model folder.
fn locate(path: &Path, options: &OpenOptions) -> Result<(PathBuf, Facts, Vec<String>), IoError> {
    if !path.is_dir() {
        return Ok((path.to_owned(), Vec::new(), Vec::new()));
    }
    let iteration = model_folder::find(path, options.iteration)?;
    let facts = vec![("iteration", iteration.number.to_string())];
    Ok((iteration.dir.join("point_cloud.ply"), facts, iteration.notes))
}
