//! Still frames of every format: files of each format's own tool are read within the stated
//! precision, and our files are decoded from their byte layout, independently of the readers.

use gs_core::{Precision, RowPrecision, Splats, quat};
use gs_io::compressed_ply::{self, morton_order};
use gs_io::frame::{self, Frame, FrameError, FrameFormat};
use gs_io::spz::{self, SpzError};
use gs_io::{Axes, FormatLosses, splat_file};
use std::fs;
use std::io::Write;
use test_support::fixture;

const FILES: [&str; 4] = ["frame.compressed.ply", "frame_v3.spz", "frame_v4.spz", "frame.sog"];

fn bytes(name: &str) -> Vec<u8> {
    fs::read(fixture("frames").join(name)).unwrap()
}

fn truth() -> Splats {
    frame::read(&bytes("frame.ply")).unwrap().splats
}

fn nearest(splats: &Splats, mean: [f32; 3]) -> usize {
    let distance = |i: &usize| -> f32 {
        (0..3).map(|axis| (splats.means[*i][axis] - mean[axis]).powi(2)).sum()
    };
    (0..splats.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
}

/// Number of values of `frame` that differ from `truth` by more than `factor` times its stated
/// precision, and number of matched rows of `truth`.
fn violations(truth: &Splats, frame: &Frame, factor: f32) -> (usize, usize) {
    let precision = frame.precision.as_ref().unwrap();
    let mut hit = vec![false; truth.len()];
    let mut count = 0;
    for row in 0..frame.splats.len() {
        let id = nearest(truth, frame.splats.means[row]);
        hit[id] = true;
        count += row_violations(truth, id, &frame.splats, row, precision.of(row), factor);
    }
    (count, hit.iter().filter(|&&hit| hit).count())
}

fn row_violations(
    truth: &Splats,
    id: usize,
    read: &Splats,
    row: usize,
    precision: &RowPrecision,
    factor: f32,
) -> usize {
    let mut count = 0;
    let mut check = |from: f32, to: f32, limit: f32, [min, max]: [f32; 2]| {
        let limit = factor * limit + 1e-4 * factor;
        count += usize::from((from.clamp(min, max) - to).abs() > limit);
    };
    let all = [f32::NEG_INFINITY, f32::INFINITY];
    for axis in 0..3 {
        check(truth.means[id][axis], read.means[row][axis], precision.means[axis], all);
        let (from, to) = (truth.log_scales[id][axis], read.log_scales[row][axis]);
        check(from, to, precision.log_scales[axis], precision.log_scale_range);
        let (from, to) = (truth.sh_of(id)[0][axis], read.sh_of(row)[0][axis]);
        check(from, to, precision.sh_dc[axis], precision.sh_dc_range);
    }
    check(truth.opacity(id), read.opacity(row), precision.opacity, all);
    let degree = |k: usize| {
        if k < 4 {
            0
        } else if k < 9 {
            1
        } else {
            2
        }
    };
    for k in 1..read.sh_coeffs() {
        let limit = precision.sh_rest[degree(k)];
        for channel in 0..3 {
            let (from, to) = (truth.sh_of(id)[k][channel], read.sh_of(row)[k][channel]);
            check(from, to, limit, precision.sh_rest_range);
        }
    }
    let angle = 2.0 * quat::dot(truth.rotation(id), read.rotation(row)).abs().min(1.0).acos();
    check(0.0, angle, precision.rotation_rad + 1e-3, all);
    count
}

#[test]
fn files_of_other_tools_are_read_within_their_precision() {
    let truth = truth();
    for name in FILES {
        let frame = frame::read(&bytes(name)).unwrap();
        assert_eq!((frame.splats.len(), frame.splats.sh_degree), (300, 3), "{name}");
        assert!(frame.splats.check_shapes().is_ok(), "{name}");
        assert_eq!(violations(&truth, &frame, 1.0), (0, 300), "{name}: violations, rows found");
        // Negative control: the stated precision is not excessively wide.
        let (count, _) = violations(&truth, &frame, 0.25);
        assert!(count > 500, "{name}: only {count} values are off by a quarter of what is stated");
    }
    let close = frame::read(&bytes("frame.sog")).unwrap();
    let error = |k: usize| {
        let row = |row| nearest(&truth, close.splats.means[row]);
        let off = |i: usize| (truth.sh_of(row(i))[k][0] - close.splats.sh_of(i)[k][0]).abs();
        (0..300).map(off).sum::<f32>() / 300.0
    };
    assert!(error(1) < 0.05 && error(15) < 0.05, "palette of SOG: {} {}", error(1), error(15));
}

#[test]
fn written_frames_are_read_within_the_precision() {
    let truth = truth();
    let order = morton_order(&truth);
    assert_eq!(order.iter().copied().collect::<std::collections::BTreeSet<_>>().len(), 300, "all");
    let mut compressed = Vec::new();
    let options = compressed_ply::WriteOptions {
        order: Some(order.clone()),
        comments: vec!["two\nlines".to_owned()],
        sh_degree: None,
    };
    let losses = compressed_ply::write(&truth, &options, &mut compressed).unwrap();
    assert!(losses.to_string().contains("positions are rounded by at most"), "{losses}");
    let read = frame::read(&compressed).unwrap();
    assert_eq!(read.comments, ["two lines"], "comments");
    assert_eq!(violations(&truth, &read, 1.0), (0, 300), "compressed PLY");
    assert_eq!(nearest(&truth, read.splats.means[5]), order[5], "in the requested order for");

    for version in [3, 4] {
        let mut bytes = Vec::new();
        let options = spz::WriteOptions { version, ..spz::WriteOptions::default() };
        let losses = spz::write(&truth, &options, &mut bytes).unwrap();
        assert!(losses.to_string().contains("1.2e-4 units"), "{losses}");
        let read = frame::read(&bytes).unwrap();
        assert_eq!(read.format, FrameFormat::Spz(version), "version");
        assert_eq!(violations(&truth, &read, 1.0), (0, 300), "SPZ {version}");
    }

    let mut bytes = Vec::new();
    let losses = splat_file::write(&truth, &mut bytes).unwrap();
    assert!(losses.to_string().contains("SH degree 3 becomes 0"), "{losses}");
    let read = frame::read(&bytes).unwrap();
    assert_eq!(read.format, FrameFormat::Splat, "found by its rows");
    assert_eq!(violations(&truth.with_sh_degree(0), &read, 1.0), (0, 300), ".splat");
    assert_eq!(read.splats.means, truth.means, "centres are exact");
    // From the byte layout: three floats, three floats, RGBA, wxyz.
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0);
    for (i, row) in bytes.as_chunks::<32>().0.iter().enumerate() {
        let float = |k: usize| f32::from_le_bytes(row[4 * k..4 * k + 4].try_into().unwrap());
        let q = gs_core::quat::normalize(truth.quats[i]);
        for k in 0..3 {
            assert_eq!(float(k).to_bits(), truth.means[i][k].to_bits(), "centre");
            let size = truth.log_scales[i][k].exp();
            assert!((float(3 + k) / size - 1.0).abs() < 1e-6, "linear size");
            let color = byte(0.5 + gs_core::sh::C0 * truth.sh_of(i)[0][k]);
            assert!((f32::from(row[24 + k]) - color).abs() <= 1.0, "colour");
        }
        assert!((f32::from(row[27]) - byte(truth.opacity(i))).abs() <= 1.0, "opacity");
        let stored = [0, 1, 2, 3].map(|k| (f32::from(row[28 + k]) - 128.0) / 128.0);
        let off = gs_core::quat::align(q, stored);
        assert!((0..4).all(|k| (off[k] - stored[k]).abs() < 0.01), "rotation {off:?} {stored:?}");
    }
}

