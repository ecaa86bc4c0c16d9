//! [`SavedCameras`]: the cameras saved in the page.

use crate::failure::Failure;
use crate::output::output_failure;
use gs_core::{Camera, Intrinsics};
use gs_io::{Existing, cameras_json};
use serde::Deserialize;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A file of cameras, rewritten with each added camera.
#[derive(Debug)]
pub(super) struct SavedCameras {
    file: PathBuf,
    /// Treatment of a file that existed before.
    existing: Existing,
    cameras: Mutex<Vec<Camera>>,
}

/// The page's current view.
#[derive(Debug, Deserialize)]
struct View {
    /// World to camera, rows x right, y down, z forward.
    rows: [[f64; 4]; 3],
    /// Focal lengths, pixels.
    focal: [f64; 2],
    size: [u32; 2],
    near: f64,
}

impl SavedCameras {
    pub(super) fn new(file: PathBuf, existing: Existing) -> Self {
        Self { file, existing, cameras: Mutex::new(Vec::new()) }
    }

    /// Adds a view, as JSON from the page; returns its name and the file.
    pub(super) fn add(&self, view: &[u8]) -> Result<(String, PathBuf), String> {
        let view: View = serde_json::from_slice(view).map_err(|error| error.to_string())?;
        let [width, height] = view.size;
        let mut cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
        let camera = Camera {
            viewmat: [view.rows[0], view.rows[1], view.rows[2], [0.0, 0.0, 0.0, 1.0]],
            intrinsics: Intrinsics {
                fx: view.focal[0],
                fy: view.focal[1],
                cx: f64::from(width) / 2.0,
                cy: f64::from(height) / 2.0,
            },
            width,
            height,
            near: view.near,
            time: None,
            name: format!("view_{}", cameras.len() + 1),
        };
        camera.check().map_err(|error| error.to_string())?;
        let name = camera.name.clone();
        cameras.push(camera);
        let existing = if cameras.len() > 1 { Existing::Replace } else { self.existing };
        if let Err(error) = cameras_json::write_file(&self.file, &cameras, existing) {
            cameras.pop();
            let Failure { what, next, .. } = output_failure(&error);
            return Err(format!("{what}. {}", next.unwrap_or_default()));
        }
        Ok((name, self.file.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_added_to_one_file_and_bad_ones_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cameras.json");
        let saved = SavedCameras::new(file.clone(), Existing::Refuse);
        let view = |near: f64| {
            format!(
                r#"{{"rows":[[1,0,0,0],[0,1,0,0],[0,0,1,2]],"focal":[50,50],"size":[64,48],"near":{near}}}"#
            )
        };
        assert!(saved.add(view(-1.0).as_bytes()).unwrap_err().contains("near"), "invalid");
        assert!(saved.add(b"{}").is_err() && !file.exists(), "nothing is written");
        assert_eq!(saved.add(view(0.1).as_bytes()).unwrap().0, "view_1", "named");
        assert_eq!(saved.add(view(0.1).as_bytes()).unwrap().0, "view_2", "both");
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.contains("view_1") && text.contains("view_2"), "in one file: {text}");
        let again = SavedCameras::new(file, Existing::Refuse);
        let refused = again.add(view(0.1).as_bytes()).unwrap_err();
        assert!(refused.contains("already exists") && refused.contains("-w"), "{refused}");
        assert!(
            std::fs::read_to_string(folder.path().join("cameras.json")).unwrap() == text,
            "kept"
        );
    }
}
