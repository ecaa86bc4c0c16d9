//! `c4d info`: shows what a path is, what is missing, and what to do with it.

mod unsupported_files;

use crate::args::{AxesArg, Global, InfoArgs};
use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use crate::lifetimes::Lifetimes;
use crate::scene::{self, LoadedScene};
use crate::suggestion::{self, Needed};
use gs_core::sh::C0;
use gs_core::{Precision, RowPrecision, Splats, nearest_rank};
use gs_io::SceneKind;
use gs_io::cameras::{self, Reading, Split};
use gs_io::frame::FrameFormat;
use gs_io::repair::{self, Damage};
use serde_json::{Value, json};
use std::path::Path;

/// Number of image sizes listed.
const SIZES: usize = 6;
/// Largest number of folder entries examined.
const MAX_PARTS: usize = 64;

pub(crate) fn run(args: &InfoArgs, global: &Global, console: &Console) -> Outcome {
    // The next step must not be `c4d info` again.
    report(args, global, console).map_err(|failure| match failure.next {
        Some(_) => failure,
        None => failure.next(READS),
    })
}

/// Supported inputs.
const READS: &str = "c4d reads 4DGS model folders (point_cloud/iteration_N with point_cloud.ply and deformation.pth), Swift4D model folders (the same with FDHash.pth), model folders of Deformable-3D-Gaussians, SC-GS, Grid4D and DASH (deform/iteration_N/deform.pth next to point_cloud) and E-D3DGS, checkpoints of native 4D Gaussians (chkpnt*.pth) and FreeTimeGS (.pt, .ftgs.ply), PLYs of Spacetime Gaussians, params.npz of Dynamic 3D Gaussians, numbered frames in a folder or zip archive, .splatv, .splat4d, .4dgs and .tsog clips, single frames (PLY, compressed PLY, .splat, .spz, .sog, .glb, or the folder of a 3DGS model), its own runs, and cameras of data sets.";

/// Next step for a PLY that is not a Gaussian scene.
const OTHER_PLY: &str = "Export a PLY of 3D Gaussians from the program that made this one, or \
                        copy the file again if it is truncated.";

fn report(args: &InfoArgs, global: &Global, console: &Console) -> Outcome {
    let path = &args.path;
    if !path.exists() {
        return Err(Failure::bad_input(format!("{} does not exist", path.display()))
            .next("Check the name; paths are relative to the current folder."));
    }
    let kind = gs_io::detect(path).map_err(|error| scene::bad_input(&error))?;
    let report = match &kind {
        _ if kind.is_frame() => frame(path, &kind, args.axes)?,
        _ if kind.is_dynamic() || kind == SceneKind::RunFolder => {
            dynamic(&scene::open(path, global, console)?)?
        }
        SceneKind::Cameras(_) if path.is_dir() && path.join("cameras.json").is_file() => {
            match parts(path) {
                parts if parts.len() > 1 => folder(path, &parts),
                _ => camera_set(path)?,
            }
        }
        SceneKind::Cameras(_) => camera_set(path)?,
        SceneKind::Unknown { .. } if path.is_dir() && !parts(path).is_empty() => {
            folder(path, &parts(path))
        }
        SceneKind::Unknown { .. } if is_json(path) => camera_set(path)?,
        SceneKind::Unsupported(format) => {
            let mut report = InfoReport::new(path, &kind);
            report.add("next", json!(within(path).unwrap_or_else(|| format.next.to_owned())));
            report
        }
        other => {
            if let Some((lines, next)) = unsupported_files::of_folder(path) {
                show(&unsupported_report(path, &lines, next), console);
                return Ok(());
            }
            let failure = Failure::bad_input(format!("{}: {other}", path.display()));
            let inside = || suggestion::for_path(path, Needed::Scene).filter(|_| path.is_dir());
            return Err(match (within(path).or_else(inside), other) {
                (Some(next), _) => failure.next(next),
                (None, SceneKind::OtherPly(_)) => failure.next(OTHER_PLY),
                (None, _) => failure,
            });
        }
    };
    show(&report, console);
    Ok(())
}

