//! [`Views`]: cameras and times, and the draw of images from them.

use crate::CuarError;
use gs_core::{Camera, SplitMix64, TimeRange};

/// Cameras and times from which images are drawn.
#[derive(Debug, Clone, Copy)]
pub struct Views<'a> {
    /// All cameras. A camera with a [`Camera::time`] (a frame of a monocular video) is used only at
    /// that time and possibly at the edited frame. The others are used at every time.
    pub cameras: &'a [Camera],
    /// Scene times, in any order, at which cameras without a time are used.
    pub times: &'a [f32],
    /// Indices of held-out cameras. They never supervise; the report states their loss before and
    /// after the refinement.
    pub held_out: &'a [usize],
}

/// One image: a camera and a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewTime {
    /// Index into [`Views::cameras`].
    pub view: usize,
    /// Scene time, within the scene's range.
    pub time: f32,
}

/// Drawn images: those that supervise and those that are only evaluated.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct DrawnViews {
    pub samples: Vec<ViewTime>,
    pub held_out: Vec<ViewTime>,
}

/// Times at which each held-out view is evaluated.
const HELD_OUT_TIMES: usize = 4;

/// Cameras with a time that are also used for the edited frame.
const FIRST_FRAMES: usize = 20;

impl Views<'_> {
    pub(crate) fn check(&self, range: TimeRange) -> Result<(), CuarError> {
        for camera in self.cameras {
            camera.check()?;
        }
        if let Some(&view) = self.held_out.iter().find(|&&view| view >= self.cameras.len()) {
            return Err(CuarError::input(format!(
                "held-out view {view}, but there are {} cameras",
                self.cameras.len()
            )));
        }
        let own = self.cameras.iter().filter_map(|camera| camera.time);
        if let Some(time) =
            own.chain(self.times.iter().copied()).find(|&time| !range.contains(time))
        {
            return Err(CuarError::input(format!(
                "time {time}, expected {} to {}",
                range.start, range.end
            )));
        }
        Ok(())
    }

    /// Draws `count` images, spread as evenly over views and times as the count allows.
    pub(crate) fn draw(
        &self,
        count: usize,
        keep_first: Option<f32>,
        edit_time: f32,
        seed: u64,
    ) -> DrawnViews {
        let mut rng = SplitMix64::new(seed);
        let held = |view: usize| self.held_out.contains(&view);
        let training: Vec<usize> = (0..self.cameras.len()).filter(|&view| !held(view)).collect();
        let (fixed, free): (Vec<usize>, Vec<usize>) =
            training.iter().partition(|&&view| self.cameras[view].time.is_some());
        // the edited frame would only supervise itself
        let mut times: Vec<f32> =
            self.times.iter().copied().filter(|&time| time != edit_time).collect();
        times.sort_by(f32::total_cmp);
        times.dedup();

        let mut samples = Vec::new();
        let fixed_share = match (fixed.len(), free.len() * times.len()) {
            (some, 0) => count.min(some),
            (some, all) => (count * some / (some + all)).min(some),
        };
        let order = rng.order(fixed.len());
        for &pick in &order[..fixed_share] {
            let view = fixed[pick];
            samples.extend(self.cameras[view].time.map(|time| ViewTime { view, time }));
        }
        let count = (count - fixed_share).min(free.len() * times.len());
        if count >= free.len() * times.len() {
            for &time in &times {
                samples.extend(free.iter().map(|&view| ViewTime { view, time }));
            }
        } else {
            let mut deck = Vec::new();
            for k in 0..count {
                let time = times[k * times.len() / count];
                // every view once per round, so that a view recurs after two rounds at most
                if deck.is_empty() {
                    deck = rng.order(free.len());
                }
                let fresh = |&pick: &usize| !samples.contains(&ViewTime { view: free[pick], time });
                let Some(at) = deck.iter().rposition(fresh) else { continue };
                samples.push(ViewTime { view: free[deck.remove(at)], time });
            }
        }
        if let Some(time) = keep_first {
            samples.extend(free.iter().map(|&view| ViewTime { view, time }));
            // frame 1 also supervises cameras with a time; of the many cameras of a video, a few
            // suffice to keep its colours
            let some = fixed_share.min(FIRST_FRAMES);
            samples.extend(order[..some].iter().map(|&pick| ViewTime { view: fixed[pick], time }));
        }
        samples.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.view.cmp(&b.view)));
        samples.dedup();

        let mut held_out = Vec::new();
        for &view in self.held_out {
            match self.cameras[view].time {
                Some(time) => held_out.push(ViewTime { view, time }),
                None => held_out.extend((0..HELD_OUT_TIMES.min(times.len())).map(|k| {
                    // the middle of each interval
                    let at = (2 * k + 1) * times.len() / (2 * HELD_OUT_TIMES.min(times.len()));
                    ViewTime { view, time: times[at] }
                })),
            }
        }
        held_out.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.view.cmp(&b.view)));
        held_out.dedup();
        DrawnViews { samples, held_out }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras(count: usize) -> Vec<Camera> {
        vec![Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 8, 8); count]
    }

    #[test]
    fn draws_are_even_and_seeded_and_exclude_held_out_views() {
        let (cameras, times) = (cameras(10), TimeRange::UNIT.frames(31));
        let views = Views { cameras: &cameras, times: &times, held_out: &[3, 7] };
        let drawn = views.draw(60, None, 0.0, 5);
        assert_eq!(drawn.samples.len(), 60, "the requested number");
        assert_eq!(drawn, views.draw(60, None, 0.0, 5), "seeded");
        assert_ne!(drawn, views.draw(60, None, 0.0, 6), "a different seed");
        for view in 0..10 {
            let seen = drawn.samples.iter().filter(|sample| sample.view == view).count();
            let expected = if [3, 7].contains(&view) { 0..=0 } else { 6..=9 };
            assert!(expected.contains(&seen), "view {view}: {seen}");
        }
        assert!(drawn.samples.iter().all(|sample| sample.time > 0.0), "not the edited frame");
        assert_eq!(drawn.held_out.len(), 8, "held-out images");
        let all = views.draw(10_000, Some(0.0), 0.0, 5);
        assert_eq!(all.samples.len(), 8 * 31, "every image once");
    }

    #[test]
    fn cameras_with_a_time_are_used_only_at_that_time() {
        let mut cameras = cameras(5);
        for (camera, time) in cameras.iter_mut().zip([0.1, 0.3, 0.5, 0.7, 0.9]) {
            camera.time = Some(time);
        }
        let views = Views { cameras: &cameras, times: &[], held_out: &[2] };
        let drawn = views.draw(100, Some(0.0), 0.0, 0);
        let (first, own): (Vec<ViewTime>, Vec<ViewTime>) =
            drawn.samples.iter().partition(|s| s.time == 0.0);
        assert_eq!((first.len(), own.len()), (4, 4), "the edited frame and their own");
        assert!(own.iter().all(|s| cameras[s.view].time == Some(s.time)), "own time");
        assert!(views.check(TimeRange { start: 0.0, end: 0.8 }).is_err(), "outside the scene");
    }
}
