//! glTF with Gaussian splats: our files decoded independently from their layout; scenes with nodes,
//! quantised and sparse values, and embedded SPZ; hostile files.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gs_core::{Splats, quat, sh};
use gs_io::frame::{self, Frame, FrameError, FrameFormat};
use gs_io::gltf::{self, GltfError};
use gs_io::{Axes, spz};
use serde_json::{Value, json};
use std::fs;
use test_support::fixture;

fn truth() -> Splats {
    frame::read_file(&fixture("frames/frame.ply")).unwrap().splats
}

fn written(splats: &Splats, text: bool) -> Vec<u8> {
    let options =
        gltf::WriteOptions { text, comments: vec!["c4d_time 0.5".to_owned()], sh_degree: None };
    let mut bytes = Vec::new();
    gltf::write(splats, &options, &mut bytes).unwrap();
    bytes
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// JSON and data of a `.glb`.
fn taken_apart(bytes: &[u8]) -> (Value, Vec<u8>) {
    assert_eq!(
        (&bytes[..4], word(bytes, 4), word(bytes, 8)),
        (&b"glTF"[..], 2, bytes.len()),
        "head"
    );
    let length = word(bytes, 12);
    assert_eq!((word(bytes, 16), length % 4), (0x4E4F_534A, 0), "JSON chunk");
    let data = 20 + length;
    assert_eq!(
        (word(bytes, data + 4), word(bytes, data)),
        (0x004E_4942, bytes.len() - data - 8),
        "data"
    );
    (serde_json::from_slice(&bytes[20..data]).unwrap(), bytes[data + 8..].to_vec())
}

fn put_together(json: &Value, data: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(u32::try_from(28 + text.len() + data.len()).unwrap().to_le_bytes());
    for (kind, chunk) in [(0x4E4F_534A_u32, &text[..]), (0x004E_4942, data)] {
        bytes.extend(u32::try_from(chunk.len()).unwrap().to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(chunk);
    }
    bytes
}

/// Asserts that `frame` has the splats `truth`, up to the rounding of activations.
fn assert_same(frame: &Frame, truth: &Splats, what: &str) {
    let splats = &frame.splats;
    assert_eq!((splats.len(), splats.sh_degree), (truth.len(), truth.sh_degree), "{what}");
    for i in 0..truth.len() {
        let near = |a: f32, b: f32| (a - b).abs() < 2e-5 * (1.0 + b.abs());
        for axis in 0..3 {
            assert!(near(splats.means[i][axis], truth.means[i][axis]), "{what}: centre of {i}");
            assert!(
                near(splats.log_scales[i][axis], truth.log_scales[i][axis]),
                "{what}: size of {i}"
            );
        }
        assert!((splats.opacity(i) - truth.opacity(i)).abs() < 1e-6, "{what}: opacity of {i}");
        let off = 1.0 - quat::dot(splats.rotation(i), truth.rotation(i)).abs();
        assert!(off < 1e-6, "{what}: rotation of {i} is off by {off}");
        for (a, b) in splats.sh_of(i).iter().flatten().zip(truth.sh_of(i).iter().flatten()) {
            assert!(near(*a, *b), "{what}: SH of {i}");
        }
    }
}

#[test]
fn frames_round_trip() {
    let truth = truth();
    for text in [false, true] {
        let frame = frame::read(&written(&truth, text)).unwrap();
        assert_eq!(frame.format, FrameFormat::Gltf, "by content");
        assert_eq!(frame.comments, ["c4d_time 0.5"], "comments");
        assert_eq!(frame.axes.map(|reading| reading.axes), Some(Axes::LUF), "axes of glTF");
        let precision = *frame.precision.as_ref().unwrap().of(0);
        assert_eq!((precision.means, precision.sh_rest), ([0.0; 3], [0.0; 3]), "floats");
        assert!(frame.notes.is_empty(), "{:?}", frame.notes);
        assert_eq!(frame.splats.means, truth.means, "centres are exact");
        assert_eq!(frame.splats.sh, truth.sh, "SH is exact");
        assert_same(&frame, &truth, "round trip");
    }
    let options = gltf::WriteOptions { sh_degree: Some(1), ..gltf::WriteOptions::default() };
    let mut bytes = Vec::new();
    let losses = gltf::write(&truth, &options, &mut bytes).unwrap();
    assert!(losses.to_string().contains("SH degree 3 becomes 1"), "{losses}");
    assert_same(&frame::read(&bytes).unwrap(), &truth.with_sh_degree(1), "degree 1");
    let mut broken = truth.clone();
    broken.means[3][1] = f32::NAN;
    bytes.clear();
    let losses = gltf::write(&broken, &gltf::WriteOptions::default(), &mut bytes).unwrap();
    assert!(losses.to_string().contains("1 damaged splats are omitted"), "{losses}");
    assert_eq!(frame::read(&bytes).unwrap().splats.len(), 299, "JSON has no NaN");
}

#[test]
fn a_file_decodes_from_its_layout() {
    let truth = truth();
    let (json, data) = taken_apart(&written(&truth, false));
    assert_eq!(json["extensionsUsed"], json!(["KHR_gaussian_splatting"]), "declared");
    let primitive = &json["meshes"][0]["primitives"][0];
    assert_eq!(primitive["mode"], 0, "points");
    let extension = &primitive["extensions"]["KHR_gaussian_splatting"];
    assert_eq!(
        (&extension["kernel"], &extension["colorSpace"]),
        (&json!("ellipse"), &json!("srgb_rec709_display")),
        "required properties"
    );
    let floats = |name: &str, shape: &str, width: usize| -> Vec<Vec<f32>> {
        let accessor = &json["accessors"][primitive["attributes"][name].as_u64().unwrap() as usize];
        assert_eq!(
            (&accessor["type"], &accessor["componentType"]),
            (&json!(shape), &json!(5126)),
            "{name}"
        );
        assert_eq!(accessor["count"], 300, "{name}");
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        let bytes = &data[start..start + view["byteLength"].as_u64().unwrap() as usize];
        let values: Vec<f32> =
            bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect();
        values.chunks(width).map(<[f32]>::to_vec).collect()
    };
    let means = floats("POSITION", "VEC3", 3);
    let rotations = floats("KHR_gaussian_splatting:ROTATION", "VEC4", 4);
    let scales = floats("KHR_gaussian_splatting:SCALE", "VEC3", 3);
    let opacities = floats("KHR_gaussian_splatting:OPACITY", "SCALAR", 1);
    let harmonics = |degree: usize, coefficient: usize| {
        let name = format!("KHR_gaussian_splatting:SH_DEGREE_{degree}_COEF_{coefficient}");
        floats(&name, "VEC3", 3)
    };
    let (dc, y, xyz) = (harmonics(0, 0), harmonics(1, 0), harmonics(3, 1));
    for i in 0..300 {
        // Left, up, front: x and y point in the opposite directions.
        let [px, py, pz] = truth.means[i];
        assert_eq!(means[i], [-px, -py, pz], "centre {i}");
        let [w, x, y_, z] = truth.rotation(i);
        let unit: f32 = rotations[i].iter().map(|q| q * q).sum();
        assert!((unit - 1.0).abs() < 1e-5, "unit quaternion {i}");
        let expected = [-x, -y_, z, w];
        let off = (0..4).map(|k| (expected[k] - rotations[i][k]).abs()).fold(0.0, f32::max);
        assert!(off < 1e-6, "xyzw of {i}: {:?}", rotations[i]);
        for axis in 0..3 {
            assert_eq!(scales[i][axis], truth.log_scales[i][axis].exp(), "linear size of {i}");
            assert_eq!(dc[i][axis], truth.sh_of(i)[0][axis], "base colour of {i}");
            assert_eq!(y[i][axis], -truth.sh_of(i)[1][axis], "the harmonic y of {i}");
            assert_eq!(xyz[i][axis], truth.sh_of(i)[10][axis], "the harmonic xyz of {i}");
        }
        assert_eq!(opacities[i][0], truth.opacity(i), "opacity of {i}");
    }
    let bounds = |key: &str| json["accessors"][0][key].as_array().unwrap().len();
    assert_eq!((bounds("min"), bounds("max")), (3, 3), "positions have bounds");
}

/// A glTF scene of `truth` in the axes LUF, with the given nodes.
fn with_nodes(truth: &Splats, nodes: &Value) -> Vec<u8> {
    let (mut json, data) = taken_apart(&written(truth, false));
    json["nodes"] = nodes.clone();
    put_together(&json, &data)
}

/// One round splat with view-dependent colour, in the axes of splats in memory.
fn one() -> Splats {
    Splats {
        means: vec![[1.0, 2.0, 3.0]],
        quats: vec![quat::normalize([0.9, 0.1, -0.3, 0.2])],
        log_scales: vec![[-1.0, -2.0, -3.0]],
        opacity_logits: vec![1.0],
        sh: (0..16).map(|k| [0.3 - 0.04 * k as f32, 0.1 * k as f32, 0.05]).collect(),
        sh_degree: 3,
    }
}

/// Covariance `xx xy xz yy yz zz`.
fn sigma(splats: &Splats) -> [f64; 6] {
    gs_core::covariance(splats.rotation(0).map(f64::from), splats.scale(0).map(f64::from))
}

fn color(splats: &Splats, direction: [f32; 3]) -> f32 {
    let basis = sh::basis(splats.sh_degree, direction);
    (0..splats.sh_coeffs()).map(|k| basis[k] * splats.sh_of(0)[k][0]).sum()
}

#[test]
fn nodes_translate_rotate_and_scale() {
    let splats = one();
    // A parent that rotates by 90° about y and translates upwards, a
    // child that scales by two: glTF axes, x → −z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let nodes = json!([
        { "children": [1], "rotation": [0.0, half, 0.0, half], "translation": [0.0, 10.0, 0.0] },
        { "mesh": 0, "scale": [2.0, 2.0, 2.0] },
    ]);
    let read = frame::read(&with_nodes(&splats, &nodes)).unwrap().splats;
    // In the file (−1, −2, 3), scaled (−2, −4, 6), rotated (6, −4, 2),
    // translated (6, 6, 2), and converted back.
    let expected = [-6.0, -6.0, 2.0];
    for axis in 0..3 {
        assert!((read.means[0][axis] - expected[axis]).abs() < 1e-5, "{:?}", read.means[0]);
        let larger = splats.log_scales[0][axis] + 2.0_f32.ln();
        assert!((read.log_scales[0][axis] - larger).abs() < 1e-6, "twice as large");
    }
    // The same rotation in the axes of splats in memory: (x, y, z) of the
    // file is (−x, −y, z) here, so x → z about −y.
    let rotated = |[x, y, z]: [f32; 3]| [-z, y, x];
    let (before, after) = (sigma(&splats), sigma(&read));
    // xx of the rotated covariance is zz of the original.
    assert!((after[0] - 4.0 * before[5]).abs() < 1e-5, "{before:?} {after:?}");
    assert!((after[5] - 4.0 * before[0]).abs() < 1e-5, "{before:?} {after:?}");
    for direction in [[0.48, -0.6, 0.64], [1.0, 0.0, 0.0], [0.0, 0.6, -0.8]] {
        let (a, b) = (color(&splats, direction), color(&read, rotated(direction)));
        assert!((a - b).abs() < 1e-5, "colour rotates with the splat: {a} {b}");
    }

    // Scaling along one axis changes the principal axes of an oblique ellipsoid.
    let nodes = json!([{ "mesh": 0, "scale": [1.0, 3.0, 1.0] }]);
    let stretched = frame::read(&with_nodes(&splats, &nodes)).unwrap().splats;
    let (a, b) = (sigma(&splats), sigma(&stretched));
    let factors = [1.0, 3.0, 1.0, 9.0, 3.0, 1.0];
    assert!((0..6).all(|k| (b[k] - factors[k] * a[k]).abs() < 1e-6), "{a:?} {b:?}");

    // The same mesh twice, once with a matrix.
    let matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1];
    let (mut document, data) = taken_apart(&written(&splats, false));
    document["nodes"] = json!([{ "mesh": 0 }, { "mesh": 0, "matrix": matrix }]);
    document["scenes"] = json!([{ "nodes": [0, 1] }]);
    let twice = frame::read(&put_together(&document, &data)).unwrap().splats;
    assert_eq!(twice.means, [[1.0, 2.0, 3.0], [-4.0, 2.0, 3.0]], "moved by 5 to the left");
    // Other scenes are ignored, as are nodes without splats.
    document["scenes"] = json!([{ "nodes": [1] }, { "nodes": [0] }]);
    document["scene"] = json!(1);
    assert_eq!(
        frame::read(&put_together(&document, &data)).unwrap().splats.means,
        splats.means,
        "scene 1"
    );
    document["scenes"] = json!([{ "nodes": [] }]);
    document["scene"] = json!(0);
    let error = frame::read(&put_together(&document, &data)).unwrap_err().to_string();
    assert!(error.contains("splats are not in its scene"), "{error}");
}

