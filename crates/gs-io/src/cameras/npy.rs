//! Two-dimensional NumPy arrays. The header is a Python dictionary, for which this crate already
//! has a parser (`cfg_args`); the usual library multiplies hostile shapes without overflow checks.

use super::CamerasError;
use crate::cfg_args::{self, Value};
use crate::content::magic::NPY;

/// Longest header accepted, bytes; NumPy writes 118.
const MAX_HEADER: usize = 1024;

/// Whether bytes begin with the magic of NumPy arrays.
pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(&NPY)
}

/// Rows of a `[rows, columns]` array of 32- or 64-bit floating-point numbers.
pub(super) fn rows(bytes: &[u8], columns: usize) -> Result<Vec<Vec<f64>>, CamerasError> {
    let header =
        |found: String| CamerasError::malformed("the header", "a NumPy array (.npy)", found);
    if !is_npy(bytes) {
        return Err(header("other bytes at the start".to_owned()));
    }
    let (length, start) = match bytes[NPY.len()..] {
        [1, _, a, b, ..] => (usize::from(u16::from_le_bytes([a, b])), 10),
        [2 | 3, _, a, b, c, d, ..] => {
            (usize::try_from(u32::from_le_bytes([a, b, c, d])).unwrap_or(usize::MAX), 12)
        }
        _ => return Err(header("an unknown version".to_owned())),
    };
    if length > MAX_HEADER || start + length > bytes.len() {
        return Err(header(format!("{length} bytes of header in a file of {}", bytes.len())));
    }
    let (text, data) = bytes[start..].split_at(length);
    let namespace = format!("Namespace(header={})", String::from_utf8_lossy(text).trim());
    let parsed = cfg_args::parse(&namespace).map_err(|error| header(error.what))?;
    let value = |key: &str| {
        parsed
            .get("header")
            .and_then(|header| header.get(key))
            .ok_or_else(|| header(format!("no `{key}`")))
    };
    let shape: Vec<Option<u64>> = match value("shape")? {
        Value::List(shape) => shape.iter().map(Value::as_u64).collect(),
        _ => return Err(header("a shape that is not a tuple".to_owned())),
    };
    let &[Some(count), Some(width)] = shape.as_slice() else {
        return Err(wrong_shape(columns, &shape));
    };
    if width != columns as u64 {
        return Err(wrong_shape(columns, &shape));
    }
    let size = match value("descr")?.as_str() {
        Some("<f8" | "=f8" | "|f8") => 8,
        Some("<f4" | "=f4" | "|f4") => 4,
        found => {
            let found = format!("`{}`", found.unwrap_or_default());
            return Err(CamerasError::malformed("the array", "numbers of type <f8 or <f4", found));
        }
    };
    let needed = count.saturating_mul(width).saturating_mul(size);
    let Some(count) = usize::try_from(count).ok().filter(|_| needed <= data.len() as u64) else {
        let at = format!("{count} rows of {columns} numbers");
        return Err(CamerasError::Truncated { at, needed, left: data.len() });
    };
    let values: Vec<f64> = if size == 8 {
        data.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect()
    } else {
        data.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
    };
    let fortran = value("fortran_order")?.as_bool() == Some(true);
    let at = |row: usize, column: usize| {
        values[if fortran { column * count + row } else { row * columns + column }]
    };
    Ok((0..count).map(|row| (0..columns).map(|column| at(row, column)).collect()).collect())
}

fn wrong_shape(columns: usize, shape: &[Option<u64>]) -> CamerasError {
    let sides: Vec<String> =
        shape.iter().map(|n| n.map_or("?".to_owned(), |n| n.to_string())).collect();
    let expected = format!("the shape [cameras, {columns}]");
    CamerasError::malformed("the array", expected, format!("[{}]", sides.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(header: &str, values: &[f64]) -> Vec<u8> {
        let mut bytes = NPY.to_vec();
        bytes.extend([1, 0]);
        bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}    \n")
    }

    #[test]
    fn row_and_column_major_arrays_are_read() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let c = rows(&npy(&header("<f8", "False", "(2, 3)"), &values), 3).unwrap();
        assert_eq!(c, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "rows");
        let f = rows(&npy(&header("<f8", "True", "(2, 3)"), &values), 3).unwrap();
        assert_eq!(f, [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]], "columns");
    }

    #[test]
    fn wrong_arrays_are_refused() {
        let values = [0.0; 6];
        for (descr, shape) in [
            ("<f8", "(2, 4)"),
            ("<f8", "(3, 3)"),
            ("<f8", "(9223372036854775807, 3)"),
            ("<f8", "(99999999999999999999, 3)"),
            ("<f8", "(-2, 3)"),
            ("<f8", "(2,)"),
            ("<f8", "7"),
            ("<i8", "(2, 3)"),
            (">f8", "(2, 3)"),
            ("|O", "(2, 3)"),
        ] {
            let bytes = npy(&header(descr, "False", shape), &values);
            assert!(rows(&bytes, 3).is_err(), "{descr} {shape}");
        }
        assert!(rows(&npy("{'shape': (2, 3)}", &values), 3).is_err(), "keys are missing");
        assert!(rows(&npy(&"(".repeat(2000), &values), 3).is_err(), "nested");
        assert!(rows(b"\x93NUMPY\x02\x00\xff\xff\xff\xff", 3).is_err(), "4 GiB of header");
    }
}
