//! [`OpenOptions`]: settings for opening a scene that its files do not contain.

use crate::axes::Axes;
use crate::model_folder::Overrides;
use crate::repair::Damage;

/// Options for opening a scene. Options that do not apply to its kind are ignored.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct OpenOptions {
    /// Saved iteration of a trained scene; the newest if `None`.
    pub iteration: Option<u64>,
    /// Treatment of damaged rows.
    pub damage: Damage,
    /// Axes of a frame or of the files of a sequence, for formats whose files use different axes
    /// (SPZ, glTF).
    pub axes: Option<Axes>,
    /// Start and end time of the scene, in the unit of its Gaussians' times, for native 4D
    /// Gaussians, whose files do not contain them.
    pub time_duration: Option<[f64; 2]>,
    /// Half the side of the cube covered by the grids of Grid4D and DASH, if `cfg_args` does not
    /// state it.
    pub bound: Option<f32>,
    /// Training flags of 4DGaussians and Swift4D models. Their `iteration` and `damage` are
    /// replaced by those above.
    pub overrides: Overrides,
}

impl OpenOptions {
    /// The same options with a different treatment of damaged rows.
    #[must_use]
    pub fn with_damage(mut self, damage: Damage) -> Self {
        self.damage = damage;
        self
    }

    /// The same options with the start and end time of native 4D Gaussians.
    #[must_use]
    pub fn with_time_duration(mut self, start: f64, end: f64) -> Self {
        self.time_duration = Some([start, end]);
        self
    }

    /// The same options with half the side of the cube covered by the grids of Grid4D and DASH.
    #[must_use]
    pub fn with_bound(mut self, bound: f32) -> Self {
        self.bound = Some(bound);
        self
    }
}
