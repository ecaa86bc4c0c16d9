//! [`Work`]: what every guide works on.

use crate::dynamics::DynamicSplit;
use crate::identity::IdentityMap;
use crate::keyframes::KeyFrames;
use crate::options::MotionOptions;
use crate::row_kind::RowKind;
use gs_core::Splats;

/// Receives the name of the stage under way and how much of that stage is done, 0 to 1.
pub type Progress<'a> = &'a (dyn Fn(&'static str, f32) + Sync);

/// Sources and weights of one row, or why it stays put.
pub(crate) type Row = (RowKind, Vec<(u32, f32)>);

/// What a guide works on.
pub(crate) struct Work<'a> {
    pub(crate) keys: &'a KeyFrames,
    pub(crate) split: &'a DynamicSplit,
    pub(crate) edited: &'a Splats,
    pub(crate) identity: &'a IdentityMap,
    pub(crate) options: &'a MotionOptions,
    /// Rows to be matched: edited, finite.
    pub(crate) open: Vec<usize>,
}
