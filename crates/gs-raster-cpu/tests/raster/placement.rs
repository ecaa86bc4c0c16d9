//! The image does not depend on a scene's size and position if its camera is transformed alike.

use crate::scenes;
use gs_raster_cpu::CpuRasterizer;
use test_support::placement::{check_near_plane, check_placement};

#[test]
fn scaling_and_translation_do_not_change_the_image() {
    let scene = scenes::random::<f32>(800, 0, [160, 120], 5);
    // Worst seen 91.3 dB after moving, 100.6 dB after scaling.
    check_placement(&CpuRasterizer::default(), (&scene.splats, &scene.camera), 83.0);
}

#[test]
fn the_cameras_near_plane_culls() {
    let scene = scenes::random::<f32>(800, 0, [160, 120], 5);
    check_near_plane(&CpuRasterizer::default(), (&scene.splats, &scene.camera));
}
