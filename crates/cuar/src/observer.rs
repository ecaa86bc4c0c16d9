//! [`RefineObserver`]: callbacks of a run.

use crate::{State, ViewTime};
use gs_core::Image;

/// Progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineProgress {
    /// `"images"` (rendering the supervision), `"refine"`, or `"report"`.
    pub stage: &'static str,
    /// Completed steps of the stage.
    pub done: usize,
    /// Total number of steps of the stage.
    pub total: usize,
    /// Eq. 20, mean over the images visited last (in the current pass, for the regression solver);
    /// `None` before the first.
    pub loss: Option<f64>,
    /// Seconds since the stage began.
    pub elapsed_secs: f64,
    /// Estimated seconds to the end of the stage.
    pub eta_secs: Option<f64>,
}

/// Current state of one image, cropped to what edited splats reach.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Preview {
    /// Index of the camera.
    pub view: usize,
    /// Scene time.
    pub time: f32,
    /// Column and row of the crop's first pixel.
    pub origin: [usize; 2],
    /// Render before refinement, `[h,w,3]`.
    pub before: Image,
    /// Render now, `[h,w,3]`.
    pub now: Image,
    /// Supervision, `[h,w,3]`; black where there is none.
    pub target: Image,
    /// Where `target` supervises, `[h,w,1]`.
    pub mask: Image,
}

/// Callbacks of a run. Every method has a default that does nothing.
pub trait RefineObserver {
    /// Called after every few images.
    fn progress(&mut self, progress: &RefineProgress) {
        let _ = progress;
    }

    /// Called every [`crate::RefineOptions::preview_secs`].
    fn preview(&mut self, preview: &Preview) {
        let _ = preview;
    }

    /// Called every [`crate::RefineOptions::checkpoint_secs`], and before a cancelled run returns,
    /// with a state that the caller can store.
    fn checkpoint(&mut self, state: &State) {
        let _ = state;
    }

    /// Called before images are made, with a hash of their inputs, without the scene's motion.
    fn begin_images(&mut self, fingerprint: u64) {
        let _ = fingerprint;
    }

    /// An image that [`RefineObserver::keep_image`] received in a run with the same scene, rasteriser and
    /// hash; `None` to make it again.
    fn kept_image(&mut self, at: ViewTime) -> Option<Vec<u8>> {
        let _ = at;
        None
    }

    /// Called with each new image; the caller may store it.
    fn keep_image(&mut self, at: ViewTime, bytes: &[u8]) {
        let _ = (at, bytes);
    }

    /// Called after every few images; `true` ends the run with
    /// [`Cancelled`](crate::CuarError::Cancelled).
    fn cancelled(&mut self) -> bool {
        false
    }
}

/// An observer that does nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoRefineObserver;

impl RefineObserver for NoRefineObserver {}
