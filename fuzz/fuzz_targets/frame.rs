//! Still frames of every format, detected by content.
#![no_main]

use gs_io::frame;
use gs_io::repair::Damage;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = frame::shape(bytes, bytes.len() as u64);
    if let Ok(read) = frame::read(bytes) {
        assert!(read.splats.check_shapes().is_ok(), "splats that were read are consistent");
        let _ = read.sanitize(Damage::Drop);
    }
});
