//! [`Supervision`]: makes the supervised images, several at a time.

use crate::{
    CuarError, RefineReport, SupervisionStats, Views,
    problem::Watch,
    sample::{Builder, Made, Sample},
    sample_source::Source,
    stored_image,
    view_sampler::ViewTime,
    warp::FirstFrame,
};
use gs_core::{DynamicScene, Rasterizer, Splats};
use rayon::prelude::*;
use std::ops::Range;

/// Number of images after which the mean size of an image is used for the budget.
const PROBE: usize = 4;

/// Makes the supervised images.
pub(crate) struct Supervision<'a, R: Rasterizer> {
    scene: &'a dyn DynamicScene,
    views: &'a Views<'a>,
    source: Source<'a, R>,
    /// One per image made at once.
    builders: Vec<Builder<R::Prepared>>,
    /// The scene at the times of the current group.
    moments: Vec<(f32, Splats)>,
    /// Frame 1 per view, while it is needed.
    frames: Vec<Option<FirstFrame>>,
    pub stats: SupervisionStats,
    /// Images in which the floor is the mask's threshold.
    pub num_floored: usize,
    /// Per edited splat: the number of images in which it exceeds the mask's threshold (Eq. 17 for
    /// one splat), and the number of images in which it is visible.
    pub uncertain_counts: Vec<[u32; 2]>,
}

impl<'a, R: Rasterizer<Prepared: Send> + Sync> Supervision<'a, R> {
    pub(crate) fn new(
        scene: &'a dyn DynamicScene,
        views: &'a Views<'a>,
        source: Source<'a, R>,
        lanes: usize,
    ) -> Self {
        Self {
            scene,
            views,
            builders: (0..lanes).map(|_| Builder::default()).collect(),
            moments: Vec::new(),
            frames: vec![None; views.cameras.len()],
            stats: SupervisionStats::default(),
            num_floored: 0,
            uncertain_counts: vec![[0; 2]; source.edited.iter().filter(|edited| **edited).count()],
            source,
        }
    }

    /// Images for `drawn` (sorted by time), as many as fit in `memory`.
    pub(crate) fn build(
        &mut self,
        drawn: &[ViewTime],
        memory: usize,
        done: usize,
        watch: &mut Watch,
        report: &mut RefineReport,
    ) -> Result<Vec<Sample<R::Prepared>>, CuarError> {
        let mut drawn = drawn.to_vec();
        let mut samples = Vec::with_capacity(drawn.len());
        let mut next = 0;
        while next < drawn.len() {
            let mut end = drawn.len().min(next + self.builders.len());
            if next < PROBE {
                end = end.min(PROBE);
            }
            for made in self.group(&drawn, next..end, watch)? {
                self.count(&made);
                samples.push(made.sample);
            }
            next = end;
            if next == PROBE.min(drawn.len()) {
                let bytes: usize = samples.iter().map(Sample::bytes).sum();
                let each = (bytes / next).max(1);
                let fit = (memory / each).max(next);
                if fit < drawn.len() {
                    report.warnings.push(format!(
                        "{fit} of {} images fit into the memory budget",
                        drawn.len()
                    ));
                    let rest = drawn.split_off(next);
                    let keep = fit - next;
                    drawn.extend((0..keep).map(|k| rest[k * rest.len() / keep]));
                }
            }
            watch.step(done + next, None);
            watch.stop_if_cancelled()?;
        }
        Ok(samples)
    }

    /// Makes the images of `drawn` (sorted by time) for the observer alone.
    pub(crate) fn keep(&mut self, drawn: &[ViewTime], watch: &mut Watch) -> Result<(), CuarError> {
        let mut next = 0;
        while next < drawn.len() {
            let end = drawn.len().min(next + self.builders.len());
            self.group(drawn, next..end, watch)?;
            next = end;
            watch.step(next, None);
            watch.stop_if_cancelled()?;
        }
        Ok(())
    }

