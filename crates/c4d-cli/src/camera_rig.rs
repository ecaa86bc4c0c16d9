//! A camera rig around (or in front of) the scene, used without a data set.
//!
//! 4DGS checkpoints contain no cameras. The rig is built from frame 1 alone: robust centre and size
//! of the visible splats, and whether the scene fills the view of a camera at the origin (a forward
//! capture, viewed from there) or not (an object, viewed from all around).

use glam::DVec3;
use gs_core::{
    Camera, DynamicScene, Extent, SceneError, Splats, WeightedPoint, weighted_points,
    weighted_quantile,
};

/// Default image size.
pub(crate) const DEFAULT_SIZE: (u32, u32) = (960, 720);

/// Layout of a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layout {
    /// Around an object.
    Object,
    /// From the origin towards a scene on one side of it.
    Forward,
}

/// A camera rig. World units.
#[derive(Debug, Clone)]
pub(crate) struct CameraRig {
    /// Which of the two layouts.
    pub(crate) layout: Layout,
    centre: DVec3,
    radius: f64,
    up: DVec3,
    forward: DVec3,
    fov_y_rad: f64,
    near: f64,
    /// Extent of the whole first frame.
    pub(crate) extent: Extent,
}

/// Number of later times examined to find moving splats.
const PROBED_TIMES: usize = 4;
/// Displacement, as a share of the scene's radius, above which a splat counts as moving.
const MOVING_SHARE: f64 = 0.01;
/// Smallest number of moving splats that determine the framing.
const MIN_MOVING: usize = 50;
/// A scene this many times larger than its moving part has a
/// backdrop; a smaller one is framed completely.
const BACKDROP: f64 = 3.0;
/// Factor of the framed radius around the moving part.
const MARGIN: f64 = 1.8;
/// Share of the splats' weight within [`FORWARD_CONE_COS`] of the axis in a forward capture.
const FORWARD_SHARE: f64 = 0.97;
/// Cosine of the half-angle of the cone of a forward capture, 75°.
const FORWARD_CONE_COS: f64 = 0.258_819;
/// View directions within 15° of a coordinate axis are snapped to it, because
/// captures are aligned with their first camera.
const SNAP_COS: f64 = 0.965_926;
/// Narrowest and widest vertical field of view of a forward capture, radians. A scene with a
/// smaller angle seen from the origin is an object away from the origin, because captured scenes
/// fill the view of their cameras.
const FORWARD_FOV_RAD: [f64; 2] = [0.6, 1.2];
/// Largest near plane as a share of the camera's distance to its target,
/// because the target may be a small part of the scene.
const NEAR_SHARE: f64 = 0.1;
/// Vertical field of view around objects, radians (40°).
const OBJECT_FOV_RAD: f64 = 0.698_132;

/// Largest angles between the front view and other views of a forward capture, sideways and up or
/// down, degrees. Cameras of such captures move little, and what lies beyond was not observed.
const CAPTURED_DEG: [f64; 2] = [12.0, 6.0];

/// Number of views in a refinement without cameras.
const REFINING: usize = 10;

impl CameraRig {
    /// Rig for a scene. Frames the moving part of a scene that surrounds its origin
    /// (backdrops and sky domes would push the cameras outside), or all of a
    /// forward capture. `up` is the world's upward direction.
    pub(crate) fn of_scene(scene: &dyn DynamicScene, up: [f64; 3]) -> Result<Self, SceneError> {
        let range = scene.time_range();
        let first = scene.at(range.start)?;
        let whole = Self::around(&first, up);
        if whole.layout == Layout::Forward {
            return Ok(whole);
        }
        let mut moved = vec![0.0_f32; first.len()];
        let mut later = Splats::default();
        for &t in &range.frames(PROBED_TIMES + 1)[1..] {
            scene.geometry_into(t, &mut later)?;
            for (reach, (a, b)) in moved.iter_mut().zip(first.means.iter().zip(&later.means)) {
                let step: f32 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
                *reach = reach.max(step.sqrt());
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "a length in scene units")]
        let threshold = (MOVING_SHARE * whole.radius) as f32;
        let moving: Vec<usize> = (0..first.len()).filter(|&i| moved[i] > threshold).collect();
        if moving.len() < MIN_MOVING || moving.len() == first.len() {
            return Ok(whole.before_backdrop(&first));
        }
        let mut around = Self::around(&first.select(&moving), up);
        if whole.radius < BACKDROP * around.radius {
            return Ok(whole);
        }
        around.layout = Layout::Object;
        around.extent = whole.extent;
        around.fov_y_rad = OBJECT_FOV_RAD;
        // Room for the motion and for the surroundings of the figure.
        around.radius = (MARGIN * around.radius).min(whole.radius);
        Ok(around)
    }

