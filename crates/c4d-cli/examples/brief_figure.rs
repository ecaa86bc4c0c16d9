//! Writes, as frames, a dancer whose splats are visible for a part of the clip, and an edit of the
//! splats that its first frame shows: another jacket, a hat, or a removed forearm.
//!
//! ```text
//! cargo run --release --example brief_figure -- brief 6000
//! c4d propagate brief/source --edited brief/recolour.ply -o run --no-refine
//! ```

use gs_io::ply::comments::up_comments;
use gs_io::ply::{self, WriteOptions};
use gs_io::{Existing, ply_sequence};
use gs_synth::{ShortLivedCase, ShortLivedParams, build_short_lived};
use std::error::Error;
use std::path::PathBuf;

/// Frames of the clip: several within the lifetime of every splat.
const FRAMES: usize = 41;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = PathBuf::from(args.next().ok_or("usage: brief_figure FOLDER [SPLATS]")?);
    let num_splats = args.next().map_or(Ok(6_000), |count| count.parse())?;
    let params =
        ShortLivedParams { num_splats, lifetimes: [0.1, 0.3], ..ShortLivedParams::default() };
    std::fs::create_dir_all(&folder)?;
    let options =
        WriteOptions { comments: up_comments([0.0, 1.0, 0.0]), ..WriteOptions::default() };
    let edits = [
        (ShortLivedCase::Recolour, "recolour.ply"),
        (ShortLivedCase::Delete, "delete.ply"),
        (ShortLivedCase::Hat, "hat.ply"),
    ];
    for (case, name) in edits {
        let scene = build_short_lived(case, &params)?;
        if case == ShortLivedCase::Recolour {
            let times = gs_core::TimeRange::UNIT.frames(FRAMES);
            let source = folder.join("source");
            let existing = Existing::Replace;
            ply_sequence::write_folder(
                &source,
                &scene.source,
                &times,
                &options,
                existing,
                &mut |_| {},
            )?;
        }
        ply::write_file(&folder.join(name), &scene.edited, &options, Existing::Replace)?;
    }
    Ok(())
}
