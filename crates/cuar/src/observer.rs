//! [`RefineObserver`]: callbacks of a run.

use crate::{State, ViewTime};
use gs_core::Image;

/// Progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct RefineProgress {
    /// `"images"` (rendering the supervision), `"refine"`, or `"report"`.
    pub stage: &'static str,
    /// Completed steps of the stage.
    pub done: usize,
    /// Total number of steps of the stage.
    pub total: usize,
    /// Eq. 20: mean over the last evaluation of every image (for the regression solver, over the
    /// images of the current pass); `None` before the first evaluation.
    pub loss: Option<f64>,
    /// Seconds since the stage began.
    pub elapsed_secs: f64,
    /// Estimated seconds to the end of the stage; `None` if unknown.
    pub eta_secs: Option<f64>,
}

/// Current state of one image, cropped to what edited splats reach.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Preview {
    /// Index of the camera.
    pub view: usize,
    /// Scene time.
    pub time: f32,
    /// Column and row of the crop's first pixel in the whole image.
    pub origin: [usize; 2],
    /// Render before refinement, RGB, 0 to 1, `[h,w,3]`.
    pub before: Image,
    /// Render with the current colours, `[h,w,3]`.
    pub now: Image,
    /// Colours that supervise the render, `[h,w,3]`; black where there are none.
    pub target: Image,
    /// 1 where `target` supervises, else 0, `[h,w,1]`.
    pub mask: Image,
}

/// Callbacks of a run. Every method has a default that does nothing.
pub trait RefineObserver {
    /// Called after every few images.
    fn progress(&mut self, progress: &RefineProgress) {
        let _ = progress;
    }

    /// Called at intervals of [`crate::RefineOptions::preview_secs`] or more.
    fn preview(&mut self, preview: &Preview) {
        let _ = preview;
    }

    /// Called at intervals of [`crate::RefineOptions::checkpoint_secs`] or more, and before a
    /// cancelled run returns, with a state that the caller can store.
    fn checkpoint(&mut self, state: &State) {
        let _ = state;
    }

    /// Called before images are made, with a hash of their inputs. The hash does not include the
    /// scene's motion.
    fn begin_images(&mut self, fingerprint: u64) {
        let _ = fingerprint;
    }

    /// The bytes that [`RefineObserver::store_image`] received for this view and time in a run with
    /// the same scene, rasteriser and hash. With `None`, or malformed bytes, the image is made
    /// again.
    fn stored_image(&mut self, at: ViewTime) -> Option<Vec<u8>> {
        let _ = at;
        None
    }

    /// Called with each new image, encoded as bytes, which the caller may store.
    fn store_image(&mut self, at: ViewTime, bytes: &[u8]) {
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
