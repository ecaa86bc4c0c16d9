//! `.tsog` archives: decoded as defined by version 4, on hand-computed values, and refused if they
//! do not conform.

use crate::common::tsog;

use gs_io::{IoError, OpenOptions, OpenedScene, SceneKind, detect, frame, open_scene};
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;
use tsog::{Plane, archive};

/// Two splats: positions (−1, 0, 0) and (1, 0, e − 1), scales (1, 1, e) and (1, 1, 1), rotations
/// close to the identity and to a rotation by 180° about z, opacities 128/255 and 1.
fn base() -> (Value, Vec<Plane>) {
    let log2 = std::f64::consts::LN_2;
    let meta = json!({
        "version": 4,
        "count": 2,
        "means": {"mins": [-log2, 0.0, 0.0], "maxs": [log2, 0.0, 1.0], "files": ["pl", "ph"]},
        "scales": {"codebook": [0.0, 1.0], "files": ["s"]},
        "quats": {"files": ["q"]},
        "sh0": {"codebook": [0.0, 1.0, -1.0], "files": ["c"]},
    });
    let planes = vec![
        ("pl", vec![[0, 0, 0, 255], [255, 9, 255, 255]]),
        ("ph", vec![[0, 0, 0, 255], [255, 9, 255, 255]]),
        ("s", vec![[0, 0, 1, 255], [0, 0, 0, 255]]),
        ("q", vec![[128, 128, 128, 252], [128, 128, 128, 255]]),
        ("c", vec![[0, 1, 2, 128], [2, 0, 1, 255]]),
    ];
    (meta, planes)
}

/// The same with centres −1 and 1, standard deviations ½ and 1, velocities (−2, 0, 513) and
/// (2, 0, 258), and SH of degree 1.
fn continuous() -> (Value, Vec<Plane>) {
    let (mut meta, mut planes) = base();
    meta["timeline"] =
        json!({"type": 1, "mins": [-1.0, 0.5], "maxs": [1.0, 1.0], "files": ["tl", "th"]});
    meta["temporal"] = json!({"means": {"mins": [[-2.0, 0.0, 0.0]], "maxs": [[2.0, 0.0, 65535.0]], "files": ["vl", "vh"]}});
    meta["shN"] = json!({"bands": 1, "count": 2, "codebook": [0.0, 0.5, -0.5], "files": ["palette", "labels"]});
    meta["playback"] = json!({"duration": 2.0, "fps": 4.0, "rate": 2.0});
    meta["audio"] = json!({"file": "tone.wav"});
    let mut palette = vec![[0, 0, 0, 255]; 192];
    palette[3..6].copy_from_slice(&[[1, 2, 0, 255], [0, 1, 2, 255], [2, 0, 1, 255]]);
    planes.extend([
        ("tl", vec![[0, 0, 7, 255], [255, 255, 7, 255]]),
        ("th", vec![[0, 0, 7, 255], [255, 255, 7, 255]]),
        ("vl", vec![[0, 0, 1, 255], [255, 0, 2, 255]]),
        ("vh", vec![[0, 0, 2, 255], [255, 0, 1, 255]]),
        ("palette", palette),
        ("labels", vec![[0, 0, 0, 255], [1, 0, 0, 255]]),
    ]);
    (meta, planes)
}

fn discrete() -> (Value, Vec<Plane>) {
    let (mut meta, mut planes) = base();
    meta["timeline"] = json!({"type": 0, "N": 3, "delta": 21845, "files": ["tl", "th"]});
    meta["fps"] = json!(6.0);
    // Codes 21844 and 65535: the end of the first frame, and beyond the last bucket.
    planes.extend([
        ("tl", vec![[0x54, 0, 0, 255], [0xff, 0, 0, 255]]),
        ("th", vec![[0x55, 0, 0, 255], [0xff, 0, 0, 255]]),
    ]);
    (meta, planes)
}

fn write(meta: &Value, planes: &[Plane]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("clip");
    fs::write(&path, archive(meta, planes)).unwrap();
    (dir, path)
}

fn open((meta, planes): &(Value, Vec<Plane>)) -> Result<OpenedScene, IoError> {
    let (_dir, path) = write(meta, planes);
    assert_eq!(detect(&path).unwrap(), SceneKind::Tsog, "by content, for any name");
    open_scene(&path, &OpenOptions::default())
}

fn assert_near<const D: usize>(found: [f32; D], expected: [f64; D], what: &str) {
    let off = found.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).abs() / (1.0 + b.abs()));
    assert!(off.fold(0.0, f64::max) < 1e-5, "{what}: {found:?}, expected {expected:?}");
}