#[test]
fn unsupported_node_transformations_are_named() {
    let splats = one();
    for (node, why) in [
        (json!({ "mesh": 0, "scale": [-1.0, 1.0, 1.0], "name": "wing" }), "`wing` is mirrored"),
        (json!({ "mesh": 0, "scale": [0.0, 1.0, 1.0] }), "scaled to zero"),
        (
            json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }),
            "sheared",
        ),
        (
            json!({ "mesh": 0, "translation": [1e300, 1e300, 0], "scale": [1e200, 1e200, 1e200] }),
            "not finite",
        ),
        (json!({ "children": [0], "mesh": 0 }), "below itself"),
        (json!({ "children": [9], "mesh": 0 }), "node 9 is missing"),
    ] {
        let node = if why == "not finite" {
            json!([{ "children": [1], "scale": [1e200, 1.0, 1.0] }, node])
        } else {
            json!([node])
        };
        let error = frame::read(&with_nodes(&splats, &node)).unwrap_err().to_string();
        assert!(error.contains(why), "{why}: {error}");
    }
}

/// Attributes of `truth` (LUF), quantised and interleaved as the specification allows.
#[expect(clippy::cast_sign_loss, reason = "values from 0 to 1")]
fn quantized(truth: &Splats) -> Vec<u8> {
    let count = truth.len();
    let (min, max) = truth.bounds().unwrap();
    let width = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f32::max);
    let largest = truth.log_scales.iter().flatten().fold(f32::MIN, |a, &b| a.max(b)).exp();
    let mut data = Vec::new();
    for i in 0..count {
        // 16-bit positions and 8-bit rotations in rows of 16 bytes.
        let [x, y, z] = truth.means[i];
        for value in [-x, -y, z].iter().zip([-max[0], -max[1], min[2]]).map(|(v, low)| v - low) {
            data.extend(((value / width * 65_535.0).round() as u16).to_le_bytes());
        }
        data.extend([0, 0]);
        let [w, x, y, z] = truth.rotation(i);
        data.extend([-x, -y, z, w].map(|q| ((q * 127.0).round() as i8).cast_unsigned()));
        data.extend([0; 4]);
    }
    let scales = data.len();
    for i in 0..count {
        let unit = truth.scale(i).map(|value| (value / largest * 65_535.0).round() as u16);
        data.extend(unit.map(u16::to_le_bytes).concat());
        data.extend([0, 0]);
    }
    let opacities = data.len();
    data.extend((0..count).map(|i| (truth.opacity(i) * 255.0).round() as u8));
    data.resize(data.len().next_multiple_of(4), 0);
    let colors = data.len();
    for i in 0..count {
        data.extend(truth.sh_of(i)[0].map(f32::to_le_bytes).concat());
    }
    // A sparse accessor: the last splat is red.
    let indices = data.len();
    data.extend(u16::try_from(count - 1).unwrap().to_le_bytes());
    data.extend([0, 0]);
    data.extend([1.0_f32, -1.0, -1.0].map(f32::to_le_bytes).concat());
    let view = |offset: usize, length: usize, stride: Option<usize>| {
        let mut view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        view
    };
    let document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_gaussian_splatting", "KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        // Undoes the normalisation of positions; this also scales the sizes.
        "nodes": [{ "mesh": 0, "translation": [-max[0], -max[1], min[2]], "scale": [width, width, width] }],
        "meshes": [{ "primitives": [{ "mode": 0,
            "attributes": {
                "POSITION": 0,
                "KHR_gaussian_splatting:ROTATION": 1,
                "KHR_gaussian_splatting:SCALE": 2,
                "KHR_gaussian_splatting:OPACITY": 3,
                "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0": 4,
            },
            "extensions": { "KHR_gaussian_splatting": { "kernel": "ellipse", "colorSpace": "srgb_rec709_display" } },
        }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5123, "normalized": true, "count": count, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 8, "componentType": 5120, "normalized": true, "count": count, "type": "VEC4" },
            { "bufferView": 1, "componentType": 5123, "normalized": true, "count": count, "type": "VEC3" },
            { "bufferView": 2, "componentType": 5121, "normalized": true, "count": count, "type": "SCALAR" },
            { "bufferView": 3, "componentType": 5126, "count": count, "type": "VEC3", "sparse": { "count": 1,
                "indices": { "bufferView": 4, "componentType": 5123 },
                "values": { "bufferView": 4, "byteOffset": 4 } } },
        ],
        "bufferViews": [
            view(0, scales, Some(16)),
            view(scales, opacities - scales, Some(8)),
            view(opacities, count, None),
            view(colors, 12 * count, None),
            view(indices, 16, None),
        ],
        "buffers": [{ "byteLength": data.len() }],
    });
    put_together(&document, &data)
}

