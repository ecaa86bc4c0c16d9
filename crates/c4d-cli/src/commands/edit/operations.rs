//! `c4d edit --select EXPR ACTION…`: a frame edited by selections and actions in order.

use super::picture::{self, Shown};
use super::record::{Record, RecordFile, RecordedStep};
use super::resources::{self, Input};
use super::style::ViewStyle;
use crate::args::{EditArgs, Global, Up};
use crate::console::Console;
use crate::device::{self, Device};
use crate::failure::{Failure, Outcome, chain};
use crate::output::{existing, output_failure, refuse_overlap};
use crate::scene::LoadedScene;
use crate::{frames, still};
use gs_core::Splats;
use gs_edit::{Action, EditError, Editor, Resources, Script, Step, Summary};
use gs_fit::FitError;
use gs_io::AtomicFile;
use gs_io::ply::comments;
use gs_io::ply::{self, WriteOptions};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Advice on the language of selections.
const LANGUAGE: &str =
    "c4d edit --help lists selections and actions; docs/EDITING.md describes them.";
/// Advice on valid inputs.
const INPUTS: &str = "Use a frame in any format, the folder of c4d freeze, or a scene with --time.";

/// Options, with replayed records inserted.
#[derive(Debug, Default)]
struct Plan {
    options: Vec<(String, String)>,
    /// Folders that are searched for files named in the options.
    folders: Vec<PathBuf>,
    /// Replayed records.
    records: Vec<PathBuf>,
    /// Time of the first replayed edit.
    time: Option<f32>,
}

pub(super) fn run(args: &EditArgs, global: &Global, console: &Console) -> Outcome {
    let plan = plan(args)?;
    let options = plan.options.iter().map(|(name, text)| (name.as_str(), text.as_str()));
    let script = Script::parse(options).map_err(|error| edit_failure(&error))?;
    check(args, &script)?;

    let path = frame_of_folder(&args.input);
    let opened = still::open(&path, args.axes, global, console)?;
    let time = args.time.or(plan.time).unwrap_or(opened.edit_time);
    frames::check(opened.scene.time_range(), time, "--time")?;
    let before = opened.scene.at(time).map_err(Failure::input)?;
    // Outputs that cannot be written are rejected before the work starts.
    let needs = script.needs();
    let mut inputs = resources::paths(&needs, &plan.folders)?;
    inputs.extend(opened.roots.iter().chain(&plan.records).cloned());
    let outputs = Outputs::create(args, &inputs, global)?;

    let input = Input { opened: &opened, time, splats: &before };
    let loaded = resources::load(&needs, input, &plan.folders, global, console)?;
    let style = script.steps.iter().any(|step| matches!(step, Step::Act(Action::Style { .. })));
    let style = style.then(|| {
        let up = args.up.map_or(opened.up, Up::vector);
        ViewStyle::new(&opened, up, Device::open(global.gpu)?, console)
    });
    let style = style.transpose()?;
    let edit = apply((&script, &plan.options), &before, (&loaded, style), args.stats, console)?;
    outputs.write(args, &opened, (&before, time), (&edit, &plan.folders), global, console)
}

fn plan(args: &EditArgs) -> Outcome<Plan> {
    let here = std::env::current_dir()
        .map_err(|error| Failure::failed(format!("the working folder cannot be read: {error}")))?;
    let mut plan = Plan { folders: vec![here], ..Plan::default() };
    for (name, text) in &args.operations.options {
        if name != "replay" {
            plan.options.push((name.clone(), text.clone()));
            continue;
        }
        let file = PathBuf::from(text);
        let record = Record::read(&file)?;
        plan.options.extend(record.steps.into_iter().map(|step| (step.option, step.argument)));
        plan.time = plan.time.or(Some(record.time));
        let own_folder = std::path::absolute(&file).map_err(Failure::failed)?;
        let own_folder = own_folder.parent().map(Path::to_owned);
        for folder in record.folders.into_iter().chain(own_folder) {
            if !plan.folders.contains(&folder) {
                plan.folders.push(folder);
            }
        }
        plan.records.push(file);
    }
    Ok(plan)
}