#[test]
fn continuous_archives_are_decoded_as_specified() {
    let read = open(&continuous()).unwrap();
    assert_eq!(read.kind, SceneKind::Tsog, "kind");
    assert_eq!(read.scene.num_frames(), Some(9), "2 s at 4 frames per second, both ends");
    assert!((read.fps.unwrap() - 4.5).abs() < 1e-12, "9 frames last 2 s");
    assert!(read.notes[0].contains("sound"), "{:?}", read.notes);
    let splats = read.scene.at(0.0).unwrap();
    // One clip after the first centre, and one before the second.
    assert_near(splats.means[0], [-3.0, 0.0, 513.0], "position");
    assert_near(splats.means[1], [-1.0, 0.0, std::f64::consts::E - 1.0 - 258.0], "position");
    let fade = |alpha: f64, z: f64| [alpha * (-0.5 * z * z).exp()];
    assert_near([splats.opacity(0)], fade(128.0 / 255.0, 2.0), "two deviations later");
    assert_near([splats.opacity(1)], fade(1.0, 1.0), "one deviation before");
    assert_eq!(splats.log_scales, [[0.0, 0.0, 1.0], [0.0; 3]], "logarithms");
    assert_eq!(splats.sh_degree, 1, "degree");
    let coefficients = [[0.0, 1.0, -1.0], [0.0; 3], [0.0; 3], [0.0; 3]];
    assert_eq!(splats.sh_of(0), coefficients, "the first entry of the palette is zero");
    let second = [[-1.0, 0.0, 1.0], [0.5, -0.5, 0.0], [0.0, 0.5, -0.5], [-0.5, 0.0, 0.5]];
    assert_eq!(splats.sh_of(1), second, "the second entry");
    // 128/255 is not quite the middle of the range.
    let small = (2.0 * 128.0 / 255.0 - 1.0) / 2.0_f64.sqrt();
    let large = (1.0 - 3.0 * small * small).sqrt();
    assert_near(splats.quats[0], [large, small, small, small], "w is omitted");
    assert_near(splats.quats[1], [small, small, small, large], "z is omitted");
    let late = read.scene.at(1.0).unwrap();
    assert_near(late.means[1], [1.0, 0.0, std::f64::consts::E - 1.0], "at its centre");
    assert_near([late.opacity(1)], [1.0 - 1e-6], "not faded");
}

#[test]
fn one_plane_of_velocities_has_8_bits() {
    let (mut meta, mut planes) = continuous();
    meta["temporal"]["means"]["files"] = json!(["vl"]);
    meta["temporal"]["means"]["maxs"] = json!([[2.0, 0.0, 255.0]]);
    planes.retain(|(name, _)| *name != "vh");
    let splats = open(&(meta, planes)).unwrap().scene.at(0.0).unwrap();
    assert_near(splats.means[0], [-3.0, 0.0, 1.0], "velocity (−2, 0, 1)");
}

#[test]
fn discrete_archives_show_each_splat_in_its_frame() {
    let read = open(&discrete()).unwrap();
    assert_eq!(read.scene.num_frames(), Some(3), "frames");
    assert!((read.fps.unwrap() - 6.0).abs() < 1e-12, "rate");
    for (t, expected) in [
        (0.0, [true, false]),
        (0.33, [true, false]),
        (0.34, [false, false]),
        (0.5, [false, false]),
        (0.67, [false, true]),
        (1.0, [false, true]),
    ] {
        let splats = read.scene.at(t).unwrap();
        assert_eq!([0, 1].map(|row| splats.opacity(row) > 0.4), expected, "at {t}");
    }
}

#[test]
fn archives_without_timeline_are_static() {
    let read = open(&base()).unwrap();
    assert_eq!(read.scene.at(0.0).unwrap(), read.scene.at(1.0).unwrap(), "nothing moves");
    assert_near([read.scene.at(0.0).unwrap().opacity(0)], [128.0 / 255.0], "linear opacity");
}

/// Name of a change, the change of the metadata, and a part of the expected message.
type Case = (&'static str, fn(&mut Value), &'static str);

