//! [`EditedScene`]: the edited dynamic scene.

use crate::AmgError;
use crate::aggregate::{SourceAt, SourceMotion, blend_change, blend_geometry, weights_seen};
use crate::binding::Binding;
use crate::field::FieldAt;
use crate::inheritance::changed_dc;
use crate::keyframes::check_rows;
use crate::moved_group::{self, GroupPose};
use crate::options::Aggregation;
use crate::persistent::PersistentMotion;
use crate::row_kind::RowKind;
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Mean, rotation and scales of a row at a time.
type GeometryMut<'a> = ((&'a mut [f32; 3], &'a mut [f32; 4]), &'a mut [f32; 3]);

/// Rows per task.
const BLOCK: usize = 1024;

/// A dynamic scene whose frame `t1` is the edited splats, and which moves with its source.
///
/// * At `t1` it is the edited splats bit for bit.
/// * At any other time the source is evaluated once; the kind of a row determines which values it
///   takes from the source (see [`RowKind`]).
/// * Rows and SH degree are those of the edited splats.
#[derive(Debug)]
pub struct EditedScene {
    source: Arc<dyn DynamicScene>,
    edited: Arc<Splats>,
    binding: Arc<Binding>,
    aggregation: Aggregation,
    edit_time: f32,
    source_1: Splats,
    /// Sources that blended rows follow, `[N]`.
    followed: Vec<bool>,
    /// Motions of the persistent splats from their rest positions to the edit time.
    rest: Vec<PersistentMotion>,
    field: Option<FieldBase>,
    dynamic: Option<Vec<bool>>,
    scratch: Mutex<Vec<Splats>>,
}

/// State of the source at a time other than the edit time.
#[derive(Clone, Copy)]
struct Moment<'a> {
    source_t: &'a Splats,
    /// The splats that are followed: the source, or its splats extended over the clip.
    followed_t: &'a Splats,
    /// Motions of the followed sources, `[N]`.
    motions: &'a [SourceMotion],
    /// Whether faded sources have lower weights.
    fading: bool,
}

#[derive(Debug)]
struct FieldBase {
    field: Arc<dyn FieldAt>,
    at_edit: Splats,
}

impl EditedScene {
    /// Joins `edited` (frame `edit_time`) to `source` by `binding`. Evaluates the source once.
    ///
    /// # Errors
    /// If the source cannot be evaluated at `edit_time`, the edited splats are malformed, the
    /// binding was made for other clouds, or it has [`RowKind::Field`] rows (see
    /// [`EditedScene::with_field`]).
    pub fn new(
        source: Arc<dyn DynamicScene>,
        edited: Arc<Splats>,
        edit_time: f32,
        binding: Arc<Binding>,
        aggregation: Aggregation,
    ) -> Result<Self, AmgError> {
        let scene = Self::assemble(source, edited, edit_time, binding, aggregation)?;
        if scene.binding.count(RowKind::Field) > 0 {
            return Err(AmgError::Binding {
                what: "rows of kind `Field` need a deformation field, found none: use `EditedScene::with_field`".to_owned(),
            });
        }
        Ok(scene)
    }

    /// As [`EditedScene::new`], with the field for [`RowKind::Field`] rows.
    ///
    /// # Errors
    /// As [`EditedScene::new`], and if the field cannot be evaluated at `edit_time`.
    pub fn with_field(
        source: Arc<dyn DynamicScene>,
        edited: Arc<Splats>,
        edit_time: f32,
        binding: Arc<Binding>,
        field: Arc<dyn FieldAt>,
    ) -> Result<Self, AmgError> {
        let mut scene = Self::assemble(source, edited, edit_time, binding, Aggregation::PAPER)?;
        let mut at_edit = Splats::default();
        field.displace_into(&scene.edited, edit_time, &mut at_edit)?;
        at_edit.check_shapes().map_err(|source| AmgError::Shape { which: "field's", source })?;
        scene.field = Some(FieldBase { field, at_edit });
        Ok(scene)
    }

