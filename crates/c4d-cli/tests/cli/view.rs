//! `c4d view`: the server with raw sockets, the page in headless Chromium.

use crate::support::{c4d, failure, fixture, success};
use crate::synth_run::synth_run;
use gs_core::DynamicScene;
use gs_io::ply::{self, WriteOptions, comments};
use gs_io::{Existing, ply_sequence};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Size of the browser's window.
const SIZE: (u32, u32) = (480, 360);
/// Timeout for a reload.
const PATIENCE: Duration = Duration::from_mins(1);

/// A running `c4d view`, ended when it is dropped.
struct Server {
    child: Child,
    lines: BufReader<std::process::ChildStdout>,
    port: u16,
    token: String,
}

impl Server {
    fn start(arguments: &[&str], scenes: &[&Path], folder: &Path) -> Self {
        let mut child = Command::new(assert_cmd::cargo::cargo_bin!("c4d"))
            .arg("view")
            .args(scenes)
            .args(["--no-open", "--no-progress"])
            .args(arguments)
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        let mut address = String::new();
        lines.read_line(&mut address).unwrap();
        let rest = address.trim().strip_prefix("http://127.0.0.1:").expect("prints its address");
        let (port, token) = rest.trim_end_matches('/').split_once('/').unwrap();
        let (port, token) = (port.parse().unwrap(), token.to_owned());
        Self { child, lines, port, token }
    }

    /// Sends bytes; returns the status and the body of the response.
    fn raw(&self, request: &str) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8_lossy(&answer[..end]).into_owned();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        assert!(head.contains("X-Content-Type-Options: nosniff"), "{head}");
        assert!(!head.to_ascii_lowercase().contains("access-control"), "no other site: {head}");
        (status, answer.split_off(end + 4))
    }

    fn get(&self, path: &str) -> (u16, Vec<u8>) {
        let (port, token) = (self.port, &self.token);
        self.raw(&format!("GET /{token}/{path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n"))
    }

    fn json(&self, path: &str) -> Value {
        let (status, body) = self.get(path);
        assert_eq!(status, 200, "{path}: {}", String::from_utf8_lossy(&body));
        serde_json::from_slice(&body).unwrap()
    }

    /// Opens the page in the browser with these start options; returns the document and a
    /// screenshot.
    fn browse(&self, hash: &str, folder: &Path) -> (String, image::RgbImage) {
        let profile = tempfile::tempdir().unwrap();
        let picture = folder.join("screen.png");
        let address = format!("http://127.0.0.1:{}/{}/#hold&{hash}", self.port, self.token);
        let output = Command::new(browser())
            .args(["--headless=new", "--no-sandbox", "--use-angle=swiftshader"])
            .args(["--enable-unsafe-swiftshader", "--hide-scrollbars", "--dump-dom"])
            .args(["--force-device-scale-factor=1", "--disable-dev-shm-usage", "--no-first-run"])
            .args(["--disable-extensions", "--disable-background-networking"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg(format!("--window-size={},{}", SIZE.0, SIZE.1))
            .arg(format!("--screenshot={}", picture.display()))
            .arg(address)
            .stderr(Stdio::null())
            .output()
            .unwrap();
        let document = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(picture.is_file(), "no screenshot of #{hash}: {document}");
        (document, image::open(picture).unwrap().to_rgb8())
    }

    /// The next line of its standard output.
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        line
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn browser() -> PathBuf {
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let on_path = std::env::split_paths(&folders)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|path| path.is_file());
    std::env::var_os("CHROMIUM")
        .map(PathBuf::from)
        .or(on_path)
        .expect("this test needs Chromium: apt-get install chromium, or name a browser in CHROMIUM")
}

/// The demo's scene, dense enough that its floor does not hide the figure, and a run of its edit.
fn figure(folder: &Path) -> (PathBuf, PathBuf) {
    let (source, frame, run) =
        (folder.join("figure"), folder.join("edited.ply"), folder.join("run"));
    let params = gs_synth::DemoParams { num_splats: 12_000, ..gs_synth::DemoParams::default() };
    let scene = gs_synth::demo(&params).unwrap();
    let edit = gs_synth::apply_edits(&scene, &gs_synth::demo_edits(), 7).unwrap();
    let options = WriteOptions {
        comments: comments::up_comments([0.0, 1.0, 0.0]),
        ..WriteOptions::default()
    };
    let times = scene.time_range().frames(3);
    let (refuse, progress) = (Existing::Refuse, &mut |_| {});
    ply_sequence::write_folder(&source, &scene, &times, &options, refuse, progress).unwrap();
    ply::write_file(&frame, &edit.splats, &options, Existing::Refuse).unwrap();
    let arguments = ["--no-refine", "-o"];
    success(c4d(["propagate"]).arg(&source).arg("--edited").arg(frame).args(arguments).arg(&run));
    (source, run)
}

/// All numbers of an array, at any depth.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(parts) => parts.iter().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}

/// The text of the first element that begins with `start`.
fn text_of<'a>(document: &'a str, start: &str) -> &'a str {
    let (_, rest) = document.split_once(start).unwrap_or_else(|| panic!("no {start}: {document}"));
    let rest = rest.split_once('>').unwrap().1;
    rest.split_once('<').unwrap().0
}

