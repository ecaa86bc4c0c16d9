//! Edited pictures and masks as files: one for each camera, found by name.

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use gs_core::{Camera, Image};
use image::{DynamicImage, ImageReader};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Extensions of the supported formats.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Maximum number of names in a message.
const SHOWN: usize = 5;
/// Advice for pictures that do not match the cameras.
const AS_FROZEN: &str = "Save each picture under the name and in the size that `c4d freeze --views` gave it; leave pictures that need no edit unchanged.";

/// The pictures in `folder`, one for each camera in the cameras' order.
pub(super) fn read_pictures(
    folder: &Path,
    cameras: &[Camera],
    console: &Console,
) -> Outcome<Vec<Image>> {
    let files = find(folder, cameras, "picture")?;
    let mut lossy = 0;
    let mut images = Vec::with_capacity(files.len());
    for (path, camera) in files.iter().zip(cameras) {
        let picture = decode(path, camera)?;
        if !is_opaque(&picture) {
            return Err(Failure::bad_input(format!(
                "{}: the picture has transparent pixels",
                path.display()
            ))
            .next("Flatten it: erased areas need the colour that should be visible there."));
        }
        lossy += usize::from(!ends_in(path, "png"));
        images.push(rgb(&picture));
    }
    if lossy > 0 {
        console.note(format!(
            "{lossy} of {} pictures are JPEG: pixels that compression changed by more than 8/255 count as edited; PNG is safer",
            files.len()
        ));
    }
    Ok(images)
}

/// The masks in `folder`, `[H,W]` per camera: lighter than half is edited.
pub(super) fn read_masks(folder: &Path, cameras: &[Camera]) -> Outcome<Vec<Vec<bool>>> {
    let files = find(folder, cameras, "mask")?;
    let mut masks = Vec::with_capacity(files.len());
    for (path, camera) in files.iter().zip(cameras) {
        let picture = decode(path, camera)?;
        let opaque = is_opaque(&picture);
        let grey_alpha = picture.to_luma_alpha8();
        // Some editors save a selection as white that is transparent elsewhere.
        masks.push(grey_alpha.pixels().map(|p| p.0[0] > 127 && (opaque || p.0[1] > 127)).collect());
    }
    Ok(masks)
}

fn find(folder: &Path, cameras: &[Camera], what: &str) -> Outcome<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|error| {
        Failure::bad_input(format!("cannot read the folder {}: {error}", folder.display()))
            .next(format!("Specify the folder with the {what}s."))
    })?;
    let mut found: BTreeMap<String, PathBuf> = BTreeMap::new();
    for entry in entries {
        let path = entry.map_err(|error| Failure::write(folder, &error))?.path();
        if !ENDINGS.iter().any(|ending| ends_in(&path, ending)) {
            continue;
        }
        let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else { continue };
        if stem.starts_with('.') {
            continue;
        }
        if let Some(other) = found.insert(stem.to_owned(), path.clone()) {
            return Err(Failure::bad_input(format!(
                "two {what}s for one view: {} and {}",
                other.display(),
                path.display()
            ))
            .next("Keep only the edited one in the folder."));
        }
    }
    let missing: Vec<&str> = cameras
        .iter()
        .map(|camera| camera.name.as_str())
        .filter(|name| !found.contains_key(*name))
        .collect();
    if !missing.is_empty() {
        return Err(Failure::bad_input(format!(
            "{}: {} of {} {what}s are missing: {}",
            folder.display(),
            missing.len(),
            cameras.len(),
            listed(&missing)
        ))
        .next(AS_FROZEN));
    }
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    let extra: Vec<&str> =
        found.keys().map(String::as_str).filter(|name| !names.contains(name)).collect();
    if !extra.is_empty() {
        return Err(Failure::bad_input(format!(
            "{}: no camera for the {what}s {}",
            folder.display(),
            listed(&extra)
        ))
        .next(AS_FROZEN));
    }
    Ok(names.iter().filter_map(|name| found.remove(*name)).collect())
}

fn listed(names: &[&str]) -> String {
    let mut text = names.iter().take(SHOWN).copied().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        let _ = write!(text, " and {} more", names.len() - SHOWN);
    }
    text
}

fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending))
}

/// Reads a picture, after its size was compared with the camera's.
fn decode(path: &Path, camera: &Camera) -> Outcome<DynamicImage> {
    let broken = |error: &dyn std::fmt::Display| {
        Failure::bad_input(format!("{}: {error}", path.display()))
            .next("Save the picture again, as PNG or JPEG.")
    };
    let bytes = gs_io::read_file(path).map_err(|error| broken(&error))?;
    let reader = || ImageReader::new(Cursor::new(&bytes)).with_guessed_format();
    let size = reader()
        .map_err(|error| broken(&error))?
        .into_dimensions()
        .map_err(|error| broken(&error))?;
    if size != (camera.width, camera.height) {
        return Err(Failure::bad_input(format!(
            "{}: {}×{} pixels, expected {}×{}",
            path.display(),
            size.0,
            size.1,
            camera.width,
            camera.height
        ))
        .next("Resize it, or run `c4d freeze` again with your editor's size: `c4d freeze --views N --size WxH`."));
    }
    reader().map_err(|error| broken(&error))?.decode().map_err(|error| broken(&error))
}

fn is_opaque(picture: &DynamicImage) -> bool {
    // Resampling can lower full alpha by one step.
    !picture.color().has_alpha() || picture.to_luma_alpha8().pixels().all(|p| p.0[1] >= 254)
}

/// Colours 0 to 1, of any depth; grey becomes RGB.
fn rgb(picture: &DynamicImage) -> Image {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let sixteen =
        matches!(picture.color().bits_per_pixel() / u16::from(picture.color().channel_count()), 16);
    let data = if sixteen {
        picture.to_rgb16().into_raw().into_iter().map(|v| f32::from(v) / 65535.0).collect()
    } else {
        picture.to_rgb8().into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect()
    };
    Image { width, height, channels: 3, data }
}
