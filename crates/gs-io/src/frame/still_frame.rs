//! [`Frame`]: a still frame as read.

use super::FrameFormat;
use crate::axes::{self, Axes, AxesReading};
use crate::repair::{self, Damage, DamagedRows, RepairReport};
use gs_core::{Precision, Splats};
use std::sync::Arc;

/// A still frame as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The Gaussians, stored parameters, rows in file order.
    pub splats: Splats,
    /// What the file is.
    pub format: FrameFormat,
    /// How coarsely it stores values; `None` where it keeps every bit.
    pub precision: Option<Arc<Precision>>,
    /// In which axes the file was read, for formats that come in several; the splats are in those
    /// of PLYs.
    pub axes: Option<AxesReading>,
    /// What was changed or left out on reading, counted, one sentence each.
    pub notes: Vec<String>,
    /// Comments of the file.
    pub comments: Vec<String>,
}

impl Frame {
    /// The frame as if its file had these axes, whatever it says. Frames of formats that have one
    /// order of axes stay as they are.
    #[must_use]
    pub fn in_axes(mut self, axes: Axes) -> Self {
        if let Some(reading) = &mut self.axes {
            // Back to how the file has it, then on.
            axes::convert(&mut self.splats, Axes::PLY, reading.axes);
            axes::convert(&mut self.splats, axes, Axes::PLY);
            *reading = AxesReading { axes, stated: true, ..*reading };
        }
        self
    }

    /// Drops, keeps or refuses damaged rows; see [`repair::sanitize`].
    ///
    /// # Errors
    /// As [`repair::sanitize`].
    pub fn sanitize(self, damage: Damage) -> Result<(Self, RepairReport), DamagedRows> {
        let sanitized = repair::sanitize(self.splats, damage)?;
        let precision = match &sanitized.kept {
            Some(kept) => self.precision.map(|precision| Arc::new(precision.select(kept))),
            None => self.precision,
        };
        Ok((Self { splats: sanitized.splats, precision, ..self }, sanitized.report))
    }
}