/// SPZ from its byte layout alone: `(means, log_scales, opacities, dc, sh[1])` in the frame of the
/// file.
type Decoded = (Vec<[f64; 3]>, Vec<[f64; 3]>, Vec<f64>, Vec<[f64; 3]>, Vec<[f64; 3]>);

fn decode_spz(n: usize, streams: &[&[u8]]) -> Decoded {
    let fixed = |b: &[u8]| f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]]) / 256) / 4096.0;
    let three =
        |stream: &[u8], i: usize, of: &dyn Fn(u8) -> f64| [0, 1, 2].map(|k| of(stream[3 * i + k]));
    (
        (0..n).map(|i| [0, 3, 6].map(|at| fixed(&streams[0][9 * i + at..]))).collect(),
        (0..n).map(|i| three(streams[3], i, &|b| f64::from(b) / 16.0 - 10.0)).collect(),
        (0..n).map(|i| f64::from(streams[1][i]) / 255.0).collect(),
        (0..n).map(|i| three(streams[2], i, &|b| (f64::from(b) / 255.0 - 0.5) / 0.15)).collect(),
        (0..n)
            .map(|i| three(&streams[5][45 * i..], 0, &|b| (f64::from(b) - 128.0) / 128.0))
            .collect(),
    )
}

fn compare_spz(truth: &Splats, (means, log_scales, opacities, dc, first): &Decoded) {
    let close = |a: f64, b: f32, limit: f64, what: &str| {
        assert!((a - f64::from(b)).abs() <= limit, "{what}: {a} is not {b}");
    };
    for i in 0..truth.len() {
        for axis in 0..3 {
            // y and z of the file point in the opposite directions.
            let sign = if axis == 0 { 1.0 } else { -1.0 };
            close(sign * means[i][axis], truth.means[i][axis], 2.0 / 4096.0, "mean");
            close(log_scales[i][axis], truth.log_scales[i][axis], 0.0313, "log-scale");
            close(dc[i][axis], truth.sh_of(i)[0][axis].clamp(-3.33, 3.33), 0.015, "colour");
            close(-first[i][axis], truth.sh_of(i)[1][axis], 0.0353, "first harmonic, y");
        }
        close(opacities[i], truth.opacity(i), 0.002, "opacity");
    }
}

