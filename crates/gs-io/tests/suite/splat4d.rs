//! `.splat4d` files, decoded by an independent decoder written from the byte layout, are within the
//! stated bounds at every splat and frame for all changing attributes, and the crate's reader gives
//! exactly the same values. Hostile clips and files are refused, or repaired with a count.

use crate::common::changing_scene;

use gs_core::{DynamicScene, Splats, TimeRange, quat, sh};
use gs_deform::{StaticScene, TabulatedScene};
use gs_io::repair::Damage;
use gs_io::splat4d::{self, PASSES, Splat4dError, WriteOptions};
use gs_io::{Clip, Existing};
use std::fs;
use std::path::Path;

/// A decoded splat: position, rotation in 128ths, colour and opacity in 255ths, log size.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    pos: [f64; 3],
    rot: [f64; 4],
    rgb: [f64; 3],
    alpha: f64,
    scale: [f64; 3],
}

/// One stream: attribute, kind, symbols; and where the next one begins.
fn stream(bytes: &[u8], head: usize, payload: usize) -> (u8, u8, Vec<u32>, usize) {
    let (attribute, kind, width) = (bytes[head], bytes[head + 1], usize::from(bytes[head + 2]));
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let (count, packed) = (u32_at(head + 3), u32_at(head + 7));
    assert!([1, 2, 4].contains(&width), "width {width}");
    let mut decoder = zstd::stream::Decoder::new(&bytes[payload..payload + packed]).unwrap();
    decoder.window_log_max(23).unwrap();
    let mut planes = Vec::new();
    std::io::Read::read_to_end(&mut decoder, &mut planes).unwrap();
    assert_eq!(planes.len(), count * width, "planes");
    let symbol = |i: usize| (0..width).map(|p| u32::from(planes[p * count + i]) << (8 * p)).sum();
    (attribute, kind, (0..count).map(symbol).collect(), payload + packed)
}

fn unzigzag(symbol: u32) -> i64 {
    i64::from(symbol >> 1) ^ -i64::from(symbol & 1)
}

const CHANNELS: [usize; 5] = [3, 4, 3, 1, 3];

