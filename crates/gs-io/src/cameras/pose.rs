//! Camera poses of the formats, converted to world-to-camera matrices with OpenCV's axes (x right, y
//! down, z forward).

use glam::{DMat3, DVec3};
use gs_core::Camera;

/// World-to-camera matrix, row by row.
pub(crate) type Viewmat = [[f64; 4]; 4];

/// `[R | t]` with `rotation` world to camera.
pub(crate) fn viewmat(rotation: DMat3, translation: DVec3) -> Viewmat {
    let row = |i: usize| {
        let r = rotation.row(i);
        [r.x, r.y, r.z, translation[i]]
    };
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// From a camera's centre and its axes (OpenCV), both in the world frame.
pub(crate) fn from_axes(right: DVec3, down: DVec3, forward: DVec3, centre: DVec3) -> Viewmat {
    let rotation = DMat3::from_cols(right, down, forward).transpose();
    viewmat(rotation, -(rotation * centre))
}

/// From a world-to-camera quaternion (wxyz, any length but zero) and
/// translation. `None` for a zero or non-finite quaternion.
pub(crate) fn from_quaternion(wxyz: [f64; 4], translation: [f64; 3]) -> Option<Viewmat> {
    let norm = wxyz.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(norm > 0.0 && norm.is_finite()) {
        return None;
    }
    let [w, x, y, z] = wxyz.map(|v| v / norm);
    let rotation = DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        DVec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    );
    Some(viewmat(rotation, translation.into()))
}

/// From a camera-to-world matrix with OpenGL's axes (x right, y up, z backward), its first three
/// rows.
pub(crate) fn from_opengl(camera_to_world: &[[f64; 4]; 3]) -> Viewmat {
    let column = |k: usize| DVec3::from(camera_to_world.map(|row| row[k]));
    // Inverted rather than transposed, because matrices rounded to
    // single precision are not exactly orthonormal.
    let inverse = DMat3::from_cols(column(0), column(1), column(2)).inverse();
    let flip = DVec3::new(1.0, -1.0, -1.0);
    let rotation = DMat3::from_diagonal(flip) * inverse;
    viewmat(rotation, rotation * -column(3))
}

/// Whether two cameras have the same pose, intrinsics and size.
pub(crate) fn same_view(a: &Camera, b: &Camera) -> bool {
    a.viewmat == b.viewmat
        && a.intrinsics == b.intrinsics
        && (a.width, a.height) == (b.width, b.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(v: &Viewmat, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| v[i][0] * p[0] + v[i][1] * p[1] + v[i][2] * p[2] + v[i][3])
    }

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn opengl_cameras_look_along_minus_z_with_y_up() {
        // Centre (1, 2, 3), axes parallel to those of the world: the camera looks along -z, and
        // higher points are nearer to row 0.
        let c2w = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];
        let v = from_opengl(&c2w);
        assert!(close(at(&v, [1.0, 2.0, 3.0]), [0.0; 3]), "the centre is the origin");
        assert!(close(at(&v, [1.5, 2.25, 1.0]), [0.5, -0.25, 2.0]), "right, up and ahead");
    }

    #[test]
    fn quaternions_are_wxyz_and_world_to_camera() {
        let half = 0.5_f64.sqrt();
        // A quarter rotation about z maps the world's x to the camera's y.
        let v = from_quaternion([half, 0.0, 0.0, half], [0.0, 0.0, 5.0]).unwrap();
        assert!(close(at(&v, [1.0, 0.0, 0.0]), [0.0, 1.0, 5.0]), "{v:?}");
        let long = from_quaternion([3.0 * half, 0.0, 0.0, 3.0 * half], [0.0, 0.0, 5.0]).unwrap();
        assert!(close(at(&long, [1.0, 0.0, 0.0]), [0.0, 1.0, 5.0]), "length does not matter");
        assert!(from_quaternion([0.0; 4], [0.0; 3]).is_none(), "no direction");
        assert!(from_quaternion([f64::NAN, 0.0, 0.0, 0.0], [0.0; 3]).is_none(), "not a number");
    }

    #[test]
    fn axes_and_centre() {
        let v = from_axes(DVec3::X, DVec3::Z, -DVec3::Y, DVec3::new(0.0, 4.0, 0.0));
        assert!(close(at(&v, [0.0, 1.0, 0.0]), [0.0, 0.0, 3.0]), "looks along -y");
    }
}