fn show(report: &InfoReport, console: &Console) {
    console.report(|| report.json());
    console.result(report.text());
}

/// Next step for a file that is part of a known folder.
fn within(path: &Path) -> Option<String> {
    /// Folders between a model or data set and its innermost files.
    const DEPTH: usize = 4;
    let path = path.canonicalize().ok().filter(|path| path.is_file())?;
    let known = |folder: &&Path| {
        gs_io::detect(folder).is_ok_and(|kind| {
            let named = matches!(kind, SceneKind::RunFolder | SceneKind::Cameras(_));
            named || kind.is_trained()
        })
    };
    let folder = path.ancestors().skip(1).take(DEPTH).filter(known).last()?;
    let kind = gs_io::detect(folder).ok()?;
    Some(match kind {
        SceneKind::Cameras(_) => format!(
            "Cameras ({kind}) are next to it: c4d info {} shows the folder.",
            folder.display()
        ),
        _ => format!("It is part of a {kind}: c4d info {}.", folder.display()),
    })
}

/// Whether a report may have several entries with this name.
fn is_list(name: &str) -> bool {
    matches!(name, "flag" | "note" | "holds")
}

/// Entries in display order.
#[derive(Default)]
struct InfoReport {
    lines: Vec<(String, Value)>,
}

impl InfoReport {
    fn new(path: &Path, kind: &SceneKind) -> Self {
        let mut report = Self { lines: Vec::new() };
        report.add("path", json!(path.display().to_string()));
        report.add("kind", json!(kind.to_string()));
        report
    }

    fn add(&mut self, name: &str, value: Value) {
        self.lines.push((name.to_owned(), value));
    }

    fn json(&self) -> Value {
        let mut object = serde_json::Map::new();
        for (name, value) in &self.lines {
            // Entries that may occur several times become a list.
            match object.get_mut(name) {
                Some(Value::Array(list)) if is_list(name) => list.push(value.clone()),
                Some(other) => *other = value.clone(),
                None if is_list(name) => {
                    object.insert(name.clone(), json!([value]));
                }
                None => {
                    object.insert(name.clone(), value.clone());
                }
            }
        }
        Value::Object(object)
    }

    fn text(&self) -> String {
        let line = |(name, value): &(String, Value)| {
            let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            format!("{name:<12} {value}")
        };
        self.lines.iter().map(line).collect::<Vec<_>>().join("\n")
    }
}

fn frame(path: &Path, kind: &SceneKind, axes: Option<AxesArg>) -> Outcome<InfoReport> {
    let mut frame = gs_io::frame::read_file(path).map_err(|error| scene::bad_input(&error))?;
    if let Some(axes) = axes {
        frame = frame.in_axes(axes.axes());
    }
    let mut report = InfoReport::new(path, kind);
    let file = gs_io::frame::file_of(path);
    if file != path {
        report.add("file", json!(file.display().to_string()));
    }
    if let FrameFormat::Ply { encoding, normals } = frame.format {
        report.add("encoding", json!(format!("{encoding:?}")));
        report.add("normals", json!(normals));
    } else {
        report.add("format", json!(frame.format.to_string()));
    }
    if let Some(reading) = &frame.axes {
        let assumed = reading.assumption().map(|text| format!("{text}; --axes chooses others"));
        let text = assumed.unwrap_or_else(|| reading.axes.to_string());
        report.add("axes", json!(text));
    }
    for note in &frame.notes {
        report.add("note", json!(note));
    }
    if let Some(precision) = &frame.precision {
        report.add("precision", json!(precision_of(precision, frame.splats.len())));
    }
    describe(&mut report, frame.splats);
    report.add(
        "next",
        json!(format!(
            "As an edited frame: c4d propagate SCENE --edited {} -o RUN. As a scene it is static.",
            path.display()
        )),
    );
    Ok(report)
}

