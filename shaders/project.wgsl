// Needs: shared/dispatch.wgsl, shared/frame.wgsl, shared/activation.wgsl, shared/projection.wgsl
// Projects, culls and bounds. One invocation = one splat (and one more that ends the array of flags).
//
// In: stored parameters, [N]. Out: `projected` [N,2] = (u, v, A, B), (C, opacity, depth, radius) in pixels; `rects` [N] = tile
// rectangle x0 | y0 << 16, x1 | y1 << 16, upper bounds exclusive; `visible` [N+1] = 1 for splats that are not culled.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> means: array<f32>;
@group(0) @binding(2) var<storage, read> quats: array<vec4f>;
@group(0) @binding(3) var<storage, read> log_scales: array<f32>;
@group(0) @binding(4) var<storage, read> opacity_logits: array<f32>;
@group(0) @binding(5) var<storage, read_write> projected: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> rects: array<vec2u>;
@group(0) @binding(7) var<storage, read_write> visible: array<u32>;

@compute @workgroup_size(256)
fn project(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(workgroup) * GROUP_SIZE + lane;
    if i > frame.num_splats {
        return;
    }
    visible[i] = 0u;
    if i == frame.num_splats {
        return;
    }
    let mean = vec3f(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
    let log_scale = vec3f(log_scales[3u * i], log_scales[3u * i + 1u], log_scales[3u * i + 2u]);
    let quat = quats[i];
    projected[2u * i] = vec4f(0.0);
    projected[2u * i + 1u] = vec4f(0.0);
    rects[i] = vec2u(0u);
    let hostile = !is_finite3(mean) || !is_finite3(quat.xyz) || !is_finite(quat.w) || is_nan(log_scale.x)
        || is_nan(log_scale.y) || is_nan(log_scale.z) || is_nan(opacity_logits[i]);
    if hostile {
        return;
    }
    let o = projection_of(frame, mean, quat, log_scale);
    let radius = projection_radius(frame, o);
    if radius <= 0.0 {
        return;
    }
    // The upper bounds are one pixel tighter than the lower ones, as in
    // the reference; this is visible in the image.
    let grid = vec2f(frame.tile_bounds);
    let side = f32(TILE_SIZE);
    let low = vec2u(clamp(trunc((o.mean2d - radius) / side), vec2f(0.0), grid));
    let high = vec2u(clamp(trunc((o.mean2d + radius + (side - 1.0)) / side), vec2f(0.0), grid));
    if low.x >= high.x || low.y >= high.y {
        return;
    }
    let conic = vec3f(o.cov2d.z, -o.cov2d.y, o.cov2d.x) / o.det;
    projected[2u * i] = vec4f(o.mean2d, conic.xy);
    projected[2u * i + 1u] = vec4f(conic.z, sigmoid(opacity_logits[i]), o.t.z, radius);
    rects[i] = vec2u(low.x | (low.y << 16u), high.x | (high.y << 16u));
    visible[i] = 1u;
}
