//! [`WriteOptions`]: bounds of the errors of a `.splat4d` clip.

use crate::error::IoError;
use std::path::Path;

/// Default position bound as a share of the scene's size: a fifth of a
/// pixel if the scene is a thousand pixels wide.
pub const DEFAULT_TOLERANCE: f64 = 2e-4;

/// Largest errors of the decoded values, at every splat and frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WriteOptions {
    /// Error of each coordinate, as a share of the scene's size: the diagonal
    /// of the box around the middle 98 % of the moving splats (of all splats,
    /// if none move). Default [`DEFAULT_TOLERANCE`].
    pub tolerance: f64,
    /// Relative error of sizes. Default 0.02.
    pub scale: f64,
    /// Error of each colour channel, steps of 255, besides the rounding to 8 bits. Default 2.
    pub rgb: u8,
    /// Error of opacity, steps of 255, besides the rounding to 8 bits. Default 2.
    pub alpha: u8,
    /// Error of each component of the unit quaternion, steps of 1/128,
    /// besides the rounding to 8 bits. Default 0.
    pub rot: u8,
    /// Frames per group, each of which can be decoded separately. Default 30.
    pub gop: usize,
    /// The world's upward direction, read back by this crate only. Default none.
    pub up: Option<[f64; 3]>,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self {
            tolerance: DEFAULT_TOLERANCE,
            scale: 0.02,
            rgb: 2,
            alpha: 2,
            rot: 0,
            gop: 30,
            up: None,
        }
    }
}

impl WriteOptions {
    /// Verifies the ranges of the options.
    pub(super) fn check(&self, path: &Path) -> Result<(), IoError> {
        let share = |value: f64| value.is_finite() && value > 0.0 && value <= 1.0;
        let wrong = if !share(self.tolerance) {
            format!("tolerance {}", self.tolerance)
        } else if !share(self.scale) {
            format!("relative size error {}", self.scale)
        } else if self.gop == 0 {
            "groups of 0 frames".to_owned()
        } else {
            return Ok(());
        };
        Err(IoError::content(
            path,
            format!("{wrong}; expected above 0, at most 1 (groups: at least 1)"),
        ))
    }
}
