//! [`Task`]: a run with all inputs of its refinement.

use crate::args::{Global, PresetArg, RefineFlags, Up, WarpArg};
use crate::camera_rig::CameraRig;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::memory;
use crate::run_folder::{self, MadeFrom};
use crate::scene::{self, Run};
use crate::settings::RefineSettings;
use amg::{EditedScene, RowKind};
use cuar::{BeforeEdit, RefineOptions, RefinePreset, Views, WarpForm};
use gs_core::Camera;
use gs_io::cameras::Split;
use std::path::Path;

/// Size of the rig's images, pixels.
pub(crate) const RIG_SIZE: (u32, u32) = (640, 480);
/// Number of times from which images are drawn.
pub(super) const FRAMES: usize = 30;
/// Maximum number of cameras of a data set; each is drawn at the edited time and at others.
const MAX_CAMERAS: usize = 64;
/// Default memory for images, MiB.
pub(super) const USUAL_MEMORY: usize = 2048;
/// Minimum memory for images, MiB: enough for a few small ones.
pub(super) const MIN_MEMORY: usize = 16;
/// One in this many cameras is held out: the refinement does not use it, and the report contains
/// its error.
const HELD_OUT_EVERY: usize = 5;

/// A run with all inputs of its refinement.
pub(super) struct Task {
    pub(super) run: Run,
    /// Whether each splat was edited.
    pub(super) edited: Vec<bool>,
    /// Source row of each splat, if it is a source splat.
    source_rows: Vec<Option<u32>>,
    /// The run without refined colours.
    pub(super) scene: EditedScene,
    pub(super) cameras: Vec<Camera>,
    pub(super) camera_source: String,
    held_out: Vec<usize>,
    pub(super) times: Vec<f32>,
    pub(super) options: RefineOptions,
    pub(super) device: Device,
}

impl Task {
    /// Opens a run; `None` if nothing was edited.
    pub(super) fn open(
        folder: &Path,
        preset: PresetArg,
        settings: &RefineSettings,
        flags: &RefineFlags,
        global: &Global,
        console: &Console,
    ) -> Outcome<Option<Self>> {
        let run = scene::open_run(folder, global, console)?;
        let binding = &run.stored.binding;
        let edited: Vec<bool> =
            binding.kinds().iter().map(|kind| *kind != RowKind::Unchanged).collect();
        if !edited.contains(&true) && binding.len() >= binding.num_sources() {
            console.note("nothing was edited: there is nothing to refine");
            return Ok(None);
        }
        let scene = run.scene(folder, false)?;
        let (cameras, camera_source) = cameras(flags, &run, console)?;
        let held_out: Vec<usize> = if cameras.len() >= HELD_OUT_EVERY {
            (HELD_OUT_EVERY / 2..cameras.len()).step_by(HELD_OUT_EVERY).collect()
        } else {
            Vec::new()
        };
        let times = crate::frames::times(&scene, &[], Some(flags.refine_frames.unwrap_or(FRAMES)))?;
        let options = options(flags, preset, settings, &run)?;
        let device = Device::open(global.gpu)?;
        console.detail(format!("refining on {}", device.describe()));
        let source_rows = run.stored.source_rows();
        Ok(Some(Self {
            run,
            edited,
            source_rows,
            scene,
            cameras,
            camera_source,
            held_out,
            times,
            options,
            device,
        }))
    }

    pub(super) fn views(&self) -> Views<'_> {
        Views { cameras: &self.cameras, times: &self.times, held_out: &self.held_out }
    }

    pub(super) fn before(&self) -> BeforeEdit<'_> {
        BeforeEdit { scene: self.run.source.scene.as_ref(), source_rows: &self.source_rows }
    }

    /// Inputs of the images, without the hash of the edit.
    pub(super) fn made_from(&self) -> Outcome<MadeFrom> {
        Ok(MadeFrom {
            fingerprint: 0,
            source_sha256: run_folder::fingerprint(&self.run.source.files)?,
            device: self.device.describe(),
        })
    }
}

/// Preset, configuration and flags combined. Options that depend on the run are not set yet.
pub(super) fn chosen(
    flags: &RefineFlags,
    preset: PresetArg,
    settings: &RefineSettings,
) -> Outcome<RefineOptions> {
    let mut options = RefineOptions::preset(match preset {
        PresetArg::Default => RefinePreset::Default,
        PresetArg::Paper => RefinePreset::Paper,
    });
    settings.apply(&mut options)?;
    options.preview_secs = flags.preview_every;
    options.checkpoint_secs = Some(flags.checkpoint_every);
    options.memory = image_memory(flags);
    if let Some(samples) = flags.samples {
        options.samples = samples;
    }
    if let Some(epsilon) = flags.epsilon {
        options.epsilon = epsilon;
    }
    match flags.warp {
        Some(WarpArg::Backward) => options.warp = WarpForm::Backward,
        Some(WarpArg::Paper) => options.warp = WarpForm::Paper,
        None => {}
    }
    Ok(options)
}

fn options(
    flags: &RefineFlags,
    preset: PresetArg,
    settings: &RefineSettings,
    loaded: &Run,
) -> Outcome<RefineOptions> {
    let mut options = chosen(flags, preset, settings)?;
    options.edit_time = Some(loaded.config.edit_time);
    options.seed = settings.seed().unwrap_or(loaded.config.seed);
    options.background = loaded.source.background.map(f64::from);
    Ok(options)
}

/// Memory for images, bytes: as requested, else the smaller of [`USUAL_MEMORY`] and half of the
/// available memory.
fn image_memory(flags: &RefineFlags) -> usize {
    let mib = flags.memory.unwrap_or_else(|| {
        let half = memory::free().map_or(USUAL_MEMORY as u64, |free| free / 2 / memory::MIB);
        usize::try_from(half).unwrap_or(usize::MAX).clamp(MIN_MEMORY, USUAL_MEMORY)
    });
    mib.saturating_mul(1 << 20)
}

/// The given cameras, else a rig.
fn cameras(flags: &RefineFlags, loaded: &Run, console: &Console) -> Outcome<(Vec<Camera>, String)> {
    let source = &loaded.source;
    if let Some(path) = &flags.refine_cameras {
        let set = crate::cameras::open(path, None, source, console)?;
        // Held-out views are not used. Every camera is used at every time, because the images are
        // renders of the scene itself.
        let train = gs_io::cameras::distinct_cameras(set.split(Split::Train));
        let cameras = if train.is_empty() { set.distinct_cameras() } else { train };
        let count = cameras.len();
        let mut cameras = crate::cameras::thinned(cameras, MAX_CAMERAS);
        if count > cameras.len() {
            console.note(format!("{} of {count} cameras are used, evenly spaced", cameras.len()));
        }
        if let Some((width, height)) = flags.refine_size {
            cameras = cameras.iter().map(|camera| camera.resized(width, height)).collect();
        }
        let absolute = std::path::absolute(path).map_err(Failure::failed)?;
        return Ok((cameras, absolute.display().to_string()));
    }
    let rig =
        CameraRig::of_scene(source.scene.as_ref(), flags.refine_up.map_or(source.up, Up::vector))
            .map_err(Failure::input)?;
    let size = flags.refine_size.unwrap_or(RIG_SIZE);
    let (cameras, what) = rig.refining(size);
    console.note(format!("no cameras given: using {} views {what}", cameras.len()));
    let name =
        |(i, camera): (usize, Camera)| Camera { name: format!("{}_{i:02}", camera.name), ..camera };
    Ok((cameras.into_iter().enumerate().map(name).collect(), "rig".to_owned()))
}
