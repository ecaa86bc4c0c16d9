//! [`Culling`]: which tiles a splat is listed in.

use gs_core::Real;

/// Which tiles inside a splat's 3σ rectangle are listed. The image is the same whichever: only time
/// differs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Culling {
    /// Tiles that the splat reaches with the opacity it has (a third fewer than its rectangle). A
    /// forward pass that finds an opacity larger than the lists were made for makes them anew,
    /// without projecting or sorting. The default.
    #[default]
    Opacity,
    /// All tiles of the rectangle, as the reference lists them: the oracle that tests compare with.
    Rectangle,
}

impl Culling {
    /// Logarithm of the opacity to cull with, given that of the splat.
    pub(crate) fn log_opacity<F: Real>(self, own: F) -> Option<F> {
        match self {
            Self::Opacity => Some(own),
            Self::Rectangle => None,
        }
    }
}
