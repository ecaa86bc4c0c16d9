//! `.splatv` files: written clips, decoded by an independent decoder written from
//! the byte layout, have motion within the reported error; read clips follow the
//! format's formulas; arbitrary bytes do not cause panics.

use crate::common::changing_scene;

use gs_core::{Camera, DynamicScene, Splats, TimeRange, quat, sh};
use gs_deform::{Polynomial, PolynomialScene, StaticScene, TabulatedScene};
use gs_io::repair::Damage;
use gs_io::splatv::{self, PASSES, SplatvError, WriteOptions};
use gs_io::{Clip, Existing};
use half::f16;
use proptest::prelude::*;
use std::fs;
use std::path::Path;

fn camera() -> Camera {
    Camera::look_at([0.0, 0.0, -8.0], [0.0; 3], [0.0, -1.0, 0.0], 0.9, 640, 480)
}

fn options() -> WriteOptions {
    let up = [0.0, 1.0, 0.0];
    WriteOptions { tolerance: splatv::DEFAULT_TOLERANCE, force: false, camera: camera(), up }
}

/// A splat of the file at time `t`: centre, unit rotation, size, colour and opacity in 0 … 1.
struct Decoded {
    mean: [f64; 3],
    quat: [f64; 4],
    scale: [f64; 3],
    rgb: [f64; 3],
    opacity: f64,
}

/// The splats at time `t`, by the layout and formulas of the format.
fn decode(bytes: &[u8], t: f64) -> (serde_json::Value, Vec<Decoded>) {
    assert_eq!(bytes[..4], 0x674B_u32.to_le_bytes(), "magic");
    let json_len = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[8..8 + json_len]).unwrap();
    let texels = &bytes[8 + json_len..];
    assert_eq!(header[0]["size"].as_u64(), Some(texels.len() as u64), "size");
    let splats = texels.chunks_exact(64).map(|texel| {
        let word = |i: usize| u32::from_le_bytes(texel[4 * i..4 * i + 4].try_into().unwrap());
        let float = |i: usize| f64::from(f32::from_bits(word(i)));
        // Two halves of a word: low, high.
        let h = |i: usize, high: bool| {
            let bits = if high { word(i) >> 16 } else { word(i) & 0xffff };
            f64::from(f16::from_bits(u16::try_from(bits).unwrap()))
        };
        let byte = |k: u32| f64::from(word(7) >> (8 * k) & 0xff) / 255.0;
        let (centre, width) = (h(15, false), h(15, true));
        let dt = t - centre;
        let v1 = [h(8, false), h(8, true), h(9, false)];
        let v2 = [h(9, true), h(10, false), h(10, true)];
        let v3 = [h(11, false), h(11, true), h(12, false)];
        let omega = [h(13, false), h(13, true), h(14, false), h(14, true)];
        let rest = [h(3, false), h(3, true), h(4, false), h(4, true)];
        Decoded {
            mean: [0, 1, 2]
                .map(|k| float(k) + v1[k] * dt + v2[k] * dt.powi(2) + v3[k] * dt.powi(3)),
            quat: quat::normalize([0, 1, 2, 3].map(|k| rest[k] + omega[k] * dt)),
            scale: [h(5, false), h(5, true), h(6, false)],
            rgb: [0, 1, 2].map(byte),
            opacity: byte(3) * (-(dt / width).powi(2)).exp(),
        }
    });
    (header, splats.collect())
}

/// A scene whose rows change smoothly and slowly enough for cubic polynomials.
fn gentle(n: usize, frames: usize) -> TabulatedScene {
    let whole = changing_scene::scene(n, 40 * frames, 1);
    TabulatedScene::new(whole.frames()[..frames].to_vec()).unwrap()
}

