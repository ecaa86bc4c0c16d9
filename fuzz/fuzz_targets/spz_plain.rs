//! SPZ before version 4, packed here so that mutations reach what is inside the gzip stream.
#![no_main]

use std::io::Write;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
    gzip.write_all(bytes).expect("memory takes everything");
    let packed = gzip.finish().expect("memory takes everything");
    if let Ok(read) = gs_io::frame::read(&packed) {
        assert!(read.splats.check_shapes().is_ok(), "whatever is read is consistent");
    }
});
