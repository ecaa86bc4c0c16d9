//! [`EditedFrame`] and [`Truth`]: edited splats and their true motion.

use crate::{
    SynthScene, contact,
    edit::Draft,
    math::row_id,
    part::{Kind, Part, Tag},
    scene::SplatTruth,
    scene::Stray,
};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};

/// An edit of the first frame.
#[derive(Debug, Clone)]
pub struct EditedFrame {
    /// Output of the editor: the only input of a method under test besides the source.
    pub splats: Splats,
    /// Their true motion.
    pub truth: Truth,
}

/// The true motion of edited splats, and labels of each; arrays are
/// `[M]` with the rows of [`EditedFrame::splats`].
///
/// A [`DynamicScene`]: at `t = 0` it equals the edited splats bit for bit, at other times it has
/// their true positions, orientations and scales, with the edited colours.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Body part of each splat.
    pub parts: Vec<Part>,
    /// Effect of the edits on each splat.
    pub tags: Vec<Tag>,
    /// Row of the source splat from which each splat descends; `None` for new geometry. Several
    /// splats can have the same parent.
    pub source_rows: Vec<Option<u32>>,
    /// Whether each splat is scored. Floaters, and outliers that no
    /// edit moved, have no meaningful true motion.
    pub eval_mask: Vec<bool>,
    /// Whether each splat is scored and within 3 % of the figure size of a
    /// source splat whose motion would displace it by more than 8 % of the
    /// figure size: the zones in which methods mix motions.
    pub contact_mask: Vec<bool>,
    scene: SynthScene,
}

impl Truth {
    /// The edited splats as a separate scene.
    pub fn scene(&self) -> &SynthScene {
        &self.scene
    }

    /// Descriptions of the splats beyond the public arrays.
    pub fn rows(&self) -> &[SplatTruth] {
        self.scene.rows()
    }

    /// Figure size of the source scene, world units.
    pub fn figure_size(&self) -> f32 {
        self.scene.figure_size()
    }
}

impl DynamicScene for Truth {
    fn num_splats(&self) -> usize {
        self.scene.num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.scene.sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        self.scene.time_range()
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.at_into(t, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.geometry_into(t, out)
    }
}

/// Ends an editing session.
pub(crate) fn finish(source: &SynthScene, draft: Draft) -> EditedFrame {
    let strays = strays_of(source, &draft.rows, &draft.source_rows);
    let eval_mask: Vec<bool> = draft
        .rows
        .iter()
        .zip(&draft.tags)
        .map(|(row, tag)| match row.kind {
            Kind::Floater => false,
            Kind::Outlier => !matches!(tag, Tag::Unchanged | Tag::Recoloured),
            Kind::Surface | Kind::Interior => true,
        })
        .collect();
    let scene = SynthScene {
        skeleton: source.skeleton.clone(),
        frame1: draft.splats.clone(),
        rows: draft.rows,
        wobbles: Vec::new(),
        strays,
        figure_size: source.figure_size,
        view: source.view,
    };
    let contact_mask = contact::mask(source, &scene, &eval_mask);
    let truth = Truth {
        parts: scene.rows.iter().map(|row| row.part).collect(),
        tags: draft.tags,
        source_rows: draft.source_rows,
        eval_mask,
        contact_mask,
        scene,
    };
    EditedFrame { splats: draft.splats, truth }
}

/// Remaining floaters keep their motion.
fn strays_of(source: &SynthScene, rows: &[SplatTruth], source_rows: &[Option<u32>]) -> Vec<Stray> {
    let mut strays = Vec::new();
    for (i, (row, parent)) in rows.iter().zip(source_rows).enumerate() {
        if row.kind != Kind::Floater {
            continue;
        }
        let own = parent.and_then(|parent| {
            let found = source.strays.binary_search_by_key(&parent, |stray| stray.row);
            found.ok().map(|at| source.strays[at])
        });
        strays.extend(own.map(|stray| Stray { row: row_id(i), ..stray }));
    }
    strays
}
