//! [`Splats`]: a set of 3D Gaussians as a structure of arrays of stored parameters.

use crate::{Real, activation, quat, sh};
use thiserror::Error;

/// `N` Gaussians: stored (pre-activation) parameters as in 3DGS files, `K = (sh_degree + 1)²`.
///
/// Fields are public because every combination of equally long arrays is meaningful;
/// [`Splats::check_shapes`] verifies the lengths where other crates take splats in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Splats<F = f32> {
    /// Centres, world units, `[N,3]`.
    pub means: Vec<[F; 3]>,
    /// Rotations `wxyz`, raw: normalised on use, `[N,4]`. Deformation networks add to the raw
    /// components.
    pub quats: Vec<[F; 4]>,
    /// Natural logarithms of the standard deviations along the local axes, `[N,3]`.
    pub log_scales: Vec<[F; 3]>,
    /// Opacities before the sigmoid, `[N]`.
    pub opacity_logits: Vec<F>,
    /// Spherical-harmonics coefficients, `[N,K,3]`: coefficient-major, RGB innermost, DC first.
    pub sh: Vec<[F; 3]>,
    /// Degree 0–3 of `sh`.
    pub sh_degree: usize,
}

/// The arrays of a [`Splats`] have inconsistent lengths.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SplatsError {
    /// The length of an array does not match `means`.
    #[error("splats: `{field}` has {found} rows, expected {expected} for {num_splats} splats")]
    Shape {
        /// Name of the array.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The length required.
        expected: usize,
        /// Length of `means`.
        num_splats: usize,
    },
    /// SH degrees above 3 are not supported.
    #[error("splats: SH degree {0} is not supported, expected 0 to 3")]
    ShDegree(usize),
}

impl<F: Real> Splats<F> {
    /// No splats; memory for `capacity` is reserved.
    pub fn with_capacity(capacity: usize, sh_degree: usize) -> Self {
        Self {
            means: Vec::with_capacity(capacity),
            quats: Vec::with_capacity(capacity),
            log_scales: Vec::with_capacity(capacity),
            opacity_logits: Vec::with_capacity(capacity),
            sh: Vec::with_capacity(capacity * sh::num_coeffs(sh_degree)),
            sh_degree,
        }
    }

    /// `N`.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// Whether `N` is 0.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// `K`, coefficients per colour channel.
    pub fn sh_coeffs(&self) -> usize {
        sh::num_coeffs(self.sh_degree)
    }

    /// SH coefficients of splat `i`, `[K,3]`.
    ///
    /// # Panics
    /// If `i` is out of range.
    pub fn sh_of(&self, i: usize) -> &[[F; 3]] {
        let coeffs = self.sh_coeffs();
        &self.sh[i * coeffs..(i + 1) * coeffs]
    }

    /// Opacity of splat `i` in (0,1).
    ///
    /// # Panics
    /// If `i` is out of range.
    pub fn opacity(&self, i: usize) -> F {
        activation::sigmoid(self.opacity_logits[i])
    }

    /// Standard deviations of splat `i` along its local axes, world units.
    ///
    /// # Panics
    /// If `i` is out of range.
    pub fn scale(&self, i: usize) -> [F; 3] {
        self.log_scales[i].map(F::exp)
    }

    /// Unit rotation of splat `i`, `wxyz`; zero for a zero quaternion, as in the reference.
    ///
    /// # Panics
    /// If `i` is out of range.
    pub fn rotation(&self, i: usize) -> [F; 4] {
        quat::normalize(self.quats[i])
    }

    /// Verifies that all arrays have the same number of rows.
    ///
    /// # Errors
    /// If lengths differ; names the first such array.
    pub fn check_shapes(&self) -> Result<(), SplatsError> {
        if self.sh_degree > sh::MAX_DEGREE {
            return Err(SplatsError::ShDegree(self.sh_degree));
        }
        let num_splats = self.len();
        let rows = [
            ("quats", self.quats.len(), num_splats),
            ("log_scales", self.log_scales.len(), num_splats),
            ("opacity_logits", self.opacity_logits.len(), num_splats),
            ("sh", self.sh.len(), num_splats * self.sh_coeffs()),
        ];
        for (field, found, expected) in rows {
            if found != expected {
                return Err(SplatsError::Shape { field, found, expected, num_splats });
            }
        }
        Ok(())
    }

    /// The rows `ids`, in that order (repeats allowed).
    ///
    /// # Panics
    /// If an id is out of range.
    #[must_use]
    pub fn select(&self, ids: &[usize]) -> Self {
        let mut out = Self::with_capacity(ids.len(), self.sh_degree);
        for &id in ids {
            out.push_from(self, id);
        }
        out
    }

