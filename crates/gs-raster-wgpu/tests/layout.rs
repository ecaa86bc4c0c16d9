//! Proves, without a device, that shaders and Rust agree: structs, bindings, sizes, constants, and that core kernels need no optional
//! feature. Each check is shown to fail.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use gs_raster_wgpu::kernels::{Access, KERNELS, KernelDef, Needs};
use gs_raster_wgpu::layout::{CONSTANTS, Field, LAYOUTS};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

type Layout = (&'static str, usize, &'static [Field]);

/// WebGPU's default limit on workgroup memory, bytes.
const MAX_WORKGROUP_BYTES: u32 = 16_384;

fn parse(text: &str, capabilities: Capabilities) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
    let info = Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|e| e.emit_to_string(text))?;
    Ok((module, info))
}

fn capabilities(def: &KernelDef) -> Capabilities {
    let mut needed = Capabilities::empty();
    if def.needs.subgroups {
        needed |= Capabilities::SUBGROUP;
    }
    if def.needs.float_atomics {
        needed |= Capabilities::SHADER_FLOAT32_ATOMIC;
    }
    needed
}

/// Structs behind uniform and storage bindings against `layouts`.
fn struct_findings(module: &Module, layouts: &[Layout]) -> Vec<String> {
    let mut found = Vec::new();
    for (_, global) in module.global_variables.iter() {
        if !matches!(global.space, AddressSpace::Uniform | AddressSpace::Storage { .. }) {
            continue;
        }
        let mut ty = &module.types[global.ty];
        let mut stride = None;
        if let TypeInner::Array { base, stride: bytes, .. } = ty.inner {
            ty = &module.types[base];
            stride = Some(bytes);
            if matches!(ty.inner, TypeInner::Vector { size: naga::VectorSize::Tri, .. }) {
                found.push(format!("{:?} is an array of vec3", global.name));
            }
        }
        let TypeInner::Struct { members, span } = &ty.inner else { continue };
        let name = ty.name.clone().unwrap_or_default();
        let Some((_, size, fields)) = layouts.iter().find(|(twin, ..)| *twin == name) else {
            found.push(format!("struct {name} has no twin"));
            continue;
        };
        if *span as usize != *size || stride.is_some_and(|bytes| bytes as usize != *size) {
            found.push(format!("struct {name} has {span} bytes, its twin {size}"));
        }
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let ours: Vec<(String, usize, usize)> = members
            .iter()
            .map(|member| {
                let bytes = layouter[member.ty].size as usize;
                (member.name.clone().unwrap_or_default(), member.offset as usize, bytes)
            })
            .collect();
        let twins: Vec<(String, usize, usize)> =
            fields.iter().map(|&(name, offset, size)| (name.to_owned(), offset, size)).collect();
        if ours != twins {
            found.push(format!("struct {name}: {ours:?} in WGSL, {twins:?} in Rust"));
        }
    }
    found
}

/// Bindings that an entry point uses, and its group size, against the table.
fn entry_findings(module: &Module, info: &ModuleInfo, def: &KernelDef) -> Vec<String> {
    let mut found = Vec::new();
    let Some(index) = module.entry_points.iter().position(|entry| entry.name == def.entry) else {
        return vec![format!("{}: no entry point {}", def.name, def.entry)];
    };
    let mut used = vec![Access::None; 9];
    for (handle, global) in module.global_variables.iter() {
        let Some(binding) = &global.binding else { continue };
        if info.get_entry_point(index)[handle].is_empty() {
            continue;
        }
        if binding.group != 0 || used[binding.binding as usize] != Access::None {
            found.push(format!("{}: binding {} twice or in a group", def.name, binding.binding));
        }
        used[binding.binding as usize] = match global.space {
            AddressSpace::Uniform => Access::Uniform,
            AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                Access::Write
            }
            _ => Access::Read,
        };
    }
    let mut table = def.bindings.to_vec();
    table.resize(9, Access::None);
    if used != table {
        found.push(format!("{}: bindings {used:?}, in the table {table:?}", def.name));
    }
    let storages = used.iter().filter(|a| matches!(a, Access::Read | Access::Write)).count();
    if storages > 8 {
        found.push(format!("{}: {storages} storage buffers", def.name));
    }
    let size = module.entry_points[index].workgroup_size;
    if size != [def.workgroup_size, 1, 1] || def.workgroup_size > 256 {
        found.push(format!(
            "{}: group size {size:?}, in the table {}",
            def.name, def.workgroup_size
        ));
    }
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let shared: u32 = module
        .global_variables
        .iter()
        .filter(|(_, global)| global.space == AddressSpace::WorkGroup)
        .map(|(_, global)| layouter[global.ty].size.next_multiple_of(16))
        .sum();
    if shared > MAX_WORKGROUP_BYTES {
        found.push(format!("{}: {shared} bytes of workgroup memory", def.name));
    }
    found
}

