//! [`Overrides`]: settings by the user that replace those of the files.

use crate::repair::Damage;
use gs_deform::IndexRule;

/// Settings by the user that replace those of the files.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Overrides {
    /// Saved iteration; the newest if `None`.
    pub iteration: Option<u64>,
    /// Centres are not deformed.
    pub no_dx: Option<bool>,
    /// Scales are not deformed.
    pub no_ds: Option<bool>,
    /// Rotations are not deformed.
    pub no_dr: Option<bool>,
    /// Opacities are not deformed.
    pub no_do: Option<bool>,
    /// SH are not deformed.
    pub no_dshs: Option<bool>,
    /// Rotations are composed instead of added.
    pub apply_rotation: Option<bool>,
    /// Frequency of the feature encoding, for networks that have one.
    pub grid_pe: Option<u32>,
    /// Treatment of damaged rows of the PLY.
    pub damage: Damage,
    /// Flags of Swift4D models.
    pub swift4d: Swift4dOverrides,
}

/// Settings by the user for a Swift4D model.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Swift4dOverrides {
    /// How lattice points are mapped into large tables. Not stored in any file.
    pub index_rule: Option<IndexRule>,
    /// Whether a ReLU follows the trunk (`activation`); not visible in the tensors.
    pub trunk_relu: Option<bool>,
    /// Score (column `dynamic` of the PLY, no unit) above which a Gaussian is dynamic.
    pub dynamic_thro: Option<f32>,
    /// Number of levels of the grid.
    pub n_levels: Option<u32>,
    /// Features per level.
    pub n_features_per_level: Option<u32>,
    /// log₂ of the largest number of entries per level.
    pub hashmap_size: Option<u32>,
    /// Resolution of the coarsest level.
    pub base_resolution: Option<u32>,
    /// Number of frames of the training video. Not stored in any file.
    pub frames: Option<u32>,
    /// Frame `i` was trained at time `i / time_divisor`. Not stored in any file.
    pub time_divisor: Option<u32>,
}