#[test]
fn spz_decodes_from_its_byte_layout() {
    let truth = truth();
    let mut v3 = Vec::new();
    spz::write(&truth, &spz::WriteOptions::default(), &mut v3).unwrap();
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&v3[..]), &mut plain).unwrap();
    assert_eq!(plain[..16], *b"NGSP\x03\0\0\0\x2c\x01\0\0\x03\x0c\x02\0", "header of version 3");
    assert_eq!(plain.len(), 16 + 300 * (9 + 1 + 3 + 3 + 4 + 45) + 12, "size");
    let mut rest = &plain[16..];
    let parts = [9, 1, 3, 3, 4, 45].map(|width| {
        let (part, after) = rest.split_at(300 * width);
        rest = after;
        part
    });
    compare_spz(&truth, &decode_spz(300, &parts));
    let record = b"\x03\0\xbe\xad\x04\0\0\0\x04\0\0\0";
    assert_eq!(rest, record, "axes: right, up, back");

    let mut v4 = Vec::new();
    let options = spz::WriteOptions { version: 4, ..spz::WriteOptions::default() };
    spz::write(&truth, &options, &mut v4).unwrap();
    let header = b"NGSP\x04\0\0\0\x2c\x01\0\0\x03\x0c\x02\x06\x2c\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0";
    assert_eq!(v4[..32], *header, "header of version 4");
    let word = |at: usize| u64::from_le_bytes(v4[at..at + 8].try_into().unwrap()) as usize;
    assert_eq!(v4[32..44], *record, "axes");
    let mut start = 44 + 6 * 16;
    let streams: Vec<Vec<u8>> = (0..6)
        .map(|i| {
            let (packed, size) = (word(44 + 16 * i), word(52 + 16 * i));
            let stream = zstd::stream::decode_all(&v4[start..start + packed]).unwrap();
            assert_eq!(stream.len(), size, "stream {i}");
            start += packed;
            stream
        })
        .collect();
    assert_eq!(start, v4.len(), "no bytes after the streams");
    let views: Vec<&[u8]> = streams.iter().map(Vec::as_slice).collect();
    compare_spz(&truth, &decode_spz(300, &views));
    assert_eq!(views[..], parts[..], "the same values in both versions");
}

