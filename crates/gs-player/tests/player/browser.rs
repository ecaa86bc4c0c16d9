//! The page in headless Chromium: screenshots at two times and on both sides of the
//! divider are compared with renders of the scenes before encoding, and the values
//! decoded by JavaScript with the decoder of these tests; overlays with feature passes; picked
//! splats with the weights of a backward pass.
//!
//! Without Chromium these tests fail; they are not skipped.

use crate::decoder::decode;
use gs_core::{Camera, DynamicScene, Image, Rasterizer, RenderParams, Splats, UpstreamGrads};
use gs_player::{
    Annotations, EncodeOptions, Encoded, Legend, Overlay, Page, PageScenes, encode_annotated, page,
};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, SynthScene, Truth, apply_edits, demo, demo_edits};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SIZE: (u32, u32) = (480, 360);
const FRAMES: usize = 9;
const BACKGROUND: [f32; 3] = [0.2, 0.1, 0.3];
/// Worst seen 56.7 dB; the wrong frame or scene is below 30 dB.
const MIN_PSNR: f64 = 50.0;
/// Worst seen 0.00115: half a step of the 8 bits of a screenshot is 0.001.
const MAX_MEAN_DIFFERENCE: f64 = 0.0025;
const CONTROL_PSNR: f64 = 30.0;
/// Largest share of values that differ by more than [`OVERLAY_LEVELS`].
const MAX_BEYOND: f64 = 0.001;

struct Fixture {
    original: SynthScene,
    edited: Truth,
    times: Vec<f32>,
    camera: Camera,
    encoded: Encoded,
    overlay: Overlay,
    folder: tempfile::TempDir,
}

impl Fixture {
    fn new() -> Self {
        Self::with(&EncodeOptions { sh_degree: 3, ..EncodeOptions::default() })
    }

    fn with(options: &EncodeOptions) -> Self {
        let params = DemoParams { num_splats: 6_000, ..DemoParams::default() };
        let original = demo(&params).unwrap();
        let edited = apply_edits(&original, &demo_edits(), 7).unwrap().truth;
        let times = original.time_range().frames(FRAMES);
        let camera =
            Camera::look_at([0.6, 1.5, 4.4], [0.0, 0.9, 0.0], [0.0, 1.0, 0.0], 0.7, SIZE.0, SIZE.1);
        let overlay = overlay([original.num_splats(), edited.num_splats()]);
        let annotations =
            Annotations { overlays: std::slice::from_ref(&overlay), row_numbers: true };
        let encoded = encode_annotated(
            &original,
            Some(&edited),
            &times,
            options,
            &annotations,
            &mut |_, _| {},
        )
        .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let text = page(
            &[PageScenes { encoded: &encoded, names: ["Original", "Edited"] }],
            &Page {
                title: "Test",
                fps: 30.0,
                camera: &camera,
                target: [0.0, 0.9, 0.0],
                up: [0.0, 1.0, 0.0],
                limits: None,
                background: BACKGROUND,
                poster: None,
            },
        )
        .unwrap();
        std::fs::write(folder.path().join("page.html"), text).unwrap();
        Self { original, edited, times, camera, encoded, overlay, folder }
    }

    /// Reference render of the scene before encoding.
    fn render(&self, scene: &dyn DynamicScene, frame: usize) -> Image {
        let splats: Splats = scene.at(self.times[frame]).unwrap();
        let rasterizer = CpuRasterizer::default();
        let mut prepared = rasterizer.prepare(&splats, &self.camera).unwrap();
        let params =
            RenderParams { background: BACKGROUND.map(f64::from), ..RenderParams::default() };
        rasterizer.forward(&mut prepared, &splats, &[], &params).unwrap().rgb_image()
    }

    /// Opens the page and waits for its first image; returns a screenshot and the document.
    fn open(&self, hash: &str, flags: &[&str]) -> (Image, String) {
        self.open_as(&hash.replace(['&', '='], "_"), hash, flags)
    }

    /// As [`Fixture::open`], with a name for the screenshot.
    fn open_as(&self, name: &str, hash: &str, flags: &[&str]) -> (Image, String) {
        let picture = self.folder.path().join(format!("{name}.png"));
        let document = chromium(&self.folder.path().join("page.html"), hash, flags, &picture);
        assert!(picture.is_file(), "no screenshot of #{hash}; the page:\n{}", problem(&document));
        let decoded = image::open(&picture).unwrap().to_rgb8();
        assert_eq!(decoded.dimensions(), SIZE, "size of the window");
        let data = decoded.as_raw().iter().map(|&byte| f32::from(byte) / 255.0).collect();
        let (width, height) = (decoded.width() as usize, decoded.height() as usize);
        (Image { width, height, channels: 3, data }, document)
    }
}

