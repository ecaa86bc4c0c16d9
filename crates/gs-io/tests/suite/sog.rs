//! SOG files whose encoder cleared the colours of invisible splats.

use gs_io::frame;
use std::io::Write;
use test_support::fixture;

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(fixture("frames").join(name)).unwrap()
}

#[test]
fn colours_of_invisible_splats_of_sog_are_unknown() {
    let frame = frame::read(&bytes("frame.sog")).unwrap();
    let precision = frame.precision.unwrap();
    let invisible = gs_core::activation::sigmoid(frame.splats.opacity_logits[0]) < 1.0 / 255.0;
    assert!(!invisible && precision.of(0).sh_dc[0].is_finite(), "a visible splat has a colour");
    let faded = sog_without_alpha(&bytes("frame.sog"));
    let frame = frame::read(&faded).unwrap();
    let precision = frame.precision.unwrap();
    for row in 0..300 {
        assert_eq!(precision.of(row).sh_dc, [f32::INFINITY; 3], "row {row}");
        assert!(frame.splats.opacity(row) < 1.0 / 255.0, "row {row} is invisible");
    }
}

/// The same archive with all opacities 0, as saved by an encoder that clears invisible colours.
fn sog_without_alpha(bytes: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut out = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).unwrap();
        let name = entry.name().unwrap().into_owned();
        let mut plane = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut plane).unwrap();
        if name.contains("sh0") {
            let image = image::load_from_memory(&plane).unwrap().into_rgba8();
            let cleared = image::RgbaImage::new(image.width(), image.height());
            plane.clear();
            let encoder = image::codecs::webp::WebPEncoder::new_lossless(&mut plane);
            cleared.write_with_encoder(encoder).unwrap();
        }
        out.start_file(name, stored).unwrap();
        out.write_all(&plane).unwrap();
    }
    out.finish().unwrap().into_inner()
}
