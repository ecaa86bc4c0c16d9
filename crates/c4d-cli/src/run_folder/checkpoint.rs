//! `refine.state`: the checkpoint of an unfinished refinement,
//! as safetensors, with its original flags.

use super::REFINE_STATE;
use crate::args::{PresetArg, RefineFlags};
use crate::failure::{Failure, Outcome};
use crate::settings::RefineSettings;
use cuar::State;
use gs_io::FolderUpdate;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::Path;

/// An unfinished refinement.
#[derive(Debug)]
pub(crate) struct Checkpoint {
    /// Original preset.
    pub(crate) preset: PresetArg,
    /// Original configuration.
    pub(crate) settings: RefineSettings,
    /// Original flags, with absolute paths.
    pub(crate) flags: RefineFlags,
    /// State of the solver, if it has started.
    pub(crate) state: Option<State>,
    /// Whether it continues the work of an earlier process.
    pub(crate) is_resumed: bool,
}

impl Checkpoint {
    /// A new refinement.
    pub(crate) fn new(preset: PresetArg, settings: RefineSettings, flags: &RefineFlags) -> Self {
        Self { preset, settings, flags: flags.clone(), state: None, is_resumed: false }
    }

    /// Writes the checkpoint into the run.
    pub(crate) fn write(
        update: &FolderUpdate,
        preset: PresetArg,
        settings: &RefineSettings,
        flags: &RefineFlags,
        state: Option<&State>,
    ) -> Outcome {
        let failed = |error: safetensors::SafeTensorError| {
            Failure::failed(format!("{REFINE_STATE}: {error}"))
        };
        let nothing = State::default();
        let known = state.unwrap_or(&nothing);
        let singles = known.arrays.iter().map(|(name, values)| {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            (name, Dtype::F32, values.len(), bytes)
        });
        let doubles = known.doubles.iter().map(|(name, values)| {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            (name, Dtype::F64, values.len(), bytes)
        });
        let arrays: Vec<_> = singles.chain(doubles).collect();
        let mut views = Vec::with_capacity(arrays.len());
        for (name, dtype, len, bytes) in &arrays {
            views
                .push((name.as_str(), TensorView::new(*dtype, vec![*len], bytes).map_err(failed)?));
        }
        let text = |value: serde_json::Result<String>| value.map_err(Failure::failed);
        let mut metadata = HashMap::from([
            ("preset".to_owned(), text(serde_json::to_string(&preset))?),
            ("settings".to_owned(), text(serde_json::to_string(settings))?),
            ("flags".to_owned(), text(serde_json::to_string(flags))?),
        ]);
        if let Some(state) = state {
            metadata.insert("fingerprint".to_owned(), state.fingerprint.to_string());
            metadata.insert("step".to_owned(), state.step.to_string());
        }
        let bytes = safetensors::serialize(views, Some(metadata)).map_err(failed)?;
        update
            .write(REFINE_STATE, &bytes, true)
            .map_err(|error| crate::output::output_failure(&error))
    }

    /// Reads the checkpoint of a run, if it has one.
    pub(crate) fn read(run: &Path) -> Outcome<Option<Self>> {
        let path = run.join(REFINE_STATE);
        let bytes = match gs_io::read_file(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(damaged(&path, &error.to_string())),
        };
        Self::parse(&bytes).map(Some).map_err(|what| damaged(&path, &what))
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let text = |error: safetensors::SafeTensorError| error.to_string();
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(text)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let entry = |name: &str| {
            metadata.get(name).ok_or_else(|| format!("no `{name}`: not a checkpoint of c4d refine"))
        };
        let preset =
            serde_json::from_str(entry("preset")?).map_err(|error| format!("preset: {error}"))?;
        let settings = serde_json::from_str(entry("settings")?)
            .map_err(|error| format!("settings: {error}"))?;
        let flags: RefineFlags =
            serde_json::from_str(entry("flags")?).map_err(|error| format!("flags: {error}"))?;
        if !metadata.contains_key("step") {
            return Ok(Self { preset, settings, flags, state: None, is_resumed: true });
        }
        let number = |name: &str| {
            entry(name)?.parse().map_err(|error| format!("`{name}` is not a count: {error}"))
        };
        let file = SafeTensors::deserialize(bytes).map_err(text)?;
        let (mut arrays, mut doubles) = (Vec::new(), Vec::new());
        for (name, view) in file.iter() {
            let (singles, pairs) = (view.data().as_chunks::<4>().0, view.data().as_chunks::<8>().0);
            let broken = || format!("`{name}` contains non-finite values");
            match view.dtype() {
                Dtype::F32 => {
                    let values: Vec<f32> =
                        singles.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
                    if !values.iter().all(|value| value.is_finite()) {
                        return Err(broken());
                    }
                    arrays.push((name.to_owned(), values));
                }
                Dtype::F64 => {
                    let values: Vec<f64> =
                        pairs.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
                    // Before its first pass the solver's loss is infinite.
                    if values.iter().any(|value| value.is_nan()) {
                        return Err(broken());
                    }
                    doubles.push((name.to_owned(), values));
                }
                other => return Err(format!("`{name}` is {other:?}, expected F32 or F64")),
            }
        }
        arrays.sort_by(|a, b| a.0.cmp(&b.0));
        doubles.sort_by(|a, b| a.0.cmp(&b.0));
        let state =
            State { fingerprint: number("fingerprint")?, step: number("step")?, arrays, doubles };
        Ok(Self { preset, settings, flags, state: Some(state), is_resumed: true })
    }
}

fn damaged(path: &Path, what: &str) -> Failure {
    Failure::bad_input(format!("{}: {what}", path.display()))
        .next("Omit --resume to start the refinement again.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_round_trip_and_damage_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let update = FolderUpdate::begin(dir.path()).unwrap();
        assert!(Checkpoint::read(dir.path()).unwrap().is_none(), "none yet");
        let flags = RefineFlags { samples: Some(7), ..RefineFlags::default() };
        let settings = RefineSettings::default();
        Checkpoint::write(&update, PresetArg::Paper, &settings, &flags, None).unwrap();
        let begun = Checkpoint::read(dir.path()).unwrap().unwrap();
        assert_eq!((begun.flags.samples, begun.state), (Some(7), None), "begun");
        let mut state = State {
            fingerprint: u64::MAX,
            step: 12,
            arrays: vec![("d_sh".to_owned(), vec![1.0, 2.0])],
            doubles: vec![("losses".to_owned(), vec![0.5, f64::INFINITY])],
        };
        Checkpoint::write(&update, PresetArg::Paper, &settings, &flags, Some(&state)).unwrap();
        let read = Checkpoint::read(dir.path()).unwrap().unwrap();
        assert_eq!((read.preset, read.state), (PresetArg::Paper, Some(state.clone())), "all of it");
        for broken in [f32::NAN, f32::INFINITY] {
            state.arrays[0].1[1] = broken;
            Checkpoint::write(&update, PresetArg::Paper, &settings, &flags, Some(&state)).unwrap();
            let failure = Checkpoint::read(dir.path()).unwrap_err().to_string();
            assert!(failure.contains("`d_sh` contains non-finite values"), "{failure}");
        }
        let bytes = gs_io::read_file(&dir.path().join(REFINE_STATE)).unwrap();
        for cut in 0..bytes.len() {
            assert!(Checkpoint::parse(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }
}
