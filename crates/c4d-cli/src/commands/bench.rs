//! `c4d bench motion`: every motion method against known truth.

use super::freeze::{existing, output_failure};
use crate::args::{BenchMotionArgs, Global};
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome, chain};
use crate::renderer::Renderer;
use amg::{MotionOptions, Preset};
use c4d_metrics::{MotionTrack, neighbourhood_distance_deviation, psnr};
use gs_core::DynamicScene;
use gs_io::AtomicDir;
use gs_synth::{TruthCase, TruthScene};
use serde::Serialize;
use std::fmt::Write;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

/// Times scored, besides frame 1.
const TIMES: usize = 8;
/// Times rendered.
const RENDERED: usize = 3;
/// Size of the renders compared, pixels.
const SIZE: (u32, u32) = (320, 240);
/// Files of a report.
const OURS: [&str; 2] = ["motion.json", "motion.md"];

/// A method and how it is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Method {
    /// Three nearest source splats, all rows (the paper's KNN-Guide).
    Knn,
    /// The paper to the letter, all rows.
    Paper,
    /// The default.
    Default,
}

const METHODS: [Method; 3] = [Method::Knn, Method::Paper, Method::Default];

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Knn => "KNN-Guide",
            Self::Paper => "paper, literal",
            Self::Default => "c4d",
        }
    }

    /// Baselines follow the paper and estimate every row; the default keeps splats that were not edited.
    fn options(self) -> MotionOptions {
        let mut options = MotionOptions::preset(match self {
            Self::Knn => Preset::Knn,
            Self::Paper => Preset::Paper,
            Self::Default => Preset::Best,
        });
        options.identity.enabled = self == Self::Default;
        options
    }
}

/// One scene, one method. Lengths in % of the figure's size.
#[derive(Debug, Clone, Serialize)]
struct Score {
    case: &'static str,
    seed: u64,
    method: Method,
    epe: f64,
    p95: f64,
    bad5: f64,
    contact: f64,
    rot_deg: f64,
    lns: f64,
    jitter_ratio: f64,
    ndd: f64,
    ndd_truth: f64,
    psnr: f64,
    seconds: f64,
}

pub(crate) fn motion(args: &BenchMotionArgs, global: &Global, console: &Console) -> Outcome {
    let cases = cases(&args.cases)?;
    let folder = AtomicDir::create(&args.output, existing(global), |name| OURS.contains(&name))
        .map_err(|error| output_failure(&error))?;
    let mut scores = Vec::new();
    let total = cases.len() as u64 * args.seeds * METHODS.len() as u64;
    let mut progress = console.progress("motion", total);
    for &case in &cases {
        for seed in 0..args.seeds {
            let scene = gs_synth::build(case, seed, args.size).map_err(Failure::failed)?;
            for method in METHODS {
                progress.message(format!("{} {}", case.name(), method.name()));
                scores.push(score(case, seed, method, &scene)?);
                progress.step();
            }
        }
    }
    progress.finish();
    let table = table(&cases, &scores);
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).map_err(|error| Failure::write(&path, &error))
    };
    write(OURS[0], &serde_json::to_string_pretty(&scores).map_err(Failure::failed)?)?;
    write(OURS[1], &table)?;
    folder.commit().map_err(|error| output_failure(&error))?;
    console.result(table);
    Ok(())
}

fn cases(names: &[String]) -> Outcome<Vec<TruthCase>> {
    if names.is_empty() {
        return Ok(TruthCase::ALL.to_vec());
    }
    let known: Vec<&str> = TruthCase::ALL.iter().map(|case| case.name()).collect();
    names
        .iter()
        .map(|name| {
            TruthCase::from_str(name).map_err(|error| {
                Failure::usage(format!("--cases {name}: {error}"))
                    .next(format!("Cases: {}.", known.join(", ")))
            })
        })
        .collect()
}

fn score(case: TruthCase, seed: u64, method: Method, scene: &TruthScene) -> Outcome<Score> {
    let failed = |error: &dyn std::error::Error| Failure::failed(chain(error));
    let truth = &scene.edited.truth;
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
    let edited = Arc::new(scene.edited.splats.clone());
    let start = Instant::now();
    let moved = amg::propagate(source, edited, &method.options(), &|_, _| {})
        .map_err(|error| failed(&error))?
        .scene;
    let seconds = start.elapsed().as_secs_f64();
    let times = scene.source.time_range().frames(TIMES + 1);
    let error =
        gs_synth::motion_error(&moved, truth, &times[1..]).map_err(|error| failed(&error))?;
    let track =
        |scene: &dyn DynamicScene| MotionTrack::of(scene, &times).map_err(|error| failed(&error));
    let (predicted, expected) = (track(&moved)?, track(truth)?);
    let size = f64::from(scene.figure_size);
    Ok(Score {
        case: case.name(),
        seed,
        method,
        epe: error.epe,
        p95: error.p95,
        bad5: error.bad5,
        contact: error.contact,
        rot_deg: error.rot_deg,
        lns: error.lns,
        jitter_ratio: predicted.jitter(size) / expected.jitter(size).max(1e-12),
        ndd: neighbourhood_distance_deviation(&predicted),
        ndd_truth: neighbourhood_distance_deviation(&expected),
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

fn table(cases: &[TruthCase], scores: &[Score]) -> String {
    let mut text = String::from(
        "| case | method | EPE % | share of KNN | p95 % | bad5 % | contact % | rot ° | jitter / truth | NDD (truth) | PSNR dB | s |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for case in cases {
        let of = |method: Method| {
            scores.iter().filter(move |score| score.case == case.name() && score.method == method)
        };
        let mean = |method: Method, value: fn(&Score) -> f64| {
            let values: Vec<f64> = of(method).map(value).collect();
            values.iter().sum::<f64>() / values.len().max(1) as f64
        };
        let knn = mean(Method::Knn, |score| score.epe);
        for method in METHODS {
            let value = |of: fn(&Score) -> f64| mean(method, of);
            let _ = writeln!(
                text,
                "| {} | {} | {:.3} | {:.2} | {:.2} | {:.1} | {:.2} | {:.1} | {:.2} | {:.3} ({:.3}) | {:.1} | {:.2} |",
                case.name(),
                method.name(),
                value(|s| s.epe),
                value(|s| s.epe) / knn.max(1e-12),
                value(|s| s.p95),
                value(|s| s.bad5),
                value(|s| s.contact),
                value(|s| s.rot_deg),
                value(|s| s.jitter_ratio),
                value(|s| s.ndd),
                value(|s| s.ndd_truth),
                value(|s| s.psnr),
                value(|s| s.seconds),
            );
        }
    }
    text
}