fn write(
    path: &Path,
    scene: &dyn DynamicScene,
    frames: usize,
    options: &WriteOptions,
) -> splatv::WriteReport {
    let times = TimeRange::UNIT.frames(frames);
    let clip = Clip { scene, times: &times, fps: 30.0 };
    let mut steps = 0;
    let report = splatv::write(path, &clip, options, Existing::Refuse, &mut |done| {
        steps += 1;
        assert_eq!(done, steps, "progress");
    })
    .unwrap();
    assert_eq!(steps, PASSES * frames, "progress ends at its declared total");
    report
}

#[test]
fn written_motion_is_within_the_reported_error() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("clip.splatv");
    let scene = gentle(1500, 12);
    let report = write(&path, &scene, 12, &options());
    let bytes = fs::read(&path).unwrap();
    let (mut worst, mut total) = (0.0_f64, 0.0);
    for (f, truth) in scene.frames().iter().enumerate() {
        let (header, splats) = decode(&bytes, f as f64 / 11.0);
        assert_eq!(splats.len(), 2048, "whole rows of the texture");
        assert_eq!(header[0]["texheight"].as_u64(), Some(2), "rows");
        assert!(header[0]["cameras"][0]["fx"].as_f64().unwrap() > 100.0, "a camera to start from");
        for (i, splat) in splats[..1500].iter().enumerate() {
            let distance = (0..3)
                .map(|k| (f64::from(truth.means[i][k]) - splat.mean[k]).powi(2))
                .sum::<f64>()
                .sqrt();
            worst = worst.max(distance);
            total += distance;
            let q = quat::normalize(truth.quats[i].map(f64::from));
            let q = quat::align(q, splat.quat);
            for k in 0..4 {
                assert!((q[k] - splat.quat[k]).abs() < 0.01, "rotation of {i} in {f}");
            }
            for k in 0..3 {
                let size = f64::from(truth.scale(i)[k]);
                assert!((splat.scale[k] / size - 1.0).abs() < 0.06, "size of {i} in {f}");
                let rgb = f64::from(0.5 + sh::C0 * truth.sh_of(i)[0][k]).clamp(0.0, 1.0);
                assert!((splat.rgb[k] - rgb).abs() < 0.05, "colour of {i} in {f}");
            }
            assert!((splat.opacity - f64::from(truth.opacity(i))).abs() < 0.05, "opacity of {i}");
        }
        let padding = &splats[1500..];
        // With width 0, the formula gives 0/0 at the centre time.
        let invisible = |splat: &Decoded| splat.opacity == 0.0 || splat.opacity.is_nan();
        assert!(padding.iter().all(invisible), "padding is invisible");
    }
    assert!(
        (worst - report.distance.max).abs() < 1e-5,
        "{worst}, reported {}",
        report.distance.max
    );
    let mean = total / (1500.0 * 12.0);
    assert!(
        (mean - report.distance.mean).abs() < 1e-6,
        "{mean}, reported {}",
        report.distance.mean
    );
    assert!(worst < 2e-3, "cubic polynomials fit a short clip: {worst}");
    assert!(report.pixels.max > 0.0 && report.pixels.max < 1.0, "{:?}", report.pixels);
    assert!(report.losses.to_string().contains("cubic"), "{}", report.losses);
}

