//! One primitive: its splats in mesh coordinates, and their placement in the scene.

use super::GltfError;
use super::accessor::{Source, Values};
use super::document::Primitive;
use super::ellipsoid;
use super::extension::{EXTENSION, SPZ_EXTENSIONS, harmonic_name};
use super::node::Placement;
use crate::axes::{self, Axes};
use crate::spz;
use glam::{DMat3, DQuat, DVec3};
use gs_core::activation::logit;
use gs_core::sh::{C0, MAX_DEGREE, num_coeffs};
use gs_core::{RowPrecision, ShRotation, Splats};
use rayon::prelude::*;
use serde_json::Value;

/// Allowance for the rounding of other writers, in half steps.
const SLACK: f32 = 1.1;
/// Floating-point opacities are clamped to this distance from 0 and 1.
const MIN_OPACITY: f32 = 1e-7;

/// Splats and the precision of each row.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) splats: Splats,
    pub(super) precision: Vec<RowPrecision>,
}

/// The extension object, if the primitive has one.
fn extension(primitive: &Primitive) -> Option<&Value> {
    primitive.extensions.get(EXTENSION)
}

/// Whether a primitive contains splats.
pub(super) fn is_splats(primitive: &Primitive) -> bool {
    extension(primitive).is_some()
}

/// View with SPZ data, if the primitive has it.
fn spz_view(primitive: &Primitive) -> Option<u64> {
    let inner = &extension(primitive)?["extensions"];
    // Some writers put it next to the base extension.
    SPZ_EXTENSIONS.iter().find_map(|name| {
        let found = inner.get(name).or_else(|| primitive.extensions.get(*name))?;
        found["bufferView"].as_u64()
    })
}

/// Rows and SH degree of the attributes; embedded SPZ has its own bounds.
pub(super) fn size(source: &Source<'_>, primitive: &Primitive) -> Result<(u64, usize), GltfError> {
    if spz_view(primitive).is_some() {
        return Ok((0, 0));
    }
    Ok((source.accessor(attribute(primitive, "POSITION")?)?.count, degree(primitive)?))
}

fn attribute(primitive: &Primitive, name: &str) -> Result<usize, GltfError> {
    primitive.attributes.get(name).copied().ok_or_else(|| {
        let found: Vec<&str> = primitive.attributes.keys().map(String::as_str).take(4).collect();
        GltfError::damaged(format!("splats have no attribute `{name}`, found {}", found.join(", ")))
    })
}

/// Highest degree with a coefficient. All coefficients up to that degree are required.
fn degree(primitive: &Primitive) -> Result<usize, GltfError> {
    let has = |k: &usize| primitive.attributes.contains_key(&harmonic_name(*k));
    let highest = (0..num_coeffs(MAX_DEGREE)).rfind(has).unwrap_or_default();
    let degree = highest.isqrt();
    for k in 0..num_coeffs(degree) {
        attribute(primitive, &harmonic_name(k))?;
    }
    Ok(degree)
}

/// Notes on non-default properties of the extension; an error if they change the meaning of splats.
pub(super) fn notes(primitive: &Primitive) -> Result<Vec<String>, GltfError> {
    let Some(extension) = extension(primitive) else { return Ok(Vec::new()) };
    let text = |name: &str, usual: &'static str| -> String {
        extension[name].as_str().unwrap_or(usual).to_owned()
    };
    let kernel = text("kernel", "ellipse");
    if kernel != "ellipse" {
        let what = format!("splats have the kernel `{kernel}`, expected `ellipse`");
        return Err(GltfError::damaged(what));
    }
    let mut notes = Vec::new();
    let projection = text("projection", "perspective");
    if projection != "perspective" {
        notes.push(format!("it is made for {projection} projection; rendered in perspective"));
    }
    match text("colorSpace", "srgb_rec709_display").as_str() {
        "srgb_rec709_display" => {}
        "lin_rec709_display" => notes.push(
            "its colours are linear and were converted to sRGB, exactly for base colours and to \
            first order for SH; blended colours differ slightly"
                .to_owned(),
        ),
        other => notes.push(format!("its colour space `{other}` is unknown; read as sRGB")),
    }
    Ok(notes)
}

