//! The files of a run folder, as `c4d propagate` writes them.

use super::messages;
use crate::args::{FollowArg, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::report::{RunReport, run_report};
use crate::run_folder::{self, CONFIG, REPORT, REPORT_PAGE, RunConfig, SCENE, Stored};
use crate::scene::LoadedScene;
use crate::settings::{AnchorSettings, KnnSettings, PropagateJob, TransportSettings};
use amg::{MotionGuide, MotionOptions, Propagation};
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Paths to record in the run, if they differ from those read.
pub(crate) struct Recorded {
    pub(crate) scene: PathBuf,
    pub(crate) edited: PathBuf,
}

/// A finished propagation.
pub(super) struct Finished<'a> {
    pub(super) args: &'a PropagateJob,
    pub(super) recorded: &'a Recorded,
    pub(super) global: &'a Global,
    pub(super) source: &'a LoadedScene,
    pub(super) options: &'a MotionOptions,
    pub(super) follow: FollowArg,
    pub(super) propagation: &'a Propagation,
    /// Duration of the motion stage, seconds.
    pub(super) seconds: f64,
}

impl Finished<'_> {
    /// Writes the run into `folder`.
    pub(super) fn write(&self, folder: &Path, console: &Console) -> Outcome {
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            std::fs::write(&path, bytes).map_err(|error| Failure::write(&path, &error))
        };
        let Self { propagation, seconds, .. } = *self;
        let config = self.config()?;
        let binding = propagation.scene.binding().as_ref().clone();
        // Restores values that were changed only by the file format.
        let edited = propagation.scene.edited().as_ref().clone();
        let stored = Stored { edited, binding, refined: None };
        write(SCENE, &stored.serialize()?)?;
        write(CONFIG, toml::to_string(&config).map_err(Failure::failed)?.as_bytes())?;
        let json = messages::json(&propagation.report, seconds);
        write(REPORT, serde_json::to_string_pretty(&json).map_err(Failure::failed)?.as_bytes())?;
        let start = Instant::now();
        match run_report(&self.page(&config)) {
            Ok(html) => write(REPORT_PAGE, html.as_bytes())?,
            Err(failure) => {
                console.warn(format!("{REPORT_PAGE} was not written: {}", failure.what));
            }
        }
        console.detail(format!("  {REPORT_PAGE}: {:.3} s", start.elapsed().as_secs_f64()));
        Ok(())
    }

    fn page(&self, config: &RunConfig) -> RunReport<'_> {
        let name = self.args.output.file_name();
        RunReport {
            name: name.map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            scene: &self.propagation.scene,
            source: self.source.scene.as_ref(),
            up: self.source.up,
            background: self.source.background,
            facts: messages::facts(config, &self.propagation.report, self.seconds),
            warnings: self.propagation.report.warnings.clone(),
        }
    }

    fn config(&self) -> Outcome<RunConfig> {
        let Self { args, recorded, global, source, .. } = *self;
        let absolute = |path: &Path| std::path::absolute(path).map_err(Failure::failed);
        let mut config = RunConfig {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            source: absolute(&recorded.scene)?,
            source_from_run: run_folder::relative(
                &absolute(&args.output)?,
                &absolute(&args.scene)?,
            ),
            source_sha256: run_folder::fingerprint(&source.files)?,
            edited: absolute(&recorded.edited)?,
            edited_sha256: run_folder::fingerprint(&[gs_io::frame::file_of(&args.edited)])?,
            edit_time: args.time,
            align: args.align,
            keep_rest: args.keep_rest,
            allow_far: args.allow_far,
            axes: args.axes.and_then(|axes| Some(axes.to_possible_value()?.get_name().to_owned())),
            preset: format!("{:?}", args.preset).to_lowercase(),
            baseline: args.baseline.map_or("none".to_owned(), |b| format!("{b:?}").to_lowercase()),
            motion: args.motion.name().to_owned(),
            follow: self.follow.name().to_owned(),
            seed: args.seed,
            iteration: global.iteration,
            set: global.set.clone(),
            position: String::new(),
            rotation: String::new(),
            scale: String::new(),
            appearance: false,
            rotation_prior: 0.0,
            fading: false,
            anchors: None,
            transport: None,
            knn: None,
            regions: None,
            refine: None,
        };
        match &self.options.guide {
            MotionGuide::Paper(params) => {
                config.anchors = Some(AnchorSettings::of(params));
                config.transport = Some(TransportSettings::of(params));
            }
            MotionGuide::Knn(params) => config.knn = Some(KnnSettings::of(*params)),
            MotionGuide::Regions(params) => config.regions = Some(params.clone()),
            MotionGuide::Field(_) => {}
        }
        config.set_aggregation(*self.propagation.scene.aggregation());
        Ok(config)
    }
}
