//! [`SceneHandle`]: an open scene, run or frame; its cameras, and its images in memory.

use crate::args::{Cli, Command, Global, RenderArgs};
use crate::cameras::own_times;
use crate::commands::render::{RenderJob, Views, cropped, layers, views};
use crate::console::Console;
use crate::device::{Device, GpuChoice};
use crate::evidence::evidence;
use crate::failure::{Failure, Outcome};
use crate::frames::Timing;
use crate::in_process::cancellable;
use crate::observer::Observer;
use crate::passes::{PassImage, flow_image};
use crate::rendered::RenderedImage;
use crate::scene::LoadedScene;
use crate::threads::start_threads;
use crate::{memory, still};
use gs_core::{Camera, DynamicScene};
use std::ffi::OsString;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// A scene, run or single frame as `c4d` opens it.
#[derive(Debug)]
pub struct SceneHandle {
    opened: LoadedScene,
    /// The device of the last render, because opening an adapter takes longer than rendering.
    device: Mutex<Option<(GpuChoice, Device)>>,
}

impl SceneHandle {
    /// Opens `path`; `arguments` are those of `c4d render` that affect reading: `--iteration`,
    /// `--set`, `--strict`, `--axes`.
    ///
    /// # Errors
    /// As `c4d render`.
    pub fn open(
        path: &Path,
        arguments: &[OsString],
        observer: &Arc<dyn Observer>,
    ) -> Outcome<Self> {
        start_threads(None)?;
        let (args, global) = render_args(path, arguments)?;
        let console = Console::observed(Arc::clone(observer));
        let opened = cancellable(|| {
            let opened = still::open(path, args.axes, &global, &console)?;
            memory::require_frames(opened.scene.as_ref(), memory::FRAMES_SEEN)?;
            Ok(opened)
        })?;
        if global.strict && console.warnings() > 0 {
            return Err(console.strict_failure());
        }
        Ok(Self { opened, device: Mutex::default() })
    }

    /// The splats at any time.
    pub fn scene(&self) -> &Arc<dyn DynamicScene> {
        &self.opened.scene
    }

    /// The scene before the edit, of a run.
    pub fn original(&self) -> Option<&Arc<dyn DynamicScene>> {
        self.opened.original.as_ref()
    }

    /// Kind of the path, as in `c4d info`.
    pub fn kind(&self) -> String {
        self.opened.kind.to_string()
    }

    /// Time of the edited frame of a run, else the first time.
    pub fn edit_time(&self) -> f32 {
        self.opened.edit_time
    }

    /// The world's upward direction according to the files, unit vector.
    pub fn up(&self) -> [f64; 3] {
        self.opened.up
    }

    /// Frames per second of the clip, if its files store them.
    pub fn fps(&self) -> Option<f64> {
        self.opened.fps
    }

    /// Background of the model's training, else black; 0 to 1.
    pub fn background(&self) -> [f32; 3] {
        self.opened.background
    }

    /// The cameras that `c4d render` would use with these arguments (`--cameras`, `--views`,
    /// `--split`, `--size`, …). Cameras of one time each have [`Camera::time`].
    ///
    /// # Errors
    /// As `c4d render`.
    pub fn cameras(
        &self,
        arguments: &[OsString],
        observer: &Arc<dyn Observer>,
    ) -> Outcome<Vec<Camera>> {
        let (args, _) = render_args(&self.opened.path, arguments)?;
        let console = Console::observed(Arc::clone(observer));
        let mut times = self.times(&args)?;
        Ok(match views(&args, &self.opened, &mut times, &console)? {
            Views::Fixed(cameras) => cameras,
            Views::Path(cameras) => cameras
                .into_iter()
                .zip(times)
                .map(|(camera, time)| Camera { time: Some(time), ..camera })
                .collect(),
        })
    }

    /// The images that `c4d render --format npy` would write with these arguments, frames in
    /// order. `cameras` take the place of `--cameras`: each at its own time if all have one and no
    /// others are requested, else each at every time.
    ///
    /// # Errors
    /// As `c4d render`.
    pub fn render(
        &self,
        arguments: &[OsString],
        cameras: Option<Vec<Camera>>,
        observer: &Arc<dyn Observer>,
    ) -> Outcome<Vec<RenderedImage>> {
        let (args, global) = render_args(&self.opened.path, arguments)?;
        let console = Console::observed(Arc::clone(observer));
        cancellable(|| self.images(&args, &global, cameras, &console))
    }

