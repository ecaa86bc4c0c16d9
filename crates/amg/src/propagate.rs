//! The motion stage: from a source scene and edited splats to an edited dynamic scene.

use crate::binding::{Binding, SurfaceBinding};
use crate::carriers;
use crate::dynamics::DynamicSplit;
use crate::generations::Generations;
use crate::guide_input::{GuideInput, ProgressFn, Row};
use crate::identity::{Identity, IdentityMap};
use crate::inheritance::{InheritanceReport, inherit};
use crate::keyframes::KeyFrames;
use crate::near_copies::companions;
use crate::options::{Follow, MotionGuide, MotionOptions};
use crate::persistent::PersistentScene;
use crate::persistent_copies;
use crate::report::MotionReport;
use crate::row_kind::RowKind;
use crate::scene::EditedScene;
use crate::{AmgError, knn};
use anchors::KdTree;
use gs_core::{DynamicScene, Real, Splats};
use std::sync::Arc;
use std::time::Instant;

/// Result of [`propagate`].
#[derive(Debug)]
pub struct Propagation {
    /// The edited dynamic scene. Its [`EditedScene::binding`] is all that needs to be stored.
    pub scene: EditedScene,
    /// Correspondence of edited splats with identical source splats.
    pub identity: IdentityMap,
    /// Which source splats move.
    pub split: DynamicSplit,
    /// Counts, convergence, timings, warnings.
    pub report: MotionReport,
}

/// Estimates the motion of `edited`, an edit of `source` at the edit time (stored parameters, `[M]`
/// splats in world coordinates). With [`crate::IdentityParams::precision`], the scene's
/// [`EditedScene::edited`] differs from `edited`: unchanged splats have the exact values of the
/// source.
///
/// # Errors
/// If the source cannot be evaluated, arrays have inconsistent lengths, or an option is out of
/// range. Unusual data (splats with NaN values, no motion, no overlap) are not errors: they are
/// counted in the report, and the splats concerned are static.
pub fn propagate(
    source: Arc<dyn DynamicScene>,
    edited: Arc<Splats>,
    options: &MotionOptions,
    progress: ProgressFn<'_>,
) -> Result<Propagation, AmgError> {
    options.check()?;
    edited.check_shapes().map_err(|source| AmgError::Shape { which: "edited", source })?;
    let mut report = MotionReport { num_edited_splats: edited.len(), ..Default::default() };
    let edit_time = options.edit_time.unwrap_or(source.time_range().start);

    let clock = Instant::now();
    let followed = surfaces(&source, edit_time, options.follow, progress)?;
    if followed.is_some() {
        report.timings.push(("lifetimes", clock.elapsed().as_secs_f64()));
    }
    let scene = followed.as_ref().map_or(&*source, |(_, persistent)| persistent);
    let mut keys = KeyFrames::of(scene, edit_time, options.num_key_times, &|done| {
        progress("source", done);
    })?;
    report.num_broken_sources = keys.broken.iter().filter(|&&b| b).count();
    if let Some((generations, _)) = &followed {
        // Splats that are invisible in the edit frame cannot be followed.
        for (i, broken) in keys.broken.iter_mut().enumerate() {
            *broken |= !generations.is_shown(i);
        }
    }
    report.timings.push(("source", clock.elapsed().as_secs_f64()));

    let clock = Instant::now();
    progress("identity", 0.0);
    let identity = IdentityMap::of(&keys.at_edit, &edited, &options.identity)?;
    // Values that changed only by the rounding of the file format are restored; otherwise those
    // splats would jump at the edit time.
    let edited = match &options.identity.precision {
        Some(_) => Arc::new(identity.restore(&keys.at_edit, &edited)),
        None => edited,
    };
    let split = DynamicSplit::of(&keys, source.dynamic_mask(), &options.dynamics)?;
    report.timings.push(("identity", clock.elapsed().as_secs_f64()));

    report.num_dynamic = split.dynamic.iter().filter(|&&d| d).count();
    let mut rows = exact_rows(&identity);
    let near_copies = match options.guide {
        MotionGuide::Regions(_) => {
            let reach = f64::from(options.reach) * split.figure_size;
            companions(&keys, &edited, &identity, reach)
        }
        _ => Vec::new(),
    };
    let mut input = GuideInput::of(&keys, &split, &edited, &identity, options, &mut report);
    // Both are sorted by row.
    input
        .open
        .retain(|row| near_copies.binary_search_by_key(row, |companion| companion.row).is_err());
    let mut aggregation = options.aggregation;
    for (&row, found) in
        input.open.iter().zip(input.bind(&mut aggregation, &mut report, progress)?)
    {
        rows[row] = found;
    }
    let mut groups = carriers::groups(&keys, &split.dynamic, &identity);
    for companion in &near_copies {
        rows[companion.row] = (RowKind::Moved, vec![(companion.source, 1.0)]);
        groups.of_row[companion.row] = groups.of_row[companion.neighbor];
    }
    report.near_copies = near_copies.len();
    let mut inherited = match &followed {
        Some((generations, _)) => {
            let frames = (&keys.at_edit, &*edited);
            inherit(generations, frames, &identity, &groups.of_row, &mut rows)
        }
        None => Vec::new(),
    };
    let hidden = followed.as_ref().map_or_else(Vec::new, |(generations, _)| {
        persistent_copies::mark(generations, &identity, &groups.of_row, &near_copies, &mut rows)
    });
    let kinds_and_sources = rows.iter().map(|(kind, entries)| (*kind, &entries[..]));
    let mut binding = Binding::from_rows(kinds_and_sources, keys.at_edit.len())
        .with_groups(groups.groups, groups.of_row);
    if let Some((generations, scene)) = &followed {
        let persistent = scene.persistent.only(followed_ids(&binding));
        let copied = binding.count(RowKind::Copied);
        let counts = InheritanceReport::of(generations, &inherited, copied, persistent.ids.len());
        report.inheritance = Some(counts);
        inherited.extend(hidden);
        inherited.sort_unstable_by_key(|inherited| inherited.row);
        binding = binding.with_surface(SurfaceBinding { persistent, inherited })?;
    }
    let binding = Arc::new(binding);
    fill_report(&mut report, &keys, &identity, &split, &binding);
    report.rotation_prior = aggregation.rotation_prior;

    progress("done", 1.0);
    let scene = match &options.guide {
        MotionGuide::Field(field) => {
            EditedScene::with_field(source, edited, edit_time, binding, Arc::clone(field))?
        }
        _ => EditedScene::new(source, edited, edit_time, binding, aggregation)?,
    };
    Ok(Propagation { scene, identity, split, report })
}

