//! [`Working`]: the splats of a running fit, and the state of each row.

use crate::alignment::Aligning;
use crate::optimizer::Optimizer;
use crate::votes::Votes;
use gs_core::{Splats, activation, nearest_rank, quat};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Value of [`Working::source`] for new splats.
pub(crate) const NEW: u32 = u32::MAX;

/// Splats below this opacity are removed at every densification, as in 3DGS.
pub(crate) const FAINT: f32 = 0.005;
/// Largest share of the selection that is cloned or split at once.
const DENSIFIED_SHARE: f64 = 0.125;
/// Mean gradient norm of the projected centre, per half image size, above which a splat is cloned
/// or split, as in 3DGS.
const GRADIENT: f32 = 2e-4;
/// Splats whose largest standard deviation exceeds this many splat sizes are split, smaller ones
/// cloned.
const LARGE: f32 = 2.0;
/// Factor by which a split divides the scales, as in 3DGS.
const SPLIT: f32 = 1.6;
/// Splats do not grow beyond this many splat sizes, unless they were larger at the start.
const HUGE: f32 = 30.0;

/// Splats and their state; all arrays have one row per splat, unless noted.
#[derive(Debug, Clone)]
pub(crate) struct Working {
    pub splats: Splats,
    /// Logarithm of the largest scale at the start, or when the splat was added.
    pub largest: Vec<f32>,
    /// Row of the start, or [`NEW`].
    pub source: Vec<u32>,
    /// Whether the fit may change the row.
    pub selected: Vec<bool>,
    /// Rows of the start that are or were selected, one flag per splat of the start.
    pub chosen: Vec<bool>,
    /// Whether some pictures show the background of the splat. At first only its opacity is fitted,
    /// so that it fades instead of taking the colour of the background.
    pub fading: Vec<bool>,
    /// Whether colours alone explain the pictures of the splat: means, quaternions and scales keep
    /// their bits.
    pub frozen: Vec<bool>,
    /// Whether other splats hide the splat in all pictures: it keeps its bits, unless it fades.
    pub hidden: Vec<bool>,
    /// Sum of gradient norms of the projected centre since the last densification.
    pub gradient: Vec<f32>,
    /// Number of steps since then in which the splat was visible.
    pub num_visible_steps: Vec<u32>,
    pub optimizer: Optimizer,
    /// How the pictures are aligned.
    pub aligning: Aligning,
    /// Median size of the selected splats at the start, world units.
    pub size: f32,
}

impl Working {
    pub(crate) fn new(start: &Splats, selected: Vec<bool>) -> Self {
        let n = start.len();
        let mut sizes: Vec<f32> = (0..n)
            .filter(|&i| selected[i])
            .map(|i| (start.log_scales[i].iter().sum::<f32>() / 3.0).exp())
            .filter(|size| size.is_finite())
            .collect();
        Self {
            splats: start.clone(),
            largest: (0..n).map(|i| largest(start, i)).collect(),
            source: (0..n).map(|i| u32::try_from(i).unwrap_or(NEW)).collect(),
            chosen: selected.clone(),
            fading: vec![false; n],
            frozen: vec![false; n],
            hidden: vec![false; n],
            gradient: vec![0.0; n],
            num_visible_steps: vec![0; n],
            optimizer: Optimizer::new(start),
            aligning: Aligning::Local,
            size: nearest_rank(&mut sizes, 0.5).unwrap_or(1.0),
            selected,
        }
    }

    /// Indices of the selected rows.
    pub(crate) fn rows(&self) -> Vec<usize> {
        (0..self.selected.len()).filter(|&i| self.selected[i]).collect()
    }

    /// Bounds the scales of selected rows.
    pub(crate) fn limit_scales(&mut self) {
        let huge = (HUGE * self.size).ln();
        for (i, log_scales) in self.splats.log_scales.iter_mut().enumerate() {
            if self.selected[i] && !self.frozen[i] && !self.hidden[i] {
                let most = huge.max(self.largest[i]);
                *log_scales = log_scales.map(|log_scale| log_scale.min(most));
            }
        }
    }

    /// Removes selected rows with an opacity below `faint`.
    pub(crate) fn prune_faint(&mut self, faint: f32) {
        self.prune(&vec![false; self.selected.len()], faint);
    }

