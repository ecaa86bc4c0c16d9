//! `c4d render`: images and videos of a scene or run.

mod views;

pub(crate) use views::{Views, cropped, views};

use super::export::say;
use crate::animated_image::{AnimatedImage, GIF_MAX_FPS, GifWriter, WebpWriter};
use crate::args::{Format, Global, LeftHalf, Pass, RenderArgs};
use crate::camera_rig::CameraRig;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::frames::{self, Timing};
use crate::output::{existing, output_failure, refuse_overlap};
use crate::passes::{self, PassImage};
use crate::renderer::{self, Renderer};
use crate::scene::{self, Opened};
use crate::video::VideoWriter;
use crate::{images, memory, rates, still};
use amg::EditedScene;
use cuar::BeforeEdit;
use gs_core::{Camera, DynamicScene, Image, RenderOutput, Splats};
use gs_io::{AtomicDir, AtomicFile, Existing, Losses};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Memory per pixel of an image, bytes: colour, coverage, depth and state of the rasteriser, two
/// images side by side, and a copy for the encoder.
const BYTES_PER_PIXEL: u64 = 64;
/// Largest number of frames on a contact sheet.
const SHEET_FRAMES: usize = 12;
/// Widest contact sheet, pixels.
const SHEET_WIDTH: usize = 2400;

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
        .next("Give the run folder that c4d propagate wrote."));
    }
    let format = args.format.map_or_else(|| format_of(&args.output), Ok)?;
    let playing = matches!(format, Format::Mp4 | Format::Webp | Format::Gif);
    if !playing && (args.fps.is_some() || args.duration.is_some()) {
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
    if args.side_by_side.is_some() && args.passes.iter().any(|pass| pass.is_relative()) {
        return Err(Failure::usage("--side-by-side shows rgb, alpha or depth"));
    }
    let device = Device::open(global.gpu)?;
    let evidence = if args.passes.iter().any(|pass| pass.needs_evidence()) {
        evidence(&opened, &device)?
    } else {
        Vec::new()
    };
    let unrefined = match args.side_by_side {
        Some(LeftHalf::Unrefined) => Some(unrefined(&args.scene, global, console)?),
        _ => None,
    };
    let shot = Shot {
        scene: opened.scene.as_ref(),
        edit_time: opened.edit_time,
        mask: opened.mask,
        evidence: &evidence,
        original: match args.side_by_side {
            Some(LeftHalf::Original) => opened.original.as_deref(),
            Some(LeftHalf::Unrefined) => unrefined.as_ref().map(|scene| scene as &dyn DynamicScene),
            None => None,
        },
        times: &times,
        views: &views,
        background: args.background.unwrap_or(opened.background),
        device: &device,
        console,
    };
    console.detail(format!("rendering on {}", shot.device.describe()));
    match format {
        Format::Mp4 => video(args, fps, global, &shot),
        Format::Webp | Format::Gif => looping(args, fps, global, &shot, format),
        Format::Sheet => sheet(args, global, &shot),
        Format::Png | Format::Exr | Format::Npy | Format::Flo => {
            stills(args, global, &shot, format)
        }
    }
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

/// ξ′ of a run's splats in the edited frame, from the views of a
/// refinement without cameras; empty for other scenes.
pub(crate) fn evidence(opened: &Opened, device: &Device) -> Outcome<Vec<f32>> {
    let (Some(original), Some(source_rows), Some(params)) =
        (&opened.original, &opened.source_rows, &opened.mask.evidence)
    else {
        return Ok(Vec::new());
    };
    let rig = CameraRig::of_scene(original.as_ref(), opened.up).map_err(Failure::bad_input)?;
    let (cameras, _) = rig.refining(super::refine::RIG_SIZE);
    let before = BeforeEdit { scene: original.as_ref(), source_rows };
    let scene = opened.scene.as_ref();
    passes::evidence(device, scene, &before, opened.edit_time, &cameras, params)
}

/// Scene, views and times of a render.
pub(crate) struct Shot<'a> {
    pub(crate) scene: &'a dyn DynamicScene,
    pub(crate) edit_time: f32,
    pub(crate) mask: passes::Mask,
    /// ξ′ of every splat, or empty.
    pub(crate) evidence: &'a [f32],
    pub(crate) original: Option<&'a dyn DynamicScene>,
    pub(crate) times: &'a [f32],
    pub(crate) views: &'a Views,
    pub(crate) background: [f32; 3],
    pub(crate) device: &'a Device,
    pub(crate) console: &'a Console,
}

