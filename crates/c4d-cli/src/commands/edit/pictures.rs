//! `c4d edit --views`: fits the splats of a frame to edited pictures of it.

use super::picture_files::{read_masks, read_pictures};
use super::progress::{ProgressObserver, WorkFolder};
use crate::args::{EditArgs, Global};
use crate::console::Console;
use crate::device::{self, Device};
use crate::failure::{Failure, Outcome, chain};
use crate::output::{existing, output_failure, refuse_overlap};
use crate::renderer::{Renderer, contact_sheet, side_by_side};
use crate::{images, scene};
use gs_core::{Camera, Image, Splats};
use gs_deform::StaticScene;
use gs_fit::{EditedPicture, FitError, FitOptions, Fitted, fit};
use gs_io::frame::{self, Frame, FrameFormat};
use gs_io::ply::comments;
use gs_io::{AtomicFile, cameras_json, ply};
use gs_raster_cpu::CpuRasterizer;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Camera files of a frozen frame.
const CAMERAS: &str = "cameras.json";
/// Seconds between previews in the work folder.
const PREVIEW_SECS: f64 = 10.0;
/// Views in `--preview`, and its width, pixels.
const PREVIEW_VIEWS: usize = 6;
const PREVIEW_WIDTH: usize = 1800;

pub(super) fn run(args: &EditArgs, folder: &Path, global: &Global, console: &Console) -> Outcome {
    let output = args.fitted_output()?;
    if !output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ply")) {
        return Err(Failure::usage(format!("-o {}: c4d edit writes a 3DGS PLY", output.display()))
            .next("Choose a name that ends in .ply; c4d propagate reads it."));
    }
    let input = frame::file_of(&args.input);
    refuse_overlap(output, &[folder.to_owned(), input.clone()])?;
    let frame = frame::read_file(&args.input).map_err(|error| scene::bad_input(&error))?;
    for note in &frame.notes {
        console.note(format!("{}: {note}", input.display()));
    }
    let cameras = cameras(args, folder)?;
    let pictures = pictures(args, folder, &cameras, console)?;
    let options = options(args, &frame, &cameras)?;
    // Outputs that cannot be written are rejected before the work starts.
    let refused = |error: gs_io::IoError| output_failure(&error);
    drop(AtomicFile::create(output, existing(global)).map_err(refused)?);
    if let Some(preview) = &args.preview {
        drop(AtomicFile::create(preview, existing(global)).map_err(refused)?);
    }
    let device = Device::open(global.gpu)?;
    let (work, state) = WorkFolder::open(output, args.pictures.resume, global.overwrite)?;
    let mut observer = ProgressObserver {
        folder: &work,
        progress: console.progress("fit", options.steps as u64),
        failure: None,
        has_state: state.is_some(),
    };
    let (start, state) = (&frame.splats, state.as_ref());
    let fitted = match &device {
        Device::Cpu => {
            fit(&CpuRasterizer::default(), start, &pictures, &options, state, &mut observer)
        }
        #[cfg(feature = "gpu")]
        Device::Gpu(raster) => fit(raster, start, &pictures, &options, state, &mut observer),
    };
    let ProgressObserver { progress, failure, has_state, .. } = observer;
    let took = progress.finish();
    let fitted = match (fitted, failure) {
        (_, Some(failure)) => return Err(failure),
        (Err(error), None) => {
            if !has_state {
                work.remove();
            }
            return Err(fit_failure(&error, args));
        }
        (Ok(fitted), None) => fitted,
    };
    write(args, &frame, &input, &fitted, global)?;
    note_fit(output, &fitted, console, took.as_secs_f64());
    if let Some(poor) = &fitted.report.poorly_seen {
        let path = output.with_extension("unseen.png");
        write_image(&path, &poor.image, gs_io::Existing::Replace)?;
        console.warn(format!(
            "{} masked pixels show splats that are visible in fewer than three pictures, so their positions are uncertain. {} shows them in red, in {}",
            poor.pixels,
            path.display(),
            poor.view
        ));
    }
    if let Some(path) = &args.preview {
        let sheet = preview(start, &fitted, &pictures, &device, &options)?;
        write_image(path, &sheet, existing(global))?;
        console.wrote(path);
    }
    work.remove();
    let time = noted(&frame, comments::TIME).unwrap_or("0");
    console.note(format!(
        "next: c4d propagate SCENE --edited {} --time {time} -o RUN",
        output.display()
    ));
    console.output(output, &[("splats", fitted.splats.len())]);
    Ok(())
}