/// An overlay of 12 saturated colours in arbitrary order.
fn overlay(rows: [usize; 2]) -> Overlay {
    let palette: Vec<[u8; 3]> =
        (0..12_u8).map(|i| [i.wrapping_mul(97), i.wrapping_mul(57), 255 - 20 * i]).collect();
    let entries = rows.map(|count| (0..count).map(|row| (row * 7919 % 12) as u8).collect());
    let legend = Legend { classes: vec![(3, "three".to_owned())], scale: None };
    let (name, title) = ("parts".to_owned(), "Parts".to_owned());
    Overlay { name, title, palette, legend, entries }
}

pub(crate) fn browser() -> PathBuf {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let on_path = std::env::split_paths(&folders)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|path| path.is_file());
    named.or(on_path).expect(
        "the player's tests need Chromium: apt-get install chromium, or name a browser in CHROMIUM",
    )
}

/// Runs the browser until the page has loaded; returns the document.
fn chromium(page: &Path, hash: &str, flags: &[&str], picture: &Path) -> String {
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser())
        .args([
            "--headless=new",
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
        ])
        .args(["--hide-scrollbars", "--force-device-scale-factor=1", "--disable-dev-shm-usage"])
        .args([
            "--disable-extensions",
            "--no-first-run",
            "--disable-background-networking",
            "--dump-dom",
        ])
        .args(flags)
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("--window-size={},{}", SIZE.0, SIZE.1))
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}#hold&{hash}", page.display()))
        .stderr(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "the browser ended with {}", output.status);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The error message on the page.
fn problem(document: &str) -> String {
    between(document, "<p id=\"problem-text\">", "</p>").unwrap_or(document).to_owned()
}

fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    text.split_once(start)?.1.split_once(end).map(|(inner, _)| inner)
}

/// Columns `from..to` of both images: PSNR in dB and mean absolute difference.
fn compare(found: &Image, expected: &Image, from: usize, to: usize) -> (f64, f64) {
    let (mut squares, mut differences, mut count) = (0.0, 0.0, 0.0);
    for y in 0..expected.height {
        for x in from..to {
            for (a, b) in found.pixel(x, y).iter().zip(expected.pixel(x, y)) {
                let difference = f64::from(a - b.clamp(0.0, 1.0));
                squares += difference * difference;
                differences += difference.abs();
                count += 1.0;
            }
        }
    }
    (-10.0 * (squares / count).log10(), differences / count)
}

fn assert_alike(what: &str, found: &Image, expected: &Image, columns: std::ops::Range<usize>) {
    let (psnr, mean) = compare(found, expected, columns.start, columns.end);
    eprintln!("{what}: {psnr:.1} dB, mean difference {mean:.5}");
    assert!(
        psnr > MIN_PSNR && mean < MAX_MEAN_DIFFERENCE,
        "{what}: {psnr:.1} dB, mean difference {mean}"
    );
}

fn assert_different(what: &str, found: &Image, expected: &Image, columns: std::ops::Range<usize>) {
    let (psnr, _) = compare(found, expected, columns.start, columns.end);
    assert!(psnr < CONTROL_PSNR, "{what}: {psnr:.1} dB, too similar for a negative control");
}

#[test]
fn the_page_matches_our_renders_and_decodes_our_payload() {
    let fixture = Fixture::new();
    let whole = 0..SIZE.0 as usize;
    let render = |second: bool, frame: usize| {
        let scene: &dyn DynamicScene = if second { &fixture.edited } else { &fixture.original };
        fixture.render(scene, frame)
    };
    let (first_2, second_2) = (render(false, 2), render(true, 2));
    let (first_6, second_6) = (render(false, 6), render(true, 6));

    // Frame 2 of 0 to 8, first only the original, then only the edited scene.
    let (before, document) = fixture.open("paused&ui=0&t=0.25&wipe=1&report", &[]);
    assert_alike("original at frame 2", &before, &first_2, whole.clone());
    assert_different("un-wiped", &before, &second_2, whole.clone());
    assert_different("wrong time", &before, &first_6, whole.clone());
    check_report(&fixture, &document);
    let (after, _) = fixture.open("paused&ui=0&t=0.25&wipe=0", &[]);
    assert_alike("edited at frame 2", &after, &second_2, whole.clone());
    assert_different("un-wiped", &after, &first_2, whole);

    // Frame 6, divided at 45 %.
    let (both, _) = fixture.open("paused&ui=0&t=0.75&wipe=0.45", &[]);
    let split = (0.45 * f64::from(SIZE.0)).round() as usize;
    assert_alike("original left of the divider", &both, &first_6, 0..split);
    assert_alike("edited right of the divider", &both, &second_6, split..SIZE.0 as usize);
    assert_different("wrong scene right", &both, &first_6, split..SIZE.0 as usize);
    assert_different("wrong time right", &both, &second_2, split..SIZE.0 as usize);
}

