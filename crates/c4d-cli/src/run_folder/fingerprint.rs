//! Fingerprints of inputs, to detect changes.

use crate::failure::{Failure, Outcome};
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::io::Read;
use std::path::PathBuf;

/// Number of bytes hashed of a file in the middle of a long sequence.
const SAMPLE: usize = 1 << 20;
/// Lists up to this length are hashed completely. Of longer ones, the first and last file are
/// hashed completely, the others by size and start.
const MAX_WHOLE_FILES: usize = 8;

/// SHA-256 of the files: complete content of a few, sizes and starts of many.
pub(crate) fn fingerprint(files: &[PathBuf]) -> Outcome<String> {
    let mut hasher = Sha256::new();
    for (i, file) in files.iter().enumerate() {
        let refuse = |error: std::io::Error| {
            Failure::bad_input(format!("cannot read {}: {error}", file.display()))
        };
        let whole = files.len() <= MAX_WHOLE_FILES || i == 0 || i + 1 == files.len();
        let mut handle = gs_io::open_file(file).map_err(refuse)?;
        let length = handle.metadata().map_err(refuse)?.len();
        hasher.update(length.to_le_bytes());
        let mut buffer = vec![0; SAMPLE];
        loop {
            let read = handle.read(&mut buffer).map_err(refuse)?;
            hasher.update(&buffer[..read]);
            if read == 0 || !whole {
                break;
            }
        }
    }
    let mut text = String::new();
    for byte in hasher.finalize() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}
