//! Articulated robots: scenes with known motion that are independent of `gs-synth` and were not
//! used to tune any parameter.
//!
//! A robot is a tree of seven capsules that rotate about random joints; one of them is folded back
//! next to the body. Its edit resamples some links, inflates others and attaches a rod to one.
//! Lengths are approximately metres: a robot has a size of about 1.5.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "scenes are single precision, counts are small"
)]

use anyhow::Result;
use glam::{DQuat, DVec3, dvec3};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, quat};
use rand::RngExt as _;
use rand_pcg::Pcg64;
use std::f64::consts::{PI, TAU};

/// Stored frames, evenly spaced over [0, 1]; the edit is made in the first.
const FRAMES: usize = 9;
/// Standard deviation of positions from frame to frame, the error of a reconstruction.
const NOISE: f64 = 6e-4;
/// Standard deviation of normals and rotations, radians.
const TILT: f64 = 0.1;
/// Share of splats that follow no link.
const FLOATERS: f64 = 0.01;

/// Rotation and translation: `x ↦ R x + p`.
#[derive(Debug, Clone, Copy)]
struct Transform {
    rotation: DQuat,
    translation: DVec3,
}

impl Transform {
    const STILL: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    fn apply(&self, x: DVec3) -> DVec3 {
        self.rotation * x + self.translation
    }

    /// This transform after a rotation by `angle` radians about the unit `axis` through `joint`.
    fn after_turn(&self, joint: DVec3, axis: DVec3, angle: f64) -> Self {
        let turn = DQuat::from_axis_angle(axis, angle);
        Self { rotation: self.rotation * turn, translation: self.apply(joint - turn * joint) }
    }
}

/// A capsule that rotates about a joint of its parent.
#[derive(Debug, Clone)]
struct Link {
    parent: Option<usize>,
    /// End points of the core in frame 1; the first is the joint.
    ends: [DVec3; 2],
    radius: f64,
    /// Unit axis of the joint.
    axis: DVec3,
    /// Amplitude (radians), cycles per clip, phase (radians).
    swing: [f64; 3],
}

impl Link {
    /// Angle of the joint at time `t`, radians; 0 in frame 1.
    fn angle(&self, t: f64) -> f64 {
        let [amplitude, cycles, phase] = self.swing;
        amplitude * ((TAU * cycles * t + phase).sin() - phase.sin())
    }

    /// Distance of a point from the core.
    fn distance(&self, x: DVec3) -> f64 {
        let [a, b] = self.ends;
        let (d, along) = (x - a, b - a);
        let share = (d.dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (d - share * along).length()
    }

    /// A random point at `radius` from the core, and its normal.
    fn sample(&self, radius: f64, rng: &mut Pcg64) -> (DVec3, DVec3) {
        let [a, b] = self.ends;
        let along = b - a;
        let length = along.length();
        let direction = along / length;
        let normal = unit(rng);
        let lengthwise = normal.dot(direction);
        if rng.random::<f64>() * (length + 2.0 * radius) < length {
            let normal = (normal - lengthwise * direction).normalize_or_zero();
            return (a + rng.random::<f64>() * along + radius * normal, normal);
        }
        let end = if lengthwise > 0.0 { b } else { a };
        (end + radius * normal, normal)
    }

    /// Surface area.
    fn area(&self, radius: f64) -> f64 {
        TAU * radius * (self.ends[0].distance(self.ends[1]) + 2.0 * radius)
    }
}

/// The reconstructed robot: splats by frames.
#[derive(Debug)]
pub(crate) struct RobotScene {
    frames: Vec<Splats>,
}

impl DynamicScene for RobotScene {
    fn num_splats(&self) -> usize {
        self.frames[0].len()
    }

