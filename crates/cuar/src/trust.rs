//! Which pixels frame 1 tells about, counted ([`Trust`]).

/// Why frame 1 is not trusted at a pixel of the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Doubt {
    /// Covered less than [`crate::WarpParams::min_coverage`].
    Uncovered,
    /// Several depths mix ([`crate::WarpParams::spread_tolerance`]).
    Mixed,
    /// Turned away from the camera in frame 1, or seen at a grazing angle ([`crate::WarpParams::min_facing`]).
    TurnedAway,
    /// Outside the image of frame 1.
    OutOfView,
    /// Frame 1 shows another depth there ([`crate::WarpParams::depth_tolerance`]).
    Hidden,
    /// Under [`crate::WarpForm::Paper`]: no pixel of frame 1 lands here.
    NothingLanded,
}

impl Doubt {
    /// Every reason, in the order of [`Trust::doubts`].
    pub const ALL: [Self; 6] = [
        Self::Uncovered,
        Self::Mixed,
        Self::TurnedAway,
        Self::OutOfView,
        Self::Hidden,
        Self::NothingLanded,
    ];

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uncovered => "hardly covered",
            Self::Mixed => "several depths mixed",
            Self::TurnedAway => "turned away in frame 1",
            Self::OutOfView => "out of view in frame 1",
            Self::Hidden => "hidden in frame 1",
            Self::NothingLanded => "no pixel of frame 1 lands there",
        }
    }
}

/// How the pixels of the supervised images were judged. Pixels, sums over the images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Trust {
    /// That an edited splat reaches.
    pub live: u64,
    /// Of those, called artifacts (M of Eq. 17).
    pub masked: u64,
    /// Of the masked, those whose surface frame 1 shows.
    pub surface: u64,
    /// Of the masked, others whose splats frame 1 shows ([`crate::WarpParams::min_carried`]).
    pub carried: u64,
    /// Of the masked, those that neither tells of, by why the surface is not trusted, in the order of [`Doubt::ALL`].
    pub doubts: [u64; 6],
}

impl Trust {
    /// Masked pixels that frame 1 tells of.
    pub fn known(&self) -> u64 {
        self.surface + self.carried
    }

    /// The reasons that occur, most frequent first, each with its share of the masked pixels, for people.
    pub fn reasons(&self) -> String {
        let mut found: Vec<(u64, Doubt)> =
            self.doubts.into_iter().zip(Doubt::ALL).filter(|(count, _)| *count > 0).collect();
        found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        let share = |count: u64| 100.0 * count as f64 / self.masked.max(1) as f64;
        let each =
            found.iter().map(|(count, doubt)| format!("{} {:.0} %", doubt.name(), share(*count)));
        each.collect::<Vec<_>>().join(", ")
    }

    pub(crate) fn count(&mut self, verdict: Verdict) {
        self.masked += 1;
        match verdict {
            Verdict::Surface => self.surface += 1,
            Verdict::Carried => self.carried += 1,
            Verdict::Doubted(doubt) => self.doubts[doubt as usize] += 1,
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.live += other.live;
        self.masked += other.masked;
        self.surface += other.surface;
        self.carried += other.carried;
        self.doubts.iter_mut().zip(other.doubts).for_each(|(sum, more)| *sum += more);
    }
}

/// What a pixel's supervision comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The surface that frame 1 shows.
    Surface,
    /// The splats that frame 1 shows.
    Carried,
    /// Nothing.
    Doubted(Doubt),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_counted_once() {
        let mut trust = Trust::default();
        for doubt in Doubt::ALL {
            trust.count(Verdict::Doubted(doubt));
        }
        trust.count(Verdict::Surface);
        trust.count(Verdict::Carried);
        assert_eq!(
            (trust.doubts, trust.masked, trust.known()),
            ([1; 6], 8, 2),
            "each by its place"
        );
    }
}