const REFUSED: [Case; 22] = [
    ("version", |meta| meta["version"] = json!(5), "expected 4"),
    ("profile", |meta| meta["profile"] = json!({"id": "other", "version": 1}), "expected org."),
    (
        "future profile",
        |meta| meta["profile"] = json!({"id": "org.opsiclear.tsog-playback", "version": 2}),
        "expected org.",
    ),
    ("fraction", |meta| meta["count"] = json!(1.5), "meta.json"),
    ("no splats", |meta| meta["count"] = json!(0), "no splats"),
    ("too many", |meta| meta["count"] = json!(3), "3 splats in a plane of 2"),
    ("far too many", |meta| meta["count"] = json!(1_u64 << 53), "9007199254740992 splats in"),
    ("no means", |meta| drop(meta.as_object_mut().unwrap().remove("means")), "means"),
    ("two numbers", |meta| meta["means"]["mins"] = json!([0, 0]), "meta.json"),
    ("reversed", |meta| meta["means"]["mins"] = json!([9, 0, 0]), "ascending"),
    ("overflow", |meta| meta["means"]["maxs"] = json!([1e39, 0, 1]), "out of range"),
    ("no codes", |meta| meta["sh0"]["codebook"] = json!([]), "0 values for sh0"),
    ("short codes", |meta| meta["sh0"]["codebook"] = json!([0.0]), "index 1 in the codebook"),
    ("text", |meta| meta["scales"]["codebook"] = json!(["0"]), "meta.json"),
    ("timeline", |meta| meta["timeline"]["type"] = json!(2), "type 2"),
    ("range of time", |meta| drop(meta["timeline"]["mins"].take()), "mins"),
    ("deviation", |meta| meta["timeline"]["mins"] = json!([0.0, 0.0]), "above 0"),
    ("tiny deviation", |meta| meta["timeline"]["mins"] = json!([0.0, 1e-100]), "above 0"),
    ("scales move", |meta| meta["temporal"]["scales"] = json!({}), "animates `scales`"),
    ("cubic", |meta| meta["temporal"]["means"]["mins"] = json!([[0, 0, 0], [0, 0, 0]]), "lines"),
    ("duration", |meta| meta["playback"] = json!({"duration": 1e300, "fps": 1e300}), "lasts"),
    ("palette", |meta| meta["shN"]["count"] = json!(1), "entry 1 of a palette of 1"),
];

#[test]
fn other_metadata_are_refused_with_the_next_step() {
    for (what, change, expected) in REFUSED {
        let (mut meta, planes) = continuous();
        change(&mut meta);
        let error = open(&(meta, planes)).expect_err(what).to_string();
        let next = ["export it again", "copy or export", "PLY sequence"];
        assert!(error.contains(expected), "{what}: {error}");
        assert!(next.iter().any(|next| error.contains(next)), "{what}: {error}");
        assert!(error.contains("clip"), "names the file: {error}");
    }
    for (what, change, expected) in [
        ("frames", (|meta| meta["timeline"]["N"] = json!(0)) as fn(&mut Value), "0 frames"),
        ("frames", |meta| meta["timeline"]["N"] = json!(1 << 20), "1 to 65536"),
        ("delta", |meta| meta["timeline"]["delta"] = json!(1), "expected 21845"),
        ("rate", |meta| meta["fps"] = json!(0), "frames per second"),
    ] {
        let (mut meta, planes) = discrete();
        change(&mut meta);
        let error = open(&(meta, planes)).expect_err(what).to_string();
        assert!(error.contains(expected), "{what}: {error}");
    }
}

#[test]
fn damaged_planes_are_refused() {
    let (meta, planes) = continuous();
    for missing in 0..planes.len() {
        let mut fewer = planes.clone();
        let (name, _) = fewer.remove(missing);
        let error = open(&(meta.clone(), fewer)).expect_err(name).to_string();
        assert!(error.contains(name) && error.contains("copy or export"), "{name}: {error}");
        let mut short = planes.clone();
        short[missing].1.truncate(1);
        let error = open(&(meta.clone(), short)).expect_err(name).to_string();
        assert!(error.contains("pixels"), "{name}: {error}");
    }
    let mut tags = planes.clone();
    tags[3].1[1][3] = 251;
    let error = open(&(meta.clone(), tags)).unwrap_err().to_string();
    assert!(error.contains("rotation of splat 1"), "{error}");
    let (_dir, path) = write(&meta, &planes);
    let whole = fs::read(&path).unwrap();
    for bytes in [&whole[..whole.len() - 1], &whole[..whole.len() / 2]] {
        fs::write(&path, bytes).unwrap();
        assert!(open_scene(&path, &OpenOptions::default()).is_err(), "{} bytes", bytes.len());
    }
    let mut entries = vec![("meta.json", meta.to_string().into_bytes())];
    entries.extend(planes.iter().map(|(name, pixels)| (*name, tsog::webp(pixels, pixels.len()))));
    let lossless = entries[1].1.windows(4).position(|bytes| bytes == b"VP8L").unwrap();
    entries[1].1[lossless + 3] = b' ';
    fs::write(&path, tsog::zip(&entries)).unwrap();
    let error = open_scene(&path, &OpenOptions::default()).unwrap_err().to_string();
    assert!(error.contains("lossy"), "{error}");
}

#[test]
fn clips_are_not_edited_frames() {
    let (meta, planes) = continuous();
    let (_dir, path) = write(&meta, &planes);
    let error = frame::read_file(&path).unwrap_err().to_string();
    assert!(error.contains("a .tsog clip") && error.contains("use it as the scene"), "{error}");
}