/// The format implied by the output's name: `.mp4` for a video, `.png` for a contact sheet, no
/// extension for a folder of PNGs.
fn format_of(output: &Path) -> Outcome<Format> {
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
        .next(format!("Give a folder: --format {name} -o FOLDER."))),
        Some(name) if name.len() < 5 && !name.bytes().any(|byte| byte.is_ascii_digit()) => {
            Err(Failure::usage(format!("unsupported format `{name}`; expected png, exr, npy, flo, mp4, webp, gif or sheet"))
                .next("Videos are .mp4, .webp or .gif. Images go into a folder (use --format png for a folder with a dot in its name)."))
        }
        _ => Ok(Format::Png),
    }
}

impl Shot<'_> {
    /// Calls `sink` for every image, frames in order. Warns about images
    /// in which no splat of the scene is visible.
    pub(crate) fn render(&self, mut sink: impl FnMut(&Exposure<'_>) -> Outcome) -> Outcome {
        let pixels = |camera: &Camera| u64::from(camera.width) * u64::from(camera.height);
        let largest = self.views.cameras().iter().map(pixels).max().unwrap_or(0);
        memory::require(
            &format!("an image of {largest} pixels"),
            largest * BYTES_PER_PIXEL,
            "Give a smaller --size.",
        )?;
        let (mut empty, mut count) = (0, 0);
        self.expose(|exposure| {
            count += 1;
            empty += usize::from(exposure.output.alpha.iter().all(|alpha| *alpha == 0.0));
            sink(exposure)
        })?;
        if empty > 0 {
            let what = if empty == count {
                "no image shows".to_owned()
            } else {
                format!("{empty} of {count} images show none")
            };
            self.console.warn(format!(
                "{what} any of the scene's splats: check that the cameras belong to \
                              it"
            ));
        }
        Ok(())
    }

    /// The image of `pass`; `then` are the splats of the edited frame, for passes relative to it.
    pub(crate) fn image_of(
        &self,
        pass: Pass,
        exposure: &Exposure<'_>,
        then: &Splats,
    ) -> Outcome<PassImage> {
        if !pass.is_relative() {
            return Ok(PassImage::Grey(exposure.image(pass)));
        }
        let Exposure { splats, camera, .. } = exposure;
        passes::render(pass, self.mask, self.device, splats, (then, self.evidence), camera)
    }

    /// The splats of the edited frame if one of the passes is relative to it, else none.
    pub(crate) fn splats_of_edit(&self, passes: &[Pass]) -> Outcome<Splats> {
        if passes.iter().any(|pass| pass.is_relative()) {
            return self.scene.at(self.edit_time).map_err(Failure::input);
        }
        Ok(Splats::default())
    }

    fn expose(&self, mut sink: impl FnMut(&Exposure<'_>) -> Outcome) -> Outcome {
        let mut edited = Renderer::new(self.device, self.background);
        let mut original =
            self.original.map(|scene| (scene, Renderer::new(self.device, self.background)));
        let per_frame = self.views.of_frame(0).len() as u64;
        let mut progress = self.console.progress("render", self.times.len() as u64 * per_frame);
        for (frame, &t) in self.times.iter().enumerate() {
            edited.seek(self.scene, t)?;
            if let Some((scene, renderer)) = &mut original {
                renderer.seek(*scene, t)?;
            }
            for camera in self.views.of_frame(frame) {
                let original = match &mut original {
                    Some((_, renderer)) => Some(renderer.render(camera)?),
                    None => None,
                };
                let (output, splats) = edited.render_with_splats(camera)?;
                sink(&Exposure { frame, camera, splats, output, original })?;
                progress.step();
            }
        }
        let elapsed = progress.finish();
        self.console.detail(format!(
            "{} frames in {:.1} s",
            self.times.len(),
            elapsed.as_secs_f64()
        ));
        Ok(())
    }
}

/// One rendered image with its view and time.
pub(crate) struct Exposure<'a> {
    pub(crate) frame: usize,
    pub(crate) camera: &'a Camera,
    splats: &'a Splats,
    output: &'a RenderOutput,
    original: Option<&'a RenderOutput>,
}

