//! Cells: regions of a cloud with known trajectories.
//!
//! Line-sampled anchors use one frame. If points have trajectories, a region can be required to
//! move rigidly, so that it has a single motion.

use crate::trajectories::{RigidNeighbors, Trajectories};
use crate::vec3::{Vec3, dot};

/// Minimum agreement of neighbours in one cell, see [`RigidNeighbors::get`].
const MIN_AGREEMENT: f64 = 0.5;

/// Points are joined only if the edge of the cubes is more than this many spacings: smaller cells
/// contain too few points for a mean.
const SPACINGS: f64 = 1.5;

/// Squared length below which a direction is too uncertain and is ignored: 0.3².
const MIN_LENGTH_SQUARED: f64 = 0.09;

/// Squared cosine of the largest angle between the directions of neighbours in one cell, 45°.
const MIN_COS_SQUARED: f64 = 0.5;

/// Entry of [`Cells::owners`] for a point that belongs to no cell.
pub const NO_CELL: u32 = u32::MAX;

/// Settings of [`Cells::build`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellParams {
    /// Edge of the lattice's cubes, world units.
    pub edge: f64,
    /// Orthonormal axes of the lattice, one per row, world frame. Mirrored or exchanged axes give
    /// the same cells.
    pub axes: [[f64; 3]; 3],
}

/// A partition of the points that are not outliers into R cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Points of each cell, ascending, `[R]`. Cells are in the order of their first points.
    pub members: Vec<Vec<u32>>,
    /// Cell of each point, `[N]`; [`NO_CELL`] for outliers.
    pub owners: Vec<u32>,
}

impl Cells {
    /// Joins neighbours that lie in one cube of a lattice about the origin, move together
    /// (agreement of at least ½) and have directions within 45°.
    ///
    /// `neighbors` are those of `points`; `outliers` `[N]` belong to no cell. `directions` `[N,3]`
    /// are normals of any sign; their lengths are their confidence, 0 to 1, and below 0.3 they are
    /// ignored. Clouds whose typical spacing is two thirds of the edge or more are not joined:
    /// every point is a cell.
    ///
    /// # Panics
    /// If `outliers` or `directions` has fewer entries than there are points.
    pub fn build(
        points: &Trajectories,
        neighbors: &RigidNeighbors,
        outliers: &[bool],
        directions: &[[f64; 3]],
        params: &CellParams,
    ) -> Self {
        let num = points.len();
        let joins = SPACINGS * neighbors.typical_spacing(points) < params.edge;
        let mut root: Vec<u32> = (0..num as u32).collect();
        if joins {
            // With rounding, the lattice is symmetric under reflection: signs and order of the axes
            // do not matter.
            let cube = |x: &Vec3| params.axes.map(|axis| (dot(&axis, x) / params.edge).round());
            let cubes: Vec<Vec3> = points.rest.iter().map(cube).collect();
            let order = neighbors.order().iter().map(|&i| i as usize);
            for i in order.filter(|&i| !outliers[i]) {
                for (neighbor, agreement) in neighbors.get(i) {
                    let j = neighbor.id as usize;
                    let joined = !outliers[j]
                        && agreement >= MIN_AGREEMENT
                        && cubes[i] == cubes[j]
                        && have_similar_directions(&directions[i], &directions[j]);
                    if joined {
                        let (a, b) = (find(&mut root, i as u32), find(&mut root, neighbor.id));
                        root[a.max(b) as usize] = a.min(b);
                    }
                }
            }
        }
        let mut owners = vec![NO_CELL; num];
        let mut members: Vec<Vec<u32>> = Vec::new();
        for i in (0..num).filter(|&i| !outliers[i]) {
            // A root is the lowest point of its cell, so its cell already has a number.
            let head = find(&mut root, i as u32) as usize;
            if owners[head] == NO_CELL {
                owners[head] = members.len() as u32;
                members.push(Vec::new());
            }
            owners[i] = owners[head];
            members[owners[i] as usize].push(i as u32);
        }
        Self { members, owners }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }
}

