//! Finds the frames among file names, and their order.

use super::SequenceError;
use std::collections::BTreeMap;

/// Frames of a folder in numeric order, and its other entries.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Found {
    pub(crate) frames: Vec<String>,
    pub(crate) ignored: Vec<String>,
    /// Note on the series used and those ignored, if there are several.
    pub(crate) series: Option<String>,
}

/// Extensions of frames, lower case.
const ENDINGS: [&str; 6] = [".compressed.ply", ".ply", ".splat", ".spz", ".sog", ".glb"];

/// Prefix with extension, and number, of `<prefix><digits><extension>`.
/// In archives the prefix includes the folders.
fn parse(name: &str) -> Option<(String, u64)> {
    let lower = name.to_lowercase();
    let file = lower.rsplit('/').next()?;
    // Metadata files that macOS adds to archives.
    if file.starts_with("._") || lower.starts_with("__macosx/") {
        return None;
    }
    let ending = ENDINGS.into_iter().find(|ending| lower.ends_with(ending))?;
    let stem = lower.strip_suffix(ending)?;
    let prefix = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = stem[prefix.len()..].parse().ok()?;
    Some((format!("{prefix}*{ending}"), number))
}

/// Finds the largest group of numbered frames with the same prefix and extension. Numbers may start
/// anywhere and have any constant step.
///
/// # Errors
/// If a number occurs twice or one is missing.
pub(crate) fn find_frames(names: &[String]) -> Result<Found, SequenceError> {
    let mut groups: BTreeMap<String, Vec<(u64, String)>> = BTreeMap::new();
    let mut ignored = Vec::new();
    for name in names {
        match parse(name) {
            Some((prefix, number)) => {
                groups.entry(prefix).or_default().push((number, name.clone()));
            }
            None => ignored.push(name.clone()),
        }
    }
    // Of groups of equal size the first in alphabetical order.
    let largest = groups.values().map(Vec::len).max().unwrap_or(0);
    let chosen = groups.iter().find(|(_, group)| group.len() == largest).map(|(p, _)| p.clone());
    let series = chosen.as_ref().filter(|_| groups.len() > 1).map(|chosen| {
        let left: Vec<String> = groups
            .iter()
            .filter(|(pattern, _)| *pattern != chosen)
            .map(|(pattern, group)| format!("{pattern} ({})", group.len()))
            .collect();
        format!(
            "several series in the folder: using {chosen} ({largest} frames), ignoring {}",
            left.join(", ")
        )
    });
    let mut frames = chosen.and_then(|prefix| groups.remove(&prefix)).unwrap_or_default();
    ignored.extend(groups.into_values().flatten().map(|(_, name)| name));
    ignored.sort();
    frames.sort();
    check_numbers(&frames)?;
    Ok(Found { frames: frames.into_iter().map(|(_, name)| name).collect(), ignored, series })
}

fn check_numbers(frames: &[(u64, String)]) -> Result<(), SequenceError> {
    let steps = || frames.windows(2).map(|pair| pair[1].0 - pair[0].0);
    let Some(step) = steps().min() else { return Ok(()) };
    for pair in frames.windows(2) {
        let ((a, first), (b, second)) = (&pair[0], &pair[1]);
        let names = || (first.clone(), second.clone());
        if a == b {
            let (first, second) = names();
            return Err(SequenceError::Duplicate { number: *a, first, second });
        }
        if b - a != step {
            let (first, second) = names();
            return Err(SequenceError::Missing { first, second, step });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(names: &[&str]) -> Result<Found, String> {
        find_frames(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn order_is_numeric_and_other_files_are_ignored() {
        let found =
            find(&["f10.ply", "f9.PLY", "F8.ply", "notes.txt", "other.ply", "g1.ply"]).unwrap();
        assert_eq!(found.frames, ["F8.ply", "f9.PLY", "f10.ply"], "numeric");
        assert_eq!(found.ignored, ["g1.ply", "notes.txt", "other.ply"], "reported");
        assert_eq!(
            find(&["a_0005.ply", "a_0000.ply", "a_0010.ply"]).unwrap().frames.len(),
            3,
            "step 5"
        );
        let zipped =
            ["a/", "a/f0.spz", "a/f1.spz", "__MACOSX/a/._f0.spz", "a/._f2.spz", "b/f2.spz"];
        assert_eq!(find(&zipped).unwrap().frames, ["a/f0.spz", "a/f1.spz"], "in an archive");
        let mixed = ["f0.ply", "f0.compressed.ply", "f1.compressed.ply", "f1.splat"];
        assert_eq!(find(&mixed).unwrap().frames.len(), 2, "one format");
        assert_eq!(find(&[]).unwrap(), Found::default(), "empty");
    }

    #[test]
    fn several_series_are_named() {
        let found = find(&["a-0.ply", "a-1.ply", "b-0.ply"]).unwrap();
        assert_eq!(
            found.series.as_deref(),
            Some("several series in the folder: using a-*.ply (2 frames), ignoring b-*.ply (1)"),
            "which series is used"
        );
        assert_eq!(find(&["a-0.ply", "a-1.ply", "notes.txt"]).unwrap().series, None, "one");
    }

    #[test]
    fn missing_and_duplicate_frames_are_named() {
        let error = find(&["f0.ply", "f1.ply", "f3.ply"]).unwrap_err();
        assert!(error.contains("f1.ply and f3.ply"), "{error}");
        let error = find(&["f1.ply", "f01.ply", "f2.ply"]).unwrap_err();
        assert!(error.contains("two files for frame 1"), "{error}");
        assert!(find(&["f99999999999999999999.ply"]).unwrap().frames.is_empty(), "beyond u64");
    }
}
