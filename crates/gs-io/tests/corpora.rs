//! Runs the stored inputs of the fuzzers through the same
//! functions: no panics, and all properties hold.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use gs_core::SplitMix64;
use std::io::{Cursor, Read};
use std::path::Path;

extern crate self as libfuzzer_sys;

/// Replaces the fuzzer's macro, which makes a program
/// of its argument, by one that makes a function.
#[macro_export]
macro_rules! fuzz_target {
    (|$bytes:ident: &[u8]| $body:block) => {
        pub(super) fn run($bytes: &[u8]) $body
    };
}

/// The targets, each as a module and a test.
macro_rules! targets {
    ($($name:ident $file:literal,)*) => {
        $(
            #[allow(unused_attributes, reason = "the target has no `main` when built as a program")]
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
    deform_network "../../../fuzz/fuzz_targets/deform_network.rs",
    frame "../../../fuzz/fuzz_targets/frame.rs",
    gltf "../../../fuzz/fuzz_targets/gltf.rs",
    model_folder "../../../fuzz/fuzz_targets/model_folder.rs",
    nerfies "../../../fuzz/fuzz_targets/nerfies.rs",
    ply "../../../fuzz/fuzz_targets/ply.rs",
    pth "../../../fuzz/fuzz_targets/pth.rs",
    sequence_zip "../../../fuzz/fuzz_targets/sequence_zip.rs",
    sog_meta "../../../fuzz/fuzz_targets/sog_meta.rs",
    splat4d "../../../fuzz/fuzz_targets/splat4d.rs",
    splatv "../../../fuzz/fuzz_targets/splatv.rs",
    spz_plain "../../../fuzz/fuzz_targets/spz_plain.rs",
    swift4d "../../../fuzz/fuzz_targets/swift4d.rs",
    trained_scene "../../../fuzz/fuzz_targets/trained_scene.rs",
    tsog_meta "../../../fuzz/fuzz_targets/tsog_meta.rs",
}

#[test]
fn stored_inputs_pass() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpora");
    let mut kept: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_str().unwrap().replace(".zip", ""))
        .collect();
    kept.sort();
    let names: Vec<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
    assert_eq!(kept, names, "a corpus for every target");
    for (name, run) in TARGETS {
        let inputs = corpus(name);
        assert!(inputs.len() > 5, "{name}: {} inputs", inputs.len());
        for input in &inputs {
            run(input);
        }
    }
    mutated_inputs_pass();
    // Temporary files of targets that read from disk.
    let left = |name: &str| std::env::temp_dir().join(format!("{name}{}", std::process::id()));
    std::fs::remove_file(left("gs-io-fuzz-").with_added_extension("zip")).unwrap();
    std::fs::remove_dir_all(left("gs-io-fuzz-swift4d-")).unwrap();
    std::fs::remove_dir_all(left("gs-io-fuzz-model-")).unwrap();
    std::fs::remove_dir_all(left("gs-io-fuzz-deform-")).unwrap();
    std::fs::remove_file(left("gs-io-fuzz-trained-")).unwrap();
    std::fs::remove_file(left("gs-io-fuzz-tsog-")).unwrap();
}

/// Seconds per target; set `C4D_FUZZ_SECONDS` for more.
fn seconds() -> f64 {
    let given = std::env::var("C4D_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    given.unwrap_or(2.0)
}

/// An input mutated as by libFuzzer: bytes, extreme numbers, digits, parts
/// removed, duplicated, or taken from a different input.
fn mutated(kept: &[Vec<u8>], numbers: &mut SplitMix64) -> Vec<u8> {
    const EXTREMES: [u32; 6] = [0, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x7fc0_0000];
    let mut bytes = kept[numbers.below(kept.len())].clone();
    for _ in 0..=numbers.below(4) {
        let at = numbers.below(bytes.len() + 1);
        let length = numbers.below(1 + (bytes.len() - at).min(64));
        match numbers.below(7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << numbers.below(8),
            1 if at < bytes.len() => bytes[at] = u8::try_from(numbers.below(256)).unwrap(),
            2 if at < bytes.len() => bytes[at] = b"0123456789-.e,nN"[numbers.below(16)],
            3 if at + 4 <= bytes.len() => {
                let extreme = EXTREMES[numbers.below(EXTREMES.len())];
                bytes[at..at + 4].copy_from_slice(&extreme.to_le_bytes());
            }
            4 => drop(bytes.drain(at..at + length)),
            5 => {
                let part = bytes[at..at + length].to_vec();
                bytes.splice(at..at, part);
            }
            _ => {
                let other = &kept[numbers.below(kept.len())];
                let from = numbers.below(other.len() + 1);
                let upto = other.len().min(from + 1 + length);
                bytes.splice(at..at, other[from.min(upto)..upto].iter().copied());
            }
        }
    }
    bytes
}

fn corpus(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpora");
    let bytes = std::fs::read(folder.join(format!("{name}.zip"))).unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    (0..archive.len())
        .map(|index| {
            let mut input = Vec::new();
            archive.by_index(index).unwrap().read_to_end(&mut input).unwrap();
            input
        })
        .collect()
}

/// Every target on mutated inputs, for a few seconds each, like a fuzzer without instrumentation.
fn mutated_inputs_pass() {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::time::Instant;
    let next = std::sync::atomic::AtomicUsize::new(0);
    let work = || {
        while let Some((name, run)) =
            TARGETS.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed))
        {
            let (kept, begun, mut tried) = (corpus(name), Instant::now(), 0_u64);
            while begun.elapsed().as_secs_f64() < seconds() {
                let input = mutated(&kept, &mut SplitMix64::new(tried));
                let start = Instant::now();
                if catch_unwind(AssertUnwindSafe(|| run(&input))).is_err() {
                    let file = std::env::temp_dir().join(format!("c4d-fuzz-{name}-{tried}"));
                    std::fs::write(&file, &input).unwrap();
                    panic!("{name}: input {tried} is in {}", file.display());
                }
                let took = start.elapsed().as_secs_f64();
                assert!(took < 20.0, "{name}: input {tried} takes {took} s");
                tried += 1;
            }
            eprintln!("{name}: {tried} inputs");
            assert!(tried > 10, "{name}: only {tried} inputs");
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(work);
        }
    });
}
