//! Values of accessors: any component type, interleaved, normalised, sparse.

use super::GltfError;
use super::document::{Accessor, BufferView, Document};
use std::borrow::Cow;

/// Buffers, with their views and accessors.
pub(super) struct Source<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a [Cow<'a, [u8]>],
}

/// Values of an attribute, and their largest error.
#[derive(Debug, Clone)]
pub(super) struct Values<const N: usize> {
    pub(super) rows: Vec<[f32; N]>,
    /// Half a step for quantised values, 0 for floats.
    pub(super) half_step: f32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32) -> Result<Self, GltfError> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(damaged(format!("component type {code}, expected 5120 to 5126"))),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Largest stored number of a normalised type.
    fn top(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32_767.0,
            Self::U16 => 65_535.0,
            Self::U32 => f64::from(u32::MAX),
            Self::F32 => 1.0,
        }
    }

    /// The number at the start of `bytes`, which have at least [`Component::size`] bytes.
    fn read(self, bytes: &[u8]) -> f64 {
        match *bytes {
            [a, ..] if self == Self::I8 => f64::from(i8::from_le_bytes([a])),
            [a, ..] if self == Self::U8 => f64::from(a),
            [a, b, ..] if self == Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            [a, b, ..] if self == Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            [a, b, c, d, ..] if self == Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            [a, b, c, d, ..] => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => f64::NAN,
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "attributes are single precision")]
    fn value(self, bytes: &[u8], normalized: bool) -> f32 {
        let value = self.read(bytes);
        if normalized && self != Self::F32 {
            (value / self.top()).max(-1.0) as f32
        } else {
            value as f32
        }
    }
}

fn damaged(what: impl Into<String>) -> GltfError {
    GltfError::damaged(what)
}

fn size(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}

/// Rows of fixed width in a view.
struct Rows<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Source<'a> {
    pub(super) fn accessor(&self, index: usize) -> Result<&'a Accessor, GltfError> {
        let missing = || damaged(format!("accessor {index} is missing"));
        self.document.accessors.get(index).ok_or_else(missing)
    }

    fn view(&self, index: usize) -> Result<(&'a BufferView, &'a [u8]), GltfError> {
        let view = self.document.buffer_views.get(index);
        let view = view.ok_or_else(|| damaged(format!("buffer view {index} is missing")))?;
        let buffer = self.buffers.get(view.buffer);
        let buffer = buffer.ok_or_else(|| damaged(format!("buffer {} is missing", view.buffer)))?;
        let start = size(view.byte_offset);
        let end = start.saturating_add(size(view.byte_length));
        let bytes = buffer.get(start..end).ok_or_else(|| GltfError::Truncated {
            part: "a buffer view",
            expected: end as u128,
            found: buffer.len() as u128,
        })?;
        Ok((view, bytes))
    }

    /// All bytes of a view.
    pub(super) fn bytes(&self, view: usize) -> Result<&'a [u8], GltfError> {
        Ok(self.view(view)?.1)
    }

    /// `count` rows of `width` bytes of a view.
    fn rows(
        &self,
        view: usize,
        offset: u64,
        count: usize,
        width: usize,
    ) -> Result<Rows<'a>, GltfError> {
        let (view, bytes) = self.view(view)?;
        let stride = view.byte_stride.map_or(width, size);
        if stride < width {
            return Err(damaged(format!("a stride of {stride} bytes for values of {width}")));
        }
        let needed = stride.saturating_mul(count.saturating_sub(1)).saturating_add(width);
        let bytes = bytes.get(size(offset)..).unwrap_or_default();
        if bytes.len() < needed {
            return Err(GltfError::Truncated {
                part: "an accessor",
                expected: needed as u128,
                found: bytes.len() as u128,
            });
        }
        Ok(Rows { bytes, stride })
    }

    /// The values of accessor `index`; `what` is its name in messages. `count` rows are expected;
    /// the caller has checked that this number is proportionate to the file size.
    pub(super) fn values<const N: usize>(
        &self,
        index: usize,
        what: &str,
        count: usize,
    ) -> Result<Values<N>, GltfError> {
        let accessor = self.accessor(index)?;
        let width = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 0,
        };
        if width != N || accessor.count != count as u64 {
            return Err(damaged(format!(
                "{what} is {} × {}, expected {count} rows of {N} values",
                accessor.count, accessor.shape
            )));
        }
        let component = Component::of(accessor.component_type)?;
        let value = |row: &[u8]| -> [f32; N] {
            std::array::from_fn(|k| {
                component.value(&row[k * component.size()..], accessor.normalized)
            })
        };
        let width = N * component.size();
        let mut rows = match accessor.buffer_view {
            Some(view) => {
                let found = self.rows(view, accessor.byte_offset, count, width)?;
                (0..count).map(|i| value(&found.bytes[i * found.stride..])).collect()
            }
            None => vec![[0.0; N]; count],
        };
        if let Some(sparse) = &accessor.sparse {
            let changed = size(sparse.count).min(count);
            let kind = Component::of(sparse.indices.component_type)?;
            let (view, offset) = (sparse.indices.buffer_view, sparse.indices.byte_offset);
            let indices = self.rows(view, offset, changed, kind.size())?;
            let (view, offset) = (sparse.values.buffer_view, sparse.values.byte_offset);
            let values = self.rows(view, offset, changed, width)?;
            for i in 0..changed {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "invalid indices saturate to one out of range, or to 0"
                )]
                let row = kind.read(&indices.bytes[i * indices.stride..]) as usize;
                let slot = rows.get_mut(row);
                *slot.ok_or_else(|| damaged(format!("{what} replaces row {row} of {count}")))? =
                    value(&values.bytes[i * values.stride..]);
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "a step of single precision")]
        let half_step = match component {
            Component::F32 => 0.0,
            _ if accessor.normalized => (0.5 / component.top()) as f32,
            _ => 0.5,
        };
        Ok(Values { rows, half_step })
    }
}
