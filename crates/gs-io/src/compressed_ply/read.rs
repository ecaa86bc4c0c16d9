//! Reading compressed PLY.

use super::CompressedPlyError;
use super::layout::{BITS, CHUNK, COLUMNS, MAX_LOG_SCALE, MAX_SH, WORDS};
use super::pack::{from_harmonic, from_rotation, from_vector, rotation_component, top};
use crate::bytes8::{dc_of, ends_note, logit_of, smallest_three_rad};
use crate::frame::{Frame, FrameFormat, Shape};
use crate::ply::{Cursor, Element, Encoding, Header, PlyError, PropertyKind, Scalar};
use gs_core::sh::{C0, degree_of};
use gs_core::{Precision, RowPrecision, Splats};
use rayon::prelude::*;
use std::sync::Arc;

/// Range width below which PlayCanvas writes every value as the minimum.
const FLAT: f32 = 1e-5;
/// Allowance for the rounding of other writers, in half steps.
const SLACK: f32 = 1.1;

/// Whether `bytes` start with the header of a compressed PLY.
pub(crate) fn is_compressed(bytes: &[u8]) -> bool {
    Header::parse(bytes).is_ok_and(|header| header.gaussians() == Err(PlyError::Compressed))
}

fn element<'a>(header: &'a Header, name: &str) -> Option<(usize, &'a Element)> {
    header.elements.iter().enumerate().find(|(_, element)| element.name == name)
}

fn missing(what: &str) -> CompressedPlyError {
    CompressedPlyError::damaged(format!("missing {what}"))
}

/// Size of the frame, from its header.
pub(crate) fn shape(header: &Header) -> Result<Shape, CompressedPlyError> {
    let (_, vertex) = element(header, "vertex").ok_or_else(|| missing("element `vertex`"))?;
    if vertex.count == 0 {
        return Err(CompressedPlyError::Empty);
    }
    let rest = element(header, "sh").map_or(0, |(_, sh)| sh.properties.len());
    let sh_degree =
        rest.is_multiple_of(3).then(|| degree_of(rest / 3 + 1)).flatten().ok_or_else(|| {
            CompressedPlyError::damaged(format!("{rest} columns of `sh`, expected 9, 24 or 45"))
        })?;
    Ok(Shape { format: FrameFormat::CompressedPly, num_splats: vertex.count, sh_degree })
}

