//! Reading model folders.

use super::{Checkpoint4dgsError, describe, flags, network};
use crate::cfg_args::CfgArgs;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::model_folder::{
    Canonical, Iteration, Model, ModelReport, ModelScene, Overrides, Stage, never_moving,
    read_canonical,
};
use crate::pth;
use gs_deform::{FieldError, HexPlaneField, HexPlaneScene};
use std::path::Path;

/// Opens a model folder, or one of its `iteration_<n>` folders.
///
/// # Errors
/// If files are missing or malformed, or the reference implementation cannot evaluate the network
/// either. Every error names the file.
pub fn open(dir: &Path, overrides: &Overrides) -> Result<Model, IoError> {
    let Canonical { iteration, splats, mut report, cfg } = read_canonical(dir, overrides)?;
    let scene = match iteration.stage {
        Stage::Coarse => never_moving(&iteration, splats, &mut report)?,
        Stage::Fine => {
            let (field, has_sh_head) =
                read_field(&iteration, cfg.as_ref(), overrides, &mut report)?;
            let scene = HexPlaneScene::new(splats, field).map_err(|source| {
                let advice = format!(
                    "{source}; if the model was trained without SH deformation, override no_dshs"
                );
                match source {
                    FieldError::Unsupported(_) => {
                        IoError::format(&report.ply)(Checkpoint4dgsError::Flags(advice))
                    }
                    _ => IoError::format(&report.ply)(source),
                }
            })?;
            let table = if has_sh_head { None } else { read_table(&iteration, &mut report)? };
            let scene = match table {
                None => scene,
                Some(moving) => scene.with_moving(&moving).map_err(IoError::format(&report.ply))?,
            };
            ModelScene::Deformed(Box::new(scene))
        }
    };
    Ok(Model { scene, report })
}

/// The network, and whether it is from a revision that deforms SH (and ignores the table).
fn read_field(
    iteration: &Iteration,
    cfg: Option<&CfgArgs>,
    overrides: &Overrides,
    report: &mut ModelReport,
) -> Result<(HexPlaneField, bool), IoError> {
    let path = iteration.dir.join("deformation.pth");
    if !path.is_file() {
        return Err(IoError::content(
            &path,
            "is missing, so the model cannot move; copy it from the machine that trained the model, or choose a different iteration with `--iteration`",
        ));
    }
    let bytes = read_bytes(&path)?;
    let wrong = IoError::format(&path);
    let tensors = pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(wrong)?;
    let tensors = network::Tensors::new(tensors);
    let shape =
        tensors.shape().map_err(Checkpoint4dgsError::Network).map_err(IoError::format(&path))?;
    let flags = flags::resolve(&shape, cfg, overrides, report)
        .map_err(Checkpoint4dgsError::Flags)
        .map_err(IoError::format(&path))?;
    describe::describe(report, &shape, &flags, &tensors);
    let network = tensors
        .network(&shape, &flags)
        .map_err(Checkpoint4dgsError::Network)
        .map_err(IoError::format(&path))?;
    let field = HexPlaneField::new(network).map_err(IoError::format(&path))?;
    Ok((field, shape.has_sh_head))
}

/// Rows that move according to the table of early revisions; `None` if
/// all move or the (optional) table is missing.
fn read_table(
    iteration: &Iteration,
    report: &mut ModelReport,
) -> Result<Option<Vec<bool>>, IoError> {
    let path = iteration.dir.join("deformation_table.pth");
    if !path.is_file() {
        return Ok(None);
    }
    let table = pth::with_file(&path, |root| Ok(root.into_tensor()?.to_f32s()))?;
    let rows = report.repair.rows;
    if table.len() != rows {
        return Err(IoError::format(&path)(Checkpoint4dgsError::Table {
            found: table.len(),
            rows,
        }));
    }
    let still = table.iter().filter(|&&moves| moves == 0.0).count();
    if still == 0 {
        return Ok(None);
    }
    report.warnings.push(format!(
        "{} marks {still} Gaussians as static, as revisions of autumn 2023 did",
        path.display()
    ));
    let moving = |row: usize| table[row] != 0.0;
    Ok(Some(match &report.kept_rows {
        Some(kept) => kept.iter().map(|&row| moving(row)).collect(),
        None => (0..rows).map(moving).collect(),
    }))
}
