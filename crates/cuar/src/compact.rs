//! Which splats an image of the edited ones needs.
//!
//! Geometry is fixed and only edited splats change colour, so per image only the pixels they reach matter, and for those only splats that
//! reach the same tiles in front of an edited one. Everything else is left out once and for all; the weights `αT` of the edited splats at
//! those pixels are the same.

use gs_core::{Camera, Splats, quat};
use rayon::prelude::*;

/// Side of a rasteriser tile, pixels.
pub(crate) const TILE: usize = 16;
/// Dilation of the projected covariance, and what the radius' floor adds at most, pixels².
const BLUR: f64 = 0.3 + 0.32;
const GUARD_BAND: f64 = 1.3;

/// Tiles `x0, y0, x1, y1` (upper bounds exclusive) that a splat can reach, no smaller than the rasteriser's, and its camera depth.
#[derive(Debug, Clone, Copy)]
struct Reach {
    tiles: [usize; 4],
    depth: f64,
}

fn reach(splats: &Splats, i: usize, camera: &Camera, grid: [usize; 2]) -> Option<Reach> {
    let mean = splats.means[i].map(f64::from);
    let [x, y, z] = camera.to_camera(mean);
    // a little nearer than the rasteriser's cull
    if z.is_nan() || z <= 0.19 {
        return None;
    }
    if splats.quats[i] == [0.0; 4] || quat::normalize(splats.quats[i]).iter().any(|q| q.is_nan()) {
        return None;
    }
    let k = &camera.intrinsics;
    let band = camera.tan_half_fov().map(|tan| GUARD_BAND * tan);
    let slope = [(x / z).clamp(-band[0], band[0]), (y / z).clamp(-band[1], band[1])];
    let focal = k.fx.max(k.fy) / z;
    let stretch = 1.0 + slope[0] * slope[0] + slope[1] * slope[1];
    let scale = splats.log_scales[i].iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
    let variance = (2.0 * f64::from(scale)).exp() * focal * focal * stretch + BLUR;
    let radius = 3.0 * variance.sqrt() + 2.0;
    let (u, v) = (k.fx * x / z + k.cx, k.fy * y / z + k.cy);
    if !(radius.is_finite() && u.is_finite() && v.is_finite()) {
        return None;
    }
    let tile = |pixel: f64, side: usize| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the grid"
        )]
        let tile = (pixel / TILE as f64).floor().clamp(0.0, side as f64) as usize;
        tile
    };
    let tiles = [
        tile(u - radius, grid[0]),
        tile(v - radius, grid[1]),
        tile(u + radius + TILE as f64, grid[0]),
        tile(v + radius + TILE as f64, grid[1]),
    ];
    (tiles[0] < tiles[2] && tiles[1] < tiles[3]).then_some(Reach { tiles, depth: z })
}

/// Rows needed to composite the edited splats at the `live` pixels (`[H,W]`), ascending.
///
/// With `all_depths` also those behind the last edited splat of a tile, which matter once opacity changes.
pub(crate) fn needed_rows(
    splats: &Splats,
    edited: &[bool],
    camera: &Camera,
    live: &[bool],
    all_depths: bool,
) -> Vec<u32> {
    let (w, h) = (camera.width as usize, camera.height as usize);
    let grid = [w.div_ceil(TILE), h.div_ceil(TILE)];
    let mut live_tiles = vec![false; grid[0] * grid[1]];
    for (p, _) in live.iter().enumerate().filter(|(_, live)| **live) {
        live_tiles[p / w / TILE * grid[0] + p % w / TILE] = true;
    }
    let reaches: Vec<Option<Reach>> = (0..splats.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| reach(splats, i, camera, grid))
        .collect();
    let tiles_of = |reach: &Reach| {
        let [x0, y0, x1, y1] = reach.tiles;
        (y0..y1).flat_map(move |y| (x0..x1).map(move |x| y * grid[0] + x))
    };
    let mut last = vec![f64::NEG_INFINITY; live_tiles.len()];
    for (reach, _) in reaches.iter().zip(edited).filter(|(_, edited)| **edited) {
        for (tile, reach) in reach.iter().flat_map(|reach| tiles_of(reach).map(move |t| (t, reach)))
        {
            if live_tiles[tile] {
                last[tile] = last[tile].max(reach.depth);
            }
        }
    }
    let slack = 1.0 + 1e-5; // the rasteriser sorts single-precision depths
    let needed = |i: usize| {
        let Some(reach) = &reaches[i] else { return false };
        tiles_of(reach)
            .any(|tile| live_tiles[tile] && (all_depths || reach.depth <= last[tile] * slack))
    };
    #[expect(clippy::cast_possible_truncation, reason = "the rasteriser numbers splats in 32 bits")]
    (0..splats.len())
        .into_par_iter()
        .with_min_len(1024)
        .filter(|&i| needed(i))
        .map(|i| i as u32)
        .collect()
}

/// Geometry and opacity of `rows`, and their colours if `with_sh`, else grey of degree 0.
pub(crate) fn gather(splats: &Splats, rows: &[u32], with_sh: bool) -> Splats {
    let ids: Vec<usize> = rows.iter().map(|&row| row as usize).collect();
    if with_sh {
        return splats.select(&ids);
    }
    Splats {
        means: ids.iter().map(|&i| splats.means[i]).collect(),
        quats: ids.iter().map(|&i| splats.quats[i]).collect(),
        log_scales: ids.iter().map(|&i| splats.log_scales[i]).collect(),
        opacity_logits: ids.iter().map(|&i| splats.opacity_logits[i]).collect(),
        sh: vec![[0.0; 3]; ids.len()],
        sh_degree: 0,
    }
}