    fn sh_degree(&self) -> usize {
        0
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn num_frames(&self) -> Option<usize> {
        Some(FRAMES)
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        if !TimeRange::UNIT.contains(t) {
            return Err(SceneError::Time { t, range: TimeRange::UNIT });
        }
        let times = TimeRange::UNIT.frames(FRAMES);
        let nearest = (0..FRAMES)
            .min_by(|&a, &b| (times[a] - t).abs().total_cmp(&(times[b] - t).abs()))
            .unwrap_or(0);
        out.clone_from(&self.frames[nearest]);
        Ok(())
    }

    fn fades(&self) -> bool {
        false
    }
}

/// A robot, its edit and the edit's true motion.
#[derive(Debug)]
pub(crate) struct Robot {
    pub(crate) source: std::sync::Arc<RobotScene>,
    pub(crate) edited: std::sync::Arc<Splats>,
    links: Vec<Link>,
    /// Link of every edited splat; `None` for unchanged splats.
    link_of: Vec<Option<usize>>,
}

/// Effect of the edit on a link.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Change {
    Keep,
    Resample,
    /// Surface moved outwards by this share of the radius.
    Inflate(f64),
}

impl Robot {
    /// The robot of a seed, with about `size` splats.
    pub(crate) fn new(seed: u64, size: usize) -> Self {
        let mut rng = Pcg64::new(u128::from(seed), 0x726f_626f_7473);
        let links = links(&mut rng);
        let area: f64 = links.iter().map(|link| link.area(link.radius)).sum();
        let spacing = (area / size as f64).sqrt();
        let mut frames = vec![Splats::default(); FRAMES];
        let mut owners = Vec::new();
        for (i, link) in links.iter().enumerate() {
            for (place, normal) in surface(&links, i, link.radius, spacing, &mut rng) {
                let opacity = rng.random_range(0.4..3.0);
                let splat = Splat { place, normal, spacing, opacity };
                let at = |frame: usize| pose(&links, frame as f64 / (FRAMES - 1) as f64)[i];
                push_moving(&mut frames, &splat, at, &mut rng);
                owners.push(i);
            }
        }
        let floaters = (FLOATERS * owners.len() as f64).round() as usize;
        for _ in 0..floaters {
            let place = DVec3::from([0; 3].map(|_| rng.random_range(-0.7..0.7)));
            let drift = 0.3 * unit(&mut rng);
            let splat = Splat { place, normal: unit(&mut rng), spacing, opacity: 0.0 };
            let at = |frame: usize| Transform {
                translation: frame as f64 / (FRAMES - 1) as f64 * drift,
                ..Transform::STILL
            };
            push_moving(&mut frames, &splat, at, &mut rng);
        }
        let (edited, link_of) = edit(&links, &frames[0], &owners, spacing, &mut rng);
        Self {
            source: std::sync::Arc::new(RobotScene { frames }),
            edited: std::sync::Arc::new(edited),
            links,
            link_of,
        }
    }

    /// Mean end-point error of new and changed splats at every second frame, scene units.
    pub(crate) fn error(&self, found: &dyn DynamicScene) -> Result<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        for t in [0.25_f32, 0.5, 0.75, 1.0] {
            let at = found.at(t)?;
            let pose = pose(&self.links, f64::from(t));
            for (row, link) in self.link_of.iter().enumerate() {
                let Some(link) = *link else { continue };
                let truth = pose[link].apply(wide(self.edited.means[row]));
                sum += truth.distance(wide(at.means[row]));
                count += 1.0;
            }
        }
        Ok(sum / count)
    }
}

/// A body with three limbs of two links each.
fn links(rng: &mut Pcg64) -> Vec<Link> {
    let swing = |rng: &mut Pcg64, most: f64| {
        [rng.random_range(0.3..most), rng.random_range(0.4..1.2), rng.random_range(0.0..TAU)]
    };
    let body = Link {
        parent: None,
        ends: [dvec3(0.0, -0.25, 0.0), dvec3(0.0, 0.25, 0.0)],
        radius: rng.random_range(0.13..0.18),
        axis: unit(rng),
        swing: swing(rng, 0.6),
    };
    let mut links = vec![body];
    for limb in 0..3 {
        let azimuth = TAU * f64::from(limb) / 3.0 + rng.random_range(-0.3..0.3);
        let outwards = dvec3(azimuth.cos(), 0.0, azimuth.sin());
        let height = dvec3(0.0, rng.random_range(-0.25..0.25), 0.0);
        let joint = 0.8 * links[0].radius * outwards + height;
        let length = rng.random_range(0.25..0.4);
        let radius = rng.random_range(0.05..0.08);
        let elbow = joint + length * outwards;
        // The first limb is folded: its second link lies along the body, separated by a small gap.
        let (joints, ends) = if limb == 0 {
            let apart = links[0].radius + radius + rng.random_range(0.01..0.03);
            let elbow = apart * outwards + height;
            let down = if height.y > 0.0 { -length } else { length };
            ([joint, elbow], [elbow, elbow + down * DVec3::Y])
        } else {
            let direction = (outwards + 0.6 * unit(rng)).normalize();
            ([joint, elbow], [elbow, elbow + length * direction])
        };
        let upper = links.len();
        let first = swing(rng, 0.9);
        let second = swing(rng, 1.2);
        links.push(Link { parent: Some(0), ends: joints, radius, axis: unit(rng), swing: first });
        let radius = 0.9 * radius;
        links.push(Link { parent: Some(upper), ends, radius, axis: unit(rng), swing: second });
    }
    links
}

