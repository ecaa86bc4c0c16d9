//! `c4d refine`: repair the colours that motion reveals (CUAR), in a run that `c4d propagate`
//! wrote.

mod errors;
mod messages;
mod part;
mod progress;
mod task;

pub(crate) use errors::check;
pub(crate) use task::RIG_SIZE;

use errors::failed;

use crate::args::{Global, PresetArg, RefineArgs, RefineFlags};
use crate::console::Console;
#[cfg(feature = "gpu")]
use crate::device;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::output::output_failure;
use crate::report::{RunReport, run_report};
use crate::run_folder::{
    self, CONFIG, Checkpoint, REFINE_IMAGES, REFINE_REPORT, REFINE_STATE, REPORT_PAGE,
    RefineConfig, RefinedRows, SCENE,
};
use crate::scene::Run;
use crate::settings::{
    AdamSettings, EvidenceSettings, OcclusionSettings, RegressionSettings, Settings,
};
use clap::ValueEnum;
use cuar::{Backend, FADED_LOGIT, Solver, refine_edit};
use gs_io::FolderUpdate;
use gs_raster_cpu::CpuRasterizer;
#[cfg(feature = "gpu")]
use gs_train_wgpu::DeviceDescent;
use progress::ProgressObserver;
use std::path::Path;
use task::{FRAMES, Task, USUAL_MEMORY};

pub(crate) fn run(args: &RefineArgs, global: &Global, console: &Console) -> Outcome {
    if global.overwrite && args.part.is_none() {
        return Err(Failure::usage("-w replaces the output of --part; a run is refined in place"));
    }
    run_folder::check_is_folder(&args.run)?;
    let unfinished = Checkpoint::read(&args.run);
    let begun = match unfinished {
        Ok(None) if args.resume => {
            console.note(format!(
                "{} has no checkpoint: the refinement starts again",
                args.run.display()
            ));
            None
        }
        Ok(Some(checkpoint)) if args.resume => Some(resumed(args, checkpoint, console)?),
        Ok(Some(_)) if args.part.is_none() => {
            console.note(
                "the checkpoint of an unfinished refinement is discarded; --resume would continue it",
            );
            None
        }
        Err(failure) if args.resume => return Err(failure),
        Ok(_) | Err(_) => None,
    };
    let begun = if let Some(begun) = begun {
        begun
    } else {
        let settings = Settings::read(args.config.as_deref())?.refine();
        let flags = settings.flags(&args.flags)?;
        let preset = match args.preset {
            Some(preset) => preset,
            None => settings.preset()?.unwrap_or(PresetArg::Default),
        };
        Checkpoint::new(preset, settings, &flags)
    };
    if let (Some(share), Some(output)) = (args.part, &args.output) {
        return part::write((&args.run, output), share, &begun, global, console);
    }
    refine(&args.run, begun, global, console)?;
    console.report(|| crate::run_folder::reports(&args.run));
    console.output(&args.run, &[]);
    Ok(())
}

/// The checkpoint to resume, with the flags of `args` that affect only previews and checkpoints.
/// Flags that would change the result are refused.
fn resumed(args: &RefineArgs, checkpoint: Checkpoint, console: &Console) -> Outcome<Checkpoint> {
    let Checkpoint { preset, settings, mut flags, state, is_resumed } = checkpoint;
    let (given, usual) = (args.flags.absolute()?, RefineFlags::default());
    flags.memory = given.memory.or(flags.memory);
    if given.preview_every.is_some() {
        flags.preview_every = given.preview_every;
    }
    if given.checkpoint_every != usual.checkpoint_every {
        flags.checkpoint_every = given.checkpoint_every;
    }
    let json = |flags: &RefineFlags| serde_json::to_value(flags).map_err(Failure::failed);
    let (given, usual, kept) = (json(&given)?, json(&usual)?, json(&flags)?);
    let mut other: Vec<String> = kept
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(name, kept)| given[*name] != usual[*name] && given[*name] != **kept)
        .map(|(name, _)| format!("--{}", name.replace('_', "-")))
        .collect();
    if args.preset.is_some_and(|given| given != preset) {
        other.push("--preset".to_owned());
    }
    if let Some(file) = args.config.as_deref()
        && Settings::read(Some(file))?.refine() != settings
    {
        other.push("--config".to_owned());
    }
    if !other.is_empty() {
        return Err(Failure::usage(format!(
            "{}: the unfinished refinement has a different {}",
            args.run.display(),
            other.join(", ")
        ))
        .next("Omit these flags: --resume takes them from the checkpoint. Without --resume the refinement starts again."));
    }
    let step = state.as_ref().map_or(0, |state| state.step);
    console.note(format!("continuing from step {step} with the flags of the checkpoint"));
    Ok(Checkpoint { preset, settings, flags, state, is_resumed })
}

