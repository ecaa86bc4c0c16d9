//! `c4d render`: images and videos of a scene or run.

mod losses;
mod render_job;
mod stills;
mod views;

pub(crate) use render_job::{RenderJob, layers};
pub(crate) use views::{Views, cropped, views};

use super::export::note_losses;
use crate::args::{Format, Global, LeftHalf, Pass, RenderArgs};
use crate::console::Console;
use crate::device::Device;
use crate::evidence::evidence;
use crate::failure::{Failure, Outcome};
use crate::frames::{self, Timing};
use crate::output::{existing, refuse_overlap};
use crate::part::PartRecord;
use crate::run_folder::fingerprint;
use crate::scene::{self, LoadedScene};
use crate::{clip_file, memory, still};
use amg::EditedScene;
use gs_core::{Camera, DynamicScene};
use gs_io::Existing;
use gs_player::{Legend, Overlay};
use losses::losses;
use serde_json::{Map, Value, json};
use std::path::Path;
use stills::stills;

pub(crate) fn run(args: &RenderArgs, global: &Global, console: &Console) -> Outcome {
    let opened = still::open(&args.scene, args.axes, global, console)?;
    memory::require_frames(opened.scene.as_ref(), memory::FRAMES_SEEN)?;
    let timing = Timing {
        times: &args.times,
        frames: args.frames.or_else(|| still::frames(args, &opened)),
        fps: args.fps,
        duration: args.duration,
    };
    timing.check()?;
    let mut times = timing.times(opened.scene.as_ref())?;
    refuse_overlap(&args.output, &opened.roots)?;
    if args.side_by_side.is_some() && opened.original.is_none() {
        return Err(Failure::usage(
            "--side-by-side compares a run with its source; this scene is not a run",
        )
        .next("Specify the run folder that c4d propagate wrote."));
    }
    let format = args.format.map_or_else(|| format_of(&args.output), Ok)?;
    clip_file::check_format(format)?;
    let playing = clip_file::plays(format);
    if args.part.is_some() && (playing || format == Format::Sheet) {
        return Err(Failure::usage("--part writes a folder of images, not one file")
            .next("Use -o FOLDER without --format; c4d gather joins the folders of all parts into a video or sheet."));
    }
    if !playing && args.part.is_none() && (args.fps.is_some() || args.duration.is_some()) {
        return Err(Failure::usage("--fps and --duration are for videos: mp4, webp and gif"));
    }
    let views = views(args, &opened, &mut times, console)?;
    let fps = timing.fps(&opened, &times)?;
    if playing && times.len() == 1 {
        console.note(
            "a video of one frame: --frames N renders more times, --cameras orbit more views",
        );
    }
    for camera in views.cameras() {
        camera.check().map_err(Failure::input)?;
    }
    let is_plain = |pass: &Pass| !pass.is_relative() && pass.overlay().is_none();
    if args.side_by_side.is_some() && !args.passes.iter().all(is_plain) {
        return Err(Failure::usage("--side-by-side shows rgb, alpha or depth"));
    }
    let device = Device::open(global.gpu)?;
    let evidence = if args.passes.iter().any(|pass| pass.needs_evidence()) {
        evidence(&opened, &device)?
    } else {
        Vec::new()
    };
    let layers = layers(&args.passes, &opened, console)?;
    for (_, layer) in &layers {
        note_legend(&layer.overlay, console);
    }
    let unrefined = match args.side_by_side {
        Some(LeftHalf::Unrefined) => Some(unrefined(&args.scene, global, console)?),
        _ => None,
    };
    let job = RenderJob {
        scene: opened.scene.as_ref(),
        edit_time: opened.edit_time,
        mask: opened.mask,
        evidence: &evidence,
        layers: &layers,
        original: match args.side_by_side {
            Some(LeftHalf::Original) => opened.original.as_deref(),
            Some(LeftHalf::Unrefined) => unrefined.as_ref().map(|scene| scene as &dyn DynamicScene),
            None => None,
        },
        times: &times,
        views: &views,
        share: args.part,
        background: args.background.unwrap_or(opened.background),
        device: &device,
        console,
    };
    console.detail(format!("rendering on {}", job.device.describe()));
    match format {
        Format::Mp4 | Format::Webp | Format::Gif => clip(args, fps, global, &job, format),
        Format::Sheet => sheet(args, global, &job),
        Format::Png | Format::Exr | Format::Npy | Format::Flo => {
            let part = match args.part {
                Some(share) => {
                    let work = work(args, fps, format, &opened, &job)?;
                    Some(PartRecord::new(share, work))
                }
                None => None,
            };
            stills(args, global, &job, format, part)
        }
    }
}

/// Everything on which the images depend, and the frame rate of videos.
fn work(
    args: &RenderArgs,
    fps: f64,
    format: Format,
    opened: &LoadedScene,
    job: &RenderJob<'_>,
) -> Outcome<Map<String, Value>> {
    let camera = |camera: &Camera| {
        let k = &camera.intrinsics;
        json!([camera.name, camera.width, camera.height, camera.viewmat, k.fx, k.fy, k.cx, k.cy])
    };
    let moves = matches!(job.views, Views::Path(_));
    let views = job.views.cameras();
    let passes: Vec<&str> = args.passes.iter().map(|pass| pass.name()).collect();
    let facts = [
        ("command", json!("render")),
        ("scene", json!(fingerprint(&opened.files)?)),
        ("axes", json!(args.axes.map(|axes| format!("{axes:?}")))),
        ("times", json!(job.times)),
        ("moving camera", json!(moves)),
        ("cameras", views.iter().map(camera).collect()),
        ("passes", json!(passes)),
        ("format", json!(format)),
        ("side by side", json!(args.side_by_side.map(|left| format!("{left:?}")))),
        ("background", json!(job.background)),
        ("frame rate", json!(fps)),
        ("device", json!(job.device.describe())),
    ];
    Ok(facts.map(|(name, value)| (name.to_owned(), value)).into_iter().collect())
}