/// Reads a compressed PLY, with or without colour ranges and SH.
///
/// # Errors
/// If it is a different format, text, truncated, or lacks a column.
pub fn read(bytes: &[u8]) -> Result<Frame, CompressedPlyError> {
    let header = Header::parse(bytes)?;
    if header.encoding == Encoding::Ascii {
        return Err(CompressedPlyError::damaged("it is text, expected binary data"));
    }
    let Shape { num_splats, sh_degree, .. } = shape(&header)?;
    let chunks = Table::of(&header, bytes, "chunk")?;
    let words = Table::of(&header, bytes, "vertex")?;
    let harmonics = if sh_degree > 0 { Some(Table::of(&header, bytes, "sh")?) } else { None };
    let rows = words.rows();
    let needed = rows.div_ceil(CHUNK);
    if chunks.rows() < needed {
        let what = format!("{} chunks for {num_splats} splats, expected {needed}", chunks.rows());
        return Err(CompressedPlyError::damaged(what));
    }
    if let Some(sh) = &harmonics
        && sh.rows() < rows
    {
        let what = format!("{} rows of `sh` for {num_splats} splats", sh.rows());
        return Err(CompressedPlyError::damaged(what));
    }
    let has_colors = chunks.column("min_r").is_some();
    let ranges = ranges(&chunks, needed, has_colors)?;
    let [position, rotation, scale, color] = columns(&words, WORDS)?;
    let word = |column: Column, row: usize| words.word(column, row);

    let per_row = |row: usize| {
        let range = &ranges[row / CHUNK];
        let rgba = word(color, row).to_be_bytes();
        let unit = [0, 1, 2].map(|channel| f32::from(rgba[channel]) / 255.0);
        let rgb = range.color.at(unit);
        (
            range.mean.at(from_vector(word(position, row))),
            from_rotation(word(rotation, row)),
            range.log_scale.at(from_vector(word(scale, row))),
            (logit_of(rgba[3]), rgb.map(dc_of)),
        )
    };
    let mut splats = Splats {
        means: vec![[0.0; 3]; rows],
        quats: vec![[0.0; 4]; rows],
        log_scales: vec![[0.0; 3]; rows],
        opacity_logits: vec![0.0; rows],
        sh: vec![[0.0; 3]; rows],
        sh_degree,
    };
    let geometry = splats.means.par_iter_mut().zip(&mut splats.quats).zip(&mut splats.log_scales);
    let appearance = splats.opacity_logits.par_iter_mut().zip(&mut splats.sh);
    geometry.zip(appearance).enumerate().for_each(|(row, (((mean, quat), scale), (logit, dc)))| {
        (*mean, *quat, *scale, (*logit, *dc)) = per_row(row);
    });
    if let Some(table) = &harmonics {
        splats.sh = interleave(&splats.sh, table, sh_degree)?;
    }
    let alphas = (0..rows).map(|row| word(color, row).to_be_bytes()[3]);
    let precision = ranges.iter().map(|range| range.precision(sh_degree)).collect();
    Ok(Frame {
        notes: ends_note(alphas).into_iter().collect(),
        splats,
        format: FrameFormat::CompressedPly,
        axes: None,
        precision: Some(Arc::new(Precision::by_chunk(precision, CHUNK))),
        comments: header.comments,
    })
}

/// DC coefficients, and the channel-major bytes of the others.
fn interleave(
    dc: &[[f32; 3]],
    table: &Table<'_>,
    degree: usize,
) -> Result<Vec<[f32; 3]>, CompressedPlyError> {
    let higher = gs_core::sh::num_coeffs(degree) - 1;
    let columns = (0..3 * higher)
        .map(|i| {
            let name = format!("f_rest_{i}");
            table.column(&name).ok_or_else(|| missing(&format!("column `{name}`")))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut sh = vec![[0.0; 3]; dc.len() * (higher + 1)];
    sh.par_chunks_exact_mut(higher + 1).enumerate().for_each(|(row, out)| {
        out[0] = dc[row];
        for k in 0..higher {
            out[1 + k] =
                [0, 1, 2].map(|channel| table.harmonic(columns[channel * higher + k], row));
        }
    });
    Ok(sh)
}

/// Rows of fixed width.
struct Table<'a> {
    element: &'a Element,
    bytes: &'a [u8],
    stride: usize,
    big_endian: bool,
}

#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    scalar: Scalar,
}

impl<'a> Table<'a> {
    fn of(header: &'a Header, bytes: &'a [u8], name: &str) -> Result<Self, CompressedPlyError> {
        let (index, element) =
            element(header, name).ok_or_else(|| missing(&format!("element `{name}`")))?;
        let rows = Cursor::at_element(header, bytes, index)?.fixed_rows(element)?;
        let stride = element.stride().filter(|&stride| stride > 0);
        let (Some(bytes), Some(stride)) = (rows, stride) else {
            return Err(CompressedPlyError::damaged(format!("`{name}` has lists or no columns")));
        };
        let big_endian = header.encoding == Encoding::BigEndian;
        Ok(Self { element, bytes, stride, big_endian })
    }

    fn rows(&self) -> usize {
        self.bytes.len() / self.stride
    }

    fn column(&self, name: &str) -> Option<Column> {
        let mut offset = 0;
        for property in &self.element.properties {
            let PropertyKind::Scalar(scalar) = property.kind else { return None };
            if property.name == name {
                return Some(Column { offset, scalar });
            }
            offset += scalar.size();
        }
        None
    }

