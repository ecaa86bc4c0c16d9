//! [`SmoothGridScene`]: canonical splats deformed by a [`SmoothGridField`].

use super::field::SmoothGridField;
use crate::FieldError;
use crate::geometry_scene::{GeometryField, GeometryScene};
use crate::shape::RasterizedShapes;
use gs_core::{Splats, quat};

/// Canonical splats and the field that deforms them: a model of Grid4D or DASH.
///
/// Rotation changes are added to normalised quaternions, which are not normalised again, and scale
/// changes to activated scales.
pub type SmoothGridScene = GeometryScene<MovingRows>;

/// A field, and the splats that it moves.
#[derive(Debug)]
pub struct MovingRows {
    field: SmoothGridField,
    dynamic: Option<Vec<bool>>,
    /// Rows that the field moves, and their centres.
    rows: Vec<usize>,
    points: Vec<[f32; 3]>,
}

impl SmoothGridScene {
    /// A scene from its parts; `dynamic` (`[N]`) selects the splats
    /// that the field moves, all if `None`.
    ///
    /// # Errors
    /// If the arrays have inconsistent lengths.
    pub fn new(
        canonical: Splats,
        field: SmoothGridField,
        dynamic: Option<Vec<bool>>,
    ) -> Result<Self, FieldError> {
        canonical.check_shapes()?;
        let n = canonical.len();
        if let Some(dynamic) = dynamic.as_ref().filter(|dynamic| dynamic.len() != n) {
            return Err(FieldError::Shape {
                tensor: "dynamic".to_owned(),
                found: vec![dynamic.len()],
                expected: format!("[{n}]"),
            });
        }
        let moves = |row: &usize| dynamic.as_ref().is_none_or(|dynamic| dynamic[*row]);
        let rows: Vec<usize> = (0..n).filter(moves).collect();
        let points = rows.iter().map(|&row| canonical.means[row]).collect();
        Self::of(canonical, MovingRows { field, dynamic, rows, points })
    }
}

impl GeometryField for MovingRows {
    fn rasterized(&self, canonical: &Splats, t: f32) -> RasterizedShapes {
        let mut shapes = RasterizedShapes {
            means: canonical.means.clone(),
            quats: canonical.quats.iter().map(|&q| quat::normalize(q)).collect(),
            scales: canonical.log_scales.iter().map(|log| log.map(f32::exp)).collect(),
        };
        let outputs = self.field.outputs(&self.points, t);
        for (index, &row) in self.rows.iter().enumerate() {
            let warp = outputs.warp[index];
            let x = self.points[index];
            shapes.means[row] = if self.field.rotates {
                let rotation = quat::normalize([warp[0] + 1.0, warp[1], warp[2], warp[3]]);
                let rotated = quat::rotate(rotation, x);
                [rotated[0] + warp[4], rotated[1] + warp[5], rotated[2] + warp[6]]
            } else {
                [x[0] + warp[0], x[1] + warp[1], x[2] + warp[2]]
            };
            for (value, change) in shapes.quats[row].iter_mut().zip(outputs.rotation[index]) {
                *value += change;
            }
            for (value, change) in shapes.scales[row].iter_mut().zip(outputs.scaling[index]) {
                *value += change;
            }
        }
        shapes
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.dynamic.as_deref()
    }
}