    /// Rig for the splats of one frame.
    pub(crate) fn around(splats: &Splats, up: [f64; 3]) -> Self {
        let extent = Extent::of(splats);
        let (centre, radius, up) = (extent.centre.into(), extent.radius, up.into());
        let near = extent.near_plane();
        let points = weighted_points(splats);
        let distance = DVec3::length(centre);
        let towards = centre * (1.0 / distance.max(f64::MIN_POSITIVE));
        let total: f64 = points.iter().map(|p| p.weight).sum();
        let in_cone: f64 = points
            .iter()
            .filter(|p| {
                let mean = DVec3::from(p.mean);
                mean.dot(towards) > FORWARD_CONE_COS * mean.length()
            })
            .map(|p| p.weight)
            .sum();
        let forward = snap_to_axis(towards);
        let angle = |p: &WeightedPoint| {
            let mean = DVec3::from(p.mean);
            (mean.dot(forward) / mean.length().max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).acos()
        };
        // Three quarters of the scene fit into the image's height; most
        // cameras of a capture do not show its borders.
        let angles = points.iter().map(|p| (angle(p), p.weight)).collect();
        let fov_y_rad = 2.0 * weighted_quantile(angles, 0.75).unwrap_or(0.0);
        let [narrowest, widest] = FORWARD_FOV_RAD;
        let forward_capture =
            distance > 0.5 * radius && in_cone > FORWARD_SHARE * total && fov_y_rad >= narrowest;
        if forward_capture {
            let fov_y_rad = fov_y_rad.min(widest);
            return Self {
                layout: Layout::Forward,
                centre,
                radius,
                up,
                forward,
                fov_y_rad,
                near,
                extent,
            };
        }
        let (layout, fov_y_rad) = (Layout::Object, OBJECT_FOV_RAD);
        Self { layout, centre, radius, up, forward: towards, fov_y_rad, near, extent }
    }

    /// Frames the most compact half of the splats if the scene is much larger: a static object in
    /// front of a backdrop or under a sky dome.
    fn before_backdrop(self, splats: &Splats) -> Self {
        let quantile = |pairs, share| weighted_quantile(pairs, share).unwrap_or(0.0);
        let median = |among: &[DVec3]| {
            let axis = |k: usize| among.iter().map(|p| (p[k], 1.0)).collect();
            DVec3::from([0, 1, 2].map(|k| quantile(axis(k), 0.5)))
        };
        let reach = |among: &[DVec3], from: DVec3, share: f64| {
            quantile(among.iter().map(|p| (p.distance(from), 1.0)).collect(), share)
        };
        let all: Vec<DVec3> = weighted_points(splats).iter().map(|p| p.mean.into()).collect();
        let middle = median(&all);
        let half = reach(&all, middle, 0.5);
        if self.layout == Layout::Forward || half <= 0.0 || self.radius < BACKDROP * half {
            return self;
        }
        let together: Vec<DVec3> =
            all.into_iter().filter(|p| p.distance(middle) < 2.0 * half).collect();
        let centre = median(&together);
        let radius = reach(&together, centre, 0.95).min(self.radius);
        Self { centre, radius, ..self }
    }

    /// A camera of the rig.
    fn look_at(&self, eye: DVec3, target: DVec3, (width, height): (u32, u32)) -> Camera {
        let near = self.near.min(NEAR_SHARE * target.distance(eye));
        let [eye, target, up] = [eye, target, self.up].map(|v| v.to_array());
        Camera::look_at(eye, target, up, self.fov_y_rad, width, height).with_near(near)
    }

    /// The front view: in front of the object, or from the position of the capture's cameras.
    pub(crate) fn front(&self, size: (u32, u32)) -> Camera {
        let mut camera = match self.layout {
            Layout::Object => self.around_at(0.0, 0.2, size),
            Layout::Forward => self.look_at(DVec3::ZERO, self.target(), size),
        };
        "front".clone_into(&mut camera.name);
        camera
    }

