//! [`Session`]: responses to the requests of the page.

use super::http::{Request, Response};
use super::saved_cameras::SavedCameras;
use super::shown_scene::ShownScene;
use crate::console::Console;
use gs_edit::Script;
use serde::Deserialize;
use serde_json::json;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Served scenes and files, shared by the threads of all connections.
#[derive(Debug)]
pub(super) struct Session<'a> {
    pub(super) page: String,
    pub(super) shown: Mutex<Shown>,
    pub(super) cameras: SavedCameras,
    pub(super) console: &'a Console,
}

/// The current scenes.
#[derive(Debug)]
pub(super) struct Shown {
    pub(super) scenes: Vec<Arc<ShownScene>>,
    /// Version of each scene; incremented by each reload.
    pub(super) versions: Vec<u64>,
    /// Error of the last reload, if it failed.
    pub(super) problem: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Drawn {
    scene: usize,
    frame: usize,
    expression: String,
}

impl Session<'_> {
    /// The current scenes.
    pub(super) fn shown(&self) -> MutexGuard<'_, Shown> {
        // Scenes are replaced as a whole, so they are complete even after a panic.
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The response to an admitted request; `path` is relative to the page's folder.
    pub(super) fn answer(&self, request: &Request, path: &str) -> Response {
        let reads = request.method == "GET";
        match path.split_once('/').unwrap_or((path, "")) {
            ("", "") if reads => Response::html(self.page.clone()),
            ("state", "") if reads => {
                let shown = self.shown();
                Response::json(&json!({ "versions": shown.versions, "problem": shown.problem }))
            }
            ("source", index) if reads => self.source(index),
            ("splat", "") if reads => self.splat(request),
            ("camera", "") if !reads => self.camera(request),
            ("selection", "") if !reads => self.selection(request),
            _ => Response::refusal(404, "no such address"),
        }
    }

    fn source(&self, index: &str) -> Response {
        let scene = index.parse().ok().and_then(|i: usize| self.shown().scenes.get(i).cloned());
        let Some(scene) = scene else { return Response::refusal(404, "no such scene") };
        match gs_player::source_file(&scene.encoded) {
            Ok(file) => Response::bytes(file),
            Err(error) => Response::refusal(500, error),
        }
    }

    /// The scene with this number in the page, and whether its state before the edit is meant.
    fn scene(&self, number: usize) -> Option<(Arc<ShownScene>, bool)> {
        let shown = self.shown();
        let mut sides = shown.scenes.iter().flat_map(|scene| {
            let sides = if scene.has_before { &[true, false][..] } else { &[false] };
            sides.iter().map(move |&before| (scene.clone(), before))
        });
        sides.nth(number)
    }

    fn splat(&self, request: &Request) -> Response {
        let number = |name| request.value(name).and_then(|text| text.parse::<usize>().ok());
        let found = number("scene").zip(number("row")).and_then(|(scene, row)| {
            let (scene, before) = self.scene(scene)?;
            scene.descriptions.describe(before, row)
        });
        match found {
            Some(found) => Response::json(&json!(found)),
            None => Response::refusal(404, "no such splat"),
        }
    }

    fn camera(&self, request: &Request) -> Response {
        match self.cameras.add(&request.body) {
            Ok((name, file)) => {
                let scene = self.scene(0).map(|(scene, _)| scene.path().clone());
                let command = format!(
                    "c4d render {} --cameras {} --views {name} -o {name}",
                    quoted(&scene.unwrap_or_default()),
                    quoted(&file)
                );
                self.console.result(&command);
                let message = format!("Saved as {name} in {}", file.display());
                Response::json(&json!({ "message": message, "command": command }))
            }
            Err(reason) => Response::refusal(400, reason),
        }
    }

    fn selection(&self, request: &Request) -> Response {
        let drawn: Drawn = match serde_json::from_slice(&request.body) {
            Ok(drawn) => drawn,
            Err(error) => return Response::refusal(400, error),
        };
        // The expression is printed in the terminal, so it may contain only characters of the
        // selection language.
        let expression = drawn.expression.as_str();
        let printable = expression.bytes().all(|byte| (b' '..=b'~').contains(&byte));
        let quoteless = !expression.contains('\'');
        let parsed = Script::parse([("select", expression)]).is_ok();
        if !(printable && quoteless && parsed) {
            return Response::refusal(400, "not an expression of c4d edit --select");
        }
        let Some((scene, before)) = self.scene(drawn.scene) else {
            return Response::refusal(404, "no such scene");
        };
        let Some(time) = scene.times.get(drawn.frame) else {
            return Response::refusal(404, "no such frame");
        };
        let time =
            if scene.opened.kind.is_frame() { String::new() } else { format!(" --time {time}") };
        let path = quoted(scene.path_of(before));
        let command = format!("c4d edit {path}{time} --select '{expression}' --stats");
        self.console.result(&command);
        Response::json(&json!({ "command": command }))
    }
}

/// A path, quoted for the shell.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/._-+=:,@%".contains(&byte);
    if !text.is_empty() && text.bytes().all(plain) {
        return text;
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_one_word() {
        assert_eq!(quoted(Path::new("runs/a-1.ply")), "runs/a-1.ply", "plain");
        assert_eq!(quoted(Path::new("my run")), "'my run'", "space");
        assert_eq!(quoted(Path::new("it's; rm")), r"'it'\''s; rm'", "quote");
        assert_eq!(quoted(Path::new("")), "''", "empty");
    }
}