#[test]
fn quantized_interleaved_and_sparse_values_are_read_within_their_precision() {
    let truth = truth().with_sh_degree(0);
    let (min, max) = truth.bounds().unwrap();
    let width = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f32::max);
    let largest = truth.log_scales.iter().flatten().fold(f32::MIN, |a, &b| a.max(b)).exp();
    let frame = frame::read(&quantized(&truth)).unwrap();
    let precision = frame.precision.unwrap();
    assert_eq!(frame.splats.len(), 300, "rows in order");
    let mut tight = 0;
    for i in 0..300 {
        let row = precision.of(i);
        for axis in 0..3 {
            let off = (frame.splats.means[i][axis] - truth.means[i][axis]).abs();
            assert!(off <= row.means[axis] + 1e-6 * width, "centre of {i}: {off} {row:?}");
            tight += usize::from(off > 0.1 * row.means[axis]);
            // Sizes are scaled by the node; stored values are relative to the largest.
            let size = truth.log_scales[i][axis] - largest.ln() + width.ln();
            let off = (frame.splats.log_scales[i][axis] - size.max(row.log_scale_range[0])).abs();
            assert!(off <= row.log_scales[axis] + 1e-4, "size of {i}: {off} {row:?}");
        }
        let off = (frame.splats.opacity(i) - truth.opacity(i)).abs();
        assert!(off <= row.opacity + 1e-5, "opacity of {i}: {off}");
        let angle =
            2.0 * quat::dot(frame.splats.rotation(i), truth.rotation(i)).abs().min(1.0).acos();
        assert!(angle <= row.rotation_rad + 1e-3, "rotation of {i}: {angle} {}", row.rotation_rad);
    }
    assert!(tight > 500, "the stated precision is not excessively wide: {tight}");
    assert_eq!(frame.splats.sh[..299], truth.sh[..299], "floats are exact");
    assert_eq!(frame.splats.sh[299], [1.0, -1.0, -1.0], "replaced");
}

