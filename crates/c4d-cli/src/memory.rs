//! Memory checks before the work begins.

use crate::failure::{Failure, MORE_MEMORY, Outcome};
use gs_core::DynamicScene;
use sysinfo::System;

/// Bytes of a mebibyte.
pub(crate) const MIB: u64 = 1 << 20;

/// Available memory of the machine or container, bytes; `None` if the system does not report it.
pub(crate) fn free() -> Option<u64> {
    let mut system = System::new().ok()?;
    system.refresh_memory();
    let machine = system.available_memory().saturating_add(system.free_swap());
    let limits = system.cgroup_limits();
    let free = limits
        .map_or(machine, |limits| machine.min(limits.free_memory.saturating_add(limits.free_swap)));
    (free > 0).then_some(free)
}

/// Refuses `what` (a clause) if `bytes`, an estimate, exceed the available memory.
pub(crate) fn require(what: &str, bytes: u64, next: &str) -> Outcome {
    let refuse = |found: String| {
        let needed = bytes.div_ceil(MIB);
        Err(Failure::failed(format!("{what} takes about {needed} MiB of memory, {found}"))
            .next(next))
    };
    if let Some(free) = free().filter(|free| *free < bytes) {
        return refuse(format!("and {} MiB are free", free / MIB));
    }
    // A limit of the process, such as `ulimit -v`, shows only on allocation.
    let granted =
        usize::try_from(bytes).is_ok_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
    if granted { Ok(()) } else { refuse("more than this process may allocate".to_owned()) }
}

/// Number of frames of a scene in memory, besides those read on opening: the neighbours of a time,
/// the file being read, and the result. Measured: 580 MB in total for frames of 94 MB.
pub(crate) const FRAMES_SEEN: u64 = 5;
/// [`FRAMES_SEEN`] for exports, which also keep the compressed data. Measured: 640 MB in total.
pub(crate) const FRAMES_PACKED: u64 = 8;

/// Refuses a scene if `frames` of its frames do not fit into memory.
pub(crate) fn require_frames(scene: &dyn DynamicScene, frames: u64) -> Outcome {
    let (splats, degree) = (scene.num_splats() as u64, scene.sh_degree() as u64);
    // Centre, rotation, scale, opacity, and SH of three channels.
    let values = 11 + 3 * (degree + 1) * (degree + 1);
    let bytes = splats.saturating_mul(4 * values).saturating_mul(frames);
    require(&format!("a scene of {splats} splats of SH degree {degree}"), bytes, MORE_MEMORY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_large_requests_are_refused_with_their_size() {
        require("nothing", 0, "").unwrap();
        let failure = require("a very large image", 1 << 60, "Use a smaller image.").unwrap_err();
        let text = failure.to_string();
        assert!(text.contains("a very large image takes about 1099511627776 MiB"), "{text}");
        assert!(text.contains("next: Use a smaller image."), "{text}");
    }
}
