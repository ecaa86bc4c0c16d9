//! Shaders and Rust agree on structs, bindings, sizes and constants, and core kernels need no
//! optional feature. Needs no device. Each check has a negative control.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod reflect;

use gs_core::image_formation;
use gs_raster_wgpu::kernels::{Access, DeviceFeatures, KERNELS, KernelDef};
use gs_raster_wgpu::layout::{CONSTANTS, Constant, LAYOUTS};
use naga::valid::Capabilities;
use reflect::{Layout, capabilities, constant_findings, entry_findings, parse, struct_findings};

/// Constants of the table and of the image formation.
fn constants() -> Vec<(&'static str, Constant)> {
    let of_image = image_formation::CONSTANTS.iter().map(|&(name, value)| match name {
        "TILE_SIZE" => (name, Constant::Uint(image_formation::TILE_SIZE)),
        _ => (name, Constant::Float(value)),
    });
    CONSTANTS.iter().copied().chain(of_image).collect()
}

#[test]
fn every_kernel_is_valid_with_its_declared_features_and_matches_rust() {
    let mut found = Vec::new();
    for def in KERNELS {
        match parse(def.source.text, capabilities(def)) {
            Ok((module, info)) => {
                found.extend(struct_findings(&module, LAYOUTS));
                found.extend(entry_findings(&module, &info, def));
                found.extend(constant_findings(&module, &constants()));
            }
            Err(message) => found.push(format!("{}: {message}", def.name)),
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_constant_of_the_table_is_in_a_shader() {
    // The guard band is a uniform, in tangents.
    for (name, _) in constants().into_iter().filter(|(name, _)| *name != "GUARD_BAND") {
        let declaration = format!("const {name}: ");
        let declared = KERNELS.iter().any(|def| def.source.text.contains(&declaration));
        assert!(declared, "no shader declares {name}");
    }
}

#[test]
fn optional_kernels_really_need_their_features() {
    for def in KERNELS.iter().filter(|def| def.needs != DeviceFeatures::default()) {
        assert!(
            parse(def.source.text, Capabilities::empty()).is_err(),
            "{} is valid without optional features, so the check cannot fail",
            def.name
        );
    }
}

#[test]
fn every_shader_file_is_used_and_declares_its_needs() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
    let mut files = Vec::new();
    for sub in ["", "shared", "variants"] {
        for entry in std::fs::read_dir(folder.join(sub)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                files.push(path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    for file in files {
        let part = KERNELS.iter().flat_map(|def| def.source.parts).find(|(name, _)| *name == file);
        let Some((_, text)) = part else { panic!("shaders/{file} is in no kernel") };
        assert!(
            text.starts_with("// Needs: "),
            "shaders/{file} does not begin with its `Needs:` line"
        );
    }
}

const SAMPLE: &str = "struct S { a: vec3f, b: u32, c: vec2f, d: vec2f }
const SIZE: u32 = 64u;
@group(0) @binding(0) var<uniform> s: S;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) { y[i] = x[i] + s.c.x + f32(SIZE); }";
const GOOD: Layout = ("S", 32, &[("a", 0, 12), ("b", 12, 4), ("c", 16, 8), ("d", 24, 8)]);

static SAMPLE_SOURCE: gs_raster_wgpu::shaders::WgslSource =
    gs_raster_wgpu::shaders::WgslSource { parts: &[], text: SAMPLE };

fn sample_def(bindings: &'static [Access], workgroup_size: u32) -> KernelDef {
    KernelDef {
        name: "sample",
        source: &SAMPLE_SOURCE,
        entry: "main",
        bindings,
        workgroup_size,
        needs: DeviceFeatures::default(),
    }
}

#[test]
fn struct_differences_are_found() {
    let (module, _) = parse(SAMPLE, Capabilities::empty()).unwrap();
    assert!(struct_findings(&module, &[GOOD]).is_empty(), "the matching layout passes");
    let swapped: Layout = ("S", 32, &[("a", 0, 12), ("b", 12, 4), ("d", 16, 8), ("c", 24, 8)]);
    assert_eq!(struct_findings(&module, &[swapped]).len(), 1, "swapped fields");
    let short: Layout = ("S", 28, GOOD.2);
    assert_eq!(struct_findings(&module, &[short]).len(), 1, "wrong size");
    assert_eq!(struct_findings(&module, &[]).len(), 1, "missing twin");
    let array = SAMPLE.replace("x: array<f32>", "x: array<vec3f>").replace("x[i]", "x[i].x");
    let (module, _) = parse(&array, Capabilities::empty()).unwrap();
    assert_eq!(struct_findings(&module, &[GOOD]).len(), 1, "array of vec3");
}

#[test]
fn binding_size_and_constant_differences_are_found() {
    use Access::{Read, Uniform, Write};
    let (module, info) = parse(SAMPLE, Capabilities::empty()).unwrap();
    let findings = |def: &KernelDef| entry_findings(&module, &info, def).len();
    assert_eq!(findings(&sample_def(&[Uniform, Read, Write], 64)), 0, "the matching table passes");
    assert_eq!(findings(&sample_def(&[Uniform, Read], 64)), 1, "missing binding");
    assert_eq!(findings(&sample_def(&[Uniform, Write, Write], 64)), 1, "wrong access");
    assert_eq!(findings(&sample_def(&[Uniform, Read, Write], 32)), 1, "wrong group size");
    let (module, _) = parse(SAMPLE, Capabilities::empty()).unwrap();
    assert!(
        constant_findings(&module, &[("SIZE", Constant::Uint(64))]).is_empty(),
        "the matching constant passes"
    );
    assert_eq!(
        constant_findings(&module, &[("SIZE", Constant::Uint(65))]).len(),
        1,
        "wrong constant"
    );
    let wrong_type = [("SIZE", Constant::Float(64.0))];
    assert_eq!(constant_findings(&module, &wrong_type).len(), 1, "wrong type");
}
