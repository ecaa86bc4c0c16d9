//! [`fixture()`]: where fixtures lie.

use std::path::PathBuf;

/// Path of `fixtures/<relative>` at the top of the workspace.
pub fn fixture(relative: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(relative)
}
