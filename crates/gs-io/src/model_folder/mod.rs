//! Model folders of 4DGaussians and related methods: the common parts of
//! [`crate::checkpoint4dgs`] and [`crate::swift4d`].
//!
//! A folder has `cfg_args` (flags of the training run) and `point_cloud/iteration_<n>/` with
//! `point_cloud.ply` and the deformation.

mod canonical;
mod flags;
mod iteration;
mod opened;
mod overrides;
mod report;
mod scene;

pub use flags::{FlagReport, Origin};
pub use iteration::Stage;
pub use overrides::{Overrides, Swift4dOverrides};
pub use report::{DynamicSplitCounts, ModelReport};
pub use scene::{Model, ModelScene};

pub(crate) use canonical::{Canonical, never_moving, read_canonical};
pub(crate) use iteration::{
    Iteration, find, has_in_iterations, has_network, looks_like_model, still_model,
};
pub(crate) use opened::opened;
