//! Difference between a written cloud and the one read back, independent of row order.

use gs_core::sh::C0;
use gs_core::{Splats, quat};
use rayon::prelude::*;

/// Opacity below which a splat is not drawn.
pub(super) const VISIBLE: f32 = 1.0 / 255.0;

/// Largest differences over all visible splats.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Difference {
    /// Difference of centres, as a share of the scene's size.
    pub(super) position: f32,
    /// Difference of base colours, in steps of 1/255.
    color: f32,
    /// Difference of opacities, in steps of 1/255.
    opacity: f32,
    /// Difference of rotations, radians.
    rotation: f32,
    /// Difference of the logarithms of sizes.
    log_scale: f32,
}

impl Difference {
    pub(super) fn text(self) -> String {
        if self.position == 0.0 && self.color == 0.0 && self.opacity == 0.0 {
            return "none".to_owned();
        }
        format!(
            "positions {:.1e}, colours {:.1}, opacities {:.1}",
            self.position, self.color, self.opacity
        )
    }

    /// Table cells with all differences.
    pub(super) fn columns(self) -> String {
        format!(
            "{:.1e} | {:.2} | {:.2} | {:.3}° | {:.2} %",
            self.position,
            self.color,
            self.opacity,
            self.rotation.to_degrees(),
            100.0 * self.log_scale.exp_m1()
        )
    }

    /// Like [`difference`], after rotating `read` by half a turn about x.
    pub(super) fn of_half_turn(truth: &Splats, read: &Splats) -> Self {
        let mut turned = read.clone();
        turned.means.iter_mut().for_each(|mean| *mean = [mean[0], -mean[1], -mean[2]]);
        difference(truth, &turned)
    }
}

/// Squared distance.
fn distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

fn nearest(splats: &Splats, mean: &[f32; 3]) -> usize {
    (0..splats.len())
        .min_by(|&a, &b| {
            distance(&splats.means[a], mean).total_cmp(&distance(&splats.means[b], mean))
        })
        .unwrap_or_default()
}

/// Rows of `truth` with a counterpart in `read`; of several rows with the same nearest splat, only
/// the nearest.
pub(super) fn paired(truth: &Splats, read: &Splats) -> Vec<usize> {
    if read.is_empty() {
        return Vec::new();
    }
    let found: Vec<usize> = truth.means.par_iter().map(|mean| nearest(read, mean)).collect();
    let mut best: Vec<Option<usize>> = vec![None; read.len()];
    for (row, &at) in found.iter().enumerate() {
        let apart = |row: usize| distance(&truth.means[row], &read.means[at]);
        if best[at].is_none_or(|other| apart(row) < apart(other)) {
            best[at] = Some(row);
        }
    }
    best.into_iter().flatten().collect()
}

/// Compares every visible splat of `truth` with the nearest splat of `read`.
pub(super) fn difference(truth: &Splats, read: &Splats) -> Difference {
    let (min, max) = truth.bounds().unwrap_or_default();
    let size = (0..3).map(|axis| max[axis] - min[axis]).fold(f32::MIN_POSITIVE, f32::max);
    let one = |row: usize| {
        let mean = &truth.means[row];
        let nearest = nearest(read, mean);
        let dc = |splats: &Splats, row: usize| splats.sh_of(row)[0];
        let (a, b) = (dc(truth, row), dc(read, nearest));
        // Every format clips colours outside the displayable range.
        let shown = |dc: f32| (0.5 + C0 * dc).clamp(0.0, 1.0);
        Difference {
            position: distance(&read.means[nearest], mean).sqrt() / size,
            color: (0..3).map(|k| 255.0 * (shown(a[k]) - shown(b[k])).abs()).fold(0.0, f32::max),
            opacity: 255.0 * (truth.opacity(row) - read.opacity(nearest)).abs(),
            rotation: {
                let turn = |splats: &Splats, row: usize| quat::normalize(splats.quats[row]);
                let (a, b) = (turn(truth, row), turn(read, nearest));
                // Chord of the half angle: exact where the angle is small.
                let chord = |sign: f32| (0..4).map(|k| (a[k] - sign * b[k]).powi(2)).sum::<f32>();
                4.0 * (0.5 * chord(1.0).min(chord(-1.0)).sqrt()).asin()
            },
            log_scale: {
                let (a, b) = (truth.log_scales[row], read.log_scales[nearest]);
                (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max)
            },
        }
    };
    (0..truth.len()).into_par_iter().filter(|&row| truth.opacity(row) >= VISIBLE).map(one).reduce(
        Difference::default,
        |a, b| Difference {
            position: a.position.max(b.position),
            color: a.color.max(b.color),
            opacity: a.opacity.max(b.opacity),
            rotation: a.rotation.max(b.rotation),
            log_scale: a.log_scale.max(b.log_scale),
        },
    )
}