impl Exposure<'_> {
    /// The image of the pass, next to that of the original if there is one.
    fn image(&self, pass: Pass) -> Image {
        let image = pass_image(pass, self.output);
        match self.original {
            Some(original) => renderer::side_by_side(&pass_image(pass, original), &image),
            None => image,
        }
    }
}

fn pass_image(pass: Pass, output: &RenderOutput) -> Image {
    match pass {
        Pass::Alpha => output.alpha_image(),
        Pass::Depth => output.depth_image(),
        _ => output.rgb_image(),
    }
}

/// Folder of one view and pass; a single view has no subfolder.
fn stills_folder(root: &Path, views: &Views, camera: &Camera, pass: Pass) -> PathBuf {
    match views {
        Views::Fixed(cameras) if cameras.len() > 1 => {
            let index = cameras.iter().position(|other| std::ptr::eq(other, camera)).unwrap_or(0);
            let safe: String = camera
                .name
                .chars()
                .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' })
                .collect();
            root.join(format!("{index:03}_{safe}")).join(pass.name())
        }
        _ => root.join(pass.name()),
    }
}

fn stills(args: &RenderArgs, global: &Global, shot: &Shot<'_>, format: Format) -> Outcome {
    if format == Format::Flo && args.passes != [Pass::Flow] {
        return Err(Failure::usage("--format flo contains flow only").next("Add --passes flow."));
    }
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let mut depth_range = (f32::INFINITY, f32::NEG_INFINITY);
    if format == Format::Png && args.passes.contains(&Pass::Depth) {
        depth_range = depth_extent(shot)?;
        shot.console.note(format!(
            "depth is scaled: black is {}, white is {}",
            depth_range.0, depth_range.1
        ));
    }
    let then = shot.splats_of_edit(&args.passes)?;
    let mut count = 0;
    shot.render(|exposure| {
        for &pass in &args.passes {
            let folder = stills_folder(folder.path(), shot.views, exposure.camera, pass);
            std::fs::create_dir_all(&folder).map_err(|error| Failure::write(&folder, &error))?;
            let path = |extension: &str| folder.join(format!("{:05}.{extension}", exposure.frame));
            match (shot.image_of(pass, exposure, &then)?, format) {
                (PassImage::Flow(flow), Format::Exr) => {
                    let channels = ["forward.u", "forward.v", "A"];
                    images::write_exr(&path("exr"), &passes::flow_with_coverage(&flow), &channels)?;
                }
                (PassImage::Flow(flow), Format::Npy) => {
                    images::write_npy(&path("npy"), &passes::flow_image(&flow))?;
                }
                (PassImage::Flow(flow), Format::Flo) => {
                    let bytes =
                        cuar::encode_flo(&passes::flow_image(&flow)).map_err(Failure::failed)?;
                    let path = path("flo");
                    std::fs::write(&path, bytes).map_err(|error| Failure::write(&path, &error))?;
                }
                (PassImage::Flow(flow), _) => {
                    write_png(&path("png"), &cuar::flow_wheel(&passes::flow_image(&flow), None))?;
                }
                (PassImage::Grey(image), Format::Exr) => {
                    images::write_exr(&path("exr"), &image, channels(pass))?;
                }
                (PassImage::Grey(image), Format::Npy) => images::write_npy(&path("npy"), &image)?,
                (PassImage::Grey(mut image), _) => {
                    if pass == Pass::Depth {
                        stretch(&mut image, depth_range);
                    }
                    write_png(&path("png"), &image)?;
                }
            }
            count += 1;
        }
        Ok(())
    })?;
    folder.commit().map_err(|error| output_failure(&error))?;
    say(&losses(format, args, shot.times.len(), 0.0), shot.console);
    shot.console.result(format!("{} ({count} images)", args.output.display()));
    Ok(())
}

