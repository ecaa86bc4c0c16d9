//! `c4d view`: scenes in the browser, served on this machine only.

mod browser;
mod description;
mod guard;
mod http;
mod saved_cameras;
mod session;
mod shown_scene;
mod watch;

use crate::args::{Global, Up, ViewArgs};
use crate::camera_rig::{CameraRig, DEFAULT_SIZE};
use crate::commands::export::page_failure;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames::Timing;
use crate::output::existing;
use crate::scene::LoadedScene;
use crate::still;
use gs_player::{Page, PageScenes};
use guard::Token;
use http::Response;
use saved_cameras::SavedCameras;
use session::{Session, Shown};
use shown_scene::ShownScene;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// Maximum number of simultaneous connections; a page opens up to six.
const MAX_CONNECTIONS: usize = 32;

static SERVING: AtomicBool = AtomicBool::new(false);

/// Whether a page is being served, in which case an interrupt is the normal way to exit.
pub(crate) fn is_serving() -> bool {
    SERVING.load(Ordering::Relaxed)
}

pub(crate) fn run(args: &ViewArgs, global: &Global, console: &Console) -> Outcome {
    if let Some(degree) = args.sh_degree.filter(|degree| *degree > 3) {
        return Err(Failure::usage(format!("--sh-degree {degree}: expected 0 to 3")));
    }
    for path in &args.scenes {
        if args.watch {
            watch::wait_for(path, console);
        }
        shown_scene::check_exists(path)?;
    }
    let mut opened = Vec::new();
    let mut stamps = Vec::new();
    for path in &args.scenes {
        let before = watch::stamp(path, &[]);
        opened.push(still::open(path, None, global, console)?);
        stamps.push(before);
    }
    check_overlays(args, &opened)?;
    let (frames, fps) = timing(args, &opened)?;
    let mut scenes = Vec::new();
    for (opened, stamp) in opened.into_iter().zip(&mut stamps) {
        // Taken before reading, so that changes during reading are detected.
        let now = watch::stamp(&opened.path, &opened.files);
        let old = |entry: &watch::Entry| stamp.iter().find(|old| old.0 == entry.0).cloned();
        *stamp = now.into_iter().map(|entry| old(&entry).unwrap_or(entry)).collect();
        scenes.push(Arc::new(ShownScene::encode(opened, frames, args, global, console)?));
    }
    let page = page(&scenes, fps, args)?;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, args.port)).map_err(|error| {
        Failure::failed(format!("cannot listen on 127.0.0.1:{}: {error}", args.port))
            .next("Omit --port to use a free one.")
    })?;
    let port = listener.local_addr().map_err(Failure::failed)?.port();
    let token = Token::random()?;
    let address = format!("http://127.0.0.1:{port}/{}/", token.as_str());
    let session = Session {
        page,
        shown: Mutex::new(Shown { versions: vec![1; scenes.len()], scenes, problem: None }),
        cameras: SavedCameras::new(args.save_cameras.clone(), existing(global)),
        console,
    };
    SERVING.store(true, Ordering::Relaxed);
    console.result(&address);
    console.note("press Ctrl-C to stop");
    if browser::is_remote() {
        console.note(format!(
            "from your machine: ssh -L {port}:127.0.0.1:{port} HOST, then open the same address"
        ));
    }
    if !args.no_open {
        browser::open(&address);
    }
    let open = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        if args.watch {
            scope.spawn(|| watch::follow(&session, stamps, args, global));
        }
        for stream in listener.incoming() {
            // A failed connection does not stop the server.
            let Ok(stream) = stream else { continue };
            let (open, session, token) = (&open, &session, &token);
            if open.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS {
                refuse(stream);
                open.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            let serve = move || {
                let end = Closing(open);
                serve(stream, session, token);
                drop(end);
            };
            if std::thread::Builder::new().spawn_scoped(scope, serve).is_err() {
                open.fetch_sub(1, Ordering::Relaxed);
            }
        }
    });
    Ok(())
}

/// Counts a connection as closed when dropped, also after a panic.
struct Closing<'a>(&'a AtomicUsize);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

fn refuse(mut stream: TcpStream) {
    // The client may have disconnected.
    let _ = Response::refusal(503, "too many connections").write(&mut stream);
}

/// Answers the request of a connection.
fn serve(mut stream: TcpStream, session: &Session<'_>, token: &Token) {
    let response = match http::read(&mut stream) {
        Ok(None) => return,
        Ok(Some(request)) => match guard::admit(&request, token) {
            Ok(path) => session.answer(&request, path),
            Err(refusal) => refusal,
        },
        Err(refusal) => refusal,
    };
    // The client may have disconnected.
    if response.write(&mut stream).is_ok() {
        http::close(stream);
    }
}

/// Refuses overlays that apply to none of the scenes.
fn check_overlays(args: &ViewArgs, scenes: &[LoadedScene]) -> Outcome {
    let has_run = scenes.iter().any(|opened| opened.binding.is_some());
    match args.overlay.iter().find(|kind| kind.needs_run() && !has_run) {
        Some(kind) => Err(Failure::usage(format!(
            "the overlay `{}` compares a run with its source; no SCENE is a run",
            kind.name()
        ))
        .next("Specify a run folder that c4d propagate wrote, or choose parts or motion.")),
        None => Ok(()),
    }
}

/// Number of frames, by default that of the first dynamic scene, and their rate.
fn timing(args: &ViewArgs, scenes: &[LoadedScene]) -> Outcome<(usize, f64)> {
    let timing = Timing { frames: args.frames, fps: args.fps, ..Timing::default() };
    timing.check()?;
    let moving = scenes.iter().find(|opened| !opened.kind.is_frame());
    let Some(moving) = moving else { return Ok((1, args.fps.unwrap_or(1.0))) };
    let times = timing.times(moving.scene.as_ref())?;
    Ok((times.len(), timing.fps(moving, &times)?))
}

/// The page; the initial view frames the first scene before its edit.
fn page(scenes: &[Arc<ShownScene>], fps: f64, args: &ViewArgs) -> Outcome<String> {
    let first = &scenes[0].opened;
    let framed = first.original.as_ref().unwrap_or(&first.scene);
    let up = args.up.map_or(first.up, Up::vector);
    let rig = CameraRig::of_scene(framed.as_ref(), up).map_err(Failure::input)?;
    let camera = rig.front(DEFAULT_SIZE);
    let names = names(scenes);
    let pairs = scenes.iter().zip(&names).map(|(scene, name)| PageScenes {
        encoded: &scene.encoded,
        names: if scene.has_before { ["Original", "Edited"] } else { [name, ""] },
    });
    let title = names.join(" · ");
    let page = Page {
        title: &title,
        fps,
        camera: &camera,
        target: rig.target().to_array(),
        up,
        limits: rig.limits(),
        background: first.background,
        poster: None,
    };
    gs_player::served_page(&pairs.collect::<Vec<_>>(), &page).map_err(|error| page_failure(&error))
}

/// Last components of the paths, or whole paths if these are not distinct.
fn names(scenes: &[Arc<ShownScene>]) -> Vec<String> {
    let last = |scene: &Arc<ShownScene>| {
        let path = scene.path();
        path.file_name()
            .map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
    };
    let short: Vec<String> = scenes.iter().map(last).collect();
    let repeats = |name: &String| short.iter().filter(|other| *other == name).count() > 1;
    let whole = |(scene, name): (&Arc<ShownScene>, &String)| {
        if repeats(name) { scene.path().display().to_string() } else { name.clone() }
    };
    scenes.iter().zip(&short).map(whole).collect()
}
