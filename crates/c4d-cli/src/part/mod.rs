//! Parts of a command's work, done by separate processes and joined by `c4d gather`.

mod folder;
mod record;
mod share;

pub(crate) use folder::PartFolder;
pub(crate) use record::{Part, PartRecord, broken, in_order};
pub(crate) use share::Share;