#[test]
fn compressed_ply_decodes_from_its_byte_layout() {
    let truth = truth();
    let mut bytes = Vec::new();
    let options = compressed_ply::WriteOptions::default();
    compressed_ply::write(&truth, &options, &mut bytes).unwrap();
    let data = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(bytes[..data].to_vec()).unwrap();
    assert!(
        header.contains("element chunk 2\n") && header.contains("element vertex 300\n"),
        "{header}"
    );
    assert!(header.contains("element sh 300\nproperty uchar f_rest_0\n"), "{header}");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let words = data + 2 * 72;
    let harmonics = words + 300 * 16;
    assert_eq!(bytes.len(), harmonics + 300 * 45, "size");
    for i in 0..300 {
        let chunk = |column: usize| f32::from_bits(word(data + 72 * (i / 256) + 4 * column));
        let packed = [0, 4, 8, 12].map(|at| word(words + 16 * i + at));
        let axes = |p: u32| {
            [
                (p >> 21) as f32 / 2047.0,
                ((p >> 11) & 1023) as f32 / 1023.0,
                (p & 2047) as f32 / 2047.0,
            ]
        };
        let lerp = |first: usize, unit: [f32; 3]| -> [f32; 3] {
            std::array::from_fn(|k| {
                chunk(first + k) + unit[k] * (chunk(first + 3 + k) - chunk(first + k))
            })
        };
        let (mean, scale) = (lerp(0, axes(packed[0])), lerp(6, axes(packed[2])));
        let rgb = lerp(12, [24, 16, 8].map(|shift| ((packed[3] >> shift) & 255) as f32 / 255.0));
        for k in 0..3 {
            let step = |first: usize| (chunk(first + 3 + k) - chunk(first + k)) / 1023.0;
            assert!((mean[k] - truth.means[i][k]).abs() <= 0.51 * step(0), "mean of {i}");
            assert!((scale[k] - truth.log_scales[i][k]).abs() <= 0.51 * step(6), "scale of {i}");
            let shown = 0.5 + 0.282_094_8 * truth.sh_of(i)[0][k];
            assert!((rgb[k] - shown).abs() <= 0.51 * 1023.0 / 255.0 * step(12), "colour of {i}");
            let stored = f32::from(bytes[harmonics + 45 * i + 15 * k + 3]);
            let value = ((stored + 0.5) / 256.0 - 0.5) * 8.0;
            assert!((value - truth.sh_of(i)[4][k]).abs() <= 1.0 / 64.0 + 1e-5, "harmonic of {i}");
        }
        assert!(
            ((packed[3] & 255) as f32 / 255.0 - truth.opacity(i)).abs() <= 0.002,
            "opacity {i}"
        );
        let (largest, q) = ((packed[1] >> 30) as usize, truth.rotation(i));
        let sign = q[largest].signum();
        let others = (0..4).filter(|&slot| slot != largest).zip([20, 10, 0]);
        for (slot, shift) in others {
            let unit = ((packed[1] >> shift) & 1023) as f32 / 1023.0;
            let component = (unit - 0.5) * std::f32::consts::SQRT_2;
            assert!((component - sign * q[slot]).abs() < 8e-4, "rotation of {i}");
        }
    }
}

#[test]
fn spz_version_2_and_large_scenes() {
    let truth = truth();
    // Version 2 differs in its rotations: x, y, z in bytes, w not negative.
    let mut v3 = Vec::new();
    spz::write(
        &truth,
        &spz::WriteOptions { sh_degree: Some(0), ..spz::WriteOptions::default() },
        &mut v3,
    )
    .unwrap();
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&v3[..]), &mut plain).unwrap();
    plain[4] = 2;
    plain.truncate(16 + 300 * 16);
    for i in 0..300 {
        let [w, x, y, z] = truth.rotation(i);
        let sign = w.signum();
        plain.extend([x, -y, -z].map(|q| (sign * q * 127.5 + 127.5).round() as u8));
    }
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&plain).unwrap();
    let read = frame::read(&gzip.finish().unwrap()).unwrap();
    assert_eq!(read.format, FrameFormat::Spz(2), "version");
    assert_eq!(violations(&truth.with_sh_degree(0), &read, 1.0), (0, 300), "SPZ 2");

    let mut large = truth.clone();
    large.means[0] = [9000.0, 0.0, -3.0];
    let mut bytes = Vec::new();
    let losses = spz::write(&large, &spz::WriteOptions::default(), &mut bytes).unwrap();
    assert!(losses.to_string().contains("beyond ±2048 units"), "{losses}");
    let read = frame::read(&bytes).unwrap();
    assert_eq!(read.splats.means[0], large.means[0], "fits with fewer bits");
    assert_eq!(violations(&large, &read, 1.0).0, 0, "within the wider precision");

    // One floater in a thousand does not reduce the precision of the others.
    let mut rows: Vec<usize> = (0..300).cycle().take(1000).collect();
    rows[0] = 299;
    let mut floating = truth.select(&rows);
    floating.means[0] = [1e9, 0.0, -3.0];
    let mut bytes = Vec::new();
    let losses = spz::write(&floating, &spz::WriteOptions::default(), &mut bytes).unwrap();
    assert!(losses.to_string().contains("1 splats beyond ±32768 units"), "{losses}");
    let read = frame::read(&bytes).unwrap().splats;
    assert!((read.means[0][0] - 32_768.0).abs() < 1.0, "moved nearer: {:?}", read.means[0]);
    let off = (0..3).map(|k| (read.means[7][k] - floating.means[7][k]).abs()).fold(0.0, f32::max);
    assert!(off <= 0.5 / 256.0, "the others are within 1/512: {off}");
    floating.means[1] = [-1e9, 0.0, 0.0];
    let losses = spz::write(&floating, &spz::WriteOptions::default(), &mut Vec::new()).unwrap();
    assert!(
        losses.to_string().contains("have 0 fractional bits"),
        "two are too many for the exception: \
        {losses}"
    );
}

