//! The checkpoint of an unfinished fit, as safetensors.

use crate::failure::{Failure, Outcome};
use gs_fit::FitState;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use std::collections::HashMap;
use std::path::Path;

/// The state as bytes.
pub(super) fn encode(state: &FitState) -> Outcome<Vec<u8>> {
    let failed = |error: safetensors::SafeTensorError| Failure::failed(error);
    let singles = state.arrays.iter().map(|(name, values)| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        (name, Dtype::F32, values.len(), bytes)
    });
    let counts = state.counts.iter().map(|(name, values)| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        (name, Dtype::U32, values.len(), bytes)
    });
    let arrays: Vec<_> = singles.chain(counts).collect();
    let mut views = Vec::with_capacity(arrays.len());
    for (name, dtype, len, bytes) in &arrays {
        views.push((name.as_str(), TensorView::new(*dtype, vec![*len], bytes).map_err(failed)?));
    }
    let metadata = HashMap::from([
        ("fingerprint".to_owned(), state.fingerprint.to_string()),
        ("step".to_owned(), state.step.to_string()),
    ]);
    safetensors::serialize(views, Some(metadata)).map_err(failed)
}

/// Inverse of [`encode`].
pub(super) fn read(path: &Path) -> Outcome<FitState> {
    let bytes = gs_io::read_file(path).map_err(|error| damaged(path, &error.to_string()))?;
    decode(&bytes).map_err(|what| damaged(path, &what))
}

fn decode(bytes: &[u8]) -> Result<FitState, String> {
    let text = |error: safetensors::SafeTensorError| error.to_string();
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(text)?;
    let metadata = header.metadata().clone().unwrap_or_default();
    let number = |name: &str| -> Result<u64, String> {
        let value = metadata
            .get(name)
            .ok_or_else(|| format!("no `{name}`: not a checkpoint of c4d edit"))?;
        value.parse().map_err(|error| format!("`{name}` is not a count: {error}"))
    };
    let file = SafeTensors::deserialize(bytes).map_err(text)?;
    let (mut arrays, mut counts) = (Vec::new(), Vec::new());
    for (name, view) in file.iter() {
        let words = view.data().as_chunks::<4>().0;
        match view.dtype() {
            Dtype::F32 => {
                arrays.push((
                    name.to_owned(),
                    words.iter().map(|w| f32::from_le_bytes(*w)).collect(),
                ));
            }
            Dtype::U32 => {
                counts.push((
                    name.to_owned(),
                    words.iter().map(|w| u32::from_le_bytes(*w)).collect(),
                ));
            }
            other => return Err(format!("`{name}` is {other:?}, expected F32 or U32")),
        }
    }
    arrays.sort_by(|a: &(String, Vec<f32>), b| a.0.cmp(&b.0));
    counts.sort_by(|a: &(String, Vec<u32>), b| a.0.cmp(&b.0));
    Ok(FitState { fingerprint: number("fingerprint")?, step: number("step")?, arrays, counts })
}

fn damaged(path: &Path, what: &str) -> Failure {
    Failure::bad_input(format!("{}: {what}", path.display()))
        .next("Omit --resume to start the fit again.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_round_trip_and_truncated_files_are_refused() {
        let state = FitState {
            fingerprint: u64::MAX,
            step: 12,
            arrays: vec![("a".to_owned(), vec![1.0, -2.5])],
            counts: vec![("n".to_owned(), vec![u32::MAX, 0])],
        };
        let bytes = encode(&state).unwrap();
        assert_eq!(decode(&bytes), Ok(state), "all of it");
        for cut in 0..bytes.len() {
            assert!(decode(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }
}
