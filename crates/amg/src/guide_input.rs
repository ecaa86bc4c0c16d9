//! [`GuideInput`]: input shared by all guides.

use crate::dynamics::DynamicSplit;
use crate::identity::IdentityMap;
use crate::keyframes::KeyFrames;
use crate::options::MotionOptions;
use crate::row_kind::RowKind;
use gs_core::Splats;

/// Progress callback. Arguments: name of the stage, and the share of it that is done, 0 to 1.
pub type ProgressFn<'a> = &'a (dyn Fn(&'static str, f32) + Sync);

/// Kind, sources and weights of one row.
pub(crate) type Row = (RowKind, Vec<(u32, f32)>);

/// Input of a guide.
pub(crate) struct GuideInput<'a> {
    pub(crate) keys: &'a KeyFrames,
    pub(crate) split: &'a DynamicSplit,
    pub(crate) edited: &'a Splats,
    pub(crate) identity: &'a IdentityMap,
    pub(crate) options: &'a MotionOptions,
    /// Rows to be matched: edited, finite.
    pub(crate) open: Vec<usize>,
}
