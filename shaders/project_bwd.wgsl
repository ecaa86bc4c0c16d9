// Needs: shared/dispatch.wgsl, shared/frame.wgsl, shared/activation.wgsl, shared/projection.wgsl
// Backward of `project`, down to the stored parameters. One invocation = one splat.
//
// In: stored parameters; `projected`; `splat_grads` [N,grad_stride] = gradients of u,
// v, A, B, C, opacity, two unused, then the channels. Out: `v_params` = means [N,3]
// (added to the existing values), quats [N,4], log_scales [N,3], opacity_logits [N],
// means2d [N,2]. Rows of splats that draw nothing are zero.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> means: array<f32>;
@group(0) @binding(2) var<storage, read> quats: array<vec4f>;
@group(0) @binding(3) var<storage, read> log_scales: array<f32>;
@group(0) @binding(4) var<storage, read> opacity_logits: array<f32>;
@group(0) @binding(5) var<storage, read> projected: array<vec4f>;
@group(0) @binding(6) var<storage, read> splat_grads: array<f32>;
@group(0) @binding(7) var<storage, read_write> v_params: array<f32>;

struct ParamGrads {
    mean: vec3f,
    quat: vec4f,
    log_scale: vec3f,
    opacity_logit: f32,
    mean2d: vec2f,
}

fn quat_gradient(o: Projection, n0: vec3f, n1: vec3f, n2: vec3f) -> vec4f {
    let w = o.quat.x;
    let x = o.quat.y;
    let y = o.quat.z;
    let z = o.quat.w;
    let v = vec4f(
        2.0 * (x * (n2.y - n1.z) + y * (n0.z - n2.x) + z * (n1.x - n0.y)),
        2.0 * (y * (n0.y + n1.x) + z * (n0.z + n2.x) + w * (n2.y - n1.z)) - 4.0 * x * (n1.y + n2.z),
        2.0 * (x * (n0.y + n1.x) + z * (n1.z + n2.y) + w * (n0.z - n2.x)) - 4.0 * y * (n0.x + n2.z),
        2.0 * (x * (n0.z + n2.x) + y * (n1.z + n2.y) + w * (n1.x - n0.y)) - 4.0 * z * (n0.x + n1.y),
    );
    return (v - o.quat * dot(o.quat, v)) / o.quat_norm;
}

fn param_gradients(i: u32) -> ParamGrads {
    var out: ParamGrads;
    let mean = vec3f(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
    let log_scale = vec3f(log_scales[3u * i], log_scales[3u * i + 1u], log_scales[3u * i + 2u]);
    let o = projection_of(frame, mean, quats[i], log_scale);
    let at = i * frame.grad_stride;
    out.mean2d = vec2f(splat_grads[at], splat_grads[at + 1u]);
    let v_conic = vec3f(splat_grads[at + 2u], splat_grads[at + 3u], splat_grads[at + 4u]);
    let opacity = sigmoid(opacity_logits[i]);
    out.opacity_logit = splat_grads[at + 5u] * opacity * (1.0 - opacity);

    // Conic to covariance: D = -kappa K G K with K = (A B; B C), G = (vA vB/2; vB/2 vC).
    let kappa = select(o.det * o.det / (o.det * o.det + 1e-7), 1.0, frame.exact_gradients == 1u || o.det > 1e15);
    let a = o.cov2d.z / o.det;
    let b = -o.cov2d.y / o.det;
    let c = o.cov2d.x / o.det;
    let ga = a * v_conic.x + 0.5 * b * v_conic.y;
    let gb = 0.5 * a * v_conic.y + b * v_conic.z;
    let gc = b * v_conic.x + 0.5 * c * v_conic.y;
    let gd = 0.5 * b * v_conic.y + c * v_conic.z;
    let d00 = -kappa * (ga * a + gb * b);
    let d01 = -kappa * (ga * b + gb * c);
    let d11 = -kappa * (gc * b + gd * c);

    // Covariance = P P^T with P = T M, M = R diag(s): v_M = 2 T^T D P, v_T = 2 D P M^T.
    let e0 = 2.0 * (d00 * o.p0 + d01 * o.p1);
    let e1 = 2.0 * (d01 * o.p0 + d11 * o.p1);
    let v_m0 = o.jw0.x * e0 + o.jw1.x * e1;
    let v_m1 = o.jw0.y * e0 + o.jw1.y * e1;
    let v_m2 = o.jw0.z * e0 + o.jw1.z * e1;
    out.log_scale = o.scale * (o.r0 * v_m0 + o.r1 * v_m1 + o.r2 * v_m2);
    out.quat = quat_gradient(o, o.scale * v_m0, o.scale * v_m1, o.scale * v_m2);

    let se0 = o.scale * e0;
    let se1 = o.scale * e1;
    let v_t0 = vec3f(dot(o.r0, se0), dot(o.r1, se0), dot(o.r2, se0));
    let v_t1 = vec3f(dot(o.r0, se1), dot(o.r1, se1), dot(o.r2, se1));
    let v_j00 = dot(v_t0, frame.view0.xyz);
    let v_j02 = dot(v_t0, frame.view2.xyz);
    let v_j11 = dot(v_t1, frame.view1.xyz);
    let v_j12 = dot(v_t1, frame.view2.xyz);
    let inv = 1.0 / o.t.z;
    let j = frame.focal * inv;
    // The reference treats a clamped x or y as constant in the derivative by z; the true derivative does not.
    let times = select(vec2f(2.0), vec2f(1.0) + o.inside, frame.exact_gradients == 1u);
    var v_t = vec3f(
        -o.inside.x * j.x * inv * v_j02,
        -o.inside.y * j.y * inv * v_j12,
        inv * (-j.x * v_j00 - j.y * v_j11
            + times.x * j.x * (o.banded.x * inv) * v_j02 + times.y * j.y * (o.banded.y * inv) * v_j12),
    );

    // Projected centre.
    let ray = frame.focal * o.t.xy + frame.center_offset * o.t.z;
    let v_ray = out.mean2d * o.inv_z;
    v_t += vec3f(frame.focal * v_ray, dot(frame.center_offset * o.inv_z - ray * (o.inv_z * o.inv_z), out.mean2d));
    if frame.depth == 1u {
        v_t.z += splat_grads[at + 8u + 3u * frame.rgb];
    }
    out.mean = v_t.x * frame.view0.xyz + v_t.y * frame.view1.xyz + v_t.z * frame.view2.xyz;
    return out;
}

@compute @workgroup_size(256)
fn project_bwd(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(workgroup) * GROUP_SIZE + lane;
    let n = frame.num_splats;
    if i >= n {
        return;
    }
    var grads: ParamGrads;
    let g1 = projected[2u * i + 1u];
    if g1.w > 0.0 && g1.y > 0.0 {
        grads = param_gradients(i);
    }
    for (var k = 0u; k < 3u; k++) {
        v_params[3u * i + k] += grads.mean[k];
        v_params[7u * n + 3u * i + k] = grads.log_scale[k];
    }
    for (var k = 0u; k < 4u; k++) {
        v_params[3u * n + 4u * i + k] = grads.quat[k];
    }
    v_params[10u * n + i] = grads.opacity_logit;
    v_params[11u * n + 2u * i] = grads.mean2d.x;
    v_params[11u * n + 2u * i + 1u] = grads.mean2d.y;
}
