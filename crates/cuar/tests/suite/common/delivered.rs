//! Edits in two forms, the true one and the one that an image editor delivers, and their
//! comparison at held-out views.

use super::{Painted, render};
use cuar::{
    Backend, BeforeEdit, CuarError, NoRefineObserver, RefineObserver, RefineOptions, Refined,
    State, Views, first_frame_shares, refine_edit,
};
use gs_core::{Camera, DynamicScene, Image, Rasterizer, RenderParams, Splats, TimeRange};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{
    DemoParams, Edit, EditedFrame, Paint, Part, Region, SynthError, SynthScene, UnseenColor,
    apply_edits, apply_visible_edits, demo,
};

/// An edit that misses splats that its pictures do not show.
pub struct Delivered {
    pub name: &'static str,
    pub edits: Vec<Edit>,
    pub source: SynthScene,
    /// The true edit.
    pub truth: EditedFrame,
    /// The delivered edit.
    pub given: EditedFrame,
    /// The cameras of the editor.
    pub pictures: Vec<Camera>,
    pub held_out: Vec<Camera>,
    pub source_rows: Vec<Option<u32>>,
}

#[derive(Debug)]
pub enum Failed {
    Synth(SynthError),
    Cuar(CuarError),
}

impl From<SynthError> for Failed {
    fn from(error: SynthError) -> Self {
        Self::Synth(error)
    }
}

/// The cases: name and edits.
pub fn cases() -> Vec<(&'static str, Vec<Edit>)> {
    let clothes = || Region::parts(&[Part::Chest, Part::UpperArmL, Part::UpperArmR]);
    let legs =
        || Region::parts(&[Part::Pelvis, Part::ThighL, Part::ThighR, Part::ShinL, Part::ShinR]);
    let paint = |region, paint| Edit::Recolour { region, paint };
    vec![
        ("recolour", vec![paint(clothes(), Paint::Solid([0.85, 0.25, 0.2]))]),
        ("local", vec![paint(clothes().within([0.0, 1.15, 0.0], 0.2), Paint::Hue(2.1))]),
        ("textured", vec![paint(clothes(), Paint::Jacket)]),
        ("trousers", vec![paint(legs(), Paint::Tint([0.62, 0.52, 0.34]))]),
        (
            "deleted",
            vec![Edit::Remove { region: Region::parts(&[Part::UpperArmL, Part::ForearmL]) }],
        ),
        (
            "deleted ball",
            vec![Edit::Remove {
                region: Region::parts(&[Part::Ball]).within([0.80, 0.15, 0.50], 0.3),
            }],
        ),
        (
            "deleted legs",
            vec![Edit::Remove { region: Region::parts(&[Part::ThighL, Part::ThighR]) }],
        ),
        ("demo", gs_synth::demo_edits()),
    ]
}

/// 24 pictures on two rings around the figure, and five views between them.
pub fn rings(scene: &SynthScene, (w, h): (u32, u32)) -> (Vec<Camera>, Vec<Camera>) {
    let (low, high) = (scene.orbit_cameras(24, w, h), scene_ring(scene, w, h));
    let pictures = low.iter().step_by(2).chain(high.iter().step_by(2)).cloned().collect();
    (pictures, low.into_iter().skip(1).step_by(4).take(5).collect())
}

/// A second ring, higher.
fn scene_ring(scene: &SynthScene, w: u32, h: u32) -> Vec<Camera> {
    scene
        .orbit_cameras(24, w, h)
        .iter()
        .map(|camera| {
            let eye = camera.position();
            let eye = [0.85 * eye[0], eye[1] + 1.3, 0.85 * eye[2]];
            Camera {
                name: camera.name.clone(),
                ..Camera::look_at(eye, [0.0, 0.95, 0.0], [0.0, 1.0, 0.0], 0.52, w, h)
            }
        })
        .collect()
}

pub fn delivered(
    name: &'static str,
    edits: &[Edit],
    num_splats: usize,
    sh_degree: usize,
    cameras: impl Fn(&SynthScene) -> (Vec<Camera>, Vec<Camera>),
) -> Delivered {
    let params = DemoParams { num_splats, sh_degree, ..DemoParams::default() };
    let source = demo(&params).unwrap();
    let (pictures, held_out) = cameras(&source);
    let truth = apply_edits(&source, edits, 0).unwrap();
    let given = given(&source, edits, UnseenColor::Source, &pictures);
    let source_rows = source_rows(&source, &given);
    let edits = edits.to_vec();
    Delivered { name, edits, source, truth, given, pictures, held_out, source_rows }
}

