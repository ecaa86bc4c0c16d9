//! PLY files.
#![no_main]

use gs_io::ply;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(read) = ply::read(bytes) {
        assert!(read.splats.check_shapes().is_ok(), "splats that were read are consistent");
    }
    let _ = ply::read_column(bytes, "x");
});
