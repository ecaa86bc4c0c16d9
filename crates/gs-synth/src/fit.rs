//! [`fit_hexplane`]: a deformation network of the 4DGaussians kind, trained on a scene's
//! trajectories.
//!
//! The effect of a deformation network on an edit can be measured only with a trained one: it maps
//! *positions*, not splats, to motion, and an edit puts splats where there were none in training.
//! Training is here and not in `gs-deform`, because only scenes with known motion are trained. The
//! network is the published one: two levels of six planes, a trunk, a head for centres and one for
//! quaternions (scales, opacity and colour are not deformed). Quaternion differences are added, as
//! in that network, which cannot rotate neighbours of different orientation alike; rotations
//! therefore fit far worse than centres.

#![expect(
    clippy::inline_always,
    reason = "loops must inline into the function that run-time dispatch compiles for the processor's vector instructions"
)]

mod layer;
mod model;
mod params;
mod samples;

use crate::{SynthError, math::rng};
use gs_core::{DynamicScene, Splats, quat};
use gs_deform::{HexPlaneField, HexPlaneNetwork, HexPlaneScene};
use layer::PANEL;
use model::{ParameterLayout, Scratch};
pub use params::FitParams;
use rand::RngExt;
use rayon::prelude::*;
use samples::{PANELS, Samples};

/// Groups of panels with a gradient each.
const GROUPS: usize = 4;
/// Initial learning rates; they decay by a cosine schedule to one fiftieth.
const PLANE_RATE: f32 = 2e-2;
const LAYER_RATE: f32 = 4e-3;
/// Margin of the planes' box around the splats, share of its size.
const MARGIN: f32 = 0.1;

/// A trained network.
#[derive(Debug, Clone)]
pub struct FittedField {
    /// The splats that the network deforms: those of the scene at time 0, bit for bit.
    pub canonical: Splats,
    /// The network, which deforms `canonical` to approximate the scene at any time.
    pub network: HexPlaneNetwork,
    /// Errors on the splats and times of the training.
    pub residual: FitResidual,
}

/// Errors of a trained network.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct FitResidual {
    /// Mean distance of centres from the scene's, % of the figure size.
    pub mean: f64,
    /// 95th percentile of these distances, % of the figure size.
    pub p95: f64,
    /// Mean angle to the scene's rotations, degrees.
    pub rot_deg: f64,
}

impl FittedField {
    /// The network as a scene.
    ///
    /// # Errors
    /// Never for results of [`fit_hexplane`].
    pub fn scene(&self) -> Result<HexPlaneScene, SynthError> {
        let field = HexPlaneField::new(self.network.clone())?;
        Ok(HexPlaneScene::new(self.canonical.clone(), field)?)
    }
}

/// Trains a network on `scene`, whose figure is `figure_size` long (world units). The result is the
/// same for any number of threads.
///
/// # Errors
/// If a parameter is out of range or the scene cannot be evaluated.
pub fn fit_hexplane(
    scene: &dyn DynamicScene,
    figure_size: f32,
    params: &FitParams,
) -> Result<FittedField, SynthError> {
    check(params, figure_size)?;
    let times = scene.time_range().frames(params.num_times);
    let canonical = scene.at(times[0])?;
    let aabb = bounds(&canonical);
    let layout = ParameterLayout::new(params);
    let mut random = rng(params.seed, 77);
    let mut weights = layout.initial(&mut random);
    let samples = samples(scene, &canonical, &times, aabb, figure_size)?;
    if !canonical.is_empty() {
        train(&layout, &samples, params, &mut random, &mut weights);
    }
    let network = layout.network(&weights, aabb);
    let mut fitted = FittedField { canonical, network, residual: FitResidual::default() };
    fitted.residual = residual(scene, &fitted, &times, figure_size)?;
    Ok(fitted)
}

fn check(params: &FitParams, figure_size: f32) -> Result<(), SynthError> {
    for (name, value, minimum) in [
        ("resolution", params.resolution, 2),
        ("time_resolution", params.time_resolution, 2),
        ("num_times", params.num_times, 2),
    ] {
        if !(minimum..=512).contains(&value) {
            return Err(SynthError::param(name, value, "2 to 512"));
        }
    }
    if figure_size > 0.0 && figure_size.is_finite() {
        Ok(())
    } else {
        Err(SynthError::param("figure_size", figure_size, "a positive length"))
    }
}

