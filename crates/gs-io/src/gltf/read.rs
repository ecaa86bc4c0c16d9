//! Reading glTF.

use super::GltfError;
use super::accessor::Source;
use super::container::{Parts, buffers};
use super::document::Document;
use super::extension::{EXTENSION, SPZ_EXTENSIONS, USUAL_AXES};
use super::node::placements;
use super::primitive::{self, Part, is_splats};
use crate::archive::decompress;
use crate::axes::{self, Axes, AxesReading};
use crate::frame::{Frame, FrameFormat};
use gs_core::sh::num_coeffs;
use gs_core::{Precision, RowPrecision, Splats};
use std::sync::Arc;

/// Required extensions that are supported or irrelevant for splats.
const KNOWN: [&str; 5] = [
    EXTENSION,
    SPZ_EXTENSIONS[0],
    SPZ_EXTENSIONS[1],
    "KHR_mesh_quantization",
    "KHR_materials_unlit",
];

/// Returns the bytes of an external file of a glTF by its URI, or an error message.
pub type External<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

/// Reads all splats of the default scene of a `.glb` or `.gltf`, with the
/// transformations of their nodes, converted to the axes of PLYs; [`Frame::axes`] has
/// the original axes. `external` returns the bytes of external files.
///
/// # Errors
/// If it is damaged, has no splats, requires an unsupported extension, mirrors or shears splats, or
/// declares more of them than its size allows.
pub fn read(bytes: &[u8], external: &External<'_>) -> Result<Frame, GltfError> {
    let parts = Parts::of(bytes)?;
    let document: Document = serde_json::from_slice(parts.json)
        .map_err(|error| GltfError::damaged(format!("its JSON: {error}")))?;
    if !document.asset.version.starts_with("2.") {
        let what = format!("version `{}`, expected 2.0", document.asset.version);
        return Err(GltfError::damaged(what));
    }
    let unknown = |name: &&String| !KNOWN.contains(&name.as_str());
    if let Some(name) = document.extensions_required.iter().find(unknown) {
        let what = format!("it requires the unsupported extension {name}; export it without");
        return Err(GltfError::damaged(what));
    }
    let has_splats = |mesh: usize| {
        document.meshes.get(mesh).is_some_and(|mesh| mesh.primitives.iter().any(is_splats))
    };
    let placements = placements(&document, &has_splats)?;
    if placements.is_empty() {
        let found = if (0..document.meshes.len()).any(has_splats) {
            "a glTF whose splats are not in its scene"
        } else {
            "a glTF without Gaussian splats (KHR_gaussian_splatting)"
        };
        return Err(GltfError::NoSplats { found });
    }
    let buffers = buffers(&document, parts.binary, external)?;
    let source = Source { document: &document, buffers: &buffers };
    let primitives: Vec<_> = placements
        .iter()
        .flat_map(|placement| {
            let all = document.meshes[placement.mesh].primitives.iter();
            all.filter(|primitive| is_splats(primitive)).map(move |found| (placement, found))
        })
        .collect();

    // Sizes are checked first, because accessors may share bytes, and nodes meshes.
    let available = decompress::limit(bytes.len() + buffers.iter().map(|b| b.len()).sum::<usize>());
    let mut needed = 0_u64;
    let mut sizes = Vec::with_capacity(primitives.len());
    for (_, found) in &primitives {
        let (count, degree) = primitive::size(&source, found)?;
        let row = 4 * (11 + 3 * num_coeffs(degree)) + size_of::<RowPrecision>();
        needed = needed.saturating_add(count.saturating_mul(row as u64));
        sizes.push((usize::try_from(count).unwrap_or(usize::MAX), degree));
    }
    let mut notes = Vec::new();
    let mut read: Vec<Part> = Vec::with_capacity(primitives.len());
    for ((placement, found), size) in primitives.iter().zip(sizes) {
        if needed > available {
            let what = format!(
                "its splats need {needed} bytes, more than a file of this size can \
                        contain"
            );
            return Err(GltfError::damaged(what));
        }
        for note in primitive::notes(found)? {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        let mut part = primitive::read(&source, found, size)?;
        part.place(placement);
        if size.0 == 0 {
            // Embedded SPZ, whose size is known only now; several nodes may use it.
            needed = needed.saturating_add(size_of_val(&part.splats.means[..]) as u64 * 20);
        }
        read.push(part);
    }
    let (mut splats, precision) = join(read);
    if splats.is_empty() {
        return Err(GltfError::Empty);
    }
    let axes = USUAL_AXES[0];
    axes::convert(&mut splats, axes, Axes::PLY);
    Ok(Frame {
        splats,
        format: FrameFormat::Gltf,
        precision: Some(Arc::new(Precision::by_chunk(precision, 1))),
        axes: Some(AxesReading { axes, stated: false, usual: &USUAL_AXES }),
        notes,
        comments: comments(&document),
    })
}

/// Joins all parts, with the highest SH degree among them.
fn join(parts: Vec<Part>) -> (Splats, Vec<RowPrecision>) {
    let degree = parts.iter().map(|part| part.splats.sh_degree).max().unwrap_or_default();
    let count = parts.iter().map(|part| part.splats.len()).sum();
    let mut all = Splats::with_capacity(count, degree);
    let mut rows = Vec::new();
    for part in parts {
        let splats = if part.splats.sh_degree == degree {
            part.splats
        } else {
            part.splats.with_sh_degree(degree)
        };
        rows.extend(part.precision);
        all.means.extend(splats.means);
        all.quats.extend(splats.quats);
        all.log_scales.extend(splats.log_scales);
        all.opacity_logits.extend(splats.opacity_logits);
        all.sh.extend(splats.sh);
    }
    (all, rows)
}

/// Comments, which our writer stores in `asset.extras`.
fn comments(document: &Document) -> Vec<String> {
    let texts = document.asset.extras["comments"].as_array();
    let texts = texts.into_iter().flatten().filter_map(|text| text.as_str());
    texts.map(str::to_owned).collect()
}
