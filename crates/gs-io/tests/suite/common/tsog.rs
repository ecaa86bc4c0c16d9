//! Writes `.tsog` archives.

use gs_core::{quat, sh};
use gs_deform::PolynomialScene;
use image::ExtendedColorType;
use image::codecs::webp::WebPEncoder;
use serde_json::{Value, json};
use std::io::Write;

/// A plane: its name and pixels, in one row.
pub(crate) type Plane = (&'static str, Vec<[u8; 4]>);

/// Largest number of pixels of a row; WebP images have at most 16384.
const WIDTH: usize = 4096;

/// An image of these pixels.
pub(crate) fn webp(pixels: &[[u8; 4]], width: usize) -> Vec<u8> {
    let height = pixels.len().div_ceil(width);
    let mut padded = pixels.to_vec();
    padded.resize(width * height, [0; 4]);
    let size = [width, height].map(|side| u32::try_from(side).unwrap());
    let mut bytes = Vec::new();
    WebPEncoder::new_lossless(&mut bytes)
        .encode(padded.as_flattened(), size[0], size[1], ExtendedColorType::Rgba8)
        .unwrap();
    bytes
}

/// An archive of these entries.
pub(crate) fn zip(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// An archive of metadata and planes.
pub(crate) fn archive(meta: &Value, planes: &[Plane]) -> Vec<u8> {
    let mut entries = vec![("meta.json", meta.to_string().into_bytes())];
    for (name, pixels) in planes {
        entries.push((name, webp(pixels, pixels.len().min(WIDTH))));
    }
    zip(&entries)
}

/// Smallest and largest value of each column.
fn range<const D: usize>(rows: &[[f32; D]]) -> ([f32; D], [f32; D]) {
    let (mut low, mut high) = ([f32::INFINITY; D], [f32::NEG_INFINITY; D]);
    for row in rows {
        for k in 0..D {
            (low[k], high[k]) = (low[k].min(row[k]), high[k].max(row[k]));
        }
    }
    (low, high)
}

/// Rows as 16-bit codes of their range: the planes of low and high bytes.
fn codes<const D: usize>(rows: &[[f32; D]], low: [f32; D], high: [f32; D]) -> [Vec<[u8; 4]>; 2] {
    let mut planes = [Vec::new(), Vec::new()];
    for row in rows {
        let mut bytes = [[255; 4]; 2];
        for k in 0..D {
            let share = if high[k] > low[k] { (row[k] - low[k]) / (high[k] - low[k]) } else { 0.0 };
            let code = (share * 65535.0).round() as u16;
            [bytes[0][k], bytes[1][k]] = code.to_le_bytes();
        }
        for (plane, bytes) in planes.iter_mut().zip(bytes) {
            plane.push(bytes);
        }
    }
    planes
}

/// 256 values from the smallest to the largest, and the index of the closest for each.
fn book(rows: &[[f32; 3]]) -> (Vec<f32>, Vec<[u8; 3]>) {
    let flat = rows.as_flattened();
    let low = flat.iter().copied().fold(f32::INFINITY, f32::min);
    let high = flat.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let step = ((high - low) / 255.0).max(f32::MIN_POSITIVE);
    let values = (0..256_u16).map(|i| low + step * f32::from(i)).collect();
    let index = |value: f32| ((value - low) / step).round().clamp(0.0, 255.0) as u8;
    (values, rows.iter().map(|row| row.map(index)).collect())
}

fn pixels(rgb: Vec<[u8; 3]>, alpha: impl Iterator<Item = u8>) -> Vec<[u8; 4]> {
    rgb.into_iter().zip(alpha).map(|([r, g, b], a)| [r, g, b, a]).collect()
}

/// The three smaller components of a rotation, and the slot of the largest.
fn rotation(raw: [f32; 4]) -> [u8; 4] {
    let q = quat::normalize(raw);
    let slot = (0..4).max_by(|&a, &b| q[a].abs().total_cmp(&q[b].abs())).unwrap();
    let sign = q[slot].signum();
    let mut out = [0, 0, 0, 252 + u8::try_from(slot).unwrap()];
    let others = (0..4).filter(|&k| k != slot);
    for (byte, k) in out.iter_mut().zip(others) {
        let share = 0.5 + 0.5 * sign * q[k] * std::f32::consts::SQRT_2;
        *byte = (share * 255.0).round() as u8;
    }
    out
}

/// A continuous archive of a scene whose splats move along lines, within 16 or 8 bits. Splats that
/// do not fade must have a finite lifetime.
pub(crate) fn continuous(scene: &PolynomialScene) -> Vec<u8> {
    let (rest, motions) = (scene.rest(), scene.motions());
    let logs: Vec<[f32; 3]> =
        rest.means.iter().map(|mean| mean.map(|x| x.abs().ln_1p().copysign(x))).collect();
    let times: Vec<[f32; 2]> = motions
        .iter()
        .map(|motion| [motion.centre, motion.width * std::f32::consts::FRAC_1_SQRT_2])
        .collect();
    let velocities: Vec<[f32; 3]> = motions.iter().map(|motion| motion.velocity[0]).collect();
    let (position, time, speed) = (range(&logs), range(&times), range(&velocities));
    let [means_l, means_u] = codes(&logs, position.0, position.1);
    let [time_l, time_u] = codes(&times, time.0, time.1);
    let [speed_l, speed_u] = codes(&velocities, speed.0, speed.1);
    let (scale_book, scales) = book(&rest.log_scales);
    let dc: Vec<[f32; 3]> = rest.sh.chunks(rest.sh_coeffs()).map(|sh| sh[0]).collect();
    let (color_book, colors) = book(&dc);
    assert_eq!(sh::num_coeffs(0), rest.sh_coeffs(), "no SH palette is written");
    let alpha = (0..rest.len()).map(|row| (rest.opacity(row) * 255.0).round() as u8);
    let opaque = std::iter::repeat(255);
    let meta = json!({
        "version": 4,
        "count": rest.len(),
        "means": {"mins": position.0, "maxs": position.1, "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": scale_book, "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": color_book, "files": ["sh0.webp"]},
        "timeline": {"type": 1, "mins": time.0, "maxs": time.1, "files": ["time_l.webp", "time_u.webp"]},
        "temporal": {"means": {"mins": [speed.0], "maxs": [speed.1], "files": ["speed_l.webp", "speed_u.webp"]}},
        "playback": {"duration": 2.0, "fps": 30.0}
    });
    archive(
        &meta,
        &[
            ("means_l.webp", means_l),
            ("means_u.webp", means_u),
            ("scales.webp", pixels(scales, opaque)),
            ("quats.webp", rest.quats.iter().map(|&quat| rotation(quat)).collect()),
            ("sh0.webp", pixels(colors, alpha)),
            ("time_l.webp", time_l),
            ("time_u.webp", time_u),
            ("speed_l.webp", speed_l),
            ("speed_u.webp", speed_u),
        ],
    )
}
