//! Settings of anchor construction.

use crate::AnchorError;

/// How points are gathered into neighbourhoods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// A partition: no point is in two neighbourhoods (the paper's "disjoint local neighborhoods").
    #[default]
    Disjoint,
    /// One neighbourhood per point, itself and its k nearest; equal member sets are kept once.
    Overlapping,
}

/// Radius δ of the cylinder a neighbourhood has to fit into.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Radius {
    /// `radius_factor` × mean member distance over all neighbourhoods. One radius for the cloud,
    /// so that neighbourhoods wider than the typical one (outliers) are rejected.
    #[default]
    Global,
    /// `radius_factor` × mean member distance of each neighbourhood by itself.
    Local,
    /// A given radius, world units.
    Fixed(f64),
}

/// Settings of anchor construction; `Default` is the paper's choice wherever the paper makes one.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorParams {
    /// Nearest neighbours that join a point to form its neighbourhood. Default 2, that is triples
    /// (supplement, Anchor Construction). 0 makes every point an anchor of its own. At most 64.
    pub k: usize,
    /// Partition or overlapping neighbourhoods. Default [`Grouping::Disjoint`].
    pub grouping: Grouping,
    /// A disjoint neighbourhood is rejected when its mean edge exceeds this many times the median
    /// over the first round's candidates. At least 1; `f64::INFINITY` rejects nothing. Default 4.
    pub max_edge_ratio: f64,
    /// Weight α of the optional per-point features: they are scaled by α·h, h being
    /// [`median_spacing`](crate::median_spacing). At least 0. Default 3.
    pub feature_weight: f64,
    /// Rule for the cylinder radius δ. Default [`Radius::Global`].
    pub radius: Radius,
    /// δ in units of the mean member distance. Positive. Default √3/2 (below Eq. 6).
    pub radius_factor: f64,
    /// Lines sampled through the bounding sphere. Default 300 000 (supplement, Anchor
    /// Construction). Used by the one-call constructors; [`Lines::sample`](crate::Lines::sample)
    /// takes the number directly.
    pub num_lines: usize,
    /// Seed of the lines. Default 0. Used by the one-call constructors.
    pub seed: u64,
}

/// Largest supported `k`; neighbourhoods are meant to be small.
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
