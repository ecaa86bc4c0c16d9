//! Writes the scene of a `.splatv` in the layouts of other methods.

use gs_core::{covariance, sh};
use gs_deform::PolynomialScene;
use gs_io::pth::{self, NamedTensor};
use std::fmt::Write;

/// A binary PLY with these columns, `[columns][rows]`.
fn ply(comments: &[&str], columns: &[(String, Vec<f32>)]) -> Vec<u8> {
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    for comment in comments {
        writeln!(header, "comment {comment}").unwrap();
    }
    writeln!(header, "element vertex {rows}").unwrap();
    for (name, _) in columns {
        writeln!(header, "property float {name}").unwrap();
    }
    header.push_str("end_header\n");
    let mut bytes = header.into_bytes();
    for row in 0..rows {
        for (_, values) in columns {
            bytes.extend(values[row].to_le_bytes());
        }
    }
    bytes
}

/// Columns `name_0`, `name_1`, … of rows of `D` values.
fn columns<const D: usize>(
    name: &str,
    rows: impl Iterator<Item = [f32; D]> + Clone,
) -> impl Iterator<Item = (String, Vec<f32>)> {
    (0..D).map(move |k| (format!("{name}_{k}"), rows.clone().map(|row| row[k]).collect()))
}

/// Columns common to both PLYs; `dc` are their colours.
fn shared(scene: &PolynomialScene, dc: &[[f32; 3]]) -> Vec<(String, Vec<f32>)> {
    let rest = scene.rest();
    let mut all: Vec<(String, Vec<f32>)> = ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(k, name)| ((*name).to_owned(), rest.means.iter().map(|mean| mean[k]).collect()))
        .collect();
    all.extend(columns("f_dc", dc.iter().copied()));
    all.push(("opacity".to_owned(), rest.opacity_logits.clone()));
    all.extend(columns("scale", rest.log_scales.iter().copied()));
    all.extend(columns("rot", rest.quats.iter().copied()));
    all
}

/// `point_cloud.ply` of Spacetime Gaussians, lite model, equivalent to `scene`.
pub(crate) fn spacetime(scene: &PolynomialScene) -> Vec<u8> {
    let rgb: Vec<[f32; 3]> =
        scene.rest().sh.iter().map(|dc| dc.map(|channel| channel * sh::C0 + 0.5)).collect();
    let motions = scene.motions();
    let mut all = shared(scene, &rgb);
    all.push(("trbf_center".to_owned(), motions.iter().map(|m| m.centre).collect()));
    // Splats that do not fade have an infinite width; its logarithm must be finite.
    let log_width = |motion: &gs_deform::Polynomial| motion.width.abs().ln().clamp(-80.0, 80.0);
    all.push(("trbf_scale".to_owned(), motions.iter().map(log_width).collect()));
    let velocities = motions.iter().map(|m| -> [f32; 9] {
        let mut flat = [0.0; 9];
        flat.copy_from_slice(m.velocity.as_flattened());
        flat
    });
    all.extend(columns("motion", velocities));
    all.extend(columns("omega", motions.iter().map(|m| m.omega)));
    ply(&[], &all)
}

/// `ln σ` of a width at which `exp(−(dt/width)²)` is `exp(−½(dt/σ)²)`.
fn log_durations(scene: &PolynomialScene) -> Vec<f32> {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    scene.motions().iter().map(|motion| (motion.width.abs() * half).ln().min(80.0)).collect()
}

/// `.ftgs.ply`, equivalent to `scene` for splats that move linearly and do not rotate.
pub(crate) fn freetime_ply(scene: &PolynomialScene) -> Vec<u8> {
    let mut all = shared(scene, &scene.rest().sh);
    all.push(("time".to_owned(), scene.motions().iter().map(|m| m.centre).collect()));
    all.push(("log_duration".to_owned(), log_durations(scene)));
    all.extend(columns("velocity", scene.motions().iter().map(|m| m.velocity[0])));
    let comments = [
        "ftgs_version 1",
        "time_units normalized",
        "sh_degree 0",
        "use_velocity 1",
        "min_duration 0",
        "opacity_floor 0",
    ];
    ply(&comments, &all)
}

/// A checkpoint of FreeTimeGS, equivalent under the same conditions; its opacities are at least
/// 10⁻⁴.
pub(crate) fn freetime_checkpoint(scene: &PolynomialScene) -> Vec<u8> {
    let (rest, n) = (scene.rest(), scene.rest().len());
    let times: Vec<f32> = scene.motions().iter().map(|motion| motion.centre).collect();
    let velocities: Vec<[f32; 3]> = scene.motions().iter().map(|m| m.velocity[0]).collect();
    let durations = log_durations(scene);
    let named = |name, shape, values| NamedTensor { name, shape, values };
    let mut out = Vec::new();
    pth::write(
        &[
            named("means", &[n, 3], rest.means.as_flattened()),
            named("scales", &[n, 3], rest.log_scales.as_flattened()),
            named("quats", &[n, 4], rest.quats.as_flattened()),
            named("opacities", &[n], &rest.opacity_logits),
            named("sh0", &[n, 1, 3], rest.sh.as_flattened()),
            named("shN", &[n, 0, 3], &[]),
            named("times", &[n, 1], &times),
            named("durations", &[n, 1], &durations),
            named("velocities", &[n, 3], velocities.as_flattened()),
        ],
        &mut out,
    )
    .unwrap();
    out
}