#[test]
fn written_clips_are_read_and_rewritten() {
    let dir = tempfile::tempdir().unwrap();
    let [first, second] = ["1.splatv", "2.splatv"].map(|name| dir.path().join(name));
    // Splats that appear, disappear and move fast, which the format represents exactly.
    let n = 200;
    let rest = changing_scene::scene(n, 2, 0).at(0.0).unwrap();
    let motions = (0..n)
        .map(|i| {
            let x = (i as f32 * 0.7).sin();
            Polynomial {
                velocity: [[x, 1.0, -x], [2.0 * x, -1.0, 0.5], [-3.0 * x, 0.2, x]],
                omega: [0.0, 0.2 * x, 0.0, -0.1],
                centre: 0.5 + 0.4 * x,
                width: if i % 3 == 0 { 1e4 } else { 0.25 + 0.1 * x },
            }
        })
        .collect();
    let scene = PolynomialScene::new(rest, motions).unwrap();
    let report = write(&first, &scene, 30, &options());
    assert!(report.distance.max < 5e-3, "only rounding to halves: {:?}", report.distance);
    let read = splatv::open(&first, Damage::Fail).unwrap();
    assert_eq!(read.repair.rows, n, "padding is not a row");
    assert_eq!(read.up, Some(options().up), "noted");
    for t in [0.0, 0.31, 0.77, 1.0] {
        let (a, b) = (scene.at(t).unwrap(), read.scene.at(t).unwrap());
        let (_, decoded) = decode(&fs::read(&first).unwrap(), t.into());
        for i in 0..n {
            assert!((a.opacity(i) - b.opacity(i)).abs() < 0.02, "opacity of {i} at {t}");
            for k in 0..3 {
                assert!((a.means[i][k] - b.means[i][k]).abs() < 5e-3, "centre of {i} at {t}");
                let exact = (f64::from(b.means[i][k]) - decoded[i].mean[k]).abs();
                assert!(exact < 1e-6, "reader and formula agree: {exact}");
            }
            for k in 0..4 {
                assert!((f64::from(b.quats[i][k]) - decoded[i].quat[k]).abs() < 1e-6, "rotation");
            }
            assert!(
                (f64::from(b.opacity(i)) - decoded[i].opacity).abs() < 2e-6,
                "opacity, formula"
            );
        }
    }
    let again = write(&second, &read.scene, 30, &options());
    assert!(again.distance.max < 5e-3, "a second generation: {:?}", again.distance);
}

#[test]
fn motion_that_cubics_do_not_fit_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("clip.splatv");
    let still = changing_scene::scene(100, 2, 0).at(0.0).unwrap();
    let frames: Vec<Splats> = (0..30_u8)
        .map(|f| {
            let mut frame = still.clone();
            frame.means.iter_mut().for_each(|mean| mean[0] += (f32::from(f) * 0.8).sin());
            frame
        })
        .collect();
    let scene = TabulatedScene::new(frames).unwrap();
    let times = TimeRange::UNIT.frames(30);
    let clip = Clip { scene: &scene, times: &times, fps: 30.0 };
    let error = splatv::write(&path, &clip, &options(), Existing::Refuse, &mut |_| ())
        .unwrap_err()
        .to_string();
    assert!(error.contains("pixels") && error.contains("shorter"), "{error}");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "no output remains");
    let forced = write(&path, &scene, 30, &WriteOptions { force: true, ..options() });
    assert!(forced.distance.max > 0.5, "reported nevertheless: {:?}", forced.distance);
    let short = Clip { times: &times[..3], ..clip };
    splatv::write(&path, &short, &options(), Existing::Replace, &mut |_| ()).unwrap();
}

#[test]
fn invalid_clips_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.splatv");
    let scene = gentle(20, 3);
    let clip = Clip { scene: &scene, times: &[0.0, 1.0], fps: 30.0 };
    let refuse = |clip: &Clip<'_>, options: &WriteOptions, expected: &str| {
        let error = splatv::write(&path, clip, options, Existing::Refuse, &mut |_| ())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected) && error.contains("x.splatv"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "no output remains: {error}");
    };
    refuse(&Clip { times: &[], ..clip }, &options(), "no frames");
    refuse(&Clip { fps: 0.0, ..clip }, &options(), "frames per second");
    refuse(&clip, &WriteOptions { tolerance: f64::NAN, ..options() }, "tolerance");
    let empty = StaticScene::new(Splats::default()).unwrap();
    refuse(&Clip { scene: &empty, ..clip }, &options(), "no splats");
    let mut frames = scene.frames().to_vec();
    frames[2].means[3] = [1e8; 3];
    let far = TabulatedScene::new(frames.clone()).unwrap();
    refuse(&Clip { scene: &far, ..clip }, &options(), "too far");
    frames[2].means[3] = [f32::NAN; 3];
    let damaged = TabulatedScene::new(frames).unwrap();
    let report = write(&path, &damaged, 3, &options());
    assert_eq!(report.num_splats, 19, "one row less");
    assert!(report.losses.to_string().contains("1 of 20"), "{}", report.losses);
    let one = dir.path().join("one.splatv");
    let report = write(&one, &scene, 1, &options());
    assert!(report.distance.max < 1e-6, "a single frame is static");
}