#[test]
fn only_the_page_itself_is_answered() {
    let folder = tempfile::tempdir().unwrap();
    let source = fixture("synth/source");
    let server = Server::start(&["--frames", "2"], &[&source], folder.path());
    let (port, token) = (server.port, server.token.clone());
    let own = format!("127.0.0.1:{port}");
    let status = |method: &str, path: &str, headers: &str| {
        server.raw(&format!("{method} {path} HTTP/1.1\r\n{headers}\r\n")).0
    };
    let page = format!("/{token}/");
    assert_eq!(status("GET", &page, &format!("Host: {own}\r\n")), 200, "the page");
    // A forwarded port may differ.
    assert_eq!(status("GET", &page, "Host: localhost:9000\r\n"), 200, "forwarded");
    for host in ["evil.example", &format!("evil.example:{port}"), "127.0.0.1.evil.example"] {
        assert_eq!(status("GET", &page, &format!("Host: {host}\r\n")), 403, "{host}");
    }
    assert_eq!(status("GET", &page, ""), 400, "no host");
    let post = format!("/{token}/camera");
    for origin in ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost"] {
        let headers = format!("Host: {own}\r\nOrigin: {origin}\r\nContent-Length: 0\r\n");
        assert_eq!(status("POST", &post, &headers), 403, "{origin}");
        assert_eq!(status("GET", &page, &headers), 403, "{origin}");
    }
    let headers = format!("Host: {own}\r\nContent-Length: 0\r\n");
    assert_eq!(status("POST", &post, &headers), 403, "no origin");
    let host = format!("Host: {own}\r\n");
    for path in ["/", "/0123/", &format!("/{token}"), &format!("/{}/", &token[1..])] {
        assert_eq!(status("GET", path, &host), 404, "{path}");
    }
    for path in ["../../etc/passwd", "source/9", "source/-1", "splat?scene=0&row=99999999", "x"] {
        assert_eq!(server.get(path).0, 404, "{path}");
    }
    assert_eq!(status("DELETE", &page, &host), 403, "no origin");
    let huge = format!("{host}X: {}\r\n", "a".repeat(40_000));
    assert_eq!(status("GET", &page, &huge), 413, "a long head");
    let body = format!("{host}Origin: http://{own}\r\nContent-Length: 99999999\r\n");
    assert_eq!(status("POST", &post, &body), 413, "a long body");
    assert_eq!(server.raw("nonsense\r\n\r\n").0, 400, "no request");
    assert_eq!(server.json("state")["versions"], serde_json::json!([1]), "still served");
}

#[test]
fn the_page_shows_what_splats_are_selects_and_saves_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let (source, run) = figure(folder.path());
    let mut server = Server::start(&["--frames", "3"], &[&run], folder.path());

    // The edited scene right of the divider, at its middle.
    let start = "paused&ui=0&t=0&wipe=0";
    let (document, _) = server.browse(&format!("{start}&inspect=.5,.5&save"), folder.path());
    let title = text_of(&document, "id=\"inspector-title\"");
    assert!(title.contains("of the edit"), "what it is: {title}");
    assert!(document.contains("<dt>Motion</dt>") && document.contains("<dt>Why</dt>"), "why");
    server.browse(&format!("{start}&turn=20&save"), folder.path());
    let saved = folder.path().join("view_cameras.json");
    let cameras: Value = serde_json::from_slice(&std::fs::read(&saved).unwrap()).unwrap();
    // The front view of other commands, and another view.
    let frozen = folder.path().join("frozen");
    success(c4d(["freeze"]).arg(&source).arg("-o").arg(&frozen));
    let text = std::fs::read(frozen.join("cameras.json")).unwrap();
    let front: Value = serde_json::from_slice(&text).unwrap();
    let apart = |camera: &Value, key: &str| {
        let pairs = numbers(&camera[key]).into_iter().zip(numbers(&front[0][key]));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for key in ["position", "rotation"] {
        assert!(apart(&cameras[0], key) < 1e-4, "{key}: {} and {}", cameras[0], front[0]);
        assert!(apart(&cameras[1], key) > 0.05, "turned, {key}: {}", cameras[1]);
    }
    for name in ["view_1", "view_2"] {
        let line = server.line();
        assert!(line.contains(&format!("--cameras view_cameras.json --views {name}")), "{line}");
    }
    let out = folder.path().join("rendered");
    let arguments = ["--views", "view_2", "--times", "0", "-o"];
    success(c4d(["render"]).arg(&run).arg("--cameras").arg(saved).args(arguments).arg(&out));
    assert!(out.join("rgb/00000.png").is_file(), "it renders");

    // Selections contain as many splats as those of c4d edit.
    let shapes = [("box=.42,.35,.58,.55", "plane"), ("brush=.49,.42;.5,.5;.5,.56", "sphere")];
    for (shape, kind) in shapes {
        let (document, _) = server.browse(&format!("{start}&{shape}"), folder.path());
        let answer = text_of(&document, "id=\"answered\"").replace("&amp;", "&");
        let answer: Value = serde_json::from_str(&answer).unwrap();
        let expression = answer["expression"].as_str().unwrap();
        assert!(expression.starts_with(kind), "{expression}");
        let line = server.line();
        assert!(line.contains(&format!("--time 0 --select '{expression}' --stats")), "{line}");
        assert_eq!(line.trim(), answer["command"].as_str().unwrap(), "the same on the page");
        let arguments = ["--time", "0", "--select", expression, "--stats"];
        let (said, _) = success(c4d(["edit"]).arg(&run).args(arguments));
        let counted = said.lines().find_map(|line| {
            let (_, rest) = line.rsplit_once(": ")?;
            rest.split_once(" of ")?.0.parse::<f64>().ok()
        });
        let (found, expected) = (answer["count"].as_f64().unwrap(), counted.expect("a count"));
        assert!(found > 10.0, "something is selected: {answer}");
        // Centres in the page are rounded, and splats that are never visible are omitted.
        assert!((found - expected).abs() <= 2.0 + 0.02 * expected, "{found}, edit: {expected}");
    }
}

