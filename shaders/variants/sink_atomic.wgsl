// Needs: shared/frame.wgsl, variants/backward
// Adds a tile's sum of an entry directly to the splat with native float atomics. The order of the
// tiles, and hence the rounding, varies from run to run.

@group(0) @binding(7) var<storage, read_write> splat_grads: array<atomic<f32>>;

fn add(at: u32, value: f32) {
    if value != 0.0 {
        atomicAdd(&splat_grads[at], value);
    }
}

fn deliver(entry: vec2u, quad: u32, sum: vec4f) {
    let channel_quad = 2u + frame.first_channel / 4u + quad - GEOMETRY_QUADS;
    let at = entry.x * frame.grad_stride + 4u * select(channel_quad, quad, quad < GEOMETRY_QUADS);
    add(at, sum.x);
    add(at + 1u, sum.y);
    add(at + 2u, sum.z);
    add(at + 3u, sum.w);
}
