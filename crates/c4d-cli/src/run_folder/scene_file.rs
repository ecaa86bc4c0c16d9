//! `scene.c4d`: the edited frame, its binding to the source, and the refined colours, as
//! safetensors.

use super::SCENE;
use super::entry::{Entry, le_bytes};
use super::surface_entries;
use crate::failure::{Failure, Outcome};
use amg::{AmgError, Binding, MovedGroup, RowKind, Similarity};
use gs_core::Splats;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Version of the layout: 3 if it contains a surface, 2 if it has groups of moved rows, else 1.
/// Older readers do not support versions 2 and 3.
const FORMATS: [u32; 3] = [1, 2, 3];
/// Key of the [`Header`] in the metadata.
const METADATA: &str = "c4d";

/// Information besides the tensors, as JSON in the metadata.
#[derive(Debug, Serialize, Deserialize)]
struct Header {
    format: u32,
    num_sources: usize,
}

/// Colours of edited rows after refinement; the original frame is stored separately.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct RefinedRows {
    /// Rows, ascending.
    pub(crate) rows: Vec<u32>,
    /// `[rows,K,3]`.
    pub(crate) sh: Vec<[f32; 3]>,
    /// `[rows]`.
    pub(crate) opacity_logits: Vec<f32>,
}

impl RefinedRows {
    /// The frame with these rows replaced.
    pub(crate) fn apply(&self, edited: &Splats) -> Splats {
        let (mut refined, coeffs) = (edited.clone(), edited.sh_coeffs());
        for (i, &row) in self.rows.iter().enumerate() {
            let row = row as usize;
            refined.sh[row * coeffs..(row + 1) * coeffs]
                .copy_from_slice(&self.sh[i * coeffs..(i + 1) * coeffs]);
            refined.opacity_logits[row] = self.opacity_logits[i];
        }
        refined
    }

    /// Number of rows whose colour or opacity differs from `edited`.
    pub(crate) fn changed(&self, edited: &Splats) -> usize {
        self.changes(edited).count()
    }

    /// Rows whose colour or opacity differs from `edited`.
    fn changes<'a>(&'a self, edited: &'a Splats) -> impl Iterator<Item = usize> + 'a {
        self.rows
            .iter()
            .zip(self.sh.chunks(edited.sh_coeffs()))
            .zip(&self.opacity_logits)
            .map(|((&row, sh), &logit)| (row as usize, sh, logit))
            .filter(|(row, sh, logit)| {
                *sh != edited.sh_of(*row) || *logit != edited.opacity_logits[*row]
            })
            .map(|(row, ..)| row)
    }

    /// `binding` for the frame with these rows replaced: source splats that the refinement changed
    /// and the edit did not are recoloured.
    pub(crate) fn rebind(&self, edited: &Splats, binding: &Binding) -> Result<Binding, AmgError> {
        let mut kinds = binding.kinds().to_vec();
        for row in self.changes(edited) {
            if kinds[row] == RowKind::Unchanged {
                kinds[row] = RowKind::Recolored;
            }
        }
        Binding::from_parts_with_groups(
            binding.offsets().to_vec(),
            binding.source_ids().to_vec(),
            binding.weights().to_vec(),
            kinds,
            binding.num_sources(),
            binding.groups().to_vec(),
            binding.group_of().to_vec(),
        )
        .and_then(|rebound| match binding.surface() {
            Some(surface) => rebound.with_surface(surface.clone()),
            None => Ok(rebound),
        })
    }

    fn fits(&self, edited: &Splats) -> bool {
        let rows = self.rows.len();
        self.rows.iter().all(|&row| (row as usize) < edited.len())
            && self.sh.len() == rows * edited.sh_coeffs()
            && self.opacity_logits.len() == rows
    }
}

/// Contents of a scene file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stored {
    /// The original edited frame.
    pub(crate) edited: Splats,
    /// Its binding to the source.
    pub(crate) binding: Binding,
    /// Refined colours.
    pub(crate) refined: Option<RefinedRows>,
}

impl Stored {
    /// The bytes of `scene.c4d`.
    pub(crate) fn serialize(&self) -> Outcome<Vec<u8>> {
        serialize(self)
    }

    /// For each edited splat, the source splat with the same geometry, moved or not.
    pub(crate) fn source_rows(&self) -> Vec<Option<u32>> {
        let own = |(row, kind): (usize, &RowKind)| {
            let is_source = kind.is_exact()
                || matches!(kind, RowKind::Moved | RowKind::Descendant | RowKind::Copied);
            self.binding.row(row).0.first().copied().filter(|_| is_source)
        };
        self.binding.kinds().iter().enumerate().map(own).collect()
    }

