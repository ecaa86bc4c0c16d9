//! Sequences in archives, and in formats other than plain PLY, are the same scenes.

use gs_core::{DynamicScene, Splats};
use gs_io::ply_sequence::{self, PlySequence, SequenceOptions};
use gs_io::{
    Axes, Existing, OpenOptions, SceneKind, compressed_ply, detect, gltf, open_scene, spz,
};
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use test_support::fixture;
use zip::write::SimpleFileOptions;

fn source() -> PlySequence {
    let folder = fixture("deform4dgs/variants/static_mlp_all_heads/gaussian_pertimestamp");
    PlySequence::open(&folder, &SequenceOptions::default()).unwrap()
}

fn zip_of(path: &Path, entries: &[(String, Vec<u8>)], method: zip::CompressionMethod) {
    let mut zip = zip::ZipWriter::new(File::create(path).unwrap());
    for (name, bytes) in entries {
        zip.start_file(name, SimpleFileOptions::default().compression_method(method)).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
}

fn entries() -> Vec<(String, Vec<u8>)> {
    let frame = |(i, path)| (format!("clip/frame_{i}.ply"), fs::read(path).unwrap());
    source().paths().iter().enumerate().map(frame).collect()
}

#[test]
fn archives_equal_their_folders() {
    let dir = tempfile::tempdir().unwrap();
    let mut entries = entries();
    entries.push(("__MACOSX/clip/._frame_0.ply".to_owned(), b"rubbish".to_vec()));
    entries.push(("notes.txt".to_owned(), b"mine".to_vec()));
    for method in [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated] {
        let path = dir.path().join(format!("{method:?}"));
        zip_of(&path, &entries, method);
        assert_eq!(detect(&path).unwrap(), SceneKind::PlySequence, "{method:?}");
        let zipped = PlySequence::open(&path, &SequenceOptions::default()).unwrap();
        assert_eq!(zipped.num_frames(), Some(6), "frames");
        assert_eq!(zipped.ignored(), ["__MACOSX/clip/._frame_0.ply", "notes.txt"], "the rest");
        for t in [0.0, 0.37, 1.0] {
            assert_eq!(zipped.at(t).unwrap(), source().at(t).unwrap(), "{method:?} at {t}");
        }
    }
    // Archives of our own writer are read.
    let path = dir.path().join("ours.zip");
    let (times, options) = (source().time_range().frames(6), gs_io::ply::WriteOptions::default());
    ply_sequence::write_zip(&path, &source(), &times, &options, Existing::Refuse, &mut |_| {})
        .unwrap();
    let opened = open_scene(&path, &OpenOptions::default()).unwrap();
    assert_eq!(opened.scene.at(0.5).unwrap(), source().at(0.5).unwrap(), "our own archive");
}

#[test]
fn broken_archives_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("clip.zip");
    let mut entries = entries();
    entries.remove(2);
    zip_of(&path, &entries, zip::CompressionMethod::Stored);
    let open = || PlySequence::open(&path, &SequenceOptions::default()).unwrap_err().to_string();
    assert!(open().contains("frame_1.ply and clip/frame_3.ply"), "{}", open());
    entries[1].1.truncate(2000);
    entries.truncate(2);
    zip_of(&path, &entries, zip::CompressionMethod::Stored);
    let error = PlySequence::open(&path, &SequenceOptions::default()).and_then(|s| s.frame(1));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("clip.zip") && error.contains("frame_1.ply"), "{error}");
    entries[1].1 = vec![0; 40 << 20];
    zip_of(&path, &entries, zip::CompressionMethod::Deflated);
    assert!(
        open().contains("frame_1.ply"),
        "only the start of a zip bomb is decompressed: {}",
        open()
    );
    fs::write(&path, b"PK\x03\x04 and no more").unwrap();
    assert!(matches!(detect(&path).unwrap(), SceneKind::Unknown { .. }), "damaged");
    assert!(open().contains("not a readable zip"), "{}", open());
    zip_of(&path, &entries[..1], zip::CompressionMethod::Stored);
    assert!(detect(&path).unwrap().to_string().contains("clip/frame_0.ply"), "says what is in it");
}