/// Values of the constants that WGSL and Rust share.
fn constant_findings(module: &Module, constants: &[(&str, u32)]) -> Vec<String> {
    let mut found = Vec::new();
    for (_, constant) in module.constants.iter() {
        let name = constant.name.clone().unwrap_or_default();
        let Some((_, expected)) = constants.iter().find(|(ours, _)| *ours == name) else {
            continue;
        };
        let value = &module.global_expressions[constant.init];
        if *value != naga::Expression::Literal(naga::Literal::U32(*expected)) {
            found.push(format!("constant {name} is {value:?}, in Rust {expected}"));
        }
    }
    found
}

#[test]
fn every_kernel_is_valid_with_what_it_declares_to_need_and_matches_rust() {
    let mut found = Vec::new();
    for def in KERNELS {
        match parse(def.source.text, capabilities(def)) {
            Ok((module, info)) => {
                found.extend(struct_findings(&module, LAYOUTS));
                found.extend(entry_findings(&module, &info, def));
                found.extend(constant_findings(&module, CONSTANTS));
            }
            Err(message) => found.push(format!("{}: {message}", def.name)),
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn optional_kernels_really_need_their_features() {
    for def in KERNELS.iter().filter(|def| def.needs != Needs::default()) {
        assert!(
            parse(def.source.text, Capabilities::empty()).is_err(),
            "{} is valid without optional features: the validation proves nothing",
            def.name
        );
    }
}

#[test]
fn every_shader_file_is_used_and_says_what_it_needs() {
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
        assert!(text.starts_with("// Needs: "), "shaders/{file} does not begin with what it needs");
    }
}

const SAMPLE: &str = "struct S { a: vec3f, b: u32, c: vec2f, d: vec2f }
const SIZE: u32 = 64u;
@group(0) @binding(0) var<uniform> s: S;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) { y[i] = x[i] + s.c.x + f32(SIZE); }";
const GOOD: Layout = ("S", 32, &[("a", 0, 12), ("b", 12, 4), ("c", 16, 8), ("d", 24, 8)]);

static SAMPLE_SOURCE: gs_raster_wgpu::shaders::Source =
    gs_raster_wgpu::shaders::Source { parts: &[], text: SAMPLE };

fn sample_def(bindings: &'static [Access], workgroup_size: u32) -> KernelDef {
    KernelDef {
        name: "sample",
        source: &SAMPLE_SOURCE,
        entry: "main",
        bindings,
        workgroup_size,
        needs: Needs::default(),
    }
}

#[test]
fn struct_differences_are_found() {
    let (module, _) = parse(SAMPLE, Capabilities::empty()).unwrap();
    assert!(struct_findings(&module, &[GOOD]).is_empty(), "the right twin passes");
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
    assert_eq!(findings(&sample_def(&[Uniform, Read, Write], 64)), 0, "the right table passes");
    assert_eq!(findings(&sample_def(&[Uniform, Read], 64)), 1, "missing binding");
    assert_eq!(findings(&sample_def(&[Uniform, Write, Write], 64)), 1, "wrong access");
    assert_eq!(findings(&sample_def(&[Uniform, Read, Write], 32)), 1, "wrong group size");
    let (module, _) = parse(SAMPLE, Capabilities::empty()).unwrap();
    assert!(constant_findings(&module, &[("SIZE", 64)]).is_empty(), "the right constant passes");
    assert_eq!(constant_findings(&module, &[("SIZE", 65)]).len(), 1, "wrong constant");
}
