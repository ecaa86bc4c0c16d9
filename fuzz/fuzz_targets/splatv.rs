//! `.splatv` scenes, evaluated where they can be read.
#![no_main]

use gs_core::DynamicScene;
use gs_io::repair::Damage;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(read) = gs_io::splatv::read(bytes, Damage::Drop) else { return };
    assert!(read.scene.num_splats() <= bytes.len(), "a splat is more than a byte");
    for t in [0.0, 0.37, 1.0] {
        if let Ok(splats) = read.scene.at(t) {
            assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
        }
    }
});