fn find(root: &mut [u32], mut i: u32) -> u32 {
    while root[i as usize] != i {
        root[i as usize] = root[root[i as usize] as usize];
        i = root[i as usize];
    }
    i
}

fn have_similar_directions(a: &Vec3, b: &Vec3) -> bool {
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    let uncertain = aa < MIN_LENGTH_SQUARED || bb < MIN_LENGTH_SQUARED;
    uncertain || ab * ab >= MIN_COS_SQUARED * aa * bb
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// A plate of 12 × 12 points of spacing 0.1, the right half of which moves away.
    fn plate() -> Trajectories {
        let rest: Vec<Vec3> = (0..144)
            .map(|i| [0.1 * f64::from(i % 12) - 0.55, 0.1 * f64::from(i / 12) - 0.55, 0.0])
            .collect();
        let part = |x: &Vec3| [x[0], x[1], if x[0] > 0.0 { 1.0 } else { 0.0 }];
        Trajectories {
            moved: rest.iter().map(part).collect(),
            presence: Vec::new(),
            weights: vec![1.0; 144],
            moving: vec![true; 144],
            rest,
        }
    }

    fn cells_of(points: &Trajectories, directions: &[Vec3], edge: f64) -> Cells {
        let neighbors = RigidNeighbors::of(points, 0.04);
        let outliers = vec![false; points.len()];
        Cells::build(points, &neighbors, &outliers, directions, &CellParams { edge, axes: AXES })
    }

    #[test]
    fn cells_do_not_cross_cubes_motions_or_edges() {
        let points = plate();
        let up = vec![[0.0, 0.0, 1.0]; 144];
        let cells = cells_of(&points, &up, 0.4);
        assert!(cells.len() > 8 && cells.len() < 72, "{}", cells.len());
        for members in &cells.members {
            for &m in members {
                let (a, b) = (points.rest[members[0] as usize], points.rest[m as usize]);
                assert_eq!(a[0] > 0.0, b[0] > 0.0, "one motion");
                assert!((a[0] - b[0]).abs() < 0.41 && (a[1] - b[1]).abs() < 0.41, "one cube");
            }
        }
        let mut bent = up;
        for (direction, x) in bent.iter_mut().zip(&points.rest) {
            if x[1] > 0.0 {
                *direction = [0.0, 1.0, 0.1];
            }
        }
        let bent = cells_of(&points, &bent, 0.4);
        assert!(
            bent.len() > cells.len(),
            "an edge separates cells: {} of {}",
            bent.len(),
            cells.len()
        );
    }

    #[test]
    fn every_point_is_in_its_cell_once() {
        let points = plate();
        let neighbors = RigidNeighbors::of(&points, 0.04);
        let mut outliers = vec![false; 144];
        (outliers[3], outliers[77]) = (true, true);
        let params = CellParams { edge: 0.3, axes: AXES };
        let cells = Cells::build(&points, &neighbors, &outliers, &[[0.0; 3]; 144], &params);
        let mut seen = [0; 144];
        for (cell, members) in cells.members.iter().enumerate() {
            for &m in members {
                seen[m as usize] += 1;
                assert_eq!(cells.owners[m as usize] as usize, cell, "owner of {m}");
            }
        }
        for (i, count) in seen.into_iter().enumerate() {
            assert_eq!(count, usize::from(!outliers[i]), "point {i}");
            assert_eq!(cells.owners[i] == NO_CELL, outliers[i], "point {i}");
        }
    }

    #[test]
    fn sparse_points_are_single_cells_and_mirrored_axes_change_nothing() {
        let points = plate();
        let flat = [[0.0; 3]; 144];
        assert_eq!(cells_of(&points, &flat, 0.12).len(), 144, "one cell per point");
        let neighbors = RigidNeighbors::of(&points, 0.04);
        let cells = |axes| {
            let params = CellParams { edge: 0.37, axes };
            Cells::build(&points, &neighbors, &[false; 144], &flat, &params)
        };
        assert_eq!(cells(AXES), cells([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]));
    }
}
