//! [`Numbers`]: the metrics of a run by `c4d eval`, and a check that they are comparable.

use crate::failure::{Failure, Outcome};
use gs_core::{Camera, Intrinsics};
use serde_json::Value;
use std::path::Path;

/// Keys that must be equal for metrics to be comparable.
const SHARED: [&str; 9] = [
    "schema",
    "source",
    "quantised",
    "views",
    "frames",
    "times",
    "edit_time",
    "background",
    "truth",
];

/// A `metrics.json`.
#[derive(Debug)]
pub(super) struct Numbers {
    document: Value,
    pub(super) cameras: Vec<Camera>,
    pub(super) times: Vec<f32>,
}

impl Numbers {
    /// Reads a file.
    pub(super) fn read(path: &Path) -> Outcome<Self> {
        let bytes = gs_io::read_file(path).map_err(|error| {
            Failure::bad_input(format!("cannot read {}: {error}", path.display()))
        })?;
        let document = serde_json::from_slice(&bytes)
            .map_err(|error| Failure::bad_input(format!("{}: {error}", path.display())))?;
        Self::of(document, path)
    }

    /// Checks a document; `path` is for messages.
    pub(super) fn of(document: Value, path: &Path) -> Outcome<Self> {
        let malformed = || {
            Failure::bad_input(format!("{}: not a metrics.json of c4d eval", path.display()))
                .next("Write it with c4d eval RUN -o metrics.json.")
        };
        let number = |value: &Value| value.as_f64().filter(|value| value.is_finite());
        #[expect(clippy::cast_possible_truncation, reason = "times are single precision")]
        let times: Vec<f32> = document["times"]
            .as_array()
            .ok_or_else(malformed)?
            .iter()
            .map(|t| number(t).map(|t| t as f32))
            .collect::<Option<_>>()
            .ok_or_else(malformed)?;
        let cameras: Vec<Camera> = document["views"]
            .as_array()
            .ok_or_else(malformed)?
            .iter()
            .map(camera)
            .collect::<Option<_>>()
            .ok_or_else(malformed)?;
        let is_whole = !times.is_empty()
            && !cameras.is_empty()
            && cameras.iter().all(|camera| camera.check().is_ok())
            && document["items"].is_array();
        if is_whole { Ok(Self { document, cameras, times }) } else { Err(malformed()) }
    }

    fn item(&self, id: &str) -> Option<&Value> {
        self.document["items"].as_array()?.iter().find(|item| item["id"] == id)
    }

    /// Value of a metric.
    pub(super) fn value(&self, id: &str) -> Option<f64> {
        self.item(id)?["value"].as_f64()
    }

    /// Standard deviation over views.
    pub(super) fn std(&self, id: &str) -> Option<f64> {
        self.item(id)?["std"].as_f64()
    }

    /// Values of each view and frame; empty where the metric has none.
    pub(super) fn frames(&self, id: &str) -> Vec<Vec<Option<f64>>> {
        let views = self.item(id).and_then(|item| item["per_view"].as_array());
        let frames = |view: &Value| {
            let list = view["frames"].as_array().map(Vec::as_slice).unwrap_or_default();
            list.iter().map(Value::as_f64).collect()
        };
        views.into_iter().flatten().map(frames).collect()
    }

