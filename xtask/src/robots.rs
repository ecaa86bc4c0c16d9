//! Articulated robots: scenes with known motion that share nothing with `gs-synth` and that no
//! parameter was tuned on.
//!
//! A robot is a tree of seven capsules that turn about random joints; one of them is folded back
//! beside the body. Its edit resamples some links, inflates others and attaches a rod to one.
//! Lengths are about metres: a robot is about 1.5 across.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "scenes are single precision, counts are small"
)]

use anyhow::Result;
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

type Vec3 = [f64; 3];

/// Rotation (unit quaternion, `wxyz`) and translation: `x ↦ R x + p`.
#[derive(Debug, Clone, Copy)]
struct Transform {
    rotation: [f64; 4],
    translation: Vec3,
}

impl Transform {
    fn apply(&self, x: Vec3) -> Vec3 {
        add(quat::rotate(self.rotation, x), self.translation)
    }

    /// This transform after a rotation by `angle` radians about the unit `axis` through `joint`.
    fn after_turn(&self, joint: Vec3, axis: Vec3, angle: f64) -> Self {
        let (sin, cos) = (angle / 2.0).sin_cos();
        let turn = [cos, sin * axis[0], sin * axis[1], sin * axis[2]];
        let fixed = sub(joint, quat::rotate(turn, joint));
        Self { rotation: quat::mul(self.rotation, turn), translation: self.apply(fixed) }
    }
}

/// A capsule that turns about a joint of its parent.
#[derive(Debug, Clone)]
struct Link {
    parent: Option<usize>,
    /// End points of the core in frame 1; the first is the joint.
    ends: [Vec3; 2],
    radius: f64,
    /// Unit axis of the joint.
    axis: Vec3,
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
    fn distance(&self, x: Vec3) -> f64 {
        let [a, b] = self.ends;
        let (d, along) = (sub(x, a), sub(b, a));
        let share = (dot(d, along) / dot(along, along)).clamp(0.0, 1.0);
        norm(sub(d, scale(along, share)))
    }

    /// A random point at `radius` from the core, and its normal.
    fn sample(&self, radius: f64, rng: &mut Pcg64) -> (Vec3, Vec3) {
        let [a, b] = self.ends;
        let along = sub(b, a);
        let length = norm(along);
        let direction = scale(along, 1.0 / length);
        let normal = unit(rng);
        let lengthwise = dot(normal, direction);
        if rng.random::<f64>() * (length + 2.0 * radius) < length {
            let across = sub(normal, scale(direction, lengthwise));
            let normal = scale(across, 1.0 / norm(across).max(1e-9));
            let base = add(a, scale(along, rng.random::<f64>()));
            return (add(base, scale(normal, radius)), normal);
        }
        let end = if lengthwise > 0.0 { b } else { a };
        (add(end, scale(normal, radius)), normal)
    }

