//! The fuzzer's function on typical user input and on mutations of it: no panics, and every column
//! lies within the text.

use rand::{RngExt, SeedableRng};

extern crate self as libfuzzer_sys;

/// Replaces the fuzzer's macro, which makes a program of its argument, by one that makes a function.
#[macro_export]
macro_rules! fuzz_target {
    (|$bytes:ident: &[u8]| $body:block) => {
        pub(super) fn run($bytes: &[u8]) $body
    };
}

#[allow(unused_attributes, reason = "as a program, the target has no `main` of its own")]
#[path = "../../../fuzz/fuzz_targets/edit_options.rs"]
mod edit_options;

const SEEDS: [&str; 18] = [
    "box inf,0,-1,inf,2,1e3",
    "sphere 0,1,0,.5 & opacity>.1",
    "plane 0,1,0,-.2 | !moving",
    "grow .1 (color #e33~.15 | hue 330..30)",
    "connected 0,1,0 gap .2 of (part 3 & size .01..0.1)",
    "near 0.05 mask \"my masks\"",
    "shrink 1 ids rows.txt",
    "1,-2,.5e-1",
    "0,90,0@1,2,3",
    "2.5@center",
    "#e33:.5",
    "#c0ffee",
    ".1,.9",
    "hat@2x.ply@0,1,0,0,90,0,.5",
    "# rows\n1, 2 3\n[10..12]\n",
    "!!!((((all",
    "size<=1e999",
    "é\u{0}\u{7f}~",
];

/// Mutated inputs per seed.
const CHANGES: usize = 2000;

#[test]
fn typical_and_mutated_texts_are_parsed_or_rejected() {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    for seed in SEEDS {
        edit_options::run(seed.as_bytes());
        for _ in 0..CHANGES {
            let mut bytes = seed.as_bytes().to_vec();
            for _ in 0..rng.random_range(1..5) {
                let at = rng.random_range(0..=bytes.len());
                let other = SEEDS[rng.random_range(0..SEEDS.len())].as_bytes();
                match rng.random_range(0..4) {
                    0 if at < bytes.len() => bytes[at] = rng.random_range(0..=u8::MAX),
                    1 if at < bytes.len() => {
                        bytes.remove(at);
                    }
                    2 => bytes.truncate(at),
                    _ => {
                        let tail = bytes.split_off(at);
                        bytes.extend(&other[rng.random_range(0..other.len())..]);
                        bytes.extend(tail);
                    }
                }
            }
            edit_options::run(&bytes);
        }
    }
}
