//! COLMAP models, binary and text.
#![no_main]

use gs_io::cameras::colmap;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let most = bytes.len();
    assert!(colmap::parse_cameras_bin(bytes).map_or(0, |found| found.len()) <= most, "bounded");
    assert!(colmap::parse_images_bin(bytes).map_or(0, |found| found.len()) <= most, "bounded");
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = colmap::parse_cameras_txt(text);
        let _ = colmap::parse_images_txt(text);
    }
});