/// The cameras of the pictures.
fn cameras(args: &EditArgs, folder: &Path) -> Outcome<Vec<Camera>> {
    let camera_file = |folder: &Path| Some(folder.join(CAMERAS)).filter(|file| file.is_file());
    let frame_folder =
        if args.input.is_dir() { Some(args.input.as_path()) } else { args.input.parent() };
    let file: PathBuf = args
        .pictures
        .cameras
        .clone()
        .or_else(|| camera_file(folder))
        .or_else(|| camera_file(frame_folder?))
        .ok_or_else(|| {
            Failure::bad_input(format!(
                "no {CAMERAS} in {} or next to {}",
                folder.display(),
                args.input.display()
            ))
            .next("`c4d freeze SCENE --views 24 -o FRAME` writes pictures and their cameras; pass FRAME, or the cameras with --cameras.")
        })?;
    let (cameras, notes) =
        cameras_json::read_file(&file).map_err(|error| scene::bad_input(&error))?;
    // Each picture needs its camera, so malformed cameras are errors here.
    if let Some(note) = notes.first() {
        return Err(Failure::bad_input(format!("{}: {note}", file.display())));
    }
    let mut names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.array_windows().find(|[a, b]| a == b) {
        let [name, _] = pair;
        return Err(Failure::bad_input(format!(
            "{}: two cameras are named {name}",
            file.display()
        )));
    }
    Ok(cameras)
}

fn pictures(
    args: &EditArgs,
    folder: &Path,
    cameras: &[Camera],
    console: &Console,
) -> Outcome<Vec<EditedPicture>> {
    let images = read_pictures(folder, cameras, console)?;
    let masks: Vec<Option<Vec<bool>>> = if args.pictures.mask == Path::new("auto") {
        vec![None; cameras.len()]
    } else {
        read_masks(&args.pictures.mask, cameras)?.into_iter().map(Some).collect()
    };
    let parts = images.into_iter().zip(masks).zip(cameras);
    Ok(parts
        .map(|((image, mask), camera)| EditedPicture { camera: camera.clone(), image, mask })
        .collect())
}

fn options(args: &EditArgs, frame: &Frame, cameras: &[Camera]) -> Outcome<FitOptions> {
    let flags = &args.pictures;
    let seconds = flags.checkpoint_every;
    if !(seconds >= 0.0 && seconds.is_finite()) {
        return Err(Failure::usage(format!(
            "--checkpoint-every {seconds}: expected seconds, 0 or more"
        )));
    }
    let reference = flags
        .reference
        .as_ref()
        .map(|name| {
            cameras.iter().position(|camera| camera.name == *name).ok_or_else(|| {
                let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
                Failure::usage(format!("--reference {name}: no such view"))
                    .next(format!("Views: {}.", names.join(", ")))
            })
        })
        .transpose()?;
    let background = noted(frame, comments::BACKGROUND)
        .and_then(|text| {
            let rgb: Vec<f64> = text.split_whitespace().filter_map(|x| x.parse().ok()).collect();
            <[f64; 3]>::try_from(rgb).ok()
        })
        .unwrap_or_default();
    Ok(FitOptions {
        steps: flags.steps as usize,
        geometry: !flags.keep_geometry,
        densify: !flags.no_densify,
        align: !flags.no_align,
        background,
        reference,
        seed: flags.seed,
        preview_secs: Some(PREVIEW_SECS),
        checkpoint_secs: flags.checkpoint_every,
        ..FitOptions::default()
    })
}

