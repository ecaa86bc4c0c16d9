//! Operations of every form of the Gibbs kernel.

/// `ln(K e^x)` and `ln(Kᵀ e^x)`. Vectors are in the kernel's own order; entries of x may be −∞ but
/// not all of them. A row or column without pairs gives −∞.
pub(crate) trait Kernel: Send {
    /// `out_i = ln Σ_j K_ij e^{x_j}`, x `[m]`, out `[n]`.
    fn rows(&mut self, x: &[f64], out: &mut [f64]);
    /// `out_j = ln Σ_i K_ij e^{x_i}`, x `[n]`, out `[m]`.
    fn cols(&mut self, x: &[f64], out: &mut [f64]);
}

/// Rows or leaves per parallel task: at most 128 tasks, on any machine, so that sums keep their
/// order.
pub(super) fn chunk_len(count: usize, min: usize) -> usize {
    count.div_ceil(128).max(min)
}

pub(super) fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}
