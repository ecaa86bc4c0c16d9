//! Lists of row numbers as text.

use crate::error::SyntaxError;

/// Maximum length of a range, rows; larger than any file of splats.
const MAX_RANGE: u64 = 1 << 32;

/// Parses row numbers from 0, separated by spaces, commas, brackets or line ends; `10..20` is a
/// range that includes both ends; `#` begins a comment. Duplicates are allowed. Returns ranges with
/// both ends included.
///
/// # Errors
/// For a malformed line; the error contains its text and the column.
pub fn parse_ids(text: &str) -> Result<Vec<(u64, u64)>, SyntaxError> {
    let mut ranges = Vec::new();
    for line in text.lines() {
        let content = line.split('#').next().unwrap_or_default();
        let chars: Vec<char> = content.chars().collect();
        let is_separator = |c: char| c.is_whitespace() || "[],;".contains(c);
        let mut at = 0;
        while at < chars.len() {
            if is_separator(chars[at]) {
                at += 1;
                continue;
            }
            let start = at;
            while at < chars.len() && !is_separator(chars[at]) {
                at += 1;
            }
            let word: String = chars[start..at].iter().collect();
            let range = match word.split_once("..") {
                Some((low, high)) => low.parse().ok().zip(high.parse().ok()),
                None => word.parse().ok().map(|id| (id, id)),
            };
            let excerpt: String =
                chars[start.saturating_sub(20)..(at.min(start + 40))].iter().collect();
            let column = start.min(20);
            match range {
                Some((low, high)) if low <= high && high - low <= MAX_RANGE => {
                    ranges.push((low, high));
                }
                Some(_) => {
                    return Err(SyntaxError::new(
                        &excerpt,
                        column,
                        "the range is empty or too long",
                    ));
                }
                None => {
                    let what = "expected row numbers from 0, or ranges such as `10..20`";
                    return Err(SyntaxError::new(&excerpt, column, what));
                }
            }
        }
    }
    Ok(ranges)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_ranges_and_comments() {
        let text = "# picked\n1, 2 3\n[10..12,\t7]\n";
        let expected = [(1, 1), (2, 2), (3, 3), (10, 12), (7, 7)];
        assert_eq!(parse_ids(text).unwrap(), expected, "rows and ranges");
        assert_eq!(parse_ids("").unwrap(), [], "an empty list");
    }

    #[test]
    fn errors_contain_the_column() {
        for (text, column) in [("1 x", 3), ("5..2", 1), ("-1", 1), ("1.5", 1), ("1\n2 3 nan", 5)] {
            assert_eq!(parse_ids(text).unwrap_err().column, column, "{text}");
        }
        assert!(parse_ids("0..99999999999999").is_err(), "a range that is too long");
    }
}