fn decode(path: &Path) -> (serde_json::Value, Vec<Vec<Row>>) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"SP4D\x01\0\0\0", "magic, version, flags");
    let json_len = u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[12..12 + json_len]).unwrap();
    let whole = |value: &serde_json::Value| usize::try_from(value.as_u64().unwrap()).unwrap();
    let n = whole(&header["n"]);
    let step = |name: &str| header["steps"][name].as_f64().unwrap();
    let steps = [step("pos"), step("rot"), step("rgb"), step("alpha"), step("scale_log")];

    let section = &header["static_section"];
    let mut at = whole(&section["offset"]);
    let end = at + whole(&section["len"]);
    assert_eq!(at, 12 + json_len, "static section follows the header");
    let mut streams = Vec::new();
    for expected in [0, 1, 2, 3, 4, 0, 4, 2, 3, 1] {
        let (attribute, kind, symbols, next) = stream(&bytes, at, at + 11);
        assert_eq!((attribute, kind), (expected, 2), "order of static streams");
        streams.push(symbols);
        at = next;
    }
    assert_eq!(at, end, "length of the static section");
    let is_static = |a: usize, i: usize| streams[a][i / 8] >> (7 - i % 8) & 1 == 1;
    let running = |symbols: &[u32], step: f64| {
        let mut sum = [0_i64; 3];
        symbols
            .chunks(3)
            .map(|three| {
                [0, 1, 2].map(|k| {
                    sum[k] += unzigzag(three[k]);
                    sum[k] as f64 * step
                })
            })
            .collect::<Vec<[f64; 3]>>()
    };
    let pos = running(&streams[5], step("base_pos"));
    let scale = running(&streams[6], step("base_scale_log"));
    let base: Vec<Row> = (0..n)
        .map(|i| Row {
            pos: pos[i],
            scale: scale[i],
            rgb: [0, 1, 2].map(|k| f64::from(streams[7][i * 3 + k])),
            alpha: f64::from(streams[8][i]),
            rot: [0, 1, 2, 3].map(|k| f64::from(streams[9][i * 4 + k]) - 128.0),
        })
        .collect();

    let mut frames = Vec::new();
    for gop in header["gops"].as_array().unwrap() {
        let start = whole(&gop["offset"]);
        assert_eq!(start, at, "chunks follow each other");
        let count = usize::from(u16::from_le_bytes(bytes[start..start + 2].try_into().unwrap()));
        let mut payload = start + 2 + 11 * count;
        let (mut keys, mut deltas) = (vec![Vec::new(); 5], vec![Vec::new(); 5]);
        let mut last_kind = 0;
        for s in 0..count {
            let (attribute, kind, symbols, next) = stream(&bytes, start + 2 + 11 * s, payload);
            assert!(kind >= last_kind, "keys before deltas");
            last_kind = kind;
            (if kind == 0 { &mut keys } else { &mut deltas })[usize::from(attribute)] = symbols;
            payload = next;
        }
        assert_eq!(payload - start, whole(&gop["len"]), "length of the chunk");
        at = payload;
        let length = whole(&gop["f1"]) - whole(&gop["f0"]) + 1;
        assert_eq!(frames.len(), whole(&gop["f0"]), "frames in order");
        let mut bins: Vec<Vec<i64>> =
            keys.iter().map(|key| key.iter().map(|&symbol| unzigzag(symbol)).collect()).collect();
        for f in 0..length {
            let mut rows = base.clone();
            for a in 0..5 {
                let dynamic: Vec<usize> = (0..n).filter(|&i| !is_static(a, i)).collect();
                assert_eq!(bins[a].len(), dynamic.len() * CHANNELS[a], "a key per group");
                if f > 0 {
                    let length = bins[a].len();
                    for (bin, &delta) in bins[a].iter_mut().zip(&deltas[a][(f - 1) * length..]) {
                        *bin += unzigzag(delta);
                    }
                }
                for (d, &i) in dynamic.iter().enumerate() {
                    let value = |k: usize| bins[a][d * CHANNELS[a] + k] as f64 * steps[a];
                    let row = &mut rows[i];
                    match a {
                        0 => row.pos = [0, 1, 2].map(value),
                        1 => row.rot = [0, 1, 2, 3].map(value),
                        2 => row.rgb = [0, 1, 2].map(|k| value(k).clamp(0.0, 255.0)),
                        3 => row.alpha = value(0).clamp(0.0, 255.0),
                        _ => row.scale = [0, 1, 2].map(value),
                    }
                }
            }
            frames.push(rows);
        }
    }
    assert_eq!(at, bytes.len(), "nothing after the last chunk");
    assert_eq!(frames.len(), whole(&header["t"]), "frames");
    (header, frames)
}

/// Largest errors: position, rotation, colour, opacity, log size. The file has its own order, so
/// decoded splats are matched to rows by position and size in all frames.
fn errors(scene: &TabulatedScene, frames: &[Vec<Row>]) -> [f64; 5] {
    let first = &scene.frames()[0];
    let distance = |i: usize, place: usize| {
        let frame = |(rows, splats): (&Vec<Row>, &Splats)| {
            let Row { pos, scale, .. } = rows[place];
            let squared = |k: usize| {
                (f64::from(splats.means[i][k]) - pos[k]).powi(2)
                    + (f64::from(splats.log_scales[i][k]) - scale[k]).powi(2)
            };
            (0..3).map(squared).sum::<f64>()
        };
        frames.iter().zip(scene.frames()).step_by(5).map(frame).sum::<f64>()
    };
    let row_of: Vec<usize> = (0..frames[0].len())
        .map(|place| {
            let nearer = |&a: &usize, &b: &usize| distance(a, place).total_cmp(&distance(b, place));
            (0..first.len()).min_by(nearer).unwrap()
        })
        .collect();
    let mut seen = row_of.clone();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), first.len(), "every splat once");
    let mut worst = [0.0_f64; 5];
    let level = |value: f32| f64::from((value * 255.0).round().clamp(0.0, 255.0));
    for (rows, splats) in frames.iter().zip(scene.frames()) {
        for (row, &i) in rows.iter().zip(&row_of) {
            for k in 0..3 {
                let rgb = level(0.5 + sh::C0 * splats.sh_of(i)[0][k]);
                worst[0] = worst[0].max((row.pos[k] - f64::from(splats.means[i][k])).abs());
                worst[2] = worst[2].max((row.rgb[k] - rgb).abs());
                worst[4] = worst[4].max((row.scale[k] - f64::from(splats.log_scales[i][k])).abs());
            }
            let q = quat::normalize(splats.quats[i].map(f64::from));
            let q = quat::align(q.map(|c| c * 128.0), row.rot);
            for k in 0..4 {
                worst[1] = worst[1].max((row.rot[k] - q[k]).abs());
            }
            worst[3] = worst[3].max((row.alpha - level(splats.opacity(i))).abs());
        }
    }
    worst
}

