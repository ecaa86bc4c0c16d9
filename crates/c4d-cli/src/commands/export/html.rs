//! `c4d export --to html`: writes the scene, for a run together with its
//! original, as one page that plays in any browser.

use super::messages::note_written;
use crate::args::{ExportArgs, Global, OverlayArg};
use crate::camera_rig::{CameraRig, DEFAULT_SIZE};
use crate::console::Console;
use crate::device::Device;
use crate::evidence::evidence;
use crate::failure::{Failure, Outcome, chain};
use crate::output::{check_sh_degree, existing, output_failure, refuse_overlap};
use crate::overlays::{Layer, LayerSource};
use crate::renderer::Renderer;
use crate::scene::LoadedScene;
use gs_core::{Camera, DynamicScene, Image};
use gs_io::{AtomicFile, FormatLosses};
use gs_player::{
    Annotations, EncodeOptions, EncodeReport, Overlay, Page, PageScenes, PlayerError, Poster,
};
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};
use std::io::Write;
use std::path::Path;

/// Quality of the poster, 1 to 100.
const POSTER_QUALITY: u8 = 85;

pub(super) fn write(
    args: &ExportArgs,
    opened: &LoadedScene,
    (times, fps): (&[f32], f64),
    global: &Global,
    console: &Console,
) -> Outcome {
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    refuse_overlap(&args.output, &opened.roots)?;
    let options = EncodeOptions {
        sh_degree: args.sh_degree.unwrap_or(EncodeOptions::default().sh_degree),
        ..EncodeOptions::default()
    };
    // Refuse the output before the work, not after it.
    let mut file = AtomicFile::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let original = opened.original.as_ref();
    let (first, second) = match original {
        Some(original) => (original.as_ref(), Some(opened.scene.as_ref())),
        None => (opened.scene.as_ref(), None),
    };
    let layers = layers(&args.overlay, opened, global, console)?;
    let overlays: Vec<Overlay> = layers.into_iter().map(|layer| layer.overlay).collect();
    let annotations = Annotations { overlays: &overlays, row_numbers: false };
    let mut progress =
        console.progress("export", 2 * (1 + u64::from(second.is_some())) * times.len() as u64);
    let mut step = |done: usize, _| progress.set(done as u64);
    let encoded =
        gs_player::encode_annotated(first, second, times, &options, &annotations, &mut step)
            .map_err(|error| failure(&error))?;
    let elapsed = progress.finish();
    // Framed as in `c4d render`, by the scene before the edit.
    let rig = CameraRig::of_scene(first, opened.up).map_err(Failure::input)?;
    let camera = rig.front(DEFAULT_SIZE);
    let poster = poster(opened, first, times[0], &camera, global)?;
    let title = args.title.clone().unwrap_or_else(|| title(&args.output));
    let page = Page {
        title: &title,
        fps,
        camera: &camera,
        target: rig.target().to_array(),
        up: opened.up,
        limits: rig.limits(),
        background: opened.background,
        poster: Some(Poster { media_type: "image/jpeg", bytes: &poster }),
    };
    let sources = [PageScenes { encoded: &encoded, names: ["Original", "Edited"] }];
    let text = gs_player::page(&sources, &page).map_err(|error| failure(&error))?;
    file.write_all(text.as_bytes()).map_err(|error| Failure::write(&args.output, &error))?;
    file.commit().map_err(|error| output_failure(&error))?;
    let report = &encoded.report;
    let what = format!(
        "{}; {}; {} of {} stored splats move",
        crate::frames::playing(report.frames, fps),
        counts(report),
        report.moving,
        report.first.max(report.second),
    );
    let losses = losses(report, &options, times.len());
    note_written(&args.output, elapsed, &what, &losses, console);
    Ok(())
}

/// The overlays of a page.
fn layers(
    kinds: &[OverlayArg],
    opened: &LoadedScene,
    global: &Global,
    console: &Console,
) -> Outcome<Vec<Layer>> {
    let xi = if kinds.contains(&OverlayArg::Uncertainty) {
        evidence(opened, &Device::open(global.gpu)?)?
    } else {
        Vec::new()
    };
    let mut source = LayerSource::new(opened);
    kinds.iter().map(|&kind| source.layer(kind, &xi, console)).collect()
}

