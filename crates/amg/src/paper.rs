//! The paper's method as printed: anchors on both clouds, unbalanced transport, nearest matched
//! anchor, Mahalanobis weights.

use crate::AmgError;
use crate::guide_input::ProgressFn;
use crate::options::{AnchorSampling, PaperParams};
use crate::report::{MotionReport, TransportReport};
use crate::row_index::index;
use anchors::AnchorSet;
use gs_core::{Real, Splats, quat};
use rayon::prelude::*;
use uot::{Bandwidth, SinkhornParams, UotProblem, WelschParams};

/// An edited anchor whose best partner has a Welsch weight below this (farther than 2.8 β) is
/// counted as unmatched.
const MATCHED: f64 = 0.02;

/// For each row of `rows`, sources of `pool` and weights (Eqs. 5–10, 21–22). Empty lists if there
/// are no anchors.
pub(crate) fn bind(
    source: &Splats,
    pool: &[usize],
    edited: &Splats,
    rows: &[usize],
    params: &PaperParams,
    report: &mut MotionReport,
    progress: ProgressFn<'_>,
) -> Result<Vec<Vec<(u32, f32)>>, AmgError> {
    if pool.is_empty() || rows.is_empty() {
        return Ok(vec![Vec::new(); rows.len()]);
    }
    let points = |splats: &Splats, ids: &[usize]| -> Vec<[f64; 3]> {
        ids.iter().map(|&i| splats.means[i].map(f64::from)).collect()
    };
    let (source_points, edited_points) = (points(source, pool), points(edited, rows));
    progress("anchors", 0.0);
    let (src, edit) = match params.sampling {
        AnchorSampling::Lines => {
            AnchorSet::of_pair(&source_points, &edited_points, &params.anchors)?
        }
        AnchorSampling::FarthestPoints => {
            params.anchors.validate()?;
            let sample = |points: &[[f64; 3]]| {
                AnchorSet::farthest(points, points.len().div_ceil(params.anchors.k + 1))
            };
            (sample(&source_points)?, sample(&edited_points)?)
        }
    };
    report.anchors = [src.len(), edit.len()];
    if src.is_empty() || edit.is_empty() {
        report.warnings.push("no anchors could be built: edited splats do not move".to_owned());
        return Ok(vec![Vec::new(); rows.len()]);
    }
    progress("transport", 0.0);
    let partner = correspond(&src, &edit, params, report)?;
    let source_owners = src.owners_or_nearest(&source_points)?;
    let edited_owners = edit.owners_or_nearest(&edited_points)?;
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); src.len()];
    for (i, &owner) in source_owners.iter().enumerate() {
        members[owner as usize].push(index(pool[i]));
    }
    for members in &mut members {
        members.sort_unstable();
    }
    Ok(rows
        .par_iter()
        .zip(&edited_owners)
        .with_min_len(256)
        .map(|(&row, &owner)| {
            let sources = &members[partner[owner as usize] as usize];
            mahalanobis_weights(source, sources, edited.means[row])
        })
        .collect())
}

/// Source anchor of every edited anchor: argmax of the transport plan's column.
fn correspond(
    src: &AnchorSet,
    edit: &AnchorSet,
    params: &PaperParams,
    report: &mut MotionReport,
) -> Result<Vec<u32>, AmgError> {
    let welsch = WelschParams {
        bandwidth: Bandwidth::MedianTimes(params.gamma),
        cutoff: params.cutoff,
        ..WelschParams::default()
    };
    let problem = UotProblem::welsch(&src.positions, &edit.positions, &welsch)?;
    let [lambda_ent, lambda_a, lambda_b] = params.lambdas;
    let PaperParams { tol, max_sweeps, .. } = *params;
    let sinkhorn = SinkhornParams {
        lambda_ent,
        lambda_a,
        lambda_b,
        tol,
        max_sweeps,
        ..SinkhornParams::default()
    };
    let out = uot::solve(&problem, &sinkhorn)?;
    let scale = problem.scale();
    report.transport = Some(TransportReport {
        converged: out.converged,
        sweeps: out.sweeps,
        residual: out.residuals.last().copied().unwrap_or(0.0),
        d_med: scale.and_then(|scale| scale.median).map_or(0.0, |median| median.value),
        beta: scale.map_or(0.0, |scale| scale.beta),
        total_mass: out.total_mass,
    });
    if !out.converged {
        report.warnings.push(format!(
            "transport did not converge in {} sweeps (residual {:.1e})",
            out.sweeps,
            out.residuals.last().copied().unwrap_or(f64::NAN)
        ));
    }
    let found = out.correspondence(&problem)?;
    report.unmatched_anchors = found.w_best.iter().filter(|&&w| w <= MATCHED).count();
    Ok(found.rows)
}

/// Eq. 10 in the log domain, relative to the best source; otherwise the weights of an edited splat
/// a few standard deviations off underflow. Standard deviations are at least a millionth of the
/// offset.
fn mahalanobis_weights(source: &Splats, ids: &[u32], x: [f32; 3]) -> Vec<(u32, f32)> {
    let logs: Vec<f64> = ids
        .iter()
        .map(|&id| {
            let i = id as usize;
            let offset = [0, 1, 2].map(|a| f64::from(x[a]) - f64::from(source.means[i][a]));
            let length = offset.iter().map(|c| c * c).sum::<f64>().sqrt();
            let q = quat::normalize(source.quats[i].map(f64::from));
            let local = quat::rotate(quat::conjugate(q), offset);
            let scale = source.scale(i);
            let squared: f64 = (0..3)
                .map(|a| local[a] / f64::from(scale[a]).max(1e-6 * length).max(f64::MIN_POSITIVE))
                .map(|z| z * z)
                .sum();
            let log = f64::from(source.opacity(i)).max(1e-12).ln() - 0.5 * squared;
            if log.is_finite() { log } else { f64::MIN }
        })
        .collect();
    let best = logs.iter().copied().fold(f64::MIN, f64::max);
    ids.iter()
        .zip(&logs)
        .map(|(&id, log)| (id, (log - best).exp().as_f32()))
        .filter(|(_, weight)| *weight > 0.0)
        .collect()
}