/// Maximum and minimum corner, with a margin, because edits extend beyond
/// the splats and planes are clamped to their box.
fn bounds(splats: &Splats) -> [[f32; 3]; 2] {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for mean in &splats.means {
        for axis in 0..3 {
            low[axis] = low[axis].min(mean[axis]);
            high[axis] = high[axis].max(mean[axis]);
        }
    }
    let longest = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f32::max);
    let margin = if longest > 0.0 { MARGIN * longest } else { 1.0 };
    if splats.is_empty() {
        return [[1.0; 3], [-1.0; 3]];
    }
    [high.map(|c| c + margin), low.map(|c| c - margin)]
}

fn samples<'a>(
    scene: &dyn DynamicScene,
    canonical: &Splats,
    times: &'a [f32],
    aabb: [[f32; 3]; 2],
    figure_size: f32,
) -> Result<Samples<'a>, SynthError> {
    let [high, low] = aabb;
    // As `gs_deform::HexPlane::normalize`.
    let place = |mean: &[f32; 3]| {
        [0, 1, 2].map(|axis| (mean[axis] - high[axis]) * (2.0 / (low[axis] - high[axis])) - 1.0)
    };
    let (mut shifts, mut rotations) = (Vec::new(), Vec::new());
    let mut at = Splats::default();
    for &t in times {
        scene.geometry_into(t, &mut at)?;
        let pairs = at.means.iter().zip(&canonical.means);
        let shift = |(to, from): (&[f32; 3], &[f32; 3])| {
            [0, 1, 2].map(|axis| (to[axis] - from[axis]) / figure_size)
        };
        shifts.push(pairs.map(shift).collect());
        let pairs = at.quats.iter().zip(&canonical.quats);
        let turn = |(to, from): (&[f32; 4], &[f32; 4])| {
            let to = quat::align(*to, *from);
            [0, 1, 2, 3].map(|i| to[i] - from[i])
        };
        rotations.push(pairs.map(turn).collect());
    }
    let places = canonical.means.iter().map(place).collect();
    Ok(Samples { places, times, shifts, rotations, figure_size })
}

fn train(
    layout: &ParameterLayout,
    samples: &Samples<'_>,
    params: &FitParams,
    random: &mut rand_pcg::Pcg64,
    weights: &mut [f32],
) {
    let rows = crate::math::row_id(samples.places.len());
    let times = crate::math::row_id(samples.times.len());
    let mut groups: Vec<(Vec<f32>, Scratch)> =
        vec![(vec![0.0; layout.len], Scratch::default()); GROUPS];
    let mut adam =
        FitAdam { first: vec![0.0; layout.len], second: vec![0.0; layout.len], steps: 0 };
    let arch = pulp::Arch::new();
    for step in 0..params.steps {
        let mut picks = vec![[(0, 0); PANEL]; PANELS];
        for pick in picks.iter_mut().flatten() {
            *pick = (random.random_range(0..rows), random.random_range(0..times));
        }
        let frozen: &[f32] = weights;
        groups.par_iter_mut().zip(picks.par_chunks(PANELS / GROUPS)).for_each(
            |((grads, scratch), picks)| {
                grads.fill(0.0);
                arch.dispatch(
                    #[inline(always)]
                    || {
                        for picks in picks {
                            layout.backward(frozen, samples, picks, scratch, grads);
                        }
                    },
                );
            },
        );
        let done = step as f32 / params.steps as f32;
        let fade = 0.02 + 0.49 * (1.0 + (std::f32::consts::PI * done).cos());
        let grads: Vec<&[f32]> = groups.iter().map(|(grads, _)| grads.as_slice()).collect();
        adam.step(weights, &grads, layout.plane_params, fade);
    }
}

/// Adam over all weights, with the sum of the groups' gradients; its second moment decays faster
/// than usual, for the short training. Not `gs_fit::Adam`: this crate depends on no method that it
/// tests.
struct FitAdam {
    first: Vec<f32>,
    second: Vec<f32>,
    steps: i32,
}

impl FitAdam {
    fn step(&mut self, weights: &mut [f32], grads: &[&[f32]], plane_params: usize, fade: f32) {
        const BETA: [f32; 2] = [0.9, 0.99];
        self.steps += 1;
        let correct = BETA.map(|beta| 1.0 / (1.0 - beta.powi(self.steps)));
        let rows = weights.par_iter_mut().zip(&mut self.first).zip(&mut self.second);
        rows.enumerate().with_min_len(16_384).for_each(|(i, ((weight, m), v))| {
            let grad: f32 = grads.iter().map(|grads| grads[i]).sum();
            *m += (1.0 - BETA[0]) * (grad - *m);
            *v += (1.0 - BETA[1]) * (grad * grad - *v);
            let rate = fade * if i < plane_params { PLANE_RATE } else { LAYER_RATE };
            *weight -= rate * *m * correct[0] / ((*v * correct[1]).sqrt() + 1e-12);
        });
    }
}

