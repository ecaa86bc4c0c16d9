//! Training shaders agree with Rust and comply with the default limits. Needs no device.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[path = "../../gs-raster-wgpu/tests/reflect/mod.rs"]
mod reflect;

use gs_train_wgpu::kernels::{CONSTANTS, KERNELS, LAYOUTS};
use reflect::{capabilities, constant_findings, entry_findings, parse, struct_findings};

#[test]
fn every_kernel_is_valid_in_core_wgsl_and_matches_rust() {
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
    let (module, _) = parse(KERNELS[0].source.text, capabilities(KERNELS[0])).unwrap();
    assert!(!struct_findings(&module, &LAYOUTS[1..]).is_empty(), "a missing twin is found");
}

#[test]
fn every_shader_file_is_used_and_declares_its_needs() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders/train");
    for entry in std::fs::read_dir(folder).unwrap() {
        let file = format!("train/{}", entry.unwrap().file_name().to_str().unwrap());
        let part = KERNELS.iter().flat_map(|def| def.source.parts).find(|(name, _)| *name == file);
        let Some((_, text)) = part else { panic!("shaders/{file} is in no kernel") };
        assert!(
            text.starts_with("// Needs: "),
            "shaders/{file} does not begin with its `Needs:` line"
        );
    }
}
