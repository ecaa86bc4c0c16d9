//! Reloads scenes whose files change.

use super::session::Session;
use super::shown_scene::ShownScene;
use crate::args::{Global, ViewArgs};
use crate::console::Console;
use crate::run_folder::{CONFIG, REFINE_REPORT, SCENE};
use crate::still;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// Interval between checks of the files.
const INTERVAL: Duration = Duration::from_millis(500);

/// A file with its size and modification time; `None` if it does not exist.
pub(super) type Entry = (PathBuf, Option<(u64, SystemTime)>);
/// State of the files of a scene.
type Stamp = Vec<Entry>;

/// Current state of the files of the scene at `path`.
pub(super) fn stamp(path: &Path, files: &[PathBuf]) -> Stamp {
    let of_run = [SCENE, CONFIG, REFINE_REPORT].map(|name| path.join(name));
    let all = files.iter().cloned().chain(of_run).chain([path.to_owned()]);
    all.map(|file| {
        let data = std::fs::metadata(&file).ok().filter(std::fs::Metadata::is_file);
        let seen = data.and_then(|data| Some((data.len(), data.modified().ok()?)));
        (file, seen)
    })
    .collect()
}

/// Waits until `path` exists.
pub(super) fn wait_for(path: &Path, console: &Console) {
    if path.exists() {
        return;
    }
    console.note(format!("waiting for {}", path.display()));
    while !path.exists() {
        std::thread::sleep(INTERVAL);
    }
}

/// Reloads scenes after their files changed and then stayed unchanged for an interval. `seen` are
/// the stamps at the time of loading. Does not return.
pub(super) fn follow(
    session: &Session<'_>,
    mut seen: Vec<Stamp>,
    args: &ViewArgs,
    global: &Global,
) {
    let console = session.console;
    let mut before = seen.clone();
    loop {
        std::thread::sleep(INTERVAL);
        for index in 0..seen.len() {
            let scene = session.shown().scenes[index].clone();
            let now = stamp(scene.path(), &scene.opened.files);
            let rests = now == before[index];
            before[index].clone_from(&now);
            if !rests || now == seen[index] {
                continue;
            }
            seen[index] = now;
            let frames = scene.times.len();
            let new = still::open(scene.path(), None, global, console)
                .and_then(|opened| ShownScene::encode(opened, frames, args, global, console));
            match new {
                // The number of scenes in the page is fixed.
                Ok(new) if new.has_before == scene.has_before => {
                    console.note(format!("reloaded {}", scene.path().display()));
                    let mut shown = session.shown();
                    shown.scenes[index] = Arc::new(new);
                    shown.versions[index] += 1;
                    shown.problem = None;
                }
                Ok(_) => {
                    let what = format!(
                        "{} is now a different kind of scene: restart c4d view",
                        scene.path().display()
                    );
                    console.warn(&what);
                    session.shown().problem = Some(what);
                }
                Err(failure) => {
                    console.warn(format!("not reloaded: {}", failure.what));
                    session.shown().problem = Some(failure.what);
                }
            }
        }
    }
}
