//! [`Axes`]: directions of a file's x, y and z axes, and the conversion to the axes of 3DGS PLYs.
//!
//! Files often use other axes than their format specifies: SPZ specifies x right, y up, z back, but
//! many tools write it with the axes of their input PLY. [`AxesReading`] therefore stores, with a
//! frame, the axes in which it was read and the alternatives.

use gs_core::{ShRotation, Splats, quat};
use rayon::prelude::*;

/// Directions of x, y and z, one letter each: left or right, up or down, front or back. The values
/// are the codes of Niantic's `CoordinateSystem` (SPZ, extension `0xADBE0003`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Axes(u8);

/// Names by code, starting at code 1.
const NAMES: [&str; 16] = [
    "LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF", "LFD", "RFD", "LFU", "RFU", "LBD",
    "RBD", "LBU", "RBU",
];

impl Axes {
    /// Right, up, back: OpenGL, three.js, and the SPZ specification.
    pub const RUB: Self = Self(4);
    /// Right, down, front: COLMAP and 3DGS PLYs, and all splats in memory.
    pub const PLY: Self = Self(6);
    /// Left, up, front: glTF, whose specification names the sides of an asset.
    pub const LUF: Self = Self(7);

    /// The axes with this code, 1 to 16.
    pub fn from_code(code: u32) -> Option<Self> {
        u8::try_from(code).ok().filter(|code| (1..=16).contains(code)).map(Self)
    }

    /// Code, 1 to 16.
    pub fn code(self) -> u32 {
        u32::from(self.0)
    }

    /// Three letters, for example `RUB`.
    pub fn name(self) -> &'static str {
        NAMES[usize::from(self.0) - 1]
    }

    /// Directions of x, y and z, as columns over (right, down, front).
    fn columns(self) -> [[i8; 3]; 3] {
        let mut letters = self.name().chars();
        std::array::from_fn(|_| match letters.next() {
            Some('R') => [1, 0, 0],
            Some('L') => [-1, 0, 0],
            Some('D') => [0, 1, 0],
            Some('U') => [0, -1, 0],
            Some('F') => [0, 0, 1],
            _ => [0, 0, -1],
        })
    }
}

/// Description, for example "RUB (x right, y up, z back)".
impl std::fmt::Display for Axes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = self.columns().map(|column| match column {
            [1, 0, 0] => "right",
            [-1, 0, 0] => "left",
            [0, 1, 0] => "down",
            [0, -1, 0] => "up",
            [0, 0, 1] => "front",
            _ => "back",
        });
        write!(f, "{} (x {}, y {}, z {})", self.name(), words[0], words[1], words[2])
    }
}

/// The axes in which a frame was read, for formats whose files use different axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AxesReading {
    /// The axes the file was read in.
    pub axes: Axes,
    /// Whether the file states its axes.
    pub stated: bool,
    /// Axes in which files of this format are written, [`AxesReading::axes`] by default first.
    pub usual: &'static [Axes],
}

impl AxesReading {
    /// The assumption as a sentence; `None` if the file states its axes.
    pub fn assumption(&self) -> Option<String> {
        (!self.stated).then(|| format!("the file does not state its axes; read as {}", self.axes))
    }
}

/// Converts splats from axes `from` to `to`. Between axes of the same
/// order (codes up to 8), only signs change.
pub(crate) fn convert(splats: &mut Splats, from: Axes, to: Axes) {
    if from == to {
        return;
    }
    // p' = Tᵀ·F·p, with the columns of both over (right, down, front).
    let (from, to) = (from.columns(), to.columns());
    let mut matrix = [[0_i8; 3]; 3];
    for (row, out) in matrix.iter_mut().enumerate() {
        for (column, entry) in out.iter_mut().enumerate() {
            *entry = (0..3).map(|k| to[row][k] * from[column][k]).sum();
        }
    }
    if (0..3).all(|axis| matrix[axis][axis] != 0) {
        flip(splats, [0, 1, 2].map(|axis| f32::from(matrix[axis][axis])));
        return;
    }
    // y and z are swapped: a reflection in x if the handedness changes, then a rotation.
    let determinant = f32::from(determinant(&matrix));
    if determinant < 0.0 {
        flip(splats, [-1.0, 1.0, 1.0]);
    }
    let m = matrix.map(|row| row.map(f32::from));
    let column = |k: usize, sign: f32| glam::Vec3::new(m[0][k], m[1][k], m[2][k]) * sign;
    let rotation = quat::from_glam(glam::Quat::from_mat3(&glam::Mat3::from_cols(
        column(0, determinant),
        column(1, 1.0),
        column(2, 1.0),
    )));
    rotate(splats, rotation);
}

fn determinant(m: &[[i8; 3]; 3]) -> i8 {
    m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
}

/// Rotates all splats about the origin by the unit quaternion `wxyz`.
pub(crate) fn rotate(splats: &mut Splats, rotation: [f32; 4]) {
    let coeffs = splats.sh_coeffs();
    let harmonics = ShRotation::new(rotation.map(f64::from));
    splats.means.par_iter_mut().for_each(|mean| *mean = quat::rotate(rotation, *mean));
    splats.quats.par_iter_mut().for_each(|q| *q = quat::mul(rotation, *q));
    splats.sh.par_chunks_exact_mut(coeffs).for_each(|sh| harmonics.apply(sh));
}

