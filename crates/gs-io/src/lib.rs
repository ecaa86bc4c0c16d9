//! Readers and writers of Gaussian-splat file formats.
//!
//! Contents: still frames of every common format ([`frame`]: 3DGS PLY, compressed PLY, `.splat`,
//! `.spz`, `.sog`, glTF), sequences of them ([`ply_sequence`]), model folders of 4DGaussians
//! ([`checkpoint4dgs`]) and Swift4D ([`swift4d`]), trained scenes of other methods
//! ([`open_scene()`]), reading and writing of `.splatv` ([`splatv`]) and `.splat4d` ([`splat4d`]),
//! reading and writing of `.4dgs` ([`fourdgs_file`]), reading of `.tsog` ([`tsog`]), writing of
//! OpenUSD ([`usda`]), cameras and times of data sets ([`cameras`], [`cameras_json`]). Writers
//! report their losses ([`FormatLosses`]); [`detect()`] detects the kind of a path. Readers accept
//! arbitrary bytes: malformed input is an error with the file, what was found and the next step;
//! memory is bounded by a small multiple of the input size; nothing in a file is executed.
//! [`repair`] defines, for all readers, which values are damage and how infinities are interpreted.
//! Unknown details (a field of `cfg_args`, one lens, an object next to the weights) are noted or
//! skipped without rejecting the model. Stand-ins for files (a Git LFS pointer, a web page) are
//! reported as such. Outputs are complete or absent ([`AtomicFile`], [`AtomicDir`]).
//!
//! Deliberately absent: algorithms, GPU, networks of the neural formats (see `gs-deform`).

mod archive;
mod axes;
mod bytes8;
pub mod cameras;
pub mod cameras_json;
pub mod cfg_args;
pub mod checkpoint4dgs;
mod clip;
pub mod compressed_ply;
mod content;
mod deform_folder;
pub mod deformable3dgs;
mod deformed_model;
mod detect;
pub mod dynamic3dgs;
pub mod ed3dgs;
mod error;
mod format_losses;
pub mod fourdgs_file;
pub mod frame;
mod frame_cache;
pub mod freetime;
mod fs;
pub mod gaussian4d;
pub mod gltf;
pub mod grid4d;
pub mod gsplat;
pub mod model_folder;
mod opacity_fit;
mod open_options;
mod open_scene;
mod opened_scene;
mod plane;
pub mod ply;
pub mod ply_sequence;
pub mod pth;
pub mod repair;
mod scene_kind;
pub mod scgs;
mod sh_error;
pub mod sog;
pub mod spacetime;
pub mod splat4d;
pub mod splat_file;
pub mod splatv;
pub mod spz;
pub mod swift4d;
pub mod tsog;
pub mod usda;

pub use archive::ZipError;
pub use axes::{Axes, AxesReading};
pub use clip::Clip;
pub use content::UnsupportedFormat;
pub use deformed_model::DeformedModel;
pub use detect::detect;
pub use error::IoError;
pub use format_losses::FormatLosses;
pub use fs::{
    AtomicDir, AtomicFile, Existing, FolderUpdate, final_path, open_file, read_file,
    remove_unfinished,
};
pub use open_options::OpenOptions;
pub use open_scene::{open_scene, open_scene_as};
pub use opened_scene::OpenedScene;
pub use scene_kind::SceneKind;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
