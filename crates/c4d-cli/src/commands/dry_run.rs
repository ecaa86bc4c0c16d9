//! `c4d propagate --dry-run`: counts the changes of an edit and shows
//! them in an image, without propagating it.

use super::panels::{render, shaded, view};
use crate::args::Global;
use crate::camera_rig::CameraRig;
use crate::caption::{self, Rgb};
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome, chain};
use crate::images;
use crate::output::{existing, output_failure};
use crate::renderer::side_by_side;
use crate::scene::LoadedScene;
use crate::settings::PropagateJob;
use amg::{Identity, IdentityMap, IdentityParams};
use gs_core::Splats;
use gs_io::AtomicFile;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Change of a splat by the edit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    Unchanged,
    Recoloured,
    Moved,
    New,
    Removed,
}

impl Change {
    const ALL: [Self; 5] =
        [Self::Unchanged, Self::Recoloured, Self::Moved, Self::New, Self::Removed];

    fn name(self) -> &'static str {
        match self {
            Self::Unchanged => "unchanged",
            Self::Recoloured => "recoloured",
            Self::Moved => "moved",
            Self::New => "new",
            Self::Removed => "removed",
        }
    }

    /// How the propagation moves such splats.
    fn motion(self) -> &'static str {
        match self {
            Self::Unchanged | Self::Recoloured => "they keep their own motion, exactly",
            Self::Moved => "they keep their own motion, transformed with their group",
            Self::New => "their motion is estimated from the splats around them",
            Self::Removed => "missing from the edit; they are removed",
        }
    }

    /// Colour in the image.
    fn color(self) -> Rgb {
        match self {
            Self::Unchanged => [0.45, 0.45, 0.45],
            Self::Recoloured => [1.0, 0.65, 0.1],
            Self::Moved => [0.3, 0.6, 1.0],
            Self::New => [0.25, 0.9, 0.35],
            Self::Removed => [1.0, 0.2, 0.25],
        }
    }

    fn of(identity: Identity) -> Self {
        match identity {
            Identity::Unchanged(_) => Self::Unchanged,
            Identity::Recolored(_) => Self::Recoloured,
            Identity::Moved { .. } => Self::Moved,
            Identity::Edited => Self::New,
        }
    }
}

/// Counts the changes between `before` and `after`, both at the
/// time of the edit, and writes the image.
pub(super) fn show(
    args: &PropagateJob,
    (source, before): (&LoadedScene, &Splats),
    (after, identity): (&Splats, &IdentityParams),
    global: &Global,
    console: &Console,
) -> Outcome {
    let path = picture_path(&args.output);
    // Refuse the output before the work, not after it.
    let mut file =
        AtomicFile::create(&path, existing(global)).map_err(|error| output_failure(&error))?;
    let params = IdentityParams { enabled: true, ..identity.clone() };
    let map = IdentityMap::of(before, after, &params)
        .map_err(|error| Failure::bad_input(chain(&error)))?;
    let fates = map.rows.iter().map(|row| Change::of(*row));
    let fates: Vec<Change> =
        fates.chain(std::iter::repeat_n(Change::Removed, map.removed.len())).collect();
    let count = |change| fates.iter().filter(|other| **other == change).count();
    let counts = Change::ALL.map(|change| (change.name().to_owned(), json!(count(change))));
    console.report(|| json!({ "splats": serde_json::Map::from_iter(counts) }));
    for change in Change::ALL {
        console.result(format!("{:>10} {:>9}  {}", change.name(), count(change), change.motion()));
    }

    let mut both = after.clone();
    for &row in &map.removed {
        both.push_from(before, row as usize);
    }
    let device = Device::open(global.gpu)?;
    let rig = CameraRig::of_scene(source.scene.as_ref(), source.up).map_err(Failure::input)?;
    let camera = view(&rig, &both, |row| fates[row] != Change::Unchanged, &device)?;
    let background = source.background;
    let panels = [
        render(before.clone(), &camera, background, &device)?,
        render(after.clone(), &camera, background, &device)?,
        render(shaded(&both, |row| fates[row].color()), &camera, [0.0; 3], &device)?,
    ];
    let titles = ["before", "after", "what changed"];
    let panels =
        panels.into_iter().zip(titles).map(|(image, title)| caption::titled(&image, title));
    let joined = panels.reduce(|left, right| side_by_side(&left, &right)).unwrap_or_default();
    let legend =
        Change::ALL.map(|change| (change.color(), format!("{} {}", change.name(), count(change))));
    images::write_png(&mut file, &path, &caption::with_legend(&joined, &legend))?;
    file.commit().map_err(|error| output_failure(&error))?;
    console.note(format!(
        "only the image is written, at time {}; run without --dry-run to apply \
                         the edit at all times",
        args.time
    ));
    console.output(&path, &[]);
    Ok(())
}

/// The output itself if it is a PNG, else an image next to it.
fn picture_path(output: &Path) -> PathBuf {
    if output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        return output.to_owned();
    }
    // Removes a trailing slash.
    let output: PathBuf = output.components().collect();
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".preview.png");
    output.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_preview_is_next_to_the_run() {
        let path = |output: &str| picture_path(Path::new(output)).display().to_string();
        assert_eq!(path("out/run/"), "out/run.preview.png", "a folder");
        assert_eq!(path("run.v2"), "run.v2.preview.png", "a dot");
        assert_eq!(path("look.PNG"), "look.PNG", "a picture");
    }
}
