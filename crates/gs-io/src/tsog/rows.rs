//! Decoding the planes of a `.tsog` archive into splats and their motions.

use super::meta::{Coded, Means, Meta, Palette, Timeline, Velocities};
use crate::bytes8::largest_from;
use crate::plane::{FIRST_SLOT, PALETTE_ROW, Plane};
use gs_core::{Splats, activation, sh};
use gs_deform::Polynomial;

/// Opacities are clamped to this distance from 0 and 1, so that their logits are finite.
const OPACITY_MARGIN: f32 = 1e-6;
/// Largest code of two bytes.
const MAX_CODE: f32 = 65535.0;

/// Access to planes by name; errors are messages.
pub(super) type Planes<'a> = dyn FnMut(&str) -> Result<Plane, String> + 'a;

/// Splats and their motions, `[N]` each.
pub(super) struct Rows {
    pub(super) splats: Splats,
    pub(super) motions: Vec<Polynomial>,
    /// The frame of each splat of a discrete timeline; empty otherwise.
    pub(super) frames: Vec<u16>,
}

/// Decodes all planes.
pub(super) fn decode(
    meta: &Meta,
    timeline: &Timeline,
    velocities: Option<&Velocities>,
    planes: &mut Planes<'_>,
) -> Result<Rows, String> {
    let count = usize::try_from(meta.count).unwrap_or(usize::MAX);
    if count == 0 {
        return Err("contains no splats; export it again with at least one splat".to_owned());
    }
    let mut plane = |name: &str| {
        let plane = planes(name)?;
        if plane.len() < count {
            return Err(format!("{count} splats in a plane of {} pixels (`{name}`)", plane.len()));
        }
        Ok(plane)
    };
    let low = plane(&meta.means.files[0])?;
    let high = plane(&meta.means.files[1])?;
    let scales = plane(&meta.scales.files[0])?;
    let quats = plane(&meta.quats.files[0])?;
    let colors = plane(&meta.sh0.files[0])?;
    let times = match timeline {
        Timeline::Static => None,
        Timeline::Discrete { files, .. } | Timeline::Continuous { files, .. } => {
            Some((plane(&files[0])?, plane(&files[1])?))
        }
    };
    let velocities = velocities
        .map(|range| {
            let second = range.files.get(1).map(|name| plane(name)).transpose()?;
            Ok::<_, String>((range, plane(&range.files[0])?, second))
        })
        .transpose()?;
    let labels = meta.sh_n.as_ref().map(|palette| plane(&palette.files[1])).transpose()?;
    let harmonics = match (&meta.sh_n, labels) {
        (Some(palette), Some(labels)) => Some(Harmonics::new(palette, labels, planes)?),
        _ => None,
    };

    let degree = harmonics.as_ref().map_or(0, |harmonics| harmonics.palette.bands);
    let mut rows = Rows {
        splats: Splats::with_capacity(count, degree),
        motions: Vec::with_capacity(count),
        frames: Vec::new(),
    };
    for i in 0..count {
        let splats = &mut rows.splats;
        splats.means.push(meta.means.at(low.at(i), high.at(i)));
        let [r, g, b, _] = scales.at(i);
        splats.log_scales.push(meta.scales.values("scales", [r, g, b])?);
        splats.quats.push(rotation(quats.at(i)).ok_or_else(|| {
            format!("the rotation of splat {i} has no valid index of the omitted component")
        })?);
        let [r, g, b, alpha] = colors.at(i);
        splats.sh.push(meta.sh0.values("sh0", [r, g, b])?);
        let opacity = (f32::from(alpha) / 255.0).clamp(OPACITY_MARGIN, 1.0 - OPACITY_MARGIN);
        splats.opacity_logits.push(activation::logit(opacity));
        if let Some(harmonics) = &harmonics {
            harmonics.push(i, &mut splats.sh)?;
        }
        let code = times.as_ref().map(|(low, high)| codes(low.at(i), high.at(i)));
        let mut motion = Polynomial {
            velocity: [[0.0; 3]; 3],
            omega: [0.0; 4],
            centre: 0.0,
            width: f32::INFINITY,
        };
        match (timeline, code) {
            (Timeline::Discrete { frames, delta, .. }, Some([code, ..])) => {
                let frame = (u64::from(code) / delta).min(frames - 1);
                rows.frames.push(u16::try_from(frame).unwrap_or(u16::MAX));
            }
            (Timeline::Continuous { mins, maxs, .. }, Some(code)) => {
                let [centre, deviation] =
                    [0, 1].map(|k| lerp(mins[k], maxs[k], f32::from(code[k]) / MAX_CODE));
                motion.centre = centre;
                motion.width = std::f32::consts::SQRT_2 * deviation;
                if let Some((range, low, high)) = &velocities {
                    motion.velocity[0] = velocity(range, low.at(i), high.as_ref().map(|p| p.at(i)));
                }
            }
            _ => {}
        }
        rows.motions.push(motion);
    }
    Ok(rows)
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Two-byte codes of the channels.
fn codes(low: [u8; 4], high: [u8; 4]) -> [u16; 3] {
    [0, 1, 2].map(|k| u16::from_le_bytes([low[k], high[k]]))
}

/// The rotation of a pixel, wxyz; `None` if its alpha is not an index of the omitted component.
fn rotation([a, b, c, slot]: [u8; 4]) -> Option<[f32; 4]> {
    let slot = slot.checked_sub(FIRST_SLOT)?;
    let part = |byte: u8| (f32::from(byte) / 255.0 * 2.0 - 1.0) * std::f32::consts::FRAC_1_SQRT_2;
    Some(gs_core::quat::normalize(largest_from([a, b, c].map(part), usize::from(slot))))
}

/// Velocity in units of length per whole clip.
fn velocity(range: &Velocities, low: [u8; 4], high: Option<[u8; 4]>) -> [f32; 3] {
    let share = match high {
        Some(high) => codes(low, high).map(|code| f32::from(code) / MAX_CODE),
        None => [0, 1, 2].map(|k| f32::from(low[k]) / 255.0),
    };
    [0, 1, 2].map(|k| lerp(range.mins[0][k], range.maxs[0][k], share[k]))
}

impl Means {
    fn at(&self, low: [u8; 4], high: [u8; 4]) -> [f32; 3] {
        let codes = codes(low, high);
        [0, 1, 2].map(|k| {
            let log = lerp(self.mins[k], self.maxs[k], f32::from(codes[k]) / MAX_CODE);
            log.abs().exp_m1().copysign(log)
        })
    }
}

impl Coded {
    fn values(&self, name: &str, indices: [u8; 3]) -> Result<[f32; 3], String> {
        values(name, &self.codebook, indices)
    }
}

fn values(name: &str, codebook: &[f32], indices: [u8; 3]) -> Result<[f32; 3], String> {
    let mut found = [0.0; 3];
    for (value, index) in found.iter_mut().zip(indices) {
        *value = *codebook.get(usize::from(index)).ok_or_else(|| {
            format!("index {index} in the codebook of {name}, which has {} values", codebook.len())
        })?;
    }
    Ok(found)
}

/// SH above degree 0.
struct Harmonics<'a> {
    palette: &'a Palette,
    centroids: Plane,
    labels: Plane,
    /// Coefficients of a splat.
    count: usize,
}

