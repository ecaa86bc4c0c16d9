//! PyTorch files (`.pth`): zip containers of a pickle and raw storages, or the older stream of
//! both.
//!
//! The pickle is interpreted as data by a machine with about forty opcodes and a dozen names;
//! nothing is imported or executed. Objects of other classes are skipped, opcodes that checkpoints
//! do not use are rejected. Tensors are views of the file until they are converted. Memory is
//! bounded by a small multiple of the file.

mod error;
mod layers;
mod legacy;
mod names;
mod pickle;
mod read;
mod root;
mod tensor;
mod write;

pub use error::{LayersError, PthError};
pub(crate) use layers::Layers;
pub use names::siblings_of;
pub(crate) use pickle::Integers;
pub(crate) use read::read_with_integers;
pub use read::{read, with_file};
pub use root::Root;
pub use tensor::{Dtype, Tensor};
pub use write::{NamedTensor, write};
