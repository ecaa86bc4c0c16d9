//! The page: one HTML file with the player, a poster and the payload.

use crate::base91;
use crate::{Encoded, Legend, PlayerError};
use base64::{Engine, prelude::BASE64_STANDARD as BASE64};
use gs_core::Camera;
use serde::Serialize;

const HTML: &str = include_str!("../player/player.html");
const STYLE: &str = include_str!("../player/style.css");
const VERTEX: &str = include_str!("../player/splat.vert");
const FRAGMENT: &str = include_str!("../player/splat.frag");
const COVER: &str = include_str!("../player/cover.vert");
const PRESENT: &str = include_str!("../player/present.frag");
/// Scripts that run in a worker.
const ENGINE: [&str; 6] = [
    include_str!("../player/decode.js"),
    include_str!("../player/tracks.js"),
    include_str!("../player/sort.js"),
    include_str!("../player/pick.js"),
    include_str!("../player/select.js"),
    include_str!("../player/engine.js"),
];
/// Scripts that run in the page.
const MAIN: [&str; 8] = [
    include_str!("../player/source.js"),
    include_str!("../player/renderer.js"),
    include_str!("../player/camera.js"),
    include_str!("../player/clock.js"),
    include_str!("../player/layout.js"),
    include_str!("../player/overlays.js"),
    include_str!("../player/ui.js"),
    include_str!("../player/main.js"),
];
/// Scripts of served pages only, before the last script of [`MAIN`].
const SERVED: [&str; 3] = [
    include_str!("../player/inspector.js"),
    include_str!("../player/selection.js"),
    include_str!("../player/server.js"),
];
/// Controls of served pages.
const TOOLS: &str = include_str!("../player/tools.html");
/// Largest number of scenes of a page.
const MAX_SOURCES: usize = 4;

/// An image shown until the scene is decoded.
#[derive(Debug, Clone, Copy)]
pub struct Poster<'a> {
    /// Media type, such as `image/jpeg`.
    pub media_type: &'a str,
    /// The file's bytes.
    pub bytes: &'a [u8],
}

/// A payload of a page, and the names of its scenes.
#[derive(Debug, Clone, Copy)]
pub struct PageScenes<'a> {
    /// One or two scenes.
    pub encoded: &'a Encoded,
    /// Names of the scenes.
    pub names: [&'a str; 2],
}

/// Texts and initial state of a page.
#[derive(Debug, Clone)]
pub struct Page<'a> {
    /// Title of the window and heading.
    pub title: &'a str,
    /// Frames per second.
    pub fps: f64,
    /// Initial view; its image always fits into the window.
    pub camera: &'a Camera,
    /// Point that the view orbits, world units.
    pub target: [f64; 3],
    /// The world's upward direction.
    pub up: [f64; 3],
    /// Largest angles from the initial view, around and up, degrees: the captured range. The user
    /// can remove the limits.
    pub limits: Option<[f64; 2]>,
    /// Colour behind the splats, 0 to 1.
    pub background: [f32; 3],
    /// Image of the first frame from the initial view.
    pub poster: Option<Poster<'a>>,
}

#[derive(Serialize)]
struct Config<'a> {
    title: &'a str,
    fps: f64,
    frames: usize,
    scenes: Vec<SceneEntry<'a>>,
    /// Descriptions of embedded payloads; served payloads are fetched.
    sources: Vec<Meta<'a>>,
    camera: View,
    target: [f64; 3],
    up: [f64; 3],
    limits: Option<[f64; 2]>,
    background: [f32; 3],
}

/// A scene of the page.
#[derive(Serialize)]
struct SceneEntry<'a> {
    name: &'a str,
    source: usize,
    /// 0 for the first scene of the payload, 1 for the second.
    second: usize,
}

/// Description of a payload.
#[derive(Serialize)]
struct Meta<'a> {
    raw_bytes: usize,
    splats: [usize; 2],
    overlays: Vec<OverlayMeta<'a>>,
}

#[derive(Serialize)]
struct OverlayMeta<'a> {
    name: &'a str,
    title: &'a str,
    palette: &'a [[u8; 3]],
    legend: &'a Legend,
}

#[derive(Serialize)]
struct View {
    position: [f64; 3],
    focal: [f64; 2],
    size: [u32; 2],
    near: f64,
}

impl<'a> Meta<'a> {
    fn of(encoded: &'a Encoded) -> Self {
        let overlays = encoded.overlays.iter().map(|overlay| OverlayMeta {
            name: &overlay.name,
            title: &overlay.title,
            palette: &overlay.palette,
            legend: &overlay.legend,
        });
        Self {
            raw_bytes: encoded.report.bytes.0,
            splats: [encoded.report.first, encoded.report.second],
            overlays: overlays.collect(),
        }
    }
}