/// The SPZ of `options` without its extension records, as
/// written by tools that do not support them.
fn without_records(splats: &Splats, options: &spz::WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    spz::write(splats, options, &mut bytes).unwrap();
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&bytes[..]), &mut plain).unwrap();
    plain[14] = 0;
    plain.truncate(plain.len() - 12);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&plain).unwrap();
    gzip.finish().unwrap()
}

#[test]
fn spz_axes_are_those_stated_in_the_file() {
    let truth = truth();
    for code in 1..=16 {
        let axes = Axes::from_code(code).unwrap();
        for version in [3, 4] {
            let options = spz::WriteOptions { version, axes, ..spz::WriteOptions::default() };
            let mut bytes = Vec::new();
            spz::write(&truth, &options, &mut bytes).unwrap();
            let read = frame::read(&bytes).unwrap();
            let reading = read.axes.unwrap();
            assert_eq!((reading.axes, reading.stated), (axes, true), "{axes}");
            assert!(reading.assumption().is_none(), "{axes}: nothing is assumed");
            // Axes that swap y and z mix harmonics before rounding,
            // so half a step becomes up to three.
            let factor = if code <= 8 { 1.0 } else { 3.0 };
            assert_eq!(violations(&truth, &read, factor), (0, 300), "{axes}, version {version}");
        }
    }
    // Without a record, the axes of the specification are assumed, which is
    // wrong for tools that keep the axes of a PLY.
    let options = spz::WriteOptions { axes: Axes::PLY, ..spz::WriteOptions::default() };
    let read = frame::read(&without_records(&truth, &options)).unwrap();
    let reading = read.axes.unwrap();
    assert_eq!((reading.axes, reading.stated), (Axes::RUB, false), "assumed");
    assert!(
        reading.assumption().unwrap().contains("RUB (x right, y up, z back)"),
        "the assumption is stated"
    );
    assert!((read.splats.means[0][1] + truth.means[0][1]).abs() < 1e-3, "rotated by 180°");
    let converted = read.in_axes(Axes::PLY);
    assert_eq!(violations(&truth, &converted, 1.0), (0, 300), "the requested axes");
    // A record of a different type is skipped; a truncated one ends the list.
    let mut bytes = Vec::new();
    spz::write(&truth, &options, &mut bytes).unwrap();
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&bytes[..]), &mut plain).unwrap();
    let data = plain.len() - 12;
    let record = plain.split_off(data);
    let packed = |records: &[u8]| {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(&[&plain, records].concat()).unwrap();
        frame::read(&gzip.finish().unwrap()).unwrap().axes.unwrap()
    };
    let other = [&b"\x02\0\xbe\xad\x0c\0\0\0"[..], &[7; 12]].concat();
    assert_eq!(packed(&[&other[..], &record].concat()).axes, Axes::PLY, "after a different record");
    for broken in [&record[..11], &record[..5], &[255; 16], &other[..9]] {
        assert!(!packed(broken).stated, "{broken:?}");
    }
}

