// Needs: shared/dispatch.wgsl, shared/frame.wgsl, shared/sh.wgsl
// Backward of `shade`. One invocation = one splat of this chunk of the harmonics.
//
// In: `splat_grads` [N,grad_stride], channels from column 8 on. Out: `v_sh` [chunk,K,3]; `v_features` [N,F]; `v_params`, whose first 3N
// values become the gradient of the means through the direction of view (the projection adds its own).

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> means: array<f32>;
@group(0) @binding(2) var<storage, read> sh: array<f32>;
@group(0) @binding(3) var<storage, read> projected: array<vec4f>;
@group(0) @binding(4) var<storage, read> splat_grads: array<f32>;
@group(0) @binding(5) var<storage, read_write> v_sh: array<f32>;
@group(0) @binding(6) var<storage, read_write> v_features: array<f32>;
@group(0) @binding(7) var<storage, read_write> v_params: array<f32>;

@compute @workgroup_size(256)
fn shade_bwd(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let within = group_index(workgroup) * GROUP_SIZE + lane;
    if within >= frame.num_chunk_splats {
        return;
    }
    let i = frame.first_splat + within;
    let g1 = projected[2u * i + 1u];
    let draws = g1.w > 0.0 && g1.y > 0.0;
    let channels_at = i * frame.grad_stride + 8u;

    for (var f = 0u; f < frame.num_features; f++) {
        var value = 0.0;
        if draws {
            value = splat_grads[channels_at + 3u * frame.rgb + frame.depth + f];
        }
        v_features[i * frame.num_features + f] = value;
    }

    var v_mean = vec3f(0.0);
    if frame.rgb == 1u {
        let coeffs = (frame.sh_degree + 1u) * (frame.sh_degree + 1u);
        let first = 3u * within * coeffs;
        if draws {
            let mean = vec3f(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
            let ray = mean - frame.camera_pos;
            let d = sh_direction(mean, frame.camera_pos);
            let y = sh_basis(frame.sh_degree, d);
            var rgb = vec3f(0.5);
            for (var k = 0u; k < coeffs; k++) {
                let at = first + 3u * k;
                rgb += y[k] * vec3f(sh[at], sh[at + 1u], sh[at + 2u]);
            }
            var v_rgb = vec3f(splat_grads[channels_at], splat_grads[channels_at + 1u], splat_grads[channels_at + 2u]);
            v_rgb = select(v_rgb, vec3f(0.0), rgb < vec3f(0.0));
            var weight: array<f32, 16>;
            for (var k = 0u; k < coeffs; k++) {
                let at = first + 3u * k;
                weight[k] = dot(v_rgb, vec3f(sh[at], sh[at + 1u], sh[at + 2u]));
                v_sh[at] = y[k] * v_rgb.x;
                v_sh[at + 1u] = y[k] * v_rgb.y;
                v_sh[at + 2u] = y[k] * v_rgb.z;
            }
            let v_d = sh_direction_gradient(frame.sh_degree, d, weight);
            v_mean = (v_d - d * dot(d, v_d)) / max(sqrt(dot(ray, ray)), 1e-30);
        } else {
            for (var k = 0u; k < 3u * coeffs; k++) {
                v_sh[first + k] = 0.0;
            }
        }
    }
    v_params[3u * i] = v_mean.x;
    v_params[3u * i + 1u] = v_mean.y;
    v_params[3u * i + 2u] = v_mean.z;
}
