//! [`open_source`]: the reader of each kind of trained scene.

use crate::error::IoError;
use crate::scene_kind::SceneKind;
use crate::source::{Source, SourceOptions};
use crate::{
    deformable3dgs, dynamic3dgs, ed3dgs, fourdgs_file, freetime, gaussian4d, grid4d, scgs,
    spacetime,
};
use std::path::Path;

/// Opens a trained scene of a kind for which [`SceneKind::is_source`] holds.
///
/// # Errors
/// As the readers, and if the kind is another.
pub fn open_source(
    path: impl AsRef<Path>,
    kind: &SceneKind,
    options: &SourceOptions,
) -> Result<Source, IoError> {
    let path = path.as_ref();
    match kind {
        SceneKind::Deformable3dgs => deformable3dgs::open(path, options),
        SceneKind::Scgs => scgs::open(path, options),
        SceneKind::Grid4d => grid4d::open(path, options),
        SceneKind::Dash => grid4d::open_dash(path, options),
        SceneKind::Ed3dgs => ed3dgs::open(path, options),
        SceneKind::Dynamic3dgs => dynamic3dgs::open(path, options),
        SceneKind::Spacetime => spacetime::open(path, options),
        SceneKind::FreeTime => freetime::open(path, options),
        SceneKind::Fourdgs => fourdgs_file::open(path, options),
        SceneKind::Gaussian4d => gaussian4d::open(path, options),
        other => {
            Err(IoError::content(path, format!("is {other}, expected a trained dynamic scene")))
        }
    }
}
