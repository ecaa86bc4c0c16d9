//! Writing compressed PLY.

use super::layout::{BITS, CHUNK, COLUMNS, MAX_LOG_SCALE, MAX_SH, WORDS};
use super::pack::{from_harmonic, harmonic, rotation, top, vector};
use crate::bytes8::{channel_of, unorm8};
use crate::format_losses::FormatLosses;
use crate::sh_error::ShError;
use gs_core::{Splats, sh};
use rayon::prelude::*;
use std::io::{self, Write};

/// Options for writing a compressed PLY.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// Comment lines of the header; control characters become spaces.
    pub comments: Vec<String>,
    /// SH degree of the file, at most that of the splats; `None` takes [`kept_degree`].
    pub sh_degree: Option<usize>,
    /// Rows in the order in which they are written; `None` keeps the order of the splats.
    /// Neighbours in the file share a chunk; see [`morton_order`].
    pub order: Option<Vec<usize>>,
}

/// The highest SH degree with a coefficient that reaches half a quantisation step (1/64) in some
/// splat. Above it, the format would change zeros to ±1/64, because it cannot store 0.
pub fn kept_degree(splats: &Splats) -> usize {
    let coeffs = splats.sh_coeffs();
    let reaches = |rgb: &[f32; 3]| rgb.iter().any(|value| value.abs() >= MAX_SH / 256.0);
    let highest = splats
        .sh
        .par_chunks_exact(coeffs)
        .map(|sh| sh.iter().rposition(reaches).unwrap_or(0))
        .max()
        .unwrap_or(0);
    (0..=splats.sh_degree)
        .find(|&degree| highest < sh::num_coeffs(degree))
        .unwrap_or(splats.sh_degree)
}

/// The rows of `splats` along a space-filling curve (Morton codes of 10 bits an axis):
/// neighbours in the file are neighbours in space, which makes chunks small and their
/// values precise. Rows of equal code keep their order.
pub fn morton_order(splats: &Splats) -> Vec<usize> {
    let (min, max) = splats.bounds().unwrap_or_default();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 10 bits"
    )]
    let cell = |value: f32, axis: usize| {
        let unit = (value - min[axis]) / (max[axis] - min[axis]).max(f32::MIN_POSITIVE);
        (unit * 1024.0).clamp(0.0, 1023.0) as u32
    };
    let spread = |mut v: u32| {
        v = (v | v << 16) & 0x0300_00ff;
        v = (v | v << 8) & 0x0300_f00f;
        v = (v | v << 4) & 0x030c_30c3;
        (v | v << 2) & 0x0924_9249
    };
    let code = |mean: &[f32; 3]| {
        (0..3).fold(0, |code, axis| code | spread(cell(mean[axis], axis)) << axis)
    };
    let mut order: Vec<(u32, usize)> = splats.means.iter().map(code).zip(0..).collect();
    order.par_sort_unstable();
    order.into_iter().map(|(_, row)| row).collect()
}

/// Writes a compressed PLY and returns the losses. Rows that are not finite
/// are written as zeros and counted in the losses.
///
/// # Errors
/// If the arrays of `splats` have inconsistent lengths or `order` contains rows out of range
/// ([`io::ErrorKind::InvalidInput`]), or writing fails.
pub fn write(
    splats: &Splats,
    options: &WriteOptions,
    out: &mut impl Write,
) -> io::Result<FormatLosses> {
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    splats.check_shapes().map_err(|error| invalid(error.to_string()))?;
    let order: Vec<usize> = options.order.clone().unwrap_or_else(|| (0..splats.len()).collect());
    if let Some(row) = order.iter().find(|&&row| row >= splats.len()) {
        return Err(invalid(format!("row {row} of {} splats", splats.len())));
    }
    let degree = options.sh_degree.map_or_else(|| kept_degree(splats), |d| d.min(splats.sh_degree));
    out.write_all(header(order.len(), degree, &options.comments).as_bytes())?;
    let packed: Vec<Chunk> = order.par_chunks(CHUNK).map(|rows| Chunk::of(splats, rows)).collect();
    for chunk in &packed {
        out.write_all(&le_bytes(chunk.range.iter().map(|value| value.to_bits())))?;
    }
    for chunk in &packed {
        out.write_all(&le_bytes(chunk.words.iter().flatten().copied()))?;
    }
    let coeffs = sh::num_coeffs(degree);
    if coeffs > 1 {
        let mut bytes = Vec::with_capacity(CHUNK * 3 * (coeffs - 1));
        for rows in order.chunks(CHUNK) {
            bytes.clear();
            for &row in rows {
                for channel in 0..3 {
                    bytes.extend(
                        splats.sh_of(row)[1..coeffs].iter().map(|rgb| harmonic(rgb[channel])),
                    );
                }
            }
            out.write_all(&bytes)?;
        }
    }
    Ok(losses(splats, degree, options.sh_degree.is_none(), &packed))
}

fn le_bytes(words: impl Iterator<Item = u32>) -> Vec<u8> {
    words.flat_map(u32::to_le_bytes).collect()
}

