//! The `meta.json` of `.tsog`, with valid planes; evaluated where it can be read.
#![no_main]

use gs_io::{OpenOptions, open_scene};
use std::io::{Cursor, Read, Write};
use std::path::PathBuf;
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;

/// Planes of a SOG frame. Those of the centres serve as times and velocities, too.
static PLANES: LazyLock<Vec<(String, Vec<u8>)>> = LazyLock::new(|| {
    let bytes = include_bytes!("../../fixtures/frames/frame.sog");
    let mut archive = zip::ZipArchive::new(Cursor::new(&bytes[..])).expect("a zip archive");
    (0..archive.len())
        .map(|i| {
            let mut entry = archive.by_index(i).expect("an entry");
            let name = entry.name().expect("a name").into_owned();
            let mut plane = Vec::new();
            entry.read_to_end(&mut plane).expect("its bytes");
            (name, plane)
        })
        .filter(|(name, _)| name != "meta.json")
        .collect()
});

static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    std::env::temp_dir().join(format!("gs-io-fuzz-tsog-{}", std::process::id()))
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored =
        SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let meta = ("meta.json".to_owned(), bytes.to_vec());
    for (name, plane) in PLANES.iter().chain([&meta]) {
        zip.start_file(name, stored).expect("a new name");
        zip.write_all(plane).expect("writing to memory succeeds");
    }
    let archive = zip.finish().expect("writing to memory succeeds").into_inner();
    std::fs::write(&*FILE, archive).expect("the file is written");
    let Ok(opened) = open_scene(&FILE, &OpenOptions::default()) else { return };
    for t in [0.0, 0.37, 1.0] {
        let splats = opened.scene.at(t).expect("times from 0 to 1 can be evaluated");
        assert!(splats.check_shapes().is_ok(), "evaluated splats are consistent");
    }
});
