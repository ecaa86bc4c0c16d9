//! Origin, size and axes of a point cloud.
//!
//! Every origin, order, length and direction of the motion stage is relative to this pose, so that
//! results do not depend on the position, orientation and size of the scene.

use crate::rigid::{dot, eigen, sub};
use gs_core::nearest_rank;

/// Share of the points within the radius of the cloud. The resulting size is about the longest edge
/// of the bounding box for most objects, and is robust to one floater in twenty splats.
const INSIDE: f64 = 0.92;

/// Coordinate frame of a point cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    /// Mean of the points.
    pub(crate) origin: [f64; 3],
    /// Principal axes, unit; signs and order are arbitrary.
    pub(crate) axes: [[f64; 3]; 3],
}

impl Pose {
    pub(crate) fn of(points: &[[f64; 3]]) -> Self {
        let origin = centroid(points);
        let mut moments = [[0.0; 3]; 3];
        for &x in points {
            let d = sub(x, origin);
            for a in 0..3 {
                for b in 0..3 {
                    moments[a][b] += d[a] * d[b];
                }
            }
        }
        let (_, columns) = eigen(moments);
        let axes = [0, 1, 2].map(|axis| [0, 1, 2].map(|a| columns[a][axis]));
        Self { origin, axes }
    }
}

/// Diameter of the ball around the cloud's mean that contains 92 % of the points; 0 without points.
/// About the height of a standing figure.
pub(crate) fn robust_diameter(points: &[[f64; 3]]) -> f64 {
    let origin = centroid(points);
    let mut squares: Vec<f64> = points
        .iter()
        .map(|&x| {
            let d = sub(x, origin);
            dot(d, d)
        })
        .collect();
    2.0 * nearest_rank(&mut squares, INSIDE).unwrap_or(0.0).sqrt()
}

fn centroid(points: &[[f64; 3]]) -> [f64; 3] {
    // About the first point: sums of coordinates far from the origin would lose precision.
    let Some(&first) = points.first() else { return [0.0; 3] };
    let mut sum = [0.0; 3];
    for &x in points {
        for a in 0..3 {
            sum[a] += x[a] - first[a];
        }
    }
    [0, 1, 2].map(|a| first[a] + sum[a] / points.len() as f64)
}