/// Compares the page's report: fingerprints of the integers, sums of the scene at the time.
fn check_report(fixture: &Fixture, document: &str) {
    let report = between(document, "<pre id=\"report\" hidden=\"\">", "</pre>").expect("a report");
    let report: serde_json::Value = serde_json::from_str(report).unwrap();
    let payload = decode(&fixture.encoded.payload);
    let entries = report["attributes"].as_array().unwrap();
    assert_eq!(entries.len(), payload.attributes.len(), "attributes");
    for entry in entries {
        let name = entry["name"].as_str().unwrap();
        let found = ["base", "frames", "values"].map(|key| entry[key].as_u64().unwrap());
        let expected = payload.attributes[name].fingerprints().map(u64::from);
        assert_eq!(found, expected, "{name}: integers decoded in JavaScript and here");
    }
    assert_eq!(report["time"].as_f64(), Some(2.0), "frame");
    let rows = payload.groups.iter().sum::<usize>();
    let mut expected = 0.0;
    for row in 0..rows {
        let place = payload.attributes["position"].value(row, 2);
        expected += (0..3).map(|k| place[k] + payload.origin[k]).sum::<f64>();
        let q = payload.attributes["rotation"].value(row, 2);
        let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        expected += q.iter().map(|v| v / norm).sum::<f64>();
        expected += payload.attributes["scale"].value(row, 2).iter().map(|v| v.exp()).sum::<f64>();
    }
    let found = report["sums"]["geometry"].as_f64().unwrap();
    assert!(
        (found - expected).abs() < 1e-6 * rows as f64,
        "sum of the geometry: {found}, expected {expected}"
    );
}

/// Largest difference of a channel due to rounding, levels of 255; limit for overlays.
const OVERLAY_LEVELS: f32 = 3.0;

#[test]
fn overlays_have_the_colours_of_a_feature_pass() {
    // Fine steps: coarse ones change the order of splats at almost the same depth.
    let default = EncodeOptions::default();
    let fixture = Fixture::with(&EncodeOptions {
        position_steps: 1e6,
        rotation_step: default.rotation_step / 16.0,
        scale_step: default.scale_step / 16.0,
        opacity_step: default.opacity_step / 16.0,
        ..default
    });
    let splats = fixture.edited.at(fixture.times[2]).unwrap();
    let colors: Vec<f32> = fixture.overlay.entries[1]
        .iter()
        .flat_map(|&entry| fixture.overlay.palette[usize::from(entry)])
        .map(|value| f32::from(value) / 255.0)
        .collect();
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&splats, &fixture.camera).unwrap();
    let output = raster.forward(&mut prepared, &splats, &colors, &RenderParams::default()).unwrap();
    let mut expected = output.features_image();
    for (pixel, alpha) in expected.data.chunks_exact_mut(3).zip(&output.alpha) {
        for (value, background) in pixel.iter_mut().zip(BACKGROUND) {
            *value += (1.0 - alpha) * background;
        }
    }
    let plain = fixture.render(&fixture.edited, 2);
    let beyond = |found: &Image, expected: &Image| {
        let differ = |(a, b): (&f32, &f32)| (a - b.clamp(0.0, 1.0)).abs() * 255.0 > OVERLAY_LEVELS;
        let count = found.data.iter().zip(&expected.data).filter(|&pair| differ(pair)).count();
        count as f64 / found.data.len() as f64
    };
    let (found, document) = fixture.open("paused&ui=0&t=0.25&wipe=0&overlay=parts&opacity=1", &[]);
    let share = beyond(&found, &expected);
    let worst =
        found.data.iter().zip(&expected.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    eprintln!("overlay: {share:.5} beyond {OVERLAY_LEVELS} levels, worst {:.1}", 255.0 * worst);
    assert_eq!(share, 0.0, "share of the values that differ by more than {OVERLAY_LEVELS}/255");
    assert!(beyond(&found, &plain) > 0.2, "the overlay is drawn");
    assert!(document.contains("three"), "the legend names the class");
    // Half of the overlay's colours and half of the splats'.
    let (found, _) = fixture.open("paused&ui=0&t=0.25&wipe=0&overlay=parts&opacity=0.498", &[]);
    let share = 127.0 / 255.0;
    for (value, plain) in expected.data.iter_mut().zip(&plain.data) {
        *value = share * *value + (1.0 - share) * plain;
    }
    assert!(beyond(&found, &expected) < MAX_BEYOND, "mixed: {}", beyond(&found, &expected));
}

