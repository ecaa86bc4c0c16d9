//! Traversal of the tables of a PLY file.

use super::PlyError;
use super::header::{Element, Encoding, Header, PropertyKind, Scalar};

/// A position in the data, between two values.
#[derive(Debug, Clone)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    position: usize,
    encoding: Encoding,
}

impl<'a> Cursor<'a> {
    /// Start of element `index`, skipping the ones before it.
    pub(crate) fn at_element(
        header: &Header,
        bytes: &'a [u8],
        index: usize,
    ) -> Result<Self, PlyError> {
        let mut cursor = Self { bytes, position: header.data_start, encoding: header.encoding };
        for element in &header.elements[..index] {
            cursor.skip(element)?;
        }
        Ok(cursor)
    }

    fn rest(&self) -> &'a [u8] {
        &self.bytes[self.position..]
    }

    /// The rows of an element of fixed width in a binary file, `None` for any other; the caller's
    /// allocations for them are bounded by the size of the file.
    pub(crate) fn fixed_rows(&self, element: &Element) -> Result<Option<&'a [u8]>, PlyError> {
        let Some(stride) = element.stride().filter(|_| self.encoding != Encoding::Ascii) else {
            return Ok(None);
        };
        let rest = self.rest();
        let expected = u128::from(element.count) * stride as u128;
        match usize::try_from(expected) {
            Ok(length) if length <= rest.len() => Ok(Some(&rest[..length])),
            _ => Err(truncated(element, expected, rest.len() as u128, "bytes")),
        }
    }

    /// Fails if the element cannot possibly fit into the rest of the file.
    pub(crate) fn check_fits(&self, element: &Element) -> Result<(), PlyError> {
        // In text a digit and a separator (except after the last value); in
        // binary only the count for an empty list.
        let row_size: usize = match self.encoding {
            Encoding::Ascii => 2 * element.properties.len(),
            Encoding::LittleEndian | Encoding::BigEndian => element
                .properties
                .iter()
                .map(|property| match property.kind {
                    PropertyKind::Scalar(scalar) => scalar.size(),
                    PropertyKind::List { count, .. } => count.size(),
                })
                .sum(),
        };
        let needed = u128::from(element.count) * row_size as u128;
        let found = self.rest().len() as u128;
        if needed > found + 1 {
            let rows = if row_size == 0 { 0 } else { found / row_size as u128 };
            return Err(truncated(element, u128::from(element.count), rows, "rows"));
        }
        Ok(())
    }

    fn skip(&mut self, element: &Element) -> Result<(), PlyError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        if let Some(rows) = self.fixed_rows(element)? {
            self.position += rows.len();
            return Ok(());
        }
        self.check_fits(element)?;
        let mut row = Vec::new();
        for index in 0..element.count {
            self.read_row(element, index, &mut row)?;
        }
        Ok(())
    }

    /// Reads one row: a number per property, NaN for lists, whose items are skipped.
    pub(crate) fn read_row(
        &mut self,
        element: &Element,
        index: u64,
        row: &mut Vec<f64>,
    ) -> Result<(), PlyError> {
        row.clear();
        for property in &element.properties {
            let value = match property.kind {
                PropertyKind::Scalar(scalar) => self.number(scalar, element, index)?,
                PropertyKind::List { count, item } => {
                    let length = self.number(count, element, index)?;
                    self.skip_list(length, item, element, index)?;
                    f64::NAN
                }
            };
            row.push(value);
        }
        Ok(())
    }

    fn skip_list(
        &mut self,
        length: f64,
        item: Scalar,
        element: &Element,
        index: u64,
    ) -> Result<(), PlyError> {
        // Counts are integers of at most 32 bits (enforced by the
        // header), which f64 represents exactly.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "negative counts saturate to an empty list"
        )]
        let length = length as u64;
        if self.encoding == Encoding::Ascii {
            for _ in 0..length {
                self.number(item, element, index)?;
            }
            return Ok(());
        }
        let size = u128::from(length) * item.size() as u128;
        match usize::try_from(size) {
            Ok(size) if size <= self.rest().len() => {
                self.position += size;
                Ok(())
            }
            _ => Err(truncated(element, u128::from(element.count), u128::from(index), "rows")),
        }
    }

    fn number(&mut self, scalar: Scalar, element: &Element, index: u64) -> Result<f64, PlyError> {
        let rest = self.rest();
        let ended = || truncated(element, u128::from(element.count), u128::from(index), "rows");
        if self.encoding != Encoding::Ascii {
            if rest.len() < scalar.size() {
                return Err(ended());
            }
            self.position += scalar.size();
            return Ok(scalar.read(rest, self.encoding == Encoding::BigEndian));
        }
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).ok_or_else(ended)?;
        let token = &rest[start..];
        let end = token.iter().position(u8::is_ascii_whitespace).unwrap_or(token.len());
        self.position += start + end;
        std::str::from_utf8(&token[..end]).ok().and_then(|text| text.parse().ok()).ok_or_else(
            || PlyError::Value {
                element: element.name.clone(),
                row: usize::try_from(index).unwrap_or(usize::MAX),
                token: String::from_utf8_lossy(&token[..end.min(40)]).into_owned(),
            },
        )
    }
}

fn truncated(element: &Element, expected: u128, found: u128, unit: &'static str) -> PlyError {
    PlyError::Truncated { element: element.name.clone(), expected, found, unit }
}
