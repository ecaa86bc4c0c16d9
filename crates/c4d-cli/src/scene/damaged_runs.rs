//! Run folders with damaged files: each opens or is refused with an error; none causes a panic.

use super::open;
use crate::args::{Cli, Command, PresetArg, RefineFlags};
use crate::commands;
use crate::console::Console;
use crate::run_folder::{CONFIG, Checkpoint, REFINE_STATE, SCENE};
use crate::settings::RefineSettings;
use clap::Parser;
use gs_core::SplitMix64;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

/// Damages bytes: overwritten bytes and digits, mostly near the start, where headers are; parts
/// removed or duplicated; truncation.
fn damaged(bytes: &[u8], numbers: &mut SplitMix64) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=numbers.below(3) {
        let range = if numbers.below(2) == 0 { bytes.len() } else { bytes.len().min(1500) };
        let at = numbers.below(range);
        let length = numbers.below((bytes.len() - at).min(40));
        match numbers.below(6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << numbers.below(8),
            1 | 2 if at < bytes.len() => bytes[at] = b"0123456789-.\"[]nai"[numbers.below(18)],
            3 => drop(bytes.drain(at..at + length)),
            4 => {
                let part = bytes[at..at + length].to_vec();
                bytes.splice(at..at, part);
            }
            _ if numbers.below(8) == 0 => bytes.truncate(at),
            _ => {}
        }
    }
    bytes
}

#[test]
fn damaged_run_folders_are_errors() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/synth");
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let (source, edited) = (text(&fixtures.join("source")), text(&fixtures.join("edited.ply")));
    let words =
        ["c4d", "propagate", &source, "--edited", &edited, "--no-refine", "-o", &text(&run)];
    let cli = Cli::parse_from(words);
    let global = cli.global();
    let console = Console::new(true, false, false);
    let Command::Propagate(args) = &cli.command else { panic!("a different command") };
    commands::propagate::run(args, &global, &console).unwrap();
    let state = cuar::State {
        fingerprint: 3,
        step: 4,
        arrays: vec![("d_sh".to_owned(), vec![0.5; 30])],
        doubles: vec![("losses".to_owned(), vec![0.5; 5])],
    };
    let update = gs_io::FolderUpdate::begin(&run).unwrap();
    let (settings, flags) = (RefineSettings::default(), RefineFlags::default());
    Checkpoint::write(&update, PresetArg::Default, &settings, &flags, Some(&state)).unwrap();
    drop(update);

    let files = [CONFIG, SCENE, REFINE_STATE].map(|name| (name, fs::read(run.join(name)).unwrap()));
    let seconds = std::env::var("C4D_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    let (begun, mut tried, mut opened) = (Instant::now(), 0_u64, 0_u64);
    while begun.elapsed().as_secs_f64() < seconds.unwrap_or(3.0) {
        let mut numbers = SplitMix64::new(tried);
        let (name, sound) = &files[numbers.below(files.len())];
        fs::write(run.join(name), damaged(sound, &mut numbers)).unwrap();
        let look = || {
            let _ = Checkpoint::read(&run);
            let Ok(found) = open(&run, &global, &console) else { return false };
            let splats = found.scene.at(found.edit_time);
            assert!(splats.is_err() || splats.unwrap().check_shapes().is_ok(), "consistent");
            true
        };
        let outcome = catch_unwind(AssertUnwindSafe(look));
        opened += u64::from(*outcome.as_ref().unwrap_or_else(|_| {
            panic!("{name}, seed {tried}: a damaged run folder causes a panic")
        }));
        fs::write(run.join(name), sound).unwrap();
        tried += 1;
    }
    eprintln!("{tried} damaged run folders, of which {opened} open");
    assert!(tried > 20 && opened > 0 && opened < tried, "{opened} of {tried} open");
}