    /// Largest horizontal and vertical angles between the front view and views of the captured
    /// side, degrees; `None` for objects, which are captured from all around.
    pub(crate) fn limits(&self) -> Option<[f64; 2]> {
        match self.layout {
            Layout::Object => None,
            Layout::Forward => Some(CAPTURED_DEG),
        }
    }

    /// Target of the front view.
    pub(crate) fn target(&self) -> DVec3 {
        match self.layout {
            Layout::Object => self.centre,
            Layout::Forward => self.forward * self.centre.length(),
        }
    }

    /// One camera per frame on a full circle around an object, or on a swing of ±12° for a forward
    /// capture, whose back was not captured.
    pub(crate) fn orbit(&self, frames: usize, size: (u32, u32)) -> Vec<Camera> {
        path(frames, "orbit", |phase| match self.layout {
            Layout::Object => self.around_at(phase * std::f64::consts::TAU, 0.25, size),
            Layout::Forward => {
                let swing = CAPTURED_DEG[0].to_radians() * (phase * std::f64::consts::TAU).sin();
                let eye = self.centre + rotated(-self.centre, self.up, swing);
                self.look_at(eye, self.centre, size)
            }
        })
    }

    /// Views of the scene from many sides, for images to be edited: around an
    /// object at three heights, or spread in both directions around the position of
    /// a forward capture's cameras. Names `view_00` ….
    pub(crate) fn views(&self, count: usize, size: (u32, u32)) -> Vec<Camera> {
        const HEIGHTS_RAD: [f64; 3] = [0.1, 0.35, 0.6];
        let digits = count.saturating_sub(1).to_string().len().max(2);
        (0..count)
            .map(|i| {
                let phase = i as f64 / count as f64;
                let mut camera = match self.layout {
                    Layout::Object => {
                        let height = HEIGHTS_RAD[i % HEIGHTS_RAD.len()];
                        self.around_at(phase * std::f64::consts::TAU, height, size)
                    }
                    Layout::Forward => self.swung(phase, size),
                };
                camera.name = format!("view_{i:0digits$}");
                camera
            })
            .collect()
    }

    /// Evenly spread over a disc of ±12° sideways and ±6° up and down (sunflower seeds), looking at
    /// the centre.
    fn swung(&self, phase: f64, size: (u32, u32)) -> Camera {
        const GOLDEN_ANGLE_RAD: f64 = 2.399_963;
        let angle = GOLDEN_ANGLE_RAD * (phase * 997.0).round();
        let reach = phase.sqrt();
        let sideways = CAPTURED_DEG[0].to_radians() * reach * angle.sin();
        let upwards = CAPTURED_DEG[1].to_radians() * reach * angle.cos();
        let back = rotated(-self.centre, self.up, sideways);
        let lift = self.centre.length() * upwards;
        let eye = self.centre + back + lift * self.up;
        self.look_at(eye, self.centre, size)
    }

    /// The views of a refinement without cameras, and a description of their positions.
    pub(crate) fn refining(&self, size: (u32, u32)) -> (Vec<Camera>, &'static str) {
        match self.layout {
            Layout::Object => (self.orbit(REFINING, size), "on a circle around the object"),
            Layout::Forward => {
                let mut cameras = vec![self.front(size)];
                cameras.extend(self.spiral(REFINING - 1, size));
                (cameras, "placed as for a capture of this scene")
            }
        }
    }

    /// One camera per frame on a small spiral in front of the scene.
    pub(crate) fn spiral(&self, frames: usize, size: (u32, u32)) -> Vec<Camera> {
        let front = self.front(size);
        let (eye, target) = (DVec3::from(front.position()), self.target());
        let reach = 0.06 * target.distance(eye);
        let [right, down, ahead, _] = front.viewmat.map(|[x, y, z, _]| DVec3::new(x, y, z));
        path(frames, "spiral", |phase| {
            let angle = 2.0 * std::f64::consts::TAU * phase;
            let (x, y, z) = (angle.cos(), 0.6 * angle.sin(), 0.5 * (angle / 2.0).sin());
            let moved = eye + reach * (x * right + y * down + z * ahead);
            self.look_at(moved, target, size)
        })
    }

