// Needs: shared/frame.wgsl, shared/activation.wgsl
// Projection of one splat: camera frame, guard band, projected covariance, conic, radius. Forward and backward share it.

struct Projection {
    // Mean in the camera frame.
    t: vec3f,
    // x and y of the mean after the guard band, camera frame; used by the Jacobian only.
    banded: vec2f,
    // 1 where the guard band is inactive.
    inside: vec2f,
    mean2d: vec2f,
    // 1 / (z + epsilon) of the perspective divide.
    inv_z: f32,
    quat: vec4f,
    quat_norm: f32,
    scale: vec3f,
    // Rows of the rotation.
    r0: vec3f,
    r1: vec3f,
    r2: vec3f,
    // Rows of J * W, 2x3.
    jw0: vec3f,
    jw1: vec3f,
    // Rows of J * W * R * diag(scale): the projected covariance is their Gram matrix.
    p0: vec3f,
    p1: vec3f,
    // a, b, c of the covariance with the low-pass, pixels^2.
    cov2d: vec3f,
    det: f32,
}

fn projection_of(frame: Frame, mean: vec3f, raw_quat: vec4f, log_scale: vec3f) -> Projection {
    var o: Projection;
    // Subtracting the camera centre first preserves precision in scenes far from the origin.
    let d = mean - frame.camera_pos;
    o.t = vec3f(
        dot(frame.view0.xyz, d) + frame.view0.w,
        dot(frame.view1.xyz, d) + frame.view1.w,
        dot(frame.view2.xyz, d) + frame.view2.w,
    );
    let z = o.t.z;
    o.inv_z = 1.0 / (z + frame.divide);
    // Half the image times the normalised device coordinate; pixel i is sampled at coordinate i.
    let ray = frame.focal * o.t.xy + frame.center_offset * z;
    o.mean2d = ray * o.inv_z + (vec2f(frame.img_size) - 1.0) * 0.5;

    o.quat_norm = max(sqrt(dot(raw_quat, raw_quat)), MIN_QUAT_NORM);
    o.quat = raw_quat / o.quat_norm;
    let w = o.quat.x;
    let x = o.quat.y;
    let y = o.quat.z;
    let q = o.quat.w;
    o.r0 = vec3f(1.0 - 2.0 * (y * y + q * q), 2.0 * (x * y - w * q), 2.0 * (x * q + w * y));
    o.r1 = vec3f(2.0 * (x * y + w * q), 1.0 - 2.0 * (x * x + q * q), 2.0 * (y * q - w * x));
    o.r2 = vec3f(2.0 * (x * q - w * y), 2.0 * (y * q + w * x), 1.0 - 2.0 * (x * x + y * y));
    o.scale = vec3f(scale_of(log_scale.x), scale_of(log_scale.y), scale_of(log_scale.z));

    let tangent = o.t.xy / z;
    let clamped = clamp(tangent, -frame.guard, frame.guard);
    o.inside = select(vec2f(0.0), vec2f(1.0), clamped == tangent);
    o.banded = clamped * z;
    let j = frame.focal / z;
    let k = -(j * o.banded) / z;
    o.jw0 = j.x * frame.view0.xyz + k.x * frame.view2.xyz;
    o.jw1 = j.y * frame.view1.xyz + k.y * frame.view2.xyz;
    o.p0 = o.scale * (o.jw0.x * o.r0 + o.jw0.y * o.r1 + o.jw0.z * o.r2);
    o.p1 = o.scale * (o.jw1.x * o.r0 + o.jw1.y * o.r1 + o.jw1.z * o.r2);
    o.cov2d = vec3f(dot(o.p0, o.p0) + EPS2D, dot(o.p0, o.p1), dot(o.p1, o.p1) + EPS2D);
    o.det = o.cov2d.x * o.cov2d.z - o.cov2d.y * o.cov2d.y;
    return o;
}

// Radius in whole pixels as a float (3 standard deviations of the longer axis, its variance floored), 0 when the splat is culled.
fn projection_radius(frame: Frame, o: Projection) -> f32 {
    if !is_finite3(o.t) || o.t.z <= frame.near {
        return 0.0;
    }
    let conic = vec3f(o.cov2d.z, -o.cov2d.y, o.cov2d.x) / o.det;
    if !is_finite3(o.cov2d) || !is_finite(o.det) || o.det <= 0.0 || !is_finite3(conic) {
        return 0.0;
    }
    let middle = 0.5 * (o.cov2d.x + o.cov2d.z);
    let variance = middle + sqrt(max(MIN_DISCRIMINANT, middle * middle - o.det));
    let radius = ceil(EXTENT_SIGMAS * sqrt(variance));
    if !is_finite(radius) || !is_finite(o.mean2d.x) || !is_finite(o.mean2d.y) {
        return 0.0;
    }
    // 2^30 pixels cover every image; larger values could not be converted to an integer.
    return min(radius, 1073741824.0);
}
