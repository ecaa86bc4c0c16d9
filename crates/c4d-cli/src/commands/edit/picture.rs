//! The picture of an edit: before, selection, after.

use crate::camera_rig::CameraRig;
use crate::caption::{self, Rgb};
use crate::commands::panels::{render, shaded, view};
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::renderer::side_by_side;
use crate::scene::LoadedScene;
use gs_core::{Image, Splats};
use gs_io::AtomicFile;
use std::path::Path;

/// Colour of splats outside all selections.
const REST: Rgb = [0.4, 0.4, 0.4];
/// Colours of the selections, in order; repeated for later ones.
const COLORS: [Rgb; 6] = [
    [1.0, 0.65, 0.1],
    [0.3, 0.6, 1.0],
    [0.25, 0.9, 0.35],
    [1.0, 0.3, 0.5],
    [0.7, 0.45, 1.0],
    [0.95, 0.9, 0.3],
];
/// Maximum length of an expression in the legend, characters.
const SHOWN: usize = 44;

/// A selection in the legend.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    /// The expression.
    pub(super) text: String,
    /// Number of selected splats.
    pub(super) count: usize,
}

/// Draws the three panels. `marks` are numbers of selections, from 0, of the input's splats
/// (`[N]`).
pub(super) fn draw(
    opened: &LoadedScene,
    up: [f64; 3],
    (before, after): (&Splats, &Splats),
    (marks, selections): (&[Option<usize>], &[Shown]),
    device: &Device,
) -> Outcome<Image> {
    let rig = CameraRig::of_scene(opened.scene.as_ref(), up).map_err(Failure::input)?;
    let camera = view(&rig, before, |row| marks[row].is_some(), device)?;
    let color = |mark: usize| COLORS[mark % COLORS.len()];
    let panels = [
        render(before.clone(), &camera, opened.background, device)?,
        render(shaded(before, |row| marks[row].map_or(REST, color)), &camera, [0.0; 3], device)?,
        render(after.clone(), &camera, opened.background, device)?,
    ];
    let titles = ["before", "selected", "after"];
    let panels =
        panels.into_iter().zip(titles).map(|(image, title)| caption::titled(&image, title));
    let joined = panels.reduce(|left, right| side_by_side(&left, &right)).unwrap_or_default();
    let mut image = joined;
    for (number, Shown { text, count }) in selections.iter().enumerate() {
        let mut shown: String = text.chars().take(SHOWN).collect();
        if text.chars().count() > SHOWN {
            shown.push_str("...");
        }
        image =
            caption::with_legend(&image, &[(color(number), format!("{shown}  {count} splats"))]);
    }
    Ok(image)
}

/// Writes the picture.
pub(super) fn write(mut file: AtomicFile, path: &Path, image: &Image) -> Outcome {
    images::write_png(&mut file, path, image)?;
    file.commit().map_err(|error| crate::output::output_failure(&error))
}
