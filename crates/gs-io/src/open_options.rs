//! [`OpenOptions`]: settings for opening a scene that its files do not contain.

use crate::axes::Axes;
use crate::model_folder::Overrides;
use crate::repair::Damage;

/// Options for opening a scene. Options that do not apply to its kind are ignored.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
