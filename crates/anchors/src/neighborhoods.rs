//! [`Neighborhoods`]: local neighbourhoods of a cloud.

use crate::groups::{disjoint, overlapping};
use crate::nearest::median_spacing_of_ranked;
use crate::points::{Coordinate, first_bad, id_from_rank, widen};
use crate::{AnchorError, AnchorParams, Grouping};

/// Sets of point ids, stored as offsets and indices.
///
/// Neighbourhood `i` is `indices[offsets[i]..offsets[i + 1]]`. In the result of
/// [`Neighborhoods::build`], members are in lexicographic order of their points and neighbourhoods
/// in lexicographic order of their members, so that the result does not depend on the order of the
/// input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighborhoods {
    offsets: Vec<u32>,
    indices: Vec<u32>,
    num_points: usize,
}

impl Neighborhoods {
    /// Groups each of the `points` `[N,3]` (world units) with its `params.k` nearest points.
    ///
    /// **Disjoint**: each free point proposes itself and its `k` nearest free points. Proposals are
    /// accepted in order of mean edge length, as long as all members are still free; then the
    /// remaining points propose again, until no proposal is accepted (at most 64 rounds). Proposals
    /// with a mean edge above `max_edge_ratio` × the median of the first round are rejected. Points
    /// that remain at the end are in no neighbourhood. Ties, here and among neighbours, are broken
    /// by lexicographic rank. Runs of coincident points are grouped among themselves first.
    ///
    /// **Overlapping**: one neighbourhood per point; equal sets are kept once.
    ///
    /// A cloud of at most `k` points is one neighbourhood; with `k = 0` every point is one.
    ///
    /// `features`, one `[f64; 6]` per point, are scaled by `feature_weight` ×
    /// [`median_spacing`](crate::median_spacing) and appended to the coordinates for the search, so
    /// that points with different features are far apart (see [`normal_feature`]).
    ///
    /// # Errors
    /// Empty cloud, coordinates or features that are not finite or beyond ±1e50, features not one
    /// per point, parameters out of range.
    pub fn build<T: Coordinate>(
        points: &[[T; 3]],
        features: Option<&[[f64; 6]]>,
        params: &AnchorParams,
    ) -> Result<Self, AnchorError> {
        params.validate()?;
        let points = widen(points)?;
        let Some(features) = features else { return Self::of_rows(&points, params) };
        if features.len() != points.len() {
            return Err(AnchorError::FeatureCount {
                expected: points.len(),
                found: features.len(),
            });
        }
        if let Some((point, entry, value)) = first_bad(features) {
            return Err(AnchorError::BadFeature { point, entry, value });
        }
        let ranks = id_from_rank(&points);
        let ranked: Vec<[f64; 3]> = ranks.iter().map(|id| points[*id as usize]).collect();
        let weight = params.feature_weight * median_spacing_of_ranked(&ranked);
        let joint: Vec<[f64; 9]> =
            points.iter().zip(features).map(|(p, f)| join(p, f, weight)).collect();
        Self::of_rows(&joint, params)
    }

    fn of_rows<const D: usize>(
        rows: &[[f64; D]],
        params: &AnchorParams,
    ) -> Result<Self, AnchorError> {
        let id_from_rank = id_from_rank(rows);
        let ranked: Vec<[f64; D]> = id_from_rank.iter().map(|id| rows[*id as usize]).collect();
        let size = (params.k + 1).min(rows.len());
        let limit = u32::MAX as usize - 1;
        if rows.len() > limit / size {
            let found = rows.len() * size;
            return Err(AnchorError::TooMany { what: "members", found, limit });
        }
        let mut members = match params.grouping {
            Grouping::Disjoint => disjoint(&ranked, size, params.max_edge_ratio),
            Grouping::Overlapping => overlapping(&ranked, size),
        };
        for id in &mut members {
            *id = id_from_rank[*id as usize];
        }
        let offsets = (0..=members.len() as u32).step_by(size).collect();
        Ok(Self { offsets, indices: members, num_points: rows.len() })
    }