/// Reads the splats of a primitive of `count` rows and SH degree `degree`, in the coordinates of
/// its mesh.
pub(super) fn read(
    source: &Source<'_>,
    primitive: &Primitive,
    (count, degree): (usize, usize),
) -> Result<Part, GltfError> {
    let mut part = match spz_view(primitive) {
        Some(view) => {
            let view = usize::try_from(view).unwrap_or(usize::MAX);
            let mut frame = spz::read(source.bytes(view)?)?;
            axes::convert(&mut frame.splats, Axes::PLY, Axes::LUF);
            let row = |row| frame.precision.as_ref().map_or(RowPrecision::EXACT, |p| *p.of(row));
            let precision = (0..frame.splats.len()).map(row).collect();
            Part { splats: frame.splats, precision }
        }
        None => attributes(source, primitive, count, degree)?,
    };
    let linear = extension(primitive)
        .is_some_and(|extension| extension["colorSpace"].as_str() == Some("lin_rec709_display"));
    if linear {
        let coeffs = part.splats.sh_coeffs();
        part.splats.sh.par_chunks_exact_mut(coeffs).for_each(encode_srgb);
    }
    Ok(part)
}

fn attributes(
    source: &Source<'_>,
    primitive: &Primitive,
    count: usize,
    degree: usize,
) -> Result<Part, GltfError> {
    let named = |name: &str| -> Result<(usize, String), GltfError> {
        let name = format!("{EXTENSION}:{name}");
        Ok((attribute(primitive, &name)?, name))
    };
    let means: Values<3> = source.values(attribute(primitive, "POSITION")?, "POSITION", count)?;
    let (index, name) = named("ROTATION")?;
    let rotations: Values<4> = source.values(index, &name, count)?;
    let (index, name) = named("SCALE")?;
    let scales: Values<3> = source.values(index, &name, count)?;
    let (index, name) = named("OPACITY")?;
    let opacities: Values<1> = source.values(index, &name, count)?;
    let coeffs = num_coeffs(degree);
    let mut sh = vec![[0.0; 3]; count * coeffs];
    let mut sh_half_step = [0.0_f32; 4];
    for k in 0..coeffs {
        let name = harmonic_name(k);
        let values: Values<3> = source.values(attribute(primitive, &name)?, &name, count)?;
        for (row, value) in values.rows.iter().enumerate() {
            sh[row * coeffs + k] = *value;
        }
        let slot = &mut sh_half_step[k.isqrt()];
        *slot = slot.max(values.half_step);
    }
    let off = scales.half_step;
    let minimum = (0.5 * off).max(f32::MIN_POSITIVE);
    let nearest = (0.5 * opacities.half_step).max(MIN_OPACITY);
    let sh_precision =
        |of: usize| if of <= degree { SLACK * sh_half_step[of] } else { f32::INFINITY };
    let row = |scale: &[f32; 3]| RowPrecision {
        means: [SLACK * means.half_step; 3],
        rotation_rad: SLACK * 4.0 * rotations.half_step,
        // The written value lies within half a step on either side.
        log_scales: scale.map(|value| {
            if value > off { SLACK * (value / (value - off)).ln() } else { std::f32::consts::LN_2 }
        }),
        log_scale_range: [minimum.ln(), f32::INFINITY],
        opacity: (SLACK * opacities.half_step).max(MIN_OPACITY),
        sh_dc: [SLACK * sh_half_step[0]; 3],
        sh_rest: [1, 2, 3].map(sh_precision),
        ..RowPrecision::EXACT
    };
    let precision = scales.rows.iter().map(row).collect();
    let splats = Splats {
        means: means.rows,
        quats: rotations.rows.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect(),
        // Negative scales are damage and become NaN.
        log_scales: scales
            .rows
            .iter()
            .map(|scale| scale.map(|value| if value == 0.0 { minimum } else { value }.ln()))
            .collect(),
        opacity_logits: opacities
            .rows
            .iter()
            .map(|[value]| logit(value.clamp(nearest, 1.0 - nearest)))
            .collect(),
        sh,
        sh_degree: degree,
    };
    Ok(Part { splats, precision })
}