impl<'a> Harmonics<'a> {
    fn new(palette: &'a Palette, labels: Plane, planes: &mut Planes<'_>) -> Result<Self, String> {
        let count = sh::num_coeffs(palette.bands) - 1;
        let centroids = planes(&palette.files[0])?;
        let width = PALETTE_ROW * count;
        let rows = palette.count.div_ceil(PALETTE_ROW);
        if centroids.width() != width || centroids.len() < rows.saturating_mul(width) {
            return Err(format!(
                "a palette of {} pixels, {} wide, expected {rows} rows of {width}",
                centroids.len(),
                centroids.width()
            ));
        }
        Ok(Self { palette, centroids, labels, count })
    }

    /// Appends the coefficients of a splat.
    fn push(&self, i: usize, out: &mut Vec<[f32; 3]>) -> Result<(), String> {
        let [low, high, ..] = self.labels.at(i);
        let label = usize::from(u16::from_le_bytes([low, high]));
        if label >= self.palette.count {
            return Err(format!(
                "splat {i} has entry {label} of a palette of {}",
                self.palette.count
            ));
        }
        let start = label / PALETTE_ROW * self.centroids.width() + label % PALETTE_ROW * self.count;
        for at in start..start + self.count {
            let [r, g, b, _] = self.centroids.at(at);
            out.push(values("shN", &self.palette.codebook, [r, g, b])?);
        }
        Ok(())
    }
}
