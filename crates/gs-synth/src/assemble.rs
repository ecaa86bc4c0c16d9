//! Builds a scene from points: pose, lighting, noise.

use crate::{
    SynthScene,
    body::Body,
    figure,
    math::{normal3, quat_from_axes, rng, round_count, row_id, uniform, wide},
    paint::{self, Material, Occluder},
    part::{Kind, Part},
    sampler::{Point, scatter},
    scene::{SplatTruth, Stray, View, Wobble},
    skeleton::{Attach, BoneMotions, Skeleton},
    stage,
};
use glam::{Quat, Vec3};
use gs_core::{Splats, activation, quat, sh};
use rand_pcg::Pcg64;

/// Bodies that share a number of splats.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) bodies: Vec<Body>,
    pub(crate) num_surface: usize,
    pub(crate) num_interior: usize,
}

/// Simulated reconstruction errors. Lengths in figure sizes, shares of the splats.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Flaws {
    pub(crate) trajectory_noise: f32,
    pub(crate) jitter: f32,
    pub(crate) num_floaters: usize,
    pub(crate) outliers: f32,
}

/// Height of the bind pose: the unit of [`Flaws`] before the scene exists.
const NOMINAL_SIZE: f32 = 1.8;

/// Poses and lights the bodies and adds the errors.
pub(crate) fn assemble(
    skeleton: Skeleton,
    groups: &[Group],
    flaws: Flaws,
    sh_degree: usize,
    seed: u64,
) -> SynthScene {
    let frame = skeleton.posing();
    let mut placement = rng(seed, 1);
    let mut points = Vec::new();
    for group in groups {
        points.extend(scatter(
            &group.bodies,
            group.num_surface,
            group.num_interior,
            &mut placement,
        ));
    }
    let dresser = SplatBuilder::new(&frame, &points, sh_degree);
    let mut look = rng(seed, 2);
    let mut splats = Splats::with_capacity(points.len() + flaws.num_floaters, sh_degree);
    let mut rows = Vec::with_capacity(points.len() + flaws.num_floaters);
    for point in &points {
        rows.push(dresser.push(point, &mut splats, &mut look));
    }
    if flaws.jitter > 0.0 {
        jitter(&mut splats, &rows, flaws.jitter * NOMINAL_SIZE, &mut rng(seed, 3));
    }
    let (low, high) = bounds(&splats.means, &rows);
    let (figure_size, center) = ((high - low).max_element(), (low + high) / 2.0);
    let view = view(&skeleton, &splats, &rows);
    let mut strays = Vec::new();
    mark_outliers(&mut rows, &mut strays, flaws.outliers, figure_size, &mut rng(seed, 4));
    add_floaters(
        &mut splats,
        &mut rows,
        &mut strays,
        (flaws.num_floaters, figure_size, center),
        &mut rng(seed, 5),
    );
    let wobbles = if flaws.trajectory_noise > 0.0 {
        wobbles(&rows, flaws.trajectory_noise, figure_size, &mut rng(seed, 6))
    } else {
        Vec::new()
    };
    SynthScene { skeleton, frame1: splats, rows, wobbles, strays, figure_size, view }
}

/// Converts points to lit splats of frame 1.
#[derive(Debug)]
pub(crate) struct SplatBuilder<'a> {
    frame: &'a BoneMotions,
    occluders: Vec<Occluder>,
    sh_degree: usize,
}

impl<'a> SplatBuilder<'a> {
    fn new(frame: &'a BoneMotions, points: &[Point], sh_degree: usize) -> Self {
        let has = |part: Part| points.iter().any(|point| point.part == part);
        Self::with_parts(frame, has(Part::Chest), has(Part::Column), sh_degree)
    }

    /// `frame` maps the bind pose to frame 1.
    pub(crate) fn with_parts(
        frame: &'a BoneMotions,
        has_figure: bool,
        has_props: bool,
        sh_degree: usize,
    ) -> Self {
        let mut occluders = Vec::new();
        if has_figure {
            occluders.extend(figure::occluders().into_iter().map(|(part, occluder)| {
                let center = frame.point(Attach::rigid(part.bone()), occluder.center.as_dvec3());
                Occluder { center: center.as_vec3(), ..occluder }
            }));
        }
        if has_props {
            occluders.extend(stage::occluders());
        }
        Self { frame, occluders, sh_degree }
    }

