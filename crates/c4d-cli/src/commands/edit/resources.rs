//! Files that selections and actions refer to, loaded before any change.

use crate::args::Global;
use crate::console::Console;
use crate::device::{self, Device};
use crate::failure::{Failure, Outcome, chain};
use crate::rigid_parts::rigid_parts;
use crate::scene::{self, LoadedScene};
use crate::{cameras, still};
use gs_core::{Camera, Image, Splats};
use gs_edit::{EditError, Motion, ResourceNames, Resources, lift_masks, parse_ids};
use gs_raster_cpu::CpuRasterizer;
use image::ImageReader;
use std::cell::RefCell;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Extensions of pictures.
const PICTURES: [&str; 3] = ["png", "jpg", "jpeg"];

/// The frame to edit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Input<'a> {
    pub(super) opened: &'a LoadedScene,
    pub(super) time: f32,
    pub(super) splats: &'a Splats,
}

/// The files and folders in `needs`, so that no output replaces one.
pub(super) fn paths(needs: &ResourceNames, folders: &[PathBuf]) -> Outcome<Vec<PathBuf>> {
    let names = [&needs.masks, &needs.ids, &needs.images, &needs.splats];
    names.into_iter().flatten().map(|name| find(name, folders)).collect()
}

/// Loads the resources in `needs`. Relative names are searched for in `folders`, in order.
pub(super) fn load(
    needs: &ResourceNames,
    input: Input<'_>,
    folders: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<Resources> {
    let mut resources = Resources { num_splats: input.splats.len(), ..Resources::default() };
    let find = |name: &str| find(name, folders);
    for name in &needs.ids {
        let bytes = read_bytes(&find(name)?)?;
        let ranges = parse_ids(&String::from_utf8_lossy(&bytes)).map_err(|error| {
            Failure::bad_input(format!("{name}: {error}")).next(
                "List row numbers from 0, one per line or separated by commas; 10..20 is a range.",
            )
        })?;
        resources.ids.insert(name.clone(), ranges);
    }
    for name in &needs.images {
        resources.images.insert(name.clone(), read_picture(&find(name)?)?);
    }
    for name in &needs.splats {
        let path = find(name)?;
        let kind = gs_io::detect(&path).map_err(|error| scene::bad_input(&error))?;
        if !kind.is_frame() {
            return Err(Failure::bad_input(format!(
                "--graft {name}: expected one frame of splats, found {kind}"
            ))
            .next(
                "Use a frame in any format; c4d freeze SCENE -o FRAME writes one from a scene.",
            ));
        }
        let opened = still::open(&path, None, global, console)?;
        let splats = opened.scene.at(opened.edit_time).map_err(Failure::input)?;
        let degree = input.splats.sh_degree;
        if splats.sh_degree > degree {
            console.note(format!(
                "{name}: SH degree {} is reduced to {degree}, that of the input",
                splats.sh_degree
            ));
        }
        resources.splats.insert(name.clone(), splats);
    }
    let mut masks = Vec::new();
    for name in &needs.masks {
        masks.push((name, read_masks(&find(name)?, input.opened, console)?));
    }
    if needs.motion {
        resources.motion = Some(motion(input, console)?);
    }
    if !masks.is_empty() {
        let device = Device::open(global.gpu)?;
        for (name, views) in masks {
            let progress = RefCell::new(console.progress("masks", views.len() as u64));
            let step = |done| progress.borrow_mut().set(done as u64);
            let lifted = match &device {
                Device::Cpu => lift_masks(&CpuRasterizer::default(), input.splats, &views, &step),
                #[cfg(feature = "gpu")]
                Device::Gpu(raster) => lift_masks(raster, input.splats, &views, &step),
            };
            let lifted = lifted.map_err(|error| match &error {
                EditError::Raster(error) => device::failure(error),
                other => Failure::bad_input(format!("mask {name}: {}", chain(other))),
            })?;
            resources.masks.insert(name.clone(), lifted);
        }
    }
    Ok(resources)
}

/// The bytes of a file named by the user.
pub(super) fn read_bytes(path: &Path) -> Outcome<Vec<u8>> {
    gs_io::read_file(path).map_err(|error| {
        Failure::bad_input(format!("cannot read {}: {error}", path.display()))
            .next("Check that the name is right and that the file is readable.")
    })
}

/// The path of the file in the first folder that has it.
fn find(name: &str, folders: &[PathBuf]) -> Outcome<PathBuf> {
    let candidates = folders.iter().map(|folder| folder.join(name));
    candidates.clone().find(|path| path.exists()).ok_or_else(|| {
        let tried: Vec<String> = candidates.map(|path| path.display().to_string()).collect();
        Failure::bad_input(format!("{name} does not exist; looked for {}", tried.join(", "))).next(
            "Check the name; names in selections and actions are relative to the working folder.",
        )
    })
}

fn motion(input: Input<'_>, console: &Console) -> Outcome<Motion> {
    let Input { opened, time, .. } = input;
    if opened.kind.is_frame() {
        return Err(Failure::usage(format!(
            "`moving` and `part` need a dynamic scene; {} is a single frame",
            opened.path.display()
        ))
        .next("Use the dynamic scene instead of the frame; --time selects the frame to edit."));
    }
    let found = rigid_parts(opened.scene.as_ref(), time, console)?;
    Ok(Motion { moving: found.moving, parts: found.parts })
}

/// RGB and coverage, 0 to 1.
pub(super) fn read_picture(path: &Path) -> Outcome<Image> {
    let picture = decode(path)?.into_rgba32f();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    Image::from_data(width, height, 4, picture.into_raw()).map_err(Failure::failed)
}

fn decode(path: &Path) -> Outcome<image::DynamicImage> {
    let bytes = read_bytes(path)?;
    let bad = |error: &dyn std::error::Error| {
        Failure::bad_input(format!(
            "{}: not a picture that can be read: {}",
            path.display(),
            chain(error)
        ))
        .next("Save it as PNG or JPEG.")
    };
    ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| bad(&error))?
        .decode()
        .map_err(|error| bad(&error))
}

