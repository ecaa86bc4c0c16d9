//! `.splat4d` clips: every clip that opens can be evaluated.
#![no_main]

use gs_core::DynamicScene;
use gs_io::repair::Damage;
use gs_io::splat4d;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(read) = splat4d::read(bytes.to_vec(), Damage::Drop) else { return };
    for t in [0.0, 0.93, 0.37, 1.0] {
        let splats = read.scene.at(t).expect("a clip that opens can be evaluated");
        assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
        assert!(
            (0..splats.len()).all(|row| splats.is_finite(row)),
            "unusable rows are dropped"
        );
    }
});
