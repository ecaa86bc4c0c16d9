//! Checkpoints in gsplat's format ([`crate::gsplat`]) with `times`,
//! `durations` (logarithms) and `velocities`.

use super::FreeTimeError;
use super::model::{MIN_DURATION, Model, OPACITY_FLOOR};
use crate::error::IoError;
use crate::gsplat;
use crate::pth::{self, Integers, Layers};
use std::path::Path;

/// Reads a checkpoint of moving splats.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Model, IoError> {
    let (root, integers) = pth::read_with_integers(bytes).map_err(IoError::format(path))?;
    let tensors = root.into_state_dict().map_err(IoError::format(path))?;
    let layers = Layers::new(pth::siblings_of(tensors, &["means"]));
    model(&layers, &integers).map_err(IoError::format(path))
}

fn model(layers: &Layers<'_>, integers: &Integers) -> Result<Model, FreeTimeError> {
    let splats = gsplat::splats(layers)?;
    let n = splats.len();
    let column = |name: &str| gsplat::column(layers, name, n);
    let (times, durations) = (column("times")?, column("durations")?);
    let velocities = layers.values("velocities", &[n, 3])?;
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