    /// The given neighbourhoods of a cloud of `num_points` points. Neighbourhoods may share points.
    ///
    /// # Errors
    /// [`AnchorError::BadNeighborhoods`] if `offsets` does not start at 0, does not end at the
    /// number of indices or does not increase, or if a member is out of range or listed twice in
    /// one neighbourhood.
    pub fn from_parts(
        offsets: Vec<u32>,
        indices: Vec<u32>,
        num_points: usize,
    ) -> Result<Self, AnchorError> {
        let bad = |reason: String| Err(AnchorError::BadNeighborhoods { reason });
        let (first, last) = (offsets.first().copied(), offsets.last().copied());
        if first != Some(0) || last.map(|x| x as usize) != Some(indices.len()) {
            return bad(format!(
                "offsets run from {first:?} to {last:?}: expected 0 to {}",
                indices.len()
            ));
        }
        if let Some(i) = offsets.windows(2).position(|pair| pair[0] >= pair[1]) {
            return bad(format!("neighbourhood {i} is empty or its offsets decrease"));
        }
        if let Some(id) = indices.iter().find(|id| **id as usize >= num_points) {
            return bad(format!("member {id} is out of range: expected below {num_points}"));
        }
        let built = Self { offsets, indices, num_points };
        let mut sorted = Vec::new();
        for (i, members) in built.iter().enumerate() {
            sorted.clear();
            sorted.extend_from_slice(members);
            sorted.sort_unstable();
            let before = sorted.len();
            sorted.dedup();
            if sorted.len() < before {
                return bad(format!("neighbourhood {i} lists a member twice: {members:?}"));
            }
        }
        Ok(built)
    }

    /// Keeps the neighbourhoods whose members satisfy `keep`, in their order. The members of the
    /// others are then uncovered.
    pub fn retain(&mut self, mut keep: impl FnMut(&[u32]) -> bool) {
        let mut kept = Self::empty(self.num_points);
        for members in self.iter().filter(|members| keep(members)) {
            kept.push(members);
        }
        *self = kept;
    }

    /// Number of neighbourhoods.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there is no neighbourhood.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point ids of neighbourhood `i`.
    ///
    /// # Panics
    /// If `i` is not below [`Self::len`].
    pub fn get(&self, i: usize) -> &[u32] {
        &self.indices[self.range(i)]
    }

    /// Range of the members of neighbourhood `i` in [`Self::indices`].
    pub(crate) fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.offsets[i] as usize..self.offsets[i + 1] as usize
    }

    /// The neighbourhoods in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> + Clone {
        (0..self.len()).map(|i| self.get(i))
    }

    /// Start of each neighbourhood in [`Self::indices`], and the end of the last: `len() + 1`
    /// entries.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// Members of all neighbourhoods, one after the other.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Number of points of the cloud to which the ids refer.
    pub fn num_points(&self) -> usize {
        self.num_points
    }

    pub(crate) fn empty(num_points: usize) -> Self {
        Self { offsets: vec![0], indices: Vec::new(), num_points }
    }

    pub(crate) fn push(&mut self, members: &[u32]) {
        self.indices.extend_from_slice(members);
        self.offsets.push(self.indices.len() as u32);
    }
}

fn join(point: &[f64; 3], feature: &[f64; 6], weight: f64) -> [f64; 9] {
    let mut row = [0.0; 9];
    row[..3].copy_from_slice(point);
    for (entry, f) in row[3..].iter_mut().zip(feature) {
        // The sum turns -0.0 into 0.0: equal features must have equal bits.
        *entry = weight * f + 0.0;
    }
    row
}

/// Feature of an unoriented unit normal `n` with confidence `w` from 0 to 1, for
/// [`Neighborhoods::build`]: the six entries of `w·n nᵀ`, scaled so that two features with `w = 1`
/// are `√(1 − (n·n')²)` apart, the sine of the angle between the normals.
pub fn normal_feature(normal: [f64; 3], w: f64) -> [f64; 6] {
    let [x, y, z] = normal;
    let diagonal = w * 0.5_f64.sqrt();
    [diagonal * x * x, diagonal * y * y, diagonal * z * z, w * x * y, w * x * z, w * y * z]
}