/// A page that contains its payloads, as UTF-8 text (ASCII except for title and names). All scenes
/// share one camera and one time.
///
/// # Errors
/// If the camera is invalid, the frame rate is not positive, there are no sources or more than 4,
/// or they have different numbers of frames.
pub fn page(sources: &[PageScenes<'_>], page: &Page<'_>) -> Result<String, PlayerError> {
    let payloads = sources.iter().enumerate();
    let payloads = payloads.map(|(i, source)| blocks(i, &source.encoded.payload)).collect();
    build(sources, page, Some(payloads))
}

/// A page that fetches its payloads from its server: `source/I` relative to the address of the
/// page, see [`source_file`]. It also identifies and selects splats, and saves cameras; the crate's
/// `README.md` lists the requests that the server has to answer for this.
///
/// # Errors
/// As [`page()`].
pub fn served_page(sources: &[PageScenes<'_>], page: &Page<'_>) -> Result<String, PlayerError> {
    build(sources, page, None)
}

/// The file `source/I` of a served page: length of a description, as 4 bytes, little-endian; the
/// description, JSON; the payload.
///
/// # Errors
/// If the description cannot be written.
pub fn source_file(encoded: &Encoded) -> Result<Vec<u8>, PlayerError> {
    let meta = serde_json::to_vec(&Meta::of(encoded))?;
    #[expect(clippy::cast_possible_truncation, reason = "a palette is a few kilobytes")]
    let mut file = (meta.len() as u32).to_le_bytes().to_vec();
    file.extend(meta);
    file.extend(&encoded.payload);
    Ok(file)
}

fn build(
    sources: &[PageScenes<'_>],
    page: &Page<'_>,
    payloads: Option<String>,
) -> Result<String, PlayerError> {
    let refuse = |name, found: String, expected| Err(PlayerError::Option { name, found, expected });
    if let Err(error) = page.camera.check() {
        return refuse("camera", error.to_string(), "a valid camera");
    }
    if !(page.fps > 0.0 && page.fps.is_finite()) {
        return refuse("fps", page.fps.to_string(), "a positive number");
    }
    if sources.is_empty() || sources.len() > MAX_SOURCES {
        return refuse("sources", sources.len().to_string(), "1 to 4");
    }
    let frames = sources[0].encoded.report.frames;
    if let Some(other) = sources.iter().find(|other| other.encoded.report.frames != frames) {
        return refuse("frames", other.encoded.report.frames.to_string(), "those of the others");
    }
    let scenes = sources.iter().enumerate().flat_map(|(index, source)| {
        let count = if source.encoded.report.second > 0 { 2 } else { 1 };
        (0..count).map(move |second| SceneEntry {
            name: source.names[second],
            source: index,
            second,
        })
    });
    let embedded = if payloads.is_some() { sources } else { &[] };
    let config = Config {
        title: page.title,
        fps: page.fps,
        frames,
        scenes: scenes.collect(),
        sources: embedded.iter().map(|source| Meta::of(source.encoded)).collect(),
        camera: View {
            position: page.camera.position(),
            focal: [page.camera.intrinsics.fx, page.camera.intrinsics.fy],
            size: [page.camera.width, page.camera.height],
            near: page.camera.near,
        },
        target: page.target,
        up: page.up,
        limits: page.limits,
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
    let served = payloads.is_none();
    let [first @ .., last] = MAIN;
    let tools = if served { SERVED.concat() } else { String::new() };
    let filled = [
        ("title", escape(page.title)),
        ("style", STYLE.to_owned()),
        ("poster", poster),
        ("connections", if served { "connect-src 'self'; " } else { "" }.to_owned()),
        ("tools", if served { TOOLS } else { "" }.to_owned()),
        ("config", config),
        ("engine", ENGINE.concat()),
        ("main", shaders + &first.concat() + &tools + last),
        ("payload", payloads.unwrap_or_default()),
    ];
    let length: usize = filled.iter().map(|(_, text)| text.len()).sum();
    let mut out = String::with_capacity(HTML.len() + length + page.title.len());
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

/// A payload as data blocks of the page.
fn blocks(source: usize, payload: &[u8]) -> String {
    let mut out = String::with_capacity(payload.len() * 5 / 4 + 1024);
    for block in payload.chunks(base91::BLOCK) {
        out.push_str("<script type=\"application/vnd.c4d\" data-source=\"");
        out.push_str(&source.to_string());
        out.push_str("\" data-bytes=\"");
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

    /// Constants of a source that differ from [`gs_core::image_formation`] in name or value.
    fn findings(source: &str, declaration: &str) -> Vec<String> {
        let number = |text: &str| text.trim().parse::<f32>().ok();
        source
            .lines()
            .filter_map(|line| line.strip_prefix(declaration)?.strip_suffix(';'))
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
            assert_eq!(findings(glsl, "const float "), Vec::<String>::new(), "{name}");
        }
        let (picking, _) = ENGINE[3].split_once("/**").unwrap();
        assert!(picking.contains("const ALPHA_THRESHOLD"), "pick.js declares constants");
        assert_eq!(findings(picking, "const "), Vec::<String>::new(), "pick.js");
        assert_eq!(findings("const float EPS2D = 0.4;", "const float ").len(), 1, "wrong value");
        assert_eq!(findings("const float BLUR = 0.3;", "const float ").len(), 1, "unknown name");
    }
}