    fn around_at(&self, azimuth_rad: f64, elevation_rad: f64, size: (u32, u32)) -> Camera {
        let distance = 1.15 * self.radius / (self.fov_y_rad / 2.0).tan();
        let front = perpendicular(self.up);
        let level = rotated(front, self.up, azimuth_rad);
        let (sin, cos) = elevation_rad.sin_cos();
        let eye = self.centre + distance * (cos * level + sin * self.up);
        self.look_at(eye, self.centre, size)
    }
}

fn path(frames: usize, name: &str, camera_at: impl Fn(f64) -> Camera) -> Vec<Camera> {
    (0..frames)
        .map(|frame| {
            let mut camera = camera_at(frame as f64 / frames.max(1) as f64);
            name.clone_into(&mut camera.name);
            camera
        })
        .collect()
}

fn snap_to_axis(direction: DVec3) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    axes.into_iter().find(|axis| axis.dot(direction) > SNAP_COS).unwrap_or(direction)
}

/// Direction towards the front viewer: +z in y-up worlds (figures are modelled facing it), −z in
/// y-down worlds (the cameras of captures), −y in z-up worlds.
fn perpendicular(up: DVec3) -> DVec3 {
    let candidate = if up.z.abs() > 0.9 {
        DVec3::NEG_Y
    } else if up.y > 0.0 {
        DVec3::Z
    } else {
        DVec3::NEG_Z
    };
    candidate.reject_from_normalized(up).normalize()
}

