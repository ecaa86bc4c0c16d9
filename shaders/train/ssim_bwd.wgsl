// Needs: shared/dispatch.wgsl, train/image_loss.wgsl, train/window.wgsl
// Backward of `ssim`: every pixel gathers from the windows that contain it; the window is
// symmetric. One invocation = one pixel, one channel.
//
// In: `x`, `y` [H,W,C]; `mask` [H,W]; `planes` [3,H,W]. Out: `v_x` [H,W,C] -= factor m dSSIM/d(m x).

@group(0) @binding(0) var<uniform> loss: ImageLoss;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> y: array<f32>;
@group(0) @binding(3) var<storage, read> mask: array<f32>;
@group(0) @binding(4) var<storage, read> planes: array<f32>;
@group(0) @binding(5) var<storage, read_write> v_x: array<f32>;

var<workgroup> seen: array<f32, SEEN_PIXELS>;
var<workgroup> across: array<f32, STRIP>;

// The window's mean of plane `plane` around `lane`. Uniform control flow.
fn window_mean(group: vec2u, lane: u32, plane: u32) -> f32 {
    let size = vec2i(loss.img_size);
    let first = plane * loss.img_size.x * loss.img_size.y;
    for (var i = lane; i < SEEN_PIXELS; i += GROUP_SIZE) {
        let p = seen_pixel(group, i);
        var value = 0.0;
        if all(p >= vec2i(0)) && all(p < size) {
            value = planes[first + u32(p.y * size.x + p.x)];
        }
        seen[i] = value;
    }
    workgroupBarrier();
    for (var i = lane; i < STRIP; i += GROUP_SIZE) {
        let at = i / BLOCK * SEEN + i % BLOCK;
        across[i] = weigh(
            seen[at] + seen[at + 10u],
            seen[at + 1u] + seen[at + 9u],
            seen[at + 2u] + seen[at + 8u],
            seen[at + 3u] + seen[at + 7u],
            seen[at + 4u] + seen[at + 6u],
            seen[at + 5u],
        );
    }
    workgroupBarrier();
    // All lanes have read the pixels, so the next plane may overwrite them;
    // its strip is written after another barrier.
    return weigh(
        across[lane] + across[lane + 160u],
        across[lane + 16u] + across[lane + 144u],
        across[lane + 32u] + across[lane + 128u],
        across[lane + 48u] + across[lane + 112u],
        across[lane + 64u] + across[lane + 96u],
        across[lane + 80u],
    );
}

@compute @workgroup_size(256)
fn ssim_bwd(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let mean = window_mean(workgroup.xy, lane, 0u);
    let square = window_mean(workgroup.xy, lane, 1u);
    let cross = window_mean(workgroup.xy, lane, 2u);
    let p = workgroup.xy * BLOCK + vec2u(lane % BLOCK, lane / BLOCK);
    if any(p >= loss.img_size) {
        return;
    }
    let pixel = p.y * loss.img_size.x + p.x;
    let m = counted(mask[pixel]);
    if m > 0.0 {
        let at = pixel * loss.num_channels + loss.channel;
        let derivative = mean + 2.0 * m * x[loss.x_base + at] * square + m * y[at] * cross;
        v_x[loss.v_base + at] -= loss.factor * m * derivative;
    }
}
