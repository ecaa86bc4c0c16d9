//! Measures one run.

use crate::args::{EvalArgs, Global, MeasureFlags};
use crate::console::Console;
use crate::device::Device;
use crate::evaluation::{
    self, Group, Header, Item, Networks, Photos, Prompts, Sight, Subject, Truth, ViewFlags,
    Viewpoints, document,
};
use crate::failure::{Failure, Outcome};
use crate::part::{PartRecord, Share};
use crate::run_folder::{REFINE_REPORT, REPORT, RunFiles, SCENE, fingerprint};
use crate::scene::LoadedScene;
use crate::{frames, memory, still};
use gs_io::SceneKind;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Memory per view, bytes per pixel: pictures of two scenes at two times, flows, and sums over
/// time.
const BYTES_PER_PIXEL: u64 = 192;

/// The flags about views and times.
pub(super) fn view_flags(flags: &MeasureFlags) -> ViewFlags<'_> {
    ViewFlags {
        cameras: flags.cameras.as_deref(),
        views: &flags.views,
        split: flags.split,
        size: flags.size,
        up: flags.up,
        frames: flags.frames,
        times: &flags.times,
    }
}

/// Results of a measurement.
pub(crate) struct Evaluated {
    /// The contents of `metrics.json`.
    pub(crate) document: Value,
    pub(crate) items: Vec<Item>,
}

/// Metrics to measure, and their inputs.
pub(crate) struct Wanted<'a> {
    /// Ids of metrics.
    ids: Vec<&'static str>,
    /// Networks of the neural metrics.
    networks: Networks,
    prompts: Prompts<'a>,
}

impl<'a> Wanted<'a> {
    /// The requested metrics; by default the core set, or all if weights are given.
    pub(super) fn of(args: &'a EvalArgs, console: &Console) -> Outcome<Self> {
        let all = ["all".to_owned()];
        let list = match &args.weights {
            Some(_) if args.metrics.is_empty() => &all[..],
            _ => &args.metrics,
        };
        let networks = match &args.weights {
            Some(folder) => Networks::open(folder, console)?,
            None => Networks::default(),
        };
        let prompts =
            Prompts { edit: args.prompt.as_deref(), source: args.source_prompt.as_deref() };
        Ok(Self { ids: evaluation::chosen(list)?, networks, prompts })
    }

    /// The core metrics.
    pub(crate) fn core() -> Outcome<Self> {
        let (networks, prompts) = (Networks::default(), Prompts::default());
        Ok(Self { ids: evaluation::chosen(&[])?, networks, prompts })
    }
}

