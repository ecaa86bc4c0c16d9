//! [`Overrides`]: what the user decides instead of the files.

use crate::repair::Damage;
use gs_deform::IndexRule;

/// What a user may decide instead of the files.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Overrides {
    /// Which saved iteration; the newest when `None`.
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
    /// What to do with damaged rows of the PLY.
    pub damage: Damage,
    /// For Swift4D models, which have flags of their own.
    pub swift4d: Swift4dOverrides,
}

/// What a user may decide instead of the files of a Swift4D model.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Swift4dOverrides {
    /// How lattice points are mapped into large tables. In no file.
    pub index_rule: Option<IndexRule>,
    /// Whether a ReLU ends the trunk (`activation`); both look the same in the tensors.
    pub trunk_relu: Option<bool>,
    /// Score above which a Gaussian is dynamic.
    pub dynamic_thro: Option<f32>,
    /// Levels of the grid.
    pub n_levels: Option<u32>,
    /// Features per level.
    pub n_features_per_level: Option<u32>,
    /// log₂ of the most entries of a level.
    pub hashmap_size: Option<u32>,
    /// Resolution of the coarsest level.
    pub base_resolution: Option<u32>,
    /// Frames of the training video. In no file.
    pub frames: Option<u32>,
    /// Frame `i` was trained at time `i / time_divisor`. In no file.
    pub time_divisor: Option<u32>,
}
