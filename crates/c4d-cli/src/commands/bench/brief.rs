//! Cases with short-lived splats: how well an edit persists when other splats replace the edited
//! ones.

use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::renderer::Renderer;
use amg::{Follow, MotionOptions};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use gs_synth::{
    ShortLivedCase, ShortLivedParams, ShortLivedTruthScene, build_short_lived, label_transport,
};
use serde::Serialize;
use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

/// Size of the renders compared, pixels.
const SIZE: (u32, u32) = (320, 240);
/// Times rendered; the first frame is the edit.
const TIMES: [f32; 4] = [0.25, 0.5, 0.75, 1.0];
/// A pixel lies inside the edited region where truth and unedited source differ by more, 0 to 1.
const DIFFERS: f32 = 2.0 / 255.0;
/// Number of times at which grafts are scored.
const TRACKED: usize = 21;
/// PSNR of identical images, dB.
const EQUAL: f64 = 99.0;

/// Propagation method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Method {
    /// The unedited source.
    Unedited,
    /// `--follow splats`.
    Splats,
    /// Labels propagated by majority vote of neighbours, with the case's true colours.
    Labels,
    /// `--follow surface`.
    Surface,
}

const METHODS: [Method; 4] = [Method::Unedited, Method::Splats, Method::Labels, Method::Surface];

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Unedited => "unedited",
            Self::Splats => "c4d --follow splats",
            Self::Labels => "labels, no transport",
            Self::Surface => "c4d --follow surface",
        }
    }
}

/// One case, one method.
#[derive(Debug, Clone, Serialize)]
pub(super) struct BriefScore {
    case: &'static str,
    seed: u64,
    share: f32,
    lifetimes: [f32; 2],
    method: Method,
    /// PSNR inside the edited region and outside, dB.
    inside: f64,
    outside: f64,
    /// Splats of the edited surface that were not edited although visible at some time, and other
    /// splats that were edited, % of the splats of that surface.
    missed: f64,
    wrong: f64,
    /// Of new splats: mean and largest error, % of the figure, and smallest share of their opacity.
    graft_mean: f64,
    graft_max: f64,
    graft_opacity: f64,
    seconds: f64,
}

/// Share and lifetime range of short-lived splats in each case: typical; fewer; more and shorter;
/// and lifetimes so long that linear motion is a poor fit.
const LIFETIMES: [(f32, [f32; 2]); 4] =
    [(0.8, [0.05, 0.3]), (0.5, [0.05, 0.3]), (0.95, [0.05, 0.15]), (0.8, [0.3, 0.6])];

/// Scores all methods on a case.
pub(super) fn scores(case: ShortLivedCase, seed: u64, size: usize) -> Outcome<Vec<BriefScore>> {
    let mut scores = Vec::new();
    for (share, lifetimes) in LIFETIMES {
        let params = ShortLivedParams {
            num_splats: size,
            seed,
            share,
            lifetimes,
            ..ShortLivedParams::default()
        };
        let scene = build_short_lived(case, &params)
            .map_err(|error| Failure::usage(format!("--size {size}: {error}")))?;
        for method in METHODS {
            scores.extend(score(case, &params, &scene, method)?);
        }
    }
    Ok(scores)
}

/// A scene with some splats hidden and other colours.
#[derive(Debug)]
struct Marked {
    source: Arc<dyn DynamicScene>,
    hidden: Vec<bool>,
    sh: Option<(Vec<bool>, Vec<[f32; 3]>)>,
}

impl DynamicScene for Marked {
    fn num_splats(&self) -> usize {
        self.source.num_splats()
    }
    fn sh_degree(&self) -> usize {
        self.source.sh_degree()
    }
    fn time_range(&self) -> TimeRange {
        self.source.time_range()
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.source.at_into(t, out)?;
        for (logit, _) in out.opacity_logits.iter_mut().zip(&self.hidden).filter(|(_, h)| **h) {
            *logit = -20.0;
        }
        if let Some((painted, sh)) = &self.sh {
            let coeffs = out.sh_coeffs();
            for row in (0..painted.len()).filter(|&row| painted[row]) {
                out.sh[row * coeffs] = sh[row * coeffs];
            }
        }
        Ok(())
    }
}

