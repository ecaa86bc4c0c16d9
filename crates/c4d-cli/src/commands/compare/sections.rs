//! Pictures, curves and tables of a comparison.

use super::numbers::Numbers;
use crate::device::Device;
use crate::evaluation::{DEFINITIONS, Definition, Group, best, number};
use crate::failure::Outcome;
use crate::renderer::Renderer;
use crate::report::{Curve, Plot, Triple, escape, wipe};
use crate::scene::LoadedScene;
use c4d_metrics::Better;
use gs_core::{Camera, DynamicScene, Image};
use std::fmt::Write as _;

/// Maximum width of a picture in a triple, pixels.
const TRIPLE_WIDTH: f64 = 480.0;
/// Maximum width of a picture on the contact sheet, pixels.
const SHEET_WIDTH: f64 = 300.0;
/// Number of times on the contact sheet.
const SHEET_TIMES: usize = 6;
const QUALITY: u8 = 82;

/// Metrics plotted over time, each with the source's metric for reference.
const CURVES: [(&str, Option<&str>); 10] = [
    ("psnr", None),
    ("flip", None),
    ("bg_psnr", None),
    ("edit_strength", None),
    ("warp_error", Some("warp_error_src")),
    ("warp_error_own", Some("warp_error_src")),
    ("warp_error_long", Some("warp_error_long_src")),
    ("flicker_excess", None),
    ("motion_fidelity", None),
    ("motion_fidelity_edit", None),
];

/// A run, opened.
pub(super) struct Picture<'a> {
    pub(super) opened: &'a LoadedScene,
    pub(super) name: &'a str,
}

/// Contents of the page.
pub(super) struct Look<'a> {
    pub(super) runs: Vec<Picture<'a>>,
    pub(super) truth: Option<&'a LoadedScene>,
    pub(super) numbers: &'a [Numbers],
    pub(super) device: &'a Device,
}

/// View and time of a run's largest error.
struct Worst {
    view: usize,
    frame: usize,
    why: String,
}

impl Look<'_> {
    /// The worst view and time of each run.
    pub(super) fn first(&self, shrink: f64) -> Outcome<String> {
        let mut html = String::new();
        for (run, numbers) in self.runs.iter().zip(self.numbers) {
            let worst = worst(numbers);
            let camera = fitted(&numbers.cameras[worst.view], TRIPLE_WIDTH * shrink);
            let t = numbers.times[worst.frame];
            let (before, title) = match self.truth {
                Some(truth) => (truth.scene.as_ref(), "truth"),
                None => (source(run.opened), "before"),
            };
            let background = numbers.background();
            let before = self.render(before, &camera, t, background)?;
            let after = self.render(run.opened.scene.as_ref(), &camera, t, background)?;
            let triple = Triple {
                before: (title, &before),
                after: (run.name, &after),
                caption: format!(
                    "{}: view {}, time {}. {}",
                    run.name,
                    numbers.cameras[worst.view].name,
                    number(f64::from(t)),
                    worst.why
                ),
            };
            html.push_str(&triple.html(QUALITY)?);
        }
        Ok(html)
    }

    /// Runs × times, from the first view, with a divider.
    pub(super) fn sheet(&self, shrink: f64) -> Outcome<String> {
        let mut html = String::from(
            "<p>Move the divider: before on its left, after on its right.</p><input id=\"divider\" type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"divider\">",
        );
        for (run, numbers) in self.runs.iter().zip(self.numbers) {
            let camera = fitted(&numbers.cameras[0], SHEET_WIDTH * shrink);
            let background = numbers.background();
            let _ = write!(html, "<h3>{}</h3><div class=\"sheet\">", escape(run.name));
            let count = numbers.times.len().min(SHEET_TIMES);
            for k in 0..count {
                let t = numbers.times[k * (numbers.times.len() - 1) / (count - 1).max(1)];
                let before = self.render(source(run.opened), &camera, t, background)?;
                let after = self.render(run.opened.scene.as_ref(), &camera, t, background)?;
                html.push_str(&wipe(
                    &before,
                    &after,
                    &format!("time {}", number(f64::from(t))),
                    QUALITY,
                )?);
            }
            html.push_str("</div>");
        }
        Ok(html)
    }

    /// Plots of values over time.
    pub(super) fn curves(&self) -> String {
        let names: Vec<String> = self.runs.iter().map(|run| run.name.to_owned()).collect();
        let Some(first) = self.numbers.first() else { return String::new() };
        let mut plots = String::new();
        for (id, reference) in CURVES {
            let Some(definition) = DEFINITIONS.iter().find(|d| d.id == id) else { continue };
            let mut curves = Vec::new();
            for (numbers, name) in self.numbers.iter().zip(&names) {
                curves.push(Curve {
                    name: name.clone(),
                    values: numbers.over_time(id),
                    is_reference: false,
                });
                curves.extend(reference.map(|id| Curve {
                    name: format!("{name}: the source"),
                    values: numbers.over_time(id),
                    is_reference: true,
                }));
            }
            let title = format!("{id} {}", definition.better.arrow());
            let plot = Plot { title, what: definition.what, times: &first.times, curves };
            plots.push_str(&plot.svg());
        }
        if plots.is_empty() {
            return plots;
        }
        format!("{}<div class=\"plots\">{plots}</div>", Plot::legend(&names))
    }

    /// A table of metrics with the best value of each row in bold; of the group `cost`, or of all
    /// others.
    pub(super) fn table(&self, cost: bool) -> String {
        let mut rows = String::new();
        for group in Group::ALL.into_iter().filter(|group| (*group == Group::Cost) == cost) {
            let mut of_group = String::new();
            for definition in DEFINITIONS.iter().filter(|d| d.group == group) {
                of_group.push_str(&self.row(definition));
            }
            if !of_group.is_empty() && !cost {
                let _ = write!(
                    rows,
                    "<tr class=\"group\"><th colspan=\"{}\">{}</th></tr>",
                    self.runs.len() + 3,
                    escape(group.title())
                );
            }
            rows.push_str(&of_group);
        }
        if rows.is_empty() {
            return rows;
        }
        let head = |run: &Picture<'_>| format!("<th>{}</th>", escape(run.name));
        let heads: String = self.runs.iter().map(head).collect();
        format!(
            "<div class=\"scroll\"><table><tr><th></th><th></th>{heads}<th></th></tr>{rows}</table></div>"
        )
    }

    fn row(&self, definition: &Definition) -> String {
        let values: Vec<Option<f64>> =
            self.numbers.iter().map(|numbers| numbers.value(definition.id)).collect();
        if values.iter().all(Option::is_none) {
            return String::new();
        }
        let winners = best(definition.better, &values);
        let cell = |(k, value): (usize, &Option<f64>)| {
            let text = match value {
                Some(value) if winners.contains(&k) => format!("<b>{}</b>", number(*value)),
                Some(value) => number(*value),
                None => "–".to_owned(),
            };
            let spread = self.numbers[k].std(definition.id).filter(|_| value.is_some());
            let spread = spread.map_or(String::new(), |std| format!(" ±{}", number(std)));
            format!("<td class=\"number\">{text}{spread}</td>")
        };
        let cells: String = values.iter().enumerate().map(cell).collect();
        let arrow =
            if definition.better == Better::Neither { "" } else { definition.better.arrow() };
        format!(
            "<tr><th>{}</th><td>{arrow}</td>{cells}<td class=\"what\">{}</td></tr>",
            escape(definition.id),
            escape(definition.what)
        )
    }

    fn render(
        &self,
        scene: &dyn DynamicScene,
        camera: &Camera,
        t: f32,
        background: [f32; 3],
    ) -> Outcome<Image> {
        let mut renderer = Renderer::new(self.device, background);
        let range = scene.time_range();
        renderer.seek(scene, t.clamp(range.start, range.end))?;
        Ok(renderer.render(camera)?.rgb_image())
    }
}

