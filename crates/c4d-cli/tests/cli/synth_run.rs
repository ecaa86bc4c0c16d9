//! The synthetic fixture's edit, propagated.

use crate::support::{c4d, fixture, success};
use std::path::{Path, PathBuf};

/// A run of the synthetic fixture's edit, without refinement, in `folder`.
pub(crate) fn synth_run(folder: &Path) -> PathBuf {
    let run = folder.join("run");
    success(
        c4d(["propagate"])
            .arg(fixture("synth/source"))
            .arg("--edited")
            .arg(fixture("synth/edited.ply"))
            .args(["--no-refine", "-o"])
            .arg(&run),
    );
    run
}
