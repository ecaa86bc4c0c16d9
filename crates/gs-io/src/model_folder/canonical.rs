//! [`Canonical`]: the part of a model folder that does not depend on the kind of its network.

use super::iteration::{Iteration, Stage, find};
use super::{ModelReport, ModelScene, Overrides};
use crate::cfg_args::{self, CfgArgs};
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::fs::text;
use crate::ply;
use crate::repair::{self, Sanitized};
use gs_core::Splats;
use gs_deform::StaticScene;
use std::path::Path;

/// Contents common to all model folders: the splats before
/// deformation, and the flags of the training run.
#[derive(Debug)]
pub(crate) struct Canonical {
    pub(crate) iteration: Iteration,
    /// Undamaged splats of the PLY.
    pub(crate) splats: Splats,
    pub(crate) report: ModelReport,
    pub(crate) cfg: Option<CfgArgs>,
}

/// Finds the iteration and reads its PLY and the flags of the training run.
pub(crate) fn read_canonical(dir: &Path, overrides: &Overrides) -> Result<Canonical, IoError> {
    let iteration = find(dir, overrides.iteration)?;
    let ply_path = iteration.dir.join("point_cloud.ply");
    let read = ply::read_file(&ply_path)?;
    let sanitized =
        repair::sanitize(read.splats, overrides.damage).map_err(IoError::damaged(&ply_path))?;
    let mut report = ModelReport::new(&iteration, ply_path, &sanitized);
    report.notes.extend(read.notes);
    report.warnings.extend(iteration.notes.iter().cloned());
    let cfg = read_cfg(&iteration, &mut report)?;
    report.white_background =
        cfg.as_ref().and_then(|cfg| cfg.get("white_background")).and_then(cfg_args::Value::as_bool);
    let Sanitized { splats, .. } = sanitized;
    Ok(Canonical { iteration, splats, report, cfg })
}

/// The scene of a save made before the deformation was trained.
pub(crate) fn never_moving(
    iteration: &Iteration,
    splats: Splats,
    report: &mut ModelReport,
) -> Result<ModelScene, IoError> {
    report.warnings.push(
        "the folder contains only saves of the coarse stage: this model is static".to_owned(),
    );
    let scene = StaticScene::new(splats)
        .map_err(|error| IoError::content(&iteration.dir, error.to_string()))?;
    Ok(ModelScene::Static(scene))
}

fn read_cfg(iteration: &Iteration, report: &mut ModelReport) -> Result<Option<CfgArgs>, IoError> {
    let path = iteration.model.join("cfg_args");
    if !path.is_file() {
        if iteration.stage == Stage::Coarse {
            return Ok(None); // There is no network whose flags could be guessed.
        }
        report.warnings.push(format!(
            "{} is missing: flags of the training run are guessed from the network; override them if the motion looks wrong",
            path.display()
        ));
        return Ok(None);
    }
    let cfg = match cfg_args::parse(&text::decode(&read_bytes(&path)?)) {
        Ok(cfg) => cfg,
        Err(source) => return Err(IoError::format(&path)(source)),
    };
    let (decisive, rest): (Vec<&str>, Vec<&str>) =
        cfg.unread.iter().map(String::as_str).partition(|name| DECISIVE.contains(name));
    if !decisive.is_empty() {
        report.warnings.push(format!(
            "cfg_args: values of {} cannot be parsed and are treated as missing; override them if \
            the motion looks wrong",
            decisive.join(", ")
        ));
    }
    if !rest.is_empty() {
        report.notes.push(format!(
            "cfg_args: fields that cannot be parsed, and are not needed: {}",
            rest.join(", ")
        ));
    }
    Ok(Some(cfg))
}

/// Fields of `cfg_args` that affect motion or appearance.
const DECISIVE: [&str; 20] = [
    "no_dx",
    "no_ds",
    "no_dr",
    "no_do",
    "no_dshs",
    "no_grid",
    "apply_rotation",
    "grid_pe",
    "net_width",
    "multires",
    "kplanes_config",
    "white_background",
    "activation",
    "dynamic_thro",
    "n_levels",
    "n_features_per_level",
    "hashmap_size",
    "base_resolution",
    "n_neurons",
    "source_path",
];