/// Names of the channels of an EXR.
fn channels(pass: Pass) -> &'static [&'static str] {
    match pass {
        Pass::Alpha => &["A"],
        Pass::Depth => &["Z"],
        Pass::Uncertainty | Pass::Evidence | Pass::Mask => &["Y"],
        Pass::Rgb | Pass::Flow => &["R", "G", "B"],
    }
}

/// Smallest and largest depth over the clip, for the same scaling of all frames.
fn depth_extent(shot: &Shot<'_>) -> Outcome<(f32, f32)> {
    let mut range = (f32::INFINITY, f32::NEG_INFINITY);
    shot.expose(|exposure| {
        for &z in &exposure.output.depth {
            range = (range.0.min(z), range.1.max(z));
        }
        Ok(())
    })?;
    Ok(range)
}

fn stretch(image: &mut Image, (near, far): (f32, f32)) {
    let span = (far - near).max(f32::MIN_POSITIVE);
    for value in &mut image.data {
        *value = (*value - near) / span;
    }
}

fn write_png(path: &Path, image: &Image) -> Outcome {
    let file = File::create(path).map_err(|error| Failure::write(path, &error))?;
    images::write_png(BufWriter::new(file), path, image)
}

fn single_view(shot: &Shot<'_>, what: &str) -> Outcome {
    if let Views::Fixed(cameras) = shot.views
        && cameras.len() > 1
    {
        return Err(Failure::usage(format!(
            "{what} shows one view, the cameras are {}",
            cameras.len()
        ))
        .next("Choose one with --views NAME."));
    }
    let size = |camera: &Camera| (camera.width, camera.height);
    let mut cameras = shot.views.cameras().iter().map(size);
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

fn video(args: &RenderArgs, fps: f64, global: &Global, shot: &Shot<'_>) -> Outcome {
    single_view(shot, "a video")?;
    rgb_only(args, "a video")?;
    write_video(&args.output, existing(global), fps, shot)?;
    shot.console.note(frames::playing(shot.times.len(), fps));
    say(&losses(Format::Mp4, args, shot.times.len(), fps), shot.console);
    shot.console.result(args.output.display());
    Ok(())
}

/// Renders the shot to an MP4.
pub(crate) fn write_video(path: &Path, existing: Existing, fps: f64, shot: &Shot<'_>) -> Outcome {
    let mut file =
        Some(AtomicFile::create(path, existing).map_err(|error| output_failure(&error))?);
    let mut writer: Option<VideoWriter<AtomicFile>> = None;
    shot.render(|exposure| {
        let image = exposure.image(Pass::Rgb);
        if let Some(file) = file.take() {
            writer = Some(VideoWriter::new(file, path, image.width, image.height, fps)?);
        }
        writer.as_mut().map_or(Ok(()), |writer| writer.push(&image.to_bytes(), image.width))
    })?;
    let file = match writer {
        Some(writer) => writer.finish()?,
        None => return Err(Failure::usage("a video needs at least one frame")),
    };
    file.commit().map_err(|error| output_failure(&error))
}

/// Renders the shot to a looping image.
fn looping(
    args: &RenderArgs,
    fps: f64,
    global: &Global,
    shot: &Shot<'_>,
    format: Format,
) -> Outcome {
    single_view(shot, "a loop")?;
    rgb_only(args, "a loop")?;
    let path = &args.output;
    let mut file =
        Some(AtomicFile::create(path, existing(global)).map_err(|error| output_failure(&error))?);
    let mut writer: Option<AnimatedImage<AtomicFile>> = None;
    shot.render(|exposure| {
        let image = exposure.image(Pass::Rgb);
        let (width, height) = (image.width, image.height);
        if let Some(file) = file.take() {
            writer = Some(match format {
                Format::Gif => AnimatedImage::Gif(GifWriter::new(file, path, width, height, fps)?),
                _ => {
                    AnimatedImage::Webp(Box::new(WebpWriter::new(file, path, width, height, fps)?))
                }
            });
        }
        writer.as_mut().map_or(Ok(()), |writer| writer.push(&image.to_bytes()))
    })?;
    let file = match writer {
        Some(writer) => writer.finish()?,
        None => return Err(Failure::usage("an animated image needs at least one frame")),
    };
    file.commit().map_err(|error| output_failure(&error))?;
    shot.console.note(frames::playing(shot.times.len(), fps));
    say(&losses(format, args, shot.times.len(), fps), shot.console);
    shot.console.result(path.display());
    Ok(())
}

/// Losses of a render's format.
fn losses(format: Format, args: &RenderArgs, frames: usize, fps: f64) -> Losses {
    let mut losses = Losses::none();
    match format {
        Format::Mp4 => {
            losses.push(
                "8 bits per channel, colour at half the resolution, slightly lossy \
                        (H.264, quantiser 16 to 20)",
            );
            losses.push("sides must be even: an odd last column or row is cut");
        }
        Format::Gif => {
            losses.push("255 colours per frame, dithered; changes of at most 3/255 are not drawn");
            if fps > GIF_MAX_FPS {
                losses.push(format!(
                    "{} frames per second become {GIF_MAX_FPS}, the highest rate that browsers \
                    play",
                    rates::rounded(fps)
                ));
            } else {
                losses.push("times are rounded to hundredths of a second");
            }
        }
        Format::Webp => {
            losses.push(
                "8 bits per channel, else exact; times are rounded to thousandths of a \
                        second",
            );
        }
        Format::Png => {
            losses.push("8 bits per channel; values are clipped to 0–1");
            if args.passes.contains(&Pass::Depth) {
                losses.push("depth is scaled to its range");
            }
            if args.passes.contains(&Pass::Flow) {
                losses.push("flow is encoded as colours");
            }
        }
        Format::Sheet if frames > 1 => {
            losses.push("8 bits per channel, reduced in size, at most twelve frames");
        }
        Format::Sheet => losses.push("8 bits per channel; values are clipped to 0–1"),
        Format::Exr | Format::Npy | Format::Flo => {}
    }
    losses
}

fn sheet(args: &RenderArgs, global: &Global, shot: &Shot<'_>) -> Outcome {
    single_view(shot, "a contact sheet")?;
    rgb_only(args, "a contact sheet")?;
    write_sheet(&args.output, existing(global), shot)?;
    say(&losses(Format::Sheet, args, shot.times.len(), 0.0), shot.console);
    shot.console.result(args.output.display());
    Ok(())
}

/// Renders up to [`SHEET_FRAMES`] evenly spaced frames of the shot onto one PNG.
pub(crate) fn write_sheet(path: &Path, existing: Existing, shot: &Shot<'_>) -> Outcome {
    let mut file = AtomicFile::create(path, existing).map_err(|error| output_failure(&error))?;
    let count = shot.times.len();
    let shown = count.min(SHEET_FRAMES);
    let picks: Vec<usize> = (0..shown).map(|i| i * (count - 1) / (shown - 1).max(1)).collect();
    let times: Vec<f32> = picks.iter().map(|&i| shot.times[i]).collect();
    let views = match shot.views {
        Views::Fixed(cameras) => Views::Fixed(cameras.clone()),
        Views::Path(cameras) => Views::Path(picks.iter().map(|&i| cameras[i].clone()).collect()),
    };
    let mut cells = Vec::with_capacity(shown);
    Shot { times: &times, views: &views, ..*shot }.render(|exposure| {
        cells.push(exposure.image(Pass::Rgb));
        Ok(())
    })?;
    let sheet = renderer::contact_sheet(&cells, SHEET_WIDTH);
    images::write_png(&mut file, path, &sheet)?;
    file.commit().map_err(|error| output_failure(&error))
}
