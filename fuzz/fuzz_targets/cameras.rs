//! Camera files that are recognised by name: `cameras.json`,
//! `transforms_*.json`, `poses_bounds.npy`.
#![no_main]

use gs_io::cameras::{self, Reading, poses_bounds, transforms};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for reading in [Reading::Trained, Reading::Stored] {
        let Ok(cameras) = cameras::from_slice(bytes, reading) else { continue };
        assert!(cameras.len() <= bytes.len(), "a camera is more than a byte");
        assert!(cameras.iter().all(|camera| camera.check().is_ok()), "cameras that can see");
    }
    if let Ok(file) = transforms::parse(bytes) {
        let _ = file.max_time();
    }
    if let Ok(rows) = poses_bounds::parse(bytes) {
        assert!(rows.len() <= bytes.len(), "a row is more than a byte");
    }
});
