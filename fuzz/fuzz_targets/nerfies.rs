//! The JSON files of Nerfies and HyperNeRF data sets.
#![no_main]

use gs_io::cameras::nerfies;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = nerfies::parse_dataset(bytes);
    let _ = nerfies::parse_metadata(bytes);
    let _ = nerfies::parse_camera(bytes);
});