    /// Reads the bytes of `scene.c4d`; every count is checked, so
    /// a damaged file causes only an error.
    pub(crate) fn deserialize(bytes: &[u8]) -> Result<Self, String> {
        deserialize(bytes)
    }
}

fn serialize(stored: &Stored) -> Outcome<Vec<u8>> {
    let Stored { edited, binding, refined } = stored;
    let (rows, coeffs) = (edited.len(), edited.sh_coeffs());
    let codes: Vec<u8> = binding.kinds().iter().map(|kind| kind.code()).collect();
    let floats = |values: &'static str, shape: Vec<usize>, data: &[f32]| {
        (values, Dtype::F32, shape, le_bytes(data, f32::to_le_bytes))
    };
    let ints = |name: &'static str, data: &[u32]| {
        (name, Dtype::U32, vec![data.len()], le_bytes(data, u32::to_le_bytes))
    };
    let mut entries = vec![
        floats("edited.means", vec![rows, 3], edited.means.as_flattened()),
        floats("edited.quats", vec![rows, 4], edited.quats.as_flattened()),
        floats("edited.log_scales", vec![rows, 3], edited.log_scales.as_flattened()),
        floats("edited.opacity_logits", vec![rows], &edited.opacity_logits),
        floats("edited.sh", vec![rows, coeffs, 3], edited.sh.as_flattened()),
        ints("binding.offsets", binding.offsets()),
        ints("binding.source_ids", binding.source_ids()),
        floats("binding.weights", vec![binding.weights().len()], binding.weights()),
        ("binding.kinds", Dtype::U8, vec![rows], codes),
    ];
    let groups = binding.groups();
    if !groups.is_empty() {
        entries.extend(group_entries(binding));
    }
    if let Some(surface) = binding.surface() {
        entries.extend(surface_entries::write(surface));
    }
    if let Some(refined) = refined {
        let rows = refined.rows.len();
        entries.push(ints("refined.rows", &refined.rows));
        entries.push(floats("refined.sh", vec![rows, coeffs, 3], refined.sh.as_flattened()));
        entries.push(floats("refined.opacity_logits", vec![rows], &refined.opacity_logits));
    }
    let failed = |error: safetensors::SafeTensorError| Failure::failed(format!("{SCENE}: {error}"));
    let mut views = Vec::with_capacity(entries.len());
    for (name, dtype, shape, bytes) in &entries {
        views.push((*name, TensorView::new(*dtype, shape.clone(), bytes).map_err(failed)?));
    }
    // A single entry, because the order of several is not reproducible.
    let format = match binding.surface() {
        Some(_) => 3,
        None if groups.is_empty() => 1,
        None => 2,
    };
    let header = Header { format, num_sources: binding.num_sources() };
    let header = serde_json::to_string(&header).map_err(Failure::failed)?;
    let metadata = HashMap::from([(METADATA.to_owned(), header)]);
    safetensors::serialize(views, Some(metadata)).map_err(failed)
}

/// Values of a stored similarity: scale, rotation `wxyz`, 1 or 0 for mirrored, translation.
const SIMILARITY: usize = 9;

fn group_entries(binding: &Binding) -> Vec<Entry> {
    let groups = binding.groups();
    let (mut similarities, mut offsets) = (Vec::new(), vec![0_u32]);
    let (mut carriers, mut weights) = (Vec::new(), Vec::new());
    for group in groups {
        let placed = &group.similarity;
        similarities.push(placed.scale);
        similarities.extend(placed.rotation);
        similarities.push(f64::from(u8::from(placed.mirrored)));
        similarities.extend(placed.translation);
        carriers.extend(group.carriers.iter().map(|carrier| carrier.0));
        weights.extend(group.carriers.iter().map(|carrier| carrier.1));
        offsets.push(u32::try_from(carriers.len()).unwrap_or(u32::MAX));
    }
    let ints =
        |name, data: &[u32]| (name, Dtype::U32, vec![data.len()], le_bytes(data, u32::to_le_bytes));
    let shape = vec![groups.len(), SIMILARITY];
    vec![
        ("groups.similarities", Dtype::F64, shape, le_bytes(&similarities, f64::to_le_bytes)),
        ints("groups.offsets", &offsets),
        ints("groups.carriers", &carriers),
        ("groups.weights", Dtype::F32, vec![weights.len()], le_bytes(&weights, f32::to_le_bytes)),
        ints("groups.of_row", binding.group_of()),
    ]
}

