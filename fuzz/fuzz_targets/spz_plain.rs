//! SPZ before version 4, compressed here so that mutations reach the contents of the gzip stream.
#![no_main]

use std::io::Write;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
    gzip.write_all(bytes).expect("writing to memory succeeds");
    let packed = gzip.finish().expect("writing to memory succeeds");
    if let Ok(read) = gs_io::frame::read(&packed) {
        assert!(read.splats.check_shapes().is_ok(), "splats that were read are consistent");
    }
});
