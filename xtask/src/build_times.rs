//! What a clean build costs: a table from the report of `cargo build --timings`.

use anyhow::{Context, Result};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Packages that take less are one row together, seconds.
const SMALL: f64 = 3.0;

/// One call of the compiler or of a build script in the report.
#[derive(Debug, Deserialize)]
struct Unit {
    name: String,
    version: String,
    start: f64,
    duration: f64,
}

/// Prints the table of the report at `path`.
#[expect(clippy::print_stdout, reason = "the result")]
pub(crate) fn print(path: &Path) -> Result<()> {
    let page = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    print!("{}", table(&units(&page)?));
    Ok(())
}

fn units(page: &str) -> Result<Vec<Unit>> {
    let (_, data) = page
        .split_once("const UNIT_DATA = ")
        .context("not a report of `cargo build --timings`: it has no UNIT_DATA")?;
    let mut values = serde_json::Deserializer::from_str(data).into_iter();
    values.next().context("UNIT_DATA is empty")?.context("UNIT_DATA")
}

fn table(units: &[Unit]) -> String {
    let mut packages = BTreeMap::new();
    for unit in units {
        *packages.entry((&unit.name, &unit.version)).or_insert(0.0) += unit.duration;
    }
    let mut rows: Vec<_> = packages.into_iter().collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let small = rows.iter().position(|row| row.1 < SMALL).unwrap_or(rows.len());
    let rest: f64 = rows[small..].iter().map(|row| row.1).sum();

    let mut out = "| package | seconds |\n|---|---|\n".to_owned();
    for ((name, version), seconds) in &rows[..small] {
        writeln!(out, "| `{name}` {version} | {seconds:.0} |").expect("strings can be written");
    }
    let end = units.iter().map(|unit| unit.start + unit.duration).fold(0.0, f64::max);
    let total: f64 = units.iter().map(|unit| unit.duration).sum();
    writeln!(out, "| {} others | {rest:.0} |", rows.len() - small).expect("strings can be written");
    writeln!(out, "| all, {end:.0} s wall time | {total:.0} |").expect("strings can be written");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_are_summed_and_sorted() {
        let page = r#"<script>const UNIT_DATA = [
            {"name":"quick","version":"1.0.0","start":0.0,"duration":1.0,"target":""},
            {"name":"c","version":"2.0.0","start":1.0,"duration":2.5,"target":" build-script (run)"},
            {"name":"slow","version":"0.1.0","start":1.0,"duration":9.0,"target":""},
            {"name":"c","version":"2.0.0","start":3.5,"duration":1.5,"target":""}];
            const CONCURRENCY_DATA = [];</script>"#;
        let table = table(&units(page).unwrap());
        let rows: Vec<&str> = table.lines().skip(2).collect();
        let expected = [
            "| `slow` 0.1.0 | 9 |",
            "| `c` 2.0.0 | 4 |",
            "| 1 others | 1 |",
            "| all, 10 s wall time | 14 |",
        ];
        assert_eq!(rows, expected, "all");
        assert!(units("<html></html>").is_err(), "not a report");
    }
}
