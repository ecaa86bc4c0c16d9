//! Errors of this crate.

use thiserror::Error;

/// Rejected input. Numerical non-convergence is not an error: see [`crate::UotOutput::converged`].
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum UotError {
    /// A side of the problem has no points, rows or columns.
    #[error("the {side} side is empty: transport needs at least one row, one column and one pair")]
    Empty {
        /// `"row"`, `"column"`, or `"candidate"` where no pair is listed.
        side: &'static str,
    },
    /// A value of an input array is NaN, infinite or outside its range.
    #[error("{what}[{index}] = {value}: expected {expected}")]
    BadValue {
        /// Name of the array.
        what: &'static str,
        /// Flat index into the array (for points: the point id).
        index: usize,
        /// Its value.
        value: f64,
        /// Description of the accepted range.
        expected: &'static str,
    },
    /// An array does not have the length that the other inputs imply.
    #[error("{what} has {found} elements, expected {expected}")]
    BadLength {
        /// Name of the array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Expected length.
        expected: usize,
    },
    /// A parameter is outside its range.
    #[error("parameter {name} = {value}: expected {expected}")]
    BadParam {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Description of the accepted range.
        expected: &'static str,
    },
    /// `lambda_ent` is too small for the kernel that this problem uses.
    #[error(
        "lambda_ent = {lambda_ent} is below {minimum}, the minimum for a {kernel}: use {instead}"
    )]
    LambdaTooSmall {
        /// Its value.
        lambda_ent: f64,
        /// Minimum value that the kernel can represent.
        minimum: f64,
        /// Description of the kernel.
        kernel: &'static str,
        /// Function or option to use instead.
        instead: &'static str,
    },
    /// The plan for this reference does not follow from that of `Kl` by a global factor, because
    /// the marginals are not uniform.
    #[error(
        "entropy reference {reference:?} is defined for uniform marginals only: use EntropyReference::Kl"
    )]
    NonUniformMarginals {
        /// Requested reference.
        reference: crate::EntropyReference,
    },
    /// The plan for this reference does not follow from that of `Kl` by a global factor, because
    /// mass without counterpart has a fixed cost.
    #[error(
        "entropy reference {reference:?} cannot be combined with unmatched costs: use EntropyReference::Kl"
    )]
    ReferenceWithUnmatched {
        /// Requested reference.
        reference: crate::EntropyReference,
    },
    /// Both marginals are enforced, but their sums differ.
    #[error(
        "both marginals are enforced (infinite lambda), but a sums to {sum_a} and b to {sum_b}: scale one, or use a finite lambda for a side"
    )]
    UnequalMasses {
        /// Sum of the row weights.
        sum_a: f64,
        /// Sum of the column weights.
        sum_b: f64,
    },
    /// A marginal is enforced at a row or column without pairs that can carry mass.
    #[error(
        "{side} {index} has weight but no candidate, and its marginal is enforced: add a candidate, an unmatched cost, or use a finite lambda"
    )]
    Infeasible {
        /// `"row"` or `"column"`.
        side: &'static str,
        /// Id of the row or column.
        index: usize,
    },
    /// A result that is not available for a structured cost.
    #[error("{what} is not available for a structured Welsch problem: use {instead}")]
    NotListed {
        /// Requested result.
        what: &'static str,
        /// Function or option to use instead.
        instead: &'static str,
    },
    /// An array would exceed the stated limit of elements.
    #[error("{what} would hold {needed} elements, more than the limit of {limit}")]
    TooLarge {
        /// Name of the array.
        what: &'static str,
        /// Elements needed.
        needed: usize,
        /// Limit in elements.
        limit: usize,
    },
    /// An output is used with a problem of a different size.
    #[error("the output is for {output_rows}x{output_cols}, the problem is {rows}x{cols}")]
    Mismatch {
        /// Rows of the output.
        output_rows: usize,
        /// Columns of the output.
        output_cols: usize,
        /// Rows of the problem.
        rows: usize,
        /// Columns of the problem.
        cols: usize,
    },
}
