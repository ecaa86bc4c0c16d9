//! Tile lists in depth order, built without sorting per tile and without shared mutable state.
//!
//! Splats arrive sorted by depth. Runs of them ([`Block`]s) are first distributed over
//! [`MacroTile`]s of 4×4 tiles, independently of each other. Then every macro tile collects its
//! splats run by run, which restores depth order, and distributes them over its tiles. Both steps
//! are parallel, and the result does not depend on the number of threads.

use crate::cull::Reach;
use crate::lanes::wide;
use crate::project::Projected;
use crate::view::{TILE, View};
use gs_core::{Real, TileSet};
use rayon::prelude::*;

/// Tiles along a side of a macro tile.
pub(crate) const MACRO: usize = 4;
/// Tiles of a macro tile.
pub(crate) const MACRO_TILES: usize = MACRO * MACRO;
/// Splats per block.
pub(crate) const BLOCK: usize = 4096;

/// Splats fetched at once.
const GROUP: usize = 32;

/// Macro-tile lists of one run of depth-sorted splats.
#[derive(Debug, Default, Clone)]
pub(crate) struct Block {
    /// Start of every macro tile's items, and the end of the last.
    offsets: Vec<u32>,
    /// Ranks (positions in depth order).
    items: Vec<u32>,
}

impl Block {
    /// Ranks of the splats in a macro tile.
    pub(crate) fn items_of(&self, macro_id: usize) -> &[u32] {
        &self.items[self.offsets[macro_id] as usize..self.offsets[macro_id + 1] as usize]
    }
}

/// Entries of one tile, front to back.
#[derive(Debug, Default, Clone)]
pub(crate) struct TileList {
    /// Index into the macro tile's items.
    pub items: Vec<u32>,
    /// First and last pixel row that the splat can affect, in the low and high four bits.
    pub rows: Vec<u8>,
}

/// A square of 4×4 tiles: the unit of parallel work.
#[derive(Debug, Default, Clone)]
pub(crate) struct MacroTile {
    /// Ranks, ascending.
    pub items: Vec<u32>,
    /// Start of each block's items in `items`.
    pub block_starts: Vec<u32>,
    /// Row by row. Tiles outside the image have empty lists.
    pub lists: [TileList; MACRO_TILES],
}

/// Macro tiles across and down.
pub(crate) fn macro_grid(tiles: [usize; 2]) -> [usize; 2] {
    tiles.map(|n| n.div_ceil(MACRO))
}

/// Macro tiles that a splat may affect, `x0, y0, x1, y1`, upper
/// bounds exclusive; `None` if it draws nothing.
fn macro_rect<F: Real>(p: &Projected<F>) -> Option<[usize; 4]> {
    let mut rect = p.rect.map(usize::from);
    let reach = Reach::new(p)?;
    for axis in 0..2 {
        let (low, high) = (p.mean[axis] - reach.extent[axis], p.mean[axis] + reach.extent[axis]);
        let tile = |x: F, bound: usize| {
            let limit = F::from_double(bound as f64);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to the tile rectangle"
            )]
            let tile =
                (x / F::from_double(TILE as f64)).max(F::zero()).min(limit).as_f64() as usize;
            tile
        };
        rect[axis] = rect[axis].max(tile(low, rect[axis + 2]));
        rect[axis + 2] = rect[axis + 2].min(tile(high, rect[axis + 2]) + 1);
    }
    (rect[0] < rect[2] && rect[1] < rect[3]).then(|| {
        [rect[0] / MACRO, rect[1] / MACRO, (rect[2] - 1) / MACRO + 1, (rect[3] - 1) / MACRO + 1]
    })
}

