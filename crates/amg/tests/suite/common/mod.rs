//! Golden scenes as `DynamicScene`s, and the metric of `fixtures/amg/README.md`.

use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use test_support::fixture;
use test_support::golden::Golden;

/// A scene given by a table of frames, evenly spaced over [0, 1].
#[derive(Debug, Clone)]
pub(crate) struct Table {
    pub(crate) frames: Vec<Splats>,
    pub(crate) mask: Option<Vec<bool>>,
}

impl Table {
    pub(crate) fn new(frames: Vec<Splats>) -> Self {
        Self { frames, mask: None }
    }
}

impl DynamicScene for Table {
    fn num_splats(&self) -> usize {
        self.frames[0].len()
    }
    fn sh_degree(&self) -> usize {
        self.frames[0].sh_degree
    }
    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }
    fn num_frames(&self) -> Option<usize> {
        Some(self.frames.len())
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        if !TimeRange::UNIT.contains(t) {
            return Err(SceneError::Time { t, range: TimeRange::UNIT });
        }
        let last = self.frames.len() - 1;
        let frame = (t * last as f32).round() as usize;
        out.clone_from(&self.frames[frame]);
        Ok(())
    }
    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.mask.as_deref()
    }
}

fn rows<const D: usize>(values: &[f32]) -> Vec<[f32; D]> {
    values.as_chunks::<D>().0.to_vec()
}

fn logit(opacity: f32) -> f32 {
    (opacity / (1.0 - opacity)).ln()
}

pub(crate) fn splats(mu: &[f32], q: &[f32], s: &[f32], opacity: &[f32]) -> Splats {
    let means = rows::<3>(mu);
    Splats {
        sh: vec![[0.0; 3]; means.len()],
        means,
        quats: rows::<4>(q),
        log_scales: rows::<3>(s).into_iter().map(|s| s.map(f32::ln)).collect(),
        opacity_logits: opacity.iter().map(|&o| logit(o)).collect(),
        sh_degree: 0,
    }
}

/// Source scene and length unit.
pub(crate) fn golden_source() -> (Table, f64) {
    let golden = Golden::open(fixture("amg/source.safetensors"));
    let opacity = golden.f32s("opacity");
    let num = opacity.len();
    let mut frames =
        vec![splats(&golden.f32s("mu"), &golden.f32s("q"), &golden.f32s("s"), &opacity)];
    let (mu, q, s) = (golden.f32s("mu_t"), golden.f32s("q_t"), golden.f32s("s_t"));
    for t in 0..golden.shape("times")[0] {
        frames.push(splats(
            &mu[t * num * 3..(t + 1) * num * 3],
            &q[t * num * 4..(t + 1) * num * 4],
            &s[t * num * 3..(t + 1) * num * 3],
            &opacity,
        ));
    }
    (Table::new(frames), f64::from(golden.f32s("figure_size")[0]))
}

/// An edit with its true motion: per time centres, orientations and scale ratios.
#[derive(Debug, Clone)]
pub(crate) struct Edit {
    pub(crate) splats: Splats,
    pub(crate) means_t: Vec<Vec<[f32; 3]>>,
    pub(crate) quats_t: Vec<Vec<[f32; 4]>>,
    pub(crate) ratios_t: Vec<Vec<f32>>,
    pub(crate) scored: Vec<bool>,
    pub(crate) contact: Vec<bool>,
}

pub(crate) fn golden_edit(name: &str) -> Edit {
    let golden = Golden::open(fixture(&format!("amg/edit_{name}.safetensors")));
    let splats =
        splats(&golden.f32s("mu"), &golden.f32s("q"), &golden.f32s("s"), &golden.f32s("opacity"));
    let num = splats.len();
    let flags = |name: &str| golden.u8s(name).iter().map(|&v| v != 0).collect();
    Edit {
        splats,
        means_t: golden.f32s("gt_mu_t").chunks(num * 3).map(rows::<3>).collect(),
        quats_t: golden.f32s("gt_q_t").chunks(num * 4).map(rows::<4>).collect(),
        ratios_t: golden.f32s("gt_scale_ratio_t").chunks(num).map(<[f32]>::to_vec).collect(),
        scored: flags("eval_mask"),
        contact: flags("contact_mask"),
    }
}

