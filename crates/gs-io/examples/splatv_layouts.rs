//! Writes a `.splatv` as PLY of Spacetime Gaussians (exact) and of FreeTimeGS (each splat on its
//! tangent): `cargo run --example splatv_layouts -- CLIP.splatv FOLDER`.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "converters of tests store single precision and bytes"
)]
#![allow(clippy::unwrap_used, dead_code, reason = "shared with tests, which fail by panicking")]

#[path = "../tests/suite/common/layouts.rs"]
mod layouts;

use gs_io::repair::Damage;
use gs_io::splatv;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(clip), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err("usage: splatv_layouts CLIP.splatv FOLDER".into());
    };
    let scene = splatv::open(&clip, Damage::Drop)?.scene;
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("spacetime.ply"), layouts::spacetime(&scene))?;
    std::fs::write(folder.join("freetime.ftgs.ply"), layouts::freetime_ply(&scene))?;
    std::fs::write(folder.join("freetime.pt"), layouts::freetime_checkpoint(&scene))?;
    Ok(())
}
