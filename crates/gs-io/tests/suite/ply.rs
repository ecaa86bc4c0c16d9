//! PLY files of every variant give the same Gaussians; hostile ones are refused with helpful
//! errors; written files are bit-identical to those of the reference.

use gs_core::Splats;
use gs_io::ply::{self, Encoding, PlyError, WriteOptions};
use gs_io::{Existing, IoError};
use std::fmt::Write as _;
use test_support::fixture;

const ITERATION: &str = "deform4dgs/variants/default_flags/model/point_cloud/iteration_1";

fn reference_bytes() -> Vec<u8> {
    std::fs::read(fixture(ITERATION).join("point_cloud.ply")).unwrap()
}

/// Small exactly representable values, all different.
fn splats(n: usize, sh_degree: usize) -> Splats {
    let mut counter = 0_u16;
    let mut next = || {
        counter += 1;
        f32::from(counter) / 8.0
    };
    let coeffs = gs_core::sh::num_coeffs(sh_degree);
    Splats {
        means: (0..n).map(|_| std::array::from_fn(|_| next())).collect(),
        quats: (0..n).map(|_| std::array::from_fn(|_| next())).collect(),
        log_scales: (0..n).map(|_| std::array::from_fn(|_| next())).collect(),
        opacity_logits: (0..n).map(|_| next()).collect(),
        sh: (0..n * coeffs).map(|_| std::array::from_fn(|_| next())).collect(),
        sh_degree,
    }
}

/// Columns of one splat in the order of the reference.
fn row(splats: &Splats, i: usize) -> Vec<(String, f32)> {
    let mut cells = Vec::new();
    let mut put = |name: &str, values: &[f32]| {
        for (k, &value) in values.iter().enumerate() {
            cells.push((format!("{name}{k}"), value));
        }
    };
    let sh = splats.sh_of(i);
    put("mean", &splats.means[i]);
    put("f_dc_", &sh[0]);
    let rest: Vec<f32> = (0..3).flat_map(|c| sh[1..].iter().map(move |rgb| rgb[c])).collect();
    put("f_rest_", &rest);
    put("opacity", &[splats.opacity_logits[i]]);
    put("scale_", &splats.log_scales[i]);
    put("rot_", &splats.quats[i]);
    for (cell, name) in cells.iter_mut().zip(["x", "y", "z"]) {
        name.clone_into(&mut cell.0);
    }
    for cell in &mut cells {
        if cell.0 == "opacity0" {
            "opacity".clone_into(&mut cell.0);
        }
    }
    cells
}

/// Writes a PLY by hand: columns reversed, types alternating, lists and other elements around.
fn exotic(splats: &Splats, encoding: Encoding, eol: &str) -> Vec<u8> {
    let format = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::LittleEndian => "binary_little_endian",
        Encoding::BigEndian => "binary_big_endian",
    };
    let names: Vec<String> = row(splats, 0).into_iter().map(|(name, _)| name).rev().collect();
    let mut header =
        format!("ply{eol}format {format} 1.0{eol}comment caf\u{e9}{eol}obj_info x{eol}");
    write!(header, "element face 2{eol}property list uchar int vertex_indices{eol}").unwrap();
    write!(header, "element camera 1{eol}property double f{eol}").unwrap();
    write!(header, "element vertex {}{eol}property uchar label{eol}", splats.len()).unwrap();
    for (k, name) in names.iter().enumerate() {
        let kind = if k % 2 == 0 { "double" } else { "float32" };
        write!(header, "property {kind} {name}{eol}").unwrap();
    }
    write!(header, "element edge 1{eol}property int a{eol}end_header{eol}").unwrap();
    let mut bytes = header.into_bytes();
    let big = encoding == Encoding::BigEndian;
    let mut number = |raw: &[u8], text: &str| {
        if encoding == Encoding::Ascii {
            bytes.extend_from_slice(text.as_bytes());
            bytes.extend_from_slice(if text.len().is_multiple_of(2) { b" " } else { b"\r\n" });
        } else if big {
            bytes.extend(raw.iter().rev());
        } else {
            bytes.extend_from_slice(raw);
        }
    };
    for count in [3_u8, 0] {
        number(&[count], &count.to_string());
        for index in 0..i32::from(count) {
            number(&index.to_le_bytes(), &index.to_string());
        }
    }
    number(&1.5_f64.to_le_bytes(), "1.5");
    for i in 0..splats.len() {
        number(&[7], "7");
        for (k, (_, value)) in row(splats, i).into_iter().rev().enumerate() {
            let text = format!("{value:e}");
            if k % 2 == 0 {
                number(&f64::from(value).to_le_bytes(), &text);
            } else {
                number(&value.to_le_bytes(), &text);
            }
        }
    }
    number(&1_i32.to_le_bytes(), "1");
    bytes
}

