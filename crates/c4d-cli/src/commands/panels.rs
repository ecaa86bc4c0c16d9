//! Images of one frame that show marked splats: choice of the view, and colours.

use crate::camera_rig::{CameraRig, Layout};
use crate::caption::Rgb;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::renderer::Renderer;
use gs_core::{Camera, Image, Splats, sh};
use gs_deform::StaticScene;

/// Size of each image, pixels.
const PANEL: (u32, u32) = (640, 480);
/// Size of the images used to choose the view, pixels.
const CANDIDATE_SIZE: (u32, u32) = (160, 120);
/// Number of candidate views around an object.
const VIEWS: usize = 8;
/// A different view is chosen only if the front view shows less than this
/// share of the marked splats that the other shows.
const FRONT_SHARE: f64 = 0.5;

pub(super) fn render(
    splats: Splats,
    camera: &Camera,
    background: Rgb,
    device: &Device,
) -> Outcome<Image> {
    let scene = StaticScene::new(splats).map_err(Failure::input)?;
    let mut renderer = Renderer::new(device, background);
    renderer.seek(&scene, 0.0)?;
    Ok(renderer.render(camera)?.rgb_image())
}

/// The splats in these colours with their own brightness, so that shapes remain visible.
pub(super) fn shaded(splats: &Splats, color: impl Fn(usize) -> Rgb) -> Splats {
    let brightness = |row: usize| {
        let rgb = sh::color(0, &splats.sh_of(row)[..1], [0.0, 0.0, 1.0]).map(|c| c.min(1.0));
        0.45 + 0.55 * (0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2])
    };
    in_colors(splats, |row| color(row).map(|channel| channel * brightness(row)))
}

fn in_colors(splats: &Splats, color: impl Fn(usize) -> Rgb) -> Splats {
    Splats {
        sh: (0..splats.len()).map(|row| sh::dc_from_rgb(color(row))).collect(),
        sh_degree: 0,
        ..splats.clone()
    }
}

/// The front view, or, if it hides the marked splats, the view
/// around the object that shows most of them.
pub(super) fn view(
    rig: &CameraRig,
    splats: &Splats,
    is_marked: impl Fn(usize) -> bool,
    device: &Device,
) -> Outcome<Camera> {
    let views = |size| {
        let mut views = vec![rig.front(size)];
        if rig.layout == Layout::Object {
            views.extend(rig.orbit(VIEWS, size));
        }
        views
    };
    let marked = in_colors(splats, |row| [f32::from(u8::from(is_marked(row))); 3]);
    let mut shown = Vec::new();
    for camera in views(CANDIDATE_SIZE) {
        let image = render(marked.clone(), &camera, [0.0; 3], device)?;
        shown.push(image.data.iter().map(|&value| f64::from(value)).sum::<f64>());
    }
    let best = (0..shown.len()).max_by(|&a, &b| shown[a].total_cmp(&shown[b])).unwrap_or(0);
    let chosen = if shown[0] >= FRONT_SHARE * shown[best] { 0 } else { best };
    Ok(views(PANEL).swap_remove(chosen))
}
