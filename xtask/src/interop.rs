//! Round trips of every still format with common tools, installed from their registries, in both
//! directions; and the document about the results.
//!
//! Needs node, npm and python 3 with venv, and their registries. Everything else goes into
//! `target/interop`.

mod compare;
mod fourdgs;
mod peers;
mod round_trips;

use crate::workspace::workspace;
use anyhow::{Context, Result, bail};
use compare::{Difference, difference};
use gs_core::{DynamicScene, Splats};
use gs_io::ply::WriteOptions;
use gs_io::ply_sequence::FolderWriter;
use gs_io::{Existing, frame};
use peers::{Peer, python};
use round_trips::RoundTrips;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Number of splats of the scene: enough to fill palettes and blocks of every format, few enough
/// that the whole run takes minutes.
const SPLATS: usize = 5000;
/// One splat in this many is invisible in the first frame and appears later.
const FADING: usize = 10;
/// Opacity logit of the invisible splats: rounds to byte 0.
const INVISIBLE: f32 = -12.0;
const TIMES: [f32; 3] = [0.0, 0.5, 1.0];
const DOCUMENT: &str = "docs/INTEROP.md";
/// First heading of the hand-written part at the end of the document.
const BY_HAND: &str = "\n## SuperSplat's colour edits";

/// Tables of the document.
#[derive(Default)]
struct Tables {
    /// How `c4d` reads unedited frames that other tools wrote.
    read: Vec<String>,
    /// How other tools read frames that `c4d` wrote.
    written: Vec<String>,
    /// Clips as `.4dgs`, in both directions.
    clips: Vec<String>,
}

pub(crate) fn run(program: Option<PathBuf>) -> Result<()> {
    let root = workspace();
    let folder = root.join("target/interop");
    let files = folder.join("files");
    if files.exists() {
        fs::remove_dir_all(&files)?;
    }
    fs::create_dir_all(&files)?;
    let c4d = match program {
        Some(program) => std::path::absolute(program)?,
        None => build(&root)?,
    };
    let peers = Peer::install_all(&folder)?;
    let round_trips = RoundTrips { c4d, frames: source(&files)?, files };
    let mut tables = Tables::default();
    for peer in &peers {
        for format in peer.writes() {
            eprintln!("{} → c4d: {format}", peer.name());
            tables.read.push(round_trips.read(peer, format)?);
        }
        for (format, flags) in peer.reads() {
            eprintln!("c4d → {}: {format} {}", peer.name(), flags.join(" "));
            tables.written.push(round_trips.written(peer, format, flags)?);
        }
    }
    let usd = round_trips.usd(&folder)?;
    tables.clips = round_trips.fourdgs(&folder)?;
    let text = document(&peers, &tables, &usd);
    let before = fs::read_to_string(root.join(DOCUMENT)).context(DOCUMENT)?;
    let by_hand = before.find(BY_HAND).map_or("", |start| &before[start..]);
    fs::write(root.join(DOCUMENT), text + by_hand).context(DOCUMENT)?;
    eprintln!("wrote {DOCUMENT}");
    Ok(())
}

/// Builds `c4d` and returns its path.
fn build(root: &Path) -> Result<PathBuf> {
    let built = Command::new("cargo")
        .args(["build", "--release", "--quiet", "--package", "c4d-cli"])
        .current_dir(root)
        .env("CARGO_TARGET_DIR", root.join("target"))
        .status()?;
    if !built.success() {
        bail!("c4d does not build");
    }
    Ok(root.join("target/release/c4d"))
}

/// The scene, as a sequence of PLYs in `files/source`.
fn source(files: &Path) -> Result<Vec<Splats>> {
    let params = gs_synth::DemoParams {
        num_splats: SPLATS,
        sh_degree: 3,
        ..gs_synth::DemoParams::default()
    };
    let scene = gs_synth::demo(&params)?;
    let mut frames = Vec::new();
    let mut writer = FolderWriter::create(&files.join("source"), Existing::Refuse)?;
    for time in TIMES {
        let mut splats = scene.at(time)?;
        let coeffs = splats.sh_coeffs();
        // The generated scene has no harmonics above degree 1.
        for (i, rgb) in splats.sh.iter_mut().enumerate() {
            if i % coeffs >= 4 {
                *rgb = [0.0, 1.0, 2.0].map(|phase| 0.1 * (0.7 * i as f32 + phase).sin());
            }
        }
        if time == 0.0 {
            splats.opacity_logits.iter_mut().step_by(FADING).for_each(|logit| *logit = INVISIBLE);
        }
        writer.push(&splats, &WriteOptions::default())?;
        frames.push(splats);
    }
    writer.finish()?;
    Ok(frames)
}