/// Converts linear colours to sRGB: the transfer curve for the base
/// colour, its slope for view-dependent coefficients.
fn encode_srgb(sh: &mut [[f32; 3]]) {
    for channel in 0..3 {
        let linear = 0.5 + C0 * sh[0][channel];
        let (value, slope) = if linear <= 0.003_130_8 {
            (12.92 * linear, 12.92)
        } else {
            (1.055 * linear.powf(1.0 / 2.4) - 0.055, 1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0))
        };
        sh[0][channel] = (value - 0.5) / C0;
        for rgb in &mut sh[1..] {
            rgb[channel] *= slope;
        }
    }
}

impl Part {
    /// Transforms the splats of a mesh to the scene.
    #[expect(clippy::cast_possible_truncation, reason = "splats are single precision")]
    pub(super) fn place(&mut self, placement: &Placement) {
        if placement.is_still() {
            return;
        }
        let splats = &mut self.splats;
        splats.means.par_iter_mut().for_each(|mean| {
            let local = DVec3::from_array(mean.map(f64::from));
            *mean = placement.point(local).to_array().map(|value| value as f32);
        });
        let quat = |q: [f32; 4]| {
            let [w, x, y, z] = q.map(f64::from);
            DQuat::from_xyzw(x, y, z, w)
        };
        let stored = |q: DQuat| [q.w, q.x, q.y, q.z].map(|value| value as f32);
        if let Some(factor) = placement.uniform_scale() {
            let larger = factor.ln() as f32;
            splats.quats.par_iter_mut().for_each(|q| *q = stored(placement.rotation * quat(*q)));
            splats.log_scales.par_iter_mut().for_each(|row| *row = row.map(|v| v + larger));
        } else {
            let stretch = DMat3::from_diagonal(placement.scale);
            splats.quats.par_iter_mut().zip(&mut splats.log_scales).for_each(|(q, row)| {
                let unit = quat(*q);
                // A zero quaternion is damage and stays zero.
                if unit.length_squared() > 0.0 {
                    let scale = DVec3::from_array(row.map(|value| f64::from(value).exp()));
                    let shape = DMat3::from_quat(unit.normalize()) * DMat3::from_diagonal(scale);
                    let (axes, deviations) = ellipsoid::axes_of(stretch * shape);
                    *q = stored(placement.rotation * axes);
                    *row = deviations.to_array().map(|value| value.ln() as f32);
                }
            });
        }
        let rotation = placement.rotation;
        let coeffs = splats.sh_coeffs();
        let harmonics = ShRotation::new([rotation.w, rotation.x, rotation.y, rotation.z]);
        splats.sh.par_chunks_exact_mut(coeffs).for_each(|sh| harmonics.apply(sh));
        let stretched = placement.uniform_scale().is_none();
        for row in &mut self.precision {
            let matrix = DMat3::from_quat(rotation);
            let local = DVec3::from_array(row.means.map(f64::from)) * placement.scale;
            row.means = std::array::from_fn(|axis| {
                (matrix.row(axis).abs().dot(local) * (1.0 + f64::from(f32::EPSILON))) as f32
            });
            if stretched {
                // Axes are permuted and lengths mixed, so the coarsest axis bounds all.
                row.log_scales = [row.log_scales.into_iter().fold(0.0, f32::max); 3];
            }
            if placement.uniform_scale() != Some(1.0) {
                let larger = placement.scale.max_element().ln() as f32;
                row.log_scale_range = row.log_scale_range.map(|value| value + larger);
            }
        }
    }
}
