//! [`FormatLosses`]: sentences that describe the losses of a written file.

use std::fmt::{self, Display};

/// Losses of a written file, one sentence each; empty if nothing is
/// lost. `Display` writes one sentence per line.
///
/// A sentence states the loss and, if possible, its size: "SH degree 3 becomes 0: colour no longer
/// depends on the view", "positions are rounded to 1/8192 of a unit".
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FormatLosses(Vec<String>);

impl FormatLosses {
    /// Nothing lost.
    pub fn none() -> Self {
        Self::default()
    }

    /// Adds a sentence unless it is already present (frames of a
    /// sequence report their losses separately).
    pub fn push(&mut self, sentence: impl Into<String>) {
        let sentence = sentence.into();
        if !self.0.contains(&sentence) {
            self.0.push(sentence);
        }
    }

    /// Whether nothing is lost.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The sentences, in the order they were added.
    pub fn sentences(&self) -> &[String] {
        &self.0
    }
}

impl Display for FormatLosses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join("\n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_are_not_repeated() {
        let mut losses = FormatLosses::none();
        assert!(losses.is_empty() && losses.to_string().is_empty(), "no losses");
        losses.push("normals are zero");
        losses.push("normals are zero");
        losses.push("colours are 8 bit");
        assert_eq!(losses.to_string(), "normals are zero\ncolours are 8 bit", "in order, once");
    }
}