#[test]
fn spz_harmonics_have_the_requested_bits() {
    let truth = truth();
    let mut last = f32::INFINITY;
    for bits in [2, 3, 5, 8] {
        let options = spz::WriteOptions { sh_bits: [bits; 2], ..spz::WriteOptions::default() };
        let mut bytes = Vec::new();
        let losses = spz::write(&truth, &options, &mut bytes).unwrap().to_string();
        let stated = losses.split("colours are off by ").nth(1).unwrap();
        let stated: f32 = stated.split(' ').next().unwrap().parse().unwrap();
        let read = frame::read(&bytes).unwrap();
        assert_eq!(violations(&truth, &read, 1.0), (0, 300), "{bits} bits");
        // Measured colour error of all splats in many directions, compared with the reported one.
        let (mut square, mut count) = (0.0_f64, 0.0);
        for i in 0..300 {
            for j in 0..64 {
                let z = (j as f32 + 0.5) / 32.0 - 1.0;
                let (angle, radius) = (2.399_963 * j as f32, (1.0 - z * z).sqrt());
                let basis = gs_core::sh::basis(3, [radius * angle.cos(), radius * angle.sin(), z]);
                for channel in 0..3 {
                    let off: f32 = (1..16)
                        .map(|k| {
                            let (a, b) = (truth.sh_of(i)[k], read.splats.sh_of(i)[k]);
                            basis[k] * (a[channel] - b[channel])
                        })
                        .sum();
                    square += f64::from(off * off);
                    count += 1.0;
                }
            }
        }
        let measured = 255.0 * (square / count).sqrt() as f32;
        assert!(
            (measured / stated - 1.0).abs() < 0.1,
            "{bits} bits: {measured}, reported \
            {stated}"
        );
        assert!(measured < last, "more bits, less error: {bits}");
        last = measured;
    }
    let options = spz::WriteOptions { sh_bits: [9, 4], ..spz::WriteOptions::default() };
    assert!(spz::write(&truth, &options, &mut Vec::new()).is_err(), "invalid number of bits");
}

#[test]
fn spz_notes_antialiasing_and_keeps_small_scenes() {
    let mut truth = truth();
    let mut bytes = without_records(&truth, &spz::WriteOptions::default());
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&bytes[..]), &mut plain).unwrap();
    plain[14] = 1;
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&plain).unwrap();
    let notes = frame::read(&gzip.finish().unwrap()).unwrap().notes.join("\n");
    assert!(notes.contains("trained with antialiasing"), "{notes}");

    let (min, max) = truth.bounds().unwrap();
    let width = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f32::max);
    for mean in &mut truth.means {
        *mean = mean.map(|value| 0.01 * value / width);
    }
    bytes.clear();
    let losses = spz::write(&truth, &spz::WriteOptions::default(), &mut bytes).unwrap();
    assert!(losses.to_string().contains("the scene is small"), "{losses}");
    let read = frame::read(&bytes).unwrap();
    let off = (0..300).flat_map(|i| (0..3).map(move |k| (i, k)));
    let off = off.map(|(i, k)| (read.splats.means[i][k] - truth.means[i][k]).abs());
    assert!(off.fold(0.0, f32::max) < 0.01 / 16_384.0, "a step is less than that");
}

#[test]
fn compressed_ply_omits_bands_below_half_a_step() {
    let mut truth = truth();
    for i in 0..truth.len() {
        for k in 4..16 {
            truth.sh[16 * i + k] = [0.015, -0.01, 0.0];
        }
    }
    assert_eq!(compressed_ply::kept_degree(&truth), 1, "above degree 1, less than half a step");
    let mut bytes = Vec::new();
    let options = compressed_ply::WriteOptions::default();
    let losses = compressed_ply::write(&truth, &options, &mut bytes).unwrap().to_string();
    assert!(losses.contains("SH degree 3 becomes 1: no coefficient above"), "{losses}");
    assert!(losses.contains("steps of 1/255"), "{losses}");
    let read = frame::read(&bytes).unwrap();
    assert_eq!((read.splats.sh_degree, violations(&truth, &read, 1.0)), (1, (0, 300)), "the rest");
    bytes.clear();
    let requested = compressed_ply::WriteOptions { sh_degree: Some(3), ..options };
    compressed_ply::write(&truth, &requested, &mut bytes).unwrap();
    assert_eq!(frame::read(&bytes).unwrap().splats.sh_degree, 3, "unless requested");
    truth.sh[16 * 7 + 15] = [0.0, 0.016, 0.0];
    assert_eq!(compressed_ply::kept_degree(&truth), 3, "one splat reaches half a step");
}

