//! The crate table in `docs/ARCHITECTURE.md`, and its comparison with the manifests.

use anyhow::{Context, Result, bail};
use std::collections::{BTreeMap, BTreeSet};

/// The table's column headings, in order.
const COLUMNS: [&str; 5] =
    ["crate", "promises", "depends on", "in tests only", "deliberately absent"];
/// Keys that a published crate's manifest must have.
const PUBLISHED: [&str; 5] = ["description", "readme", "keywords", "categories", "repository"];

/// Workspace crates that one crate depends on.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Dependencies {
    /// `[dependencies]`.
    pub normal: BTreeSet<String>,
    /// `[dev-dependencies]` that are not also in `[dependencies]`.
    pub tests_only: BTreeSet<String>,
}

/// The rows of the table: crates by name.
#[derive(Debug, Default)]
pub(super) struct CrateTable {
    rows: BTreeMap<String, Dependencies>,
}

impl CrateTable {
    /// Parses the table in the text of `docs/ARCHITECTURE.md`.
    ///
    /// # Errors
    /// If there is no table with these columns, or a row has a different number of cells.
    pub(super) fn parse(document: &str) -> Result<Self> {
        let mut lines = document.lines().map(cells).skip_while(|row| row[..] != COLUMNS).skip(2);
        let mut rows = BTreeMap::new();
        for row in lines.by_ref().take_while(|row| !row.is_empty()) {
            let [name, _, normal, tests_only, _] = row[..] else {
                bail!("a row of the crate table has {} cells, expected 5: {row:?}", row.len());
            };
            let [name] = &quoted(name).into_iter().collect::<Vec<_>>()[..] else {
                bail!("a row of the crate table has no name: {row:?}");
            };
            let dependencies =
                Dependencies { normal: quoted(normal), tests_only: quoted(tests_only) };
            rows.insert(name.clone(), dependencies);
        }
        if rows.is_empty() {
            bail!("docs/ARCHITECTURE.md has no table with the columns {COLUMNS:?}");
        }
        Ok(Self { rows })
    }

    /// Differences in either direction between the table and `manifests` (the text of every
    /// `Cargo.toml` in the workspace).
    pub(super) fn compare(&self, manifests: &[String]) -> Result<Vec<String>> {
        let mut found = Vec::new();
        let mut crates = BTreeMap::new();
        for text in manifests {
            let manifest: toml::Table = text.parse().context("a manifest is not TOML")?;
            let package = manifest.get("package").and_then(toml::Value::as_table);
            let package = package.context("a manifest has no [package]")?;
            let name = package.get("name").and_then(toml::Value::as_str);
            let name = name.context("a manifest has no package name")?.to_owned();
            let published = package.get("publish") != Some(&toml::Value::Boolean(false));
            for key in PUBLISHED.iter().filter(|key| published && !package.contains_key(**key)) {
                found.push(format!("crate `{name}`: its manifest has no `{key}`"));
            }
            crates.insert(name, manifest);
        }
        let ours = |manifest: &toml::Table, section: &str| -> BTreeSet<String> {
            let section = manifest.get(section).and_then(toml::Value::as_table);
            let names = section.into_iter().flat_map(toml::Table::keys);
            names.filter(|key| crates.contains_key(*key)).cloned().collect()
        };
        for (name, manifest) in &crates {
            let Some(row) = self.rows.get(name) else {
                found.push(format!("crate `{name}` has no row in the crate table"));
                continue;
            };
            let normal = ours(manifest, "dependencies");
            let mut tests_only = ours(manifest, "dev-dependencies");
            tests_only.retain(|dependency| !normal.contains(dependency));
            let sides = [
                ("depends on", &normal, &row.normal),
                ("depends in tests on", &tests_only, &row.tests_only),
            ];
            for (how, actual, listed) in sides {
                for dependency in actual.difference(listed) {
                    found.push(format!(
                        "crate `{name}` {how} `{dependency}`, which its row in the crate table does not list"
                    ));
                }
                for dependency in listed.difference(actual) {
                    found.push(format!(
                        "the crate table states that `{name}` {how} `{dependency}`, its manifest does not"
                    ));
                }
            }
        }
        for name in self.rows.keys().filter(|name| !crates.contains_key(*name)) {
            found.push(format!(
                "the crate table lists `{name}`, which is not a crate of the workspace"
            ));
        }
        found.extend(self.cycles());
        Ok(found)
    }

