//! [`Subset`]: the splats that part of a picture depends on, and their gradients.

use gs_core::{RenderGrads, Splats};
use rayon::prelude::*;

/// Rows copied per task.
const CHUNK: usize = 2048;

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
        copy(&mut own.means, &splats.means, 1, rows);
        copy(&mut own.quats, &splats.quats, 1, rows);
        copy(&mut own.log_scales, &splats.log_scales, 1, rows);
        copy(&mut own.opacity_logits, &splats.opacity_logits, 1, rows);
        copy(&mut own.sh, &splats.sh, splats.sh_coeffs(), rows);
    }
}

/// Copies `rows` of an array with `columns` elements per row.
fn copy<T: Copy + Default + Send + Sync>(
    target: &mut Vec<T>,
    source: &[T],
    columns: usize,
    rows: &[u32],
) {
    target.resize(rows.len() * columns, T::default());
    target.par_chunks_mut(CHUNK * columns).zip(rows.par_chunks(CHUNK)).for_each(
        |(target, rows)| {
            for (target, &row) in target.chunks_exact_mut(columns).zip(rows) {
                target.copy_from_slice(&source[row as usize * columns..][..columns]);
            }
        },
    );
}
