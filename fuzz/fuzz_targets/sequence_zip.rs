//! Zip archives of frames.
#![no_main]

use gs_core::DynamicScene;
use gs_io::ply_sequence::{PlySequence, SequenceOptions};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = std::env::temp_dir().join(format!("gs-io-fuzz-{}.zip", std::process::id()));
    std::fs::write(&path, bytes).expect("a temporary file");
    let _ = gs_io::detect(&path);
    if let Ok(sequence) = PlySequence::open(&path, &SequenceOptions::default()) {
        for frame in 0..sequence.num_frames().unwrap_or(0).min(4) {
            let _ = sequence.frame(frame);
        }
    }
});
