//! `c4d freeze`: the frame to edit, as a PLY for any 3D editor, with cameras.

use crate::args::{FreezeArgs, Global};
use crate::camera_rig::{CameraRig, DEFAULT_SIZE};
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::output::{check_sh_degree, existing, output_failure, refuse_overlap};
use crate::renderer::Renderer;
use crate::scene::LoadedScene;
use crate::{cameras, frames, images, memory, placement, scene};
use gs_core::image_formation::ALPHA_THRESHOLD;
use gs_core::{Camera, Splats};
use gs_deform::StaticScene;
use gs_io::ply::comments;
use gs_io::ply::{self, WriteOptions};
use gs_io::{AtomicDir, Existing, SceneKind, cameras_json};
use std::collections::HashSet;
use std::path::Path;

/// Cameras of the rig written next to the PLY.
const RIG_CAMERAS: usize = 12;
/// Folder of the views.
const VIEWS: &str = "views";
/// Size of the views of a rig, pixels: the usual size of image models.
const PICTURE_SIZE: (u32, u32) = (512, 512);
/// Files this command writes.
const OURS: [&str; 2] = ["point_cloud.ply", "cameras.json"];

pub(crate) fn run(args: &FreezeArgs, global: &Global, console: &Console) -> Outcome {
    let opened = scene::open(&args.scene, global, console)?;
    memory::require_frames(opened.scene.as_ref(), memory::FRAMES_SEEN)?;
    frames::check(opened.scene.time_range(), args.time, "--time")?;
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    let splats = opened.scene.at(args.time).map_err(Failure::input)?;
    let splats = visible(splats, args, console)?;
    let (cameras, origin) = cameras_of(args, &opened, console)?;
    let output = &args.output;
    refuse_overlap(output, &opened.roots)?;
    let device = args.views.map(|_| Device::open(global.gpu)).transpose()?;
    let folder =
        AtomicDir::create(output, existing(global)).map_err(|error| output_failure(&error))?;
    let options = WriteOptions {
        comments: std::iter::once(format!("{}{}", comments::TIME, args.time))
            .chain(device.as_ref().map(|_| background_comment(opened.background)))
            .chain(comments::up_comments(opened.up))
            .collect(),
        sh_degree: args.sh_degree,
        ..WriteOptions::default()
    };
    ply::write_file(&folder.path().join(OURS[0]), &splats, &options, Existing::Refuse)
        .map_err(|error| output_failure(&error))?;
    cameras_json::write_file(&folder.path().join(OURS[1]), &cameras, Existing::Refuse)
        .map_err(|error| output_failure(&error))?;
    if let Some(device) = &device {
        let splats = match args.sh_degree {
            Some(degree) => splats.with_sh_degree(degree),
            None => splats.clone(),
        };
        let views = folder.path().join(VIEWS);
        write_views(&views, splats, &cameras, device, opened.background, console)?;
    }
    folder.commit().map_err(|error| output_failure(&error))?;
    console.note(format!("{} cameras: {origin}", cameras.len()));
    if device.is_some() {
        console.note(format!(
            "edit the pictures in {0}, then: c4d edit {1} --views {0} -o EDITED.ply",
            output.join(VIEWS).display(),
            output.display()
        ));
    }
    console.note(format!(
        "edit {0}, then: c4d propagate {1} --edited EDITED.ply --time {2} -o RUN",
        output.join(OURS[0]).display(),
        args.scene.display(),
        args.time
    ));
    console.output(&output.join(OURS[0]), &[("splats", splats.len())]);
    Ok(())
}

