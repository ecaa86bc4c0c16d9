//! Joins the metrics of `c4d eval --part`.

use crate::args::Global;
use crate::console::Console;
use crate::evaluation::{self, Item};
use crate::failure::{Failure, Outcome};
use crate::output::{existing, output_failure};
use crate::part::{Part, PartRecord, broken};
use gs_io::AtomicFile;
use serde_json::Value;
use std::io::Write;
use std::path::Path;

/// Reads a part: the document without its record.
pub(super) fn read(path: &Path) -> Outcome<Part<Value>> {
    let not_a_part = || {
        Failure::bad_input(format!(
            "{} is not a part; c4d eval --part K/N -o FILE writes parts",
            path.display()
        ))
        .next("Pass the outputs of --part 1/N to --part N/N, and nothing else.")
    };
    let bytes = gs_io::read_file(path).map_err(|error| broken(path, &error.to_string()))?;
    let mut document: Value = serde_json::from_slice(&bytes).map_err(|_not_json| not_a_part())?;
    let record = document.as_object_mut().and_then(|object| object.remove(PartRecord::KEY));
    let record: PartRecord = serde_json::from_value(record.ok_or_else(not_a_part)?)
        .map_err(|error| broken(path, &error.to_string()))?;
    Ok((path.to_owned(), record, document))
}

pub(super) fn join(
    parts: &[Part<Value>],
    output: &Path,
    global: &Global,
    console: &Console,
) -> Outcome {
    let mut file =
        AtomicFile::create(output, existing(global)).map_err(|error| output_failure(&error))?;
    let cameras = parts[0].1.work("cameras").as_array().map_or(0, Vec::len);
    let mut views = Vec::new();
    let mut of_parts = Vec::new();
    for (path, record, document) in parts {
        let refused = || broken(path, "its views or items do not match its part");
        let own = document["views"].as_array().ok_or_else(refused)?;
        if own.len() != record.range(cameras).len() {
            return Err(refused());
        }
        views.extend(own.iter().cloned());
        let items = document["items"].as_array().ok_or_else(refused)?;
        let items: Option<Vec<Item>> =
            items.iter().map(|item| Item::of_json(item, own.len())).collect();
        of_parts.push(items.ok_or_else(refused)?);
    }
    let names: Vec<String> =
        views.iter().map(|view| view["name"].as_str().unwrap_or_default().to_owned()).collect();
    let items: Vec<Item> = of_parts[0].iter().map(|item| item.joined(&of_parts)).collect();
    let mut document = parts[0].2.clone();
    document["views"] = Value::Array(views);
    document["items"] = items.iter().map(|item| item.json(&names)).collect();
    let text = serde_json::to_string_pretty(&document).map_err(Failure::failed)?;
    writeln!(file, "{text}").map_err(|error| Failure::write(output, &error))?;
    file.commit().map_err(|error| output_failure(&error))?;
    console.wrote(output);
    console.report(|| document);
    console.result(evaluation::table(&items));
    Ok(())
}
