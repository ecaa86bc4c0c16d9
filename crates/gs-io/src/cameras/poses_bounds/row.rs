//! Rows of a `poses_bounds.npy`.

use crate::cameras::lens::Lens;
use crate::cameras::{CamerasError, Reading, npy, pose};
use glam::DVec3;
use gs_core::Intrinsics;

/// Numbers of a row: a 3×5 matrix, near and far.
const COLUMNS: usize = 17;

/// A camera of the file. World units; pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Camera's right, world frame.
    pub right: DVec3,
    /// Camera's up, world frame.
    pub up: DVec3,
    /// Camera's backward axis, world frame.
    pub back: DVec3,
    /// Camera centre, world frame and units.
    pub centre: DVec3,
    /// Image rows, pixels.
    pub height: f64,
    /// Image columns, pixels.
    pub width: f64,
    /// Focal length of both axes, pixels.
    pub focal: f64,
    /// Smallest depth, world units.
    pub near: f64,
    /// Largest depth, world units.
    pub far: f64,
}

impl Row {
    pub(super) fn viewmat(&self) -> pose::Viewmat {
        pose::from_axes(self.right, -self.up, -self.back, self.centre)
    }

    /// Stored size and focal length; in training half the size, and
    /// half the first camera's focal length.
    pub(super) fn lens_of(&self, first: &Self, reading: Reading) -> Lens {
        let (focal, scale) = match reading {
            Reading::Trained => (first.focal, 0.5),
            Reading::Stored => (self.focal, 1.0),
        };
        let (width, height) = (self.width * scale, self.height * scale);
        let (fx, fy) = (focal * scale, focal * scale);
        Lens::pinhole(Intrinsics { fx, fy, cx: width / 2.0, cy: height / 2.0 }, width, height)
    }
}

/// Parses a `poses_bounds.npy`.
///
/// # Errors
/// If it is not a NumPy array of shape `[cameras, 17]` of floating-point numbers, all finite.
pub fn parse(bytes: &[u8]) -> Result<Vec<Row>, CamerasError> {
    let rows = npy::rows(bytes, COLUMNS)?;
    if rows.is_empty() {
        return Err(CamerasError::Empty);
    }
    let row = |(index, v): (usize, &Vec<f64>)| {
        if let Some(column) = v.iter().position(|value| !value.is_finite()) {
            let at = format!("row {index}, column {column}");
            return Err(CamerasError::malformed(at, "a finite number", v[column]));
        }
        // Columns of the 3×5 matrix: down, right, backward, centre, (height, width, focal).
        let axis = |k: usize| DVec3::new(v[k], v[5 + k], v[10 + k]);
        let [height, width, focal] = axis(4).to_array();
        Ok(Row {
            right: axis(1),
            up: -axis(0),
            back: axis(2),
            centre: axis(3),
            height,
            width,
            focal,
            near: v[15],
            far: v[16],
        })
    };
    rows.iter().enumerate().map(row).collect()
}