    /// Crates in dependency cycles.
    fn cycles(&self) -> Vec<String> {
        let mut below: BTreeSet<&str> = BTreeSet::new();
        let mut left: BTreeMap<&str, &Dependencies> =
            self.rows.iter().map(|(name, row)| (name.as_str(), row)).collect();
        // Remove crates whose dependencies have all been removed. What
        // remains is in a cycle, or depends on one.
        loop {
            let ready: Vec<&str> = left
                .iter()
                .filter(|(_, row)| row.normal.iter().all(|name| below.contains(name.as_str())))
                .map(|(name, _)| *name)
                .collect();
            if ready.is_empty() {
                break;
            }
            for name in ready {
                below.insert(name);
                left.remove(name);
            }
        }
        left.keys()
            .map(|name| format!("crate `{name}` is in a dependency cycle, or depends on one"))
            .collect()
    }
}

/// Cells of a table row; empty for any other line.
fn cells(line: &str) -> Vec<&str> {
    let line = line.trim();
    let Some(inner) = line.strip_prefix('|').and_then(|rest| rest.strip_suffix('|')) else {
        return Vec::new();
    };
    inner.split('|').map(str::trim).collect()
}

/// Names in backticks.
fn quoted(cell: &str) -> BTreeSet<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOCUMENT: &str = "# Architecture

| crate | promises | depends on | in tests only | deliberately absent |
|---|---|---|---|---|
| `low` | x | – | – | y |
| `high` | x | `low` | `aid` | y |
| `aid` | x | – | – | y |
";

    fn manifest(name: &str, rest: &str) -> String {
        let keys = PUBLISHED.map(|key| format!("{key} = \"x\"\n")).concat();
        format!("[package]\nname = \"{name}\"\n{keys}{rest}")
    }

    fn good() -> [String; 3] {
        let high = "[dependencies]\nlow = \"1\"\nserde = \"1\"\n[dev-dependencies]\nlow = \"1\"\naid = \"1\"\n";
        [manifest("low", ""), manifest("high", high), manifest("aid", "")]
    }

    fn findings(document: &str, manifests: &[String]) -> Vec<String> {
        CrateTable::parse(document).unwrap().compare(manifests).unwrap()
    }

    #[test]
    fn an_agreeing_table_has_no_findings() {
        assert_eq!(findings(DOCUMENT, &good()), Vec::<String>::new(), "no finding");
    }

    #[test]
    fn a_dependency_missing_from_the_table_is_found() {
        let mut manifests = good();
        manifests[0] = manifest("low", "[dependencies]\naid = \"1\"\n");
        assert_eq!(findings(DOCUMENT, &manifests).len(), 1, "dependency");
        manifests[0] = manifest("low", "[dev-dependencies]\naid = \"1\"\n");
        assert_eq!(findings(DOCUMENT, &manifests).len(), 1, "dependency of tests");
    }

    #[test]
    fn a_dependency_missing_from_the_manifest_is_found() {
        let document = DOCUMENT.replace("| `low` | x | – |", "| `low` | x | `aid` |");
        assert_eq!(findings(&document, &good()).len(), 1, "stale arrow");
    }

    #[test]
    fn missing_rows_and_crates_are_found() {
        let document = DOCUMENT.replace("| `aid` | x | – | – | y |\n", "");
        assert_eq!(findings(&document, &good()).len(), 1, "crate without a row");
        assert_eq!(findings(DOCUMENT, &good()[..2]).len(), 2, "row and dependency without a crate");
    }

    #[test]
    fn dependency_cycles_are_found() {
        let document = DOCUMENT.replace("| `low` | x | – |", "| `low` | x | `high` |");
        let mut manifests = good();
        manifests[0] = manifest("low", "[dependencies]\nhigh = \"1\"\n");
        assert_eq!(findings(&document, &manifests).len(), 2, "both crates of the cycle");
    }

    #[test]
    fn published_crates_need_their_keys() {
        let mut manifests = good();
        manifests[2] = "[package]\nname = \"aid\"\n".to_owned();
        assert_eq!(findings(DOCUMENT, &manifests).len(), PUBLISHED.len(), "all keys");
        manifests[2].push_str("publish = false\n");
        assert_eq!(findings(DOCUMENT, &manifests), Vec::<String>::new(), "not published");
    }

    #[test]
    fn a_document_without_the_table_is_refused() {
        assert!(CrateTable::parse("| crate | promises |\n|---|---|\n").is_err(), "other columns");
    }
}