    fn assemble(
        source: Arc<dyn DynamicScene>,
        edited: Arc<Splats>,
        edit_time: f32,
        binding: Arc<Binding>,
        aggregation: Aggregation,
    ) -> Result<Self, AmgError> {
        edited.check_shapes().map_err(|source| AmgError::Shape { which: "edited", source })?;
        let source_1 = source.at(edit_time)?;
        source_1.check_shapes().map_err(|source| AmgError::Shape { which: "source", source })?;
        binding.check(source_1.len(), &edited)?;
        let dynamic = source.dynamic_mask().map(|mask| inherit_mask(mask, &binding));
        let mut followed = vec![false; source_1.len()];
        let blended = (0..binding.len()).filter(|&row| binding.kinds()[row] == RowKind::Blended);
        for &id in blended.flat_map(|row| binding.row(row).0) {
            followed[id as usize] = true;
        }
        let rest = binding.surface().map_or_else(Vec::new, |s| s.persistent.motions(&source_1));
        Ok(Self {
            rest,
            source,
            edited,
            binding,
            aggregation,
            edit_time,
            source_1,
            followed,
            field: None,
            dynamic,
            scratch: Mutex::new(Vec::new()),
        })
    }

    /// The edited splats: this scene at [`EditedScene::edit_time`].
    pub fn edited(&self) -> &Arc<Splats> {
        &self.edited
    }

    /// The scene that was edited.
    pub fn source(&self) -> &Arc<dyn DynamicScene> {
        &self.source
    }

    /// Source splats and weights of each edited splat.
    pub fn binding(&self) -> &Arc<Binding> {
        &self.binding
    }

    /// Rules of aggregation.
    pub fn aggregation(&self) -> &Aggregation {
        &self.aggregation
    }

    /// Time of the edited frame.
    pub fn edit_time(&self) -> f32 {
        self.edit_time
    }

    fn borrow_scratch(&self) -> Splats {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn return_scratch(&self, splats: Splats) {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(splats);
    }

    fn evaluate(&self, t: f32, appearance: bool, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        self.copy_edited(appearance, out);
        if t == self.edit_time {
            return Ok(());
        }
        let mut source_t = self.borrow_scratch();
        let surface = self.binding.surface();
        let fading = surface.is_none() && self.aggregation.fading && self.source.fades();
        let opacities = fading || surface.is_some();
        if appearance || opacities {
            self.source.at_into(t, &mut source_t)?;
        } else {
            self.source.geometry_into(t, &mut source_t)?;
        }
        check_rows(&source_t, self.source_1.len())?;
        if appearance || opacities {
            source_t.check_shapes()?;
        }
        let mut persistent = surface.map(|_| self.borrow_scratch());
        if let (Some(surface), Some(persistent)) = (surface, &mut persistent) {
            persistent.clone_from(&self.source_1);
            surface.persistent.move_into(&self.rest, &source_t, persistent);
        }
        let followed_t = persistent.as_ref().unwrap_or(&source_t);
        let motion = |(id, &followed): (usize, &bool)| {
            let between = || SourceMotion::between(&self.source_1, followed_t, id, fading);
            if followed { between() } else { SourceMotion::default() }
        };
        let motions: Vec<SourceMotion> =
            self.followed.par_iter().enumerate().with_min_len(BLOCK).map(motion).collect();
        let moment = Moment { source_t: &source_t, followed_t, motions: &motions, fading };
        self.move_geometry(moment, out);
        if appearance {
            self.move_appearance(moment, out);
        }
        if let Some(persistent) = persistent {
            self.return_scratch(persistent);
        }
        self.return_scratch(source_t);
        self.add_field(t, appearance, out)
    }

    fn copy_edited(&self, appearance: bool, out: &mut Splats) {
        let edited = &*self.edited;
        out.means.clone_from(&edited.means);
        out.quats.clone_from(&edited.quats);
        out.log_scales.clone_from(&edited.log_scales);
        if appearance {
            out.opacity_logits.clone_from(&edited.opacity_logits);
            out.sh.clone_from(&edited.sh);
            out.sh_degree = edited.sh_degree;
        }
    }

    /// Sources of a row, and their weights at this time.
    fn seen_at<'a>(
        (ids, weights): (&'a [u32], &'a [f32]),
        at: Moment<'_>,
        scratch: &'a mut Vec<f32>,
    ) -> (&'a [u32], &'a [f32]) {
        if !at.fading || ids.len() < 2 {
            return (ids, weights);
        }
        weights_seen((ids, weights), |id| at.motions[id].seen(), scratch);
        (ids, scratch)
    }