fn write(
    scene: &dyn DynamicScene,
    frames: usize,
    options: &WriteOptions,
) -> (tempfile::TempDir, splat4d::WriteReport) {
    let dir = tempfile::tempdir().unwrap();
    let times = TimeRange::UNIT.frames(frames);
    let clip = Clip { scene, times: &times, fps: 24.0 };
    let mut steps = 0;
    let report = splat4d::write(
        &dir.path().join("clip.splat4d"),
        &clip,
        options,
        Existing::Refuse,
        &mut |done| {
            steps += 1;
            assert_eq!(done, steps, "progress");
        },
    )
    .unwrap();
    assert_eq!(steps, PASSES * frames, "progress ends at its declared total");
    (dir, report)
}

#[test]
fn every_value_is_within_its_bound() {
    let scene = changing_scene::scene(333, 40, 1);
    for options in [
        WriteOptions { gop: 15, ..WriteOptions::default() },
        WriteOptions { tolerance: 0.02, scale: 0.1, rgb: 4, alpha: 0, rot: 2, gop: 13, up: None },
        WriteOptions { tolerance: 1e-6, scale: 1e-4, rgb: 0, alpha: 7, rot: 0, gop: 100, up: None },
    ] {
        let (dir, report) = write(&scene, 40, &options);
        let (header, frames) = decode(&dir.path().join("clip.splat4d"));
        let worst = errors(&scene, &frames);
        // A component is rounded to 1/128 before its bound applies, and 1 becomes 127/128.
        let rot = f64::from(options.rot) + 1.0;
        let bounds = [
            report.position_bound,
            rot,
            f64::from(options.rgb),
            f64::from(options.alpha),
            options.scale.ln_1p(),
        ];
        for (what, (error, bound)) in worst.iter().zip(bounds).enumerate() {
            assert!(
                *error <= bound + 1e-9,
                "attribute {what}: {error} beyond {bound}, {options:?}"
            );
            assert!(
                bound == 0.0 || *error > 0.2 * bound,
                "attribute {what}: {error} is far below {bound}, so the bound is not tested"
            );
        }
        let stated = header["bounds"]["pos_m"].as_f64().unwrap();
        assert!((stated / report.position_bound - 1.0).abs() < 1e-12, "{stated}");
        assert_eq!(header["fps"].as_f64(), Some(24.0), "rate");
        assert!(
            report.moving > 100 && report.moving < 200,
            "half of the splats move: {}",
            report.moving
        );
        assert_eq!(
            report.bytes,
            fs::metadata(dir.path().join("clip.splat4d")).unwrap().len(),
            "size"
        );
        assert!(report.losses.to_string().contains("SH degree 1"), "{}", report.losses);
    }
}

/// Whether splat `i` of the reader equals a decoded splat.
fn matches(row: &Row, splats: &Splats, i: usize) -> bool {
    let close = |a: f64, b: f32| (a - f64::from(b)).abs() <= 1e-6 * a.abs().max(1.0);
    let three = |a: [f64; 3], b: [f32; 3]| (0..3).all(|k| close(a[k], b[k]));
    let level = |value: f32| f64::from((value * 255.0).round());
    three(row.pos, splats.means[i])
        && three(row.scale, splats.log_scales[i])
        && (0..4).all(|k| row.rot[k] == f64::from(splats.quats[i][k] * 128.0))
        && (0..3).all(|k| row.rgb[k] == level(0.5 + sh::C0 * splats.sh[i][k]))
        && row.alpha == level(splats.opacity(i))
}

