//! Reading `params.npz`.

use super::Dynamic3dgsError;
use super::array::Arrays;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use gs_core::{Splats, sh};
use gs_deform::TabulatedScene;
use std::path::{Path, PathBuf};

/// Name of the file.
const FILE: &str = "params.npz";
/// An array that identifies these archives.
const MARK: &str = "means3D.npy";

/// Whether an archive with these entries is of this kind.
pub(crate) fn is_archive(names: &[String]) -> bool {
    names.iter().any(|name| name == MARK)
}

/// The file in a folder, if present.
pub(crate) fn file_of(dir: &Path) -> Option<PathBuf> {
    Some(dir.join(FILE)).filter(|path| path.is_file())
}

/// Opens a `params.npz`, or the folder that contains one.
///
/// # Errors
/// If the file cannot be read, or arrays are missing or have inconsistent shapes.
pub fn open(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    if path.is_dir() && file_of(path).is_none() {
        let what = format!("contains no {FILE}; copy it from the machine that trained the model");
        return Err(IoError::content(path, what));
    }
    let path = file_of(path).unwrap_or_else(|| path.to_owned());
    let mut arrays = Arrays::open(read_bytes(&path)?).map_err(IoError::format(&path))?;
    let frames = frames(&mut arrays).map_err(IoError::format(&path))?;
    let count = frames.len();
    let (frames, report) = without_damage(frames, options).map_err(IoError::damaged(&path))?;
    let scene = TabulatedScene::new(frames).map_err(IoError::format(&path))?;
    Ok(OpenedScene {
        facts: vec![("frames", count.to_string())],
        repair: report,
        ..OpenedScene::new(SceneKind::Dynamic3dgs, scene, vec![path])
    })
}

fn frames(arrays: &mut Arrays) -> Result<Vec<Splats>, Dynamic3dgsError> {
    let means = arrays.read("means3D")?;
    let &[count, n, 3] = &means.shape[..] else {
        return Err(Dynamic3dgsError::Shape {
            name: "means3D".to_owned(),
            found: means.shape,
            expected: "[frames, splats, 3]".to_owned(),
        });
    };
    if count == 0 || n == 0 {
        return Err(Dynamic3dgsError::Empty { shape: means.shape });
    }
    let colors = arrays.of_shape("rgb_colors", &[count, n, 3])?;
    let quats = arrays.of_shape("unnorm_rotations", &[count, n, 4])?;
    let logits = arrays.of_shape("logit_opacities", &[n, 1])?;
    let log_scales = arrays.of_shape("log_scales", &[n, 3])?;
    let log_scales = log_scales.as_chunks::<3>().0;
    let frames = (0..count).map(|frame| {
        let rows = |width: usize| frame * n * width..(frame + 1) * n * width;
        let rgb = colors[rows(3)].as_chunks::<3>().0;
        Splats {
            means: means.values[rows(3)].as_chunks::<3>().0.to_vec(),
            quats: quats[rows(4)].as_chunks::<4>().0.to_vec(),
            log_scales: log_scales.to_vec(),
            opacity_logits: logits.clone(),
            sh: rgb.iter().map(|&rgb| sh::dc_from_rgb(rgb)).collect(),
            sh_degree: 0,
        }
    });
    Ok(frames.collect())
}

/// Drops, keeps or rejects rows that are damaged in any frame.
fn without_damage(
    mut frames: Vec<Splats>,
    options: &OpenOptions,
) -> Result<(Vec<Splats>, repair::RepairReport), repair::DamagedRows> {
    let (first, rest) = frames.split_at_mut(1);
    for frame in rest.iter_mut() {
        repair::replace_infinities(frame);
    }
    let broken = |row: usize| rest.iter().any(|frame| !frame.is_finite(row));
    let splats = std::mem::take(&mut first[0]);
    let Sanitized { splats, kept, report } = repair::sanitize_with(splats, options.damage, broken)?;
    first[0] = splats;
    if let Some(kept) = kept {
        for frame in rest {
            *frame = frame.select(&kept);
        }
    }
    Ok((frames, report))
}