    /// Appends row `i` of `other`.
    ///
    /// # Panics
    /// If `i` is out of range or the SH degrees differ.
    pub fn push_from(&mut self, other: &Self, i: usize) {
        assert_eq!(
            self.sh_degree, other.sh_degree,
            "splats of different SH degree cannot be mixed"
        );
        self.means.push(other.means[i]);
        self.quats.push(other.quats[i]);
        self.log_scales.push(other.log_scales[i]);
        self.opacity_logits.push(other.opacity_logits[i]);
        self.sh.extend_from_slice(other.sh_of(i));
    }

    /// The same splats with SH cut or zero-padded to `degree`.
    #[must_use]
    pub fn with_sh_degree(&self, degree: usize) -> Self {
        let (old, new) = (self.sh_coeffs(), sh::num_coeffs(degree));
        let mut coeffs = vec![[F::zero(); 3]; self.len() * new];
        for (row, stored) in coeffs.chunks_exact_mut(new).zip(self.sh.chunks_exact(old)) {
            let kept = old.min(new);
            row[..kept].copy_from_slice(&stored[..kept]);
        }
        Self { sh: coeffs, sh_degree: degree, ..self.clone() }
    }

    /// Whether every stored value of row `i` is finite and its quaternion is
    /// not zero. Infinite log-scales and logits that activate to finite values
    /// (`−∞` log-scale, `±∞` logit) count as not finite.
    ///
    /// # Panics
    /// If `i` is out of range.
    pub fn is_finite(&self, i: usize) -> bool {
        let finite = |values: &[F]| values.iter().all(|value| value.is_finite());
        finite(&self.means[i])
            && finite(&self.quats[i])
            && finite(&self.log_scales[i])
            && self.opacity_logits[i].is_finite()
            && self.sh_of(i).iter().all(|rgb| finite(rgb))
            && self.quats[i].iter().any(|&q| q != F::zero())
    }

    /// The same values converted to a different float type.
    pub fn cast<G: Real>(&self) -> Splats<G> {
        let cast = |value: F| G::from_double(value.as_f64());
        Splats {
            means: self.means.iter().map(|row| row.map(cast)).collect(),
            quats: self.quats.iter().map(|row| row.map(cast)).collect(),
            log_scales: self.log_scales.iter().map(|row| row.map(cast)).collect(),
            opacity_logits: self.opacity_logits.iter().map(|&value| cast(value)).collect(),
            sh: self.sh.iter().map(|row| row.map(cast)).collect(),
            sh_degree: self.sh_degree,
        }
    }

    /// Axis-aligned bounding box of the centres `(min, max)`, world
    /// units; `None` if there is no finite centre.
    pub fn bounds(&self) -> Option<([F; 3], [F; 3])> {
        let mut finite =
            self.means.iter().filter(|mean| mean.iter().all(|value| value.is_finite()));
        let first = *finite.next()?;
        Some(finite.fold((first, first), |(mut min, mut max), mean| {
            for axis in 0..3 {
                min[axis] = min[axis].min(mean[axis]);
                max[axis] = max[axis].max(mean[axis]);
            }
            (min, max)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Splats {
        Splats {
            means: vec![[0.0; 3], [1.0, 2.0, 3.0]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; 2],
            log_scales: vec![[0.0; 3]; 2],
            opacity_logits: vec![0.0, 1.0],
            sh: (0_u8..8).map(|i| [f32::from(i); 3]).collect(),
            sh_degree: 1,
        }
    }

    #[test]
    fn shapes_are_checked() {
        let mut splats = two();
        assert!(splats.check_shapes().is_ok(), "well-formed");
        splats.sh.pop();
        let error = splats.check_shapes().unwrap_err().to_string();
        assert!(error.contains("`sh` has 7 rows, expected 8"), "{error}");
    }

    #[test]
    fn degree_changes_pad_or_truncate() {
        let up = two().with_sh_degree(2);
        assert_eq!(up.sh_of(1)[..4], two().sh_of(1)[..], "kept coefficients");
        assert!(up.sh_of(1)[4..].iter().all(|rgb| *rgb == [0.0; 3]), "padding is zero");
        assert_eq!(up.with_sh_degree(1), two(), "cutting the padding gives the original");
    }

    #[test]
    fn select_reorders_all_arrays() {
        let swapped = two().select(&[1, 0]);
        assert_eq!(swapped.means[0], [1.0, 2.0, 3.0], "mean follows");
        assert_eq!(swapped.sh_of(0), two().sh_of(1), "SH follows");
    }
}
