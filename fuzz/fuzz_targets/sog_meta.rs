//! The `meta.json` of SOG, with valid planes.
#![no_main]

use std::io::{Cursor, Read, Write};
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;

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
    if let Ok(read) = gs_io::frame::read(&archive) {
        assert!(read.splats.check_shapes().is_ok(), "splats that were read are consistent");
    }
});
