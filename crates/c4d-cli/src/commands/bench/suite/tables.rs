//! Results of a suite as Markdown and CSV.

use super::file::Suite;
use super::job::Measured;
use crate::evaluation::{Item, method_table};
use std::fmt::Write as _;

/// First lines of the tables.
const TITLE: &str = "# c4d bench suite";
const HEAD: &str = "scene,edit,method,metric,value,std";

/// Whether a text is one of the tables.
pub(super) fn is_table(text: &str) -> bool {
    text.starts_with(TITLE) || text.starts_with(HEAD)
}

/// A table of methods for each edit, and a table of means over the edits that every method
/// completed.
pub(super) fn markdown(suite: &Suite, measured: &[Measured]) -> String {
    let shown = suite.shown();
    let of = |scene: &str, edit: &str, method: &str| {
        let is = |m: &&Measured| m.scene == scene && m.edit == edit && m.method == method;
        measured.iter().find(is).map(|m| &m.items)
    };
    let mut text = format!("{TITLE}\n");
    let mut complete: Vec<Vec<&Vec<Item>>> = Vec::new();
    let mut edits = 0;
    for scene in &suite.scenes {
        for edit in &scene.edits {
            edits += 1;
            let found: Vec<Option<&Vec<Item>>> =
                suite.methods.iter().map(|m| of(&scene.name, &edit.name, &m.name)).collect();
            let columns: Vec<(&str, Vec<Item>)> = suite
                .methods
                .iter()
                .zip(&found)
                .map(|(method, items)| (method.name.as_str(), items.cloned().unwrap_or_default()))
                .collect();
            let table = method_table("metric", &columns, &shown);
            let _ = write!(text, "\n## {}: {}\n\n{table}\n", scene.name, edit.name);
            for (method, items) in suite.methods.iter().zip(&found) {
                if items.is_none() {
                    let _ = write!(text, "\n{} failed.\n", method.name);
                }
            }
            complete.extend(found.into_iter().collect::<Option<Vec<_>>>());
        }
    }
    if edits > 1 && !complete.is_empty() {
        let columns: Vec<(&str, Vec<Item>)> = suite
            .methods
            .iter()
            .enumerate()
            .map(|(k, method)| {
                let of_method: Vec<&Vec<Item>> = complete.iter().map(|row| row[k]).collect();
                (method.name.as_str(), means(&shown, &of_method))
            })
            .collect();
        let table = method_table("metric", &columns, &shown);
        let _ = write!(
            text,
            "\n## Mean over {} of {edits} edits (those that every method completed)\n\n{table}\n",
            complete.len()
        );
    }
    text
}

/// Mean of each metric over edits; missing if an edit has no value.
fn means(shown: &[&str], edits: &[&Vec<Item>]) -> Vec<Item> {
    let mean = |id: &str| {
        let values = edits.iter().map(|items| {
            items.iter().find(|item| item.definition.id == id).and_then(|item| item.value)
        });
        let values: Option<Vec<f64>> = values.collect();
        let values = values.filter(|values| !values.is_empty());
        let value = values.map(|values| values.iter().sum::<f64>() / values.len() as f64);
        Item::optional(id, value, "an edit has no value")
    };
    shown.iter().map(|id| mean(id)).collect()
}

/// CSV with one row per value.
pub(super) fn csv(suite: &Suite, measured: &[Measured]) -> String {
    let shown = suite.shown();
    let mut text = format!("{HEAD}\n");
    for Measured { scene, edit, method, items } in measured {
        for item in items.iter().filter(|item| shown.contains(&item.definition.id)) {
            let number =
                |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
            let (value, std) = (number(item.value), number(item.std));
            let _ = writeln!(text, "{scene},{edit},{method},{},{value},{std}", item.definition.id);
        }
    }
    text
}
