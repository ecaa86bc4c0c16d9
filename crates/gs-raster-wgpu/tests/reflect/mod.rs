//! Compares the declarations of a shader, parsed by naga, with those in Rust.

#![allow(unreachable_pub, reason = "each test binary uses it as a module")]

use gs_raster_wgpu::kernels::{Access, KernelDef};
use gs_raster_wgpu::layout::{Constant, StructField};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

pub type Layout = (&'static str, usize, &'static [StructField]);

/// WebGPU's default limit on workgroup memory, bytes.
const MAX_WORKGROUP_BYTES: u32 = 16_384;

pub fn parse(text: &str, capabilities: Capabilities) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
    let info = Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|e| e.emit_to_string(text))?;
    Ok((module, info))
}

pub fn capabilities(def: &KernelDef) -> Capabilities {
    let mut needed = Capabilities::empty();
    if def.needs.subgroups {
        needed |= Capabilities::SUBGROUP;
    }
    if def.needs.float_atomics {
        needed |= Capabilities::SHADER_FLOAT32_ATOMIC;
    }
    needed
}

/// Differences between structs of uniform and storage bindings and `layouts`.
pub fn struct_findings(module: &Module, layouts: &[Layout]) -> Vec<String> {
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
            found.push(format!("struct {name} has no Rust struct"));
            continue;
        };
        if *span as usize != *size || stride.is_some_and(|bytes| bytes as usize != *size) {
            found.push(format!("struct {name} has {span} bytes, in Rust {size}"));
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

/// Differences between an entry point's bindings and group size and the table.
pub fn entry_findings(module: &Module, info: &ModuleInfo, def: &KernelDef) -> Vec<String> {
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

/// Differences between constants that exist in WGSL and in Rust.
pub fn constant_findings(module: &Module, constants: &[(&str, Constant)]) -> Vec<String> {
    let mut found = Vec::new();
    for (_, constant) in module.constants.iter() {
        let name = constant.name.clone().unwrap_or_default();
        let Some((_, expected)) = constants.iter().find(|(ours, _)| *ours == name) else {
            continue;
        };
        let value = &module.global_expressions[constant.init];
        let expected = match *expected {
            Constant::Uint(value) => naga::Literal::U32(value),
            Constant::Float(value) => naga::Literal::F32(value),
        };
        if *value != naga::Expression::Literal(expected) {
            found.push(format!("constant {name} is {value:?}, in Rust {expected:?}"));
        }
    }
    found
}
