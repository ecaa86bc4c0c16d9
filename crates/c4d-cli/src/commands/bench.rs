//! `c4d bench motion`: every motion method against ground truth.

mod brief;
mod method;
mod score;
mod suite;
mod table;

pub(crate) use suite::suite;

use crate::args::{BenchMotionArgs, Global};
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome, chain};
use crate::output::{existing, output_failure};
use crate::renderer::Renderer;
use c4d_metrics::{MotionTrack, neighborhood_distance_deviation, psnr};
use gs_core::DynamicScene;
use gs_deform::HexPlaneScene;
use gs_io::AtomicDir;
use gs_synth::{
    CASE_SIZES, FitParams, FitResidual, ShortLivedCase, ShortLivedParams, SynthScene, Tag,
    TruthCase, TruthScene,
};
use method::{METHODS, Method};
use score::Score;
use serde::Serialize;
use serde_json::json;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

/// Number of scored times, besides frame 1.
const TIMES: usize = 8;
/// Number of rendered times.
const RENDERED: usize = 3;
/// Size of the renders compared, pixels.
const SIZE: (u32, u32) = (320, 240);

pub(crate) fn motion(args: &BenchMotionArgs, global: &Global, console: &Console) -> Outcome {
    let (cases, brief_cases) = cases(&args.cases)?;
    let sizes = if brief_cases.is_empty() { CASE_SIZES } else { ShortLivedParams::NUM_SPLATS };
    if !sizes.contains(&args.size) {
        let (smallest, largest) = (sizes.start(), sizes.end());
        let what =
            format!("--size {}: expected {smallest} to {largest} for these cases", args.size);
        return Err(Failure::usage(what));
    }
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let mut scores = Vec::new();
    let mut networks = Networks::default();
    let methods: Vec<Method> =
        METHODS.into_iter().filter(|m| !(args.no_network && m.on_network())).collect();
    let total = (cases.len() * methods.len() + brief_cases.len()) as u64 * args.seeds;
    let mut progress = console.progress("motion", total);
    for &case in &cases {
        for seed in 0..args.seeds {
            let scene = gs_synth::build(case, seed, args.size).map_err(Failure::failed)?;
            let network = if args.no_network {
                None
            } else {
                progress.message(format!("{}: training a network", case.name()));
                Some(networks.of(case, seed, &scene)?)
            };
            for &method in &methods {
                progress.message(format!("{} {}", case.name(), method.name()));
                scores.push(score(case, seed, method, &scene, network.as_ref())?);
                progress.step();
            }
        }
    }
    let mut brief = Vec::new();
    for &case in &brief_cases {
        for seed in 0..args.seeds {
            progress.message(case.name());
            brief.extend(brief::scores(case, seed, args.size)?);
            progress.step();
        }
    }
    progress.finish();
    let mut tables = Vec::new();
    if !cases.is_empty() {
        tables.push(table::motion(&cases, &methods, &scores));
    }
    if !brief.is_empty() {
        tables.push(brief::table(&brief));
    }
    let table = tables.join("\n");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).map_err(|error| Failure::write(&path, &error))
    };
    let report = MotionScores { scores: &scores, networks: &networks.fits, brief: &brief };
    write("motion.json", &serde_json::to_string_pretty(&report).map_err(Failure::failed)?)?;
    write("motion.md", &table)?;
    folder.commit().map_err(|error| output_failure(&error))?;
    console.report(|| json!(report));
    console.wrote(&args.output);
    console.result(table);
    Ok(())
}

/// The contents of `motion.json`.
#[derive(Debug, Serialize)]
struct MotionScores<'a> {
    scores: &'a [Score],
    networks: &'a [Fit],
    brief: &'a [brief::BriefScore],
}

/// A network trained on the source of a case: its error on its own training splats and times.
#[derive(Debug, Serialize)]
struct Fit {
    case: &'static str,
    seed: u64,
    /// Mean error, % of the figure's size.
    mean: f64,
    p95: f64,
    rot_deg: f64,
    seconds: f64,
}

/// Networks trained so far; many cases edit the same source.
#[derive(Default)]
struct Networks {
    trained: Vec<(SynthScene, Arc<HexPlaneScene>)>,
    fits: Vec<Fit>,
}

impl Networks {
    fn of(
        &mut self,
        case: TruthCase,
        seed: u64,
        scene: &TruthScene,
    ) -> Outcome<Arc<HexPlaneScene>> {
        if let Some((_, network)) = self.trained.iter().find(|(known, _)| *known == scene.source) {
            return Ok(Arc::clone(network));
        }
        let start = Instant::now();
        let params = FitParams { seed, ..FitParams::default() };
        let fitted = gs_synth::fit_hexplane(&scene.source, scene.figure_size, &params)
            .map_err(Failure::failed)?;
        let FitResidual { mean, p95, rot_deg, .. } = fitted.residual;
        let seconds = start.elapsed().as_secs_f64();
        self.fits.push(Fit { case: case.name(), seed, mean, p95, rot_deg, seconds });
        let network = Arc::new(fitted.scene().map_err(Failure::failed)?);
        self.trained.push((scene.source.clone(), Arc::clone(&network)));
        Ok(network)
    }
}

