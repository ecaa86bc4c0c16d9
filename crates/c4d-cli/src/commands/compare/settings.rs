//! Differing settings and warnings from the records of runs.

use crate::report::escape;
use crate::run_folder::{CONFIG, REFINE_REPORT, REPORT};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Keys that are not settings: locations and the version.
const LOCATIONS: [&str; 2] = ["source_from_run", "version"];

/// A table of the settings that differ between the runs; a sentence if there are none.
pub(super) fn differing(runs: &[PathBuf], names: &[String]) -> String {
    let all: Vec<BTreeMap<String, String>> = runs.iter().map(|run| flat(run)).collect();
    let keys: BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let mut rows = String::new();
    for key in keys.into_iter().filter(|key| !LOCATIONS.contains(&key.as_str())) {
        let values: Vec<Option<&String>> = all.iter().map(|settings| settings.get(key)).collect();
        if values.iter().any(|value| *value != values[0]) {
            let cell = |value: Option<&String>| {
                format!("<td>{}</td>", value.map_or("–".to_owned(), |value| escape(value)))
            };
            let cells: String = values.iter().copied().map(cell).collect();
            let _ = write!(rows, "<tr><th>{}</th>{cells}</tr>", escape(key));
        }
    }
    if rows.is_empty() {
        return if runs.len() > 1 { "<p>None.</p>".to_owned() } else { String::new() };
    }
    let head = |name: &String| format!("<th>{}</th>", escape(name));
    let heads: String = names.iter().map(head).collect();
    format!("<div class=\"scroll\"><table><tr><th></th>{heads}</tr>{rows}</table></div>")
}

/// Keys and values of a run's configuration.
fn flat(run: &Path) -> BTreeMap<String, String> {
    let text = gs_io::read_file(&run.join(CONFIG)).ok().and_then(|b| String::from_utf8(b).ok());
    let mut out = BTreeMap::new();
    if let Some(toml::Value::Table(table)) = text.and_then(|text| toml::from_str(&text).ok()) {
        for (key, value) in table {
            flatten(&key, &value, &mut out);
        }
    }
    out
}

fn flatten(key: &str, value: &toml::Value, out: &mut BTreeMap<String, String>) {
    match value {
        toml::Value::Table(table) => {
            for (name, value) in table {
                flatten(&format!("{key}.{name}"), value, out);
            }
        }
        value => {
            out.insert(key.to_owned(), value.to_string());
        }
    }
}

/// The warnings of each run.
pub(super) fn warnings(runs: &[PathBuf], names: &[String]) -> String {
    let mut items = String::new();
    for (run, name) in runs.iter().zip(names) {
        for warning in of_run(run) {
            let _ = write!(items, "<li><b>{}</b>: {}</li>", escape(name), escape(&warning));
        }
    }
    if items.is_empty() { "<p>None.</p>".to_owned() } else { format!("<ul>{items}</ul>") }
}

/// The warnings in a run's reports.
fn of_run(run: &Path) -> Vec<String> {
    let of = |name: &str| -> Vec<String> {
        let bytes = gs_io::read_file(&run.join(name)).ok();
        let report: Option<Value> = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let warnings = report.and_then(|report| report["warnings"].as_array().cloned());
        warnings
            .into_iter()
            .flatten()
            .filter_map(|warning| warning.as_str().map(str::to_owned))
            .collect()
    };
    [of(REPORT), of(REFINE_REPORT)].concat()
}
