//! Visibility culling for images of the edited splats.
//!
//! Geometry is fixed and only edited splats change colour. An image therefore needs only the pixels
//! that edited splats reach, and for these only splats that reach the same cell of the image in
//! front of an edited one. All other splats are omitted. This does not change the weights `αT` of
//! the edited splats at those pixels.

use gs_core::image_formation::TILE_SIZE;
use gs_core::{Camera, Footprint, Rasterizer, Splats, TileSet};
use rayon::prelude::*;

/// Side of a cell, pixels. Any size gives the same weights; that of a rasteriser's tile keeps the
/// fewest rows.
const CELL: usize = TILE_SIZE as usize;

/// Footprint of every splat.
pub(crate) fn footprints<R: Rasterizer + Sync>(
    raster: &R,
    splats: &Splats,
    camera: &Camera,
) -> Vec<Option<Footprint>> {
    (0..splats.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| raster.footprint(splats, i, camera))
        .collect()
}

/// Tiles that the edited splats reach.
pub(crate) fn edited_tiles(
    footprints: &[Option<Footprint>],
    edited: &[bool],
    camera: &Camera,
) -> TileSet {
    let mut tiles = TileSet::new(camera.width as usize, camera.height as usize);
    for (footprint, _) in footprints.iter().zip(edited).filter(|(_, edited)| **edited) {
        if let Some(footprint) = footprint {
            tiles.insert(footprint.pixels);
        }
    }
    tiles
}

/// Rows needed to composite the edited splats at the pixels of `live`, ascending.
pub(crate) fn needed_rows(
    footprints: &[Option<Footprint>],
    edited: &[bool],
    live: &TileSet,
) -> Vec<u32> {
    let live_cells = live.flags();
    let across = live.size()[0].div_ceil(CELL);
    let cells_of = |footprint: &Footprint| {
        let [x0, y0, x1, y1] = footprint.pixels;
        let columns = x0 / CELL..x1.div_ceil(CELL);
        (y0 / CELL..y1.div_ceil(CELL))
            .flat_map(move |y| columns.clone().map(move |x| y * across + x))
    };
    let mut last = vec![f64::NEG_INFINITY; live_cells.len()];
    for (footprint, _) in footprints.iter().zip(edited).filter(|(_, edited)| **edited) {
        let Some(footprint) = footprint else { continue };
        for cell in cells_of(footprint).filter(|&cell| live_cells[cell]) {
            last[cell] = last[cell].max(footprint.depth);
        }
    }
    let slack = 1.0 + 1e-5; // the rasteriser sorts single-precision depths
    let needed = |i: usize| {
        let Some(footprint) = &footprints[i] else { return false };
        cells_of(footprint).any(|cell| live_cells[cell] && footprint.depth <= last[cell] * slack)
    };
    #[expect(clippy::cast_possible_truncation, reason = "the rasteriser numbers splats in 32 bits")]
    (0..footprints.len())
        .into_par_iter()
        .with_min_len(1024)
        .filter(|&i| needed(i))
        .map(|i| i as u32)
        .collect()
}

/// Geometry and opacity of `rows`, grey of degree 0.
pub(crate) fn gather(splats: &Splats, rows: &[u32]) -> Splats {
    let ids: Vec<usize> = rows.iter().map(|&row| row as usize).collect();
    Splats {
        means: ids.iter().map(|&i| splats.means[i]).collect(),
        quats: ids.iter().map(|&i| splats.quats[i]).collect(),
        log_scales: ids.iter().map(|&i| splats.log_scales[i]).collect(),
        opacity_logits: ids.iter().map(|&i| splats.opacity_logits[i]).collect(),
        sh: vec![[0.0; 3]; ids.len()],
        sh_degree: 0,
    }
}
