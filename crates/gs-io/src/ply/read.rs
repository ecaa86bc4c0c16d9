//! Reading 3DGS PLY files.

use super::PlyError;
use super::header::{Element, Encoding, Header, PropertyKind, Scalar};
use super::layout::Layout;
use super::rows::Cursor;
use gs_core::{Splats, sh};
use rayon::prelude::*;

/// Rows converted per task.
const CHUNK: usize = 4096;

/// A Gaussian scene from a PLY file, values as stored.
#[derive(Debug, Clone, PartialEq)]
pub struct PlySplats {
    /// The Gaussians.
    pub splats: Splats,
    /// Columns that are not part of the 3DGS layout and were ignored.
    pub extra_columns: Vec<String>,
    /// Notes on columns that changed the interpretation of stored values, one sentence each.
    pub notes: Vec<String>,
    /// Comments of the header.
    pub comments: Vec<String>,
    /// Whether the file has (unused) normals.
    pub has_normals: bool,
    /// Encoding of the data.
    pub encoding: Encoding,
}

/// Reads a 3DGS PLY: any column order, any number types, any encoding, SH degree 0 to 3 (higher
/// ones are cut).
///
/// Values are kept as stored, quaternions unnormalised; see [`crate::repair`] for infinities and
/// damaged rows. Columns of other trainers that affect the appearance are applied and noted:
/// colours instead of SH, Mip-Splatting's filter, surfels.
///
/// # Errors
/// Describes the error, or the kind of the file if it is not a Gaussian scene. Memory is bounded by
/// a small multiple of the file's size, regardless of the counts in its header.
pub fn read(bytes: &[u8]) -> Result<PlySplats, PlyError> {
    let header = Header::parse(bytes)?;
    let layout = header.gaussians()?;
    let element = &header.elements[layout.element];
    let mut cursor = Cursor::at_element(&header, bytes, layout.element)?;
    let (mut splats, filters) = match cursor.fixed_rows(element)? {
        Some(rows) => read_fixed(rows, element, &layout, header.encoding),
        None => read_general(&mut cursor, element, &layout)?,
    };
    layout.appearance.apply(&mut splats, &filters);
    Ok(PlySplats::new(splats, header, layout))
}

impl PlySplats {
    /// The result for finished `splats`.
    pub(super) fn new(splats: Splats, header: Header, layout: Layout) -> Self {
        Self {
            splats,
            notes: layout.appearance.notes(&header.comments),
            extra_columns: layout.extra_columns,
            comments: header.comments,
            has_normals: layout.has_normals,
            encoding: header.encoding,
        }
    }
}

/// Reads one numeric column of the vertices, for example a label that an editor added.
///
/// # Errors
/// If the file is malformed or has no such column.
pub fn read_column(bytes: &[u8], name: &str) -> Result<Vec<f32>, PlyError> {
    Ok(read_columns(bytes, &[name])?.swap_remove(0))
}

/// Reads some numeric columns of the vertices, `[columns][rows]`.
///
/// # Errors
/// If the file is malformed, or lacks one of the columns.
pub fn read_columns(bytes: &[u8], names: &[impl AsRef<str>]) -> Result<Vec<Vec<f32>>, PlyError> {
    let header = Header::parse(bytes)?;
    let found = header.elements.iter().enumerate().find(|(_, element)| element.name == "vertex");
    let properties = found.map_or(&[][..], |(_, element)| &element.properties);
    let position = |name: &str| {
        let is_wanted =
            |p: &super::Property| p.name == name && matches!(p.kind, PropertyKind::Scalar(_));
        properties.iter().position(is_wanted).ok_or_else(|| PlyError::NoColumn {
            name: name.to_owned(),
            found: properties.iter().map(|property| property.name.clone()).collect(),
        })
    };
    let positions: Vec<usize> =
        names.iter().map(|name| position(name.as_ref())).collect::<Result<_, _>>()?;
    let mut columns = vec![Vec::new(); positions.len()];
    let Some((index, element)) = found.filter(|_| !positions.is_empty()) else {
        return Ok(columns);
    };
    let mut cursor = Cursor::at_element(&header, bytes, index)?;
    cursor.check_fits(element)?;
    let mut row = Vec::new();
    for i in 0..element.count {
        cursor.read_row(element, i, &mut row)?;
        for (column, &at) in columns.iter_mut().zip(&positions) {
            column.push(single(row[at]));
        }
    }
    Ok(columns)
}

#[expect(clippy::cast_possible_truncation, reason = "Gaussians are single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Position of a column in a fixed-width row.
#[derive(Debug, Clone, Copy)]
struct Column {
    offset: usize,
    scalar: Scalar,
}

/// How rows of fixed width become Gaussians.
#[derive(Debug, Clone)]
pub(super) struct FixedRows {
    /// Bytes per row.
    pub stride: usize,
    /// In the order of [`Layout::columns`].
    columns: Vec<Column>,
    encoding: Encoding,
    has_filter: bool,
}

impl FixedRows {
    /// The layout of an element of fixed width in a binary file.
    pub(super) fn new(element: &Element, layout: &Layout, encoding: Encoding) -> Self {
        let mut stride = 0;
        let offsets: Vec<Column> = element
            .properties
            .iter()
            .filter_map(|property| match property.kind {
                PropertyKind::Scalar(scalar) => {
                    let column = Column { offset: stride, scalar };
                    stride += scalar.size();
                    Some(column)
                }
                PropertyKind::List { .. } => None,
            })
            .collect();
        let columns = layout.columns.iter().map(|&index| offsets[index]).collect();
        Self { stride, columns, encoding, has_filter: layout.appearance.filter }
    }