/// Distributes depth-sorted `splats` over blocks, then over macro tiles and tiles; if `tiles` is
/// given, over these only.
#[expect(
    clippy::cast_possible_truncation,
    reason = "ranks are below 2^32, the limit on the number of splats"
)]
pub(crate) fn bin<F: Real>(
    splats: &[Projected<F>],
    view: &View<F>,
    tiles: Option<&TileSet>,
    blocks: &mut Vec<Block>,
    macros: &mut Vec<MacroTile>,
) {
    let grid = macro_grid(view.tiles);
    let num_macros = grid[0] * grid[1];
    blocks.resize_with(splats.len().div_ceil(BLOCK), Block::default);
    blocks.par_iter_mut().zip(splats.par_chunks(BLOCK)).enumerate().for_each(
        |(number, (block, run))| {
            let first_rank = number * BLOCK;
            block.offsets.clear();
            block.offsets.resize(num_macros + 1, 0);
            let visit = |action: &mut dyn FnMut(usize, u32)| {
                for (i, splat) in run.iter().enumerate() {
                    let Some([x0, y0, x1, y1]) = macro_rect(splat) else { continue };
                    for y in y0..y1 {
                        for x in x0..x1 {
                            action(y * grid[0] + x, (first_rank + i) as u32);
                        }
                    }
                }
            };
            visit(&mut |macro_id, _| block.offsets[macro_id] += 1);
            let mut end = 0;
            for offset in &mut block.offsets {
                end += *offset;
                *offset = end;
            }
            // Filled from the back, which leaves every offset at the start of its macro tile; ranks
            // are reversed in place afterwards.
            block.items.resize(end as usize, 0);
            let (offsets, items) = (&mut block.offsets, &mut block.items);
            visit(&mut |macro_id, rank| {
                offsets[macro_id] -= 1;
                items[offsets[macro_id] as usize] = rank;
            });
            for macro_id in 0..num_macros {
                items[offsets[macro_id] as usize..offsets[macro_id + 1] as usize].reverse();
            }
        },
    );

    macros.resize_with(num_macros, MacroTile::default);
    let blocks = &*blocks;
    macros.par_iter_mut().enumerate().for_each(|(macro_id, target)| {
        target.items.clear();
        target.block_starts.clear();
        for block in blocks {
            target.block_starts.push(target.items.len() as u32);
            target.items.extend_from_slice(block.items_of(macro_id));
        }
        let corner = [macro_id % grid[0] * MACRO, macro_id / grid[0] * MACRO];
        wide(
            #[inline(always)]
            || fill_lists(splats, view, tiles, corner, target),
        );
    });
}

/// Distributes the items of the macro tile whose first tile is `corner` over its tiles.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rows are 0..16, items are below 2^32")]
fn fill_lists<F: Real>(
    splats: &[Projected<F>],
    view: &View<F>,
    tiles: Option<&TileSet>,
    corner: [usize; 2],
    target: &mut MacroTile,
) {
    let mut is_used = [true; MACRO_TILES];
    if let Some(tiles) = tiles {
        for (i, is_used) in is_used.iter_mut().enumerate() {
            *is_used = tiles.has_tile(corner[0] + i % MACRO, corner[1] + i / MACRO);
        }
    }
    for list in &mut target.lists {
        list.items.clear();
        list.rows.clear();
    }
    let side = F::from_double(TILE as f64);
    let last_column = F::from_double((view.width - 1) as f64);
    let last = F::from_double((TILE - 1) as f64);
    // First pixels of the tiles, columns and rows: conversions would take longer than the rest.
    let firsts: [[F; MACRO]; 2] =
        corner.map(|first| std::array::from_fn(|i| F::from_double((first + i) as f64) * side));
    let mut group = [Projected::default(); GROUP];
    for item in 0..target.items.len() {
        // Copied in groups, so that the cache misses of a group overlap.
        if item % GROUP == 0 {
            for (p, &rank) in group.iter_mut().zip(&target.items[item..]) {
                *p = splats[rank as usize];
            }
        }
        let p = &group[item % GROUP];
        let rect = p.rect.map(usize::from);
        let clip = |low: usize, high: usize, axis: usize| {
            (low.max(corner[axis]), high.min(corner[axis] + MACRO))
        };
        let ((x0, x1), (y0, y1)) = (clip(rect[0], rect[2], 0), clip(rect[1], rect[3], 1));
        let Some(reach) = Reach::new(p) else { continue };
        for tx in x0..x1 {
            let left = firsts[0][tx - corner[0]];
            let right = (left + side - F::one()).min(last_column);
            let Some(reached) = reach.rows(left - p.mean[0], right - p.mean[0]) else { continue };
            for ty in y0..y1 {
                let centre = p.mean[1] - firsts[1][ty - corner[1]];
                let low = (centre + reached.0).ceil().max(F::zero());
                let high = (centre + reached.1).floor().min(last);
                let tile = (ty - corner[1]) * MACRO + tx - corner[0];
                if low <= high && is_used[tile] {
                    let list = &mut target.lists[tile];
                    list.items.push(item as u32);
                    #[expect(clippy::cast_sign_loss, reason = "0 ≤ low ≤ high ≤ 15")]
                    list.rows.push(low.as_f64() as u8 | ((high.as_f64() as u8) << 4));
                }
            }
        }
    }
}