/// The generations of the source, and the source with splats extended over the whole clip; `None`
/// if the edit applies to splats.
fn surfaces(
    source: &Arc<dyn DynamicScene>,
    edit_time: f32,
    follow: Follow,
    progress: ProgressFn<'_>,
) -> Result<Option<(Generations, PersistentScene)>, AmgError> {
    if follow == Follow::Splats {
        return Ok(None);
    }
    let generations = Generations::of(&**source, edit_time, &|done| progress("lifetimes", done))?;
    let persistent = PersistentScene::new(Arc::clone(source), &generations, edit_time)?;
    Ok(Some((generations, persistent)))
}

/// Whether a source splat is followed by a blended or copied row, or is a carrier of a group.
fn followed_ids(binding: &Binding) -> impl Fn(u32) -> bool {
    let mut wanted = vec![false; binding.num_sources()];
    let follows = |&row: &usize| matches!(binding.kinds()[row], RowKind::Blended | RowKind::Copied);
    let of_rows =
        (0..binding.len()).filter(follows).flat_map(|row| binding.row(row).0.iter().copied());
    let of_groups = binding.groups().iter().flat_map(|group| group.carriers.iter().map(|c| c.0));
    for id in of_rows.chain(of_groups) {
        wanted[id as usize] = true;
    }
    move |id| wanted[id as usize]
}

fn exact_rows(identity: &IdentityMap) -> Vec<Row> {
    let row = |row: &Identity| match *row {
        Identity::Unchanged(id) => (RowKind::Unchanged, vec![(id, 1.0)]),
        Identity::Recolored(id) => (RowKind::Recolored, vec![(id, 1.0)]),
        Identity::Moved { source, .. } => (RowKind::Moved, vec![(source, 1.0)]),
        Identity::Edited => (RowKind::Static, Vec::new()),
    };
    identity.rows.iter().map(row).collect()
}

impl<'a> GuideInput<'a> {
    fn of(
        keys: &'a KeyFrames,
        split: &'a DynamicSplit,
        edited: &'a Splats,
        identity: &'a IdentityMap,
        options: &'a MotionOptions,
        report: &mut MotionReport,
    ) -> Self {
        let finite = |row: usize| {
            let all = |values: &[f32]| values.iter().all(|value| value.is_finite());
            all(&edited.means[row]) && all(&edited.quats[row])
        };
        let (open, broken): (Vec<usize>, Vec<usize>) = (0..edited.len())
            .filter(|&row| identity.rows[row] == Identity::Edited)
            .partition(|&row| finite(row));
        report.broken_rows = broken.len();
        Self { keys, split, edited, identity, options, open }
    }

