//! Reading model folders.

use super::network::{self, Params};
use super::settings::Settings;
use super::{Swift4dError, flags, index_rule};
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::model_folder::{
    self, Canonical, DynamicSplitCounts, FlagReport, Iteration, Model, ModelReport, ModelScene,
    Origin, Overrides, Stage,
};
use crate::{ply, pth};
use gs_core::Splats;
use gs_deform::{FieldBox, HashGridField, HashGridScene, IndexRule};
use std::path::Path;

/// File of the field, next to the PLY.
const FIELD: &str = "FDHash.pth";
/// Column of the PLY with the dynamic score.
const SCORE: &str = "dynamic";

/// Whether a folder is a Swift4D model: the iteration that would be opened contains its field, or
/// else the score of its splats.
pub(crate) fn looks_like_model(dir: &Path) -> bool {
    let Ok(iteration) = model_folder::find(dir, None) else {
        return model_folder::has_in_iterations(dir, FIELD);
    };
    let has = |name: &str| iteration.dir.join(name).is_file();
    match (has(FIELD), has("deformation.pth")) {
        (true, false) => true,
        (false, true) => false,
        // If both or neither exist, the kind is determined from the PLY.
        _ => has_score(&iteration.dir.join("point_cloud.ply")),
    }
}

fn has_score(path: &Path) -> bool {
    ply::read_header_file(path)
        .ok()
        .and_then(|header| header.gaussians().ok())
        .is_some_and(|layout| layout.extra_columns.iter().any(|column| column == SCORE))
}

/// Opens a model folder, or one of its `iteration_<n>` folders.
///
/// # Errors
/// If files are missing, malformed or inconsistent, or do not determine the motion. Every error
/// names the file, and the flag that would resolve it, if any.
pub fn open(dir: &Path, overrides: &Overrides) -> Result<Model, IoError> {
    let Canonical { iteration, splats, mut report, cfg } =
        model_folder::read_canonical(dir, overrides)?;
    if iteration.stage == Stage::Coarse {
        let scene = model_folder::never_moving(&iteration, splats, &mut report)?;
        return Ok(Model { scene, report });
    }
    let path = iteration.dir.join(FIELD);
    if !path.is_file() {
        return Err(IoError::content(
            &path,
            "is missing, without which the model cannot move; copy it from the machine that \
            trained the model (training writes it next to point_cloud.ply), or choose a different \
            iteration",
        ));
    }
    let bytes = read_bytes(&path)?;
    let tensors =
        pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(IoError::format(&path))?;
    let params = Params::new(tensors).map_err(IoError::format(&path))?;
    let settings = flags::resolve(&params, cfg.as_ref(), &overrides.swift4d, &mut report)
        .map_err(Swift4dError::Flags)
        .map_err(IoError::format(&path))?;
    let dynamic = read_dynamic(&iteration, settings.dynamic_thro, &mut report)?;
    let field = field(&params, &settings, &splats, &dynamic, overrides, &mut report)
        .map_err(IoError::format(&path))?;
    let scene = HashGridScene::new(splats, dynamic, field)
        .and_then(|scene| scene.with_frames(settings.frames, settings.time_divisor))
        .map_err(IoError::format(&report.ply))?;
    describe(&mut report, &params, &settings, &scene);
    Ok(Model { scene: ModelScene::HashGrid(Box::new(scene)), report })
}

fn field(
    params: &Params<'_>,
    settings: &Settings,
    splats: &Splats,
    dynamic: &[bool],
    overrides: &Overrides,
    report: &mut ModelReport,
) -> Result<HashGridField, Swift4dError> {
    let bounds = params.bounds()?;
    bounds.check()?;
    let network = params.network(bounds, settings)?;
    let rule = index_rule(&network.grid, &bounds, splats, dynamic, overrides, report)?;
    let grid = network.grid.with_rule(rule);
    Ok(HashGridField::new(gs_deform::HashGridNetwork { grid, ..network })?)
}

