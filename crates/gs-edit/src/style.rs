//! [`StyleTransfer`]: the part of [`crate::Action::Style`] that needs renders.

use gs_core::{Image, Splats};
use std::error::Error;

/// Changes colours so that renders have the patterns of a picture. Implemented by callers, because
/// it needs cameras and a rasteriser.
pub trait StyleTransfer {
    /// Returns `splats` with new harmonics for the `selected` ones (`[N]`); everything else is
    /// ignored. The colours already have the distribution of those of `picture`, which has three
    /// channels, or four with coverage, 0 to 1.
    ///
    /// # Errors
    /// Any error of the implementation.
    fn transfer(
        &mut self,
        splats: &Splats,
        selected: &[bool],
        picture: &Image,
    ) -> Result<Splats, Box<dyn Error + Send + Sync>>;
}

/// Rejects [`crate::Action::Style`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct NoStyleTransfer;

impl StyleTransfer for NoStyleTransfer {
    fn transfer(
        &mut self,
        _splats: &Splats,
        _selected: &[bool],
        _picture: &Image,
    ) -> Result<Splats, Box<dyn Error + Send + Sync>> {
        Err("a style needs renders; apply the step with `Editor::apply_with`".into())
    }
}
