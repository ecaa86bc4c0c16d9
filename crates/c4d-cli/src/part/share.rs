//! [`Share`]: the part of the work that a process does.

use std::fmt;
use std::ops::Range;

/// Maximum number of parts.
const MAX_PARTS: usize = 10_000;

/// The K-th of N parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Share {
    /// From 1 to [`Share::of`].
    pub(crate) part: usize,
    pub(crate) of: usize,
}

impl Share {
    /// Parses `K/N`.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<usize>().ok();
        let parse = || {
            let (part, of) = text.split_once('/')?;
            Some(Self { part: number(part)?, of: number(of)? })
        };
        parse()
            .filter(|share| (1..=MAX_PARTS).contains(&share.of))
            .filter(|share| (1..=share.of).contains(&share.part))
            .ok_or_else(|| {
                format!(
                    "invalid part `{text}`: expected K/N with K from 1 to N and N up to \
                     {MAX_PARTS}, for example 2/3"
                )
            })
    }

    /// The items of this part among `count`. Parts are consecutive, differ by at most one item, and
    /// the first is never empty.
    pub(crate) fn range(self, count: usize) -> Range<usize> {
        let begin = |part: usize| (part * count).div_ceil(self.of);
        begin(self.part - 1)..begin(self.part)
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "part {} of {}", self.part, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_everything_once() {
        for count in [1, 2, 3, 7, 60, 61] {
            for of in [1, 2, 3, 5, 64] {
                let ranges = (1..=of).map(|part| Share { part, of }.range(count));
                let all: Vec<usize> = ranges.clone().flatten().collect();
                assert_eq!(all, (0..count).collect::<Vec<_>>(), "{count} items, {of} parts");
                let sizes: Vec<usize> = ranges.map(|range| range.len()).collect();
                let (smallest, largest) =
                    (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                assert!(
                    largest - smallest <= 1 && sizes[0] > 0,
                    "{count} items, {of} parts: {sizes:?}"
                );
            }
        }
    }

    #[test]
    fn parts_are_numbered_from_one() {
        assert_eq!(Share::parse("2/3"), Ok(Share { part: 2, of: 3 }), "plain");
        for text in ["0/3", "4/3", "1/0", "1", "a/b", "-1/3", "1/2/3", "", "1/100000"] {
            assert!(Share::parse(text).unwrap_err().contains("2/3"), "{text}");
        }
    }
}
