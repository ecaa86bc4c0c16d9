//! [`OpenOptions`]: what a user decides about a scene that its files do not say.

use crate::axes::Axes;
use crate::model_folder::Overrides;
use crate::repair::Damage;

/// How to open a scene. Each kind uses the options that apply to it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OpenOptions {
    /// Which saved iteration of a trained scene; the newest when `None`.
    pub iteration: Option<u64>,
    /// What to do with damaged rows.
    pub damage: Damage,
    /// Axes of a frame or of the files of a sequence, for formats that come in several (SPZ, glTF).
    pub axes: Option<Axes>,
    /// Start and end of the scene in the unit of its Gaussians' times, for native 4D Gaussians,
    /// whose files do not say it.
    pub time_duration: Option<[f64; 2]>,
    /// Half the side of the cube that the grids of Grid4D and DASH cover, if `cfg_args` does not
    /// say it.
    pub bound: Option<f32>,
    /// Training flags of 4DGaussians and Swift4D models. Their `iteration` and `damage` are
    /// replaced by those above.
    pub overrides: Overrides,
}
