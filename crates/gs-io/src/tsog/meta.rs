//! `meta.json` of a `.tsog` archive, and its checks that need no planes.

use crate::fs::text;
use serde::Deserialize;
use serde_json::{Map, Value};

/// Name of the entry.
pub(super) const META: &str = "meta.json";
/// Version of the encoding.
const VERSION: u64 = 4;
/// The known interpretation of playback fields.
const PROFILE: (&str, u64) = ("org.opsiclear.tsog-playback", 1);
/// Frames per second without a stored rate.
const FPS: f64 = 30.0;
/// Frames of a continuous timeline without a stored duration.
const FRAMES: f64 = 300.0;
/// Largest number of frames of a discrete timeline: its codes have 16 bits.
const MAX_FRAMES: u64 = 1 << 16;
/// Largest plausible number of frames of a continuous timeline.
const MAX_DISPLAYED: f64 = (1_u64 << 20) as f64;

#[derive(Debug, Deserialize)]
pub(super) struct Meta {
    version: u64,
    profile: Option<Profile>,
    pub(super) count: u64,
    pub(super) means: Means,
    pub(super) scales: Coded,
    pub(super) quats: Files,
    pub(super) sh0: Coded,
    #[serde(rename = "shN")]
    pub(super) sh_n: Option<Palette>,
    timeline: Option<RawTimeline>,
    temporal: Option<Map<String, Value>>,
    fps: Option<f64>,
    playback: Option<RawPlayback>,
    audio: Option<Value>,
}

#[derive(Debug, Deserialize)]
struct Profile {
    id: String,
    version: u64,
}

#[derive(Debug, Deserialize)]
pub(super) struct Means {
    pub(super) mins: [f32; 3],
    pub(super) maxs: [f32; 3],
    pub(super) files: [String; 2],
}

#[derive(Debug, Deserialize)]
pub(super) struct Coded {
    pub(super) codebook: Vec<f32>,
    pub(super) files: [String; 1],
}

#[derive(Debug, Deserialize)]
pub(super) struct Files {
    pub(super) files: [String; 1],
}

#[derive(Debug, Deserialize)]
pub(super) struct Palette {
    pub(super) bands: usize,
    pub(super) count: usize,
    pub(super) codebook: Vec<f32>,
    pub(super) files: [String; 2],
}

#[derive(Debug, Deserialize)]
struct RawTimeline {
    #[serde(rename = "type")]
    kind: u64,
    #[serde(rename = "N")]
    frames: Option<u64>,
    delta: Option<u64>,
    mins: Option<[f32; 2]>,
    maxs: Option<[f32; 2]>,
    files: [String; 2],
}

#[derive(Debug, Deserialize)]
struct RawPlayback {
    duration: Option<f64>,
    fps: Option<f64>,
}

/// Velocities, units of length per whole clip, in one plane (8 bits) or two (16 bits).
#[derive(Debug, Deserialize)]
pub(super) struct Velocities {
    pub(super) mins: [[f32; 3]; 1],
    pub(super) maxs: [[f32; 3]; 1],
    pub(super) files: Vec<String>,
}

/// When splats are visible.
#[derive(Debug)]
pub(super) enum Timeline {
    Static,
    /// Each splat is visible in one of `frames` frames: its code divided by `delta`.
    Discrete {
        frames: u64,
        delta: u64,
        files: [String; 2],
    },
    /// Ranges of the centre and of the standard deviation.
    Continuous {
        mins: [f32; 2],
        maxs: [f32; 2],
        files: [String; 2],
    },
}

/// Frames and seconds of the clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Playback {
    pub(super) frames: usize,
    pub(super) seconds: f64,
}

/// Whether an entry of an archive has this name, in any folder.
pub(crate) fn is_meta(name: &str) -> bool {
    name.strip_suffix(META).is_some_and(|folder| folder.is_empty() || folder.ends_with('/'))
}

/// Whether `meta.json` is of a `.tsog`, not of a SOG frame.
pub(crate) fn is_timed(meta: &[u8]) -> bool {
    let Ok(Value::Object(meta)) = serde_json::from_slice(&text::json(meta)) else { return false };
    let version = meta.get("version").and_then(Value::as_u64);
    version == Some(VERSION) || ["timeline", "temporal"].iter().any(|name| meta.contains_key(*name))
}