/// Whether each SH basis function is odd in x, y and z.
const ODD: [[bool; 3]; 16] = {
    const N: bool = false;
    const Y: bool = true;
    [
        [N, N, N],
        [N, Y, N],
        [N, N, Y],
        [Y, N, N],
        [Y, Y, N],
        [N, Y, Y],
        [N, N, N],
        [Y, N, Y],
        [N, N, N],
        [N, Y, N],
        [Y, Y, Y],
        [N, Y, N],
        [N, N, Y],
        [Y, N, N],
        [N, N, Y],
        [Y, N, N],
    ]
};

/// Multiplies the coordinates by `signs`, each ±1: exact, and its own inverse.
fn flip(splats: &mut Splats, signs: [f32; 3]) {
    // A reflection reverses the sense of rotations, so each axis gets the signs of the other two.
    let about = [signs[1] * signs[2], signs[0] * signs[2], signs[0] * signs[1]];
    let sh_signs: [f32; 16] = std::array::from_fn(|k| {
        (0..3).map(|axis| if ODD[k][axis] { signs[axis] } else { 1.0 }).product()
    });
    let coeffs = splats.sh_coeffs();
    splats.means.par_iter_mut().for_each(|mean| {
        *mean = std::array::from_fn(|axis| signs[axis] * mean[axis]);
    });
    splats.quats.par_iter_mut().for_each(|q| {
        *q = [q[0], about[0] * q[1], about[1] * q[2], about[2] * q[3]];
    });
    splats.sh.par_chunks_exact_mut(coeffs).for_each(|sh| {
        for (rgb, sign) in sh.iter_mut().zip(sh_signs) {
            *rgb = rgb.map(|value| sign * value);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::{covariance, sh};

    fn splats() -> Splats {
        let sh = (0..16).map(|k| [0.1 * k as f32, -0.3, 0.02 * (k * k) as f32]).collect();
        Splats {
            means: vec![[1.0, -2.0, 3.5]],
            quats: vec![quat::normalize([0.5, 0.1, -0.7, 0.2])],
            log_scales: vec![[-1.0, 0.2, 0.5]],
            opacity_logits: vec![0.3],
            sh,
            sh_degree: 3,
        }
    }

    /// A vector with coordinates in axes `from`, converted to axes `to` by their letters.
    fn converted(v: [f32; 3], from: Axes, to: Axes) -> [f32; 3] {
        let (from, to) = (from.columns(), to.columns());
        let world: [f32; 3] =
            std::array::from_fn(|k| (0..3).map(|axis| f32::from(from[axis][k]) * v[axis]).sum());
        std::array::from_fn(|axis| (0..3).map(|k| f32::from(to[axis][k]) * world[k]).sum())
    }

    #[test]
    fn every_conversion_of_axes_keeps_shapes_and_colours() {
        assert_eq!(Axes::RUB.to_string(), "RUB (x right, y up, z back)", "words");
        assert_eq!(
            converted([1.0, 2.0, 3.0], Axes::RUB, Axes::PLY),
            [1.0, -2.0, -3.0],
            "rotation by 180°"
        );
        for code in 1..=16 {
            let from = Axes::from_code(code).unwrap();
            let (before, mut after) = (splats(), splats());
            convert(&mut after, from, Axes::PLY);
            let name = from.name();
            let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
            let mean = converted(before.means[0], from, Axes::PLY);
            assert!((0..3).all(|k| near(mean[k], after.means[0][k])), "{name}: centre");
            // Covariance along converted directions.
            let sigma = |splats: &Splats| covariance(splats.rotation(0), splats.scale(0));
            let along = |s: [f32; 6], [x, y, z]: [f32; 3]| {
                s[0] * x * x
                    + s[3] * y * y
                    + s[5] * z * z
                    + 2.0 * (s[1] * x * y + s[2] * x * z + s[4] * y * z)
            };
            for direction in [[0.48, -0.6, 0.64], [0.0, 1.0, 0.0], [0.6, 0.0, -0.8]] {
                let there = converted(direction, from, Axes::PLY);
                let (a, b) = (along(sigma(&before), direction), along(sigma(&after), there));
                assert!(near(a, b), "{name}: {a} {b}");
                let color = |splats: &Splats, d: [f32; 3]| -> f32 {
                    let basis = sh::basis(3, d);
                    (0..16).map(|k| basis[k] * splats.sh_of(0)[k][2]).sum()
                };
                let (a, b) = (color(&before, direction), color(&after, there));
                assert!(near(a, b), "{name}: {a} {b}");
            }
            convert(&mut after, Axes::PLY, from);
            let off = (0..4).map(|k| (after.quats[0][k] - before.quats[0][k]).abs());
            let same = off.fold(0.0, f32::max) < 1e-5
                || quat::dot(after.quats[0], before.quats[0]) < -0.999;
            assert!(same, "{name}: back again");
            if code <= 8 {
                assert_eq!(after, before, "{name}: signs keep every bit");
            }
        }
        assert!(Axes::from_code(0).is_none() && Axes::from_code(17).is_none(), "no others");
    }
}