    fn images(
        &self,
        args: &RenderArgs,
        global: &Global,
        cameras: Option<Vec<Camera>>,
        console: &Console,
    ) -> Outcome<Vec<RenderedImage>> {
        let mut times = self.times(args)?;
        let views = match cameras {
            Some(cameras) => given(args, cameras, &mut times)?,
            None => views(args, &self.opened, &mut times, console)?,
        };
        for camera in views.cameras() {
            camera.check().map_err(Failure::input)?;
        }
        let device = self.device(global.gpu)?;
        let evidence = if args.passes.iter().any(|pass| pass.needs_evidence()) {
            evidence(&self.opened, &device)?
        } else {
            Vec::new()
        };
        let job = RenderJob {
            scene: self.opened.scene.as_ref(),
            edit_time: self.opened.edit_time,
            mask: self.opened.mask,
            evidence: &evidence,
            layers: &layers(&args.passes, &self.opened, console)?,
            original: None,
            times: &times,
            views: &views,
            share: args.part,
            background: args.background.unwrap_or(self.opened.background),
            device: &device,
            console,
        };
        let then = job.splats_of_edit(&args.passes)?;
        let mut images = Vec::new();
        job.render(|exposure| {
            for &pass in &args.passes {
                let image = match job.image_of(pass, exposure, &then)? {
                    PassImage::Flow(flow) => flow_image(&flow),
                    PassImage::Grey(image) => image,
                    PassImage::Overlay(colors, numbers) => numbers.unwrap_or(colors),
                };
                images.push(RenderedImage {
                    frame: exposure.frame,
                    time: times[exposure.frame],
                    camera: exposure.camera.clone(),
                    pass: pass.name(),
                    image,
                });
            }
            Ok(())
        })?;
        Ok(images)
    }

    fn times(&self, args: &RenderArgs) -> Outcome<Vec<f32>> {
        let frames = args.frames.or_else(|| still::frames(args, &self.opened));
        let timing = Timing { times: &args.times, frames, ..Timing::default() };
        timing.times(self.opened.scene.as_ref())
    }

    fn device(&self, choice: GpuChoice) -> Outcome<Device> {
        let mut kept = self.device.lock().unwrap_or_else(PoisonError::into_inner);
        match kept.as_ref().filter(|(of, _)| *of == choice) {
            Some((_, device)) => Ok(device.clone()),
            None => Ok(kept.insert((choice, Device::open(choice)?)).1.clone()),
        }
    }
}

/// The given cameras as views, at the requested size.
fn given(args: &RenderArgs, cameras: Vec<Camera>, times: &mut Vec<f32>) -> Outcome<Views> {
    if cameras.is_empty() {
        return Err(Failure::usage("no cameras: expected at least one"));
    }
    let sized = cameras.into_iter().map(|camera| match args.size {
        Some((width, height)) => camera.resized(width, height),
        None => camera,
    });
    let cameras: Vec<Camera> = sized.collect();
    let requested = !args.times.is_empty() || args.frames.is_some();
    let views = match own_times(&cameras).filter(|_| !requested) {
        Some(own) => {
            *times = own;
            Views::Path(cameras)
        }
        None => Views::Fixed(cameras),
    };
    match args.crop {
        Some(crop) => cropped(views, crop),
        None => Ok(views),
    }
}

/// Arguments of `c4d render PATH ARGUMENTS`, without its output.
fn render_args(path: &Path, arguments: &[OsString]) -> Outcome<(RenderArgs, Global)> {
    let mut words: Vec<OsString> = vec!["render".into(), path.into()];
    words.extend_from_slice(arguments);
    words.push("--output=none".into());
    let cli = Cli::of(&words)?;
    let global = cli.global();
    match cli.command {
        Command::Render(args) => Ok((args, global)),
        _ => Err(Failure::usage("expected the arguments of c4d render")),
    }
}
