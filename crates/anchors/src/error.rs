//! Errors of this crate.

/// Rejected input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnchorError {
    /// The cloud has no points.
    #[error("the point cloud is empty: at least one point is needed")]
    EmptyCloud,
    /// A coordinate is NaN, infinite, or so large that its square overflows.
    #[error(
        "point {point} has coordinate {value} on axis {axis}: expected a finite number within ±1e50"
    )]
    BadPoint {
        /// Index of the point.
        point: usize,
        /// Axis, 0 to 2.
        axis: usize,
        /// Its value.
        value: f64,
    },
    /// A feature entry is NaN, infinite, or so large that its square overflows.
    #[error("feature {point} has entry {value} at {entry}: expected a finite number within ±1e50")]
    BadFeature {
        /// Index of the point the feature belongs to.
        point: usize,
        /// Entry, 0 to 5.
        entry: usize,
        /// Its value.
        value: f64,
    },
    /// The number of features differs from the number of points.
    #[error("{found} features for {expected} points: expected one feature per point")]
    FeatureCount {
        /// Number of points.
        expected: usize,
        /// Number of features.
        found: usize,
    },
    /// A parameter is outside its range.
    #[error("parameter `{name}` is {value}: expected {expected}")]
    BadParam {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Accepted range.
        expected: &'static str,
    },
    /// Neighbourhoods do not fit the cloud or are not well formed.
    #[error("neighbourhoods are malformed: {reason}")]
    BadNeighborhoods {
        /// Description, with the values found.
        reason: String,
    },
    /// A line has a coordinate that is not finite or a direction that is not of unit length.
    #[error("line {line} is not usable: expected a finite point and a unit direction")]
    BadLine {
        /// Index of the line.
        line: usize,
    },
    /// More elements than 32-bit ids can represent.
    #[error("{found} {what}: at most {limit} are supported")]
    TooMany {
        /// Name of the elements.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Maximum number.
        limit: usize,
    },
}
