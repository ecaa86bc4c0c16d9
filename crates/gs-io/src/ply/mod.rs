//! 3DGS PLY files: reads the variants of all common tools, writes the most compatible one.

mod appearance;
mod blocks;
pub mod comments;
mod error;
mod file;
mod header;
mod layout;
mod read;
mod rows;
mod write;

pub(crate) use blocks::read_in_blocks;
pub use error::PlyError;
pub use file::{read_file, read_header_file, write_file};
pub use header::{Element, Encoding, Header, Property, PropertyKind, Scalar};
pub use layout::Layout;
pub use read::{PlySplats, read, read_column, read_columns};
pub(crate) use rows::Cursor;
pub use write::{WriteOptions, write};
