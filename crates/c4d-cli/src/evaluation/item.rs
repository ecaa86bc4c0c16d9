//! [`Item`]: the value of a metric, with its parameters.

use super::definitions::{DEFINITIONS, Definition};
use super::series::{Series, mean};
use serde_json::{Map, Value, json};

/// A metric's value.
#[derive(Debug, Clone)]
pub(crate) struct Item {
    pub(crate) definition: &'static Definition,
    /// `None` if not measured; `reason` states why.
    pub(crate) value: Option<f64>,
    /// Standard deviation over views, if there are several.
    pub(crate) std: Option<f64>,
    /// Lowest and highest value over views and frames.
    pub(crate) range: Option<[f64; 2]>,
    /// Value of each view.
    pub(crate) per_view: Vec<Option<f64>>,
    /// Value of each view and frame, `[V][T]`; `None` where a frame has none.
    pub(crate) per_frame: Vec<Vec<Option<f64>>>,
    /// Parameters of the metric besides scenes, views and frames.
    pub(crate) params: Map<String, Value>,
    /// Additional results.
    pub(crate) found: Map<String, Value>,
    /// File of the network's weights.
    pub(crate) weights: Option<String>,
    /// Reason for a missing value.
    pub(crate) reason: Option<String>,
}

impl Item {
    fn new(id: &str) -> Self {
        let definition = DEFINITIONS
            .iter()
            .find(|definition| definition.id == id)
            .unwrap_or_else(|| unreachable!("{id} is not defined"));
        Self {
            definition,
            value: None,
            std: None,
            range: None,
            per_view: Vec::new(),
            per_frame: Vec::new(),
            params: Map::new(),
            found: Map::new(),
            weights: None,
            reason: None,
        }
    }

    /// A value of the whole scene.
    pub(crate) fn scalar(id: &str, value: f64) -> Self {
        Self { value: value.is_finite().then_some(value), ..Self::new(id) }
            .because("the value is not finite")
    }

    /// A value of the whole scene that may be missing.
    pub(crate) fn optional(id: &str, value: Option<f64>, reason: &str) -> Self {
        match value {
            Some(value) => Self::scalar(id, value),
            None => Self::missing(id, reason),
        }
    }

    /// A missing value.
    pub(crate) fn missing(id: &str, reason: &str) -> Self {
        Self { reason: Some(reason.to_owned()), ..Self::new(id) }
    }

    /// Mean over frames, then over views.
    pub(crate) fn of_frames(id: &str, series: &Series) -> Self {
        let per_view = series.0.iter().map(|frames| mean(frames.iter().flatten().copied()));
        let item = Self::of_views(id, per_view.collect());
        let values = || series.0.iter().flatten().flatten().copied();
        let range = values().next().map(|_| {
            [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
        });
        Self { per_frame: series.0.clone(), range, ..item }
    }

    /// Mean over views.
    pub(crate) fn of_views(id: &str, per_view: Vec<Option<f64>>) -> Self {
        let values = || per_view.iter().flatten().copied();
        let value = mean(values());
        let count = values().count();
        let std = value.filter(|_| count > 1).map(|centre| {
            (values().map(|v| (v - centre).powi(2)).sum::<f64>() / count as f64).sqrt()
        });
        Self { value, std, per_view, ..Self::new(id) }.because("no frame has pixels to measure")
    }

    /// Adds a parameter.
    pub(crate) fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.params.insert(name.to_owned(), value.into());
        self
    }

    /// Sets the file of the weights.
    pub(crate) fn weights(self, file: &str) -> Self {
        Self { weights: Some(file.to_owned()), ..self }
    }

    /// Adds an additional result.
    pub(crate) fn finding(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.found.insert(name.to_owned(), value.into());
        self
    }

    /// Sets the reason if there is no value and no reason yet.
    fn because(mut self, reason: &str) -> Self {
        if self.value.is_none() && self.reason.is_none() {
            self.reason = Some(reason.to_owned());
        }
        self
    }

