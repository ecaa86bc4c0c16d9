//! [`SupervisionStats`]: counts of supervised and rejected pixels.

/// Reason why a masked pixel has no supervision from frame 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Rejection {
    /// The coverage is below [`crate::WarpParams::min_coverage`].
    Uncovered,
    /// Several depths mix ([`crate::WarpParams::spread_tolerance`]).
    Mixed,
    /// Facing away from the camera in frame 1, or seen at a grazing angle
    /// ([`crate::WarpParams::min_facing`]).
    TurnedAway,
    /// Outside the image of frame 1.
    OutOfView,
    /// Frame 1 shows another depth there ([`crate::WarpParams::depth_tolerance`]).
    Hidden,
    /// Under [`crate::WarpForm::Paper`]: no pixel of frame 1 lands here.
    NothingLanded,
}

impl Rejection {
    /// Every reason, in the order of [`SupervisionStats::rejections`].
    pub const ALL: [Self; 6] = [
        Self::Uncovered,
        Self::Mixed,
        Self::TurnedAway,
        Self::OutOfView,
        Self::Hidden,
        Self::NothingLanded,
    ];

    /// Human-readable name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uncovered => "hardly covered",
            Self::Mixed => "several depths mixed",
            Self::TurnedAway => "facing away in frame 1",
            Self::OutOfView => "out of view in frame 1",
            Self::Hidden => "hidden in frame 1",
            Self::NothingLanded => "no pixel of frame 1 lands there",
        }
    }
}

/// Counts of pixels, summed over the supervised images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SupervisionStats {
    /// Pixels that an edited splat reaches.
    pub live: u64,
    /// Of those, pixels of the artifact mask (M of Eq. 17).
    pub masked: u64,
    /// Masked pixels whose surface is visible in frame 1.
    pub surface: u64,
    /// Other masked pixels, whose splats are visible in frame 1
    /// ([`crate::WarpParams::min_known_color`]).
    pub splat_colors: u64,
    /// Masked pixels without supervision, by the reason why their surface was rejected, in the
    /// order of [`Rejection::ALL`].
    pub rejections: [u64; 6],
}

impl SupervisionStats {
    /// Masked pixels with supervision from frame 1.
    pub fn supervised(&self) -> u64 {
        self.surface + self.splat_colors
    }

    /// The reasons that occur, most frequent first, each with its share of the masked pixels, as
    /// text.
    pub fn reasons(&self) -> String {
        let mut found: Vec<(u64, Rejection)> = self
            .rejections
            .into_iter()
            .zip(Rejection::ALL)
            .filter(|(count, _)| *count > 0)
            .collect();
        found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        let share = |count: u64| 100.0 * count as f64 / self.masked.max(1) as f64;
        let each = found
            .iter()
            .map(|(count, rejection)| format!("{} {:.0} %", rejection.name(), share(*count)));
        each.collect::<Vec<_>>().join(", ")
    }

    pub(crate) fn count(&mut self, pixel_source: PixelSource) {
        self.masked += 1;
        match pixel_source {
            PixelSource::Surface => self.surface += 1,
            PixelSource::SplatColors => self.splat_colors += 1,
            PixelSource::Rejected(rejection) => self.rejections[rejection as usize] += 1,
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.live += other.live;
        self.masked += other.masked;
        self.surface += other.surface;
        self.splat_colors += other.splat_colors;
        self.rejections.iter_mut().zip(other.rejections).for_each(|(sum, more)| *sum += more);
    }
}

/// Source of a pixel's supervision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PixelSource {
    /// The surface, visible in frame 1.
    Surface,
    /// The colours of its splats, visible in frame 1.
    SplatColors,
    /// None.
    Rejected(Rejection),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_counted_once() {
        let mut stats = SupervisionStats::default();
        for rejection in Rejection::ALL {
            stats.count(PixelSource::Rejected(rejection));
        }
        stats.count(PixelSource::Surface);
        stats.count(PixelSource::SplatColors);
        assert_eq!(
            (stats.rejections, stats.masked, stats.supervised()),
            ([1; 6], 8, 2),
            "each by its index"
        );
    }
}