impl Meta {
    /// Parses and checks `meta.json`; the error is a message.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let meta: Self = serde_json::from_slice(&text::json(bytes))
            .map_err(|error| format!("has a damaged {META}: {error}; export it again"))?;
        if meta.version != VERSION {
            return Err(format!(
                "has version {}, expected {VERSION}; export it again with an encoder of that version",
                meta.version
            ));
        }
        if let Some(Profile { id, version }) = &meta.profile
            && (id.as_str(), *version) != PROFILE
        {
            return Err(format!(
                "declares the profile {id} {version}, expected {} {}; export it again with that",
                PROFILE.0, PROFILE.1
            ));
        }
        check_range("means", &meta.means.mins, &meta.means.maxs)?;
        check_book("scales", &meta.scales.codebook)?;
        check_book("sh0", &meta.sh0.codebook)?;
        if let Some(palette) = &meta.sh_n {
            check_book("shN", &palette.codebook)?;
            if !(1..=3).contains(&palette.bands) {
                return Err(format!("has {} bands of SH, expected 1 to 3", palette.bands));
            }
        }
        Ok(meta)
    }

    pub(super) fn has_sound(&self) -> bool {
        self.audio.is_some()
    }

    pub(super) fn timeline(&self) -> Result<Timeline, String> {
        let Some(raw) = &self.timeline else { return Ok(Timeline::Static) };
        let files = raw.files.clone();
        match (raw.kind, raw.frames, raw.mins.zip(raw.maxs)) {
            (0, Some(frames @ 1..=MAX_FRAMES), _) => {
                let delta = MAX_FRAMES / frames;
                if raw.delta != Some(delta) {
                    return Err(format!(
                        "has a timeline of {frames} frames with delta {}, expected {delta}; export it again",
                        raw.delta.map_or_else(|| "missing".to_owned(), |found| found.to_string())
                    ));
                }
                Ok(Timeline::Discrete { frames, delta, files })
            }
            (0, frames, _) => Err(format!(
                "has a discrete timeline of {} frames, expected 1 to {MAX_FRAMES}; export it again",
                frames.unwrap_or_default()
            )),
            (1, _, Some((mins, maxs))) => {
                check_range("timeline", &mins, &maxs)?;
                if mins[1] <= 0.0 {
                    return Err(format!(
                        "has a standard deviation in time of {}, expected above 0; export it again",
                        mins[1]
                    ));
                }
                Ok(Timeline::Continuous { mins, maxs, files })
            }
            (1, _, None) => {
                Err("has a continuous timeline without mins and maxs; export it again".to_owned())
            }
            (other, ..) => Err(format!(
                "has a timeline of type {other}, expected 0 (discrete) or 1 (continuous); export it with one of these, or as a PLY sequence"
            )),
        }
    }

    pub(super) fn velocities(&self) -> Result<Option<Velocities>, String> {
        let Some(temporal) = &self.temporal else { return Ok(None) };
        if let Some(name) = temporal.keys().find(|name| *name != "means") {
            return Err(format!(
                "animates `{name}`, which version {VERSION} does not define; export the scene as a PLY sequence from the program that made it"
            ));
        }
        if self.timeline.is_none() {
            return Err("has motion without a timeline; export it again".to_owned());
        }
        let Some(means) = temporal.get("means") else { return Ok(None) };
        let velocities: Velocities =
            serde_json::from_value(means.clone()).map_err(|error| {
                format!(
                    "has damaged motion: {error}; only motion along lines is defined, so export it again as that, or as a PLY sequence"
                )
            })?;
        if !(1..=2).contains(&velocities.files.len()) {
            return Err(format!(
                "has motion in {} planes, expected 1 or 2; export it again",
                velocities.files.len()
            ));
        }
        check_range("temporal.means", &velocities.mins[0], &velocities.maxs[0])?;
        Ok(Some(velocities))
    }

    /// Frames and duration, as the playback profile derives them; `None` for a static scene.
    pub(super) fn playback(&self, timeline: &Timeline) -> Result<Option<Playback>, String> {
        let playback = self.playback.as_ref();
        let fps = playback.and_then(|playback| playback.fps).or(self.fps).unwrap_or(FPS);
        let duration = playback.and_then(|playback| playback.duration);
        let (frames, seconds) = match timeline {
            Timeline::Static => return Ok(None),
            Timeline::Discrete { frames, .. } => {
                (*frames as f64, duration.unwrap_or(*frames as f64 / fps))
            }
            Timeline::Continuous { .. } => match duration {
                Some(duration) => (((duration * fps + 0.5).floor() + 1.0).max(2.0), duration),
                None => (FRAMES, (FRAMES - 1.0) / fps),
            },
        };
        let usable = |value: f64| value.is_finite() && value > 0.0;
        if !usable(fps) || !usable(seconds) || frames > MAX_DISPLAYED {
            return Err(format!(
                "lasts {seconds} seconds at {fps} frames per second, expected positive numbers and at most {MAX_DISPLAYED} frames; export it again"
            ));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let frames = frames as usize;
        Ok(Some(Playback { frames, seconds }))
    }
}

fn check_range(name: &str, mins: &[f32], maxs: &[f32]) -> Result<(), String> {
    let ascending = |(low, high): (&f32, &f32)| low.is_finite() && high.is_finite() && low <= high;
    if mins.iter().zip(maxs).all(ascending) {
        return Ok(());
    }
    Err(format!(
        "has the range {mins:?} to {maxs:?} of {name}, expected finite ascending numbers; export it again"
    ))
}

fn check_book(name: &str, codebook: &[f32]) -> Result<(), String> {
    let count = codebook.len();
    if (1..=256).contains(&count) && codebook.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    Err(format!(
        "has a codebook of {count} values for {name}, expected 1 to 256 finite numbers; export it again"
    ))
}