    /// Inverse of [`Item::json`] for `num_views` views; `None` if `value` is not an item.
    pub(crate) fn of_json(value: &Value, num_views: usize) -> Option<Self> {
        let id = value["id"].as_str()?;
        let definition = DEFINITIONS.iter().find(|definition| definition.id == id)?;
        let number = |name: &str| value[name].as_f64();
        let map = |name: &str| value[name].as_object().cloned().unwrap_or_default();
        let text = |name: &str| value[name].as_str().map(str::to_owned);
        let entries = value["per_view"].as_array().map_or(&[][..], Vec::as_slice);
        if !entries.is_empty() && entries.len() != num_views {
            return None;
        }
        let frames = |entry: &Value| -> Option<Vec<Option<f64>>> {
            Some(entry["frames"].as_array()?.iter().map(Value::as_f64).collect())
        };
        Some(Self {
            definition,
            value: number("value"),
            std: number("std"),
            range: number("min").zip(number("max")).map(|(min, max)| [min, max]),
            per_view: entries.iter().map(|entry| entry["value"].as_f64()).collect(),
            per_frame: entries.iter().filter_map(frames).collect(),
            params: map("params"),
            found: map("found"),
            weights: text("weights"),
            reason: text("reason"),
        })
    }

    /// This item with the views of all `parts`, which include its own.
    pub(crate) fn joined(&self, parts: &[Vec<Self>]) -> Self {
        if self.per_view.is_empty() {
            return self.clone();
        }
        let id = self.definition.id;
        let same = || parts.iter().flatten().filter(|item| item.definition.id == id);
        let of_all = if self.per_frame.is_empty() {
            Self::of_views(id, same().flat_map(|item| item.per_view.clone()).collect())
        } else {
            let frames = same().flat_map(|item| item.per_frame.clone()).collect();
            Self::of_frames(id, &Series(frames))
        };
        let Self { params, found, weights, .. } = self.clone();
        Self { params, found, weights, ..of_all }
    }

    /// The item in the format of `metrics.json`.
    pub(crate) fn json(&self, views: &[String]) -> Value {
        let Definition { id, group, better, what } = *self.definition;
        let mut object = Map::new();
        let mut put = |name: &str, value: Value| object.insert(name.to_owned(), value);
        put("id", json!(id));
        put("group", json!(group.name()));
        put("what", json!(what));
        put("value", json!(self.value));
        put(
            "higher_is_better",
            match better {
                c4d_metrics::Better::Higher => json!(true),
                c4d_metrics::Better::Lower => json!(false),
                _ => Value::Null,
            },
        );
        put("better", json!(better_name(better)));
        put("params", Value::Object(self.params.clone()));
        put("weights", json!(self.weights));
        if !self.found.is_empty() {
            put("found", Value::Object(self.found.clone()));
        }
        if let Some(reason) = &self.reason {
            put("reason", json!(reason));
        }
        if let Some(std) = self.std {
            put("std", json!(std));
        }
        if let Some([min, max]) = self.range {
            put("min", json!(min));
            put("max", json!(max));
        }
        if !self.per_view.is_empty() {
            let entry = |(k, value): (usize, &Option<f64>)| {
                let mut entry = json!({ "view": views.get(k), "value": value });
                if let (Some(frames), Some(object)) = (self.per_frame.get(k), entry.as_object_mut())
                {
                    object.insert("frames".to_owned(), json!(frames));
                }
                entry
            };
            put("per_view", self.per_view.iter().enumerate().map(entry).collect());
        }
        Value::Object(object)
    }
}

fn better_name(better: c4d_metrics::Better) -> &'static str {
    match better {
        c4d_metrics::Better::Higher => "higher",
        c4d_metrics::Better::Lower => "lower",
        c4d_metrics::Better::NearOne => "nearer 1",
        c4d_metrics::Better::NearZero => "nearer 0",
        c4d_metrics::Better::Neither => "neither",
    }
}
