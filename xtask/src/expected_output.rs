//! Compares the output of a documented command with the output that the document shows, so that
//! its numbers cannot become outdated unnoticed.

use anyhow::{Result, bail};

/// Largest relative difference of two numbers that count as equal: printed numbers are rounded, and
/// the last digits of sums differ between vector units.
const TOLERANCE: f64 = 0.02;
/// Matches any one word: a time, a path.
const ANY: &str = "…";

/// Compares the output of a command with the block in the document, line by line and word by word.
/// The lines of the block must occur in this order; the command may print other lines in between.
///
/// # Errors
/// States the first line of the block that was not printed.
pub(crate) fn compare(expected: &str, printed: &str) -> Result<()> {
    let mut rest = printed.lines();
    for line in expected.lines().filter(|line| !line.trim().is_empty()) {
        if !rest.any(|other| is_same(line, other)) {
            bail!("not printed (any more): `{line}`; the command printed:\n{printed}");
        }
    }
    Ok(())
}

fn is_same(expected: &str, printed: &str) -> bool {
    let (mut words, mut others) = (expected.split_whitespace(), printed.split_whitespace());
    loop {
        match (words.next(), others.next()) {
            (None, None) => return true,
            (Some(ANY), Some(_)) => {}
            (Some(word), Some(other)) if word == other || are_close(word, other) => {}
            _ => return false,
        }
    }
}

/// Whether both are numbers, with the same characters around them, and about equal.
fn are_close(word: &str, other: &str) -> bool {
    let (Some((before, a, after)), Some((other_before, b, other_after))) =
        (number(word), number(other))
    else {
        return false;
    };
    (before, after) == (other_before, other_after)
        && (a - b).abs() <= TOLERANCE * f64::max(a.abs(), b.abs())
}

/// The number in a word and the text around it, as in `(12%)`.
fn number(word: &str) -> Option<(&str, f64, &str)> {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | '−');
    let start = word.find(is_part)?;
    let end = word.rfind(|c: char| c.is_ascii_digit())? + 1;
    let value = word.get(start..end)?.replace('−', "-").parse().ok()?;
    Some((&word[..start], value, &word[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_compared_as_numbers() {
        let printed = "begin\nclip.ply  29.8 MB in 0.31 s\nsums (12%)\n";
        assert!(compare("clip.ply 29.9 MB in … s\n", printed).is_ok(), "within the tolerance");
        assert!(compare("clip.ply 29.9 MB in … s\nsums (12%)", printed).is_ok(), "in order");
    }

    #[test]
    fn outdated_lines_are_found() {
        let printed = "a 10.0 dB\nb 20.0 dB\n";
        for stale in ["a 10.5 dB", "a 10 B", "a 10", "b 20 dB\na 10 dB", "c 1", "a -10 dB"] {
            assert!(compare(stale, printed).is_err(), "{stale}");
        }
    }
}
