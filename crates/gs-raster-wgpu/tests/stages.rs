//! Tests each stage before the image, on five scenes and at awkward sizes: projection
//! against double precision; culling, rectangles and counts against the CPU
//! rasteriser; order and lists against simple references.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{Mode, Scene, awkward_scenes, raster, scenes};
use gs_core::{Camera, Rasterizer, covariance, quat};
use gs_raster_cpu::CpuRasterizer;
use gs_raster_wgpu::Stages;

fn all_scenes() -> Vec<Scene> {
    scenes().into_iter().chain(awkward_scenes()).collect()
}

fn stages(scene: &Scene) -> Stages {
    let raster = raster(Mode::Portable);
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    raster.stages(&mut prepared).unwrap()
}

/// Centre (pixels, pixel i sampled at i), conic, opacity and depth of a splat in double precision.
fn projected(scene: &Scene, id: usize) -> [f64; 7] {
    let (splats, camera) = (&scene.splats, &scene.camera);
    let [x, y, z] = camera.to_camera(splats.means[id].map(f64::from));
    let [u, v] = camera.project(splats.means[id].map(f64::from)).unwrap();
    let scale = splats.log_scales[id].map(|s| f64::from(s).exp());
    let s = covariance(quat::normalize(splats.quats[id]).map(f64::from), scale);
    let sigma = [[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]];
    let (k, band) = (&camera.intrinsics, camera.tan_half_fov().map(|tan| 1.3 * tan));
    let slope = [(x / z).clamp(-band[0], band[0]), (y / z).clamp(-band[1], band[1])];
    let rows = |focal: f64, axis: usize| {
        [0, 1, 2]
            .map(|j| focal / z * (camera.viewmat[axis][j] - slope[axis] * camera.viewmat[2][j]))
    };
    let t = [rows(k.fx, 0), rows(k.fy, 1)];
    let product = |a: [f64; 3], b: [f64; 3]| -> f64 {
        (0..9).map(|n| a[n / 3] * sigma[n / 3][n % 3] * b[n % 3]).sum()
    };
    let (a, b, c) = (product(t[0], t[0]) + 0.3, product(t[0], t[1]), product(t[1], t[1]) + 0.3);
    let det = a * c - b * b;
    let opacity = 1.0 / (1.0 + (-f64::from(splats.opacity_logits[id])).exp());
    [u - 0.5, v - 0.5, c / det, -b / det, a / det, opacity, z]
}

#[test]
fn projection_matches_double_precision() {
    let mut compared = 0;
    for scene in all_scenes() {
        let stages = stages(&scene);
        for (id, ours) in stages.projected.iter().enumerate().filter(|(_, row)| row[7] > 0.0) {
            let theirs = projected(&scene, id);
            let conic = theirs[2].hypot(theirs[4]);
            for (k, (a, b)) in ours.iter().zip(theirs).enumerate() {
                let allowed = match k {
                    0 | 1 => 1e-3 + 1e-5 * b.abs(),
                    2..5 => 2e-3 * conic,
                    _ => 1e-5 * b.abs(),
                };
                let error = (f64::from(*a) - b).abs();
                assert!(error <= allowed, "{}: splat {id}, value {k}: {a} {b}", scene.name);
            }
            compared += 1;
        }
    }
    assert!(compared > 10_000, "{compared} splats compared");
}

/// Negative control: the tolerances above detect a shift of half a pixel.
#[test]
fn a_shifted_centre_is_detected() {
    let scene = &scenes()[0];
    let stages = stages(scene);
    let id = stages.projected.iter().position(|row| row[7] > 0.0).unwrap();
    let off = (f64::from(stages.projected[id][0]) + 0.5 - projected(scene, id)[0]).abs();
    assert!(off > 0.4, "{off}");
}