/// Grey times coverage, 0 to 1.
fn read_mask(path: &Path) -> Outcome<Image> {
    let mask = decode(path)?.into_luma_alpha16();
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let full = f32::from(u16::MAX);
    let grey =
        mask.pixels().map(|p| f32::from(p.0[0]) / full * (f32::from(p.0[1]) / full)).collect();
    Image::from_data(width, height, 1, grey).map_err(Failure::failed)
}

/// Pictures of a folder by the names of the cameras in its `cameras.json`, or in that of the folder
/// around it.
fn read_masks(
    folder: &Path,
    opened: &LoadedScene,
    console: &Console,
) -> Outcome<Vec<(Camera, Image)>> {
    let inside = folder.join("cameras.json");
    let around = folder.join("..").join("cameras.json");
    let file = [&inside, &around].into_iter().find(|file| file.is_file()).ok_or_else(|| {
        Failure::bad_input(format!("mask {}: no cameras.json in it or in the folder around it", folder.display()))
            .next("c4d freeze SCENE -o FRAME writes cameras.json; draw masks for its cameras into FRAME/masks/NAME.png.")
    })?;
    let set = cameras::open(file, None, opened, console)?;
    let candidates: Vec<&Camera> = set.views.iter().map(|view| &view.camera).collect();
    let entries = std::fs::read_dir(folder).map_err(|error| {
        Failure::bad_input(format!("cannot read {}: {error}", folder.display()))
    })?;
    let mut pictures: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    pictures.retain(|path| {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        PICTURES.contains(&ending.as_str())
    });
    pictures.sort();
    let mut views = Vec::new();
    for path in &pictures {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let camera = candidates.iter().find(|camera| {
            camera.name == stem
                || Path::new(&camera.name).file_stem().is_some_and(|name| *name == *stem)
        });
        let camera = camera.ok_or_else(|| {
            let names: Vec<&str> = candidates.iter().take(8).map(|c| c.name.as_str()).collect();
            Failure::bad_input(format!(
                "{}: {} has no camera of this name",
                path.display(),
                file.display()
            ))
            .next(format!("Name the masks after the cameras: {}, …", names.join(", ")))
        })?;
        let mask = read_mask(path)?;
        views.push((camera_of_size(camera, &mask, path)?, mask));
    }
    if views.is_empty() {
        return Err(Failure::bad_input(format!(
            "mask {}: no PNG or JPEG in this folder",
            folder.display()
        ))
        .next("Draw what to select in white on black, into NAME.png for the camera NAME."));
    }
    Ok(views)
}

/// The camera at the size of the mask, which must have its proportions.
fn camera_of_size(camera: &Camera, mask: &Image, path: &Path) -> Outcome<Camera> {
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    let (width, height) = (side(mask.width), side(mask.height));
    // One pixel of rounding.
    let expected = f64::from(width) * f64::from(camera.height) / f64::from(camera.width.max(1));
    if (expected - f64::from(height)).abs() > 1.0 {
        return Err(Failure::bad_input(format!(
            "{}: {width}x{height} pixels, expected the proportions of its camera, {}x{}",
            path.display(),
            camera.width,
            camera.height
        ))
        .next("Draw the mask on the picture of that camera, without cropping."));
    }
    Ok(camera.resized(width, height))
}
