//! Learned judges, which are separate programs: `--emit` writes their input, `--ingest` reads their
//! scores.

use crate::args::{Global, JudgeArg};
use crate::device::Device;
use crate::evaluation::{Viewpoints, sampled_frames};
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::output::{existing, output_failure};
use crate::renderer::Renderer;
use gs_core::{Camera, DynamicScene, Image};
use gs_io::AtomicDir;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Input of a judge.
pub(super) struct Case<'a> {
    pub(super) source: &'a dyn DynamicScene,
    pub(super) scene: &'a dyn DynamicScene,
    pub(super) at: &'a Viewpoints,
    pub(super) background: [f32; 3],
    pub(super) prompt: &'a str,
}

/// Writes pictures and `jobs.jsonl` into `folder`: pairs of frames for EditScore, two clips per
/// view for VE-Bench, as folders of numbered, lossless PNGs.
pub(super) fn emit(
    judge: JudgeArg,
    folder: &Path,
    case: &Case<'_>,
    global: &Global,
    device: &Device,
) -> Outcome<usize> {
    let out =
        AtomicDir::create(folder, existing(global)).map_err(|error| output_failure(&error))?;
    let chosen = match judge {
        JudgeArg::Editscore => sampled_frames(case.at.times.len()),
        JudgeArg::Vebench => (0..case.at.times.len()).collect(),
    };
    let names: Vec<String> = case.at.cameras.iter().map(file_name).collect();
    for side in ["src", "dst"] {
        for name in &names {
            let path = out.path().join(side).join(name);
            std::fs::create_dir_all(&path).map_err(|error| Failure::write(&path, &error))?;
        }
    }
    let (mut before, mut after) =
        (Renderer::new(device, case.background), Renderer::new(device, case.background));
    let mut jobs = Vec::new();
    for &frame in &chosen {
        before.seek(case.source, case.at.times[frame])?;
        after.seek(case.scene, case.at.times[frame])?;
        for (camera, name) in case.at.cameras.iter().zip(&names) {
            let file = format!("{name}/{frame:05}.png");
            write(&out.path().join("src").join(&file), &before.render(camera)?.rgb_image())?;
            write(&out.path().join("dst").join(&file), &after.render(camera)?.rgb_image())?;
            if judge == JudgeArg::Editscore {
                jobs.push(job(&format!("{name}/{frame:05}"), &file, case.prompt));
            }
        }
    }
    if judge == JudgeArg::Vebench {
        jobs.extend(names.iter().map(|name| job(name, name, case.prompt)));
    }
    let mut text = String::new();
    for job in &jobs {
        let _ = writeln!(text, "{job}");
    }
    let path = out.path().join("jobs.jsonl");
    std::fs::write(&path, text).map_err(|error| Failure::write(&path, &error))?;
    out.commit().map_err(|error| output_failure(&error))?;
    Ok(jobs.len())
}

fn job(id: &str, file: &str, prompt: &str) -> Value {
    json!({ "id": id, "src": format!("src/{file}"), "dst": format!("dst/{file}"), "prompt": prompt })
}

/// A view's name as a folder name.
fn file_name(camera: &Camera) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    camera.name.chars().map(safe).collect()
}

fn write(path: &Path, image: &Image) -> Outcome {
    let file = File::create(path).map_err(|error| Failure::write(path, &error))?;
    images::write_png(BufWriter::new(file), path, image)
}

/// Means of the scores in a file of lines `{"id": …, "scores": {NAME: NUMBER, …}}`.
pub(super) fn ingest(path: &Path) -> Outcome<Vec<Value>> {
    let refused = |line: usize, what: &str| {
        Failure::bad_input(format!("{}, line {line}: {what}", path.display()))
            .next(r#"Each line is {"id": "…", "scores": {"overall": 7.4, …}}, with the ids of jobs.jsonl."#)
    };
    let bytes = gs_io::read_file(path)
        .map_err(|error| Failure::bad_input(format!("cannot read {}: {error}", path.display())))?;
    let text = String::from_utf8(bytes).map_err(|_not_text| refused(1, "not UTF-8"))?;
    let mut seen = BTreeSet::new();
    let mut values: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
        let entry: Value =
            serde_json::from_str(line).map_err(|error| refused(number, &error.to_string()))?;
        let id = entry["id"].as_str().ok_or_else(|| refused(number, "has no id"))?;
        if !seen.insert(id.to_owned()) {
            return Err(refused(number, &format!("the id {id} occurs twice")));
        }
        let scores: &Map<String, Value> =
            entry["scores"].as_object().ok_or_else(|| refused(number, "has no scores"))?;
        for (name, score) in scores {
            let score = score
                .as_f64()
                .ok_or_else(|| refused(number, &format!("the score `{name}` is not a number")))?;
            values.entry(name.clone()).or_default().push(score);
        }
    }
    if values.is_empty() {
        return Err(refused(1, "the file has no scores"));
    }
    let summary = |(name, scores): (String, Vec<f64>)| {
        let count = scores.len() as f64;
        let mean = scores.iter().sum::<f64>() / count;
        let variance = scores.iter().map(|score| (score - mean).powi(2)).sum::<f64>() / count;
        json!({ "id": name, "value": mean, "std": variance.sqrt(), "count": scores.len() })
    };
    Ok(values.into_iter().map(summary).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_averaged_and_damaged_files_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scores.jsonl");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            ingest(&path)
        };
        let good = "{\"id\":\"a\",\"scores\":{\"overall\":6}}\n\n{\"id\":\"b\",\"scores\":{\"overall\":8}}\n";
        let found = read(good).unwrap();
        assert_eq!(found[0]["value"], 7.0, "mean");
        assert_eq!(found[0]["count"], 2, "of two");
        for bad in [
            "",
            "{",
            "{\"scores\":{\"overall\":6}}",
            "{\"id\":\"a\"}",
            "{\"id\":\"a\",\"scores\":{\"overall\":\"good\"}}",
            "{\"id\":\"a\",\"scores\":{\"x\":1}}\n{\"id\":\"a\",\"scores\":{\"x\":1}}",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