/// Visible splats, their radii and rectangles, and the number of pairs.
/// Values at a pixel boundary may round differently.
#[test]
fn culling_and_rectangles_match_the_cpu() {
    for scene in all_scenes() {
        let theirs = CpuRasterizer::default().prepare(&scene.splats, &scene.camera).unwrap();
        let ours = stages(&scene);
        let num = scene.splats.len();
        let rect = |id: usize| {
            let visible = ours.projected[id][7] > 0.0;
            visible.then_some(ours.rects[id])
        };
        let expected = |id: usize| theirs.tile_rect(id).map(|rect| rect.map(u32::from));
        let differ = (0..num).filter(|&id| rect(id) != expected(id)).count();
        assert!(differ * 1000 <= num, "{}: {differ} rectangles differ", scene.name);
        for (what, ours, theirs) in [
            ("visible splats", ours.depth_order.len(), theirs.num_visible()),
            ("pairs of rectangles", ours.num_rect_isects, theirs.num_rect_isects()),
        ] {
            let apart = ours.abs_diff(theirs);
            assert!(apart * 1000 <= theirs, "{}: {ours} {what}, {theirs} on the CPU", scene.name);
        }
        // These lists are valid for every opacity, those of the CPU
        // for the opacities of the preparation.
        let pairs: usize = ours.tile_lists.iter().map(Vec::len).sum();
        let minimum = theirs.num_isects() - theirs.num_isects() / 1000;
        assert!((minimum..=ours.num_rect_isects).contains(&pairs), "{}: {pairs}", scene.name);
    }
}

/// The lists equal a simple reference: depth order with ties by index, tiles
/// within the rectangle in which the splat can draw.
#[test]
fn lists_match_a_simple_reference() {
    for scene in all_scenes() {
        let raster = raster(Mode::Portable);
        let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
        let stages = raster.stages(&mut prepared).unwrap();
        let mut order: Vec<u32> = (0..)
            .take(scene.splats.len())
            .filter(|&id: &u32| stages.projected[id as usize][7] > 0.0)
            .collect();
        order.sort_by_key(|&id| stages.projected[id as usize][6].to_bits());
        assert_eq!(stages.depth_order, order, "{}: depth order", scene.name);
        check_lists(&scene, &stages);
    }
}

/// Smallest value of the quadratic form on the tile's pixel centres, by brute force.
fn smallest_quad(row: &[f32; 8], tile: [u32; 2], camera: &Camera) -> f64 {
    let [u, v, a, b, c] = [row[0], row[1], row[2], row[3], row[4]].map(f64::from);
    let mut smallest = f64::INFINITY;
    for y in 16 * tile[1]..(16 * tile[1] + 16).min(camera.height) {
        for x in 16 * tile[0]..(16 * tile[0] + 16).min(camera.width) {
            let (dx, dy) = (u - f64::from(x), v - f64::from(y));
            smallest = smallest.min(a * dx * dx + c * dy * dy + 2.0 * b * dx * dy);
        }
    }
    smallest
}

fn check_lists(scene: &Scene, stages: &Stages) {
    let columns = scene.camera.width.div_ceil(16);
    let reach = 2.0 * 255.0_f64.ln();
    for (number, list) in (0_u32..).zip(&stages.tile_lists) {
        let tile = [number % columns, number / columns];
        let mut rest = list.iter().peekable();
        for &id in &stages.depth_order {
            let [x0, y0, x1, y1] = stages.rects[id as usize];
            let inside = (x0..x1).contains(&tile[0]) && (y0..y1).contains(&tile[1]);
            let listed = rest.next_if(|&&next| next == id).is_some();
            assert!(inside || !listed, "{}: splat {id} outside its rectangle", scene.name);
            if inside && !listed {
                let smallest = smallest_quad(&stages.projected[id as usize], tile, &scene.camera);
                assert!(smallest > reach, "{}: tile {tile:?} lacks splat {id}", scene.name);
            }
        }
        assert_eq!(rest.next(), None, "{}: tile {tile:?} out of order", scene.name);
    }
}

#[test]
fn radii_match_the_cpu() {
    for scene in all_scenes() {
        let theirs = CpuRasterizer::default().prepare(&scene.splats, &scene.camera).unwrap();
        let raster = raster(Mode::Portable);
        let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
        let ours = raster.radii(&mut prepared).unwrap();
        // 3σ may round to either side of a whole pixel.
        let differ = (0..scene.splats.len())
            .filter(|&id| i64::from(theirs.radius(id)) != i64::from(ours[id]))
            .count();
        assert!(differ * 1000 <= scene.splats.len(), "{}: {differ} radii differ", scene.name);
    }
}
