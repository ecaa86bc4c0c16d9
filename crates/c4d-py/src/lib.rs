#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "doc comments are the docstrings of Python, in which [4,4] is a shape"
)]
#![doc = include_str!("../README.md")]
#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments from Python are passed by value: PyO3 extracts them"
)]

mod anchor_regions;
mod arrays;
mod camera;
mod command;
mod failures;
mod rasterized;
mod run;
mod scene;
mod splat_arrays;
mod supervise;
mod transport;

use pyo3::prelude::*;

/// The compiled part of `catalyst4d`.
#[pymodule(name = "_native")]
mod native {
    #[pymodule_export]
    use crate::anchor_regions::build_anchors;
    #[pymodule_export]
    use crate::camera::{Camera, open_cameras};
    #[pymodule_export]
    use crate::command::{run_command, set_num_threads};
    #[pymodule_export]
    use crate::rasterized::{Rasterized, rasterize};
    #[pymodule_export]
    use crate::run::read_run;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::splat_arrays::write_ply;
    #[pymodule_export]
    use crate::transport::{Transport, solve_transport};

    /// Version of the package and of `c4d`.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the usual name in Python")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
