//! [`Subset`]: the splats that part of a picture depends on, and their gradients.

use gs_core::{RenderGrads, Splats};

/// Copies of some rows. A fit changes only a part of a picture; splats that do not reach that part
/// are not rendered. Memory is reused.
#[derive(Debug, Clone, Default)]
pub(crate) struct Subset {
    /// The copies, in the order of the rows.
    pub splats: Splats,
    /// Gradients of the copies.
    pub grads: RenderGrads,
}

impl Subset {
    /// Copies `rows` of `splats`.
    pub(crate) fn gather(&mut self, splats: &Splats, rows: &[u32]) {
        let own = &mut self.splats;
        own.sh_degree = splats.sh_degree;
        own.means.clear();
        own.quats.clear();
        own.log_scales.clear();
        own.opacity_logits.clear();
        own.sh.clear();
        for &row in rows {
            own.push_from(splats, row as usize);
        }
    }

    /// Writes the gradients of the copies of `rows` to those rows of `all`, which is resized to
    /// `count` rows with `coeffs` SH coefficients. Other rows have undefined values.
    pub(crate) fn scatter(&self, rows: &[u32], all: &mut RenderGrads, count: usize, coeffs: usize) {
        all.v_means.resize(count, [0.0; 3]);
        all.v_quats.resize(count, [0.0; 4]);
        all.v_log_scales.resize(count, [0.0; 3]);
        all.v_opacity_logits.resize(count, 0.0);
        all.v_sh.resize(count * coeffs, [0.0; 3]);
        all.v_means2d.resize(count, [0.0; 2]);
        let own = &self.grads;
        for (i, &row) in rows.iter().enumerate() {
            let row = row as usize;
            all.v_means[row] = own.v_means[i];
            all.v_quats[row] = own.v_quats[i];
            all.v_log_scales[row] = own.v_log_scales[i];
            all.v_opacity_logits[row] = own.v_opacity_logits[i];
            all.v_means2d[row] = own.v_means2d[i];
            all.v_sh[row * coeffs..(row + 1) * coeffs]
                .copy_from_slice(&own.v_sh[i * coeffs..(i + 1) * coeffs]);
        }
    }
}