fn header(rows: usize, degree: usize, comments: &[String]) -> String {
    let mut lines = vec!["ply".to_owned(), "format binary_little_endian 1.0".to_owned()];
    let one_line = |comment: &String| -> String {
        comment.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
    };
    lines.extend(comments.iter().map(|comment| format!("comment {}", one_line(comment))));
    lines.push(format!("element chunk {}", rows.div_ceil(CHUNK)));
    lines.extend(COLUMNS.iter().map(|name| format!("property float {name}")));
    lines.push(format!("element vertex {rows}"));
    lines.extend(WORDS.iter().map(|name| format!("property uint {name}")));
    let rest = 3 * (sh::num_coeffs(degree) - 1);
    if rest > 0 {
        lines.push(format!("element sh {rows}"));
        lines.extend((0..rest).map(|i| format!("property uchar f_rest_{i}")));
    }
    lines.push("end_header\n".to_owned());
    lines.join("\n")
}

struct Chunk {
    range: [f32; 18],
    words: Vec<[u32; 4]>,
    /// Largest half step of a centre, world units.
    coarsest: f32,
}

impl Chunk {
    fn of(splats: &Splats, rows: &[usize]) -> Self {
        let log_scale = |row: usize| {
            splats.log_scales[row].map(|value| value.clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE))
        };
        let color = |row: usize| splats.sh_of(row)[0].map(channel_of);
        let mean = |row: usize| splats.means[row];
        let ranges = [span(rows, mean), span(rows, log_scale), span(rows, color)];
        let unit = |values: [f32; 3], of: usize| -> [f32; 3] {
            let (min, max) = ranges[of];
            std::array::from_fn(|axis| {
                let width = max[axis] - min[axis];
                if width > 0.0 { (values[axis] - min[axis]) / width } else { 0.0 }
            })
        };
        let words = rows
            .iter()
            .map(|&row| {
                let [r, g, b] = unit(color(row), 2).map(unorm8);
                [
                    vector(unit(mean(row), 0)),
                    rotation(splats.quats[row]),
                    vector(unit(log_scale(row), 1)),
                    u32::from_be_bytes([r, g, b, unorm8(splats.opacity(row))]),
                ]
            })
            .collect();
        let mut range = [0.0; 18];
        for (of, (min, max)) in ranges.iter().enumerate() {
            range[6 * of..][..3].copy_from_slice(min);
            range[6 * of + 3..][..3].copy_from_slice(max);
        }
        let (min, max) = ranges[0];
        let coarsest = (0..3).map(|k| 0.5 * (max[k] - min[k]) / top(BITS[k])).fold(0.0, f32::max);
        Self { range, words, coarsest }
    }
}

/// Smallest and largest finite value per axis, 0 without any.
fn span(rows: &[usize], value: impl Fn(usize) -> [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let mut span = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &row in rows {
        for (axis, value) in value(row).into_iter().enumerate().filter(|(_, v)| v.is_finite()) {
            span.0[axis] = span.0[axis].min(value);
            span.1[axis] = span.1[axis].max(value);
        }
    }
    for axis in 0..3 {
        if span.0[axis] > span.1[axis] {
            (span.0[axis], span.1[axis]) = (0.0, 0.0);
        }
    }
    span
}

/// Effect of quantised coefficients on colours.
fn sh_error(splats: &Splats, degree: usize) -> ShError {
    let mut error = ShError::default();
    let mut read = Vec::new();
    for row in 0..splats.len() {
        let sh = &splats.sh_of(row)[1..];
        read.clear();
        let kept = &sh[..sh::num_coeffs(degree) - 1];
        read.extend(kept.iter().map(|rgb| rgb.map(|value| from_harmonic(harmonic(value)))));
        error.add(sh, &read);
    }
    error
}

fn losses(splats: &Splats, degree: usize, chosen: bool, chunks: &[Chunk]) -> FormatLosses {
    let mut losses = FormatLosses::none();
    if degree < splats.sh_degree {
        losses.push(format!(
            "SH degree {} becomes {degree}{}",
            splats.sh_degree,
            if chosen {
                ": no coefficient above reaches half a quantisation step (1/64)"
            } else {
                ""
            }
        ));
    }
    let coarsest = chunks.iter().map(|chunk| chunk.coarsest).fold(0.0, f32::max);
    losses.push(format!("positions are rounded by at most {coarsest:.1e} units (11, 10 and 11 bits within blocks of {CHUNK} splats)"));
    losses.push("log-scales have 10 or 11 bits, colours and opacities 8 bits within their blocks; rotations are within 0.3°");
    if splats.sh_degree > 0 {
        let kept = if degree == 0 {
            "no SH is stored".to_owned()
        } else {
            format!("SH coefficients are rounded to 1/32 and clipped to ±{MAX_SH}")
        };
        losses.push(format!("{kept}: colours are off by {}", sh_error(splats, degree).in_steps()));
    }
    let broken = (0..splats.len()).filter(|&row| !splats.is_finite(row)).count();
    if broken > 0 {
        losses.push(format!(
            "{broken} splats with NaN values were written at the edge of their block"
        ));
    }
    losses
}
