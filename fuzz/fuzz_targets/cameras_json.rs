//! `cameras.json` files.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = gs_io::cameras_json::parse(bytes);
});