/// The edit that an editor of `pictures` delivers.
fn given(
    source: &SynthScene,
    edits: &[Edit],
    unseen: UnseenColor,
    pictures: &[Camera],
) -> EditedFrame {
    let raster = CpuRasterizer::default();
    let shown =
        |splats: &Splats| first_frame_shares(&raster, splats, pictures).map_err(Failed::Cuar);
    apply_visible_edits(source, edits, 0, unseen, shown).unwrap()
}

/// Source row of each splat that has the geometry of a source splat.
fn source_rows(source: &SynthScene, edited: &EditedFrame) -> Vec<Option<u32>> {
    let (first, splats) = (source.frame1(), &edited.splats);
    let same = |(i, id): (usize, &Option<u32>)| {
        id.filter(|&id| {
            let id = id as usize;
            splats.means[i] == first.means[id] && splats.quats[i] == first.quats[id]
        })
    };
    edited.truth.source_rows.iter().enumerate().map(same).collect()
}

impl Delivered {
    /// The same case with the true edit.
    pub fn perfect(&self) -> Self {
        self.with(self.truth.clone())
    }

    /// The same case with a different colour on splats that the editor's pictures do not show.
    pub fn with_unseen(&self, unseen: UnseenColor) -> Self {
        self.with(given(&self.source, &self.edits, unseen, &self.pictures))
    }

    fn with(&self, given: EditedFrame) -> Self {
        Self {
            name: self.name,
            edits: self.edits.clone(),
            source: self.source.clone(),
            truth: self.truth.clone(),
            source_rows: source_rows(&self.source, &given),
            given,
            pictures: self.pictures.clone(),
            held_out: self.held_out.clone(),
        }
    }

    /// Rows that the edit changed.
    pub fn edited(&self) -> Vec<bool> {
        let (splats, source) = (&self.given.splats, self.source.frame1());
        let is_edited = |i: usize| {
            self.source_rows[i].is_none_or(|id| source.sh_of(id as usize) != splats.sh_of(i))
        };
        (0..splats.len()).map(is_edited).collect()
    }

    /// `scene` (the delivered one, or with other colours) refined from the pictures' cameras at
    /// `frames` times.
    pub fn refined(
        &self,
        scene: &dyn DynamicScene,
        frames: usize,
        options: &RefineOptions,
    ) -> Refined {
        let times = TimeRange::UNIT.frames(frames);
        let views = Views { cameras: &self.pictures, times: &times, held_out: &[] };
        self.refined_from(scene, &views, options, None, &mut NoRefineObserver).unwrap()
    }

    pub fn refined_from(
        &self,
        scene: &dyn DynamicScene,
        views: &Views<'_>,
        options: &RefineOptions,
        resume: Option<&State>,
        observer: &mut dyn RefineObserver,
    ) -> Result<Refined, CuarError> {
        let raster = CpuRasterizer::default();
        let backend = Backend { raster: &raster, descent: None };
        let (before, edited) = (self.before(), self.edited());
        refine_edit(backend, scene, &before, &edited, views, options, resume, observer)
    }

    pub fn before(&self) -> BeforeEdit<'_> {
        BeforeEdit { scene: &self.source, source_rows: &self.source_rows }
    }

    /// The held-out views of a recolouring as a case of flicker.
    pub fn as_case(&self) -> super::Case {
        let truth = self.truth.truth.clone();
        super::Case {
            scene: Painted { truth: self.given.truth.clone(), sh: self.given.splats.sh.clone() },
            edited: truth.tags.iter().map(|tag| *tag != gs_synth::Tag::Unchanged).collect(),
            truth,
            cameras: self.held_out.clone(),
            held_out: (0..self.held_out.len()).collect(),
        }
    }

    /// The delivered scene.
    pub fn scene(&self) -> &dyn DynamicScene {
        &self.given.truth
    }
}

/// Squared error and number of values.
pub type Errors = (f64, f64);

/// Errors in pixels that motion reveals and elsewhere, and in pixels of the paper's mask and
/// outside it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Score {
    pub revealed: Errors,
    pub elsewhere: Errors,
    pub inside: Errors,
    pub outside: Errors,
}

impl Score {
    /// PSNR in that order, dB; 100 without differences.
    pub fn db(&self) -> [f64; 4] {
        [self.revealed, self.elsewhere, self.inside, self.outside]
            .map(|(error, count)| (-10.0 * (error / f64::max(count, 1.0)).log10()).min(100.0))
    }
}

