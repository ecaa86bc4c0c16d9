//! A model of FreeTimeGS, independent of its file format.

use crate::error::IoError;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use gs_core::Splats;
use gs_deform::{FadeLimits, Polynomial, PolynomialScene};
use std::path::Path;

/// Default of the smallest duration, as in training.
pub(super) const MIN_DURATION: f32 = 0.02;
/// Default of the smallest opacity, as in training.
pub(super) const OPACITY_FLOOR: f32 = 1e-4;
/// Factor from a standard deviation to the width for which
/// `exp(−(dt/width)²)` is the same Gaussian.
const WIDTH: f32 = std::f32::consts::SQRT_2;

/// The parameters, `[N]` each.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) splats: Splats,
    pub(super) times: Vec<f32>,
    /// Logarithms.
    pub(super) durations: Vec<f32>,
    pub(super) velocities: Vec<[f32; 3]>,
    pub(super) use_velocity: bool,
    pub(super) min_duration: f32,
    pub(super) opacity_floor: f32,
    pub(super) num_frames: Option<usize>,
    pub(super) notes: Vec<String>,
}

impl Model {
    pub(super) fn into_source(
        self,
        path: &Path,
        options: &OpenOptions,
    ) -> Result<OpenedScene, IoError> {
        let Self { splats, times, durations, velocities, use_velocity, min_duration, .. } = self;
        let mut motions: Vec<Polynomial> = (0..splats.len())
            .map(|row| Polynomial {
                velocity: [
                    if use_velocity { velocities[row] } else { [0.0; 3] },
                    [0.0; 3],
                    [0.0; 3],
                ],
                omega: [0.0; 4],
                centre: times[row],
                width: WIDTH * durations[row].exp().max(min_duration),
            })
            .collect();
        let broken = |row: usize| {
            let values = [times[row], durations[row]];
            !values.iter().chain(&velocities[row]).all(|value| value.is_finite())
        };
        let Sanitized { splats, kept, report } =
            repair::sanitize_with(splats, options.damage, broken)
                .map_err(IoError::damaged(path))?;
        if let Some(kept) = kept {
            motions = kept.into_iter().map(|row| motions[row]).collect();
        }
        let motion = if use_velocity { "linear" } else { "none: use_velocity is off" };
        let mut facts = vec![("motion", motion.to_owned())];
        let scene = PolynomialScene::new(splats, motions)
            .map_err(IoError::format(path))?
            .with_fade_limits(FadeLimits { floor: self.opacity_floor, cutoff: 0.0 });
        let scene = match self.num_frames {
            Some(frames) => {
                facts.push(("frames", frames.to_string()));
                scene.with_frames(frames)
            }
            None => scene,
        };
        Ok(OpenedScene {
            facts,
            notes: self.notes,
            repair: report,
            ..OpenedScene::new(SceneKind::FreeTime, scene, vec![path.to_owned()])
        })
    }
}