    /// Appends the splat of `point` and returns its description.
    pub(crate) fn push(&self, point: &Point, splats: &mut Splats, rng: &mut Pcg64) -> SplatTruth {
        let (rotation, log_scales) = disc(point, rng);
        let moved = self.frame.splat(
            point.attach,
            point.rest.into(),
            quat::from_glam(rotation),
            log_scales,
        );
        let turn = quat::to_glam(moved.quat) * rotation.conjugate();
        let normal = turn * point.normal;
        let mean = Vec3::from(moved.mean);
        let casts = Part::SCENERY.contains(&point.part) && point.part != Part::Backdrop;
        let mut shade = match point.part {
            Part::Backdrop => Vec3::ONE,
            _ => paint::shade(mean, normal, &self.occluders, casts),
        };
        let opacity = if point.kind == Kind::Interior {
            shade *= 0.7;
            uniform(rng, 0.5, 0.9)
        } else {
            uniform(rng, 0.93, 0.985)
        };
        // both signs of a quaternion describe the same rotation, and files contain both
        let sign = if uniform(rng, 0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        splats.means.push(moved.mean);
        splats.quats.push(quat::normalize(moved.quat).map(|component| sign * component));
        splats.log_scales.push(moved.log_scales);
        splats.opacity_logits.push(activation::logit(opacity));
        let grain = 1.0 + uniform(rng, -0.02, 0.02);
        push_color(splats, point.material, shade * grain, normal, self.sh_degree);
        SplatTruth {
            part: point.part,
            kind: point.kind,
            rest: point.rest.into(),
            normal: normal.into(),
            spacing: point.spacing,
            shade: shade * grain,
            attach: point.attach,
        }
    }
}

/// Orientation and log-scales in bind coordinates: a disc across the normal, or a blob.
fn disc(point: &Point, rng: &mut Pcg64) -> (Quat, [f32; 3]) {
    let h = point.spacing;
    if point.kind == Kind::Interior {
        let axis = normal3(rng).try_normalize().unwrap_or(Vec3::X);
        let rotation = Quat::from_axis_angle(axis, uniform(rng, 0.0, std::f32::consts::TAU));
        let scales = [0, 1, 2].map(|_| (h * uniform(rng, 0.5, 0.9)).ln());
        return (rotation, scales);
    }
    let tilted = point.normal + normal3(rng) * 0.05;
    let n = tilted.try_normalize().unwrap_or(point.normal);
    let angle = uniform(rng, 0.0, std::f32::consts::TAU);
    let x = Quat::from_axis_angle(n, angle) * n.any_orthonormal_vector();
    let y = n.cross(x);
    let spread = match point.part {
        Part::Backdrop => 0.95,
        _ => 0.66,
    };
    let long = (h * spread * uniform(rng, 0.96, 1.1)).ln();
    let short = (h * spread * uniform(rng, 0.88, 1.02)).ln();
    let thin = (h * 0.13).min(0.004).ln();
    // the thin axis is not always the third, as in a trained scene
    match crate::math::floor_index(uniform(rng, 0.0, 3.0)) {
        0 => (quat_from_axes(n, x, y), [thin, long, short]),
        1 => (quat_from_axes(y, n, x), [short, thin, long]),
        _ => (quat_from_axes(x, y, n), [long, short, thin]),
    }
}

/// Appends SH of a lit material: base colour, a highlight from degree 1 on.
pub(crate) fn push_color(
    splats: &mut Splats,
    material: Material,
    shade: Vec3,
    normal: Vec3,
    sh_degree: usize,
) {
    let rgb = (material.rgb * shade).clamp(Vec3::ZERO, Vec3::ONE);
    splats.sh.push(sh::dc_from_rgb(rgb.into()));
    if sh_degree > 0 {
        splats.sh.extend(paint::highlight(normal, material.gloss));
        splats.sh.extend(vec![[0.0; 3]; sh::num_coeffs(sh_degree) - 4]);
    }
}

/// Adds reconstruction noise to frame 1: positions, orientations, sizes. `amount` in world units.
fn jitter(splats: &mut Splats, rows: &[SplatTruth], amount: f32, rng: &mut Pcg64) {
    for (i, row) in rows.iter().enumerate() {
        if Part::SCENERY.contains(&row.part) {
            continue;
        }
        let mean = Vec3::from(splats.means[i]) + normal3(rng) * (amount / 3.0_f32.sqrt());
        splats.means[i] = mean.into();
        let turn = Quat::from_scaled_axis(normal3(rng) * 0.15);
        splats.quats[i] = quat::mul(quat::from_glam(turn), splats.quats[i]);
        for value in &mut splats.log_scales[i] {
            *value += 0.12 * crate::math::normal(rng);
        }
    }
}

/// Bounding box of the moving splats.
fn bounds(means: &[[f32; 3]], rows: &[SplatTruth]) -> (Vec3, Vec3) {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (mean, row) in means.iter().zip(rows) {
        if !Part::SCENERY.contains(&row.part) {
            low = low.min(Vec3::from(*mean));
            high = high.max(Vec3::from(*mean));
        }
    }
    (low, high)
}

/// Bounding box of the moving splats over the clip.
fn view(skeleton: &Skeleton, splats: &Splats, rows: &[SplatTruth]) -> View {
    let (mut low, mut high) = bounds(&splats.means, rows);
    for t in [0.2, 0.4, 0.5, 0.6, 0.8, 1.0] {
        let frame = skeleton.motion(t);
        // every eighth splat suffices for a bounding box
        for (mean, row) in splats.means.iter().zip(rows).step_by(8) {
            if !Part::SCENERY.contains(&row.part) {
                let at = frame.point(row.attach, wide(*mean)).as_vec3();
                (low, high) = (low.min(at), high.max(at));
            }
        }
    }
    // centred on frame 1, except in height
    let (first_low, first_high) = bounds(&splats.means, rows);
    let center = ((first_low + first_high) / 2.0).with_y(f32::midpoint(low.y, high.y));
    let extent = 2.0 * (high - center).max(center - low).max_element();
    View { center: center.into(), extent }
}

/// Assigns a wrong motion to a share of the moving surface splats.
fn mark_outliers(
    rows: &mut [SplatTruth],
    strays: &mut Vec<Stray>,
    share: f32,
    figure_size: f32,
    rng: &mut Pcg64,
) {
    if share <= 0.0 {
        return;
    }
    for (i, row) in rows.iter_mut().enumerate() {
        let moves = row.kind == Kind::Surface && !Part::SCENERY.contains(&row.part);
        if moves && uniform(rng, 0.0, 1.0) < share {
            row.kind = Kind::Outlier;
            let length = figure_size * uniform(rng, 0.05, 0.2);
            let drift = normal3(rng).try_normalize().unwrap_or(Vec3::X) * length;
            strays.push(Stray { row: row_id(i), drift, swing: normal3(rng) * (0.2 * length) });
        }
    }
}

fn add_floaters(
    splats: &mut Splats,
    rows: &mut Vec<SplatTruth>,
    strays: &mut Vec<Stray>,
    (count, figure_size, center): (usize, f32, Vec3),
    rng: &mut Pcg64,
) {
    for _ in 0..count {
        let offset =
            Vec3::new(uniform(rng, -0.35, 0.35), uniform(rng, -0.5, 0.55), uniform(rng, -0.3, 0.3));
        let mean = center + offset * figure_size;
        let axis = normal3(rng).try_normalize().unwrap_or(Vec3::X);
        strays.push(Stray {
            row: row_id(rows.len()),
            drift: normal3(rng) * (0.10 * figure_size),
            swing: normal3(rng) * (0.04 * figure_size),
        });
        rows.push(SplatTruth {
            part: Part::Floater,
            kind: Kind::Floater,
            rest: mean.into(),
            normal: axis.into(),
            spacing: 0.02 * figure_size,
            shade: Vec3::ONE,
            attach: Attach::WORLD,
        });
        splats.means.push(mean.into());
        splats.quats.push(quat::from_glam(Quat::from_axis_angle(axis, uniform(rng, 0.0, 6.0))));
        splats.log_scales.push([0, 1, 2].map(|_| (figure_size * uniform(rng, 0.002, 0.010)).ln()));
        splats.opacity_logits.push(activation::logit(uniform(rng, 0.05, 0.3)));
        let grey = uniform(rng, 0.4, 0.8);
        let material = paint::matt(Vec3::splat(grey));
        push_color(splats, material, Vec3::ONE, axis, splats.sh_degree);
    }
}

fn wobbles(rows: &[SplatTruth], amount: f32, figure_size: f32, rng: &mut Pcg64) -> Vec<Wobble> {
    let length = amount * figure_size;
    rows.iter()
        .map(|row| {
            // a trained field has no noise where nothing moves
            let quiet = if Part::SCENERY.contains(&row.part) { 0.0 } else { 1.0 };
            Wobble {
                sine: normal3(rng) * (length * quiet),
                cosine: normal3(rng) * (length * quiet),
                turn: normal3(rng) * (15.0 * amount * quiet),
            }
        })
        .collect()
}

/// Splits `count` splats into surface and interior; `share` is that of the interior.
pub(crate) fn split(count: usize, share: f32) -> (usize, usize) {
    let interior = round_count(count as f32 * share).min(count);
    (count - interior, interior)
}