/// Measures the `wanted` metrics of `run`, on all views or on those in `share`.
pub(crate) fn evaluate(
    run: &Path,
    args: &MeasureFlags,
    wanted: &Wanted<'_>,
    share: Option<Share>,
    global: &Global,
    console: &Console,
) -> Outcome<Evaluated> {
    let opened = still::open(run, None, global, console)?;
    memory::require_frames(opened.scene.as_ref(), 2 * memory::FRAMES_SEEN)?;
    let files = match opened.kind {
        SceneKind::RunFolder => Some(RunFiles::read(run)?),
        _ => None,
    };
    if files.is_none() && args.truth.is_none() {
        console.note(format!(
            "{} is not a run: it has no edit to measure, and no --truth is given",
            run.display()
        ));
    }
    let at = evaluation::viewpoints(&view_flags(args), &opened, console)?;
    let truth = match &args.truth {
        Some(path) => Some(truth(path, &at, global, console)?),
        None => None,
    };
    let all = at.cameras.len();
    let cameras = &at.cameras[share.map_or(0..all, |share| share.range(all))];
    let pixels: u64 =
        cameras.iter().map(|camera| u64::from(camera.width) * u64::from(camera.height)).sum();
    memory::require(
        &format!("measuring {} views", cameras.len()),
        pixels * BYTES_PER_PIXEL,
        "Use a smaller --size or fewer --views.",
    )?;
    let device = Device::open(global.gpu)?;
    console.detail(format!("rendering on {}", device.describe()));
    let edited = match (&opened.original, &files) {
        (Some(source), Some(files)) => {
            Some((source.as_ref(), &files.stored.edited, &files.stored.binding))
        }
        _ => None,
    };
    let subject = Subject::new(opened.scene.as_ref(), edited, opened.edit_time)?;
    let background = args.background.unwrap_or(opened.background);
    // The first part measures the metrics that do not depend on views.
    let is_first = share.is_none_or(|share| share.part == 1);
    let is_wanted = |group: Group| {
        (is_first || group.is_of_views())
            && evaluation::DEFINITIONS
                .iter()
                .any(|d| d.group == group && wanted.ids.contains(&d.id))
    };
    let mut items: Vec<Item> = Vec::new();
    let mut sight = Sight {
        subject: &subject,
        cameras,
        times: &at.times,
        background,
        truth: truth.as_ref().map(|truth| match truth {
            Known::Scene(opened) => Truth::scene(opened.scene.as_ref(), &device, background),
            Known::Photos(photos) => Truth::Photos(photos),
        }),
        retouch: None,
        console,
    };
    if [Group::Truth, Group::Preservation, Group::Time].into_iter().any(is_wanted) {
        items.extend(evaluation::pictures(&mut sight, &device)?);
    }
    if is_wanted(Group::Neural) {
        let Wanted { networks, prompts, .. } = wanted;
        items.extend(evaluation::neural(&mut sight, &device, networks, *prompts)?);
    }
    if is_wanted(Group::Motion) {
        items.extend(evaluation::motion(&subject, &at.times)?);
    }
    let report = |name: &str| files.as_ref().map_or(Value::Null, |_| read_json(&run.join(name)));
    let record = report(REPORT);
    if is_wanted(Group::Matches) {
        items.extend(evaluation::matches(&subject, &record)?);
    }
    if is_wanted(Group::Cost) {
        let bytes = std::fs::metadata(run.join(SCENE)).ok().map(|metadata| metadata.len());
        items.extend(evaluation::cost(&subject, &record, &report(REFINE_REPORT), bytes));
    }
    items.retain(|item| wanted.ids.contains(&item.definition.id));
    items.sort_by_key(|item| wanted.ids.iter().position(|id| *id == item.definition.id));
    let header = Header {
        scene: run.display().to_string(),
        edit: files.as_ref().map(|files| files.config.edited_sha256.clone()),
        cameras,
        origin: at.origin.clone(),
        times: &at.times,
        edit_time: opened.edit_time,
        background,
        truth: args.truth.as_ref().map(|path| path.display().to_string()),
        renderer: match device {
            Device::Cpu => "cpu",
            #[cfg(feature = "gpu")]
            Device::Gpu(_) => "gpu",
        },
    };
    console.note(format!(
        "{} frames, {} views ({})",
        at.times.len(),
        cameras.len(),
        cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>().join(", ")
    ));
    let mut document = document(&header, &items);
    if let Some(share) = share {
        let whole = Header { cameras: &at.cameras, ..header.clone() };
        let truth = match &truth {
            Some(Known::Scene(opened)) => Some(fingerprint(&opened.files)?),
            _ => None,
        };
        let files = [("scene", json!(fingerprint(&opened.files)?)), ("truth", json!(truth))];
        document[PartRecord::KEY] = json!(PartRecord::new(share, work(&whole, wanted, files)));
    }
    Ok(Evaluated { document, items })
}

/// Everything on which the metrics depend; `files` are fingerprints.
fn work(header: &Header<'_>, wanted: &Wanted<'_>, files: [(&str, Value); 2]) -> Map<String, Value> {
    let mut all = document(header, &[]);
    let facts = [
        ("command", json!("eval")),
        ("cameras", all["views"].take()),
        ("times", all["times"].take()),
        ("background", json!(header.background)),
        ("truth's path", json!(header.truth)),
        ("metrics", json!(wanted.ids)),
        ("weights", json!(wanted.networks.files())),
        ("prompts", json!([wanted.prompts.edit, wanted.prompts.source])),
        ("renderer", json!(header.renderer)),
    ];
    facts.into_iter().chain(files).map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Ground truth.
enum Known {
    Scene(Box<LoadedScene>),
    Photos(Photos),
}

fn truth(path: &Path, at: &Viewpoints, global: &Global, console: &Console) -> Outcome<Known> {
    if !path.exists() {
        return Err(Failure::bad_input(format!(
            "--truth {}: no such file or folder",
            path.display()
        )));
    }
    if evaluation::is_video(path) {
        return Err(Failure::usage(format!("--truth {}: a compressed video", path.display()))
            .next(
                "Its compression changes what is measured. Use the frames as PNG, or the scene.",
            ));
    }
    let kind = gs_io::detect(path).map_err(|error| crate::scene::bad_input(&error))?;
    let shows = matches!(kind, SceneKind::Cameras(_) | SceneKind::Unknown { .. });
    if shows && evaluation::holds_images(path) {
        if at.path.is_none() {
            return Err(Failure::usage(
                "--truth refers to photographs, but no views are specified",
            )
            .next("Add --cameras with the data set."));
        }
        let photos = Photos::find(path, &at.timed_cameras)?;
        console.note(format!("{} photographs in {}", photos.len(), path.display()));
        return Ok(Known::Photos(photos));
    }
    let source = Global { iteration: None, set: Vec::new(), ..global.clone() };
    let opened = still::open(path, None, &source, console)?;
    // A single frame is the ground truth at all times.
    if !opened.kind.is_frame() {
        for &t in &at.times {
            frames::check(opened.scene.time_range(), t, "--truth: time")?;
        }
    }
    Ok(Known::Scene(Box::new(opened)))
}

/// A report of a run; `Null` if it is missing or not JSON.
fn read_json(path: &Path) -> Value {
    let bytes = gs_io::read_file(path).ok();
    bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or(Value::Null)
}