/// The scene before the edit.
fn source(opened: &LoadedScene) -> &dyn DynamicScene {
    opened.original.as_ref().unwrap_or(&opened.scene).as_ref()
}

/// The camera, reduced to at most this image width.
fn fitted(camera: &Camera, width: f64) -> Camera {
    let factor = (width / f64::from(camera.width)).min(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a picture's side")]
    let side = |pixels: u32| (f64::from(pixels) * factor).round().max(1.0) as u32;
    camera.resized(side(camera.width), side(camera.height))
}

/// The view and time farthest from the ground truth; without one, with the largest excess of the
/// warp error over the source's, else with the largest change of the background.
fn worst(numbers: &Numbers) -> Worst {
    let excess = || {
        let mut frames = numbers.frames("warp_error_long");
        for (ours, theirs) in frames.iter_mut().zip(numbers.frames("warp_error_long_src")) {
            for (ours, theirs) in ours.iter_mut().zip(theirs) {
                *ours = ours.zip(theirs).map(|(a, b)| a - b);
            }
        }
        frames
    };
    let candidates = [
        (numbers.frames("flip"), "Largest perceived difference from the ground truth: ꟻLIP"),
        (
            excess(),
            "Largest change of colours along the motion, compared with the source: excess of warp_error_long",
        ),
        (numbers.frames("bg_changed_frac"), "Largest change of the background: share"),
    ];
    for (frames, why) in candidates {
        let mut found: Option<(f64, usize, usize)> = None;
        for (view, values) in frames.iter().enumerate() {
            for (frame, value) in values.iter().enumerate() {
                if let Some(value) = value
                    && view < numbers.cameras.len()
                    && frame < numbers.times.len()
                    && found.is_none_or(|(worst, ..)| *value > worst)
                {
                    found = Some((*value, view, frame));
                }
            }
        }
        if let Some((value, view, frame)) = found {
            return Worst { view, frame, why: format!("{why} {}.", number(value)) };
        }
    }
    let frame = numbers.times.len() / 2;
    Worst {
        view: 0,
        frame,
        why: "No metric has values per frame: the middle of the clip.".to_owned(),
    }
}