struct StoredGroups {
    similarities: Vec<f64>,
    offsets: Vec<u32>,
    carriers: Vec<u32>,
    weights: Vec<f32>,
}

impl StoredGroups {
    fn groups(&self) -> Result<Vec<MovedGroup>, String> {
        let similarities = self.similarities.as_chunks::<SIMILARITY>().0;
        let entries = self.carriers.len();
        let ascending = self.offsets.windows(2).all(|pair| pair[0] <= pair[1]);
        if self.offsets.len() != similarities.len() + 1
            || !ascending
            || self.offsets[0] != 0
            || self.offsets[similarities.len()] as usize != entries
            || self.weights.len() != entries
        {
            return Err("the arrays of moved groups are inconsistent".to_owned());
        }
        let group = |(values, range): (&[f64; SIMILARITY], &[u32])| {
            let [scale, w, x, y, z, mirrored, tx, ty, tz] = *values;
            let range = range[0] as usize..range[1] as usize;
            let weights = self.weights[range.clone()].iter().copied();
            MovedGroup {
                similarity: Similarity {
                    scale,
                    rotation: [w, x, y, z],
                    mirrored: mirrored != 0.0,
                    translation: [tx, ty, tz],
                },
                carriers: self.carriers[range].iter().copied().zip(weights).collect(),
            }
        };
        Ok(similarities.iter().zip(self.offsets.windows(2)).map(group).collect())
    }
}