/// A file of these texels without padding, as some writers produce.
fn file(texels: &[[u8; 64]]) -> Vec<u8> {
    let header = format!(r#"[{{"type":"splat","size":{},"texwidth":4096,"texheight":1}}]"#, 65536);
    let mut bytes = 0x674B_u32.to_le_bytes().to_vec();
    bytes.extend_from_slice(&u32::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend(texels.iter().flatten());
    bytes
}

fn texel(quat: f32, width: f32) -> [u8; 64] {
    let mut texel = [0; 64];
    texel[..4].copy_from_slice(&2.0_f32.to_le_bytes());
    texel[12..14].copy_from_slice(&f16::from_f32(quat).to_le_bytes());
    texel[28..32].copy_from_slice(&[255, 0, 128, 255]);
    texel[62..].copy_from_slice(&f16::from_f32(width).to_le_bytes());
    texel
}

#[test]
fn files_of_other_writers() {
    let good = texel(1.0, f32::INFINITY);
    let read = splatv::read(&file(&[good, [0; 64], good]), Damage::Fail).unwrap();
    assert_eq!(read.scene.num_splats(), 2, "rows of zeros are padding");
    assert_eq!(read.up, None, "other writers note no upward direction");
    let splats = read.scene.at(0.9).unwrap();
    assert!((0..2).all(|i| splats.is_finite(i)), "sizes of 0 and opacity 255 stay finite");
    assert_eq!(splats.means[0], [2.0, 0.0, 0.0], "centre");
    assert!(splats.opacity(0) > 0.999, "always there");

    let damaged = [good, texel(0.0, 1.0), texel(f32::NAN, 1.0), texel(1.0, f32::NAN)];
    let read = splatv::read(&file(&damaged), Damage::Drop).unwrap();
    assert_eq!((read.scene.num_splats(), read.repair.damaged()), (1, 3), "counted");
    assert_eq!(read.repair.zero_quaternion, 1, "by kind");
    assert_eq!(splatv::read(&file(&damaged), Damage::Keep).unwrap().scene.num_splats(), 4, "kept");
    let error = splatv::read(&file(&damaged), Damage::Fail).unwrap_err();
    assert!(matches!(error, SplatvError::Damaged(_)), "{error}");
    let error = splatv::read(&file(&damaged[1..]), Damage::Drop).unwrap_err();
    assert!(matches!(error, SplatvError::Damaged(_)), "none left: {error}");

    let mut cut = file(&[good]);
    cut.pop();
    assert!(
        matches!(splatv::read(&cut, Damage::Drop), Err(SplatvError::Truncated { found: 63 })),
        "cut"
    );
    assert!(matches!(splatv::read(&file(&[]), Damage::Drop), Err(SplatvError::Empty)), "empty");
    assert!(matches!(splatv::read(b"ply\n", Damage::Drop), Err(SplatvError::Magic)), "other files");
    let lying = [&0x674B_u32.to_le_bytes()[..], &u32::MAX.to_le_bytes(), b"[]"].concat();
    assert!(matches!(splatv::read(&lying, Damage::Drop), Err(SplatvError::Header(_))), "lengths");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), front in any::<bool>()) {
        let bytes = if front { [file(&[]), bytes].concat() } else { bytes };
        if let Ok(read) = splatv::read(&bytes, Damage::Keep) {
            prop_assert!(read.scene.at(0.5).is_ok(), "evaluates");
        }
    }
}
