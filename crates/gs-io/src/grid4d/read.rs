//! Reading model folders.

use super::{Grid4dError, grids};
use crate::cfg_args::Value;
use crate::deform_folder::DeformFolder;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::pth::{self, Layers};
use crate::scene_kind::SceneKind;
use gs_deform::{Attention, SmoothGrid, SmoothGridField, SmoothGridNetwork, SmoothGridScene};
use std::path::Path;

/// Column of DASH's PLY.
const DYNAMIC: &str = "dynamic";

/// Opens a model folder of Grid4D, or one of the iterations of its point cloud.
///
/// # Errors
/// If files are missing or malformed, or required settings are missing. Every error names the file.
pub fn open(dir: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    open_either(dir, options, SceneKind::Grid4d, |_| Vec::new())
}

/// Opens a model folder of DASH, or one of the iterations of its point cloud.
///
/// # Errors
/// As [`open`].
pub fn open_dash(dir: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    open_either(dir, options, SceneKind::Dash, |_| vec![DYNAMIC.to_owned()])
}

fn open_either(
    dir: &Path,
    options: &OpenOptions,
    kind: SceneKind,
    columns: impl FnOnce(&[String]) -> Vec<String>,
) -> Result<OpenedScene, IoError> {
    let mut folder = DeformFolder::read(dir, options, columns)?;
    let path = folder.network.clone();
    let bytes = read_bytes(&path)?;
    let tensors =
        pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(IoError::format(&path))?;
    let layers = Layers::new(tensors);
    let field = field(&layers, &folder, options).map_err(IoError::format(&path))?;
    folder.facts.push(("network", format!("hash grids, width {}", field.width())));
    let background = folder.background();
    let dynamic = folder
        .columns
        .first()
        .map(|column| column.iter().map(|&value| value != 0.0).collect::<Vec<bool>>());
    if let Some(dynamic) = &dynamic {
        let moving = dynamic.iter().filter(|dynamic| **dynamic).count();
        folder.facts.push((
            "dynamic",
            format!("{moving} of {} splats; the others are static", dynamic.len()),
        ));
    }
    let scene =
        SmoothGridScene::new(folder.splats, field, dynamic).map_err(IoError::format(&path))?;
    Ok(OpenedScene {
        facts: folder.facts,
        notes: folder.notes,
        repair: folder.repair,
        background,
        ..OpenedScene::new(kind, scene, folder.files)
    })
}

fn field(
    layers: &Layers<'_>,
    folder: &DeformFolder,
    options: &OpenOptions,
) -> Result<SmoothGridField, Grid4dError> {
    let grids_of = |names: &[(&str, &[usize])]| -> Result<Vec<SmoothGrid>, Grid4dError> {
        names.iter().map(|(name, axes)| grids::grid(layers, name, axes)).collect()
    };
    let is_dash = layers.has("1.d4_mlp.0.weight");
    let (attention, grids, trunk) = if is_dash {
        (None, grids_of(&[("xyzt", &[0, 1, 2, 3])])?, layers.linear("1.d4_mlp.0")?)
    } else {
        let attention = Attention {
            grid: grids::grid(layers, "xyz", &[0, 1, 2])?,
            layer: layers.linear("1.spatial_mlp.0")?,
            directional: directional(folder),
        };
        let grids = grids_of(&[("xyt", &[0, 1, 3]), ("yzt", &[1, 2, 3]), ("xzt", &[0, 2, 3])])?;
        (Some(attention), grids, layers.linear("1.temporal_mlp.0")?)
    };
    Ok(SmoothGridField::new(SmoothGridNetwork {
        bound: bound(folder, options)?,
        scale: scale(folder)?,
        attention,
        grids,
        trunk,
        hidden: layers.sequence(|index| format!("1.grid_mlp.{}", 2 * index))?,
        warp: layers.linear("1.gaussian_warp")?,
        rotation: layers.linear("1.gaussian_rotation")?,
        scaling: layers.linear("1.gaussian_scaling")?,
    })?)
}

#[expect(clippy::cast_possible_truncation, reason = "options are single precision in training")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Half the side of the cube, given by the user or by `cfg_args`.
fn bound(folder: &DeformFolder, options: &OpenOptions) -> Result<f32, Grid4dError> {
    let stated = || folder.cfg.get("grid_args")?.get("bound")?.as_f64().map(single);
    options.bound.or_else(stated).ok_or(Grid4dError::Bound)
}

/// Whether attention is `2σ − 1`, as in every published configuration.
fn directional(folder: &DeformFolder) -> bool {
    let stated = || folder.cfg.get("network_args")?.get("directional")?.as_bool();
    stated().unwrap_or(true)
}

/// Factor of positions per axis.
fn scale(folder: &DeformFolder) -> Result<[f32; 3], Grid4dError> {
    match folder.cfg.get("scale_xyz") {
        None => Ok([1.0; 3]),
        Some(Value::List(items)) => {
            let numbers: Vec<f32> = items.iter().filter_map(Value::as_f64).map(single).collect();
            numbers.try_into().map_err(|_not_three| Grid4dError::Scale)
        }
        Some(value) => value.as_f64().map(|factor| [single(factor); 3]).ok_or(Grid4dError::Scale),
    }
}
