//! The small report in every run folder.

use super::page::{Page, escape};
use super::picture::{Triple, wipe};
use crate::camera_rig::CameraRig;
use crate::device::Device;
use crate::evaluation::number;
use crate::failure::{Failure, Outcome};
use crate::renderer::Renderer;
use gs_core::{DynamicScene, Image};
use std::fmt::Write as _;

/// Size of its pictures, pixels.
const SIZE: (u32, u32) = (256, 192);
/// Times shown.
const TIMES: usize = 4;
const QUALITY: u8 = 82;

/// Contents of a report.
pub(crate) struct RunReport<'a> {
    pub(crate) name: String,
    pub(crate) scene: &'a dyn DynamicScene,
    pub(crate) source: &'a dyn DynamicScene,
    pub(crate) up: [f64; 3],
    pub(crate) background: [f32; 3],
    /// Lines of a table: name and value.
    pub(crate) facts: Vec<(String, String)>,
    pub(crate) warnings: Vec<String>,
}

/// Renders a few small pictures and writes the HTML. Renders on the CPU, which avoids starting an
/// adapter.
pub(crate) fn run_report(report: &RunReport<'_>) -> Outcome<String> {
    let device = &Device::Cpu;
    let rig = CameraRig::of_scene(report.source, report.up).map_err(Failure::input)?;
    let camera = rig.front(SIZE);
    let times = report.scene.time_range().frames(TIMES);
    let (mut before, mut after) =
        (Renderer::new(device, report.background), Renderer::new(device, report.background));
    let mut pairs: Vec<(f32, Image, Image)> = Vec::new();
    for t in times {
        before.seek(report.source, t)?;
        after.seek(report.scene, t)?;
        let images = (before.render(&camera)?.rgb_image(), after.render(&camera)?.rgb_image());
        pairs.push((t, images.0, images.1));
    }
    let mut page = Page::default();
    if let Some((t, before, after)) = pairs.get(TIMES / 2) {
        let triple = Triple {
            before: ("before", before),
            after: ("after", after),
            caption: format!("Time {}, from the front.", number(f64::from(*t))),
        };
        page.section("look", "Largest difference", &triple.html(QUALITY)?);
    }
    let mut sheet = String::from(
        "<p>Move the divider: before on its left, after on its right.</p><input id=\"divider\" type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"divider\"><div class=\"sheet\">",
    );
    for (t, before, after) in &pairs {
        sheet.push_str(&wipe(before, after, &format!("time {}", number(f64::from(*t))), QUALITY)?);
    }
    sheet.push_str("</div>");
    page.section("sheet", "Over time", &sheet);
    page.section("warnings", "Warnings", &list(&report.warnings));
    let mut rows = String::new();
    for (name, value) in &report.facts {
        let _ = write!(rows, "<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(value));
    }
    page.section("facts", "Summary", &format!("<table>{rows}</table>"));
    let next = format!(
        "<pre>c4d render {0} --side-by-side -o clip.mp4\nc4d export {0} -o player.html\nc4d eval {0} -o metrics.json</pre>",
        escape(&report.name)
    );
    page.section("next", "Next steps", &next);
    Ok(page.html(&report.name, "made by c4d propagate; opens offline"))
}

/// Sentences as a list; empty if there are none.
fn list(sentences: &[String]) -> String {
    if sentences.is_empty() {
        return String::new();
    }
    let item = |sentence: &String| format!("<li>{}</li>", escape(sentence));
    let items: String = sentences.iter().map(item).collect();
    format!("<ul>{items}</ul>")
}
