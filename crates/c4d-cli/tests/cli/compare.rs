//! `c4d compare`, with its page in headless Chromium. Without Chromium these tests fail; they are
//! not skipped.

use crate::support::{c4d, failure, fixture, success};
use std::io::Read;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Two runs of the synthetic fixture's edit with different methods.
fn runs(folder: &Path) -> [PathBuf; 2] {
    ["default", "paper"].map(|preset| {
        let run = folder.join(preset);
        success(
            c4d(["propagate"])
                .arg(fixture("synth/source"))
                .arg("--edited")
                .arg(fixture("synth/edited.ply"))
                .args(["--no-refine", "--preset", preset, "-o"])
                .arg(&run),
        );
        run
    })
}

fn browser() -> PathBuf {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let on_path = std::env::split_paths(&folders)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|path| path.is_file());
    named.or(on_path).expect("these tests need Chromium: apt-get install chromium, or CHROMIUM")
}

/// Opens `page` with the divider at `percent`; all requests except for files go to `proxy`.
fn screenshot(page: &Path, percent: u32, proxy: &str, picture: &Path) -> image::RgbImage {
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser())
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        .args(["--hide-scrollbars", "--force-device-scale-factor=1", "--no-first-run"])
        .args(["--disable-extensions", "--disable-background-networking", "--disable-sync"])
        .args(["--disable-component-update", "--disable-default-apps"])
        .arg(format!("--proxy-server={proxy}"))
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg("--window-size=1200,3000")
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}#{percent}", page.display()))
        .stderr(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "the browser ended with {}", output.status);
    image::open(picture).unwrap().to_rgb8()
}

/// A proxy that serves nothing and counts requests for hosts other than the browser vendor's.
fn proxy() -> (String, Arc<AtomicUsize>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let count = Arc::new(AtomicUsize::new(0));
    let seen = Arc::clone(&count);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let Ok(mut stream) = stream else { continue };
            let mut head = [0; 512];
            let length = stream.read(&mut head).unwrap_or(0);
            if String::from_utf8_lossy(&head[..length]).contains("c4d-report.invalid") {
                seen.fetch_add(1, Ordering::SeqCst);
            }
        }
    });
    (address, count)
}

#[test]
fn runs_are_compared_in_one_page_that_opens_offline() {
    let folder = tempfile::tempdir().unwrap();
    let [default, paper] = runs(folder.path());
    let page = folder.path().join("report.html");
    let (out, stderr) = success(
        c4d(["compare"])
            .args([&default, &paper])
            .args(["--frames", "5", "--size", "160x120", "-o"])
            .arg(&page),
    );
    assert!(out.contains("report.html") && stderr.contains("2 runs"), "{out}{stderr}");
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.len() < 10_000_000, "{} bytes", html.len());
    let sections = ["first", "sheet", "curves", "numbers", "cost", "settings", "warnings"];
    let at: Vec<usize> =
        sections.iter().map(|id| html.find(&format!("<section id=\"{id}\"")).unwrap()).collect();
    assert!(at.is_sorted(), "in this order: {at:?}");
    assert!(html.contains("<b>") && html.contains("→1"), "the best in bold, with arrows");
    assert!(html.contains("<th>preset</th>"), "settings that differ");
    assert!(html.contains("<svg") && !html.contains("<img alt=\"\""), "curves are vector");
    for scheme in ["http://", "https://", "//cdn"] {
        assert!(!html.contains(scheme), "nothing to fetch: {scheme}");
    }

    let (address, requests) = proxy();
    let screenshot_at = |percent: u32| {
        let name = format!("{percent}.png");
        screenshot(&page, percent, &address, &folder.path().join(name))
    };
    let (all_after, all_before) = (screenshot_at(0), screenshot_at(100));
    let differing = all_after.pixels().zip(all_before.pixels()).filter(|(a, b)| a != b).count();
    assert!(differing > 500, "the divider reveals the other pictures: {differing} pixels");
    let again = screenshot_at(0);
    assert_eq!(again, all_after, "and nothing else changes");
    assert_eq!(requests.load(Ordering::SeqCst), 0, "no request");

    // Negative control: requests of a page reach the proxy unless its policy forbids them.
    let policy = html.find("<meta http-equiv").unwrap();
    let end = policy + html[policy..].find('>').unwrap() + 1;
    let fetching = "<img src=\"http://c4d-report.invalid/x.png\">";
    let open = html.replace(&html[policy..end], "").replace("<h1>", &format!("{fetching}<h1>"));
    let guarded = html.replace("<h1>", &format!("{fetching}<h1>"));
    for (text, expected) in [(guarded, false), (open, true)] {
        let changed = folder.path().join("changed.html");
        std::fs::write(&changed, text).unwrap();
        screenshot(&changed, 50, &address, &folder.path().join("changed.png"));
        assert_eq!(requests.load(Ordering::SeqCst) > 0, expected, "as the policy allows");
    }
}

#[test]
fn numbers_with_different_parameters_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [default, paper] = runs(folder.path());
    let numbers = |run: &Path, name: &str, frames: &str| {
        let file = folder.path().join(name);
        success(
            c4d(["eval"]).arg(run).args(["--frames", frames, "--size", "80x60", "-o"]).arg(&file),
        );
        file
    };
    let [a, b, c] =
        [numbers(&default, "a", "3"), numbers(&paper, "b", "3"), numbers(&paper, "c", "4")];
    let page = folder.path().join("report.html");
    let compare = |second: &Path| {
        let list = format!("{},{}", a.display(), second.display());
        let mut command = c4d(["compare"]);
        command.args([&default, &paper]).args(["--numbers", &list, "-o"]).arg(&page);
        command
    };
    let stderr = failure(&mut compare(&c), 2);
    assert!(
        stderr.contains("different frames") && stderr.contains("cannot be compared"),
        "{stderr}"
    );
    assert!(!page.exists(), "nothing is written");
    success(&mut compare(&b));
    assert!(page.exists(), "the same parameters");
    std::fs::write(&b, "{}").unwrap();
    let stderr = failure(compare(&b).arg("-w"), 3);
    assert!(stderr.contains("not a metrics.json"), "{stderr}");
}