/// Refines the run in place, starting from `begun`. Its motion and its original edited frame are
/// kept.
pub(crate) fn refine(run: &Path, begun: Checkpoint, global: &Global, console: &Console) -> Outcome {
    let Checkpoint { preset, settings, flags, state, is_resumed } = begun;
    let flags = &flags.absolute()?;
    check(flags, preset, &settings, global)?;
    run_folder::check_is_folder(run)?;
    // Detect an unwritable folder before the work, not after it.
    let update = FolderUpdate::begin(run).map_err(|error| output_failure(&error))?;
    let Some(task) = Task::open(run, preset, &settings, flags, global, console)? else {
        return Ok(());
    };
    if !is_resumed {
        update.remove(REFINE_IMAGES).map_err(|error| output_failure(&error))?;
        Checkpoint::write(&update, preset, &settings, flags, None)?;
    }
    let mut observer = ProgressObserver {
        update: &update,
        preset,
        settings: &settings,
        flags,
        console,
        made_from: task.made_from()?,
        images: None,
        progress: None,
        failure: None,
    };
    let Task { scene, edited, options, .. } = &task;
    let (resumed, before, views) = (state.as_ref(), task.before(), task.views());
    let result = match &task.device {
        Device::Cpu => {
            let backend = Backend { raster: &CpuRasterizer::default(), descent: None };
            refine_edit(backend, scene, &before, edited, &views, options, resumed, &mut observer)
        }
        #[cfg(feature = "gpu")]
        Device::Gpu(raster) => {
            let mut engine =
                DeviceDescent::new(raster.clone()).map_err(|error| device::failure(&error))?;
            let backend = Backend { raster, descent: Some(&mut engine) };
            refine_edit(backend, scene, &before, edited, &views, options, resumed, &mut observer)
        }
    };
    let failure = observer.finish();
    let refined = result.map_err(|error| failed(run, failure, error))?;
    let Task { run: mut loaded, cameras, camera_source, times, options, device, .. } = task;
    let coeffs = refined.d_sh.len() / refined.rows.len().max(1);
    let changed = refined
        .d_sh
        .chunks(coeffs.max(1))
        .filter(|d_sh| d_sh.iter().any(|d| *d != [0.0; 3]))
        .count();
    console.note(messages::summary(&refined.report, &options, changed));
    if refined.report.samples.is_empty() {
        let lacks_views =
            if changed + refined.faded.len() > 0 { "" } else { messages::OTHER_VIEWS };
        console.note(format!(
            "no edited splat changes colour with the viewing direction along its path (views: {}, times: {}, threshold: {:.0} of 255): no images are needed{lacks_views}",
            cameras.len(),
            times.len(),
            -255.0 * (1.0 - options.min_uncertainty).ln()
        ));
    } else {
        messages::refinement(&refined.report, &cameras, console);
    }
    if refined.report.samples.is_empty() && changed + refined.faded.len() == 0 {
        for name in [REFINE_STATE, REFINE_IMAGES] {
            update.remove(name).map_err(|error| output_failure(&error))?;
        }
        return Ok(());
    }

    loaded.config.refine = Some(RefineConfig {
        preset: format!("{preset:?}").to_lowercase(),
        warp: format!("{:?}", options.warp).to_lowercase(),
        cameras: camera_source,
        size: flags.refine_size.map(|(width, height)| [width, height]),
        up: flags.refine_up.and_then(|up| Some(up.to_possible_value()?.get_name().to_owned())),
        frames: flags.refine_frames.unwrap_or(FRAMES),
        samples: options.samples,
        memory: flags.memory.unwrap_or(USUAL_MEMORY),
        epsilon: options.epsilon,
        min_uncertainty: options.min_uncertainty,
        eta: Some(options.weights.eta),
        zeta: Some(options.weights.zeta),
        keep_first_frame: Some(options.keep_first_frame),
        seed: options.seed,
        device: device.describe(),
        adam: match &options.solver {
            Solver::Adam(params) => Some(AdamSettings::of(params)),
            Solver::Regression(_) => None,
        },
        regression: match &options.solver {
            Solver::Regression(params) => Some(RegressionSettings::of(params)),
            Solver::Adam(_) => None,
        },
        occlusion: Some(OcclusionSettings::of(&options.warp_params)),
        evidence: Some(EvidenceSettings::of(options.evidence.as_ref())),
    });
    let report = messages::json(&refined.report, changed, &cameras);
    let logits = &loaded.stored.edited.opacity_logits;
    let logit = |row: &u32| match refined.faded.binary_search(row) {
        Ok(_) => FADED_LOGIT,
        Err(_) => logits[*row as usize],
    };
    let opacity_logits = refined.rows.iter().map(logit).collect();
    loaded.stored.refined =
        Some(RefinedRows { rows: refined.rows, sh: refined.sh, opacity_logits });
    let write = |name: &str, bytes: &[u8], has_read: bool| {
        update.write(name, bytes, has_read).map_err(|error| output_failure(&error))
    };
    let report = serde_json::to_string_pretty(&report).map_err(Failure::failed)?;
    // The report is written first: if a user's file is in its place, nothing has been changed.
    write(REFINE_REPORT, report.as_bytes(), false)?;
    write(SCENE, &loaded.stored.serialize()?, true)?;
    write(CONFIG, toml::to_string(&loaded.config).map_err(Failure::failed)?.as_bytes(), true)?;
    page(run, &loaded, &refined.report, changed, &update, console)?;
    // The refinement is complete, so its checkpoint is not needed any more.
    for name in [REFINE_STATE, REFINE_IMAGES] {
        update.remove(name).map_err(|error| output_failure(&error))?;
    }
    Ok(())
}