/// Pixels that motion reveals at `t`: their visible splats have less than a tenth of their weight
/// in the pictures of frame 1.
pub fn revealed(case: &Delivered, shares: &[f32], t: f32, camera: &Camera) -> Vec<bool> {
    let splats = case.given.truth.at(t).unwrap();
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&splats, camera).unwrap();
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    // the static parts partly exceed the pictures, and motion reveals none of them in these views
    let moving = case.given.truth.scene().moving_mask();
    let shares: Vec<f32> = shares
        .iter()
        .zip(moving)
        .map(|(&share, moving)| if moving { share } else { 1.0 })
        .collect();
    let out = raster.forward(&mut prepared, &splats, &shares, &params).unwrap();
    out.features.iter().zip(&out.alpha).map(|(shown, alpha)| *shown < 0.1 * alpha).collect()
}

/// A held-out view and time: the true image, the revealed pixels, and the paper's mask of the
/// unrefined scene.
struct Reference {
    t: f32,
    camera: Camera,
    truth: Image,
    revealed: Vec<bool>,
    mask: Image,
}

/// Reference images for the comparison of scenes.
pub struct Judge(Vec<Reference>);

impl Judge {
    /// Reference images of `case`; `scene` is the delivered one.
    pub fn of(case: &Delivered, scene: &dyn DynamicScene, times: &[f32]) -> Self {
        let raster = CpuRasterizer::default();
        let shares = first_frame_shares(&raster, &case.given.splats, &case.pictures).unwrap();
        let mut images = Vec::new();
        for &t in times {
            for camera in &case.held_out {
                images.push(Reference {
                    t,
                    camera: camera.clone(),
                    truth: render(&case.truth.truth, t, camera),
                    revealed: revealed(case, &shares, t, camera),
                    mask: super::mask(scene, t, camera, 0.5),
                });
            }
        }
        Self(images)
    }

    pub fn score(&self, scene: &dyn DynamicScene) -> Score {
        let mut sum = Score::default();
        for score in self.scores(scene) {
            let parts = [
                (&mut sum.revealed, score.revealed),
                (&mut sum.elsewhere, score.elsewhere),
                (&mut sum.inside, score.inside),
                (&mut sum.outside, score.outside),
            ];
            for (sum, part) in parts {
                *sum = (sum.0 + part.0, sum.1 + part.1);
            }
        }
        sum
    }

    /// Scores of every image.
    pub fn scores(&self, scene: &dyn DynamicScene) -> Vec<Score> {
        let mut scores = Vec::new();
        for Reference { t, camera, truth, revealed, mask } in &self.0 {
            let mut score = Score::default();
            let ours = render(scene, *t, camera);
            for (p, &revealed) in revealed.iter().enumerate() {
                let error: f64 = (p * 3..p * 3 + 3)
                    .map(|k| ours.data[k].clamp(0.0, 1.0) - truth.data[k].clamp(0.0, 1.0))
                    .map(|difference| f64::from(difference).powi(2))
                    .sum();
                let masked = mask.data[p] > 0.0;
                let motion = if revealed { &mut score.revealed } else { &mut score.elsewhere };
                let view = if masked { &mut score.inside } else { &mut score.outside };
                for (sum, count) in [motion, view] {
                    *sum += error;
                    *count += 3.0;
                }
            }
            scores.push(score);
        }
        scores
    }
}

/// Rows with wrong colours in the delivered form of a recolouring (both forms have the same rows).
pub fn wrong_rows(case: &Delivered) -> Option<Vec<bool>> {
    let (given, truth) = (&case.given.splats, &case.truth.splats);
    (given.means == truth.means)
        .then(|| (0..given.len()).map(|i| given.sh_of(i) != truth.sh_of(i)).collect())
}

/// The delivered scene with an SH component of size `unseen_sh` in every splat the edit changed,
/// which no picture of frame 1 shows.
pub fn with_unseen_sh(case: &Delivered, unseen_sh: f32) -> Painted {
    let (splats, before) = (&case.given.splats, case.source.frame1());
    let (coeffs, degree) = (splats.sh_coeffs(), splats.sh_degree);
    let mut sh = splats.sh.clone();
    let mut random = 7_u64;
    for (i, source) in case.source_rows.iter().enumerate() {
        if source.is_some_and(|id| before.sh_of(id as usize) == splats.sh_of(i)) {
            continue;
        }
        let seen = super::seen_basis(degree, splats.means[i], &case.pictures);
        for channel in 0..3 {
            let mut extra: Vec<f32> = (0..coeffs).map(|_| super::uniform(&mut random)).collect();
            for _ in 0..2 {
                for direction in &seen {
                    let along: f32 = extra.iter().zip(direction).map(|(a, b)| a * b).sum();
                    extra.iter_mut().zip(direction).for_each(|(a, b)| *a -= along * b);
                }
            }
            for (rgb, value) in sh[i * coeffs..].iter_mut().zip(&extra) {
                rgb[channel] += unseen_sh * value;
            }
        }
    }
    Painted { truth: case.given.truth.clone(), sh }
}