fn score(
    case: ShortLivedCase,
    params: &ShortLivedParams,
    scene: &ShortLivedTruthScene,
    method: Method,
) -> Outcome<Option<BriefScore>> {
    let start = Instant::now();
    let source: Arc<dyn DynamicScene> = Arc::new(scene.source.clone());
    let follow = |follow| {
        let options = MotionOptions::default().with_follow(follow);
        let edited = Arc::new(scene.edited.clone());
        amg::propagate(Arc::clone(&source), edited, &options, &|_, _| {}).map_err(Failure::failed)
    };
    let none = || vec![false; source.num_splats()];
    let (moved, edited): (Arc<dyn DynamicScene>, Option<Vec<bool>>) = match method {
        Method::Unedited => (Arc::clone(&source), None),
        Method::Labels => {
            if matches!(case, ShortLivedCase::Hat | ShortLivedCase::Scale) {
                return Ok(None);
            }
            let labels = label_transport(&*source, &scene.touched).map_err(Failure::failed)?;
            let is_recolour = case == ShortLivedCase::Recolour;
            let marked = Marked {
                source: Arc::clone(&source),
                hidden: if is_recolour { none() } else { labels.clone() },
                sh: is_recolour.then(|| (labels.clone(), scene.painted.clone())),
            };
            (Arc::new(marked), Some(labels))
        }
        Method::Splats => (Arc::new(follow(Follow::Splats)?.scene), None),
        Method::Surface => {
            let found = follow(Follow::Surface)?;
            let edited = reached(&found, source.num_splats());
            (Arc::new(found.scene), Some(edited))
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    let (missed, wrong) = match edited {
        Some(edited) if case != ShortLivedCase::Hat => missed_and_wrong(scene, &edited)?,
        _ => (f64::NAN, f64::NAN),
    };
    let (inside, outside) = rendered(&*moved, scene)?;
    let graft = if case == ShortLivedCase::Hat && method != Method::Unedited {
        grafted(&*moved, scene)?
    } else {
        [f64::NAN; 3]
    };
    Ok(Some(BriefScore {
        case: case.name(),
        seed: params.seed,
        share: params.share,
        lifetimes: params.lifetimes,
        method,
        inside,
        outside,
        missed,
        wrong,
        graft_mean: graft[0],
        graft_max: graft[1],
        graft_opacity: graft[2],
        seconds,
    }))
}

/// Whether the edit changed each source splat, in the edited frame or by inheritance.
fn reached(found: &amg::Propagation, num_sources: usize) -> Vec<bool> {
    let mut reached = vec![true; num_sources];
    let binding = found.scene.binding();
    for (row, kind) in binding.kinds().iter().enumerate() {
        if *kind == amg::RowKind::Unchanged {
            reached[binding.row(row).0[0] as usize] = false;
        }
    }
    // Splats on a soft border that changed by less than half do not count.
    for inherited in binding.surface().iter().flat_map(|surface| &surface.inherited) {
        let id = binding.row(inherited.row as usize).0[0] as usize;
        let whole = inherited.opacity <= 0.0 || inherited.group.is_some();
        let matrix = &inherited.color.matrix;
        let change = (0..3).map(|i| (matrix[i][i] - 1.0).abs()).fold(0.0, f32::max);
        let shift = inherited.color.offset.iter().fold(0.0, |m: f32, o| m.max(o.abs()));
        reached[id] = whole || change > 0.02 || shift > 0.02;
    }
    reached
}

fn missed_and_wrong(scene: &ShortLivedTruthScene, edited: &[bool]) -> Outcome<(f64, f64)> {
    let mut visible = vec![false; edited.len()];
    for t in TimeRange::UNIT.frames(41) {
        let now = scene.source.at(t).map_err(Failure::failed)?;
        for (row, visible) in visible.iter_mut().enumerate() {
            *visible |= now.opacity(row) > 0.1;
        }
    }
    let count = |of: &dyn Fn(usize) -> bool| {
        (0..edited.len()).filter(|&row| visible[row] && of(row)).count() as f64
    };
    let all = count(&|row| scene.touched[row]).max(1.0);
    let missed = count(&|row| scene.touched[row] && !edited[row]);
    let wrong = count(&|row| !scene.touched[row] && edited[row]);
    Ok((100.0 * missed / all, 100.0 * wrong / all))
}

/// PSNR inside the edited region and outside, over times and two views.
fn rendered(moved: &dyn DynamicScene, scene: &ShortLivedTruthScene) -> Outcome<(f64, f64)> {
    let mut renderers = [0, 1, 2].map(|_| Renderer::new(&Device::Cpu, [0.5; 3]));
    let mut sums = [(0.0_f64, 0_usize); 2];
    for t in TIMES {
        renderers[0].seek(moved, t)?;
        renderers[1].seek(&scene.truth, t)?;
        renderers[2].seek(&scene.source, t)?;
        for camera in scene.cameras.iter().take(2) {
            let camera = camera.resized(SIZE.0, SIZE.1);
            let mut images = Vec::new();
            for renderer in &mut renderers {
                images.push(renderer.render(&camera)?.rgb_image().data);
            }
            let pixels = |image: usize| images[image].chunks_exact(3);
            for ((ours, truth), before) in pixels(0).zip(pixels(1)).zip(pixels(2)) {
                let differs = truth.iter().zip(before).any(|(a, b)| (a - b).abs() > DIFFERS);
                let sum = &mut sums[usize::from(!differs)];
                sum.0 += ours.iter().zip(truth).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
                sum.1 += 3;
            }
        }
    }
    let psnr = |(squares, count): (f64, usize)| {
        let mean = squares / count.max(1) as f64;
        if mean > 0.0 { (-10.0 * mean.log10()).min(EQUAL) } else { EQUAL }
    };
    Ok((psnr(sums[0]), psnr(sums[1])))
}

/// Of new splats, over the clip: mean and largest error of positions, and smallest share of opacity.
fn grafted(moved: &dyn DynamicScene, scene: &ShortLivedTruthScene) -> Outcome<[f64; 3]> {
    let new: Vec<usize> = scene
        .truth
        .new_rows()
        .iter()
        .enumerate()
        .filter(|(_, new)| **new)
        .map(|(i, _)| i)
        .collect();
    let percent = 100.0 / f64::from(scene.source.figure_size());
    let (mut sum, mut worst, mut opacity) = (0.0, 0.0_f64, 1.0_f64);
    for t in TimeRange::UNIT.frames(TRACKED) {
        let ours = moved.at(t).map_err(Failure::failed)?;
        let truth = scene.truth.at(t).map_err(Failure::failed)?;
        // In both, the new splats are the last rows.
        let (a, b) = (ours.len() - new.len(), truth.len() - new.len());
        let mut mean = 0.0;
        for k in 0..new.len() {
            let apart: f64 = (0..3)
                .map(|i| f64::from(ours.means[a + k][i] - truth.means[b + k][i]).powi(2))
                .sum();
            mean += percent * apart.sqrt() / new.len() as f64;
            let share = f64::from(ours.opacity(a + k) / truth.opacity(b + k));
            opacity = opacity.min(share);
        }
        sum += mean / TRACKED as f64;
        worst = worst.max(mean);
    }
    Ok([sum, worst, opacity])
}

/// Scores as Markdown: means over the seeds.
pub(super) fn table(scores: &[BriefScore]) -> String {
    let mut text = String::from(
        "| short-lived splats | share, lifetimes | method | inside dB | outside dB | missed % | wrong % | graft %: mean, at worst | graft's opacity | s |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut keys: Vec<(&str, f32, [f32; 2], Method)> = Vec::new();
    for score in scores {
        let key = (score.case, score.share, score.lifetimes, score.method);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    for (case, share, lifetimes, method) in keys {
        let same: Vec<&BriefScore> = scores
            .iter()
            .filter(|s| {
                (s.case, s.share, s.lifetimes, s.method) == (case, share, lifetimes, method)
            })
            .collect();
        let mean = |of: fn(&BriefScore) -> f64| {
            same.iter().map(|score| of(score)).sum::<f64>() / same.len() as f64
        };
        let shown = |value: f64, digits: usize| {
            if value.is_nan() { "–".to_owned() } else { format!("{value:.digits$}") }
        };
        let _ = writeln!(
            text,
            "| {case} | {:.0} %, {:.2}–{:.2} | {} | {:.1} | {:.1} | {} | {} | {}, {} | {} | {:.2} |",
            100.0 * share,
            lifetimes[0],
            lifetimes[1],
            method.name(),
            mean(|s| s.inside),
            mean(|s| s.outside),
            shown(mean(|s| s.missed), 1),
            shown(mean(|s| s.wrong), 1),
            shown(mean(|s| s.graft_mean), 2),
            shown(mean(|s| s.graft_max), 2),
            shown(mean(|s| s.graft_opacity), 3),
            mean(|s| s.seconds),
        );
    }
    text
}
