// Needs: nothing
// Real spherical harmonics up to degree 3, with the constants and signs of 3DGS.

const SH_C0: f32 = 0.28209479177387814;
const SH_C1: f32 = 0.4886025119029199;
const SH_C2A: f32 = 1.0925484305920792;
const SH_C2B: f32 = 0.31539156525252005;
const SH_C2E: f32 = 0.5462742152960396;
const SH_C3A: f32 = 0.5900435899266435;
const SH_C3B: f32 = 2.890611442640554;
const SH_C3C: f32 = 0.4570457994644658;
const SH_C3D: f32 = 0.3731763325901154;
const SH_C3E: f32 = 1.445305721320277;

// Unit direction from the camera to a mean; zero for a mean at the camera centre, which is culled.
fn sh_direction(mean: vec3f, camera_pos: vec3f) -> vec3f {
    let ray = mean - camera_pos;
    return ray / max(sqrt(dot(ray, ray)), 1e-30);
}

// Basis values; zero above the degree.
fn sh_basis(degree: u32, d: vec3f) -> array<f32, 16> {
    var y: array<f32, 16>;
    y[0] = SH_C0;
    if degree >= 1u {
        y[1] = -SH_C1 * d.y;
        y[2] = SH_C1 * d.z;
        y[3] = -SH_C1 * d.x;
    }
    let s = d * d;
    if degree >= 2u {
        y[4] = SH_C2A * d.x * d.y;
        y[5] = -SH_C2A * d.y * d.z;
        y[6] = SH_C2B * (2.0 * s.z - s.x - s.y);
        y[7] = -SH_C2A * d.x * d.z;
        y[8] = SH_C2E * (s.x - s.y);
    }
    if degree >= 3u {
        y[9] = -SH_C3A * d.y * (3.0 * s.x - s.y);
        y[10] = SH_C3B * d.x * d.y * d.z;
        y[11] = -SH_C3C * d.y * (4.0 * s.z - s.x - s.y);
        y[12] = SH_C3D * d.z * (2.0 * s.z - 3.0 * s.x - 3.0 * s.y);
        y[13] = -SH_C3C * d.x * (4.0 * s.z - s.x - s.y);
        y[14] = SH_C3E * d.z * (s.x - s.y);
        y[15] = -SH_C3A * d.x * (s.x - 3.0 * s.y);
    }
    return y;
}

// Gradient of sum_k weight_k * Y_k with respect to the direction,
// treating its three components as independent.
fn sh_direction_gradient(degree: u32, d: vec3f, weight: array<f32, 16>) -> vec3f {
    var g = vec3f(0.0);
    if degree >= 1u {
        g += SH_C1 * vec3f(-weight[3], -weight[1], weight[2]);
    }
    let s = d * d;
    if degree >= 2u {
        g += SH_C2A * weight[4] * vec3f(d.y, d.x, 0.0);
        g -= SH_C2A * weight[5] * vec3f(0.0, d.z, d.y);
        g += SH_C2B * weight[6] * vec3f(-2.0 * d.x, -2.0 * d.y, 4.0 * d.z);
        g -= SH_C2A * weight[7] * vec3f(d.z, 0.0, d.x);
        g += SH_C2E * weight[8] * vec3f(2.0 * d.x, -2.0 * d.y, 0.0);
    }
    if degree >= 3u {
        let xy = d.x * d.y;
        let xz = d.x * d.z;
        let yz = d.y * d.z;
        g -= SH_C3A * weight[9] * vec3f(6.0 * xy, 3.0 * s.x - 3.0 * s.y, 0.0);
        g += SH_C3B * weight[10] * vec3f(yz, xz, xy);
        g -= SH_C3C * weight[11] * vec3f(-2.0 * xy, 4.0 * s.z - s.x - 3.0 * s.y, 8.0 * yz);
        g += SH_C3D * weight[12] * vec3f(-6.0 * xz, -6.0 * yz, 6.0 * s.z - 3.0 * s.x - 3.0 * s.y);
        g -= SH_C3C * weight[13] * vec3f(4.0 * s.z - 3.0 * s.x - s.y, -2.0 * xy, 8.0 * xz);
        g += SH_C3E * weight[14] * vec3f(2.0 * xz, -2.0 * yz, s.x - s.y);
        g -= SH_C3A * weight[15] * vec3f(3.0 * s.x - 3.0 * s.y, -6.0 * xy, 0.0);
    }
    return g;
}