/// `v` rotated about the unit vector `axis` (Rodrigues).
fn rotated(v: DVec3, axis: DVec3, angle_rad: f64) -> DVec3 {
    let (sin, cos) = angle_rad.sin_cos();
    v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(offset: [f32; 3]) -> Splats {
        let mut splats = Splats::with_capacity(125, 0);
        for i in 0_u8..125 {
            let cell = [i % 5, (i / 5) % 5, i / 25].map(|c| f32::from(c) / 2.0 - 1.0);
            splats.means.push([0, 1, 2].map(|k| cell[k] + offset[k]));
            splats.quats.push(gs_core::quat::IDENTITY);
            splats.log_scales.push([-3.0; 3]);
            splats.opacity_logits.push(2.0);
            splats.sh.push([0.0; 3]);
        }
        splats
    }

    #[test]
    fn an_object_is_orbited_and_always_in_view() {
        let rig = CameraRig::around(&cloud([0.0; 3]), [0.0, 1.0, 0.0]);
        assert_eq!(rig.layout, Layout::Object, "the origin is inside");
        for camera in rig.orbit(7, (64, 48)) {
            let centre = camera.project([0.0; 3]).unwrap();
            assert!(
                (centre[0] - 32.0).abs() < 1e-6 && (centre[1] - 24.0).abs() < 1e-6,
                "{centre:?}"
            );
            let top = camera.project([0.0, 1.0, 0.0]).unwrap();
            assert!(
                top[1] < 24.0 && top[1] > 0.0,
                "the top is above the centre and inside: \
                {top:?}"
            );
        }
    }

    /// `splats` scaled about the origin, then translated.
    fn placed(splats: &Splats, scale: f32, shift: [f32; 3]) -> Splats {
        let mut splats = splats.clone();
        for mean in &mut splats.means {
            *mean = [0, 1, 2].map(|k| mean[k] * scale + shift[k]);
        }
        for log_scale in splats.log_scales.as_flattened_mut() {
            *log_scale += scale.ln();
        }
        splats
    }

    #[test]
    fn an_object_away_from_the_origin_is_orbited() {
        let up = [0.0, 1.0, 0.0];
        let here = CameraRig::around(&cloud([0.0; 3]), up);
        for shift in [[0.0, 0.0, 8.0], [-12.0, 3.0, 0.0], [2000.0, 0.0, -900.0]] {
            let rig = CameraRig::around(&cloud(shift), up);
            assert_eq!(rig.layout, Layout::Object, "{shift:?}");
            let pairs = here.orbit(5, (64, 48)).into_iter().zip(rig.orbit(5, (64, 48)));
            for (a, b) in pairs {
                let (a, b) = (a.position(), b.position());
                let apart = (0..3).map(|k| (a[k] + f64::from(shift[k]) - b[k]).abs());
                assert!(apart.fold(0.0, f64::max) < 2e-3, "{shift:?}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn rigs_and_their_near_planes_follow_the_scale() {
        let up = [0.0, -1.0, 0.0];
        for splats in [cloud([0.0; 3]), cloud([0.15, 0.1, 3.0])] {
            let here = CameraRig::around(&splats, up);
            for scale in [1e-3_f32, 1e-2, 1e2, 1e3] {
                let rig = CameraRig::around(&placed(&splats, scale, [0.0; 3]), up);
                assert_eq!(rig.layout, here.layout, "{scale}");
                for (a, b) in here.spiral(4, (64, 48)).iter().zip(rig.spiral(4, (64, 48))) {
                    let unscaled = b.position().map(|x| x / f64::from(scale));
                    let apart = DVec3::from(unscaled).distance(a.position().into());
                    assert!(apart < 1e-4, "{scale}: {apart}");
                    let near = b.near / f64::from(scale) / a.near;
                    assert!((near - 1.0).abs() < 1e-4 && b.check().is_ok(), "{scale}: {near}");
                }
            }
        }
    }

    #[test]
    fn a_figure_under_a_sky_dome_is_seen_from_inside() {
        let params = gs_synth::DemoParams { num_splats: 3000, ..gs_synth::DemoParams::default() };
        let scene = gs_synth::demo(&params).unwrap();
        let rig = CameraRig::of_scene(&scene, [0.0, 1.0, 0.0]).unwrap();
        let reach = |p: [f64; 3]| p[0].hypot(p[2]);
        let dome = scene.frame1().means.iter().map(|m| reach(m.map(f64::from))).fold(0.0, f64::max);
        let size = f64::from(scene.figure_size());
        for camera in std::iter::once(rig.front((64, 48))).chain(rig.orbit(8, (64, 48))) {
            assert!(reach(camera.position()) < 0.8 * dome, "inside: {:?}", camera.position());
            let head = camera.project([0.0, size, 0.0]).unwrap();
            let feet = camera.project([0.0, 0.0, 0.0]).unwrap();
            assert!(head[1] > 0.0 && feet[1] < 48.0, "the figure fits: {head:?} {feet:?}");
            assert!(feet[1] - head[1] > 16.0, "and fills a third of the image: {head:?} {feet:?}");
        }
    }

    #[test]
    fn a_static_figure_under_a_sky_dome_is_seen_from_inside() {
        let params = gs_synth::DemoParams { num_splats: 8000, ..gs_synth::DemoParams::default() };
        let scene = gs_synth::demo(&params).unwrap();
        let still = gs_deform::StaticScene::new(scene.frame1().clone()).unwrap();
        let rig = CameraRig::of_scene(&still, [0.0, 1.0, 0.0]).unwrap();
        let size = f64::from(scene.figure_size());
        for camera in std::iter::once(rig.front((64, 48))).chain(rig.orbit(8, (64, 48))) {
            let head = camera.project([0.0, size, 0.0]).unwrap();
            let feet = camera.project([0.0, 0.0, 0.0]).unwrap();
            assert!(head[1] > 0.0 && feet[1] < 48.0, "the figure fits: {head:?} {feet:?}");
            assert!(feet[1] - head[1] > 12.0, "and fills a quarter: {head:?} {feet:?}");
        }
    }

    #[test]
    fn a_forward_capture_is_seen_from_its_origin() {
        let rig = CameraRig::around(&cloud([0.15, 0.1, 3.0]), [0.0, -1.0, 0.0]);
        assert_eq!(rig.layout, Layout::Forward, "fills the view from the origin");
        let camera = rig.front((64, 48));
        assert!(camera.position().iter().all(|v| v.abs() < 1e-9), "is at the origin");
        assert_eq!(camera.viewmat[2][..3], [0.0, 0.0, 1.0], "direction snapped to +z");
        for camera in rig.orbit(8, (64, 48)).iter().chain(&rig.spiral(8, (64, 48))) {
            assert!(camera.to_camera([0.15, 0.1, 3.0])[2] > 2.0, "never behind the scene");
            assert!(camera.check().is_ok(), "a valid camera");
        }
    }
}