#[test]
fn external_data_and_embedded_spz() {
    let truth = truth();
    let folder = tempfile::tempdir().unwrap();
    let (mut document, data) = taken_apart(&written(&truth, false));
    document["buffers"][0]["uri"] = json!("the%20data.bin");
    let path = folder.path().join("scene.gltf");
    fs::write(&path, document.to_string()).unwrap();
    let error = frame::read_file(&path).unwrap_err().to_string();
    assert!(error.contains("the data.bin is missing"), "{error}");
    fs::write(folder.path().join("the data.bin"), &data).unwrap();
    assert_same(&frame::read_file(&path).unwrap(), &truth, "a file next to it");
    assert_eq!(gs_io::detect(&path).unwrap(), gs_io::SceneKind::Gltf, "found by content");
    let error = frame::read(document.to_string().as_bytes()).unwrap_err().to_string();
    assert!(error.contains("the%20data.bin") && error.contains("path of the .gltf"), "{error}");
    for outside in ["../the%20data.bin", "/etc/passwd", "https://example.org/a.bin", "", "%2e%2e/a"]
    {
        document["buffers"][0]["uri"] = json!(outside);
        fs::write(&path, document.to_string()).unwrap();
        let error = frame::read_file(&path).unwrap_err().to_string();
        assert!(error.contains("not in its folder"), "{outside}: {error}");
    }

    let mut packed = Vec::new();
    spz::write(&truth, &spz::WriteOptions::default(), &mut packed).unwrap();
    let expected = frame::read(&packed).unwrap();
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&packed));
    for name in
        ["KHR_gaussian_splatting_compression_spz", "KHR_gaussian_splatting_compression_spz_2"]
    {
        let document = json!({
            "asset": { "version": "2.0" },
            "extensionsRequired": ["KHR_gaussian_splatting", name],
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "mode": 0, "extensions": { "KHR_gaussian_splatting": {
                "kernel": "ellipse", "colorSpace": "srgb_rec709_display",
                "extensions": { name: { "bufferView": 0 } },
            } } }] }],
            "bufferViews": [{ "buffer": 0, "byteLength": packed.len() }],
            "buffers": [{ "byteLength": packed.len(), "uri": uri }],
        });
        let frame = frame::read(document.to_string().as_bytes()).unwrap();
        assert_eq!(frame.splats, expected.splats, "{name}");
        assert_eq!(
            frame.precision.unwrap().of(7),
            expected.precision.as_ref().unwrap().of(7),
            "as coarse"
        );
    }
}

