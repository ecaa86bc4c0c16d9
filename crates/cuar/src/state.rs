//! [`State`] of a run, for checkpoints.

use crate::CuarError;

/// State from which a run can be resumed, as flat arrays. Their names and number depend on the
/// solver; both have `d_sh`, the offsets of SH, `[E,K,3]` for `E` edited splats. Resuming fails with
/// [`CuarError::State`] if an array is missing or has a different length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Hash of the inputs and options; a state can resume only runs with the same hash.
    pub fingerprint: u64,
    /// Completed steps: evaluations of one image each.
    pub step: u64,
    /// Arrays in single precision: name and values.
    pub arrays: Vec<(String, Vec<f32>)>,
    /// Arrays in double precision: name and values.
    pub doubles: Vec<(String, Vec<f64>)>,
}

impl State {
    /// The named array, if it has `expected` values.
    pub(crate) fn array(&self, name: &str, expected: usize) -> Result<&[f32], CuarError> {
        find(&self.arrays, name, expected)
    }

    /// The named array in double precision, if it has `expected` values.
    pub(crate) fn double(&self, name: &str, expected: usize) -> Result<&[f64], CuarError> {
        find(&self.doubles, name, expected)
    }
}

fn find<'a, T>(
    arrays: &'a [(String, Vec<T>)],
    name: &str,
    expected: usize,
) -> Result<&'a [T], CuarError> {
    let found = arrays.iter().find(|(key, _)| key == name);
    match found {
        Some((_, values)) if values.len() == expected => Ok(values),
        Some((_, values)) => Err(CuarError::State {
            what: format!("`{name}` has {} values, expected {expected}", values.len()),
        }),
        None => Err(CuarError::State { what: format!("`{name}` is missing") }),
    }
}