/// Number of picked pixels.
const PICKED: usize = 200;

#[test]
fn the_splat_that_contributes_most_is_picked() {
    let fixture = Fixture::new();
    let splats = fixture.edited.at(fixture.times[2]).unwrap();
    // More positions than needed, because some show no splat.
    let mut state = 5_u32;
    let mut share = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    let places: Vec<String> =
        (0..6 * PICKED).map(|_| format!("{:.4},{:.4}", share(), share())).collect();
    let hash = format!("paused&ui=0&t=0.25&wipe=0&pick={}", places.join(";"));
    let (_, document) = fixture.open_as("picked", &hash, &[]);
    let picked =
        between(&document, "<pre id=\"picked\" hidden=\"\">", "</pre>").expect("an answer");
    let picked: serde_json::Value = serde_json::from_str(picked).unwrap();

    // The browser's canvas can have a smaller height than its screenshots.
    let side = |k: usize| picked["sides"][k].as_u64().unwrap() as u32;
    let (width, height) = (side(0), side(1));
    let fit = f64::min(f64::from(width) / f64::from(SIZE.0), f64::from(height) / f64::from(SIZE.1));
    let mut camera = Camera { width, height, ..fixture.camera.clone() };
    camera.intrinsics.fx *= fit;
    camera.intrinsics.fy *= fit;
    camera.intrinsics.cx = f64::from(width) / 2.0;
    camera.intrinsics.cy = f64::from(height) / 2.0;
    let raster = CpuRasterizer::default();
    let params = RenderParams::default();
    let mut prepared = raster.prepare(&splats, &camera).unwrap();
    let features = vec![0.0; splats.len()];
    let output = raster.forward(&mut prepared, &splats, &features, &params).unwrap();
    let (mut right, mut others, mut count) = (0, 0, 0);
    let mut last = None;
    for answer in picked["answers"].as_array().unwrap() {
        let place = |k: usize| answer["place"][k].as_f64().unwrap() as usize;
        let pixel = place(1) * width as usize + place(0);
        if count == PICKED || output.alpha[pixel] < 0.5 {
            continue;
        }
        count += 1;
        let mut mask = vec![0.0; output.alpha.len()];
        mask[pixel] = 1.0;
        let upstream = UpstreamGrads { v_features: mask, ..UpstreamGrads::default() };
        let weights =
            raster.backward_colors(&mut prepared, &splats, &features, &params, &upstream).unwrap();
        let weights = weights.v_features;
        let heaviest = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b]));
        let row = answer["row"].as_u64().map(|row| row as usize);
        right += usize::from(row == heaviest);
        others += usize::from(last == Some(heaviest));
        last = Some(row);
    }
    eprintln!("picked {right} of {count} right; {others} for the pixel before");
    assert_eq!(count, PICKED, "pixels that show something");
    assert!(right * 100 >= 95 * PICKED, "{right} of {PICKED} right");
    assert!(others * 100 < 20 * PICKED, "{others} right for a different pixel");
}

#[test]
fn errors_are_shown_on_the_page() {
    let fixture = Fixture::new();
    let (_, document) = fixture.open("paused", &["--disable-3d-apis"]);
    let message = problem(&document);
    assert!(message.contains("WebGL 2 is not available"), "message: {message}");
    let path = fixture.folder.path().join("page.html");
    let text = std::fs::read_to_string(&path).unwrap();
    // One character of the payload.
    let start = text.find("data-bytes=\"").unwrap() + 2000;
    let other = if text.as_bytes()[start] == b'x' { "y" } else { "x" };
    let mut damaged = text.clone();
    damaged.replace_range(start..=start, other);
    std::fs::write(&path, damaged).unwrap();
    let (_, document) = fixture.open("paused", &[]);
    let message = problem(&document);
    assert!(message.contains("damaged"), "message: {message}");
}
