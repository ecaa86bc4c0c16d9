//! Arrays of `scene.c4d` for edits that apply to surfaces: persistent splats with their carriers, and
//! inherited edits of rows.

use super::entry::{Entry, le_bytes};
use amg::{Carrier, ColorChange, Inherited, PersistentSplats, SurfaceBinding};
use safetensors::{Dtype, SafeTensors};

/// Number of values of a carrier: rest position, floor, peak.
const CARRIER: usize = 5;
/// Number of values of an inherited edit: confidence, opacity factor, matrix, offset, spherical
/// harmonics.
const INHERITED: usize = 15;
/// Marks a row without a group.
const NO_GROUP: u32 = u32::MAX;

pub(super) fn write(surface: &SurfaceBinding) -> Vec<Entry> {
    let SurfaceBinding { persistent, inherited } = surface;
    let ints =
        |name, data: &[u32]| (name, Dtype::U32, vec![data.len()], le_bytes(data, u32::to_le_bytes));
    let floats =
        |name, shape, data: &[f32]| (name, Dtype::F32, shape, le_bytes(data, f32::to_le_bytes));
    let sources: Vec<u32> = persistent.carriers.iter().map(|carrier| carrier.source).collect();
    let carriers: Vec<f32> = persistent
        .carriers
        .iter()
        .flat_map(|c| [c.rest[0], c.rest[1], c.rest[2], c.floor, c.peak])
        .collect();
    let rows: Vec<u32> = inherited.iter().map(|i| i.row).collect();
    let groups: Vec<u32> = inherited.iter().map(|i| i.group.unwrap_or(NO_GROUP)).collect();
    let mut values = Vec::with_capacity(INHERITED * inherited.len());
    for i in inherited {
        values.extend([i.confidence, i.opacity]);
        values.extend(i.color.matrix.as_flattened());
        values.extend(i.color.offset);
        values.push(i.color.harmonics);
    }
    vec![
        ints("lasting.ids", &persistent.ids),
        ints("lasting.offsets", &persistent.offsets),
        ints("lasting.carried_by", &persistent.carrier_indices),
        floats("lasting.weights", vec![persistent.weights.len()], &persistent.weights),
        ints("carriers.sources", &sources),
        floats("carriers.values", vec![sources.len(), CARRIER], &carriers),
        ints("inherited.rows", &rows),
        ints("inherited.groups", &groups),
        floats("inherited.values", vec![rows.len(), INHERITED], &values),
    ]
}

/// `None` for files without these arrays.
///
/// # Errors
/// If the arrays are inconsistent.
pub(super) fn read(
    floats: &impl Fn(&str) -> Result<Vec<f32>, String>,
    ints: &impl Fn(&str) -> Result<Vec<u32>, String>,
    file: &SafeTensors<'_>,
) -> Result<Option<SurfaceBinding>, String> {
    if file.tensor("inherited.rows").is_err() {
        return Ok(None);
    }
    let sources = ints("carriers.sources")?;
    let values = floats("carriers.values")?;
    if values.len() != CARRIER * sources.len() {
        return Err("the arrays of carriers are inconsistent".to_owned());
    }
    let carrier = |(&source, values): (&u32, &[f32; CARRIER])| {
        let [x, y, z, floor, peak] = *values;
        Carrier { source, rest: [x, y, z], floor, peak }
    };
    let carriers = sources.iter().zip(values.as_chunks::<CARRIER>().0).map(carrier).collect();
    let (rows, groups) = (ints("inherited.rows")?, ints("inherited.groups")?);
    let values = floats("inherited.values")?;
    if groups.len() != rows.len() || values.len() != INHERITED * rows.len() {
        return Err("the arrays of inherited edits are inconsistent".to_owned());
    }
    let inherited = rows
        .iter()
        .zip(&groups)
        .zip(values.as_chunks::<INHERITED>().0)
        .map(|((&row, &group), values)| {
            let [confidence, opacity, a, b, c, d, e, f, g, h, i, red, green, blue, harmonics] =
                *values;
            Inherited {
                row,
                confidence,
                opacity,
                color: ColorChange {
                    matrix: [[a, b, c], [d, e, f], [g, h, i]],
                    offset: [red, green, blue],
                    harmonics,
                },
                group: (group != NO_GROUP).then_some(group),
            }
        })
        .collect();
    let persistent = PersistentSplats {
        ids: ints("lasting.ids")?,
        offsets: ints("lasting.offsets")?,
        carrier_indices: ints("lasting.carried_by")?,
        weights: floats("lasting.weights")?,
        carriers,
    };
    Ok(Some(SurfaceBinding { persistent, inherited }))
}
