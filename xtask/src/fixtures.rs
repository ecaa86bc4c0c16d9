//! Generated fixtures: a small synthetic scene, an edit of its first frame, and the ground truth.
//!
//! Goldens from reference implementations are not generated here; `fixtures/*/README.md` states
//! their origin.

use crate::workspace::workspace;
use anyhow::{Context, Result, bail};
use gs_core::{DynamicScene, Splats};
use gs_io::ply::{self, WriteOptions};
use std::fs;
use std::path::Path;

/// Number of splats of the fixture scene: few enough for the repository, enough to form a figure.
const SPLATS: usize = 1500;
/// Frames of the source sequence and of the ground truth.
const FRAMES: usize = 3;
/// Seed of scene and edit.
const SEED: u64 = 11;
/// Largest allowed difference between a stored and a regenerated value:
/// `sin` may round differently on another machine.
const TOLERANCE: f32 = 1e-5;

/// Writes `fixtures/synth`, or with `check` compares it with what would be written.
pub(crate) fn regenerate(check: bool) -> Result<()> {
    let folder = workspace().join("fixtures/synth");
    let mut differing = Vec::new();
    for (name, splats) in contents()? {
        let path = folder.join(&name);
        if check {
            if let Err(error) = compare(&path, &splats) {
                differing.push(format!("{}: {error:#}", path.display()));
            }
        } else {
            write(&path, &splats)?;
        }
    }
    if differing.is_empty() {
        return Ok(());
    }
    bail!("fixtures differ (run `cargo xtask regenerate-fixtures`):\n  {}", differing.join("\n  "))
}

/// File names under `fixtures/synth` and their splats.
fn contents() -> Result<Vec<(String, Splats)>> {
    let params = gs_synth::DemoParams {
        num_splats: SPLATS,
        seed: SEED,
        sh_degree: 0,
        ..gs_synth::DemoParams::default()
    };
    let scene = gs_synth::demo(&params)?;
    let edit = gs_synth::apply_edits(&scene, &gs_synth::demo_edits(), SEED)?;
    let mut files = vec![("edited.ply".to_owned(), edit.splats.clone())];
    for (frame, t) in scene.time_range().frames(FRAMES).into_iter().enumerate() {
        files.push((format!("source/frame_{frame:05}.ply"), scene.at(t)?));
        files.push((format!("truth/frame_{frame:05}.ply"), edit.truth.at(t)?));
    }
    Ok(files)
}

fn write(path: &Path, splats: &Splats) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let options = WriteOptions {
        normals: false,
        comments: vec!["c4d_up y".to_owned()],
        ..WriteOptions::default()
    };
    ply::write_file(path, splats, &options, gs_io::Existing::Replace)
        .with_context(|| format!("cannot write {}", path.display()))
}

fn compare(path: &Path, expected: &Splats) -> Result<()> {
    let found = ply::read_file(path)?.splats;
    if found.len() != expected.len() || found.sh_degree != expected.sh_degree {
        bail!(
            "{} splats of SH degree {}, expected {} of degree {}",
            found.len(),
            found.sh_degree,
            expected.len(),
            expected.sh_degree
        );
    }
    let arrays = [
        ("means", found.means.as_flattened(), expected.means.as_flattened()),
        ("quats", found.quats.as_flattened(), expected.quats.as_flattened()),
        ("log_scales", found.log_scales.as_flattened(), expected.log_scales.as_flattened()),
        ("opacity_logits", &found.opacity_logits, &expected.opacity_logits),
        ("sh", found.sh.as_flattened(), expected.sh.as_flattened()),
    ];
    for (name, found, expected) in arrays {
        let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0_f32, f32::max);
        if worst.is_nan() || worst > TOLERANCE {
            bail!("{name} differ by {worst:e}");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixtures_are_fresh() {
        regenerate(true).unwrap();
    }

    #[test]
    fn a_changed_fixture_is_found() {
        let (name, mut splats) = contents().unwrap().remove(0);
        let path = workspace().join("fixtures/synth").join(name);
        splats.means[3][1] += 1e-3;
        let error = compare(&path, &splats).unwrap_err().to_string();
        assert!(error.starts_with("means differ"), "{error}");
    }
}