    /// One row per entry of `open`.
    fn bind(
        &self,
        aggregation: &mut crate::Aggregation,
        report: &mut MotionReport,
        progress: ProgressFn<'_>,
    ) -> Result<Vec<Row>, AmgError> {
        if self.open.is_empty() {
            return Ok(Vec::new());
        }
        let clock = Instant::now();
        let rows = match &self.options.guide {
            MotionGuide::Knn(params) => {
                let (movers, rows) = self.movers(report);
                progress("nearest", 0.0);
                let found = knn::bind(&self.keys.at_edit, &movers, self.edited, &rows, *params);
                self.fill_rows(&rows, found)
            }
            MotionGuide::Paper(params) => {
                let (movers, rows) = self.movers(report);
                let found = crate::paper::bind(
                    &self.keys.at_edit,
                    &movers,
                    self.edited,
                    &rows,
                    params,
                    report,
                    progress,
                )?;
                self.fill_rows(&rows, found)
            }
            MotionGuide::Regions(params) => {
                let (rows, quality) = crate::regions::bind(self, params, report, progress);
                aggregation.rotation_prior *= quality.as_f32();
                rows
            }
            MotionGuide::Field(_) => vec![(RowKind::Field, Vec::new()); self.open.len()],
        };
        report.timings.push(("match", clock.elapsed().as_secs_f64()));
        Ok(rows)
    }

    /// Usable sources, and the open rows whose nearest source moves and is within reach.
    pub(crate) fn movers(&self, report: &mut MotionReport) -> (Vec<usize>, Vec<usize>) {
        let usable: Vec<usize> =
            (0..self.keys.at_edit.len()).filter(|&i| !self.keys.broken[i]).collect();
        let movers: Vec<usize> =
            usable.iter().copied().filter(|&i| self.split.dynamic[i]).collect();
        if movers.is_empty() {
            return (movers, Vec::new());
        }
        let points: Vec<[f64; 3]> =
            usable.iter().map(|&i| self.keys.at_edit.means[i].map(f64::from)).collect();
        let tree = KdTree::<3>::new(&points);
        let reach = f64::from(self.options.reach) * self.split.figure_size;
        let places: Vec<[f64; 3]> =
            self.open.iter().map(|&row| self.edited.means[row].map(f64::from)).collect();
        let nearest: Vec<(bool, bool)> = tree.map(&places, 1, |_, near| {
            let near_enough = near[0].distance_squared.sqrt() <= reach;
            (near_enough, self.split.dynamic[usable[near[0].id as usize]])
        });
        report.out_of_reach = nearest.iter().filter(|(near_enough, _)| !near_enough).count();
        let rows = self
            .open
            .iter()
            .zip(&nearest)
            .filter(|(_, nearest)| **nearest == (true, true))
            .map(|(&row, _)| row)
            .collect();
        (movers, rows)
    }

    /// Rows of `open`: `found` for the subset `rows`; all others are static.
    pub(crate) fn fill_rows(&self, rows: &[usize], found: Vec<Vec<(u32, f32)>>) -> Vec<Row> {
        let mut by_row = rows.iter().zip(found).peekable();
        self.open
            .iter()
            .map(|row| match by_row.next_if(|(found, _)| *found == row) {
                Some((_, sources)) if !sources.is_empty() => (RowKind::Blended, sources),
                _ => (RowKind::Static, Vec::new()),
            })
            .collect()
    }
}

fn fill_report(
    report: &mut MotionReport,
    keys: &KeyFrames,
    identity: &IdentityMap,
    split: &DynamicSplit,
    binding: &Binding,
) {
    report.num_sources = keys.at_edit.len();
    report.dynamic_threshold = split.threshold;
    report.figure_size = split.figure_size;
    report.unchanged = identity.unchanged;
    report.recolored = identity.recolored;
    report.moved = identity.moved;
    report.moved_groups = moved_groups(keys, identity);
    report.edited = identity.edited;
    report.removed = identity.removed.len();
    report.blended = binding.count(RowKind::Blended);
    report.static_rows = binding.count(RowKind::Static);
    report.field_rows = binding.count(RowKind::Field);
    let mut warn = |count: usize, what: &str| {
        if count > 0 {
            report.warnings.push(format!("{count} {what}"));
        }
    };
    warn(report.out_of_reach, "edited splats are beyond reach of the source and do not move");
    warn(report.broken_rows, "edited splats contain non-finite values and are unchanged");
    warn(report.num_broken_sources, "source splats contain non-finite values and are ignored");
    if report.num_dynamic == 0 {
        report.warnings.push("nothing in the source moves: no edited splat moves".to_owned());
    }
    // Rows that are source splats lie on the source, even if a few new rows are far away.
    let shared = identity.matched();
    if report.edited > 0 && report.out_of_reach == report.edited && shared == 0 {
        report.warnings.push("the edit and the source do not overlap".to_owned());
    }
}

/// Number of splats of each group and a description of its similarity, largest first.
fn moved_groups(keys: &KeyFrames, identity: &IdentityMap) -> Vec<(usize, String)> {
    let described = |(number, similarity): (u32, &crate::Similarity)| {
        let points: Vec<[f64; 3]> = identity
            .members(number)
            .map(|(_, id)| keys.at_edit.means[id as usize].map(f64::from))
            .collect();
        let centre = crate::pose::Pose::of(&points).origin;
        (points.len(), similarity.describe(centre, crate::pose::robust_diameter(&points)))
    };
    let mut groups: Vec<(usize, String)> =
        (0..).zip(&identity.similarities).map(described).collect();
    groups.sort_by_key(|group| std::cmp::Reverse(group.0));
    groups
}
