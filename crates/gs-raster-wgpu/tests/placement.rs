//! The image does not depend on a scene's size and position if its camera is transformed alike.

mod common;

use common::{Mode, camera, cloud, raster};
use test_support::placement::{check_near_plane, check_placement};

#[test]
fn scaling_and_translation_do_not_change_the_image() {
    let (splats, camera) = (cloud(11, 800, 2, -3.0), camera(160, 120));
    // Worst seen on llvmpipe 84.3 dB after moving, 136.9 dB after scaling.
    check_placement(&raster(Mode::Portable), (&splats, &camera), 76.0);
}

#[test]
fn the_cameras_near_plane_culls() {
    let (splats, camera) = (cloud(11, 800, 2, -3.0), camera(160, 120));
    check_near_plane(&raster(Mode::Portable), (&splats, &camera));
}