/// Prints the meaning of an overlay's colours.
fn note_legend(overlay: &Overlay, console: &Console) {
    let color = |entry: u8| {
        let [r, g, b] = overlay.palette[usize::from(entry)];
        format!("#{r:02x}{g:02x}{b:02x}")
    };
    let Legend { classes, scale } = &overlay.legend;
    let classes = classes.iter().map(|(entry, label)| format!("{} {label}", color(*entry)));
    let scale = scale
        .iter()
        .map(|(from, low, to, high)| format!("{} {low} to {} {high}", color(*from), color(*to)));
    let lines: Vec<String> = scale.chain(classes).collect();
    console.note(format!("{} ({}): {}", overlay.name, overlay.title, lines.join(", ")));
}

/// The run without its refinement.
fn unrefined(path: &Path, global: &Global, console: &Console) -> Outcome<EditedScene> {
    let run = scene::open_run(path, global, console)?;
    if run.stored.refined.is_none() {
        return Err(Failure::usage(format!(
            "--side-by-side=unrefined: {} is not refined",
            path.display()
        ))
        .next(format!("Refine it first: c4d refine {}", path.display())));
    }
    run.scene(path, false)
}

/// The format implied by the output's name: `.mp4` for a video, `.png` for a contact sheet, no
/// extension for a folder of PNGs.
pub(super) fn format_of(output: &Path) -> Outcome<Format> {
    let extension = output.extension().and_then(|extension| extension.to_str());
    match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("mp4") => Ok(Format::Mp4),
        Some("webp") => Ok(Format::Webp),
        Some("gif") => Ok(Format::Gif),
        Some("png") => Ok(Format::Sheet),
        Some(name @ ("exr" | "npy" | "flo")) => Err(Failure::usage(format!(
            "{}: a {name} file contains one image, but there are several to write",
            output.display()
        ))
        .next(format!("Use a folder: --format {name} -o FOLDER."))),
        Some(name) if name.len() < 5 && !name.bytes().any(|byte| byte.is_ascii_digit()) => {
            Err(Failure::usage(format!("unsupported format `{name}`; expected png, exr, npy, flo, mp4, webp, gif or sheet"))
                .next("Videos are .mp4, .webp or .gif. Images go into a folder (use --format png for a folder with a dot in its name)."))
        }
        _ => Ok(Format::Png),
    }
}

fn single_view(job: &RenderJob<'_>, what: &str) -> Outcome {
    if let Views::Fixed(cameras) = job.views
        && cameras.len() > 1
    {
        return Err(Failure::usage(format!(
            "{what} shows one view, the cameras are {}",
            cameras.len()
        ))
        .next("Choose one with --views NAME."));
    }
    let size = |camera: &Camera| (camera.width, camera.height);
    let mut cameras = job.views.cameras().iter().map(size);
    if let Some(first) = cameras.next()
        && let Some(other) = cameras.find(|other| *other != first)
    {
        return Err(Failure::usage(format!(
            "{what} has one size, the cameras have {}×{} and {}×{}",
            first.0, first.1, other.0, other.1
        ))
        .next("Add --size WxH."));
    }
    Ok(())
}

fn rgb_only(args: &RenderArgs, what: &str) -> Outcome {
    if args.passes == [Pass::Rgb] {
        return Ok(());
    }
    Err(Failure::usage(format!("{what} shows colour only"))
        .next("For other passes use --format png, exr or npy."))
}

/// Renders the job to a video or an animated image.
fn clip(
    args: &RenderArgs,
    fps: f64,
    global: &Global,
    job: &RenderJob<'_>,
    format: Format,
) -> Outcome {
    single_view(job, "a video")?;
    rgb_only(args, "a video")?;
    let to = (args.output.as_path(), existing(global));
    clip_file::write(to, format, fps, |push| {
        job.render(|exposure| push(&exposure.image(Pass::Rgb)))
    })?;
    job.console.note(frames::playing(job.times.len(), fps));
    note_losses(&losses(format, args, job.times.len(), fps), job.console);
    job.console.output(&args.output, &[]);
    Ok(())
}

fn sheet(args: &RenderArgs, global: &Global, job: &RenderJob<'_>) -> Outcome {
    single_view(job, "a contact sheet")?;
    rgb_only(args, "a contact sheet")?;
    write_sheet((&args.output, existing(global)), job)?;
    note_losses(&losses(Format::Sheet, args, job.times.len(), 0.0), job.console);
    job.console.output(&args.output, &[]);
    Ok(())
}

/// Renders evenly spaced frames of the job onto one PNG.
pub(crate) fn write_sheet(to: (&Path, Existing), job: &RenderJob<'_>) -> Outcome {
    let picks = clip_file::sheet_frames(job.times.len());
    let times: Vec<f32> = picks.iter().map(|&i| job.times[i]).collect();
    let views = match job.views {
        Views::Fixed(cameras) => Views::Fixed(cameras.clone()),
        Views::Path(cameras) => Views::Path(picks.iter().map(|&i| cameras[i].clone()).collect()),
    };
    clip_file::write_sheet(to, |push| {
        RenderJob { times: &times, views: &views, ..*job }
            .render(|exposure| push(&exposure.image(Pass::Rgb)))
    })
}
