//! [`expected_changes`]: the colour change of supervised splats of the same surface.

use super::{edited_frame::EditedFrame, params::EvidenceParams, surface::scaled_tone};
use anchors::KdTree;
use gs_core::sh;
use rayon::prelude::*;

/// Supervised splats compared per splat.
const REFERENCES: usize = 24;
/// Weight of the prior β = 1, relative to the references' spread of log-brightness.
const PRIOR: f32 = 0.02;
/// Added to colours under a logarithm.
const DARK: f32 = 0.03;

/// Supervised splats that the edit changed, by position and hue before the edit.
pub(super) struct References {
    pub(super) rows: Vec<usize>,
    /// Features of every splat of frame 1.
    features: Vec<[f64; 6]>,
    tree: Option<KdTree<6>>,
}

impl References {
    pub(super) fn of(
        frame: &EditedFrame<'_>,
        changed: &[bool],
        supervision: &[f32],
        params: &EvidenceParams,
    ) -> Self {
        let EditedFrame { nodes, surface, .. } = *frame;
        let spacing = surface.rigid.typical_spacing(&surface.points);
        let spacing = if spacing > 0.0 { spacing } else { 1e-6 };
        let feature = |i: usize| {
            let [x, y, z] = nodes.means[i].map(|x| x / (3.0 * spacing));
            let [r, g, b] = scaled_tone(nodes.colors[i], params).map(f64::from);
            [x, y, z, r, g, b]
        };
        let features: Vec<[f64; 6]> = (0..changed.len()).map(feature).collect();
        let rows: Vec<usize> = (0..changed.len())
            .filter(|&i| nodes.has_source[i] && changed[i] && supervision[i] > 0.5)
            .collect();
        let points: Vec<[f64; 6]> = rows.iter().map(|&i| features[i]).collect();
        let tree = (!points.is_empty()).then(|| KdTree::<6>::new(&points));
        Self { rows, features, tree }
    }
}

/// Expected change of SH of each row in `rows`, `[K,3]`: that of the nearest references on its
/// surface, excluding the row itself; `None` without references.
///
/// References are near the splat, have a similar normal, move with it and had the same hue before
/// the edit. New base colours are a local power law of the old brightness `b`, per channel
/// `log new = log new̅ + β (log b − log b̅)`. Shading multiplies old and new brightness alike (β =
/// 1, the prior); paint that covers a texture has β = 0. Higher bands get the mean change of the
/// references.
pub(super) fn expected_changes(
    frame: &EditedFrame<'_>,
    rows: &[usize],
    references: &References,
) -> Vec<Option<Vec<[f32; 3]>>> {
    let EditedFrame { nodes, surface, first, old, .. } = *frame;
    let coeffs = first.sh_coeffs();
    let Some(tree) = &references.tree else { return vec![None; rows.len()] };
    let rgb = |sh: [f32; 3]| sh.map(|x| 0.5 + sh::C0 * x);
    rows.par_iter()
        .with_min_len(64)
        .map(|&i| {
            let mut found = Vec::new();
            tree.nearest(&references.features[i], REFERENCES + 1, &mut found);
            found.retain(|neighbor| references.rows[neighbor.id as usize] != i);
            found.truncate(REFERENCES);
            let nearest = found.first()?.distance_squared;
            let mut total = 0.0_f32;
            let mut weighted = Vec::with_capacity(found.len());
            for neighbor in &found {
                let j = references.rows[neighbor.id as usize];
                let together = surface.rigid.between(&surface.points, i, j);
                let near = (-0.5 * (neighbor.distance_squared - nearest)).exp();
                #[expect(clippy::cast_possible_truncation, reason = "weights are single precision")]
                let weight = (near * (together + 1e-3)) as f32 * (nodes.facing(i, j) + 0.05);
                total += weight;
                weighted.push((j, weight));
            }
            if total.is_nan() || total <= 0.0 {
                return None;
            }
            let mut change = vec![[0.0_f32; 3]; coeffs];
            for &(j, weight) in &weighted {
                for (k, sum) in change.iter_mut().enumerate() {
                    let (now, then) = (first.sh_of(j)[k], old[j * coeffs + k]);
                    (0..3).for_each(|c| sum[c] += weight / total * (now[c] - then[c]));
                }
            }
            let mean = |of: &dyn Fn(usize) -> f32| {
                weighted.iter().map(|&(j, w)| w / total * of(j)).sum::<f32>()
            };
            let light = |j: usize| nodes.colors[j][0];
            let light_mean = mean(&light);
            let spread = mean(&|j| (light(j) - light_mean).powi(2));
            for c in 0..3 {
                let new = |j: usize| (rgb(first.sh_of(j)[0])[c].max(0.0) + DARK).ln();
                let new_mean = mean(&new);
                let together = mean(&|j| (light(j) - light_mean) * (new(j) - new_mean));
                let slope = ((together + PRIOR) / (spread + PRIOR)).clamp(0.0, 1.5);
                let value = (new_mean + slope * (light(i) - light_mean)).exp() - DARK;
                change[0][c] = (value - 0.5) / sh::C0 - old[i * coeffs][c];
            }
            change.iter().flatten().all(|x| x.is_finite()).then_some(change)
        })
        .collect()
}
