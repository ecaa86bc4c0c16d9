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
    /// Format of the file.
    pub format: FrameFormat,
    /// Precision of the stored values; `None` if exact.
    pub precision: Option<Arc<Precision>>,
    /// Axes in which the file was read, for formats whose files use
    /// different axes; the splats have those of PLYs.
    pub axes: Option<AxesReading>,
    /// Changes and omissions on reading, with counts, one sentence each.
    pub notes: Vec<String>,
    /// Comments of the file.
    pub comments: Vec<String>,
}

impl Frame {
    /// The frame read as if its file had these axes, regardless of the axes it states. Frames of
    /// formats with fixed axes are unchanged.
    #[must_use]
    pub fn in_axes(mut self, axes: Axes) -> Self {
        if let Some(reading) = &mut self.axes {
            // Converts back to the file's axes, then from the new ones.
            axes::convert(&mut self.splats, Axes::PLY, reading.axes);
            axes::convert(&mut self.splats, axes, Axes::PLY);
            *reading = AxesReading { axes, stated: true, ..*reading };
        }
        self
    }

    /// Drops, keeps or rejects damaged rows; see [`repair::sanitize`].
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
