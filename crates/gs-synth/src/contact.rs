//! Contact zones: edited splats close to source splats that move differently.

use crate::{
    SynthScene,
    math::wide,
    part::{Bone, Kind, Part},
    skeleton::{Attach, BoneMotions},
};
use glam::{DVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// Largest distance of splats in contact, figure sizes.
const NEAR: f32 = 0.03;
/// Smallest difference of motions in a contact zone, figure sizes.
const ASTRAY: f64 = 0.08;
/// Times at which motions are compared.
const TIMES: [f64; 6] = [0.15, 0.3, 0.5, 0.7, 0.85, 1.0];

type Cell = [i32; 3];

/// Mask of the rows of `edited` in a contact zone; only rows of `scored`.
pub(crate) fn mask(source: &SynthScene, edited: &SynthScene, scored: &[bool]) -> Vec<bool> {
    let radius = NEAR * source.figure_size;
    let grid = Grid::build(source, radius);
    let frames = TIMES.map(|t| source.skeleton.motion(t));
    let limit = ASTRAY * f64::from(source.figure_size);
    edited
        .rows
        .iter()
        .zip(&edited.frame1.means)
        .zip(scored)
        .map(|((row, mean), &is_scored)| {
            is_scored
                && row.part != Part::Backdrop
                && grid
                    .others_near(Vec3::from(*mean), row.attach.bone)
                    .any(|other| strays(&frames, wide(*mean), row.attach, other, limit))
        })
        .collect()
}

/// Whether the motions `own` and `other` move `x` apart by more than `limit`.
fn strays(frames: &[BoneMotions], x: DVec3, own: Attach, other: Attach, limit: f64) -> bool {
    frames.iter().any(|frame| (frame.point(own, x) - frame.point(other, x)).length() > limit)
}

/// Source splats thinned to one per bone and voxel, in cells as large as the search radius.
struct Grid {
    radius: f32,
    cells: HashMap<Cell, Vec<(Vec3, Attach)>>,
    /// Bones in a cell and its neighbours, one bit each; answers most queries.
    bones_around: HashMap<Cell, u32>,
}

fn around([x, y, z]: Cell) -> impl Iterator<Item = Cell> {
    let shift = |value: i32, by: i32| value.saturating_add(by);
    (-1..=1).flat_map(move |dx| {
        (-1..=1)
            .flat_map(move |dy| (-1..=1).map(move |dz| [shift(x, dx), shift(y, dy), shift(z, dz)]))
    })
}

fn cell_of(x: Vec3, size: f32) -> Cell {
    #[expect(clippy::cast_possible_truncation, reason = "saturates far outside any scene")]
    (x / size).floor().to_array().map(|value| value as i32)
}

impl Grid {
    fn build(source: &SynthScene, radius: f32) -> Self {
        let mut taken: HashSet<(Cell, u8)> = HashSet::new();
        let mut cells: HashMap<Cell, Vec<(Vec3, Attach)>> = HashMap::new();
        let mut bones_in: HashSet<(Cell, Bone)> = HashSet::new();
        let mut bones_around: HashMap<Cell, u32> = HashMap::new();
        for (row, mean) in source.rows.iter().zip(&source.frame1.means) {
            let moves_with_part = matches!(row.kind, Kind::Surface | Kind::Interior);
            let x = Vec3::from(*mean);
            if moves_with_part && taken.insert((cell_of(x, radius / 4.0), row.attach.bone as u8)) {
                let cell = cell_of(x, radius);
                cells.entry(cell).or_default().push((x, row.attach));
                if bones_in.insert((cell, row.attach.bone)) {
                    for neighbor in around(cell) {
                        *bones_around.entry(neighbor).or_default() |= 1 << row.attach.bone as u8;
                    }
                }
            }
        }
        Self { radius, cells, bones_around }
    }

    /// The nearest splat of each other bone within the radius, in the order of the bones.
    fn others_near(&self, x: Vec3, own: Bone) -> impl Iterator<Item = Attach> + use<> {
        let mut nearest: [Option<(f32, Attach)>; Bone::ALL.len()] = [None; Bone::ALL.len()];
        let cell = cell_of(x, self.radius);
        let bones = self.bones_around.get(&cell).copied().unwrap_or(0);
        let cells = around(cell).filter(|_| bones & !(1 << own as u8) != 0);
        for key in cells {
            for &(at, attach) in self.cells.get(&key).map_or(&[][..], Vec::as_slice) {
                let distance2 = at.distance_squared(x);
                let slot = &mut nearest[attach.bone as usize];
                if attach.bone != own
                    && distance2 <= self.radius * self.radius
                    && slot.is_none_or(|(best, _)| distance2 < best)
                {
                    *slot = Some((distance2, attach));
                }
            }
        }
        nearest.into_iter().flatten().map(|(_, attach)| attach)
    }
}
