// Needs: shared/dispatch.wgsl, train/image_loss.wgsl, train/group_sum.wgsl, train/window.wgsl
// SSIM of the masked images m x and m y around every pixel, one channel. One invocation = one window.
//
// In: `x`, `y` [H,W,C]; `mask` [H,W]. Out: `planes` [3,H,W], derivatives of the window's SSIM by its mean of x, of x^2 and of x y;
// `partials`, one sum of 1 - SSIM per group.

@group(0) @binding(0) var<uniform> loss: ImageLoss;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> y: array<f32>;
@group(0) @binding(3) var<storage, read> mask: array<f32>;
@group(0) @binding(4) var<storage, read_write> planes: array<f32>;
@group(0) @binding(5) var<storage, read_write> partials: array<f32>;

const C1: f32 = 0.0001;
const C2: f32 = 0.0009;

var<workgroup> seen_x: array<f32, SEEN_PIXELS>;
var<workgroup> seen_y: array<f32, SEEN_PIXELS>;
// Horizontal pass over (x, y), then (x^2, y^2), then x y. One pair at
// a time, because workgroup memory is small.
var<workgroup> across: array<vec2f, STRIP>;

// `kind` 0: (x, y); 1: (x^2, y^2); 2: (x y, 0).
fn product(at: u32, kind: u32) -> vec2f {
    let p = vec2f(seen_x[at], seen_y[at]);
    if kind == 0u {
        return p;
    }
    return select(vec2f(p.x * p.y, 0.0), p * p, kind == 1u);
}

fn weigh2(a: vec2f, b: vec2f, c: vec2f, d: vec2f, e: vec2f, f: vec2f) -> vec2f {
    return TAP_5 * a + TAP_4 * b + TAP_3 * c + TAP_2 * d + TAP_1 * e + TAP_0 * f;
}

// Means of products over the window of `lane`. Uniform control flow.
fn window_mean(lane: u32, kind: u32) -> vec2f {
    // The pixels must be loaded, and the previous strip read.
    workgroupBarrier();
    for (var i = lane; i < STRIP; i += GROUP_SIZE) {
        let at = i / BLOCK * SEEN + i % BLOCK;
        across[i] = weigh2(
            product(at, kind) + product(at + 10u, kind),
            product(at + 1u, kind) + product(at + 9u, kind),
            product(at + 2u, kind) + product(at + 8u, kind),
            product(at + 3u, kind) + product(at + 7u, kind),
            product(at + 4u, kind) + product(at + 6u, kind),
            product(at + 5u, kind),
        );
    }
    workgroupBarrier();
    return weigh2(
        across[lane] + across[lane + 160u],
        across[lane + 16u] + across[lane + 144u],
        across[lane + 32u] + across[lane + 128u],
        across[lane + 48u] + across[lane + 112u],
        across[lane + 64u] + across[lane + 96u],
        across[lane + 80u],
    );
}

@compute @workgroup_size(256)
fn ssim(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let size = vec2i(loss.img_size);
    for (var i = lane; i < SEEN_PIXELS; i += GROUP_SIZE) {
        let p = seen_pixel(workgroup.xy, i);
        var own = vec2f(0.0);
        if all(p >= vec2i(0)) && all(p < size) {
            let pixel = u32(p.y * size.x + p.x);
            let m = counted(mask[pixel]);
            let at = pixel * loss.num_channels + loss.channel;
            own = vec2f(masked(m, x[loss.x_base + at]), masked(m, y[at]));
        }
        seen_x[i] = own.x;
        seen_y[i] = own.y;
    }
    let mean = window_mean(lane, 0u);
    let square = window_mean(lane, 1u);
    let cross = window_mean(lane, 2u).x;

    let p = workgroup.xy * BLOCK + vec2u(lane % BLOCK, lane / BLOCK);
    var unlike = 0.0;
    if all(p < loss.img_size) {
        let a1 = 2.0 * mean.x * mean.y + C1;
        let a2 = 2.0 * (cross - mean.x * mean.y) + C2;
        let b1 = mean.x * mean.x + mean.y * mean.y + C1;
        let b2 = (square.x - mean.x * mean.x) + (square.y - mean.y * mean.y) + C2;
        let both = 1.0 / (b1 * b2);
        let s = a1 * a2 * both;
        unlike = 1.0 - s;
        let num_pixels = loss.img_size.x * loss.img_size.y;
        let pixel = p.y * loss.img_size.x + p.x;
        planes[pixel] = 2.0 * (mean.y * (a2 - a1) * both - s * mean.x / b1 + s * mean.x / b2);
        planes[num_pixels + pixel] = -s / b2;
        planes[2u * num_pixels + pixel] = 2.0 * a1 * both;
    }
    let total = group_sum(lane, unlike);
    if lane == 0u {
        let groups = (loss.img_size + BLOCK - 1u) / BLOCK;
        partials[loss.first_partial + workgroup.y * groups.x + workgroup.x] = total;
    }
}