    /// Removes selected rows that are flagged, have an opacity below `faint`, or are not finite.
    /// Returns the number of removed rows.
    pub(crate) fn prune(&mut self, gone: &[bool], faint: f32) -> usize {
        let faint = activation::logit(faint);
        let keep: Vec<bool> = (0..self.selected.len())
            .map(|i| {
                !self.selected[i]
                    || (!gone[i]
                        && self.splats.opacity_logits[i] >= faint
                        && self.splats.is_finite(i))
            })
            .collect();
        let removed = keep.iter().filter(|keep| !**keep).count();
        if removed > 0 {
            self.retain(&keep);
        }
        removed
    }

    fn retain(&mut self, keep: &[bool]) {
        let ids: Vec<usize> = (0..keep.len()).filter(|&i| keep[i]).collect();
        self.optimizer.retain(keep, self.splats.sh_coeffs());
        self.splats = self.splats.select(&ids);
        self.largest = ids.iter().map(|&i| self.largest[i]).collect();
        self.source = ids.iter().map(|&i| self.source[i]).collect();
        self.selected = ids.iter().map(|&i| self.selected[i]).collect();
        self.fading = ids.iter().map(|&i| self.fading[i]).collect();
        self.frozen = ids.iter().map(|&i| self.frozen[i]).collect();
        self.hidden = ids.iter().map(|&i| self.hidden[i]).collect();
        self.gradient = ids.iter().map(|&i| self.gradient[i]).collect();
        self.num_visible_steps = ids.iter().map(|&i| self.num_visible_steps[i]).collect();
    }

    /// Clones small and splits large selected splats whose projected centres have the largest
    /// gradients; the new rows come last. Returns the number of new rows.
    pub(crate) fn densify(&mut self, seed: u64) -> usize {
        let mean = |i: usize| self.gradient[i] / self.num_visible_steps[i].max(1) as f32;
        let mut pulled: Vec<usize> = self
            .rows()
            .into_iter()
            .filter(|&i| {
                mean(i) > GRADIENT && !self.fading[i] && !self.frozen[i] && !self.hidden[i]
            })
            .collect();
        pulled.sort_by(|&a, &b| mean(b).total_cmp(&mean(a)).then(a.cmp(&b)));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count"
        )]
        let most = (self.rows().len() as f64 * DENSIFIED_SHARE).ceil() as usize;
        pulled.truncate(most);
        let mut rng = Pcg64::seed_from_u64(seed);
        for &i in &pulled {
            let (centre, scale) = (self.splats.means[i], self.splats.scale(i));
            let rotation = self.splats.rotation(i);
            let mut drawn = |spread: f32| {
                let offset = quat::rotate(rotation, scale.map(|s| spread * s * normal(&mut rng)));
                [0, 1, 2].map(|k| centre[k] + offset[k])
            };
            let is_large = scale.iter().copied().fold(0.0, f32::max) > LARGE * self.size;
            let places = if is_large { [drawn(1.0), drawn(1.0)] } else { [centre, drawn(0.5)] };
            if is_large {
                for log_scale in &mut self.splats.log_scales[i] {
                    *log_scale -= SPLIT.ln();
                }
                self.largest[i] = largest(&self.splats, i);
            }
            self.push_copy(i);
            for (row, place) in [i, self.splats.len() - 1].into_iter().zip(places) {
                self.splats.means[row] = place;
            }
        }
        self.gradient.fill(0.0);
        self.num_visible_steps.fill(0);
        pulled.len()
    }

    fn push_copy(&mut self, i: usize) {
        let copy = self.splats.select(&[i]);
        self.splats.push_from(&copy, 0);
        self.largest.push(self.largest[i]);
        self.source.push(NEW);
        self.selected.push(true);
        self.fading.push(false);
        self.frozen.push(false);
        self.hidden.push(false);
        self.gradient.push(0.0);
        self.num_visible_steps.push(0);
        self.optimizer.append(1, self.splats.sh_coeffs());
    }

    /// Selects rows that are now mainly visible in the masks. Returns the number of new selected
    /// rows.
    pub(crate) fn select_more(&mut self, votes: &Votes, share: f32) -> usize {
        let mut count = 0;
        for i in 0..self.selected.len() {
            if !self.selected[i] && votes.share(i) > share && votes.seen[i] > 1.0 {
                self.selected[i] = true;
                if let Some(chosen) = self.chosen.get_mut(self.source[i] as usize) {
                    *chosen = true;
                }
                count += 1;
            }
        }
        count
    }
}

/// Logarithm of the largest scale.
fn largest(splats: &Splats, i: usize) -> f32 {
    splats.log_scales[i].iter().copied().fold(f32::NEG_INFINITY, f32::max)
}

/// Standard normal.
fn normal(rng: &mut Pcg64) -> f32 {
    let (u, v) = (rng.random(), rng.random());
    gs_core::standard_normal(u, v)
}
