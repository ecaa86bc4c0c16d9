//! [`SynthScene`]: splats on a skeleton, with exact motion at every time.

use crate::{
    part::{Bone, Kind, Part},
    skeleton::{Attach, Skeleton},
};
use glam::{Quat, Vec3};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, quat};
use std::f32::consts::TAU;

/// Description of one splat of a synthetic scene. For diagnostics
/// only; never an input of a method under test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplatTruth {
    /// Object or body part.
    pub part: Part,
    /// Surface, interior, floater or outlier.
    pub kind: Kind,
    /// Position in the bind pose, world units.
    pub rest: [f32; 3],
    /// Outward unit normal at frame 1, world frame; for interior splats that of the nearest
    /// surface.
    pub normal: [f32; 3],
    /// Mean distance between splats of the same body, world units.
    pub spacing: f32,
    /// Baked light: colour = albedo × shade.
    pub(crate) shade: Vec3,
    pub(crate) attach: Attach,
}

impl SplatTruth {
    /// The single bone that moves the splat; `None` between two bones and on cloth.
    pub fn rigid_bone(&self) -> Option<Bone> {
        let is_rigid = self.attach.weight >= 1.0 && self.attach.bone != Bone::Cloth;
        is_rigid.then_some(self.attach.bone)
    }
}

/// A smooth deviation from the true motion, zero at frame 1, per splat; world units and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wobble {
    pub(crate) sine: Vec3,
    pub(crate) cosine: Vec3,
    pub(crate) turn: Vec3,
}

/// A splat whose motion is unrelated to its surroundings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stray {
    pub(crate) row: u32,
    pub(crate) drift: Vec3,
    pub(crate) swing: Vec3,
}

/// Bounding box of all motion, which cameras frame. World units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    pub(crate) center: [f32; 3],
    pub(crate) extent: f32,
}

/// A synthetic dynamic scene: frame-1 splats and the exact motion of each.
///
/// World units are approximately metres, y is up; a figure stands on y = 0 at the origin and faces
/// +z. Times run over `[0,1]`; frame 1 is `t = 0`, where the scene returns its frame-1 splats bit
/// for bit. Colours and opacities are constant.
#[derive(Debug, Clone, PartialEq)]
pub struct SynthScene {
    pub(crate) skeleton: Skeleton,
    pub(crate) frame1: Splats,
    pub(crate) rows: Vec<SplatTruth>,
    /// Empty without trajectory noise.
    pub(crate) wobbles: Vec<Wobble>,
    pub(crate) strays: Vec<Stray>,
    pub(crate) figure_size: f32,
    pub(crate) view: View,
}

impl SynthScene {
    /// The splats at `t = 0`.
    pub fn frame1(&self) -> &Splats {
        &self.frame1
    }

    /// Descriptions of the splats, `[N]`.
    pub fn rows(&self) -> &[SplatTruth] {
        &self.rows
    }

    /// Largest extent of the moving splats at frame 1, world units; the
    /// length unit of [`crate::motion_error`].
    pub fn figure_size(&self) -> f32 {
        self.figure_size
    }

    /// Whether each splat belongs to a moving object, `[N]`. True for floaters.
    pub fn moving_mask(&self) -> Vec<bool> {
        self.rows.iter().map(|row| !Part::SCENERY.contains(&row.part)).collect()
    }

    /// The same splats with their true motion: without trajectory noise, and with outliers moving
    /// with their surface. Floaters keep their motion.
    #[must_use]
    pub fn noise_free(&self) -> Self {
        let strays = self.strays.iter().copied();
        let is_floater = |stray: &Stray| self.rows[stray.row as usize].kind == Kind::Floater;
        Self { wobbles: Vec::new(), strays: strays.filter(is_floater).collect(), ..self.clone() }
    }

    /// Means, quaternions and log-scales at `t`, without the other arrays.
    fn move_into(&self, t: f32, out: &mut Splats) {
        out.means.clone_from(&self.frame1.means);
        out.quats.clone_from(&self.frame1.quats);
        out.log_scales.clone_from(&self.frame1.log_scales);
        if t == 0.0 {
            return;
        }
        let frame = self.skeleton.motion(f64::from(t));
        for (i, row) in self.rows.iter().enumerate() {
            if !frame.is_still(row.attach) {
                let moved = frame.splat(row.attach, out.means[i], out.quats[i], out.log_scales[i]);
                out.means[i] = moved.mean;
                out.quats[i] = moved.quat;
                out.log_scales[i] = moved.log_scales;
            }
        }
        let (sine, versine) = ((TAU * t).sin(), (1.0 - (2.0 * TAU * t).cos()) / 2.0);
        for (i, wobble) in self.wobbles.iter().enumerate() {
            let mean = Vec3::from(out.means[i]) + wobble.sine * sine + wobble.cosine * versine;
            out.means[i] = mean.into();
            let turn = Quat::from_scaled_axis(wobble.turn * sine);
            out.quats[i] = quat::mul(quat::from_glam(turn), out.quats[i]);
        }
        for stray in &self.strays {
            let mean = &mut out.means[stray.row as usize];
            *mean = (Vec3::from(*mean) + stray.drift * t + stray.swing * (4.0 * t).sin()).into();
        }
    }

    fn check_time(&self, t: f32) -> Result<(), SceneError> {
        let range = self.time_range();
        if range.contains(t) { Ok(()) } else { Err(SceneError::Time { t, range }) }
    }
}

impl DynamicScene for SynthScene {
    fn num_splats(&self) -> usize {
        self.frame1.len()
    }

    fn sh_degree(&self) -> usize {
        self.frame1.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.check_time(t)?;
        self.move_into(t, out);
        out.opacity_logits.clone_from(&self.frame1.opacity_logits);
        out.sh.clone_from(&self.frame1.sh);
        out.sh_degree = self.frame1.sh_degree;
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.check_time(t)?;
        self.move_into(t, out);
        Ok(())
    }
}