/// The README's measures: lengths in % of figure size, `rot` in degrees.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Score {
    pub(crate) epe: f64,
    pub(crate) p95: f64,
    pub(crate) bad5: f64,
    pub(crate) contact: f64,
    pub(crate) rot: f64,
    pub(crate) lns: f64,
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.3} | {:.2} | {:.2} | {:.2} | {:.1} | {:.2}",
            self.epe, self.p95, self.bad5, self.contact, self.rot, self.lns
        )
    }
}

/// Largest error over time of each row, % of figure size.
pub(crate) fn worst_errors(scene: &dyn DynamicScene, edit: &Edit, size: f64) -> Vec<f64> {
    let times = scene.time_range().frames(edit.means_t.len() + 1);
    let mut worst = vec![0.0_f64; edit.splats.len()];
    for (t, truth) in times[1..].iter().zip(&edit.means_t) {
        let at = scene.at(*t).unwrap();
        for (i, worst) in worst.iter_mut().enumerate() {
            *worst = worst.max(distance(at.means[i], truth[i]) / size * 100.0);
        }
    }
    worst
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|i| (f64::from(a[i]) - f64::from(b[i])).powi(2)).sum::<f64>().sqrt()
}

pub(crate) fn score(scene: &dyn DynamicScene, edit: &Edit, size: f64) -> Score {
    let times = scene.time_range().frames(edit.means_t.len() + 1);
    let scored: Vec<usize> = (0..edit.splats.len()).filter(|&i| edit.scored[i]).collect();
    let mut errors = Vec::new();
    let mut out = Score::default();
    let (mut contact, mut contacts) = (0.0, 0);
    let count = (scored.len() * edit.means_t.len()) as f64;
    for (k, t) in times[1..].iter().enumerate() {
        let at = scene.at(*t).unwrap();
        assert!(
            at.means.iter().flatten().all(|v| v.is_finite())
                && at.quats.iter().flatten().all(|v| v.is_finite()),
            "no NaN at {t}"
        );
        for &i in &scored {
            let e = distance(at.means[i], edit.means_t[k][i]) / size * 100.0;
            errors.push(e);
            if edit.contact[i] {
                contact += e;
                contacts += 1;
            }
            let q = gs_core::quat::normalize(at.quats[i].map(f64::from));
            let truth = gs_core::quat::normalize(edit.quats_t[k][i].map(f64::from));
            let cosine = gs_core::quat::dot(q, truth).abs().min(1.0);
            out.rot += 2.0 * cosine.acos().to_degrees() / count;
            let lns: f64 = (0..3)
                .map(|axis| {
                    let expected = f64::from(edit.splats.log_scales[i][axis])
                        + f64::from(edit.ratios_t[k][i]).ln();
                    (f64::from(at.log_scales[i][axis]) - expected).abs()
                })
                .sum();
            out.lns += lns / 3.0 * 100.0 / count;
        }
    }
    let worst = worst_errors(scene, edit, size);
    out.bad5 =
        scored.iter().filter(|&&i| worst[i] > 5.0).count() as f64 / scored.len() as f64 * 100.0;
    out.epe = errors.iter().sum::<f64>() / count;
    errors.sort_by(f64::total_cmp);
    let position = 0.95 * (errors.len() - 1) as f64;
    let (low, share) = (position.floor() as usize, position.fract());
    out.p95 = errors[low] * (1.0 - share) + errors[(low + 1).min(errors.len() - 1)] * share;
    out.contact = if contacts > 0 { contact / f64::from(contacts) } else { 0.0 };
    out
}