pub(crate) fn failure(error: &PlayerError) -> Failure {
    match error {
        PlayerError::Scene { .. } | PlayerError::NothingVisible { .. } => {
            Failure::bad_input(chain(error)).next("c4d info SCENE shows what it contains.")
        }
        PlayerError::Option { .. } | PlayerError::TooManyFrames { .. } => {
            Failure::usage(chain(error))
        }
        _ => Failure::failed(chain(error)),
    }
}

fn counts(report: &EncodeReport) -> String {
    if report.second == 0 {
        return format!("{} splats", report.first);
    }
    format!(
        "{} splats before the edit and {} after it ({} identical, {} with the same motion)",
        report.first, report.second, report.shared, report.same_motion
    )
}

/// Losses of the page.
fn losses(report: &EncodeReport, options: &EncodeOptions, frames: usize) -> FormatLosses {
    let mut losses = FormatLosses::none();
    let (available, kept) = report.sh_degree;
    if kept < available {
        losses.push(format!(
            "SH degree {available} becomes {kept}: {}; --sh-degree {available} keeps it",
            if kept == 0 {
                "colour no longer depends on the view"
            } else {
                "view-dependent colour is smoother"
            }
        ));
    }
    let (resting, moving) = report.position_error;
    losses.push(format!(
        "positions are within {resting:.1e} units for static splats and {moving:.1e} for moving \
        ones"
    ));
    losses.push(format!(
        "rotations are within about {:.2} degrees, sizes {:.1} %, opacities and colours {:.1} of \
        255 steps; three times that for changing values",
        (options.rotation_step * 3.0_f64.sqrt()).to_degrees(),
        100.0 * options.scale_step / 2.0,
        255.0 * options.color_step / 2.0,
    ));
    if frames > 1 {
        losses.push(format!("motion is linear between the {frames} frames"));
    }
    if report.not_finite > 0 {
        losses.push(format!("{} damaged splats are omitted", report.not_finite));
    }
    if report.invisible > 0 {
        losses.push(format!(
            "{} splats with opacities below 1/255 at all times are omitted: they draw nothing",
            report.invisible
        ));
    }
    if report.clamped > 0 {
        losses.push(format!(
            "{} splats are outside the range of positions and are clamped to it",
            report.clamped
        ));
    }
    losses
}

/// The first frame from the initial view, shown before the page can
/// play; for a run, the left half is the original.
fn poster(
    opened: &LoadedScene,
    first: &dyn DynamicScene,
    time: f32,
    camera: &Camera,
    global: &Global,
) -> Outcome<Vec<u8>> {
    let device = Device::open(global.gpu)?;
    let mut renderer = Renderer::new(&device, opened.background);
    let mut image = |scene| -> Outcome<Image> {
        renderer.seek(scene, time)?;
        Ok(renderer.render(camera)?.rgb_image())
    };
    let mut shown = image(first)?;
    if opened.original.is_some() {
        let edited = image(opened.scene.as_ref())?;
        for y in 0..shown.height {
            for x in shown.width / 2..shown.width {
                shown.pixel_mut(x, y).copy_from_slice(edited.pixel(x, y));
            }
        }
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, POSTER_QUALITY)
        .write_image(&shown.to_bytes(), camera.width, camera.height, ExtendedColorType::Rgb8)
        .map_err(|error| Failure::failed(format!("the poster cannot be encoded: {error}")))?;
    Ok(bytes)
}

/// Name of the file, as a title.
fn title(output: &Path) -> String {
    let stem = output.file_stem().map(|stem| stem.to_string_lossy().replace(['_', '-'], " "));
    let mut title = stem.unwrap_or_default().trim().to_owned();
    if let Some(first) = title.get(..1) {
        title.replace_range(..1, &first.to_uppercase());
    }
    if title.is_empty() { "Scene".to_owned() } else { title }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_are_names_of_files() {
        assert_eq!(
            title(Path::new("some/where/flame_steak-edit.html")),
            "Flame steak edit",
            "separate words, capitalised"
        );
        assert_eq!(
            title(Path::new("ünter.html")),
            "ünter",
            "the first letter is not ASCII and \
                                   stays unchanged"
        );
    }
}