/// Updates the run's page with the refined colours. A page that the user changed is kept.
fn page(
    run: &Path,
    loaded: &Run,
    report: &cuar::RefineReport,
    changed: usize,
    update: &FolderUpdate,
    console: &Console,
) -> Outcome {
    let scene = loaded.scene(run, true)?;
    let facts = [
        ("source", loaded.config.source.display().to_string()),
        ("edited", loaded.config.edited.display().to_string()),
        ("time of the edit", loaded.config.edit_time.to_string()),
        ("method", format!("preset {}, motion {}", loaded.config.preset, loaded.config.motion)),
        ("refined", format!("{changed} of {} edited splats have new colours", report.num_edited)),
        ("faded", report.repair.faded.to_string()),
        ("images of the refinement", report.samples.len().to_string()),
    ];
    let page = RunReport {
        name: run.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        scene: &scene,
        source: loaded.source.scene.as_ref(),
        up: loaded.source.up,
        background: loaded.source.background,
        facts: facts.map(|(name, value)| (name.to_owned(), value)).into(),
        warnings: report.warnings.clone(),
    };
    let html = run_report(&page);
    let written = html.and_then(|html| {
        let written = update.write(REPORT_PAGE, html.as_bytes(), false);
        written.map_err(|error| output_failure(&error))
    });
    if let Err(failure) = written {
        console.warn(format!("{REPORT_PAGE} was not updated: {}", failure.what));
    }
    Ok(())
}