#[test]
fn every_variant_gives_the_same_splats() {
    for degree in 0..=3 {
        let expected = splats(5, degree);
        for encoding in [Encoding::Ascii, Encoding::LittleEndian, Encoding::BigEndian] {
            for eol in ["\n", "\r\n"] {
                let bytes = exotic(&expected, encoding, eol);
                let read = ply::read(&bytes).unwrap();
                assert_eq!(read.splats, expected, "{encoding:?}, degree {degree}");
                assert_eq!(read.extra_columns, ["label"], "extra columns");
                assert_eq!(read.comments.len(), 2, "comments");
                assert!(!read.has_normals, "no normals");
                assert_eq!(ply::read_column(&bytes, "label").unwrap(), [7.0; 5], "column");
                assert!(
                    matches!(ply::read_column(&bytes, "nope"), Err(PlyError::NoColumn { .. })),
                    "no such column"
                );
            }
        }
    }
}

#[test]
fn lists_inside_vertices_are_skipped() {
    let expected = splats(3, 0);
    let mut text =
        String::from("ply\nformat ascii 1.0\nelement vertex 3\nproperty list uchar float tags\n");
    for (name, _) in row(&expected, 0) {
        writeln!(text, "property float {name}").unwrap();
    }
    text.push_str("end_header\n");
    for i in 0..3 {
        write!(text, "{i}{} ", " 0.5".repeat(i)).unwrap();
        for (_, value) in row(&expected, i) {
            write!(text, "{value} ").unwrap();
        }
        text.push('\n');
    }
    let read = ply::read(text.as_bytes()).unwrap();
    assert_eq!((read.splats, read.extra_columns), (expected, vec!["tags".to_owned()]), "skipped");
}

#[test]
fn written_files_equal_those_of_the_reference() {
    let bytes = reference_bytes();
    let read = ply::read(&bytes).unwrap();
    assert!(read.has_normals, "the reference writes normals");
    let mut out = Vec::new();
    ply::write(&read.splats, &WriteOptions::default(), &mut out).unwrap();
    assert!(out == bytes, "identical to the file of the reference");
    assert_eq!(WriteOptions::default().file_size(&read.splats), out.len() as u64, "size");
}

#[test]
fn write_options() {
    let original = splats(2, 1);
    let write = |options: &WriteOptions| {
        let mut out = Vec::new();
        ply::write(&original, options, &mut out).unwrap();
        assert_eq!(options.file_size(&original), out.len() as u64, "predicted size");
        ply::read(&out).unwrap()
    };
    let bare = write(&WriteOptions { normals: false, ..WriteOptions::default() });
    assert!(!bare.has_normals && bare.splats == original, "no normals");
    let degree =
        |sh_degree| write(&WriteOptions { sh_degree: Some(sh_degree), ..WriteOptions::default() });
    assert_eq!(degree(0).splats, original.with_sh_degree(0), "cut");
    assert_eq!(degree(3).splats, original.with_sh_degree(3), "padded");
    let comments = vec!["c4d_fps 30".to_owned(), "two\nlines".to_owned()];
    let commented = write(&WriteOptions { comments, ..WriteOptions::default() });
    assert_eq!(commented.comments, ["c4d_fps 30", "two lines"], "comments stay on one line");
    let mut broken = original.clone();
    broken.quats.pop();
    assert!(ply::write(&broken, &WriteOptions::default(), &mut Vec::new()).is_err(), "shapes");
}

