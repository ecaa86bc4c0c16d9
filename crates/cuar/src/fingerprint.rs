//! [`fingerprint_of_inputs`], [`fingerprint()`]: hashes that identify the run of a state or an
//! image.

use crate::{RefineOptions, sample::Sample};
use gs_core::{Camera, Splats};

/// FNV-1a, 64 bits.
struct Fnv(u64);

impl Fnv {
    fn eat(&mut self, value: u64) {
        for byte in value.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// Hash of the inputs of the images, without the scene's motion.
pub(crate) fn fingerprint_of_inputs(
    first: &Splats,
    rows: &[u32],
    options: &RefineOptions,
    cameras: &[Camera],
) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    let options = RefineOptions {
        // these do not change the result
        preview_secs: None,
        checkpoint_secs: None,
        memory: 0,
        ..options.clone()
    };
    for byte in format!("{options:?}").bytes() {
        hash.eat(u64::from(byte));
    }
    for &row in rows {
        hash.eat(u64::from(row));
    }
    for value in first.sh.iter().flatten().chain(first.means.iter().flatten()) {
        hash.eat(u64::from(value.to_bits()));
    }
    for camera in cameras {
        hash.eat(u64::from(camera.width) << 32 | u64::from(camera.height));
        let lens = &camera.intrinsics;
        let lens = [lens.fx, lens.fy, lens.cx, lens.cy];
        let values = lens.iter().chain(camera.viewmat.as_flattened());
        values.for_each(|value| hash.eat(value.to_bits()));
    }
    hash.0
}

/// Hash of all inputs of a run.
pub(crate) fn fingerprint<P>(inputs: u64, samples: &[Sample<P>]) -> u64 {
    let mut hash = Fnv(inputs);
    for sample in samples {
        hash.eat(sample.at.view as u64);
        hash.eat(u64::from(sample.at.time.to_bits()));
        hash.eat(sample.entries.len() as u64);
    }
    hash.0
}