/// Cameras to write, and where they come from.
fn cameras_of(
    args: &FreezeArgs,
    opened: &LoadedScene,
    console: &Console,
) -> Outcome<(Vec<Camera>, String)> {
    let count = args.views.map(usize::from);
    if let Some(file) = &args.cameras {
        if args.up.is_some() {
            return Err(Failure::usage("--up applies to the built-in cameras only; the cameras of --cameras have their own poses")
                .next("Omit one of them."));
        }
        let distinct_cameras = cameras::open(file, None, opened, console)?.distinct_cameras();
        let cameras = match count {
            Some(count) => for_pictures(distinct_cameras, count, args.size),
            None => distinct_cameras,
        };
        return Ok((cameras, format!("copied from {}", file.display())));
    }
    // Cameras of the capture show the scene well, and no parts that were never observed.
    let is_model = matches!(opened.kind, SceneKind::Model4dgs | SceneKind::Swift4d);
    if let Some(count) = count.filter(|_| is_model && args.up.is_none())
        && let Ok(set) = cameras::open(&args.scene, None, opened, console)
    {
        let cameras = for_pictures(set.distinct_cameras(), count, args.size);
        if !cameras.is_empty() {
            return Ok((cameras, "the scene's own".to_owned()));
        }
    }
    let up = args.up.map_or(opened.up, crate::args::Up::vector);
    let rig = CameraRig::of_scene(opened.scene.as_ref(), up).map_err(Failure::input)?;
    placement::warn_if_coarse(&rig.extent, console);
    let origin = "placed around the scene, because its files have no cameras".to_owned();
    if let Some(count) = count {
        return Ok((rig.views(count, args.size.unwrap_or(PICTURE_SIZE)), origin));
    }
    let mut cameras = vec![rig.front(DEFAULT_SIZE)];
    for (i, camera) in rig.orbit(RIG_CAMERAS, DEFAULT_SIZE).into_iter().enumerate() {
        cameras.push(Camera { name: format!("orbit_{i:02}"), ..camera });
    }
    Ok((cameras, origin))
}

/// At most `count` of the cameras, evenly spaced, at the requested size, with valid file names.
fn for_pictures(from: Vec<Camera>, count: usize, size: Option<(u32, u32)>) -> Vec<Camera> {
    let mut cameras = cameras::thinned(from, count);
    let mut names = HashSet::new();
    for (i, camera) in cameras.iter_mut().enumerate() {
        if let Some((width, height)) = size {
            *camera = camera.resized(width, height);
        }
        camera.time = None;
        let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
        camera.name = camera.name.chars().map(plain).collect();
        if camera.name.is_empty() || !names.insert(camera.name.clone()) {
            camera.name = format!("view_{i:03}");
            names.insert(camera.name.clone());
        }
    }
    cameras
}

/// Renders one PNG per camera.
fn write_views(
    folder: &Path,
    splats: Splats,
    cameras: &[Camera],
    device: &Device,
    background: [f32; 3],
    console: &Console,
) -> Outcome {
    std::fs::create_dir(folder).map_err(|error| Failure::write(folder, &error))?;
    let frame = StaticScene::new(splats).map_err(Failure::failed)?;
    let mut renderer = Renderer::new(device, background);
    renderer.seek(&frame, 0.0)?;
    let mut progress = console.progress("views", cameras.len() as u64);
    for camera in cameras {
        let image = renderer.render(camera)?.rgb_image();
        let path = folder.join(format!("{}.png", camera.name));
        let file = std::fs::File::create(&path).map_err(|error| Failure::write(&path, &error))?;
        images::write_png(file, &path, &image)?;
        progress.step();
    }
    progress.finish();
    Ok(())
}

/// The PLY comment that notes the background of the pictures.
fn background_comment([r, g, b]: [f32; 3]) -> String {
    format!("{}{r} {g} {b}", comments::BACKGROUND)
}

/// Reports the number of invisible splats, and omits them on request.
fn visible(splats: Splats, args: &FreezeArgs, console: &Console) -> Outcome<Splats> {
    let seen: Vec<usize> =
        (0..splats.len()).filter(|&i| splats.opacity(i) >= ALPHA_THRESHOLD).collect();
    let hidden = splats.len() - seen.len();
    if hidden == 0 {
        return Ok(splats);
    }
    let (time, all) = (args.time, splats.len());
    if !args.visible {
        console.note(format!(
            "{hidden} of {all} splats are invisible at time {time} and appear at others: an edit of a region changes them too; --visible omits them"
        ));
        return Ok(splats);
    }
    if seen.is_empty() {
        return Err(Failure::usage(format!("--visible: no splat is visible at time {time}"))
            .next("Choose a different --time, or omit --visible."));
    }
    console.note(format!(
        "--visible: {hidden} of {all} splats are invisible at time {time} and omitted; c4d propagate keeps them in the result"
    ));
    Ok(splats.select(&seen))
}
