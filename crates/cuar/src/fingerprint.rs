//! [`fingerprint_of_inputs`], [`fingerprint()`]: hashes that identify the run of a state or an
//! image.

use crate::{RefineOptions, sample::Sample};
use gs_core::{Camera, Fnv1a, Splats};

/// Hash of the inputs of the images, without the scene's motion.
pub(crate) fn fingerprint_of_inputs(
    first: &Splats,
    rows: &[u32],
    options: &RefineOptions,
    cameras: &[Camera],
) -> u64 {
    let mut hash = Fnv1a::default();
    let options = RefineOptions {
        // these do not change the result
        preview_secs: None,
        checkpoint_secs: None,
        memory: 0,
        ..options.clone()
    };
    for byte in format!("{options:?}").bytes() {
        hash.bytes(u64::from(byte).to_le_bytes());
    }
    for &row in rows {
        hash.bytes(u64::from(row).to_le_bytes());
    }
    for value in first.sh.iter().flatten().chain(first.means.iter().flatten()) {
        hash.bytes(u64::from(value.to_bits()).to_le_bytes());
    }
    for camera in cameras {
        hash.bytes((u64::from(camera.width) << 32 | u64::from(camera.height)).to_le_bytes());
        let lens = &camera.intrinsics;
        let lens = [lens.fx, lens.fy, lens.cx, lens.cy];
        let values = lens.iter().chain(camera.viewmat.as_flattened());
        values.for_each(|value| hash.bytes(value.to_bits().to_le_bytes()));
    }
    hash.finish()
}

/// Hash of all inputs of a run.
pub(crate) fn fingerprint<P>(inputs: u64, samples: &[Sample<P>]) -> u64 {
    let mut hash = Fnv1a::resume(inputs);
    for sample in samples {
        hash.bytes((sample.at.view as u64).to_le_bytes());
        hash.bytes(u64::from(sample.at.time.to_bits()).to_le_bytes());
        hash.bytes((sample.entries.len() as u64).to_le_bytes());
    }
    hash.finish()
}