    /// Surface area.
    fn area(&self, radius: f64) -> f64 {
        TAU * radius * (norm(sub(self.ends[1], self.ends[0])) + 2.0 * radius)
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
    /// Link of every edited splat; `None` for splats that the edit kept.
    link_of: Vec<Option<usize>>,
}

/// What the edit does with a link.
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
            let place = [0; 3].map(|_| rng.random_range(-0.7..0.7));
            let drift = scale(unit(&mut rng), 0.3);
            let splat = Splat { place, normal: unit(&mut rng), spacing, opacity: 0.0 };
            let at = |frame: usize| Transform {
                rotation: [1.0, 0.0, 0.0, 0.0],
                translation: scale(drift, frame as f64 / (FRAMES - 1) as f64),
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

    /// Mean end-point error of the splats that the edit made, scene units, at every second frame.
    pub(crate) fn error(&self, found: &dyn DynamicScene) -> Result<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        for t in [0.25_f32, 0.5, 0.75, 1.0] {
            let at = found.at(t)?;
            let pose = pose(&self.links, f64::from(t));
            for (row, link) in self.link_of.iter().enumerate() {
                let Some(link) = *link else { continue };
                let truth = pose[link].apply(self.edited.means[row].map(f64::from));
                sum += norm(sub(at.means[row].map(f64::from), truth));
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
        ends: [[0.0, -0.25, 0.0], [0.0, 0.25, 0.0]],
        radius: rng.random_range(0.13..0.18),
        axis: unit(rng),
        swing: swing(rng, 0.6),
    };
    let mut links = vec![body];
    for limb in 0..3 {
        let azimuth = TAU * f64::from(limb) / 3.0 + rng.random_range(-0.3..0.3);
        let height = rng.random_range(-0.25..0.25);
        let outwards = [azimuth.cos(), 0.0, azimuth.sin()];
        let joint = add(scale(outwards, 0.8 * links[0].radius), [0.0, height, 0.0]);
        let length = rng.random_range(0.25..0.4);
        let radius = rng.random_range(0.05..0.08);
        let elbow = add(joint, scale(outwards, length));
        // The first limb is folded: its second link lies along the body, a small gap beside it.
        let (joints, ends) = if limb == 0 {
            let beside = scale(outwards, links[0].radius + radius + rng.random_range(0.01..0.03));
            let down = if height > 0.0 { -1.0 } else { 1.0 };
            let elbow = add(beside, [0.0, height, 0.0]);
            ([joint, elbow], [elbow, add(elbow, [0.0, down * length, 0.0])])
        } else {
            let bend = scale(unit(rng), 0.6);
            let direction = add(outwards, bend);
            let direction = scale(direction, 1.0 / norm(direction));
            ([joint, elbow], [elbow, add(elbow, scale(direction, length))])
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
    let still = Transform { rotation: [1.0, 0.0, 0.0, 0.0], translation: [0.0; 3] };
    let mut found: Vec<Transform> = Vec::with_capacity(links.len());
    for link in links {
        let parent = link.parent.map_or(still, |parent| found[parent]);
        let mut own = parent.after_turn(link.ends[0], link.axis, link.angle(t));
        if link.parent.is_none() {
            own.translation = add(own.translation, [0.2 * t, 0.05 * (PI * t).sin(), 0.0]);
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
) -> Vec<(Vec3, Vec3)> {
    let count = (links[i].area(radius) / (spacing * spacing)).round() as usize;
    let outside = |x: Vec3| {
        links.iter().enumerate().all(|(j, link)| j == i || link.distance(x) > 0.98 * link.radius)
    };
    let samples = (0..count).map(|_| links[i].sample(radius, rng));
    samples.filter(|(place, _)| outside(*place)).collect()
}

/// A disc on a surface.
struct Splat {
    place: Vec3,
    normal: Vec3,
    spacing: f64,
    opacity: f32,
}

/// Adds one splat, moved by `transform`, to `splats`.
fn push(splats: &mut Splats, splat: &Splat, transform: Transform, rng: &mut Pcg64) {
    let noise = scale(normal3(rng), NOISE);
    let tilted = add(splat.normal, scale(normal3(rng), TILT));
    let rotation = quat::mul(transform.rotation, facing(tilted));
    let place = add(transform.apply(splat.place), noise);
    let extent = (0.7 * splat.spacing).ln() as f32;
    splats.means.push(place.map(|c| c as f32));
    splats.quats.push(rotation.map(|c| c as f32));
    splats.log_scales.push([extent, extent, extent - 2.0]);
    splats.opacity_logits.push(splat.opacity);
    splats.sh.push([0.0; 3]);
}

/// Adds one splat to all frames; its shape is that of the first.
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
        let noise = scale(normal3(rng), NOISE);
        let small = scale(normal3(rng), 0.5 * TILT);
        let turn = quat::normalize([1.0, 0.5 * small[0], 0.5 * small[1], 0.5 * small[2]]);
        let rotation =
            quat::mul(quat::mul(transform.rotation, turn), first.quats[row].map(f64::from));
        splats.push_from(first, row);
        splats.means[row] = add(transform.apply(splat.place), noise).map(|c| c as f32);
        splats.quats[row] = rotation.map(|c| c as f32);
    }
}

/// The edited frame, and the link of every splat that the edit made.
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
    let along = sub(ends[1], ends[0]);
    let random = unit(rng);
    let across = sub(random, scale(along, dot(random, along) / dot(along, along)));
    let across = scale(across, 1.0 / norm(across).max(1e-9));
    let foot = add(add(ends[0], scale(along, 0.6)), scale(across, *radius));
    let rod = Link {
        parent: Some(carrier),
        ends: [foot, add(foot, scale(across, 0.3))],
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

/// A rotation that takes the z axis, the thin one, to `normal`.
fn facing(normal: Vec3) -> [f64; 4] {
    let n = scale(normal, 1.0 / norm(normal).max(1e-9));
    // Halfway between z and the normal; where they are opposite, half a turn about x.
    if n[2] < -0.999_999 {
        return [0.0, 1.0, 0.0, 0.0];
    }
    quat::normalize([1.0 + n[2], -n[1], n[0], 0.0])
}

fn normal3(rng: &mut Pcg64) -> Vec3 {
    // Box and Muller.
    [0; 3].map(|_| {
        let (u, v): (f64, f64) = (rng.random(), rng.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
    })
}

fn unit(rng: &mut Pcg64) -> Vec3 {
    let v = normal3(rng);
    scale(v, 1.0 / norm(v).max(1e-9))
}

fn add(a: Vec3, b: Vec3) -> Vec3 {
    [0, 1, 2].map(|i| a[i] + b[i])
}

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn scale(a: Vec3, by: f64) -> Vec3 {
    a.map(|c| c * by)
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Links are rigid, so the truth keeps distances within a link and not between links.
    #[test]
    fn links_move_rigidly_and_apart_from_each_other() {
        let robot = Robot::new(1, 600);
        let (start, end) = (pose(&robot.links, 0.0), pose(&robot.links, 0.7));
        for (i, (from, to)) in start.iter().zip(&end).enumerate() {
            let [a, b] = robot.links[i].ends;
            let before = norm(sub(from.apply(a), from.apply(b)));
            let after = norm(sub(to.apply(a), to.apply(b)));
            assert!((before - after).abs() < 1e-9, "link {i}: {before} and {after}");
            let joint = robot.links[i].ends[0];
            if let Some(parent) = robot.links[i].parent {
                let gap = norm(sub(end[parent].apply(joint), to.apply(joint)));
                assert!(gap < 1e-9, "the joint of link {i} opens by {gap}");
            }
        }
        let x = robot.links[2].ends[1];
        assert!(norm(sub(end[0].apply(x), end[2].apply(x))) > 0.01, "limbs swing");
    }

    /// Negative control of the score: splats that stay where they are have a large error.
    #[test]
    fn edits_are_made_of_kept_and_new_splats_and_standing_still_is_wrong() -> Result<()> {
        let robot = Robot::new(2, 600);
        assert_eq!(robot.edited.len(), robot.link_of.len(), "a link for every row");
        assert!(robot.link_of.iter().any(Option::is_some), "something was edited");
        let still = RobotScene { frames: vec![(*robot.edited).clone(); FRAMES] };
        assert!(robot.error(&still)? > 0.05, "{}", robot.error(&still)?);
        Ok(())
    }
}
