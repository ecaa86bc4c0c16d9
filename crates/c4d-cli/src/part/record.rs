//! [`PartRecord`]: identifies the work of a part, so that only parts of the same work are joined.

use super::share::Share;
use crate::failure::{Failure, Outcome};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// Number of a part, and the work to which it belongs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PartRecord {
    /// From 1 to `of`.
    part: usize,
    of: usize,
    /// Everything on which the result depends, by name; equal in all parts.
    work: Map<String, Value>,
}

impl PartRecord {
    /// Key of the record in a part that is a JSON document.
    pub(crate) const KEY: &str = "part_of";

    /// `work` contains everything on which the result depends; the version of the program is added.
    pub(crate) fn new(share: Share, mut work: Map<String, Value>) -> Self {
        work.insert("version".to_owned(), env!("CARGO_PKG_VERSION").into());
        Self { part: share.part, of: share.of, work }
    }

    /// A value of the work.
    pub(crate) fn work(&self, name: &str) -> &Value {
        self.work.get(name).unwrap_or(&Value::Null)
    }

    /// The items of this part among `count`.
    pub(crate) fn range(&self, count: usize) -> std::ops::Range<usize> {
        Share { part: self.part, of: self.of }.range(count)
    }

    fn is_possible(&self) -> bool {
        Share::parse(&format!("{}/{}", self.part, self.of)).is_ok()
    }
}

/// Path, record and content of a part.
pub(crate) type Part<T> = (PathBuf, PartRecord, T);

/// Sorts parts by number.
///
/// # Errors
/// If parts belong to different work, or one is missing or given twice.
pub(crate) fn in_order<T>(mut parts: Vec<Part<T>>) -> Outcome<Vec<Part<T>>> {
    let Some((first_path, first, _)) = parts.first() else {
        return Err(Failure::usage("no parts are given"));
    };
    for (path, record, _) in &parts {
        if !record.is_possible() {
            return Err(broken(path, &format!("it is part {} of {}", record.part, record.of)));
        }
        let names = first.work.keys().chain(record.work.keys());
        let other: Vec<&str> = names
            .map(String::as_str)
            .filter(|name| first.work(name) != record.work(name))
            .chain((first.of != record.of).then_some("number of parts"))
            .collect();
        if let Some(name) = other.first() {
            return Err(Failure::usage(format!(
                "{} and {} are parts of different work: {name} differs",
                first_path.display(),
                path.display()
            ))
            .next("Make all parts with the same command; only K in --part K/N may differ."));
        }
    }
    let of = first.of;
    parts.sort_by_key(|(_, record, _)| record.part);
    if let Some(pair) = parts.windows(2).find(|pair| pair[0].1.part == pair[1].1.part) {
        return Err(Failure::usage(format!(
            "{} and {} are both part {} of {of}",
            pair[0].0.display(),
            pair[1].0.display(),
            pair[0].1.part
        ))
        .next("Pass each part once."));
    }
    let missing: Vec<String> = (1..=of)
        .filter(|part| parts.binary_search_by_key(part, |(_, record, _)| record.part).is_err())
        .map(|part| part.to_string())
        .collect();
    if !missing.is_empty() {
        let parts = if missing.len() == 1 { "part" } else { "parts" };
        return Err(Failure::usage(format!("{parts} {} of {of} missing", missing.join(", ")))
            .next(format!("Make it with --part {}/{of}, and pass all {of} parts.", missing[0])));
    }
    Ok(parts)
}

/// Failure for a part that c4d did not write, or that was changed later.
pub(crate) fn broken(path: &Path, what: &str) -> Failure {
    Failure::bad_input(format!("{}: {what}", path.display()))
        .next("Make this part again: the same command with -w.")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn record(part: usize, of: usize, times: &Value) -> (PathBuf, PartRecord, usize) {
        let work = Map::from_iter([("times".to_owned(), times.clone())]);
        let share = Share { part, of };
        (PathBuf::from(format!("part{part}")), PartRecord::new(share, work), part)
    }

    #[test]
    fn only_all_parts_of_the_same_work_are_joined() {
        let times = json!([0.0, 0.5]);
        let part = |k| record(k, 3, &times);
        let ordered = in_order(vec![part(3), part(1), part(2)]).unwrap();
        assert_eq!(ordered.iter().map(|(_, _, k)| *k).collect::<Vec<_>>(), [1, 2, 3], "in order");
        let refusal = |parts| in_order(parts).unwrap_err().to_string();
        let text = refusal(vec![part(3), part(1)]);
        assert!(text.contains("part 2 of 3 missing"), "{text}");
        let text = refusal(vec![part(1), part(2), part(2), part(3)]);
        assert!(text.contains("both part 2 of 3"), "{text}");
        let text = refusal(vec![part(1), record(2, 3, &json!([0.0, 1.0])), part(3)]);
        assert!(text.contains("times differs"), "{text}");
        let text = refusal(vec![part(1), record(2, 2, &times)]);
        assert!(text.contains("number of parts differs"), "{text}");
        let text = refusal(vec![record(4, 3, &times)]);
        assert!(text.contains("part 4 of 3"), "{text}");
        assert!(refusal(Vec::new()).contains("no parts"), "none");
    }
}