/// Median precision of the values of a frame.
fn precision_of(precision: &Precision, rows: usize) -> String {
    let median = |of: fn(&RowPrecision) -> f32| {
        let mut values: Vec<f32> = (0..rows).map(|row| of(precision.of(row))).collect();
        nearest_rank(&mut values, 0.5).unwrap_or_default()
    };
    let mean = median(|row| row.means.into_iter().fold(0.0, f32::max));
    let size = median(|row| row.log_scales.into_iter().fold(0.0, f32::max));
    let angle = median(|row| row.rotation_rad).to_degrees();
    let positions =
        if mean > 0.0 { format!("within {mean:.1e} units") } else { "exact".to_owned() };
    let sizes = if size > 0.0 {
        format!("within {:.1} %", 100.0 * size.exp_m1())
    } else {
        "exact".to_owned()
    };
    let steps = |of: fn(&RowPrecision) -> f32| format!("{:.1}", 255.0 * median(of));
    let opacity = steps(|row| row.opacity);
    let color = steps(|row| C0 * row.sh_dc.into_iter().fold(0.0, f32::max));
    format!(
        "median: positions {positions}, sizes {sizes}, rotations within {angle:.1}°, opacities within {opacity} and base colours within {color} of 255 steps"
    )
}

/// Cameras of a data set: numbers, times, sizes, and assumptions.
fn camera_set(path: &Path) -> Outcome<InfoReport> {
    let set = cameras::open(path, Reading::Trained).map_err(|error| scene::bad_input(&error))?;
    let mut report = InfoReport::new(path, &SceneKind::Cameras(set.format));
    if set.path != path {
        report.add("data set", json!(set.path.display().to_string()));
    }
    report.add("views", json!(set.views.len()));
    report.add("cameras", json!(set.distinct_cameras().len()));
    for (name, split) in [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)] {
        let count = set.split(split).count();
        if count > 0 {
            report.add(name, json!(count));
        }
    }
    match set.times().as_slice() {
        [] => report.add("times", json!("none: each camera can be used at any time")),
        [only] => report.add("times", json!([short(*only)])),
        [first, .., last] => {
            report.add("times", json!([short(*first), short(*last)]));
            report.add("instants", json!(set.times().len()));
        }
    }
    let sizes: Vec<String> = set.sizes().iter().map(|(w, h)| format!("{w}×{h}")).collect();
    let more = sizes.len().saturating_sub(SIZES);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    report.add("sizes", json!(format!("{}{more}", sizes[..sizes.len().min(SIZES)].join(", "))));
    if !set.video.is_empty() {
        report.add("path", json!(format!("{} cameras (--split path)", set.video.len())));
    }
    for note in &set.notes {
        report.add("note", json!(note));
    }
    report.add(
        "next",
        json!("c4d render SCENE --cameras PATH -o images, with this path and the model trained on it; c4d refine RUN --refine-cameras PATH."),
    );
    Ok(report)
}

/// The double with the same decimal representation as the single.
fn short(time: f32) -> f64 {
    time.to_string().parse().unwrap_or(f64::from(time))
}

/// Whether a file seems to be JSON; a malformed one is opened to report the position of the error.
fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// Readable entries of a folder.
fn parts(path: &Path) -> Vec<(String, SceneKind)> {
    let Ok(entries) = std::fs::read_dir(path) else { return Vec::new() };
    let mut entries: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    entries.sort();
    let known = |path: &std::path::PathBuf| {
        let kind = gs_io::detect(path).ok()?;
        let unknown = matches!(
            kind,
            SceneKind::Unknown { .. } | SceneKind::OtherPly(_) | SceneKind::Unsupported(_)
        );
        (!unknown).then(|| (path.file_name().unwrap_or_default().to_string_lossy().into(), kind))
    };
    entries.iter().take(MAX_PARTS).filter_map(known).collect()
}