#[test]
fn several_scenes_share_camera_and_clock_and_reload() {
    let folder = tempfile::tempdir().unwrap();
    let (source, run) = (fixture("synth/source"), synth_run(folder.path()));
    let frame = folder.path().join("frame.ply");
    std::fs::copy(fixture("synth/edited.ply"), &frame).unwrap();
    let server =
        Server::start(&["--frames", "2", "--watch"], &[&source, &run, &frame], folder.path());
    let (document, grid) =
        server.browse("paused&ui=0&t=0&mode=grid&overlay=changed", folder.path());
    assert!(document.contains(">frame.ply<") && document.contains(">run<"), "names");
    assert!(document.contains("What the edit changed"), "an overlay that one scene has");
    // Run and frame are the same at the edited frame, in the right half of the first line and in
    // the left half of the second; the source in the first cell is not edited.
    let (width, height) = (SIZE.0 / 2 - 4, SIZE.1 / 2 - 4);
    let cell = |x: u32, y: u32| {
        image::imageops::crop_imm(&grid, x + 3, y + 3, width - 6, height - 6).to_image()
    };
    let share = |a: &image::RgbImage| a.pixels().filter(|pixel| pixel.0 != [0, 0, 0]).count();
    for (x, y) in [(0, 0), (SIZE.0 / 2, 0), (0, SIZE.1 / 2)] {
        assert!(share(&cell(x, y)) > 300, "a scene in the cell at {x}, {y}");
    }
    assert_eq!(share(&cell(SIZE.0 / 2, SIZE.1 / 2)), 0, "no fourth scene");
    let (_, blink) = server.browse("paused&ui=0&t=0&mode=single&show=2", folder.path());
    assert!(share(&blink) > 1000, "one scene alone");

    // Another edit of the frame.
    let before = server.json("state");
    assert_eq!(before["versions"], serde_json::json!([1, 1, 1]), "as loaded");
    let arguments = ["--select", "all", "--brightness", ".2", "-w", "-o"];
    success(c4d(["edit"]).arg(fixture("synth/edited.ply")).args(arguments).arg(&frame));
    let begun = Instant::now();
    while server.json("state")["versions"] != serde_json::json!([1, 1, 2]) {
        assert!(begun.elapsed() < PATIENCE, "not reloaded: {}", server.json("state"));
        std::thread::sleep(Duration::from_millis(100));
    }
    std::fs::write(&frame, b"damaged").unwrap();
    while server.json("state")["problem"].is_null() {
        assert!(begun.elapsed() < PATIENCE, "no problem: {}", server.json("state"));
        std::thread::sleep(Duration::from_millis(100));
    }
    assert_eq!(server.get("source/2").0, 200, "the last state is kept");
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let said = failure(&mut c4d(["view", "nowhere", "--no-open"]), 3);
    assert!(said.contains("nowhere does not exist") && said.contains("--watch"), "{said}");
    let source = fixture("synth/source");
    let taken = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let said = failure(
        c4d(["view"]).arg(&source).args(["--frames", "1", "--no-open", "--port", &port]),
        1,
    );
    assert!(said.contains("cannot listen on 127.0.0.1") && said.contains("--port"), "{said}");
}
