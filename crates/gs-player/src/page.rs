//! The page: one HTML file with the player, a poster and the payload.

use crate::base91;
use crate::{Encoded, PlayerError};
use base64::{Engine, prelude::BASE64_STANDARD as BASE64};
use gs_core::Camera;
use serde::Serialize;

const HTML: &str = include_str!("../player/player.html");
const STYLE: &str = include_str!("../player/style.css");
const VERTEX: &str = include_str!("../player/splat.vert");
const FRAGMENT: &str = include_str!("../player/splat.frag");
const COVER: &str = include_str!("../player/cover.vert");
const PRESENT: &str = include_str!("../player/present.frag");
/// Runs in a worker.
const ENGINE: [&str; 4] = [
    include_str!("../player/decode.js"),
    include_str!("../player/tracks.js"),
    include_str!("../player/sort.js"),
    include_str!("../player/engine.js"),
];
/// Runs in the page.
const MAIN: [&str; 6] = [
    include_str!("../player/renderer.js"),
    include_str!("../player/camera.js"),
    include_str!("../player/clock.js"),
    include_str!("../player/wipe.js"),
    include_str!("../player/ui.js"),
    include_str!("../player/main.js"),
];

/// An image shown until the scene is decoded.
#[derive(Debug, Clone, Copy)]
pub struct Poster<'a> {
    /// Media type, such as `image/jpeg`.
    pub media_type: &'a str,
    /// The file's bytes.
    pub bytes: &'a [u8],
}

/// Texts and initial state of a page.
#[derive(Debug, Clone)]
pub struct Page<'a> {
    /// Title of the window and heading.
    pub title: &'a str,
    /// Names of the two scenes.
    pub names: [&'a str; 2],
    /// Frames per second.
    pub fps: f64,
    /// Initial view; its image always fits into the window.
    pub camera: &'a Camera,
    /// Point that the view orbits, world units.
    pub target: [f64; 3],
    /// The world's upward direction.
    pub up: [f64; 3],
    /// Colour behind the splats, 0 to 1.
    pub background: [f32; 3],
    /// Image of the first frame from the initial view.
    pub poster: Option<Poster<'a>>,
}

#[derive(Serialize)]
struct Config<'a> {
    title: &'a str,
    names: [&'a str; 2],
    fps: f64,
    frames: usize,
    splats: [usize; 2],
    raw_bytes: usize,
    camera: View,
    target: [f64; 3],
    up: [f64; 3],
    background: [f32; 3],
}

#[derive(Serialize)]
struct View {
    position: [f64; 3],
    focal: [f64; 2],
    size: [u32; 2],
    near: f64,
}

/// The page as UTF-8 text (ASCII except for title and names).
///
/// # Errors
/// If the camera is invalid or the frame rate is not positive.
pub fn page(encoded: &Encoded, page: &Page<'_>) -> Result<String, PlayerError> {
    let refuse = |name, found: String, expected| Err(PlayerError::Option { name, found, expected });
    if let Err(error) = page.camera.check() {
        return refuse("camera", error.to_string(), "a valid camera");
    }
    if !(page.fps > 0.0 && page.fps.is_finite()) {
        return refuse("fps", page.fps.to_string(), "a positive number");
    }
    let report = &encoded.report;
    let config = Config {
        title: page.title,
        names: page.names,
        fps: page.fps,
        frames: report.frames,
        splats: [report.first, report.second],
        raw_bytes: report.bytes.0,
        camera: View {
            position: page.camera.position(),
            focal: [page.camera.intrinsics.fx, page.camera.intrinsics.fy],
            size: [page.camera.width, page.camera.height],
            near: page.camera.near,
        },
        target: page.target,
        up: page.up,
        background: page.background,
    };
    // In a script element only `<` could end the data early.
    let config = serde_json::to_string(&config)?.replace('<', "\\u003c");
    let shader = |text: &str| text.replace('`', "'");
    let shaders = format!(
        "const SPLAT_VERTEX = `{}`;\nconst SPLAT_FRAGMENT = `{}`;\nconst COVER_VERTEX = `{}`;\nconst PRESENT_FRAGMENT = `{}`;\n",
        shader(VERTEX),
        shader(FRAGMENT),
        shader(COVER),
        shader(PRESENT)
    );
    let poster = page.poster.map_or_else(String::new, |poster| {
        format!(
            "<img id=\"poster\" alt=\"First frame\" src=\"data:{};base64,{}\">",
            escape(poster.media_type),
            BASE64.encode(poster.bytes)
        )
    });
    let filled = [
        ("title", escape(page.title)),
        ("style", STYLE.to_owned()),
        ("poster", poster),
        ("config", config),
        ("engine", ENGINE.concat()),
        ("main", shaders + &MAIN.concat()),
        ("payload", blocks(&encoded.payload)),
    ];
    let mut out = String::with_capacity(encoded.payload.len() * 5 / 4 + 200_000);
    let mut rest = HTML;
    // A single pass: inserted text is never searched for placeholders.
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        out.push_str(before);
        if let Some((_, text)) = filled.iter().find(|(key, _)| *key == name) {
            out.push_str(text);
        }
        rest = after;
    }
    out.push_str(rest);
    Ok(out)
}

/// The payload as data blocks of the page.
fn blocks(payload: &[u8]) -> String {
    let mut out = String::with_capacity(payload.len() * 5 / 4 + 1024);
    for block in payload.chunks(base91::BLOCK) {
        out.push_str("<script type=\"application/vnd.c4d\" data-bytes=\"");
        out.push_str(&block.len().to_string());
        out.push_str("\">");
        base91::encode(block, &mut out);
        out.push_str("</script>\n");
    }
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::image_formation::CONSTANTS;

    /// Constants of a GLSL source that differ from [`gs_core::image_formation`] in name or value.
    fn findings(glsl: &str) -> Vec<String> {
        let number = |text: &str| text.trim().parse::<f32>().ok();
        glsl.lines()
            .filter_map(|line| line.strip_prefix("const float ")?.strip_suffix(';'))
            .filter(|line| {
                let Some((name, value)) = line.split_once(" = ") else { return true };
                let value = match value.split_once('/') {
                    Some((a, b)) => number(a).zip(number(b)).map(|(a, b)| a / b),
                    None => number(value),
                };
                !CONSTANTS.iter().any(|known| Some(*known) == value.map(|value| (name, value)))
            })
            .map(str::to_owned)
            .collect()
    }

    #[test]
    fn constants_of_the_shaders_equal_those_of_the_image_formation() {
        for (name, glsl) in [("splat.vert", VERTEX), ("splat.frag", FRAGMENT)] {
            assert!(glsl.contains("const float ALPHA_THRESHOLD"), "{name} declares constants");
            assert_eq!(findings(glsl), Vec::<String>::new(), "{name}");
        }
        assert_eq!(findings("const float EPS2D = 0.4;").len(), 1, "wrong value");
        assert_eq!(findings("const float BLUR = 0.3;").len(), 1, "unknown name");
    }
}