/// A checkpoint of native 4D Gaussians with times from 0 to 1, equivalent to `scene` for splats
/// that move linearly and do not rotate. Real checkpoints are tuples; the reader finds the same
/// parts by position.
pub(crate) fn gaussian4d(scene: &PolynomialScene) -> Vec<u8> {
    let (rest, n) = (scene.rest(), scene.rest().len());
    let (mut scales, mut left, mut right) = (Vec::new(), Vec::new(), Vec::new());
    let mut scales_t = Vec::new();
    for (row, motion) in scene.motions().iter().enumerate() {
        // Covariance of space and time: that of space at a given time is the splat's.
        let sigma = f64::from(motion.width) * std::f64::consts::FRAC_1_SQRT_2;
        let shape = covariance(rest.rotation(row).map(f64::from), rest.scale(row).map(f64::from));
        let [xx, xy, xz, yy, yz, zz] = shape;
        let velocity = motion.velocity[0].map(f64::from);
        let mut joint = [[xx, xy, xz, 0.0], [xy, yy, yz, 0.0], [xz, yz, zz, 0.0], [0.0; 4]];
        for (i, a) in velocity.iter().chain([&1.0]).enumerate() {
            for (j, b) in velocity.iter().chain([&1.0]).enumerate() {
                joint[i][j] += sigma * sigma * a * b;
            }
        }
        let (values, mut axes) = eigen(joint);
        if determinant(&axes) < 0.0 {
            for row in &mut axes {
                row[0] = -row[0];
            }
        }
        let logs = values.map(|value| (0.5 * value.max(1e-20).ln()) as f32);
        scales.extend(&logs[..3]);
        scales_t.push(logs[3]);
        let (l, r) = quaternions(&axes);
        left.extend(l);
        right.extend(r);
    }
    let times: Vec<f32> = scene.motions().iter().map(|motion| motion.centre).collect();
    let named = |name, shape, values| NamedTensor { name, shape, values };
    let mut out = Vec::new();
    pth::write(
        &[
            named("0.1", &[n, 3], rest.means.as_flattened()),
            named("0.2", &[n, 1, 3], rest.sh.as_flattened()),
            named("0.3", &[n, 0, 3], &[]),
            named("0.4", &[n, 3], &scales),
            named("0.5", &[n, 4], &left),
            named("0.6", &[n, 1], &rest.opacity_logits),
            named("0.13", &[n, 1], &times),
            named("0.14", &[n, 1], &scales_t),
            named("0.15", &[n, 4], &right),
            // Parameter groups of the optimiser, by which the method is recognised.
            named("0.11.scaling_t", &[0], &[]),
            named("0.11.rotation_r", &[0], &[]),
        ],
        &mut out,
    )
    .unwrap();
    out
}

type Matrix = [[f64; 4]; 4];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
fn eigen(mut a: Matrix) -> ([f64; 4], Matrix) {
    let mut axes: Matrix =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..30 {
        for p in 0..4 {
            for q in p + 1..4 {
                if a[p][q].abs() < 1e-300 {
                    continue;
                }
                let theta = 0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p]);
                let (s, c) = theta.sin_cos();
                let mut rotation: Matrix =
                    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
                (rotation[p][p], rotation[q][q], rotation[p][q], rotation[q][p]) = (c, c, s, -s);
                let transposed = std::array::from_fn(|i| std::array::from_fn(|j| rotation[j][i]));
                a = product(&transposed, &product(&a, &rotation));
                axes = product(&axes, &rotation);
            }
        }
    }
    (std::array::from_fn(|i| a[i][i]), axes)
}

fn determinant(m: &Matrix) -> f64 {
    // By elimination with pivots.
    let (mut m, mut out) = (*m, 1.0);
    for k in 0..4 {
        let pivot = (k..4).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs())).unwrap();
        if pivot != k {
            m.swap(pivot, k);
            out = -out;
        }
        out *= m[k][k];
        for i in k + 1..4 {
            let factor = m[i][k] / m[k][k];
            for j in k..4 {
                m[i][j] -= factor * m[k][j];
            }
        }
    }
    out
}

fn left_factor([a, b, c, d]: [f64; 4]) -> Matrix {
    [[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]]
}

fn right_factor([p, q, r, s]: [f64; 4]) -> Matrix {
    [[p, q, r, s], [-q, p, -s, r], [-r, s, p, -q], [-s, -r, q, p]]
}

/// The two unit quaternions of a rotation in four dimensions, whose axes the method reverses.
fn quaternions(rotation: &Matrix) -> ([f32; 4], [f32; 4]) {
    let flipped: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| rotation[3 - i][3 - j]));
    let unit = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i == k)));
    // Coordinates in the basis of products of unit factors: an outer product of the quaternions.
    let outer: Matrix = std::array::from_fn(|p| {
        std::array::from_fn(|q| {
            let basis = product(&left_factor(unit(p)), &right_factor(unit(q)));
            let pairs = basis.as_flattened().iter().zip(flipped.as_flattened());
            pairs.map(|(a, b)| 0.25 * a * b).sum()
        })
    });
    let norm = |row: &[f64; 4]| row.iter().map(|value| value * value).sum::<f64>().sqrt();
    let best = (0..4).max_by(|&a, &b| norm(&outer[a]).total_cmp(&norm(&outer[b]))).unwrap();
    let scale = norm(&outer[best]);
    let right = outer[best].map(|value| value / scale);
    let left: [f64; 4] = std::array::from_fn(|p| (0..4).map(|q| outer[p][q] * right[q]).sum());
    (left.map(|value| value as f32), right.map(|value| value as f32))
}
