//! Reading a large PLY file block by block, without holding all its bytes.

use super::header::{Element, Encoding, Header};
use super::read::{FixedRows, PlySplats, zeroed};
use crate::error::IoError;
use crate::fs::{check_room, open_file};
use gs_core::sh;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Smaller files are read as a whole: they take milliseconds, and any reader can describe their
/// errors. Bytes.
const MIN_LENGTH: u64 = 4 << 20;
/// The header must end within this many bytes; that of a usual file takes two kilobytes.
const START: u64 = 64 << 10;
/// Bytes read at once.
const BLOCK: usize = 8 << 20;

/// Reads a large binary 3DGS PLY with rows of fixed width. `None` for any other file, also for a
/// malformed one: the general reader describes the error.
///
/// Needs 16 MiB besides the result.
///
/// # Errors
/// If the file cannot be read.
pub(crate) fn read_in_blocks(path: &Path) -> Result<Option<PlySplats>, IoError> {
    let failed = |source| IoError::Read { path: path.to_owned(), source };
    let mut file = open_file(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    if length < MIN_LENGTH {
        return Ok(None);
    }
    let mut start = Vec::new();
    (&mut file).take(START).read_to_end(&mut start).map_err(failed)?;
    let Ok(header) = Header::parse(&start) else { return Ok(None) };
    let Ok(layout) = header.gaussians() else { return Ok(None) };
    let Some((position, count)) = rows(&header, layout.element, length) else { return Ok(None) };
    let element = &header.elements[layout.element];
    let fixed = FixedRows::new(element, &layout, header.encoding);
    let values = 11 + 3 * sh::num_coeffs(layout.sh_degree);
    check_room(count.saturating_mul(4 * values), length).map_err(failed)?;
    let mut splats = zeroed(count, layout.sh_degree);
    let mut filters = Vec::new();

    file.seek(SeekFrom::Start(position)).map_err(failed)?;
    let per_block = (BLOCK / fixed.stride).max(1);
    let rows_of = |first: usize| per_block.min(count - first) * fixed.stride;
    let (mut block, mut next) = (Vec::new(), Vec::new());
    fill(&mut file, &mut block, rows_of(0)).map_err(failed)?;
    for first in (0..count).step_by(per_block) {
        // The next block is read while this one is converted.
        let after = (first + per_block).min(count);
        let (read, ()) = rayon::join(
            || fill(&mut file, &mut next, rows_of(after)),
            || fixed.convert(&block, first, &mut splats, &mut filters),
        );
        read.map_err(failed)?;
        std::mem::swap(&mut block, &mut next);
    }
    layout.appearance.apply(&mut splats, &filters);
    Ok(Some(PlySplats::new(splats, header, layout)))
}

/// Where the rows of element `index` start, and their number, if all elements up to it are of fixed
/// width and fit into a binary file of `length` bytes.
fn rows(header: &Header, index: usize, length: u64) -> Option<(u64, usize)> {
    if header.encoding == Encoding::Ascii {
        return None;
    }
    let bytes = |element: &Element| element.count.checked_mul(element.stride()? as u64);
    let mut position = header.data_start as u64;
    for element in &header.elements[..index] {
        position = position.checked_add(bytes(element)?)?;
    }
    let element = &header.elements[index];
    let end = position.checked_add(bytes(element)?)?;
    (end <= length && element.stride()? > 0)
        .then_some((position, usize::try_from(element.count).ok()?))
}

/// Reads exactly `length` bytes into `block`.
fn fill(file: &mut File, block: &mut Vec<u8>, length: usize) -> io::Result<()> {
    block.resize(length, 0);
    file.read_exact(block)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    /// A file of `rows` rows with a table before the Gaussians and bytes after them; `f_dc_1` has
    /// double precision, and the columns of the reference are interleaved with an unknown one.
    fn file(rows: usize, encoding: &str, filter: bool) -> Vec<u8> {
        let mut names = vec!["x", "y", "z", "label", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"];
        let rest: Vec<String> = (0..45).map(|i| format!("f_rest_{i}")).collect();
        names.extend(rest.iter().map(String::as_str));
        names.extend(["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]);
        if filter {
            names.push("filter_3D");
        }
        let kind = |name: &str| if name == "f_dc_1" { "double" } else { "float" };
        let mut header = format!(
            "ply\nformat {encoding} 1.0\nelement camera 3\nproperty uchar a\nproperty int b\n\
             element vertex {rows}\n"
        );
        for name in &names {
            writeln!(header, "property {} {name}", kind(name)).unwrap();
        }
        let mut bytes = (header + "end_header\n").into_bytes();
        bytes.extend([7; 15]);
        let is_big = encoding == "binary_big_endian";
        for row in 0..rows {
            for (column, name) in names.iter().enumerate() {
                let value = ((row * 31 + column * 7) % 1013) as f32 / 1013.0 + 0.01;
                match (kind(name), is_big) {
                    ("double", false) => bytes.extend(f64::from(value).to_le_bytes()),
                    ("double", true) => bytes.extend(f64::from(value).to_be_bytes()),
                    (_, false) => bytes.extend(value.to_le_bytes()),
                    (_, true) => bytes.extend(value.to_be_bytes()),
                }
            }
        }
        bytes.extend(b"something after the table");
        bytes
    }

    /// Several blocks, the last of them short: the same values as from all bytes.
    #[test]
    fn blocks_give_the_same_values_as_the_whole_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large.ply");
        for (encoding, filter) in [
            ("binary_little_endian", false),
            ("binary_little_endian", true),
            ("binary_big_endian", true),
        ] {
            let bytes = file(70_001, encoding, filter);
            assert!(bytes.len() > 2 * BLOCK, "more than two blocks: {}", bytes.len());
            std::fs::write(&path, &bytes).unwrap();
            let found = read_in_blocks(&path).unwrap().expect("a large binary file");
            let expected = super::super::read(&bytes).unwrap();
            assert!(found == expected, "{encoding}, filter {filter}");
            assert_eq!(found.splats.len(), 70_001);
        }
    }

    #[test]
    fn other_files_are_not_read_in_blocks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other.ply");
        let large = file(30_000, "binary_little_endian", false);
        let none = |bytes: &[u8], what: &str| {
            std::fs::write(&path, bytes).unwrap();
            assert!(read_in_blocks(&path).unwrap().is_none(), "{what}");
        };
        none(&large[..large.len() - 30], "a truncated table");
        none(&file(100, "binary_little_endian", false), "a small file");
        none(&vec![b'p'; 5 << 20], "no header");
        let text = String::from_utf8_lossy(&large[..2000]);
        let listed = text.replacen("property int b", "property list uchar int b", 1);
        let end = text.find("end_header\n").unwrap();
        let mut bytes = listed.into_bytes();
        bytes.truncate(end + listed_growth());
        bytes.extend(&large[end..]);
        none(&bytes, "a list before the table");
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(read_in_blocks(&path), Err(IoError::Read { .. })), "no file");
    }

    /// Bytes by which the list's declaration is longer.
    fn listed_growth() -> usize {
        "property list uchar int b".len() - "property int b".len()
    }
}
