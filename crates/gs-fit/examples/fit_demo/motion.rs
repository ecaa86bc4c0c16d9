//! Motion of a fitted edit: end-point error after propagation, compared with that of the true
//! edited splats. Splats are weighted by their contribution to the pictures: splats hidden in all
//! pictures cannot be fitted, and are not visible.

use amg::{MotionOptions, propagate};
use gs_core::{Camera, DynamicScene, Splats, quat};
use gs_fit::votes::Votes;
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{EditedFrame, SynthScene, Tag, Truth};
use rayon::prelude::*;
use std::collections::HashSet;
use std::error::Error;
use std::sync::Arc;

/// Times at which positions are compared.
const TIMES: usize = 9;

/// Weighted mean and 95th percentile of the end-point error of splats, % of the figure's size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EndPoints {
    pub mean: f64,
    pub p95: f64,
    pub count: usize,
    /// Share of the weight of splats that coincide with a source splat and follow it exactly, %.
    pub kept: f64,
}

/// Errors of the edited splats of the true frame, and of those made by a fit, both propagated with
/// the defaults.
pub(crate) fn end_points(
    scene: &SynthScene,
    edit: &EditedFrame,
    (fitted, is_fitted): (&Splats, &[bool]),
    cameras: &[Camera],
) -> Result<[EndPoints; 2], Box<dyn Error>> {
    let tags = &edit.truth.tags;
    let is_edited: Vec<bool> =
        (0..tags.len()).map(|i| edit.truth.eval_mask[i] && tags[i] != Tag::Unchanged).collect();
    Ok([
        error_of(scene, &edit.truth, (&edit.splats, &is_edited), cameras)?,
        error_of(scene, &edit.truth, (fitted, is_fitted), cameras)?,
    ])
}

/// Error of the rows of `scored`. The true motion of a splat is the rigid motion of the nearest
/// true splat of frame 1.
fn error_of(
    scene: &SynthScene,
    truth: &Truth,
    (splats, scored): (&Splats, &[bool]),
    cameras: &[Camera],
) -> Result<EndPoints, Box<dyn Error>> {
    let source: Arc<dyn DynamicScene> = Arc::new(scene.clone());
    let found = propagate(source, Arc::new(splats.clone()), &MotionOptions::default(), &|_, _| {})?;
    let first = truth.at(0.0)?;
    let candidates: Vec<usize> = (0..first.len()).filter(|&i| truth.eval_mask[i]).collect();
    let rows: Vec<usize> = (0..splats.len()).filter(|&i| scored[i]).collect();
    let squared = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>();
    let nearest: Vec<usize> = rows
        .par_iter()
        .map(|&row| {
            let distance = |&&i: &&usize| squared(first.means[i], splats.means[row]);
            let closest = candidates.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            closest.copied().unwrap_or(0)
        })
        .collect();
    let masks: Vec<Vec<bool>> =
        cameras.iter().map(|c| vec![false; (c.width * c.height) as usize]).collect();
    let views = cameras.iter().zip(masks.iter().map(Vec::as_slice));
    let weights = Votes::of(&CpuRasterizer::default(), splats, views)?.seen;
    let places: HashSet<[u32; 3]> =
        scene.frame1().means.iter().map(|mean| mean.map(f32::to_bits)).collect();
    let weight = |keep: &dyn Fn(usize) -> bool| -> f64 {
        rows.iter().filter(|&&row| keep(row)).map(|&row| f64::from(weights[row])).sum()
    };
    let kept = weight(&|row| places.contains(&splats.means[row].map(f32::to_bits)));
    let kept = 100.0 * kept / weight(&|_| true);
    let mut errors = Vec::new();
    for t in truth.time_range().frames(TIMES).into_iter().skip(1) {
        let (ours, theirs) = (found.scene.at(t)?, truth.at(t)?);
        for (&row, &i) in rows.iter().zip(&nearest) {
            let turn = quat::mul(
                quat::normalize(theirs.quats[i]),
                quat::conjugate(quat::normalize(first.quats[i])),
            );
            let offset = [0, 1, 2].map(|k| splats.means[row][k] - first.means[i][k]);
            let offset = quat::rotate(turn, offset);
            let place = [0, 1, 2].map(|k| theirs.means[i][k] + offset[k]);
            let error = f64::from(squared(ours.means[row], place).sqrt());
            errors.push((error, f64::from(weights[row])));
        }
    }
    let to_percent = 100.0 / f64::from(truth.figure_size());
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = errors.iter().map(|(_, weight)| weight).sum();
    let mean = errors.iter().map(|(error, weight)| error * weight).sum::<f64>() / total;
    let mut below = 0.0;
    let p95 = errors.iter().find(|(_, weight)| {
        below += weight;
        below >= 0.95 * total
    });
    let p95 = p95.map_or(0.0, |(error, _)| *error);
    Ok(EndPoints { mean: to_percent * mean, p95: to_percent * p95, count: rows.len(), kept })
}
