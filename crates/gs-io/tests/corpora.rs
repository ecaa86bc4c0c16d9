//! What the fuzzers found worth keeping, through the very functions they call: nothing panics, every promise holds.

#![allow(clippy::unwrap_used, reason = "shared functions of tests fail by panicking, as tests do")]

use std::io::{Cursor, Read};
use std::path::Path;

extern crate self as libfuzzer_sys;

/// In place of the fuzzer's own macro, which makes a program of its argument: a function.
#[macro_export]
macro_rules! fuzz_target {
    (|$bytes:ident: &[u8]| $body:block) => {
        pub(super) fn run($bytes: &[u8]) $body
    };
}

/// The targets, each a module of its own and a test.
macro_rules! targets {
    ($($name:ident $file:literal,)*) => {
        $(
            #[allow(unused_attributes, reason = "as a program, the target has no `main` of its own")]
            #[path = $file]
            mod $name;
        )*

        const TARGETS: &[(&str, fn(&[u8]))] = &[$((stringify!($name), $name::run),)*];
    };
}

targets! {
    cameras "../../../fuzz/fuzz_targets/cameras.rs",
    cameras_json "../../../fuzz/fuzz_targets/cameras_json.rs",
    cfg_args "../../../fuzz/fuzz_targets/cfg_args.rs",
    colmap "../../../fuzz/fuzz_targets/colmap.rs",
    frame "../../../fuzz/fuzz_targets/frame.rs",
    gltf "../../../fuzz/fuzz_targets/gltf.rs",
    nerfies "../../../fuzz/fuzz_targets/nerfies.rs",
    ply "../../../fuzz/fuzz_targets/ply.rs",
    pth "../../../fuzz/fuzz_targets/pth.rs",
    sequence_zip "../../../fuzz/fuzz_targets/sequence_zip.rs",
    sog_meta "../../../fuzz/fuzz_targets/sog_meta.rs",
    splat4d "../../../fuzz/fuzz_targets/splat4d.rs",
    splatv "../../../fuzz/fuzz_targets/splatv.rs",
    spz_plain "../../../fuzz/fuzz_targets/spz_plain.rs",
    swift4d "../../../fuzz/fuzz_targets/swift4d.rs",
}

#[test]
fn kept_inputs_still_pass() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpora");
    let mut kept: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_str().unwrap().replace(".zip", ""))
        .collect();
    kept.sort();
    let names: Vec<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
    assert_eq!(kept, names, "a corpus for every target");
    for (name, run) in TARGETS {
        let bytes = std::fs::read(folder.join(format!("{name}.zip"))).unwrap();
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        assert!(archive.len() > 5, "{name}: {} inputs", archive.len());
        for index in 0..archive.len() {
            let mut input = Vec::new();
            archive.by_index(index).unwrap().read_to_end(&mut input).unwrap();
            run(&input);
        }
    }
    // What targets that read from disk leave behind.
    let left = |name: &str| std::env::temp_dir().join(format!("{name}{}", std::process::id()));
    std::fs::remove_file(left("gs-io-fuzz-").with_added_extension("zip")).unwrap();
    std::fs::remove_dir_all(left("gs-io-fuzz-swift4d-")).unwrap();
}