/// Largest difference of centres and logarithms of sizes.
fn apart(a: &Splats, b: &Splats) -> f32 {
    let pairs = a.means.iter().zip(&b.means).chain(a.log_scales.iter().zip(&b.log_scales));
    pairs.flat_map(|(a, b)| (0..3).map(move |k| (a[k] - b[k]).abs())).fold(0.0, f32::max)
}

#[test]
fn sequences_of_other_formats_are_scenes() {
    let dir = tempfile::tempdir().unwrap();
    let (compressed, packed) = (dir.path().join("compressed"), dir.path().join("packed"));
    let times = source().time_range().frames(6);
    let options = compressed_ply::WriteOptions::default();
    let write = ply_sequence::write_compressed_folder;
    let losses =
        write(&compressed, &source(), &times, &options, Existing::Refuse, &mut |_| {}).unwrap();
    assert!(!losses.is_empty(), "reports losses");
    let read = PlySequence::open(&compressed, &SequenceOptions::default()).unwrap();
    let order = compressed_ply::morton_order(&source().at(0.0).unwrap());
    for t in [0.0, 0.5, 1.0] {
        let truth = source().at(t).unwrap().select(&order);
        assert!(apart(&read.at(t).unwrap(), &truth) < 0.01, "one order for all frames, at {t}");
    }
    assert!(read.row_drift().unwrap() < 0.3, "rows persist: {}", read.row_drift().unwrap());
    // Replacing our own folder is allowed.
    write(&compressed, &source(), &times, &options, Existing::Replace, &mut |_| {}).unwrap();

    fs::create_dir(&packed).unwrap();
    for (i, &t) in times.iter().enumerate() {
        let mut file = File::create(packed.join(format!("f{i}.spz"))).unwrap();
        let mut splats = source().at(t).unwrap();
        if i == 1 {
            splats = splats.select(&(0..splats.len()).rev().collect::<Vec<_>>());
        }
        spz::write(&splats, &spz::WriteOptions::default(), &mut file).unwrap();
    }
    let read = PlySequence::open(&packed, &SequenceOptions::default()).unwrap();
    assert!(apart(&read.at(0.0).unwrap(), &source().at(0.0).unwrap()) < 0.05, "SPZ frames");
    let drift = read.row_drift().unwrap();
    assert!(drift > 0.3, "a frame with permuted rows is detected: {drift}");
}

#[test]
fn axes_of_sequences_are_those_of_their_files_or_of_the_options() {
    let dir = tempfile::tempdir().unwrap();
    let (packed, binary) = (dir.path().join("packed"), dir.path().join("binary"));
    fs::create_dir(&packed).unwrap();
    fs::create_dir(&binary).unwrap();
    for (i, &t) in source().time_range().frames(6).iter().enumerate() {
        let splats = source().at(t).unwrap();
        let options = spz::WriteOptions { axes: Axes::PLY, ..spz::WriteOptions::default() };
        let mut file = File::create(packed.join(format!("f{i}.spz"))).unwrap();
        spz::write(&splats, &options, &mut file).unwrap();
        let mut file = File::create(binary.join(format!("f{i}.glb"))).unwrap();
        gltf::write(&splats, &gltf::WriteOptions::default(), &mut file).unwrap();
    }
    let truth = source().at(0.37).unwrap();
    let open = |folder: &Path, axes| {
        assert_eq!(detect(folder).unwrap(), SceneKind::PlySequence, "{}", folder.display());
        PlySequence::open(folder, &SequenceOptions { axes, ..SequenceOptions::default() }).unwrap()
    };
    for folder in [&packed, &binary] {
        let read = open(folder, None).at(0.37).unwrap();
        assert!(apart(&read, &truth) < 0.05, "{}: {}", folder.display(), apart(&read, &truth));
    }
    let mut rotated = open(&packed, Some(Axes::RUB)).at(0.37).unwrap();
    let tall = truth.means.iter().flat_map(|mean| [mean[1].abs(), mean[2].abs()]);
    let tall = tall.fold(0.0, f32::max);
    assert!(
        apart(&rotated, &truth) > tall.max(0.1),
        "the axes of the options override those of \
        the file"
    );
    for [_, y, z] in &mut rotated.means {
        (*y, *z) = (-*y, -*z);
    }
    assert!(apart(&rotated, &truth) < 0.05, "rotated by 180° about x");
}