impl RoundTrips {
    /// The first frame, written by a peer and used as an edit without changes.
    fn read(&self, peer: &Peer, format: &str) -> Result<String> {
        self.c4d(&["export", "source", "--time", "0", "-w", "-o", "frame.ply"])?;
        let file = format!("theirs{}", peers::ending(format));
        let row = |rest: String| format!("| {} | {format} | {rest} |", peer.name());
        if let Err(error) = peer.convert(&self.files, "frame.ply", &file, format) {
            return Ok(row(format!("cannot be written: {} | | | |", short(&error))));
        }
        let arguments =
            ["propagate", "source", "--edited", &file, "--no-refine", "-w", "-o", "run"];
        if let Err(error) = self.c4d(&arguments) {
            return Ok(row(format!("refused: {} | | | |", short(&error))));
        }
        let report: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(self.files.join("run/run.json"))?)?;
        let count = |name: &str| report["edited"][name].as_u64().unwrap_or_default();
        self.c4d(&["export", "run", "--to", "ply-seq", "--frames", "3", "-w", "-o", "out"])?;
        let last = frame::read_file(&self.files.join("out/frame_00002.ply"))?.splats;
        let off = difference(&self.frames[2], &last);
        Ok(row(format!(
            "{} | {} | {} | {}",
            count("unchanged"),
            count("recoloured"),
            count("edited"),
            off.text()
        )))
    }

    /// The first frame, written by `c4d` and converted to a PLY by a peer.
    fn written(&self, peer: &Peer, format: &str, flags: &[&str]) -> Result<String> {
        let file = format!("ours{}", peers::ending(format));
        let mut arguments = vec!["export", "source", "--time", "0", "-w", "-o", &file];
        arguments.extend(flags);
        self.c4d(&arguments)?;
        let flags =
            if flags.is_empty() { String::new() } else { format!(" `{}`", flags.join(" ")) };
        let row = |rest: String| format!("| {} | {format}{flags} | {rest} |", peer.name());
        let back = "back.ply";
        if let Err(error) = peer.convert(&self.files, &file, back, "ply") {
            return Ok(row(format!("cannot be read: {} | ", short(&error))));
        }
        let read = frame::read_file(&self.files.join(back))?.splats;
        let truth = &self.frames[0];
        let off = difference(truth, &read);
        let turned = Difference::of_half_turn(truth, &read);
        let text = if turned.position < 0.01 * off.position {
            format!("rotated by 180° about x; otherwise {}", turned.text())
        } else {
            off.text()
        };
        Ok(row(format!("{} | {text}", read.len())))
    }

    /// The clip as OpenUSD, evaluated by OpenUSD's own library.
    fn usd(&self, folder: &Path) -> Result<String> {
        self.c4d(&["export", "source", "--frames", "3", "-w", "-o", "ours.usda"])?;
        let script = include_str!("interop/usd.py");
        let output = python(folder).arg("-c").arg(script).current_dir(&self.files).output()?;
        if !output.status.success() {
            bail!("usd-core: {}", String::from_utf8_lossy(&output.stderr));
        }
        let mut worst = 0.0_f32;
        for (index, truth) in self.frames.iter().enumerate() {
            let read = frame::read_file(&self.files.join(format!("usd_{index}.ply")))?.splats;
            worst = worst.max(difference(truth, &read).position);
        }
        Ok(format!(
            "{SPLATS} splats, {} time samples, positions within {worst:.1e} of the scene's size; OpenUSD's own {} find no error",
            TIMES.len(),
            String::from_utf8_lossy(&output.stdout).trim()
        ))
    }
}

/// The first line of an error, short enough for a table.
fn short(error: &anyhow::Error) -> String {
    let text = format!("{error:#}").replace(['|', '\n'], " ");
    text.chars().take(120).collect()
}

fn document(peers: &[Peer], tables: &Tables, usd: &str) -> String {
    let names: Vec<String> = peers.iter().map(Peer::origin).collect();
    format!(
        "\
# Round trips with other tools

Written by `cargo xtask interop`. It installs the tools from their registries and therefore does not run in ordinary CI: {}, {} (PyPI), {} (PyPI).

The scene has {SPLATS} splats of SH degree {} and {} frames. One splat in {FADING} is invisible in the first frame and appears later.

## Frames that other tools write

The first frame, converted by the tool without an edit and given to `c4d propagate SCENE --edited FILE`. Unchanged splats move exactly and get
their original values back. Errors are the largest over all splats in the last frame of the result: positions as a share of the scene's
size, base colours in steps of 1/255.

| tool | format | unchanged | recoloured | edited | error of the last frame |
|---|---|---|---|---|---|
{}

## Frames that c4d writes

The first frame, exported by `c4d export` and converted to a PLY by the tool. Errors are the largest over all visible splats. Splats are
paired by position, so with a coarse format a splat may be paired with a neighbour.

| tool | format | splats | error |
|---|---|---|---|
{}

## OpenUSD

The clip as `.usda`, opened and evaluated by {}: {usd}.

## .4dgs

Clips written by one program and evaluated by the other, {}. The first clip is the scene, written with 9 frames; times are shares of the clip. 0.3 and 0.7
lie between frames: at these times, a splat that rotates or appears quickly has the rotation and opacity of the nearest frame. The other clips are written by the package: random splats with linear
motion, and the scene's frames as stored by its converter, which are invisible at both ends of the clip. Their reference is the package's evaluation of its own file. Missing
and extra splats are visible (opacity above half a step of 255) in only one of the programs; at 0.3, some missing splats are paired
with extra neighbours, which causes the large errors. Errors are the largest over all other splats: positions as a share of the scene's size, colours and opacities in steps of 1/255.

| file | time | splats | missing | extra | positions | colours | opacities | rotations | sizes |
|---|---|---|---|---|---|---|---|---|---|
{}
",
        names.join(", "),
        peers::usd(),
        peers::fourdgs(),
        3,
        TIMES.len(),
        tables.read.join("\n"),
        tables.written.join("\n"),
        peers::usd(),
        peers::fourdgs(),
        tables.clips.join("\n"),
    )
}
