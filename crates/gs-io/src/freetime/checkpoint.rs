//! Checkpoints in gsplat's format ([`crate::gsplat`]) with `times`,
//! `durations` (logarithms) and `velocities`.

use super::model::{MIN_DURATION, Model, OPACITY_FLOOR};
use crate::error::IoError;
use crate::gsplat;
use crate::pth::{self, Integers, Layers};
use std::path::Path;

/// Tensors and integers of a file.
fn parts<'a>(bytes: &'a [u8], path: &Path) -> Result<(Layers<'a>, Integers), IoError> {
    let (root, integers) = pth::read_with_integers(bytes)
        .map_err(|source| IoError::Pth { path: path.to_owned(), source })?;
    let tensors =
        root.into_state_dict().map_err(|source| IoError::Pth { path: path.to_owned(), source })?;
    Ok((Layers::new(pth::beside(tensors, &["means"])), integers))
}

/// Reads a checkpoint of moving splats.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Model, IoError> {
    let (layers, integers) = parts(bytes, path)?;
    let wrong = |what: String| IoError::content(path, what);
    let splats = gsplat::splats(&layers).map_err(wrong)?;
    let n = splats.len();
    let column = |name: &str| gsplat::column(&layers, name, n).map_err(wrong);
    let (times, durations) = (column("times")?, column("durations")?);
    let velocities = layers.values("velocities", &[n, 3]).map_err(wrong)?;
    let use_velocity = integers.get("use_velocity").is_none_or(|&used| used != 0);
    let frames = integers.get("n_frames").and_then(|&count| usize::try_from(count).ok());
    Ok(Model {
        splats,
        times,
        durations,
        velocities: velocities.as_chunks::<3>().0.to_vec(),
        use_velocity,
        min_duration: MIN_DURATION,
        opacity_floor: OPACITY_FLOOR,
        num_frames: frames.filter(|count| (1..1 << 20).contains(count)),
        notes: Vec::new(),
    })
}