#[test]
fn absurd_counts_are_refused_without_allocating() {
    let expected = splats(1, 0);
    for encoding in [Encoding::Ascii, Encoding::LittleEndian] {
        let bytes = exotic(&expected, encoding, "\n");
        let text = String::from_utf8_lossy(&bytes[..200]).into_owned();
        for (from, to) in [
            ("element vertex 1", "element vertex 18446744073709551615"),
            ("element vertex 1", "element vertex 99999999999"),
            ("element face 2", "element face 18446744073709551615"),
            ("element camera 1", "element camera 1844674407370955161"),
        ] {
            assert!(text.contains(from), "{from}");
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            let hostile = [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat();
            let error = ply::read(&hostile).unwrap_err();
            assert!(
                matches!(error, PlyError::Truncated { .. } | PlyError::Value { .. }),
                "{to}: {error}"
            );
        }
    }
}

#[test]
fn truncation_reports_the_missing_amount() {
    let bytes = reference_bytes();
    let error = ply::read(&bytes[..bytes.len() - 100]).unwrap_err();
    let expected = 48 * 248;
    assert_eq!(
        error,
        PlyError::Truncated {
            element: "vertex".to_owned(),
            expected,
            found: expected - 100,
            unit: "bytes"
        },
        "bytes"
    );
    let ascii = exotic(&splats(5, 0), Encoding::Ascii, "\n");
    let error = ply::read(&ascii[..ascii.len() - 80]).unwrap_err().to_string();
    assert!(error.contains("needs 5 rows") && error.contains("found 4"), "{error}");
}

#[test]
fn invalid_numbers_are_located() {
    let mut ascii = exotic(&splats(2, 0), Encoding::Ascii, "\n");
    let at = ascii.windows(2).rposition(|w| w == b"e0").unwrap();
    ascii[at] = b'q';
    let error = ply::read(&ascii).unwrap_err().to_string();
    assert!(error.contains("row 1 of element `vertex`") && error.contains("q0"), "{error}");
}

#[test]
fn non_finite_values_are_kept() {
    let mut damaged = splats(3, 0);
    damaged.means[1][2] = f32::NAN;
    damaged.log_scales[2][0] = f32::NEG_INFINITY;
    damaged.quats[0] = [0.0; 4];
    let mut out = Vec::new();
    ply::write(&damaged, &WriteOptions::default(), &mut out).unwrap();
    let read = ply::read(&out).unwrap().splats;
    assert!(read.means[1][2].is_nan(), "NaN");
    assert_eq!(read.log_scales[2][0], f32::NEG_INFINITY, "−∞");
    assert_eq!(read.quats[0], [0.0; 4], "zero quaternion");
}

#[test]
fn files_are_named_in_errors() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("edit.ply");
    let error = ply::read_file(&path).unwrap_err();
    assert!(matches!(error, IoError::Read { .. }), "{error}");
    std::fs::write(
        &path,
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n0 0 0 1 2 3\n",
    )
    .unwrap();
    let error = ply::read_file(&path).unwrap_err().to_string();
    for needle in [
        "edit.ply",
        "scale_0",
        "rot_0",
        "opacity",
        "plain point cloud with x, y, z, red, green, blue",
        "export",
    ] {
        assert!(error.contains(needle), "{needle}: {error}");
    }
    let error = ply::write_file(&path, &splats(1, 0), &WriteOptions::default(), Existing::Refuse);
    assert!(matches!(error, Err(IoError::Exists { .. })), "not overwritten");
    ply::write_file(&path, &splats(1, 0), &WriteOptions::default(), Existing::Replace).unwrap();
    assert_eq!(ply::read_file(&path).unwrap().splats, splats(1, 0), "replaced");
}

#[test]
fn long_headers_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("long.ply");
    let comments = vec!["x".repeat(100); 200];
    let options = WriteOptions { comments, ..WriteOptions::default() };
    ply::write_file(&path, &splats(1, 0), &options, Existing::Refuse).unwrap();
    let header = ply::read_header_file(&path).unwrap();
    assert_eq!(header.comments.len(), 200, "more than one read");
    assert_eq!(header.gaussians().unwrap().num_splats, 1, "rows");
}