#[test]
fn linear_colours_are_converted() {
    let (mut document, data) = taken_apart(&written(&one(), false));
    let extension =
        &mut document["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"];
    extension["colorSpace"] = json!("lin_rec709_display");
    let frame = frame::read(&put_together(&document, &data)).unwrap();
    let linear = 0.5 + sh::C0 * one().sh[0][0];
    let shown = 0.5 + sh::C0 * frame.splats.sh[0][0];
    let curve = |value: f32| 1.055 * value.powf(1.0 / 2.4) - 0.055;
    assert!((shown - curve(linear)).abs() < 1e-6, "{linear} {shown}");
    let slope = (curve(linear + 1e-3) - curve(linear - 1e-3)) / 2e-3;
    let ratio = frame.splats.sh[5][0] / one().sh[5][0];
    assert!((ratio - slope).abs() < 1e-3, "{ratio} {slope}");
    assert!(frame.notes[0].contains("linear"), "{:?}", frame.notes);
}

/// Damages a document.
type Change<'a> = &'a dyn Fn(&mut Value);

#[test]
fn unsupported_files_are_named() {
    let truth = one();
    let bytes = written(&truth, false);
    let (document, data) = taken_apart(&bytes);
    let error = |change: &dyn Fn(&mut Value)| {
        let mut document = document.clone();
        change(&mut document);
        frame::read(&put_together(&document, &data)).unwrap_err().to_string()
    };
    let primitive = |document: &mut Value| document["meshes"][0]["primitives"][0].take();
    let cases: [(Change, &str); 13] = [
        (&|d| d["asset"]["version"] = json!("1.0"), "version `1.0`, expected 2.0"),
        (
            &|d| d["extensionsRequired"] = json!(["EXT_meshopt_compression"]),
            "requires the unsupported extension EXT_meshopt_compression",
        ),
        (
            &|d| {
                d["meshes"][0]["primitives"][0]["extensions"].take();
            },
            "invalid type",
        ),
        (&|d| d["meshes"][0]["primitives"][0]["extensions"] = json!({}), "without Gaussian splats"),
        (&|d| d["meshes"][0]["primitives"] = json!([]), "without Gaussian splats"),
        (
            &|d| {
                d["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["kernel"] =
                    json!("cube");
            },
            "kernel `cube`",
        ),
        (
            &|d| d["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0 }),
            "no attribute `KHR_gaussian_splatting:SH_DEGREE_0_COEF_0`",
        ),
        (&|d| d["accessors"][2]["count"] = json!(2), "rows of"),
        (&|d| d["accessors"][0]["type"] = json!("VEC2"), "VEC2"),
        (&|d| d["accessors"][3]["componentType"] = json!(5130), "component type 5130"),
        (&|d| d["bufferViews"][0]["byteLength"] = json!(1_000_000), "a buffer view needs"),
        (&|d| d["bufferViews"][0]["byteStride"] = json!(4), "stride of 4"),
        (&|d| d["buffers"][0]["byteLength"] = json!(1_000_000), "a buffer needs"),
    ];
    for (change, expected) in cases {
        let found = error(change);
        assert!(found.contains(expected), "{expected}: {found}");
    }
    let mut missing = document.clone();
    let _ = primitive(&mut missing);
    assert!(frame::read(&put_together(&missing, &data)).is_err(), "null for a primitive");
    // A file that declares a hundred million splats, and one that uses a splat ten million times.
    let mut many = document.clone();
    for accessor in many["accessors"].as_array_mut().unwrap() {
        accessor["count"] = json!(100_000_000_u64);
        accessor.as_object_mut().unwrap().remove("bufferView");
    }
    let found = frame::read(&put_together(&many, &data)).unwrap_err();
    assert!(found.to_string().contains("can contain"), "{found}");
    for length in 0..bytes.len() {
        let found = frame::read(&bytes[..length]);
        assert!(found.is_err(), "cut at {length} of {}", bytes.len());
    }
    let mut old = bytes;
    old[4] = 1;
    let found = frame::read(&old).unwrap_err();
    assert!(matches!(found, FrameError::Gltf(GltfError::Version { found: 1 })), "{found}");
    let found = frame::read(b"{\"asset\": {\"version\": \"2.0\"}, \"nodes\": [[[").unwrap_err();
    assert!(found.to_string().contains("its JSON"), "{found}");
}
