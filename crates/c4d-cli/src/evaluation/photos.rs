//! [`Photos`]: the photographs of a data set, found by view name.

use crate::failure::{Failure, Outcome};
use gs_core::{Camera, Image};
use image::imageops::FilterType;
use std::path::{Path, PathBuf};

/// File extensions of the supported formats.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// File extensions of videos. Videos are rejected as ground truth because compression changes
/// flicker.
const VIDEOS: [&str; 4] = ["mp4", "mkv", "mov", "webm"];
/// Folders that may lie between a camera's folder and its images.
const IMAGE_FOLDERS: [&str; 4] = ["images", "rgb", "1x", "2x"];
/// Maximum depth of the search.
const MAX_DEPTH: usize = 6;
/// Largest difference between the times of a photograph and its frame.
const SAME_TIME: f32 = 1e-4;

/// Files of the photographs of views.
#[derive(Debug)]
pub(crate) struct Photos {
    /// Camera (with time) of each photograph, and its file.
    photographs: Vec<(Camera, PathBuf)>,
}

impl Photos {
    /// Finds the photographs of `cameras` in `folder`. The cameras have times.
    pub(crate) fn find(folder: &Path, cameras: &[Camera]) -> Outcome<Self> {
        let mut files = Vec::new();
        list(folder, 0, &mut files)?;
        files.sort();
        let named: Vec<(Vec<String>, &PathBuf)> = files
            .iter()
            .map(|file| (parts(file.strip_prefix(folder).unwrap_or(file)), file))
            .collect();
        let photographs: Vec<(Camera, PathBuf)> = cameras
            .iter()
            .filter_map(|camera| {
                let name = parts(Path::new(&camera.name));
                let found =
                    named.iter().find(|(file, _)| file.ends_with(&name) && !name.is_empty());
                found.map(|(_, file)| (camera.clone(), (*file).clone()))
            })
            .collect();
        if photographs.is_empty() {
            let names: Vec<&str> = cameras.iter().take(3).map(|c| c.name.as_str()).collect();
            return Err(Failure::bad_input(format!(
                "--truth {}: none of its {} images has the name of a view ({} …)",
                folder.display(),
                files.len(),
                names.join(", ")
            ))
            .next("Use the folder of the data set passed with --cameras."));
        }
        Ok(Self { photographs })
    }

    /// Number of photographs found.
    pub(crate) fn len(&self) -> usize {
        self.photographs.len()
    }

    /// The photograph of a view at time `t`, in the view's size.
    pub(crate) fn picture(&self, view: &Camera, t: f32) -> Outcome<Option<Image>> {
        let is_of = |camera: &Camera| {
            let station = camera.name == view.name
                || camera.name.strip_prefix(&view.name).is_some_and(|rest| rest.starts_with('/'));
            station && camera.time.is_none_or(|time| (time - t).abs() < SAME_TIME)
        };
        let Some((_, file)) = self.photographs.iter().find(|(camera, _)| is_of(camera)) else {
            return Ok(None);
        };
        let refused = |error: &dyn std::fmt::Display| {
            Failure::bad_input(format!("{}: {error}", file.display()))
        };
        let bytes = gs_io::read_file(file).map_err(|error| refused(&error))?;
        let picture = image::load_from_memory(&bytes).map_err(|error| refused(&error))?;
        let mut rgb = picture.to_rgb8();
        if (rgb.width(), rgb.height()) != (view.width, view.height) {
            rgb = image::imageops::resize(&rgb, view.width, view.height, FilterType::Lanczos3);
        }
        let data = rgb.into_raw().into_iter().map(|value| f32::from(value) / 255.0).collect();
        Image::from_data(view.width as usize, view.height as usize, 3, data)
            .map(Some)
            .map_err(|error| refused(&error))
    }
}

fn list(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Outcome {
    let refused = |error: std::io::Error| {
        Failure::bad_input(format!("cannot read the folder {}: {error}", folder.display()))
    };
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        if path.is_dir() && depth < MAX_DEPTH {
            list(&path, depth + 1, files)?;
        } else if has_ending(&path, &ENDINGS) {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether a path has one of these extensions, ignoring case.
fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| {
        endings.iter().any(|ending| extension.eq_ignore_ascii_case(ending))
    })
}

/// Whether a path names a video.
pub(crate) fn is_video(path: &Path) -> bool {
    has_ending(path, &VIDEOS)
}

/// Whether a path is a folder with at least one image at a depth of at most [`MAX_DEPTH`].
pub(crate) fn holds_images(path: &Path) -> bool {
    let mut files = Vec::new();
    path.is_dir() && list(path, 0, &mut files).is_ok() && !files.is_empty()
}

/// Folders and stem of a path, without the folders in [`IMAGE_FOLDERS`].
fn parts(path: &Path) -> Vec<String> {
    let stem = if has_ending(path, &ENDINGS) { path.with_extension("") } else { path.to_owned() };
    stem.components()
        .filter_map(|part| match part {
            std::path::Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
            _ => None,
        })
        .filter(|name| !IMAGE_FOLDERS.contains(&name.as_str()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_views_lead_to_files() {
        let at = |text: &str| parts(Path::new(text));
        assert!(at("cam00/images/0007.png").ends_with(&at("cam00/0007")), "DyNeRF");
        assert!(at("test/r_003.png").ends_with(&at("./test/r_003")), "D-NeRF");
        assert!(at("rgb/2x/000012.png").ends_with(&at("000012")), "HyperNeRF");
        assert!(!at("cam01/images/0007.png").ends_with(&at("cam00/0007")), "a different camera");
    }
}