#[test]
fn written_clips_are_read_back() {
    let scene = changing_scene::scene(333, 40, 1);
    let up = [0.0, -1.0, 0.0];
    for options in [
        WriteOptions { gop: 15, up: Some(up), ..WriteOptions::default() },
        WriteOptions { tolerance: 0.02, scale: 0.1, rgb: 4, alpha: 3, rot: 2, gop: 1, up: None },
    ] {
        let (dir, _) = write(&scene, 40, &options);
        let path = dir.path().join("clip.splat4d");
        let (_, frames) = decode(&path);
        let read = splat4d::open(&path, Damage::Fail).unwrap();
        assert_eq!((read.fps, read.up, read.repair.damaged()), (24.0, options.up, 0), "notes");
        let clip = &read.scene;
        assert_eq!((clip.num_splats(), clip.num_frames(), clip.sh_degree()), (333, Some(40), 0));
        assert!(clip.fades(), "opacities change");
        let times = clip.time_range().frames(40);
        // Forwards, then backwards and across groups of frames.
        for f in (0..40).chain([39, 3, 17, 16, 29, 0]) {
            let splats = clip.at(times[f]).unwrap();
            for (i, row) in frames[f].iter().enumerate() {
                assert!(matches(row, &splats, i), "frame {f}, splat {i}: {row:?}");
            }
        }
        let mut wrong = frames[3][5];
        wrong.pos[2] += 1e-4;
        assert!(!matches(&wrong, &clip.at(times[3]).unwrap(), 5), "the comparison can fail");
        let (before, after) = (clip.at(times[4]).unwrap(), clip.at(times[5]).unwrap());
        let between = clip.at(0.5 * (times[4] + times[5])).unwrap();
        let middle = 0.5 * (before.means[1][0] + after.means[1][0]);
        assert!((between.means[1][0] - middle).abs() < 1e-5, "linear between frames");
        assert!(clip.at(1.5).is_err(), "outside");
        let mut geometry = Splats::default();
        clip.geometry_into(0.3, &mut geometry).unwrap();
        assert_eq!((geometry.means.len(), geometry.sh.len()), (333, 0), "geometry alone");
    }
}

#[test]
fn rows_without_rotation_are_dropped_and_counted() {
    let (dir, _) = write(
        &changing_scene::scene(60, 9, 0),
        9,
        &WriteOptions { gop: 4, ..WriteOptions::default() },
    );
    let bytes = fs::read(dir.path().join("clip.splat4d")).unwrap();
    let whole = splat4d::read(bytes.clone(), Damage::Fail).unwrap().scene;
    // Zeroes the static rotations of all splats; splats that rotate have others in every frame.
    let json_len = u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize;
    let mut header: serde_json::Value = serde_json::from_slice(&bytes[12..12 + json_len]).unwrap();
    let whole_number =
        |value: &serde_json::Value| usize::try_from(value.as_u64().unwrap()).unwrap();
    let section = 12 + json_len..12 + json_len + whole_number(&header["static_section"]["len"]);
    let mut at = section.start;
    for _ in 0..9 {
        at = stream(&bytes, at, at + 11).3;
    }
    let packed = zstd::bulk::compress(&[128; 240], 3).unwrap();
    let mut changed = bytes[section.start..at].to_vec();
    changed.extend_from_slice(&[1, 2, 1]);
    changed.extend_from_slice(&240_u32.to_le_bytes());
    changed.extend_from_slice(&u32::try_from(packed.len()).unwrap().to_le_bytes());
    changed.extend_from_slice(&packed);
    let rest = &bytes[section.end..];
    header["static_section"]["len"] = changed.len().into();
    // Room for offsets of any length.
    let front = 12 + 4096;
    header["static_section"]["offset"] = front.into();
    let moved = front + changed.len();
    for gop in header["gops"].as_array_mut().unwrap() {
        gop["offset"] = (moved + whole_number(&gop["offset"]) - section.end).into();
    }
    let mut file = b"SP4D\x01\0\0\0".to_vec();
    file.extend_from_slice(&4096_u32.to_le_bytes());
    let mut json = header.to_string().into_bytes();
    json.resize(4096, b' ');
    file.extend(json.into_iter().chain(changed).chain(rest.iter().copied()));

    let read = splat4d::read(file.clone(), Damage::Drop).unwrap();
    let turning = whole_number(&header["dyn"]["rot"]);
    assert_eq!((read.repair.rows, read.repair.zero_quaternion), (60, 60 - turning), "counted");
    assert_eq!(read.scene.num_splats(), turning, "dropped");
    let kept = read.scene.at(0.5).unwrap();
    assert!((0..kept.len()).all(|i| kept.is_finite(i)), "usable");
    assert!(kept.means.iter().all(|mean| whole.at(0.5).unwrap().means.contains(mean)), "as it was");
    assert!(matches!(
        splat4d::read(file.clone(), Damage::Fail).unwrap_err(),
        Splat4dError::Damaged(_)
    ));
    assert_eq!(splat4d::read(file, Damage::Keep).unwrap().scene.num_splats(), 60, "kept");
}