    /// Mean over views of each frame.
    pub(super) fn over_time(&self, id: &str) -> Vec<Option<f64>> {
        let views = self.frames(id);
        let of_frame = |frame: usize| {
            let values: Vec<f64> = views.iter().filter_map(|frames| *frames.get(frame)?).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        (0..self.times.len()).map(of_frame).collect()
    }

    /// Background of the pictures.
    pub(super) fn background(&self) -> [f32; 3] {
        #[expect(clippy::cast_possible_truncation, reason = "colours are single precision")]
        let channel = |c: usize| self.document["background"][c].as_f64().unwrap_or(0.0) as f32;
        [channel(0), channel(1), channel(2)]
    }

    /// Description of the shared settings.
    pub(super) fn subtitle(&self) -> String {
        let truth = match self.document["truth"].as_str() {
            Some(truth) => format!(", against {truth}"),
            None => String::new(),
        };
        format!(
            "{} views, {} frames{truth}; made by c4d {}; opens offline",
            self.cameras.len(),
            self.times.len(),
            env!("CARGO_PKG_VERSION")
        )
    }
}

fn camera(view: &Value) -> Option<Camera> {
    let number = |name: &str| view[name].as_f64();
    let side = |k: usize| u32::try_from(view["size"][k].as_u64()?).ok();
    let mut viewmat = [[0.0; 4]; 4];
    for (row, out) in viewmat.iter_mut().enumerate() {
        for (column, out) in out.iter_mut().enumerate() {
            *out = view["viewmat"][row][column].as_f64()?;
        }
    }
    Some(Camera {
        name: view["name"].as_str()?.to_owned(),
        width: side(0).filter(|side| *side <= 16_384)?,
        height: side(1).filter(|side| *side <= 16_384)?,
        viewmat,
        intrinsics: Intrinsics {
            fx: number("fx")?,
            fy: number("fy")?,
            cx: number("cx")?,
            cy: number("cy")?,
        },
        near: number("near")?,
        time: None,
    })
}

/// Refuses metrics with different views, frames or parameters.
pub(super) fn refuse_other_parameters(all: &[Numbers], names: &[String]) -> Outcome {
    let Some(first) = all.first() else { return Ok(()) };
    let refused = |what: &str, k: usize| {
        Err(Failure::usage(format!(
            "the numbers of {} and {} have different {what} and cannot be compared",
            names[0], names[k]
        ))
        .next("Measure all runs with the same --cameras, --views, --frames, --size and --truth."))
    };
    for (k, other) in all.iter().enumerate().skip(1) {
        for name in SHARED {
            if first.document[name] != other.document[name] {
                return refused(name, k);
            }
        }
        for item in first.document["items"].as_array().into_iter().flatten() {
            let Some(theirs) = item["id"].as_str().and_then(|id| other.item(id)) else { continue };
            let have_values = !item["value"].is_null() && !theirs["value"].is_null();
            if have_values && item["params"] != theirs["params"] {
                let id = item["id"].as_str().unwrap_or_default();
                return refused(&format!("parameters of {id}"), k);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn numbers(times: &[f32], threshold: f64) -> Numbers {
        let camera = Camera::look_at([0.0, 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.8, 64, 48);
        let document = json!({
            "times": times,
            "views": [{
                "name": "a", "size": [64, 48], "viewmat": camera.viewmat, "near": camera.near,
                "fx": camera.intrinsics.fx, "fy": camera.intrinsics.fy,
                "cx": camera.intrinsics.cx, "cy": camera.intrinsics.cy,
            }],
            "items": [{ "id": "x", "value": 1.0, "params": { "threshold": threshold },
                        "per_view": [{ "view": "a", "frames": [1.0, null] }] }],
        });
        Numbers::of(document, Path::new("x")).unwrap()
    }

    #[test]
    fn different_parameters_are_refused() {
        let names = ["a".to_owned(), "b".to_owned()];
        let check =
            |other: Numbers| refuse_other_parameters(&[numbers(&[0.0, 1.0], 2.0), other], &names);
        check(numbers(&[0.0, 1.0], 2.0)).unwrap();
        let message = check(numbers(&[0.0, 0.5], 2.0)).unwrap_err().to_string();
        assert!(message.contains("different times"), "{message}");
        let message = check(numbers(&[0.0, 1.0], 3.0)).unwrap_err().to_string();
        assert!(message.contains("parameters of x"), "{message}");
    }

    #[test]
    fn cameras_and_series_round_trip() {
        let found = numbers(&[0.0, 1.0], 2.0);
        assert_eq!((found.cameras.len(), found.cameras[0].width), (1, 64), "a camera");
        assert_eq!(found.over_time("x"), [Some(1.0), None], "a gap");
        assert!(Numbers::of(json!({}), Path::new("x")).is_err(), "something else");
    }
}