fn deserialize(bytes: &[u8]) -> Result<Stored, String> {
    let text = |error: safetensors::SafeTensorError| error.to_string();
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(text)?;
    let metadata = header.metadata().as_ref().and_then(|entries| entries.get(METADATA));
    let header: Header = metadata
        .ok_or_else(|| format!("no `{METADATA}` entry: not a scene of c4d"))
        .and_then(|text| serde_json::from_str(text).map_err(|error| error.to_string()))?;
    if !FORMATS.contains(&header.format) {
        return Err(format!("format {}, expected 1 to 3", header.format));
    }
    let file = SafeTensors::deserialize(bytes).map_err(text)?;
    let data = |name: &str, dtype: Dtype| -> Result<Vec<u8>, String> {
        let view = file.tensor(name).map_err(|error| format!("{name}: {error}"))?;
        if view.dtype() != dtype {
            return Err(format!("{name} is {:?}, expected {dtype:?}", view.dtype()));
        }
        Ok(view.data().to_vec())
    };
    let floats = |name: &str| -> Result<Vec<f32>, String> {
        let values: Vec<f32> = data(name, Dtype::F32)?
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        match values.iter().position(|value| !value.is_finite()) {
            Some(at) => {
                Err(format!("{name}: value {at} is {}, expected a finite number", values[at]))
            }
            None => Ok(values),
        }
    };
    let ints = |name: &str| -> Result<Vec<u32>, String> {
        Ok(data(name, Dtype::U32)?
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| u32::from_le_bytes(*b))
            .collect())
    };
    let means = floats("edited.means")?.as_chunks::<3>().0.to_vec();
    let sh = floats("edited.sh")?.as_chunks::<3>().0.to_vec();
    let coeffs = if means.is_empty() { 1 } else { sh.len() / means.len() };
    let edited = Splats {
        quats: floats("edited.quats")?.as_chunks::<4>().0.to_vec(),
        log_scales: floats("edited.log_scales")?.as_chunks::<3>().0.to_vec(),
        opacity_logits: floats("edited.opacity_logits")?,
        sh_degree: gs_core::sh::degree_of(coeffs).ok_or(format!("{coeffs} SH coefficients"))?,
        means,
        sh,
    };
    edited.check_shapes().map_err(|error| error.to_string())?;
    let kinds = data("binding.kinds", Dtype::U8)?
        .iter()
        .map(|&code| RowKind::from_code(code).ok_or(format!("row kind {code}")))
        .collect::<Result<Vec<_>, _>>()?;
    let (groups, group_of) = if file.tensor("groups.of_row").is_ok() {
        let stored = StoredGroups {
            similarities: data("groups.similarities", Dtype::F64)?
                .as_chunks::<8>()
                .0
                .iter()
                .map(|bytes| f64::from_le_bytes(*bytes))
                .collect(),
            offsets: ints("groups.offsets")?,
            carriers: ints("groups.carriers")?,
            weights: floats("groups.weights")?,
        };
        (stored.groups()?, ints("groups.of_row")?)
    } else {
        (Vec::new(), Vec::new())
    };
    let binding = Binding::from_parts_with_groups(
        ints("binding.offsets")?,
        ints("binding.source_ids")?,
        floats("binding.weights")?,
        kinds,
        header.num_sources,
        groups,
        group_of,
    )
    .map_err(|error| error.to_string())?;
    let binding = match surface_entries::read(&floats, &ints, &file)? {
        Some(surface) => binding.with_surface(surface).map_err(|error| error.to_string())?,
        None => binding,
    };
    if binding.len() != edited.len() {
        return Err(format!("{} bound rows for {} splats", binding.len(), edited.len()));
    }
    let refined = if file.tensor("refined.rows").is_ok() {
        let refined = RefinedRows {
            rows: ints("refined.rows")?,
            sh: floats("refined.sh")?.as_chunks::<3>().0.to_vec(),
            opacity_logits: floats("refined.opacity_logits")?,
        };
        if !refined.fits(&edited) {
            return Err("refined rows do not fit the edited splats".to_owned());
        }
        Some(refined)
    } else {
        None
    };
    Ok(Stored { edited, binding, refined })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Stored {
        let edited = Splats {
            means: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; 2],
            log_scales: vec![[-1.0; 3]; 2],
            opacity_logits: vec![0.5, 1.5],
            sh: vec![[0.1; 3]; 8],
            sh_degree: 1,
        };
        let kinds = vec![RowKind::Unchanged, RowKind::Blended];
        let binding =
            Binding::from_parts(vec![0, 1, 3], vec![4, 0, 2], vec![1.0, 0.25, 0.75], kinds, 5)
                .unwrap();
        let refined =
            Some(RefinedRows { rows: vec![1], sh: vec![[0.7; 3]; 4], opacity_logits: vec![2.5] });
        Stored { edited, binding, refined }
    }

    #[test]
    fn scene_file_round_trips() {
        let stored = sample();
        assert_eq!(
            Stored::deserialize(&stored.serialize().unwrap()),
            Ok(stored.clone()),
            "bit for bit"
        );
        let unrefined = Stored { refined: None, ..stored };
        assert_eq!(
            Stored::deserialize(&unrefined.serialize().unwrap()),
            Ok(unrefined),
            "without refinement"
        );
    }

    #[test]
    fn moved_groups_round_trip() {
        let Stored { edited, .. } = sample();
        let similarity = Similarity {
            scale: 1.3,
            rotation: [0.6, 0.0, -0.8, 0.0],
            mirrored: true,
            translation: [0.1, 2.0, -3.0],
        };
        let groups = vec![
            MovedGroup { similarity, carriers: vec![(4, 1.0), (0, 0.25)] },
            MovedGroup { similarity: Similarity::IDENTITY, carriers: Vec::new() },
        ];
        let kinds = vec![RowKind::Moved, RowKind::Moved];
        let binding = Binding::from_parts_with_groups(
            vec![0, 1, 2],
            vec![4, 0],
            vec![1.0, 1.0],
            kinds,
            5,
            groups,
            vec![1, 0],
        )
        .unwrap();
        let stored = Stored { edited, binding, refined: None };
        let bytes = stored.serialize().unwrap();
        assert_eq!(Stored::deserialize(&bytes), Ok(stored), "bit for bit");
        for i in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[i] ^= 0x55;
            if let Ok(read) = Stored::deserialize(&flipped) {
                assert_eq!(read.binding.groups().len(), 2, "byte {i}: groups are complete");
            }
        }
    }

    #[test]
    fn refined_rows_replace_colours_only() {
        let stored = sample();
        let refined = stored.refined.as_ref().unwrap().apply(&stored.edited);
        assert_eq!(refined.sh_of(0), stored.edited.sh_of(0), "other rows are unchanged");
        assert_eq!(refined.sh_of(1), [[0.7; 3]; 4], "refined row");
        assert_eq!(refined.means, stored.edited.means, "geometry stays");
    }

    #[test]
    fn damaged_scene_files_are_errors() {
        let bytes = sample().serialize().unwrap();
        for cut in 0..bytes.len() {
            assert!(Stored::deserialize(&bytes[..cut]).is_err(), "cut at {cut}");
        }
        for i in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[i] ^= 0x55;
            // Values may change, but nothing may panic, and an accepted scene must be consistent.
            if let Ok(stored) = Stored::deserialize(&flipped) {
                assert!(stored.edited.check_shapes().is_ok(), "byte {i}");
                assert_eq!(stored.binding.len(), stored.edited.len(), "byte {i}");
            }
        }
    }
}
