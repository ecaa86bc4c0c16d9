//! Output of `c4d render`, decoded independently from the byte layouts: EXR, NumPy,
//! Middlebury and PNG files have the same values, and the samples of an MP4,
//! extracted from its boxes, decode to the same images.

use crate::support::{c4d, fixture, success};
use std::fs;
use std::path::Path;

const SIZE: (usize, usize) = (64, 48);

/// Renders two times of the fixture's scene.
fn render(output: &Path, more: &[&str]) {
    let scene = fixture("synth/source");
    let mut command = c4d(["render", "--size", "64x48", "--times", "0,0.6"]);
    success(command.arg(scene).arg("-o").arg(output).args(more));
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect()
}

/// The text before the next zero byte, and the bytes after it.
fn text(bytes: &[u8]) -> (&str, &[u8]) {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap();
    (std::str::from_utf8(&bytes[..end]).unwrap(), &bytes[end + 1..])
}

/// Channels of a single-part scan-line EXR with ZIP compression, by name: `[height · width]` each.
fn exr(path: &Path) -> Vec<(String, Vec<f32>)> {
    let bytes = fs::read(path).unwrap();
    assert_eq!(bytes[..8], [0x76, 0x2f, 0x31, 1, 2, 0, 0, 0], "magic, version 2, one flat part");
    let (mut rest, mut names) = (&bytes[8..], Vec::new());
    while rest[0] != 0 {
        let (name, after) = text(rest);
        let (kind, after) = text(after);
        let size = u32_at(after, 0);
        let (value, after) = after[4..].split_at(size);
        match (name, kind) {
            ("channels", "chlist") => {
                let mut list = value;
                while list[0] != 0 {
                    let (name, after) = text(list);
                    assert_eq!(u32_at(after, 0), 2, "32-bit floats");
                    names.push(name.to_owned());
                    list = &after[16..];
                }
            }
            ("compression", _) => assert_eq!(value, [3], "ZIP, sixteen lines at once"),
            ("dataWindow", "box2i") => {
                let window: Vec<usize> = (0..4).map(|k| u32_at(value, 4 * k)).collect();
                assert_eq!(window, [0, 0, SIZE.0 - 1, SIZE.1 - 1], "size");
            }
            _ => {}
        }
        rest = after;
    }
    let table = bytes.len() - rest.len() + 1;
    let mut channels: Vec<(String, Vec<f32>)> =
        names.into_iter().map(|name| (name, Vec::new())).collect();
    for block in 0..SIZE.1.div_ceil(16) {
        let at = u32_at(&bytes, table + 8 * block);
        assert_eq!(u32_at(&bytes, at), 16 * block, "lines in order");
        let packed = &bytes[at + 8..at + 8 + u32_at(&bytes, at + 4)];
        let lines = 16.min(SIZE.1 - 16 * block);
        let whole = lines * SIZE.0 * 4 * channels.len();
        let mut raw = packed.to_vec();
        if packed.len() < whole {
            raw.clear();
            let mut decoder = flate2::read::ZlibDecoder::new(packed);
            std::io::Read::read_to_end(&mut decoder, &mut raw).unwrap();
            for i in 1..raw.len() {
                raw[i] = raw[i].wrapping_add(raw[i - 1]).wrapping_sub(128);
            }
            let (even, odd) = raw.split_at(raw.len().div_ceil(2));
            raw =
                (0..raw.len()).map(|i| if i % 2 == 0 { even[i / 2] } else { odd[i / 2] }).collect();
        }
        assert_eq!(raw.len(), whole, "a whole block");
        let mut rows = raw.chunks_exact(SIZE.0 * 4);
        for _ in 0..lines {
            for (_, values) in &mut channels {
                values.extend(floats(rows.next().unwrap()));
            }
        }
    }
    channels
}

