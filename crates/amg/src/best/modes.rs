//! Per edited splat: the few motions it could have, and the cells that speak for each.

use super::cells::Cells;
use super::edit::Edit;
use super::motion::CellMotion;
use crate::binding::index;
use anchors::KdTree;
use gs_core::Real;
use rayon::prelude::*;

/// Motions told apart per splat.
pub(super) const MODES: usize = 4;

/// Cells looked at per splat: all within a thick sleeve's reach.
const CANDIDATES: usize = 160;

/// What proof of a splat's descent from a source splat is worth.
const DESCENT: f32 = 8.0;

/// Cells kept per motion.
const WITNESSES: usize = 8;

/// A cell that may explain an edited splat.
#[derive(Debug, Clone, Copy)]
pub(super) struct Witness {
    pub(super) cell: u32,
    /// Signed offset of the splat from the cell along its outward normal, world units.
    pub(super) offset: f32,
    /// Squared distance within the cell's tangent plane, world units².
    pub(super) tangent_squared: f32,
    /// Inner product of the two normals, both with their flatness.
    pub(super) aligned: f32,
    /// Product of the two flatnesses: 0 if either is a ball.
    pub(super) flat: f32,
    /// Square of their difference.
    pub(super) unlike: f32,
}

/// One motion an edited splat could have.
#[derive(Debug, Clone)]
pub(super) struct Mode {
    pub(super) witnesses: Vec<Witness>,
    /// The best witness, its cell.
    pub(super) cell: u32,
    /// Cost of the splat having this motion and facing along (0) or against (1) its stored thin axis.
    pub(super) cost: [f32; 2],
    /// What proof there is that the splat descends from a source splat of this motion.
    pub(super) descent: f32,
}

/// The motions of one edited splat, best first once costs are known.
pub(super) type Choice = Vec<Mode>;

/// The cells around an edited splat.
#[derive(Debug)]
pub(super) struct Near {
    /// Distance of the nearest one, world units; infinite if there is none.
    pub(super) distance: f64,
    /// Nearest first.
    pub(super) cells: Vec<u32>,
}

/// Nearest cells of every edited splat, and these grouped by what they would do to it.
pub(super) fn collect(
    cells: &Cells,
    motion: &CellMotion,
    normals: &[[f64; 3]],
    edit: &Edit,
    tolerance: f32,
) -> (Vec<Near>, Vec<Choice>) {
    let kept: Vec<usize> = (0..cells.cloud.len()).filter(|&i| !motion.floater[i]).collect();
    let points: Vec<[f64; 3]> = kept.iter().map(|&i| cells.cloud.means[i]).collect();
    let tree = KdTree::<3>::new(&points);
    (0..edit.len())
        .into_par_iter()
        .with_min_len(128)
        .map_init(Vec::new, |found, e| {
            if let Some(point) = edit.exact[e] {
                let near = Near { distance: f64::INFINITY, cells: Vec::new() };
                return (near, known(cells, normals, edit, e, cells.cell_of[point as usize]));
            }
            tree.nearest(&edit.means[e], CANDIDATES, found);
            let near = Near {
                distance: found.first().map_or(f64::INFINITY, |n| n.distance_squared.sqrt()),
                cells: found.iter().map(|n| index(kept[n.id as usize])).collect(),
            };
            let choice = group(cells, motion, normals, edit, e, &near.cells, tolerance);
            (near, choice)
        })
        .unzip()
}

/// The one motion of a splat that is a source splat; none if that one is a floater.
fn known(cells: &Cells, normals: &[[f64; 3]], edit: &Edit, e: usize, cell: u32) -> Choice {
    if cell == u32::MAX {
        return Vec::new();
    }
    let witnesses = vec![witness(cells, normals, edit, e, cell)];
    vec![Mode { witnesses, cell, cost: [0.0; 2], descent: 0.0 }]
}

fn group(
    cells: &Cells,
    motion: &CellMotion,
    normals: &[[f64; 3]],
    edit: &Edit,
    e: usize,
    near: &[u32],
    tolerance: f32,
) -> Choice {
    let x = edit.means[e].map(Real::as_f32);
    let parent = edit.lineage[e].map(|point| cells.cell_of[point as usize]);
    let parent = parent.filter(|cell| *cell != u32::MAX);
    let ids = parent.into_iter().chain(near.iter().copied());
    let mut modes: Choice = Vec::with_capacity(2);
    let mut paths = Vec::with_capacity(2);
    for cell in ids {
        let found = paths.iter().position(|path| motion.agrees(cell as usize, path, tolerance));
        match found {
            Some(m) if modes[m].witnesses.len() < WITNESSES => {
                modes[m].witnesses.push(witness(cells, normals, edit, e, cell));
            }
            None if modes.len() < MODES => {
                let witnesses = vec![witness(cells, normals, edit, e, cell)];
                let descent = if parent == Some(cell) { DESCENT } else { 0.0 };
                paths.push(motion.path(cell as usize, x));
                modes.push(Mode { witnesses, cell, cost: [0.0; 2], descent });
            }
            _ => {}
        }
    }
    modes
}

fn witness(cells: &Cells, normals: &[[f64; 3]], edit: &Edit, e: usize, cell: u32) -> Witness {
    let inner = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (ns, ne) = (normals[cell as usize], edit.axes[e]);
    let (fs, fe) = (inner(ns, ns).sqrt(), inner(ne, ne).sqrt());
    let from = cells.cloud.means[cell as usize];
    let d = [0, 1, 2].map(|a| edit.means[e][a] - from[a]);
    let offset = if fs > 1e-9 { inner(d, ns) / fs } else { 0.0 };
    Witness {
        cell,
        offset: offset.as_f32(),
        tangent_squared: (inner(d, d) - offset * offset).max(0.0).as_f32(),
        aligned: inner(ns, ne).as_f32(),
        flat: (fs * fe).as_f32(),
        unlike: (fs - fe).powi(2).as_f32(),
    }
}
