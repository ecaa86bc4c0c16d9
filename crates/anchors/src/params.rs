//! Settings of anchor construction.

use crate::AnchorError;

/// How points are grouped in neighbourhoods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// A partition: no point is in two neighbourhoods (the paper's "disjoint local neighborhoods").
    #[default]
    Disjoint,
    /// One neighbourhood per point, itself and its k nearest; equal member sets are kept once.
    Overlapping,
}

/// Radius δ of the cylinder that must contain a neighbourhood.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Radius {
    /// `radius_factor` × mean member distance over all neighbourhoods. One radius for the cloud,
    /// so that neighbourhoods wider than the typical one (outliers) are rejected.
    #[default]
    Global,
    /// `radius_factor` × mean member distance, for each neighbourhood separately.
    Local,
    /// A fixed radius, world units; above 0.
    Fixed(f64),
}

/// Settings of anchor construction; `Default` has the paper's values where the paper states them.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorParams {
    /// Number of nearest neighbours that form a neighbourhood with a point. Default 2: triples
    /// (supplement, Anchor Construction). With 0 every point is an anchor. At most 64.
    pub k: usize,
    /// Partition or overlapping neighbourhoods. Default [`Grouping::Disjoint`].
    pub grouping: Grouping,
    /// A disjoint neighbourhood is rejected when its mean edge exceeds this many times the median
    /// over the first round's candidates. At least 1; `f64::INFINITY` disables the test. Default 4.
    pub max_edge_ratio: f64,
    /// Weight α of the optional per-point features: they are scaled by α·h, h being
    /// [`median_spacing`](crate::median_spacing). At least 0. Default 3.
    pub feature_weight: f64,
    /// Rule for the cylinder radius δ. Default [`Radius::Global`].
    pub radius: Radius,
    /// δ in units of the mean member distance. Positive. Default √3/2 (below Eq. 6).
    pub radius_factor: f64,
    /// Number of lines sampled through the bounding sphere. Default 300 000 (supplement, Anchor
    /// Construction). Used by the one-call constructors; [`Lines::sample`](crate::Lines::sample)
    /// takes the number directly.
    pub num_lines: usize,
    /// Random seed of the lines. Default 0. Used by the one-call constructors.
    pub seed: u64,
}

/// Maximum supported `k`; neighbourhoods are intended to be small.
pub(crate) const MAX_K: usize = 64;

impl Default for AnchorParams {
    fn default() -> Self {
        Self {
            k: 2,
            grouping: Grouping::Disjoint,
            max_edge_ratio: 4.0,
            feature_weight: 3.0,
            radius: Radius::Global,
            radius_factor: 0.75_f64.sqrt(),
            num_lines: 300_000,
            seed: 0,
        }
    }
}

impl AnchorParams {
    /// Checks every field against its documented range.
    ///
    /// # Errors
    /// [`AnchorError::BadParam`] names the first field out of range.
    pub fn validate(&self) -> Result<(), AnchorError> {
        let bad = |name, value, expected| Err(AnchorError::BadParam { name, value, expected });
        if self.k > MAX_K {
            return bad("k", self.k as f64, "at most 64");
        }
        if self.max_edge_ratio.is_nan() || self.max_edge_ratio < 1.0 {
            return bad("max_edge_ratio", self.max_edge_ratio, "at least 1 (infinity allowed)");
        }
        if !(0.0..1e50).contains(&self.feature_weight) {
            return bad("feature_weight", self.feature_weight, "a finite number, at least 0");
        }
        if !(self.radius_factor > 0.0 && self.radius_factor < 1e50) {
            return bad("radius_factor", self.radius_factor, "a positive finite number");
        }
        if let Radius::Fixed(delta) = self.radius
            && !(delta > 0.0 && delta < 1e50)
        {
            return bad("radius", delta, "a positive finite number");
        }
        if self.num_lines >= u32::MAX as usize {
            return bad("num_lines", self.num_lines as f64, "below 2^32 - 1");
        }
        Ok(())
    }
}