/// A `[height, width, channels]` array of version 1.0: number of channels, and values.
fn npy(path: &Path) -> (usize, Vec<f32>) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(bytes[..8], *b"\x93NUMPY\x01\0", "magic and version");
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    assert!(header.contains("'<f4'") && header.contains("False"), "{header}");
    let values = floats(&bytes[end..]);
    let channels = values.len() / (SIZE.0 * SIZE.1);
    let shape = format!("({}, {}, {channels}", SIZE.1, SIZE.0);
    assert!(header.contains(&shape), "{header}");
    (channels, values)
}

fn channel(values: &[f32], channels: usize, which: usize) -> Vec<f32> {
    values.iter().skip(which).step_by(channels).copied().collect()
}

#[test]
fn stills_of_every_format_have_the_same_values() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let passes = ["--passes", "rgb,depth,flow", "--format"];
    for format in ["exr", "npy"] {
        render(&at(format), &[&passes[..], &[format]].concat());
    }
    render(&at("flo"), &["--passes", "flow", "--format", "flo"]);
    render(&at("png"), &["--passes", "rgb", "--format", "png"]);
    for frame in ["00000", "00001"] {
        for (pass, names) in [("rgb", &["R", "G", "B"][..]), ("depth", &["Z"])] {
            let found = exr(&at(&format!("exr/{pass}/{frame}.exr")));
            let (channels, values) = npy(&at(&format!("npy/{pass}/{frame}.npy")));
            assert_eq!((found.len(), channels), (names.len(), names.len()), "{pass}");
            for (k, name) in names.iter().enumerate() {
                let (_, exr) = found.iter().find(|(found, _)| found == name).unwrap();
                assert!(*exr == channel(&values, channels, k), "{pass} {frame}: {name}");
            }
        }
        let (_, rgb) = npy(&at(&format!("npy/rgb/{frame}.npy")));
        assert!(rgb.iter().any(|&value| value > 0.3), "the scene is visible");
        let png = image::open(at(&format!("png/rgb/{frame}.png"))).unwrap().to_rgb8();
        assert_eq!((png.width(), png.height()), (64, 48), "size");
        for (byte, value) in png.as_raw().iter().zip(&rgb) {
            let off = f32::from(*byte) / 255.0 - value.clamp(0.0, 1.0);
            assert!(off.abs() < 0.5 / 255.0 + 1e-5, "rounded: {byte} of {value}");
        }

        let flo = fs::read(at(&format!("flo/flow/{frame}.flo"))).unwrap();
        assert_eq!(&flo[..4], b"PIEH", "magic");
        assert_eq!((u32_at(&flo, 4), u32_at(&flo, 8)), SIZE, "size");
        let (channels, flow) = npy(&at(&format!("npy/flow/{frame}.npy")));
        let exr = exr(&at(&format!("exr/flow/{frame}.exr")));
        let flo = floats(&flo[12..]);
        for k in 0..2 {
            let expected = channel(&flow, channels, k);
            assert!(channel(&flo, 2, k) == expected, "flow {frame}: {k}");
            assert!(exr.iter().any(|(_, values)| *values == expected), "flow {frame}: {k}");
        }
    }
    let still = |frame: &str| npy(&at(&format!("npy/flow/{frame}.npy"))).1;
    assert!(still("00000").iter().all(|&value| value == 0.0), "no motion at the edit's time");
    assert!(still("00001").iter().any(|&value| value.abs() > 0.5), "motion at a later time");
}

/// The content of the box `path` within `bytes`, big-endian sizes.
fn mp4_box<'a>(bytes: &'a [u8], path: &[&str]) -> &'a [u8] {
    let Some((name, inner)) = path.split_first() else { return bytes };
    let mut rest = bytes;
    loop {
        let size = u32::from_be_bytes(rest[..4].try_into().unwrap()) as usize;
        if &rest[4..8] == name.as_bytes() {
            return mp4_box(&rest[8..size], inner);
        }
        rest = &rest[size..];
    }
}