#[test]
fn damaged_files_are_errors() {
    let (dir, _) = write(
        &changing_scene::scene(40, 12, 0),
        12,
        &WriteOptions { gop: 5, ..WriteOptions::default() },
    );
    let bytes = fs::read(dir.path().join("clip.splat4d")).unwrap();
    let fails = |bytes: &[u8], expected: &str| {
        let error = splat4d::read(bytes.to_vec(), Damage::Drop).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    };
    fails(b"SP4", "does not begin");
    fails(&[&b"SP4D\x02"[..], &bytes[5..]].concat(), "version 2, expected 1");
    for length in 0..bytes.len() {
        assert!(splat4d::read(bytes[..length].to_vec(), Damage::Drop).is_err(), "cut at {length}");
    }
    // Same length, another value.
    let edit = |from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        let mut edited = bytes.clone();
        edited[at..at + to.len()].copy_from_slice(to.as_bytes());
        edited
    };
    fails(&edit("\"n\":40", "\"n\":41"), "symbols, expected");
    fails(&edit("\"n\":40", "\"n\":00"), "damaged");
    fails(&edit("\"t\":12", "\"t\":13"), "groups have 12 frames, expected 13");
    fails(&edit("\"f0\":5", "\"f0\":4"), "expected to start at 5");
    fails(&edit("\"f1\":9", "\"f1\":8"), "expected to start at 9");
    fails(&edit("\"base_pos\":", "\"base_pos\":-"), "header");
    fails(&edit("\"offset\":", "\"offset\":9"), "truncated: its group 0 of frames ends at");
    let path = dir.path().join("clip.splat4d");
    fs::write(&path, &bytes[..200]).unwrap();
    let error = splat4d::open(&path, Damage::Drop).unwrap_err().to_string();
    assert!(error.contains("clip.splat4d") && error.contains("truncated"), "{error}");
}

#[test]
fn small_files_do_not_decompress_to_large_scenes() {
    // A hundred million splats in a few kilobytes: every stream is one value repeated.
    let n = 100_000_000_u32;
    let mut section = Vec::new();
    for (attribute, channels) in [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (0, 3), (4, 3), (2, 3)] {
        let count = if channels == 0 { n / 8 } else { 3 * n };
        let packed = zstd::bulk::compress(&vec![255; 1 << 20], 1).unwrap();
        section.extend_from_slice(&[attribute, 2, 1]);
        section.extend_from_slice(&count.to_le_bytes());
        section.extend_from_slice(&u32::try_from(packed.len()).unwrap().to_le_bytes());
        section.extend_from_slice(&packed);
    }
    let json = format!(
        r#"{{"n":{n},"t":1,"fps":30,"steps":{{"pos":1,"scale_log":1,"rgb":1,"alpha":1,"rot":1,"base_pos":1,"base_scale_log":1}},
"static_section":{{"offset":4096,"len":{}}},"gops":[{{"offset":4096,"len":0,"f0":0,"f1":0}}]}}"#,
        section.len()
    );
    let mut file = b"SP4D\x01\0\0\0".to_vec();
    file.extend_from_slice(&4084_u32.to_le_bytes());
    file.extend_from_slice(json.as_bytes());
    file.resize(4096, b' ');
    file.extend(section);
    let error = splat4d::read(file, Damage::Drop).unwrap_err().to_string();
    assert!(error.contains("cannot contain 100000000 splats"), "{error}");
}

#[test]
fn the_comparison_detects_differences() {
    let scene = changing_scene::scene(64, 5, 0);
    let (dir, report) = write(&scene, 5, &WriteOptions::default());
    let (_, mut frames) = decode(&dir.path().join("clip.splat4d"));
    frames[3][7].pos[1] += 3.0 * report.position_bound;
    assert!(errors(&scene, &frames)[0] > report.position_bound, "a wrong value is detected");
}

