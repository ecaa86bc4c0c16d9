//! `cfg_args`: the `repr` of a Python namespace, parsed as data.
//!
//! Forks add fields of any Python type. Values that are not literals stay text and are listed
//! ([`CfgArgs::unread`]); the other fields are parsed.

mod error;
mod read;
mod value;

pub use error::CfgError;
pub use read::{CfgArgs, parse};
pub use value::Value;
