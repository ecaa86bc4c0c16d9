//! Values of `--preset`.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// Presets of `c4d propagate` and `c4d refine`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub(crate) enum PresetArg {
    /// The smallest measured error
    #[value(alias = "best")]
    #[serde(alias = "Best")]
    Default,
    /// The paper's method, taken literally
    Paper,
}