    /// Converts whole `rows` to the splats from `first` on, and appends their filters, if there are
    /// any.
    pub(super) fn convert(
        &self,
        rows: &[u8],
        first: usize,
        splats: &mut Splats,
        filters: &mut Vec<f32>,
    ) {
        let (stride, columns) = (self.stride, self.columns.as_slice());
        let coeffs = splats.sh_coeffs();
        let is_plain = self.encoding == Encoding::LittleEndian
            && columns.iter().all(|column| column.scalar == Scalar::F32);
        splats.means[first..]
            .par_chunks_mut(CHUNK)
            .zip(splats.quats[first..].par_chunks_mut(CHUNK))
            .zip(splats.log_scales[first..].par_chunks_mut(CHUNK))
            .zip(splats.opacity_logits[first..].par_chunks_mut(CHUNK))
            .zip(splats.sh[first * coeffs..].par_chunks_mut(CHUNK * coeffs))
            .zip(rows.par_chunks(CHUNK * stride))
            .for_each(|(((((means, quats), log_scales), logits), sh), rows)| {
                for (i, row) in rows.chunks_exact(stride).enumerate() {
                    let out = Row {
                        mean: &mut means[i],
                        quat: &mut quats[i],
                        log_scale: &mut log_scales[i],
                        opacity_logit: &mut logits[i],
                        sh: &mut sh[i * coeffs..(i + 1) * coeffs],
                    };
                    if is_plain {
                        out.fill(|column| plain(row, columns[column]));
                    } else {
                        out.fill(|column| self.value(row, columns[column]));
                    }
                }
            });
        if let Some(&column) = columns.last().filter(|_| self.has_filter) {
            filters.par_extend(rows.par_chunks_exact(stride).map(|row| self.value(row, column)));
        }
    }

    fn value(&self, row: &[u8], Column { offset, scalar }: Column) -> f32 {
        single(scalar.read(&row[offset..], self.encoding == Encoding::BigEndian))
    }
}

/// A little-endian `f32`.
#[inline]
fn plain(row: &[u8], column: Column) -> f32 {
    row[column.offset..].first_chunk().map_or(0.0, |bytes| f32::from_le_bytes(*bytes))
}

/// The Gaussians and, if there are any, the filters.
fn read_fixed(
    rows: &[u8],
    element: &Element,
    layout: &Layout,
    encoding: Encoding,
) -> (Splats, Vec<f32>) {
    let fixed = FixedRows::new(element, layout, encoding);
    let mut splats = zeroed(rows.len() / fixed.stride, layout.sh_degree);
    let mut filters = Vec::new();
    fixed.convert(rows, 0, &mut splats, &mut filters);
    (splats, filters)
}

fn read_general(
    cursor: &mut Cursor<'_>,
    element: &Element,
    layout: &Layout,
) -> Result<(Splats, Vec<f32>), PlyError> {
    cursor.check_fits(element)?;
    let count = usize::try_from(element.count)
        .map_err(|error| PlyError::Header(format!("{} rows: {error}", element.count)))?;
    let mut splats = zeroed(count, layout.sh_degree);
    let coeffs = splats.sh_coeffs();
    let mut row = Vec::with_capacity(element.properties.len());
    let filter = layout.columns.last().filter(|_| layout.appearance.filter);
    let mut filters = Vec::new();
    for i in 0..count {
        cursor.read_row(element, i as u64, &mut row)?;
        let out = Row {
            mean: &mut splats.means[i],
            quat: &mut splats.quats[i],
            log_scale: &mut splats.log_scales[i],
            opacity_logit: &mut splats.opacity_logits[i],
            sh: &mut splats.sh[i * coeffs..(i + 1) * coeffs],
        };
        out.fill(|column| single(row[layout.columns[column]]));
        filters.extend(filter.map(|&column| single(row[column])));
    }
    Ok((splats, filters))
}

pub(super) fn zeroed(count: usize, sh_degree: usize) -> Splats {
    Splats {
        means: vec![[0.0; 3]; count],
        quats: vec![[0.0; 4]; count],
        log_scales: vec![[0.0; 3]; count],
        opacity_logits: vec![0.0; count],
        sh: vec![[0.0; 3]; count * sh::num_coeffs(sh_degree)],
        sh_degree,
    }
}

/// Destinations of one row of the file.
struct Row<'a> {
    mean: &'a mut [f32; 3],
    quat: &'a mut [f32; 4],
    log_scale: &'a mut [f32; 3],
    opacity_logit: &'a mut f32,
    sh: &'a mut [[f32; 3]],
}

impl Row<'_> {
    /// `value(c)` is column `c` of the canonical order: x y z, dc, rest, opacity, scale, rot.
    #[inline]
    fn fill(self, value: impl Fn(usize) -> f32) {
        let higher = self.sh.len() - 1;
        let tail = 6 + 3 * higher;
        let copy = |out: &mut [f32], first: usize, step: usize| {
            for (i, out) in out.iter_mut().enumerate() {
                *out = value(first + i * step);
            }
        };
        copy(self.mean, 0, 1);
        copy(&mut self.sh[0], 3, 1);
        for (k, sh) in self.sh[1..].iter_mut().enumerate() {
            // Channel-major in the file, coefficient-major in memory.
            copy(sh, 6 + k, higher);
        }
        *self.opacity_logit = value(tail);
        copy(self.log_scale, tail + 1, 1);
        copy(self.quat, tail + 4, 1);
    }
}