/// The comment of the frame with this prefix.
fn noted<'a>(frame: &'a Frame, name: &str) -> Option<&'a str> {
    frame.comments.iter().find_map(|comment| comment.strip_prefix(name)).map(str::trim)
}

fn fit_failure(error: &FitError, args: &EditArgs) -> Failure {
    let text = chain(error);
    match error {
        FitError::Raster(error) => device::failure(error),
        FitError::NothingSelected { .. } => Failure::bad_input(text).next(
            "Check that the pictures belong to this frame and cameras; a new object in empty space needs pictures that also change what it touches.",
        ),
        FitError::State { .. } => {
            Failure::bad_input(text).next("Omit --resume and add -w to start the fit again.")
        }
        FitError::Size { .. } | FitError::NoPictures | FitError::Camera(_) => {
            Failure::bad_input(text)
        }
        FitError::Splats(_) => Failure::bad_input(format!("{}: {text}", args.input.display())),
        FitError::Option { .. } => Failure::usage(text),
        _ => Failure::failed(text),
    }
}

/// Writes the fitted frame; the input itself, byte for byte, if no picture was edited.
fn write(
    args: &EditArgs,
    frame: &Frame,
    input: &Path,
    fitted: &Fitted,
    global: &Global,
) -> Outcome {
    let output = args.fitted_output()?;
    let mut file =
        AtomicFile::create(output, existing(global)).map_err(|error| output_failure(&error))?;
    let is_ply = matches!(frame.format, FrameFormat::Ply { .. });
    let written = if fitted.report.edited_views == 0 && is_ply {
        gs_io::read_file(input).and_then(|bytes| file.write_all(&bytes))
    } else {
        let normals = matches!(frame.format, FrameFormat::Ply { normals: true, .. });
        let options =
            ply::WriteOptions { normals, comments: frame.comments.clone(), sh_degree: None };
        ply::write(&fitted.splats, &options, &mut file)
    };
    written.map_err(|error| Failure::write(output, &error))?;
    file.commit().map_err(|error| output_failure(&error))
}

fn note_fit(output: &Path, fitted: &Fitted, console: &Console, secs: f64) {
    let report = &fitted.report;
    if report.edited_views == 0 {
        console.note(format!(
            "no picture differs from the frame: {} is an unchanged copy of it",
            output.display()
        ));
        return;
    }
    if report.geometry_frozen {
        console.note(
            "fewer than three pictures are edited: colours and opacities are fitted, positions are kept",
        );
    }
    console.note(format!(
        "{} of {} pictures are edited; {} splats selected, of which {} removed; {} new ({secs:.0} s)",
        report.edited_views, report.views, report.selected, report.removed, report.added
    ));
}

/// Frame, picture and fit of some edited views, in rows.
fn preview(
    start: &Splats,
    fitted: &Fitted,
    pictures: &[EditedPicture],
    device: &Device,
    options: &FitOptions,
) -> Outcome<Image> {
    #[expect(clippy::cast_possible_truncation, reason = "a colour")]
    let background = options.background.map(|x| x as f32);
    let mut renderer = Renderer::new(device, background);
    let still = |splats: &Splats| StaticScene::new(splats.clone()).map_err(Failure::failed);
    let (before, after) = (still(start)?, still(&fitted.splats)?);
    let step = pictures.len().div_ceil(PREVIEW_VIEWS).max(1);
    let mut rows = Vec::new();
    for picture in pictures.iter().step_by(step) {
        renderer.seek(&before, 0.0)?;
        let original = renderer.render(&picture.camera)?.rgb_image();
        renderer.seek(&after, 0.0)?;
        let now = renderer.render(&picture.camera)?.rgb_image();
        rows.push(side_by_side(&side_by_side(&original, &picture.image), &now));
    }
    Ok(contact_sheet(&rows, PREVIEW_WIDTH))
}

fn write_image(path: &Path, image: &Image, existing: gs_io::Existing) -> Outcome {
    let mut file = AtomicFile::create(path, existing).map_err(|error| output_failure(&error))?;
    images::write_png(&mut file, path, image)?;
    file.commit().map_err(|error| output_failure(&error))
}
