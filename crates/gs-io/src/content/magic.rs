//! First bytes of the formats, by which they are recognised.

/// Byte order mark that some Windows programs write before text.
pub(crate) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
/// A zip archive with entries.
pub(crate) const ZIP: [u8; 4] = *b"PK\x03\x04";
/// A gzip stream.
pub(crate) const GZIP: [u8; 2] = [0x1f, 0x8b];
/// SPZ, before any compression.
pub(crate) const SPZ: [u8; 4] = *b"NGSP";
/// Binary glTF.
pub(crate) const GLB: [u8; 4] = *b"glTF";
/// `.splatv`.
pub(crate) const SPLATV: [u8; 4] = 0x674B_u32.to_le_bytes();
/// `.splat4d`.
pub(crate) const SPLAT4D: [u8; 4] = *b"SP4D";
/// `.4dgs`.
pub(crate) const FOURDGS: [u8; 5] = *b"\x894DGS";
/// An array of NumPy.
pub(crate) const NPY: [u8; 6] = *b"\x93NUMPY";