    /// The images `drawn[group]` that show edited splats. A render of frame 1 stays in memory while
    /// a later image of `drawn` has its view.
    fn group(
        &mut self,
        drawn: &[ViewTime],
        group: Range<usize>,
        watch: &mut Watch,
    ) -> Result<Vec<Made<R::Prepared>>, CuarError> {
        let made = self.made(&drawn[group.clone()], watch)?;
        for at in &drawn[group.clone()] {
            if !drawn[group.end..].iter().any(|later| later.view == at.view) {
                self.frames[at.view] = None;
            }
        }
        Ok(made.into_iter().flatten().collect())
    }

    /// The images of `group`: stored ones from an earlier run, and new ones.
    fn made(
        &mut self,
        group: &[ViewTime],
        watch: &mut Watch,
    ) -> Result<Vec<Option<Made<R::Prepared>>>, CuarError> {
        let num_rows = self.uncertain_counts.len();
        let mut kept: Vec<_> = group
            .iter()
            .map(|&at| stored_image::decode(&watch.stored_image(at)?, at, num_rows))
            .collect();
        let missing: Vec<ViewTime> =
            group.iter().zip(&kept).filter(|(_, kept)| kept.is_none()).map(|(at, _)| *at).collect();
        let mut fresh = self.make(&missing)?.into_iter();
        for (&at, kept) in group.iter().zip(&mut kept) {
            if kept.is_none()
                && let Some(made) = fresh.next()
            {
                watch.store_image(at, &stored_image::encode(made.as_ref()));
                *kept = Some(made);
            }
        }
        Ok(kept.into_iter().map(Option::flatten).collect())
    }

    fn count<P>(&mut self, made: &Made<P>) {
        self.stats.add(&made.stats);
        self.num_floored += usize::from(made.floored);
        for (entry, &uncertain) in made.sample.entries.iter().zip(&made.uncertain) {
            let [count, seen] = &mut self.uncertain_counts[entry.row as usize];
            *count += u32::from(uncertain);
            *seen += 1;
        }
    }

    /// The images `group`, in parallel; `None` if no edited splat is visible.
    fn make(&mut self, group: &[ViewTime]) -> Result<Vec<Option<Made<R::Prepared>>>, CuarError> {
        self.evaluate(group)?;
        let mut views: Vec<usize> = group.iter().map(|at| at.view).collect();
        views.sort_unstable();
        views.dedup();
        views.retain(|&view| self.frames[view].is_none());
        let (source, cameras) = (&self.source, self.views.cameras);
        let frames: Vec<FirstFrame> = views
            .par_iter()
            .zip(self.builders.par_iter_mut())
            .map(|(&view, builder)| builder.first_frame(source, &cameras[view]))
            .collect::<Result<_, _>>()?;
        for (view, frame) in views.into_iter().zip(frames) {
            self.frames[view] = Some(frame);
        }
        let (moments, frames) = (&self.moments, &self.frames);
        group
            .par_iter()
            .zip(self.builders.par_iter_mut())
            .map(|(&at, builder)| {
                let moment = moments.iter().find(|(time, _)| *time == at.time);
                let (Some((_, splats)), Some(frame)) = (moment, &frames[at.view]) else {
                    return Ok(None);
                };
                builder.sample(source, at, splats, &cameras[at.view], frame)
            })
            .collect()
    }

    /// Evaluates the scene at the times of `group`.
    fn evaluate(&mut self, group: &[ViewTime]) -> Result<(), CuarError> {
        let wanted = |time: f32| group.iter().any(|at| at.time == time);
        for at in group {
            if self.moments.iter().any(|(time, _)| *time == at.time) {
                continue;
            }
            let spare = self.moments.iter().position(|(time, _)| !wanted(*time));
            let place = spare.unwrap_or_else(|| {
                self.moments.push((f32::NAN, Splats::default()));
                self.moments.len() - 1
            });
            let (time, splats) = &mut self.moments[place];
            *time = f32::NAN;
            self.scene.at_into(at.time, splats)?;
            CuarError::check("splats", splats.len(), self.source.first.len())?;
            *time = at.time;
        }
        Ok(())
    }
}