fn cases(names: &[String]) -> Outcome<(Vec<TruthCase>, Vec<ShortLivedCase>)> {
    if names.is_empty() {
        return Ok((TruthCase::ALL.to_vec(), ShortLivedCase::ALL.to_vec()));
    }
    let lasting = TruthCase::ALL.iter().map(|case| case.name());
    let known: Vec<&str> =
        lasting.chain(ShortLivedCase::ALL.iter().map(|case| case.name())).collect();
    let (mut cases, mut brief) = (Vec::new(), Vec::new());
    for name in names {
        if let Ok(case) = ShortLivedCase::from_str(name) {
            brief.push(case);
            continue;
        }
        cases.push(TruthCase::from_str(name).map_err(|error| {
            Failure::usage(format!("--cases {name}: {error}"))
                .next(format!("Cases: {}.", known.join(", ")))
        })?);
    }
    Ok((cases, brief))
}

fn score(
    case: TruthCase,
    seed: u64,
    method: Method,
    scene: &TruthScene,
    network: Option<&Arc<HexPlaneScene>>,
) -> Outcome<Score> {
    let failed = |error: &dyn std::error::Error| Failure::failed(chain(error));
    let truth = &scene.edited.truth;
    let start = Instant::now();
    let moved = method.apply(scene, network)?;
    let seconds = start.elapsed().as_secs_f64();
    let times = scene.source.time_range().frames(TIMES + 1);
    let on = |rows: &[bool]| {
        gs_synth::motion_error_of(&moved, truth, &times[1..], rows).map_err(|error| failed(&error))
    };
    let error = on(&truth.eval_mask)?;
    let is_rigid =
        |(scored, row): (&bool, &gs_synth::SplatTruth)| *scored && row.rigid_bone().is_some();
    let rigid: Vec<bool> = truth.eval_mask.iter().zip(truth.rows()).map(is_rigid).collect();
    let is_open =
        |(scored, tag): (&bool, &Tag)| *scored && !matches!(tag, Tag::Unchanged | Tag::Recoloured);
    let open: Vec<bool> = truth.eval_mask.iter().zip(&truth.tags).map(is_open).collect();
    let track =
        |scene: &dyn DynamicScene| MotionTrack::of(scene, &times).map_err(|error| failed(&error));
    let (predicted, expected) = (track(&moved)?, track(truth)?);
    let size = f64::from(scene.figure_size);
    // Methods without a network use the scene itself.
    let followed: &dyn DynamicScene = match network {
        Some(network) if method.on_network() => &**network,
        _ => &scene.source,
    };
    let noise_free = track(&scene.source.noise_free())?.jitter(size).max(1e-12);
    Ok(Score {
        case: case.name(),
        seed,
        method,
        epe: error.epe,
        epe_edited: on(&open)?.epe,
        p95: error.p95,
        bad5: error.bad5,
        contact: error.contact,
        rot_deg: error.rot_deg,
        rot_rigid_deg: on(&rigid)?.rot_deg,
        lns: error.lns,
        jitter_ratio: predicted.jitter(size) / expected.jitter(size).max(1e-12),
        jitter_ratio_source: track(followed)?.jitter(size) / noise_free,
        ndd: neighborhood_distance_deviation(&predicted),
        ndd_truth: neighborhood_distance_deviation(&expected),
        psnr: rendered_psnr(&moved, truth, scene)?,
        seconds,
    })
}

/// Mean PSNR of renders against the truth's, over times and two views.
fn rendered_psnr(
    moved: &dyn DynamicScene,
    truth: &dyn DynamicScene,
    scene: &TruthScene,
) -> Outcome<f64> {
    let (mut ours, mut theirs) =
        (Renderer::new(&Device::Cpu, [0.5; 3]), Renderer::new(&Device::Cpu, [0.5; 3]));
    let mut values = Vec::new();
    for &t in &truth.time_range().frames(RENDERED + 1)[1..] {
        ours.seek(moved, t)?;
        theirs.seek(truth, t)?;
        for camera in scene.cameras.iter().take(2) {
            let camera = camera.resized(SIZE.0, SIZE.1);
            let image = ours.render(&camera)?.rgb_image();
            values.extend(psnr(&image, &theirs.render(&camera)?.rgb_image()));
        }
    }
    Ok(values.iter().sum::<f64>() / values.len().max(1) as f64)
}