    fn move_geometry(&self, at: Moment<'_>, out: &mut Splats) {
        let Moment { source_t, followed_t, motions, fading } = at;
        let kinds = self.binding.kinds();
        let poses = self.group_poses(followed_t, fading);
        let move_row =
            |seen: &mut Vec<f32>,
             (row, ((mean, rotation), log_scale)): (usize, GeometryMut<'_>)| {
                let sources = self.binding.row(row);
                match kinds[row] {
                    RowKind::Static | RowKind::Field => {}
                    RowKind::Unchanged | RowKind::Recolored => {
                        let id = sources.0[0] as usize;
                        *mean = source_t.means[id];
                        *rotation = source_t.quats[id];
                        *log_scale = source_t.log_scales[id];
                    }
                    RowKind::Descendant => {
                        let id = sources.0[0] as usize;
                        (*mean, *rotation, *log_scale) =
                            (source_t.means[id], source_t.quats[id], source_t.log_scales[id]);
                        let group = self.binding.inherited(row).and_then(|found| found.group);
                        if let Some(group) = group {
                            moved_group::transform_with_group(
                                &poses[group as usize],
                                mean,
                                rotation,
                                log_scale,
                            );
                        }
                    }
                    kind @ (RowKind::Moved | RowKind::Copied) => {
                        let Some(group) = self.binding.group_number(row) else { return };
                        let source_t = if kind == RowKind::Copied { followed_t } else { source_t };
                        let (edited, id) = ((*mean, *rotation, *log_scale), sources.0[0] as usize);
                        (*mean, *rotation, *log_scale) = moved_group::moved_geometry(
                            edited,
                            id,
                            &poses[group],
                            &self.source_1,
                            source_t,
                        );
                    }
                    RowKind::Blended => {
                        let edited = (*mean, *rotation, *log_scale);
                        let sources = Self::seen_at(sources, at, seen);
                        let source =
                            SourceAt { source_1: &self.source_1, source_t: followed_t, motions };
                        (*mean, *rotation, *log_scale) =
                            blend_geometry(edited, sources, source, self.aggregation);
                    }
                }
            };
        out.means
            .par_iter_mut()
            .zip(&mut out.quats)
            .zip(&mut out.log_scales)
            .enumerate()
            .with_min_len(BLOCK)
            .for_each_init(Vec::new, move_row);
    }

    /// Poses of the groups of moved rows.
    fn group_poses(&self, source_t: &Splats, fading: bool) -> Vec<GroupPose> {
        let mut scratch = Vec::new();
        let pose =
            |group: &crate::MovedGroup| group.pose(&self.source_1, source_t, fading, &mut scratch);
        self.binding.groups().iter().map(pose).collect()
    }

    fn move_appearance(&self, at: Moment<'_>, out: &mut Splats) {
        let source_t = at.source_t;
        let coeffs = out.sh_coeffs();
        let source_coeffs = source_t.sh_coeffs();
        let shared = coeffs.min(source_coeffs);
        let source_1 = &self.source_1;
        // In most formats colours are constant, and the loop over coefficients can be skipped.
        let sh_moves = source_t.sh != source_1.sh;
        let kinds = self.binding.kinds();
        let on_surface = self.binding.surface().is_some();
        let move_row =
            |seen: &mut Vec<f32>, (row, (logit, sh)): (usize, (&mut f32, &mut [[f32; 3]]))| {
                let sources = self.binding.row(row);
                match kinds[row] {
                    RowKind::Static | RowKind::Field => return,
                    RowKind::Unchanged => {
                        let id = sources.0[0] as usize;
                        *logit = source_t.opacity_logits[id];
                        sh[..shared].copy_from_slice(&source_t.sh_of(id)[..shared]);
                        return;
                    }
                    RowKind::Descendant => {
                        self.inherit_appearance(row, sources.0[0] as usize, source_t, logit, sh);
                        return;
                    }
                    // Rows that follow a surface keep the edit's opacity and colours: the splats
                    // that represent the surface appear and disappear.
                    RowKind::Blended | RowKind::Copied if on_surface => return,
                    RowKind::Recolored | RowKind::Blended | RowKind::Moved | RowKind::Copied => {
                        if !self.aggregation.appearance {
                            return;
                        }
                    }
                }
                let sources = Self::seen_at(sources, at, seen);
                let change = blend_change(sources, |id| {
                    (source_1.opacity_logits[id], source_t.opacity_logits[id])
                });
                if change != 0.0 {
                    *logit += change;
                }
                if !sh_moves {
                    return;
                }
                for (k, rgb) in sh[..shared].iter_mut().enumerate() {
                    for channel in 0..3 {
                        let change = blend_change(sources, |id| {
                            let at = id * source_coeffs + k;
                            (source_1.sh[at][channel], source_t.sh[at][channel])
                        });
                        if change != 0.0 {
                            rgb[channel] += change;
                        }
                    }
                }
            };
        out.opacity_logits
            .par_iter_mut()
            .zip(out.sh.par_chunks_exact_mut(coeffs))
            .enumerate()
            .with_min_len(BLOCK)
            .for_each_init(Vec::new, move_row);
    }