/// Rejects command lines that would do nothing, or discard the result.
fn check(args: &EditArgs, script: &Script) -> Outcome {
    if args.output.is_some() && args.output == args.preview {
        return Err(Failure::usage("-o and --preview name the same file")
            .next("Use a name that ends in .ply for -o and one that ends in .png for --preview."));
    }
    let acts = script.steps.iter().any(|step| matches!(step, Step::Act(_)));
    let looks = args.stats || args.preview.is_some();
    match (&args.output, acts) {
        (Some(_), false) => Err(Failure::usage("there is no action: -o would be a copy of the input")
            .next("Add an action, such as --hue 120 or --delete; or omit -o and use --stats or --preview LOOK.png.")),
        (None, true) if !looks => {
            Err(Failure::usage("no -o: the edit would be discarded").next("Add -o EDITED.ply."))
        }
        (None, false) if !looks => Err(Failure::usage("nothing to do: no selection, no action")
            .next("For example --select 'hue 200..260' --hue 120 -o EDITED.ply; --stats and --preview LOOK.png show a selection without editing.")),
        (Some(output), true) => match output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()) {
            Some(ending) if ending != "ply" => Err(Failure::usage(format!(
                "-o {}: the result is a 3DGS PLY, which keeps every value",
                output.display()
            ))
            .next("Choose a name that ends in .ply; c4d propagate reads it directly.")),
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

/// The frame in a folder of `c4d freeze`; other paths unchanged.
fn frame_of_folder(path: &Path) -> PathBuf {
    let frame = path.join("point_cloud.ply");
    if path.join("cameras.json").is_file() && frame.is_file() { frame } else { path.to_owned() }
}

/// An error of the editor, with advice.
fn edit_failure(error: &EditError) -> Failure {
    let text = chain(error);
    match error {
        EditError::Syntax { .. } | EditError::Modifier { .. } | EditError::Part { .. } => {
            Failure::usage(text).next(LANGUAGE)
        }
        EditError::UnknownAction(_) => Failure::bad_input(text).next(LANGUAGE),
        EditError::EmptySelection { .. } => Failure::usage(text).next(
            "--stats describes each selection, --preview LOOK.png shows it; neither needs -o.",
        ),
        EditError::NothingLeft(_) => {
            Failure::usage(text).next("Select fewer splats; --stats describes a selection.")
        }
        EditError::NotFinite { .. } => Failure::usage(text).next("Use smaller numbers."),
        EditError::Id { .. } => Failure::bad_input(text)
            .next("Rows are counted from 0 in the given file; c4d info shows their number."),
        EditError::EmptyImage(_) => {
            Failure::bad_input(text).next("Use a picture with opaque pixels.")
        }
        EditError::Style { source, .. } if let Some(FitError::Raster(error)) = source.downcast_ref() => {
            device::failure(error)
        }
        EditError::Style { .. } => Failure::bad_input(text).next(
            "Use a picture of at least 64×64 opaque pixels, and a larger selection; --match-colors IMAGE --sliced transfers colours only, also to broad splats.",
        ),
        EditError::Splats(_) => Failure::bad_input(text).next(INPUTS),
        _ => Failure::failed(text),
    }
}

/// Result of all steps.
#[derive(Debug)]
struct Edit {
    splats: Splats,
    steps: Vec<RecordedStep>,
    selections: Vec<Shown>,
    /// Index of the last selection that contained each splat of the input.
    marks: Vec<Option<usize>>,
}

fn apply(
    (script, options): (&Script, &[(String, String)]),
    before: &Splats,
    (loaded, mut style): (&Resources, Option<ViewStyle<'_>>),
    stats: bool,
    console: &Console,
) -> Outcome<Edit> {
    let mut editor = Editor::new(before.clone()).map_err(|error| edit_failure(&error))?;
    let mut edit = Edit {
        splats: Splats::default(),
        steps: Vec::new(),
        selections: Vec::new(),
        marks: vec![None; before.len()],
    };
    // `--sliced` is a separate option, but not a step.
    let mut steps = script.steps.iter();
    let mut statistics = Vec::new();
    for (option, argument) in options {
        if option != "sliced"
            && let Some(step) = steps.next()
        {
            let applied = match &mut style {
                Some(style) => editor.apply_with(step, loaded, style),
                None => editor.apply(step, loaded),
            };
            applied.map_err(|error| edit_failure(&error))?;
        }
        let selected = editor.selected().iter().filter(|&&selected| selected).count();
        edit.steps.push(RecordedStep {
            option: option.clone(),
            argument: argument.clone(),
            selected,
        });
        if option == "select" {
            console.detail(format!(
                "--select '{argument}': {selected} of {} splats",
                editor.splats().len()
            ));
            if stats {
                let summary = Summary::of(editor.splats(), editor.selected());
                report(argument, &summary, console);
                statistics.push(as_json(argument, &summary));
            }
            let number = edit.selections.len();
            edit.selections.push(Shown { text: argument.clone(), count: selected });
            let rows = editor.origins().iter().zip(editor.selected());
            for (origin, _) in rows.filter(|(_, selected)| **selected) {
                if let Some(origin) = origin {
                    edit.marks[*origin as usize] = Some(number);
                }
            }
        }
    }
    if stats {
        let all = vec![true; editor.splats().len()];
        let summary = Summary::of(editor.splats(), &all);
        report("all, after the edit", &summary, console);
        statistics.push(as_json("all", &summary));
        console.report(|| json!({ "statistics": statistics }));
    }
    edit.splats = editor.into_splats();
    Ok(edit)
}

fn report(name: &str, summary: &Summary, console: &Console) {
    let share = 100.0 * summary.selected as f64 / summary.total.max(1) as f64;
    console
        .result(format!("{name}: {} of {} splats, {share:.1} %", summary.selected, summary.total));
    let Some((low, high)) = summary.bounds else { return };
    let point = |p: [f64; 3]| p.map(rounded).join(",");
    console.result(format!(
        "  box {},{}  center {}",
        point(low),
        point(high),
        point(summary.center)
    ));
    let range = |[low, middle, high]: [f64; 3]| {
        format!("{} .. {} .. {}", rounded(low), rounded(middle), rounded(high))
    };
    console.result(format!(
        "  size {}  opacity {}  (10th, 50th and 90th percentile)",
        range(summary.size),
        range(summary.opacity)
    ));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let [r, g, b] = summary.color.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8);
    let hue = summary.hue.map_or_else(|| "grey".to_owned(), |hue| format!("hue {hue:.0}"));
    console.result(format!("  color #{r:02x}{g:02x}{b:02x}, {hue}"));
}

fn as_json(selection: &str, summary: &Summary) -> Value {
    json!({
        "selection": selection,
        "selected": summary.selected,
        "total": summary.total,
        "bounds": summary.bounds,
        "center": summary.center,
        "opacity": summary.opacity,
        "size": summary.size,
        "color": summary.color,
        "hue": summary.hue,
    })
}

/// Four significant digits, in the syntax of the expressions.
fn rounded(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { 3.0 - value.abs().log10().floor() };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 9")]
    let digits = digits.clamp(0.0, 9.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Output files, created on commit.
#[derive(Debug)]
struct Outputs {
    frame: Option<(AtomicFile, PathBuf, RecordFile)>,
    picture: Option<(AtomicFile, PathBuf)>,
}

impl Outputs {
    fn create(args: &EditArgs, inputs: &[PathBuf], global: &Global) -> Outcome<Self> {
        let existing = existing(global);
        let create = |path: &Path| {
            refuse_overlap(path, inputs)?;
            AtomicFile::create(path, existing).map_err(|error| output_failure(&error))
        };
        let frame = match &args.output {
            Some(path) => {
                let file = create(path)?;
                Some((file, path.clone(), RecordFile::create(path, existing)?))
            }
            None => None,
        };
        let picture = match &args.preview {
            Some(path) => Some((create(path)?, path.clone())),
            None => None,
        };
        Ok(Self { frame, picture })
    }

    fn write(
        self,
        args: &EditArgs,
        opened: &LoadedScene,
        (before, time): (&Splats, f32),
        (edit, folders): (&Edit, &[PathBuf]),
        global: &Global,
        console: &Console,
    ) -> Outcome {
        if let Some((file, path)) = self.picture {
            let device = Device::open(global.gpu)?;
            let up = args.up.map_or(opened.up, Up::vector);
            let shown = (edit.marks.as_slice(), edit.selections.as_slice());
            let image = picture::draw(opened, up, (before, &edit.splats), shown, &device)?;
            picture::write(file, &path, &image)?;
            console.output(&path, &[]);
        }
        let Some((mut file, path, record_file)) = self.frame else { return Ok(()) };
        let options = WriteOptions { comments: comments(opened, time), ..WriteOptions::default() };
        ply::write(&edit.splats, &options, &mut file)
            .map_err(|error| Failure::write(&path, &error))?;
        let input = std::path::absolute(&args.input).map_err(Failure::failed)?;
        let mut record = Record::new(input, time, before.len(), folders.to_vec());
        record.num_edited = edit.splats.len();
        record.steps.clone_from(&edit.steps);
        file.commit().map_err(|error| output_failure(&error))?;
        record_file.write(&record)?;
        console.report(|| json!(record));
        if !opened.kind.is_frame() {
            console.note(format!(
                "next: c4d propagate {} --edited {} --time {time} -o RUN",
                args.input.display(),
                path.display()
            ));
        }
        console.output(&path, &[("splats", edit.splats.len())]);
        Ok(())
    }
}

/// Comments of the result: those of an input PLY (such as the time of the frame), else time and
/// upward axis.
fn comments(opened: &LoadedScene, time: f32) -> Vec<String> {
    let frame = opened.files.first().filter(|_| opened.kind.is_frame());
    if let Some(header) = frame.and_then(|file| ply::read_header_file(file).ok()) {
        return header.comments;
    }
    let time = (!opened.kind.is_frame()).then(|| format!("{}{time}", comments::TIME));
    time.into_iter().chain(comments::up_comments(opened.up)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        for (value, text) in
            [(0.0, "0"), (1.0, "1"), (-0.123_456, "-0.1235"), (12_345.6, "12346"), (1e-12, "0")]
        {
            assert_eq!(rounded(value), text, "{value}");
        }
    }
}
