//! [`CfgError`]: error of reading a `cfg_args`.

use thiserror::Error;

/// A text that is not a complete `cfg_args`.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "malformed cfg_args: {what} at character {at}; copy the file again, or remove the file (flags are then guessed)"
)]
pub struct CfgError {
    /// Position, bytes.
    pub at: usize,
    /// Description of the expected text.
    pub what: String,
}
