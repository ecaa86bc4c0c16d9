//! [`Optimizer`]: Adam over all parameters of the selected splats.

use crate::{Adam, FitRates};
use gs_core::{RenderGrads, Splats};

/// Which parameters of each row are fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowFlags<'a> {
    /// Any.
    pub selected: &'a [bool],
    /// Of these, opacity only.
    pub fading: &'a [bool],
    /// Of these, colour and opacity only.
    pub frozen: &'a [bool],
    /// Of these, none, unless the row fades.
    pub hidden: &'a [bool],
}

/// One Adam per array of [`Splats`]; rows that are not selected keep their values and moments.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Optimizer {
    pub means: Adam<f32>,
    pub quats: Adam<f32>,
    pub log_scales: Adam<f32>,
    pub opacity_logits: Adam<f32>,
    pub sh: Adam<f32>,
}

impl Optimizer {
    pub(crate) fn new(splats: &Splats) -> Self {
        let n = splats.len();
        Self {
            means: Adam::new(3 * n),
            quats: Adam::new(4 * n),
            log_scales: Adam::new(3 * n),
            opacity_logits: Adam::new(n),
            sh: Adam::new(3 * splats.sh.len()),
        }
    }

    /// All arrays, with their names and numbers of values per splat.
    pub(crate) fn groups(
        &mut self,
        sh_coeffs: usize,
    ) -> [(&'static str, &mut Adam<f32>, usize); 5] {
        [
            ("means", &mut self.means, 3),
            ("quats", &mut self.quats, 4),
            ("log_scales", &mut self.log_scales, 3),
            ("opacity_logits", &mut self.opacity_logits, 1),
            ("sh", &mut self.sh, 3 * sh_coeffs),
        ]
    }

    /// One step of the selected rows among `rows`, the rows of `grads`. `rates.means` is in world
    /// units here. Without `geometry`, only colour and opacity change.
    pub(crate) fn step(
        &mut self,
        splats: &mut Splats,
        (rows, grads): (&[u32], &RenderGrads),
        rates: &FitRates,
        geometry: bool,
        flags: RowFlags,
    ) {
        let RowFlags { selected, fading, frozen, hidden } = flags;
        let all = || rows.iter().enumerate().map(|(i, &row)| [row as usize, i]);
        let visible = || all().filter(|&[row, _]| selected[row] && (fading[row] || !hidden[row]));
        let lasting = || visible().filter(|&[row, _]| !fading[row]);
        let coeffs = splats.sh_coeffs();
        let mut sh_rates = vec![rates.sh / 20.0; 3 * coeffs];
        sh_rates[..3].fill(rates.sh);
        let Splats { means, quats, log_scales, opacity_logits, sh, .. } = splats;
        rayon::scope(|scope| {
            scope.spawn(|_| {
                let grads = grads.v_sh.as_flattened();
                self.sh.step(sh.as_flattened_mut(), grads, &sh_rates, lasting());
            });
            let rate = [rates.opacity_logits];
            self.opacity_logits.step(opacity_logits, &grads.v_opacity_logits, &rate, visible());
            if geometry {
                let moving = || lasting().filter(|&[row, _]| !frozen[row]);
                let (means, v_means) = (means.as_flattened_mut(), grads.v_means.as_flattened());
                self.means.step(means, v_means, &[rates.means; 3], moving());
                let (quats, v_quats) = (quats.as_flattened_mut(), grads.v_quats.as_flattened());
                self.quats.step(quats, v_quats, &[rates.quats; 4], moving());
                let (scales, v_scales) =
                    (log_scales.as_flattened_mut(), grads.v_log_scales.as_flattened());
                self.log_scales.step(scales, v_scales, &[rates.log_scales; 3], moving());
            }
        });
    }

    /// Appends `count` rows with zero moments.
    pub(crate) fn append(&mut self, count: usize, sh_coeffs: usize) {
        for (_, adam, columns) in self.groups(sh_coeffs) {
            adam.m.resize(adam.m.len() + count * columns, 0.0);
            adam.v.resize(adam.v.len() + count * columns, 0.0);
        }
    }

    /// Keeps only the rows whose flag is set.
    pub(crate) fn retain(&mut self, keep: &[bool], sh_coeffs: usize) {
        for (_, adam, columns) in self.groups(sh_coeffs) {
            for moments in [&mut adam.m, &mut adam.v] {
                let mut k = 0;
                moments.retain(|_| {
                    k += 1;
                    keep[(k - 1) / columns]
                });
            }
        }
    }
}
