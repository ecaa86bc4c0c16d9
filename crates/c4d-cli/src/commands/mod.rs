//! One module per command.

pub(crate) mod bench;
pub(crate) mod compare;
pub(crate) mod demo;
pub(crate) mod doctor;
mod dry_run;
pub(crate) mod edit;
pub(crate) mod eval;
pub(crate) mod export;
pub(crate) mod freeze;
pub(crate) mod gather;
pub(crate) mod info;
mod panels;
pub(crate) mod propagate;
pub(crate) mod refine;
pub(crate) mod render;
pub(crate) mod shell;
pub(crate) mod source_match;
pub(crate) mod view;