/// Samples of the only track, each with its parameter sets and NAL units as a byte stream.
fn mp4_samples(bytes: &[u8]) -> Vec<Vec<u8>> {
    let table = mp4_box(bytes, &["moov", "trak", "mdia", "minf", "stbl"]);
    let word = |bytes: &[u8], at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    let word = |bytes: &[u8], at: usize| word(bytes, at) as usize;
    let (sizes, offsets) = (mp4_box(table, &["stsz"]), mp4_box(table, &["stco"]));
    let chunks = mp4_box(table, &["stsc"]);
    // Version and flags, count, one entry of 86 bytes and its boxes.
    let config = mp4_box(&mp4_box(table, &["stsd"])[8 + 86..], &["avcC"]);
    let mut parameters = Vec::new();
    let mut at = 5;
    for mask in [31, 255] {
        let count = config[at] & mask;
        at += 1;
        for _ in 0..count {
            let length = usize::from(u16::from_be_bytes([config[at], config[at + 1]]));
            parameters.extend([0, 0, 0, 1]);
            parameters.extend(&config[at + 2..at + 2 + length]);
            at += 2 + length;
        }
    }
    let mut samples = Vec::new();
    for chunk in 0..word(offsets, 4) {
        let entries = (0..word(chunks, 4)).map(|entry| 8 + 12 * entry);
        let entry = entries.take_while(|&entry| word(chunks, entry) <= chunk + 1).last().unwrap();
        let mut at = word(offsets, 8 + 4 * chunk);
        for _ in 0..word(chunks, entry + 4) {
            let end = at + word(sizes, 12 + 4 * samples.len());
            let mut stream = parameters.clone();
            while at < end {
                let length = word(bytes, at);
                stream.extend([0, 0, 0, 1]);
                stream.extend(&bytes[at + 4..at + 4 + length]);
                at += 4 + length;
            }
            samples.push(stream);
        }
    }
    assert_eq!(samples.len(), word(sizes, 8), "as many as there are sizes");
    samples
}

#[test]
fn videos_decode_to_the_images() {
    use openh264::formats::YUVSource;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    render(&at("clip.mp4"), &["--fps", "12.5"]);
    render(&at("png"), &["--format", "png"]);
    let bytes = fs::read(at("clip.mp4")).unwrap();
    let media = mp4_box(&bytes, &["moov", "trak", "mdia", "mdhd"]);
    let word = |at: usize| f64::from(u32::from_be_bytes(media[at..at + 4].try_into().unwrap()));
    assert!((word(16) / word(12) - 2.0 / 12.5).abs() < 1e-3, "two frames at 12.5 per second");
    let samples = mp4_samples(&bytes);
    assert_eq!(samples.len(), 2, "frames");
    let mut decoder = openh264::decoder::Decoder::new().unwrap();
    let mut decoded = Vec::new();
    for sample in &samples {
        let picture = decoder.decode(sample).unwrap().expect("an image for every sample");
        assert_eq!(picture.dimensions(), SIZE, "size");
        let mut rgb = vec![0; 3 * SIZE.0 * SIZE.1];
        picture.write_rgb8(&mut rgb);
        decoded.push(rgb);
    }
    let still = |frame: usize| {
        image::open(at(&format!("png/rgb/{frame:05}.png"))).unwrap().to_rgb8().into_raw()
    };
    let psnr = |a: &[u8], b: &[u8]| {
        let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
        10.0 * (255.0 * 255.0 * a.len() as f64 / squares).log10()
    };
    for (frame, rgb) in decoded.iter().enumerate() {
        let still = still(frame);
        let turned: Vec<u8> = still.iter().rev().copied().collect();
        let (same, other) = (psnr(rgb, &still), psnr(rgb, &turned));
        assert!(
            same > 35.0 && other < same - 8.0,
            "frame {frame}: {same} dB, upside down {other} dB"
        );
    }
}