#[test]
fn formats_are_detected_by_content_and_damage_is_named() {
    let path = |name: &str| fixture("frames").join(name);
    let dir = tempfile::tempdir().unwrap();
    let misnamed = dir.path().join("scene.compressed.ply");
    fs::copy(path("frame.ply"), &misnamed).unwrap();
    let read = frame::read_file(&misnamed).unwrap();
    assert!(matches!(read.format, FrameFormat::Ply { normals: true, .. }), "plain under that name");
    assert_eq!(gs_io::detect(&misnamed).unwrap(), gs_io::SceneKind::Ply, "detected by content");
    for (name, kind) in FILES.iter().zip([
        gs_io::SceneKind::CompressedPly,
        gs_io::SceneKind::Spz,
        gs_io::SceneKind::Spz,
        gs_io::SceneKind::Sog,
    ]) {
        let other = dir.path().join("unnamed");
        fs::copy(path(name), &other).unwrap();
        assert_eq!(gs_io::detect(&other).unwrap(), kind, "{name}");
    }
    // Runs of GaussianEditor and DGE write the result here.
    fs::create_dir_all(dir.path().join("trial/save")).unwrap();
    fs::copy(path("frame.ply"), dir.path().join("trial/save/last.ply")).unwrap();
    let trial = dir.path().join("trial");
    assert_eq!(gs_io::detect(&trial).unwrap(), gs_io::SceneKind::EditorFolder, "editor's folder");
    assert_eq!(frame::read_file(&trial).unwrap().splats, truth(), "its frame");
    let error = frame::read_file(dir.path()).unwrap_err().to_string();
    assert!(error.contains("save/last.ply"), "{error}");

    for name in FILES {
        let whole = bytes(name);
        for keep in [0, 3, 15, 40, whole.len() / 2, whole.len() - 1] {
            assert!(frame::read(&whole[..keep]).is_err(), "{name} cut to {keep}");
        }
    }
    let mut future = bytes("frame_v4.spz");
    future[4] = 9;
    let error = frame::read(&future).unwrap_err().to_string();
    assert!(error.contains("SPZ version 9, expected 2, 3 or 4"), "{error}");
    let mut lying = bytes("frame_v4.spz");
    lying[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = frame::read(&lying).unwrap_err();
    assert!(matches!(error, FrameError::Spz(SpzError::Damaged(_))), "{error}");
    let clip = [b"Kg\0\0\x10\0\0\0".to_vec(), vec![b'x'; 100]].concat();
    assert!(frame::read(&clip).unwrap_err().to_string().contains("a .splatv clip"), "named");
    for text in ["hello", &"prose of thirty-two characters..".repeat(40)] {
        let error = frame::read(text.as_bytes()).unwrap_err();
        assert!(matches!(error, FrameError::Unknown { .. }), "{text}: {error}");
    }
}

#[test]
fn unusual_rows_are_counted() {
    let mut bytes = Vec::new();
    splat_file::write(&truth(), &mut bytes).unwrap();
    bytes[27] = 255;
    bytes[32 + 12..32 + 16].copy_from_slice(&0.0_f32.to_le_bytes());
    bytes[64 + 28..64 + 32].copy_from_slice(&[128; 4]);
    bytes[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let frame = frame::read(&bytes).unwrap();
    assert!(frame.notes.iter().any(|note| note.contains("opacities")), "{:?}", frame.notes);
    assert!(frame.notes.iter().any(|note| note.starts_with("1 rows with a standard")), "flat");
    let (clean, report) = frame.sanitize(gs_io::repair::Damage::Drop).unwrap();
    assert_eq!((report.not_finite, report.zero_quaternion), (1, 1), "counted by kind");
    assert_eq!(clean.splats.len(), 298, "dropped");
    let mut frame = frame::read(&bytes).unwrap();
    let entries =
        (0..300_u16).map(|i| RowPrecision { opacity: f32::from(i), ..RowPrecision::EXACT });
    frame.precision = Some(std::sync::Arc::new(Precision::by_chunk(entries.collect(), 1)));
    let (clean, _) = frame.sanitize(gs_io::repair::Damage::Drop).unwrap();
    assert_eq!(clean.precision.unwrap().of(2).opacity, 4.0, "precision follows its row");
    assert!(FormatLosses::none().is_empty(), "no losses on reading");
}