    /// The source's appearance with the change that the row inherits, plus the change that a
    /// refinement made in the edited frame.
    fn inherit_appearance(
        &self,
        row: usize,
        id: usize,
        source_t: &Splats,
        logit: &mut f32,
        sh: &mut [[f32; 3]],
    ) {
        let Some(inherited) = self.binding.inherited(row) else { return };
        let refined = |edited: f32, source: f32| {
            let change = edited - source;
            if change.is_finite() { change } else { 0.0 }
        };
        let more = refined(*logit, self.source_1.opacity_logits[id]);
        *logit = inherited.logit(source_t.opacity_logits[id]) + more;
        let before = self.source_1.sh_of(id);
        for (k, (rgb, now)) in sh.iter_mut().zip(source_t.sh_of(id)).enumerate() {
            let changed = if k == 0 {
                changed_dc(&inherited.color, *now)
            } else {
                now.map(|c| inherited.color.harmonics * c)
            };
            *rgb = [0, 1, 2].map(|i| changed[i] + refined(rgb[i], before[k][i]));
        }
    }

    /// Baseline "w/o AMG": stored parameters change by the difference of the field between `t` and
    /// the edit frame.
    fn add_field(&self, t: f32, appearance: bool, out: &mut Splats) -> Result<(), SceneError> {
        let Some(base) = &self.field else { return Ok(()) };
        let mut at_t = self.borrow_scratch();
        base.field.displace_into(&self.edited, t, &mut at_t)?;
        at_t.check_shapes()?;
        let change = |to: f32, from: f32| {
            let change = to - from;
            if change.is_finite() { change } else { 0.0 }
        };
        for row in
            (0..self.binding.len()).filter(|&row| self.binding.kinds()[row] == RowKind::Field)
        {
            for axis in 0..3 {
                out.means[row][axis] +=
                    change(at_t.means[row][axis], base.at_edit.means[row][axis]);
                out.log_scales[row][axis] +=
                    change(at_t.log_scales[row][axis], base.at_edit.log_scales[row][axis]);
            }
            for i in 0..4 {
                out.quats[row][i] += change(at_t.quats[row][i], base.at_edit.quats[row][i]);
            }
            if appearance {
                out.opacity_logits[row] +=
                    change(at_t.opacity_logits[row], base.at_edit.opacity_logits[row]);
                let coeffs = out.sh_coeffs();
                for at in row * coeffs..(row + 1) * coeffs {
                    for channel in 0..3 {
                        out.sh[at][channel] +=
                            change(at_t.sh[at][channel], base.at_edit.sh[at][channel]);
                    }
                }
            }
        }
        self.return_scratch(at_t);
        Ok(())
    }
}

/// Exact rows move if their source does, other rows if the binding moves them.
fn inherit_mask(mask: &[bool], binding: &Binding) -> Vec<bool> {
    let row = |row: usize| match binding.kinds()[row] {
        RowKind::Static => false,
        RowKind::Unchanged
        | RowKind::Recolored
        | RowKind::Moved
        | RowKind::Descendant
        | RowKind::Copied => mask.get(binding.row(row).0[0] as usize).copied().unwrap_or(true),
        RowKind::Blended | RowKind::Field => true,
    };
    (0..binding.len()).map(row).collect()
}

impl DynamicScene for EditedScene {
    fn num_splats(&self) -> usize {
        self.edited.len()
    }

    fn sh_degree(&self) -> usize {
        self.edited.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        self.source.time_range()
    }

    fn num_frames(&self) -> Option<usize> {
        self.source.num_frames()
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, true, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, false, out)
    }

    fn fades(&self) -> bool {
        self.source.fades()
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.dynamic.as_deref()
    }
}
