//! [`PlyError`]: errors of reading a PLY file.

use thiserror::Error;

/// Error of reading a PLY file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PlyError {
    /// The first line is not `ply`.
    #[error("not a PLY file: it starts with {found}, expected the line `ply`")]
    NotPly {
        /// The first bytes, printable.
        found: String,
    },
    /// The header is malformed.
    #[error("malformed PLY header: {0}")]
    Header(String),
    /// The data end early.
    #[error(
        "truncated PLY: element `{element}` needs {expected} {unit} after the header, found {found}; the file is incomplete, copy or export it again"
    )]
    Truncated {
        /// Name of the element.
        element: String,
        /// Amount needed.
        expected: u128,
        /// Amount found.
        found: u128,
        /// `bytes` or `rows`.
        unit: &'static str,
    },
    /// A value of an ascii file is not a number.
    #[error("malformed PLY: row {row} of element `{element}` holds `{token}`, expected a number")]
    Value {
        /// Name of the element.
        element: String,
        /// Row, from 0.
        row: usize,
        /// The text found.
        token: String,
    },
    /// Required columns of Gaussians are missing.
    #[error("not a 3D Gaussian PLY: it has no {} (it looks like {looks_like}); {next}", missing.join(", "))]
    MissingColumns {
        /// Missing columns.
        missing: Vec<String>,
        /// Probable kind of the file.
        looks_like: String,
        /// Next step.
        next: &'static str,
    },
    /// The number of SH columns matches no degree.
    #[error(
        "not a 3D Gaussian PLY: it has {found} f_rest columns, expected 0, 9, 24 or 45 (SH degree 0 to 3), or 72 (degree 4, which is cut)"
    )]
    ShColumns {
        /// Columns found.
        found: usize,
    },
    /// No rows.
    #[error(
        "the PLY contains no Gaussians (element vertex 0); export it again with at least one splat"
    )]
    Empty,
    /// Compressed by PlayCanvas tools.
    #[error(
        "PlayCanvas compressed PLY (first element `chunk`), expected a plain one here; convert it, for example by opening it in SuperSplat and exporting \"Splat PLY\""
    )]
    Compressed,
    /// The requested column is missing.
    #[error("the PLY has no numeric vertex column `{name}`; its columns are {}", found.join(", "))]
    NoColumn {
        /// The requested column.
        name: String,
        /// The existing columns.
        found: Vec<String>,
    },
}