#[test]
fn static_values_are_stored_once() {
    let still = changing_scene::scene(2000, 2, 0).at(0.0).unwrap();
    let scene = StaticScene::new(still).unwrap();
    let (_one_dir, one) = write(&scene, 1, &WriteOptions::default());
    let (dir, many) = write(&scene, 90, &WriteOptions::default());
    assert!(many.bytes < one.bytes + 1000, "{} and {} bytes", one.bytes, many.bytes);
    assert_eq!(many.moving, 0, "nothing moves");
    let (_, frames) = decode(&dir.path().join("clip.splat4d"));
    assert_eq!(frames[0], frames[89], "the same in every frame");
    let read = splat4d::open(&dir.path().join("clip.splat4d"), Damage::Fail).unwrap().scene;
    assert!(!read.fades(), "opacities stay");
}

#[test]
fn noise_within_the_bound_does_not_enlarge_the_file() {
    let mut frames = vec![changing_scene::scene(1000, 2, 0).at(0.0).unwrap(); 30];
    for (f, frame) in frames.iter_mut().enumerate() {
        // A slow drift plus jitter far below the bound.
        for (i, mean) in frame.means.iter_mut().enumerate() {
            mean[0] +=
                f as f32 * 0.01 + if (i * 7 + f * 13).is_multiple_of(2) { 1e-4 } else { -1e-4 };
        }
    }
    let scene = TabulatedScene::new(frames).unwrap();
    let (_dir, report) =
        write(&scene, 30, &WriteOptions { tolerance: 1e-3, ..WriteOptions::default() });
    assert!(report.bytes < 1000 * 30 * 2, "{} bytes", report.bytes);
}

#[test]
fn invalid_clips_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("clip.splat4d");
    let scene = changing_scene::scene(20, 3, 0);
    let refuse = |clip: &Clip<'_>, options: &WriteOptions, expected: &str| {
        let error = splat4d::write(&path, clip, options, Existing::Refuse, &mut |_| ())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected) && error.contains("clip.splat4d"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "no output remains: {error}");
    };
    let clip = Clip { scene: &scene, times: &[0.0, 1.0], fps: 30.0 };
    refuse(&Clip { times: &[], ..clip }, &WriteOptions::default(), "no frames");
    for fps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refuse(&Clip { fps, ..clip }, &WriteOptions::default(), "frames per second");
    }
    refuse(&Clip { times: &[0.0, 2.0], ..clip }, &WriteOptions::default(), "outside");
    for tolerance in [0.0, f64::NAN, -1.0, 2.0] {
        refuse(&clip, &WriteOptions { tolerance, ..WriteOptions::default() }, "tolerance");
    }
    refuse(&clip, &WriteOptions { gop: 0, ..WriteOptions::default() }, "groups of 0");
    let empty = StaticScene::new(Splats::default()).unwrap();
    refuse(&Clip { scene: &empty, ..clip }, &WriteOptions::default(), "no splats");
    let mut far = scene.at(0.0).unwrap();
    far.means[3][1] = 1e30;
    let far = StaticScene::new(far).unwrap();
    refuse(&Clip { scene: &far, ..clip }, &WriteOptions::default(), "too large for a grid step");
    let mut broken = scene.at(0.0).unwrap();
    broken.means.fill([f32::NAN; 3]);
    let broken = StaticScene::new(broken).unwrap();
    refuse(&Clip { scene: &broken, ..clip }, &WriteOptions::default(), "every splat");
}

#[test]
fn damaged_rows_are_dropped_and_counted() {
    let mut frames = changing_scene::scene(50, 4, 0).frames().to_vec();
    frames[2].means[7][0] = f32::NAN;
    frames[1].quats[9] = [0.0; 4];
    let scene = TabulatedScene::new(frames).unwrap();
    let (dir, report) = write(&scene, 4, &WriteOptions::default());
    assert_eq!(report.num_splats, 48, "two rows less");
    assert!(report.losses.to_string().contains("2 of 50 splats are omitted"), "{}", report.losses);
    let (header, _) = decode(&dir.path().join("clip.splat4d"));
    assert_eq!(header["n"].as_u64(), Some(48), "in the file too");
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let scene = changing_scene::scene(500, 10, 0);
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (dir, _) = pool.install(|| write(&scene, 10, &WriteOptions::default()));
        fs::read(dir.path().join("clip.splat4d")).unwrap()
    };
    assert_eq!(bytes(1), bytes(4), "one and four threads");
}