    fn value(&self, column: Column, row: usize) -> f64 {
        column.scalar.read(&self.bytes[row * self.stride + column.offset..], self.big_endian)
    }

    /// Bits of a word, declared signed or unsigned.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "32 bits, exact in f64"
    )]
    fn word(&self, column: Column, row: usize) -> u32 {
        self.value(column, row) as i64 as u32
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates to a byte"
    )]
    fn harmonic(&self, column: Column, row: usize) -> f32 {
        from_harmonic(self.value(column, row) as u8)
    }
}

fn columns<const N: usize>(
    table: &Table<'_>,
    names: [&str; N],
) -> Result<[Column; N], CompressedPlyError> {
    let mut found = [Column { offset: 0, scalar: Scalar::F32 }; N];
    for (slot, name) in found.iter_mut().zip(names) {
        *slot = table.column(name).ok_or_else(|| missing(&format!("column `{name}`")))?;
    }
    Ok(found)
}

/// Smallest and largest value per axis.
#[derive(Debug, Clone, Copy)]
struct Range {
    min: [f32; 3],
    max: [f32; 3],
}

impl Range {
    fn at(&self, unit: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            self.min[axis] * (1.0 - unit[axis]) + self.max[axis] * unit[axis]
        })
    }

    /// Half a step per axis plus the error of single precision; the whole
    /// range if writers treat it as a single value.
    fn half_steps(&self, bits: [u32; 3]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let magnitude = self.min[axis].abs().max(self.max[axis].abs());
            let width = self.max[axis] - self.min[axis];
            let step = if width < FLAT { width } else { SLACK * 0.5 * width / top(bits[axis]) };
            let off = step + 4.0 * f32::EPSILON * magnitude;
            if off.is_finite() { off } else { 0.0 }
        })
    }
}

/// Value ranges of a chunk.
#[derive(Debug, Clone, Copy)]
struct ChunkRange {
    mean: Range,
    log_scale: Range,
    color: Range,
    clipped_color: bool,
}

impl ChunkRange {
    fn precision(&self, sh_degree: usize) -> RowPrecision {
        let sh_precision =
            |degree| if degree <= sh_degree { MAX_SH / 128.0 } else { f32::INFINITY };
        let unlimited = [f32::NEG_INFINITY, f32::INFINITY];
        RowPrecision {
            means: self.mean.half_steps(BITS),
            rotation_rad: SLACK * smallest_three_rad(rotation_component()),
            log_scales: self.log_scale.half_steps(BITS),
            log_scale_range: [-MAX_LOG_SCALE, MAX_LOG_SCALE],
            opacity: SLACK * 0.5 / 255.0,
            sh_dc: self.color.half_steps([8; 3]).map(|step| step / C0),
            sh_dc_range: if self.clipped_color { [dc_of(0.0), dc_of(1.0)] } else { unlimited },
            sh_rest: [1, 2, 3].map(sh_precision),
            sh_rest_range: [-MAX_SH, MAX_SH],
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "chunks hold single precision")]
fn ranges(
    table: &Table<'_>,
    count: usize,
    has_colors: bool,
) -> Result<Vec<ChunkRange>, CompressedPlyError> {
    let wanted = if has_colors { COLUMNS.len() } else { 12 };
    let columns = COLUMNS[..wanted]
        .iter()
        .map(|name| table.column(name).ok_or_else(|| missing(&format!("column `{name}`"))))
        .collect::<Result<Vec<_>, _>>()?;
    let range_of = |row: usize| {
        let three = |first: usize| [0, 1, 2].map(|i| table.value(columns[first + i], row) as f32);
        let range = |first: usize| Range { min: three(first), max: three(first + 3) };
        let unit = Range { min: [0.0; 3], max: [1.0; 3] };
        ChunkRange {
            mean: range(0),
            log_scale: range(6),
            color: if has_colors { range(12) } else { unit },
            clipped_color: !has_colors,
        }
    };
    Ok((0..count).map(range_of).collect())
}
