//! Writes the scene of a `.splatv` in the layouts of other methods.

use gs_core::sh;
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
    all.push(("trbf_scale".to_owned(), motions.iter().map(|m| m.width.abs().ln()).collect()));
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
    scene.motions().iter().map(|motion| (motion.width.abs() * half).ln()).collect()
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

/// A checkpoint of FreeTimeGS, equivalent likewise; its opacities are at least 10⁻⁴.
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
