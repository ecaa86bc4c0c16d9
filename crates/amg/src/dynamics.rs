//! Split of the source into moving and static splats, and size of the moving object.

use crate::AmgError;
use crate::coherence::keep_coherent;
use crate::keyframes::KeyFrames;
use crate::options::DynamicParams;
use crate::pose::robust_diameter;

/// Split of the source into moving and static splats.
///
/// In order of precedence: the user's mask or box; the scene's own mask; motion. By motion, a splat
/// is dynamic if its maximum displacement over the key times exceeds a threshold. The threshold is
/// the minimum between the two modes of the distribution of log-displacements, of the static and
/// the moving population (Otsu). It is accepted only if both populations contain at least 0.1 % of
/// the splats, the typical moving splat moves at least 8 times as far as the typical static splat,
/// and the valley is below 0.5 % of the scene's size: deformation networks also displace static
/// splats, but by less than that. Without such a valley, every splat that moves by more than 0.2 %
/// of the scene's size is dynamic. Splats whose motion their neighbours do not share are then made
/// static (see [`DynamicParams::coherent`]).
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicSplit {
    /// Whether each source splat moves, `[N]`.
    pub dynamic: Vec<bool>,
    /// Displacement above which a splat counts as moving, world units; 0 if a mask was used.
    pub threshold: f64,
    /// Diameter of the ball around the mean of the dynamic splats that contains 92 % of them, at
    /// the edit frame, world units.
    pub figure_size: f64,
}

impl DynamicSplit {
    pub(crate) fn of(
        keys: &KeyFrames,
        scene_mask: Option<&[bool]>,
        params: &DynamicParams,
    ) -> Result<Self, AmgError> {
        let num = keys.at_edit.len();
        let (mut dynamic, threshold) = match scene_mask {
            Some(mask) if mask.len() != num => {
                return Err(AmgError::Mask { found: mask.len(), expected: num });
            }
            Some(mask) => (mask.to_vec(), 0.0),
            None => {
                let amplitudes = amplitudes(keys);
                let threshold = params.threshold.map_or_else(
                    || automatic_threshold(&amplitudes, &keys.broken, size(keys, |_| true)),
                    f64::from,
                );
                let mut dynamic: Vec<bool> = amplitudes.iter().map(|&a| a > threshold).collect();
                if params.coherent {
                    keep_coherent(keys, &mut dynamic);
                }
                (dynamic, threshold)
            }
        };
        for (dynamic, broken) in dynamic.iter_mut().zip(&keys.broken) {
            *dynamic &= !broken;
        }
        let figure_size = size(keys, |i| dynamic[i]);
        Ok(Self { dynamic, threshold, figure_size })
    }
}

/// Largest displacement of each source over the key times.
fn amplitudes(keys: &KeyFrames) -> Vec<f64> {
    (0..keys.at_edit.len())
        .map(|i| {
            (0..keys.times.len()).fold(0.0_f64, |largest, k| {
                let d = keys.displacement(k, i);
                largest.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            })
        })
        .map(f64::sqrt)
        .collect()
}

/// Size of the splats selected by `of`, see [`robust_diameter`].
fn size(keys: &KeyFrames, of: impl Fn(usize) -> bool) -> f64 {
    let rows = (0..keys.at_edit.len()).filter(|&i| !keys.broken[i] && of(i));
    robust_diameter(&rows.map(|i| keys.at_edit.means[i].map(f64::from)).collect::<Vec<_>>())
}

fn automatic_threshold(amplitudes: &[f64], broken: &[bool], size: f64) -> f64 {
    const BINS: usize = 96;
    const DECADES_BELOW: f64 = 6.0;
    let fallback = 2e-3 * size;
    if size <= 0.0 {
        return 0.0;
    }
    // Bins over log10(amplitude / size) in [−6, 0]; smaller amplitudes fall into the first bin.
    let bin_of = |a: f64| {
        let decade = (a / size).max(1e-12).log10().clamp(-DECADES_BELOW, -1e-9);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the last bin"
        )]
        let bin = ((BINS - 1) as f64 * ((decade + DECADES_BELOW) / DECADES_BELOW)).round() as usize;
        bin
    };
    let mut histogram = [0.0_f64; BINS];
    for (a, _) in amplitudes.iter().zip(broken).filter(|(_, broken)| !**broken) {
        histogram[bin_of(*a)] += 1.0;
    }
    let total: f64 = histogram.iter().sum();
    let sum: f64 = histogram.iter().enumerate().map(|(bin, n)| bin as f64 * n).sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, (0.0, 0, 0.0));
    for cut in 0..BINS - 1 {
        below += histogram[cut];
        sum_below += cut as f64 * histogram[cut];
        let above = total - below;
        if below < 1e-3 * total || above < 1e-3 * total {
            continue;
        }
        let gap = (sum - sum_below) / above - sum_below / below;
        let between = below * above * gap * gap;
        if between > best.0 {
            best = (between, cut, gap);
        }
    }
    let ratio = 10.0_f64.powf(best.2 * DECADES_BELOW / (BINS - 1) as f64);
    let valley = (best.1 as f64 + 0.5) / (BINS - 1) as f64;
    let share = 10.0_f64.powf(DECADES_BELOW * (valley - 1.0));
    // A higher valley separates slow from fast motion.
    if best.0 == 0.0 || ratio < 8.0 || share > 5e-3 { fallback } else { share * size }
}
