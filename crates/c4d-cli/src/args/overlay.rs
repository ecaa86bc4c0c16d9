//! Kinds of overlays.

use clap::ValueEnum;

/// Colours of splats by a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OverlayArg {
    /// Parts that move rigidly, as `part N` of c4d edit selects them
    Parts,
    /// Largest distance from the position at the edited frame
    Motion,
    /// Runs: uncertainty of colours that the edited frame hides
    Uncertainty,
    /// Runs: how well the source determines the motion
    Confidence,
    /// Runs: what the edit changed
    Changed,
}

impl OverlayArg {
    /// All overlays, in display order.
    pub(crate) const ALL: [Self; 5] =
        [Self::Parts, Self::Motion, Self::Changed, Self::Confidence, Self::Uncertainty];

    /// Name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Parts => "parts",
            Self::Motion => "motion",
            Self::Uncertainty => "uncertainty",
            Self::Confidence => "confidence",
            Self::Changed => "changed",
        }
    }

    /// Whether the overlay compares a run with its source.
    pub(crate) fn needs_run(self) -> bool {
        matches!(self, Self::Uncertainty | Self::Confidence | Self::Changed)
    }
}