fn unsupported_report(path: &Path, lines: &[String], next: &str) -> InfoReport {
    let mut report = InfoReport::default();
    report.add("path", json!(path.display().to_string()));
    report.add("kind", json!("folder with no supported files"));
    for line in lines {
        report.add("holds", json!(line));
    }
    report.add("next", json!(next));
    report
}

fn folder(path: &Path, parts: &[(String, SceneKind)]) -> InfoReport {
    let mut report = InfoReport::default();
    report.add("path", json!(path.display().to_string()));
    let several = parts.len() > 1;
    report.add("kind", json!(if several { "folder with several inputs" } else { "folder" }));
    for (name, kind) in parts {
        report.add("holds", json!(format!("{name}: {kind}")));
    }
    let sorted_anew = parts.len() > 1 && parts.iter().all(|(_, kind)| *kind == SceneKind::Sog);
    report.add(
        "next",
        json!(if sorted_anew {
            "Each file is a separate frame: SOG sorts the splats of every frame separately, so \
            rows do not persist. Export the sequence as PLY."
        } else {
            "Run c4d info on one of these paths for details, and use that path in other commands."
        }),
    );
    report
}

fn dynamic(opened: &LoadedScene) -> Outcome<InfoReport> {
    let mut report = InfoReport::new(&opened.path, &opened.kind);
    for (name, value) in &opened.facts {
        // Counts are numbers in JSON.
        let number =
            value.parse::<u64>().map_or_else(|_not_a_count| json!(value), |count| json!(count));
        report.add(name, number);
    }
    let range = opened.scene.time_range();
    report.add("times", json!([range.start, range.end]));
    if let Some(frames) = opened.scene.num_frames().filter(|_| opened.kind == SceneKind::Swift4d) {
        report.add("frames", json!(frames));
    }
    let splats = opened.scene.at(range.start).map_err(Failure::input)?;
    describe(&mut report, splats);
    if let Some(lifetimes) = Lifetimes::of(&*opened.scene, opened.edit_time)? {
        report.add("visible", json!(lifetimes.describe()));
    }
    report.add("up", json!(opened.up));
    if opened.kind.is_trained() && opened.path.is_dir() {
        report.add("cameras", json!(cameras_of_model(&opened.path)));
    }
    report.add(
        "next",
        json!("c4d freeze SCENE -o DIR writes the frame to edit; c4d render SCENE -o clip.mp4 shows it."),
    );
    Ok(report)
}

/// Source of a model's cameras.
fn cameras_of_model(path: &Path) -> String {
    match cameras::find(path) {
        Ok(Some(source)) => {
            format!("{} in {} (for --cameras)", source.format, source.root.display())
        }
        Ok(None) => "none: cameras around the scene are used instead".to_owned(),
        Err(error) => format!("none, a rig is used instead: {}", chain(&error)),
    }
}

fn describe(report: &mut InfoReport, splats: Splats) {
    report.add("splats", json!(splats.len()));
    report.add("sh_degree", json!(splats.sh_degree));
    if let Some((min, max)) = splats.bounds() {
        report.add("bounds", json!([min, max]));
    }
    let damaged = match repair::sanitize(splats, Damage::Drop) {
        Ok(sanitized) => sanitized.report,
        Err(all) => {
            report.add("damaged", json!(all.to_string()));
            return;
        }
    };
    if let Some(note) = damaged.infinities.note() {
        report.add("note", json!(note));
    }
    let rows = damaged.damaged();
    if rows > 0 {
        report.add(
            "damaged",
            json!(format!(
                "{rows} rows ({} not finite, {} with a zero quaternion): dropped on use, refused under --strict",
                damaged.not_finite, damaged.zero_quaternion
            )),
        );
    }
}