/// Transform of every link from frame 1 to time `t`.
fn pose(links: &[Link], t: f64) -> Vec<Transform> {
    let mut found: Vec<Transform> = Vec::with_capacity(links.len());
    for link in links {
        let parent = link.parent.map_or(Transform::STILL, |parent| found[parent]);
        let mut own = parent.after_turn(link.ends[0], link.axis, link.angle(t));
        if link.parent.is_none() {
            own.translation += dvec3(0.2 * t, 0.05 * (PI * t).sin(), 0.0);
        }
        found.push(own);
    }
    found
}

/// Random points on link `i` at `radius` from its core that no other link encloses, and normals.
fn surface(
    links: &[Link],
    i: usize,
    radius: f64,
    spacing: f64,
    rng: &mut Pcg64,
) -> Vec<(DVec3, DVec3)> {
    let count = (links[i].area(radius) / (spacing * spacing)).round() as usize;
    let outside = |x: DVec3| {
        links.iter().enumerate().all(|(j, link)| j == i || link.distance(x) > 0.98 * link.radius)
    };
    let samples = (0..count).map(|_| links[i].sample(radius, rng));
    samples.filter(|(place, _)| outside(*place)).collect()
}

/// A disc on a surface.
struct Splat {
    place: DVec3,
    normal: DVec3,
    spacing: f64,
    opacity: f32,
}

/// Adds one splat, moved by `transform`, to `splats`.
fn push(splats: &mut Splats, splat: &Splat, transform: Transform, rng: &mut Pcg64) {
    let place = transform.apply(splat.place) + NOISE * normal3(rng);
    let normal = (splat.normal + TILT * normal3(rng)).normalize_or(DVec3::Z);
    // The z axis is the shortest.
    let rotation = transform.rotation * DQuat::from_rotation_arc(DVec3::Z, normal);
    let extent = (0.7 * splat.spacing).ln() as f32;
    splats.means.push(place.as_vec3().to_array());
    splats.quats.push(quat::from_glam(rotation.as_quat()));
    splats.log_scales.push([extent, extent, extent - 2.0]);
    splats.opacity_logits.push(splat.opacity);
    splats.sh.push([0.0; 3]);
}

/// Adds one splat to all frames; its shape is that in the first.
fn push_moving(
    frames: &mut [Splats],
    splat: &Splat,
    at: impl Fn(usize) -> Transform,
    rng: &mut Pcg64,
) {
    let (first, later) = frames.split_at_mut(1);
    let first = &mut first[0];
    push(first, splat, at(0), rng);
    let row = first.len() - 1;
    for (frame, splats) in (1..).zip(later) {
        let transform = at(frame);
        let place = transform.apply(splat.place) + NOISE * normal3(rng);
        let turn = DQuat::from_scaled_axis(0.5 * TILT * normal3(rng));
        let rotation = transform.rotation * turn * quat::to_glam(first.quats[row]).as_dquat();
        splats.push_from(first, row);
        splats.means[row] = place.as_vec3().to_array();
        splats.quats[row] = quat::from_glam(rotation.as_quat());
    }
}