fn residual(
    scene: &dyn DynamicScene,
    fitted: &FittedField,
    times: &[f32],
    figure_size: f32,
) -> Result<FitResidual, SynthError> {
    let network = fitted.scene()?;
    let (mut ours, mut theirs) = (Splats::default(), Splats::default());
    let mut misses = Vec::new();
    let mut angles = 0.0;
    for &t in times {
        network.geometry_into(t, &mut ours)?;
        scene.geometry_into(t, &mut theirs)?;
        for (a, b) in ours.means.iter().zip(&theirs.means) {
            let d = [0, 1, 2].map(|axis| f64::from(a[axis]) - f64::from(b[axis]));
            let length = d.iter().map(|c| c * c).sum::<f64>().sqrt();
            misses.push(100.0 * length / f64::from(figure_size));
        }
        for (a, b) in ours.quats.iter().zip(&theirs.quats) {
            angles += crate::metric::angle_between(*a, *b).to_degrees();
        }
    }
    let count = misses.len().max(1) as f64;
    Ok(FitResidual {
        mean: misses.iter().sum::<f64>() / count,
        p95: gs_core::quantile(&mut misses, 0.95).unwrap_or(0.0),
        rot_deg: angles / count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{TruthCase, build};

    fn params() -> FitParams {
        FitParams { steps: 40, resolution: 12, time_resolution: 17, num_times: 9, seed: 3 }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let scene = build(TruthCase::TouchAndPart, 1, 500).unwrap();
        let small = FitParams { resolution: 3, ..params() };
        let layout = ParameterLayout::new(&small);
        let mut random = rng(5, 5);
        let mut weights = layout.initial(&mut random);
        // Moved away from the initial weights, where time planes
        // and last layers have special values.
        for weight in &mut weights {
            *weight += 0.1 * crate::math::normal(&mut random);
        }
        let times = scene.source.time_range().frames(5);
        let canonical = scene.source.at(0.0).unwrap();
        let aabb = bounds(&canonical);
        let samples = samples(&scene.source, &canonical, &times, aabb, 1.0).unwrap();
        let mut picks = [(0, 0); PANEL];
        for (k, pick) in picks.iter_mut().enumerate() {
            *pick = (crate::math::row_id(k * 7), crate::math::row_id(k % 5));
        }
        let mut scratch = Scratch::default();
        let mut loss = |weights: &[f32], grads: &mut [f32]| {
            f64::from(layout.backward(weights, &samples, &picks, &mut scratch, grads))
        };
        let mut grads = vec![0.0; layout.len];
        loss(&weights, &mut grads);
        let mut ignored = vec![0.0; layout.len];
        // The stored gradient is that of the mean over a whole step.
        let scale = (PANELS * PANEL) as f64;
        let mut compared = 0;
        for i in (0..layout.len).step_by(97) {
            let expected = scale * f64::from(grads[i]);
            let (old, h) = (weights[i], 4e-3);
            let mut at = |value| {
                weights[i] = value;
                loss(&weights, &mut ignored)
            };
            let (up, down) = (at(old + h), at(old - h));
            weights[i] = old;
            let found = (up - down) / f64::from(2.0 * h);
            if expected.abs() > 0.02 {
                compared += 1;
                let gap = (found - expected).abs();
                assert!(gap < 0.01 * expected.abs() + 0.002, "{i}: {found} against {expected}");
            }
        }
        assert!(compared > 10, "{compared} gradients are large enough to compare");
    }

    #[test]
    fn a_network_approximates_its_scene_on_any_number_of_threads() {
        let scene = build(TruthCase::TouchAndPart, 0, 600).unwrap();
        let on = |threads: usize, params: FitParams| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fit_hexplane(&scene.source, scene.figure_size, &params).unwrap())
        };
        let fitted = on(2, FitParams { steps: 100, ..params() });
        let few = FitParams { steps: 8, ..params() };
        assert!(on(1, few).network == on(3, few).network, "bit for bit");
        let untrained = on(2, FitParams { steps: 0, ..params() });
        assert!(
            fitted.residual.mean < 0.3 * untrained.residual.mean,
            "{:?} after training, {:?} before",
            fitted.residual,
            untrained.residual
        );
        assert_eq!(fitted.canonical, scene.source.at(0.0).unwrap(), "time 0, bit for bit");
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let scene = build(TruthCase::TouchAndPart, 0, 500).unwrap();
        let bad = FitParams { resolution: 1, ..params() };
        let error = fit_hexplane(&scene.source, 1.0, &bad).unwrap_err().to_string();
        assert!(error.contains("`resolution` is 1"), "{error}");
        assert!(fit_hexplane(&scene.source, 0.0, &params()).is_err(), "no size");
    }
}
