//! What can be wrong with a problem, its points or its parameters.

use thiserror::Error;

/// Rejected input. Numerical non-convergence is not an error: see [`crate::UotOutput::converged`].
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UotError {
    /// A side of the problem has no points, rows or columns.
    #[error("the {side} side is empty: transport needs at least one row and one column")]
    Empty {
        /// `"source"` (rows) or `"edited"` (columns).
        side: &'static str,
    },
    /// A value of an input array is NaN, infinite or outside its range.
    #[error("{what}[{index}] = {value}: expected {expected}")]
    BadValue {
        /// Name of the array.
        what: &'static str,
        /// Flat index into the array (for points: the point id).
        index: usize,
        /// The offending value.
        value: f64,
        /// The accepted range in words.
        expected: &'static str,
    },
    /// An array does not have the length that the other inputs imply.
    #[error("{what} has {found} elements, expected {expected}")]
    BadLength {
        /// Name of the array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that fits.
        expected: usize,
    },
    /// A parameter is outside its range.
    #[error("parameter {name} = {value}: expected {expected}")]
    BadParam {
        /// Field name.
        name: &'static str,
        /// Given value.
        value: f64,
        /// The accepted range in words.
        expected: &'static str,
    },
    /// `lambda_ent` is too small for the kernel that this problem uses.
    #[error(
        "lambda_ent = {lambda_ent} is below {minimum}, the least value for a {kernel}: use {instead}"
    )]
    LambdaTooSmall {
        /// Given weight.
        lambda_ent: f64,
        /// Least weight that kernel can represent.
        minimum: f64,
        /// Kernel in words.
        kernel: &'static str,
        /// What to use instead.
        instead: &'static str,
    },
    /// The reference measure cannot be reached by a global factor because the marginals are not uniform.
    #[error(
        "entropy reference {reference:?} is defined for uniform marginals only: use EntropyReference::Kl"
    )]
    NonUniformMarginals {
        /// Requested reference.
        reference: crate::EntropyReference,
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
    /// An output is used with a problem of another size.
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