/// The edited frame, and the link of every new or changed splat.
fn edit(
    links: &[Link],
    frame: &Splats,
    owners: &[usize],
    spacing: f64,
    rng: &mut Pcg64,
) -> (Splats, Vec<Option<usize>>) {
    let changes: Vec<Change> = (0..links.len())
        .map(|i| match (i, rng.random_range(0..3)) {
            // The body is thicker, so that its new surface approaches the folded limb.
            (0, _) | (_, 0) => Change::Inflate(rng.random_range(0.05..0.35)),
            (_, 1) => Change::Resample,
            _ => Change::Keep,
        })
        .collect();
    let still = pose(links, 0.0);
    let (mut splats, mut link_of) = (Splats::default(), Vec::new());
    for (row, &owner) in owners.iter().enumerate() {
        if changes[owner] == Change::Keep {
            splats.push_from(frame, row);
            link_of.push(None);
        }
    }
    for (i, change) in changes.iter().enumerate() {
        let radius = match change {
            Change::Keep => continue,
            Change::Resample => links[i].radius,
            Change::Inflate(share) => links[i].radius * (1.0 + share),
        };
        for (place, normal) in surface(links, i, radius, spacing, rng) {
            push(&mut splats, &Splat { place, normal, spacing, opacity: 2.0 }, still[i], rng);
            link_of.push(Some(i));
        }
    }
    // A rod on the outside of a link that is not folded.
    let carrier = [2, 3, 4, 5, 6][rng.random_range(0..5)];
    let Link { ends, radius, .. } = &links[carrier];
    let along = ends[1] - ends[0];
    let across = unit(rng).reject_from(along).normalize_or(along.any_orthonormal_vector());
    let foot = ends[0] + 0.6 * along + *radius * across;
    let rod = Link {
        parent: Some(carrier),
        ends: [foot, foot + 0.3 * across],
        radius: 0.03,
        axis: across,
        swing: [0.0; 3],
    };
    let mut with_rod = links.to_vec();
    with_rod.push(rod);
    for (place, normal) in surface(&with_rod, links.len(), 0.03, spacing, rng) {
        push(&mut splats, &Splat { place, normal, spacing, opacity: 2.0 }, still[carrier], rng);
        link_of.push(Some(carrier));
    }
    (splats, link_of)
}

fn wide(x: [f32; 3]) -> DVec3 {
    DVec3::from(x.map(f64::from))
}

/// A standard normal vector.
fn normal3(rng: &mut Pcg64) -> DVec3 {
    DVec3::from([0; 3].map(|_| {
        let (u, v) = (rng.random(), rng.random());
        gs_core::standard_normal(u, v)
    }))
}

fn unit(rng: &mut Pcg64) -> DVec3 {
    normal3(rng).normalize_or(DVec3::X)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Links are rigid, so the true motion preserves distances within a link but not between links.
    #[test]
    fn links_move_rigidly_and_apart_from_each_other() {
        let robot = Robot::new(1, 600);
        let (start, end) = (pose(&robot.links, 0.0), pose(&robot.links, 0.7));
        for (i, (from, to)) in start.iter().zip(&end).enumerate() {
            let [a, b] = robot.links[i].ends;
            let before = from.apply(a).distance(from.apply(b));
            let after = to.apply(a).distance(to.apply(b));
            assert!((before - after).abs() < 1e-9, "link {i}: {before} and {after}");
            let joint = robot.links[i].ends[0];
            if let Some(parent) = robot.links[i].parent {
                let gap = end[parent].apply(joint).distance(to.apply(joint));
                assert!(gap < 1e-9, "the joint of link {i} opens by {gap}");
            }
        }
        let x = robot.links[2].ends[1];
        assert!(end[0].apply(x).distance(end[2].apply(x)) > 0.01, "limbs swing");
    }

    /// Negative control of the score: splats that do not move have a large error.
    #[test]
    fn edits_contain_kept_and_new_splats_and_zero_motion_is_wrong() -> Result<()> {
        let robot = Robot::new(2, 600);
        assert_eq!(robot.edited.len(), robot.link_of.len(), "a link for every row");
        assert!(robot.link_of.iter().any(Option::is_some), "something was edited");
        let still = RobotScene { frames: vec![(*robot.edited).clone(); FRAMES] };
        assert!(robot.error(&still)? > 0.05, "{}", robot.error(&still)?);
        Ok(())
    }
}