/// The index rule with which the grid was trained.
fn index_rule(
    grid: &gs_deform::HashGrid,
    bounds: &FieldBox,
    splats: &Splats,
    dynamic: &[bool],
    overrides: &Overrides,
    report: &mut ModelReport,
) -> Result<IndexRule, Swift4dError> {
    let ambiguous = grid.shape().ambiguous_levels();
    let (rule, origin) = match overrides.swift4d.index_rule {
        Some(rule) => (rule, Origin::Override),
        None if ambiguous.is_empty() => {
            report.flags.push(FlagReport {
                name: "index_rule",
                value: "either (they agree for this table)".to_owned(),
                origin: Origin::Inferred,
            });
            return Ok(IndexRule::Current);
        }
        None => {
            let moving = splats.means.iter().zip(dynamic).filter(|(_, dynamic)| **dynamic);
            let xs: Vec<f32> =
                moving.filter_map(|(mean, _)| bounds.normalize(*mean)).map(|[x, _, _]| x).collect();
            let rule = index_rule::infer(grid, &xs).ok_or_else(|| Swift4dError::Flags(format!(
                "is evaluated differently by tiny-cuda-nn before and after 24 June 2025 (levels \
                {ambiguous:?}), and the table does not show which version trained it; set \
                index_rule=older for models trained before that date (including all released by \
                the authors), or index_rule=current"
            )))?;
            report.warnings.push(format!(
                "the version of tiny-cuda-nn that trained the model is not recorded; the unused entries of its table suggest index_rule={}. If fine detail trembles, override it",
                rule_name(rule)
            ));
            (rule, Origin::Inferred)
        }
    };
    let value = rule_name(rule).to_owned();
    report.flags.push(FlagReport { name: "index_rule", value, origin });
    Ok(rule)
}

/// Name of a rule in flags.
fn rule_name(rule: IndexRule) -> &'static str {
    match rule {
        IndexRule::Current => "current",
        IndexRule::Older => "older",
    }
}

/// Whether each remaining splat is dynamic: its score is strictly above the threshold.
fn read_dynamic(
    iteration: &Iteration,
    threshold: f32,
    report: &mut ModelReport,
) -> Result<Vec<bool>, IoError> {
    let path = iteration.dir.join("point_cloud.ply");
    if !has_score(&path) {
        return Err(IoError::format(&path)(Swift4dError::NoScore { column: SCORE }));
    }
    let scores = ply::read_column(&read_bytes(&path)?, SCORE).map_err(IoError::format(&path))?;
    let nan = scores.iter().filter(|score| score.is_nan()).count();
    if nan > 0 {
        report.warnings.push(format!(
            "{}: {nan} of {} dynamic scores are NaN: these Gaussians are static",
            path.display(),
            scores.len()
        ));
    }
    let is_dynamic = |score: &f32| *score > threshold;
    Ok(match &report.kept_rows {
        Some(kept) => kept.iter().map(|&row| is_dynamic(&scores[row])).collect(),
        None => scores.iter().map(is_dynamic).collect(),
    })
}

fn describe(
    report: &mut ModelReport,
    params: &Params<'_>,
    settings: &Settings,
    scene: &HashGridScene,
) {
    report.width = params.width();
    report.channels = settings.shape.features;
    report.levels = settings.shape.levels;
    report.depth = 2;
    report.heads = network::HEADS.to_vec();
    let num_dynamic = scene.dynamic().iter().filter(|dynamic| **dynamic).count();
    let num_moving = scene.moving_rows().len();
    report.split = Some(DynamicSplitCounts { num_dynamic, num_moving });
    if num_moving == 0 {
        report.warnings.push(format!(
            "this model is static: of {} Gaussians {num_dynamic} have a dynamic score above {}, \
            none of them in the field's box; check dynamic_thro",
            report.num_splats, settings.dynamic_thro
        ));
    }
}
