// Needs: shared/dispatch.wgsl, train/image_loss.wgsl, train/group_sum.wgsl
// Masked L1: sum of m |x - y|, and its derivative. One invocation = one pixel.
//
// In: `x`, `y` [H,W,C]; `mask` [H,W]. Out: `v_x` [H,W,C] += factor m sign(x - y), 0 at x = y; `partials`, one sum per group.

@group(0) @binding(0) var<uniform> loss: ImageLoss;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> y: array<f32>;
@group(0) @binding(3) var<storage, read> mask: array<f32>;
@group(0) @binding(4) var<storage, read_write> v_x: array<f32>;
@group(0) @binding(5) var<storage, read_write> partials: array<f32>;

@compute @workgroup_size(256)
fn masked_l1(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let group = group_index(workgroup);
    let num_pixels = loss.img_size.x * loss.img_size.y;
    let pixel = group * GROUP_SIZE + lane;
    var sum = 0.0;
    if pixel < num_pixels {
        let m = counted(mask[pixel]);
        if m > 0.0 {
            for (var c = 0u; c < loss.num_channels; c++) {
                let at = pixel * loss.num_channels + c;
                let difference = x[loss.x_base + at] - y[at];
                sum += m * abs(difference);
                let side = f32(difference > 0.0) - f32(difference < 0.0);
                v_x[loss.v_base + at] += loss.factor * m * select(side, 0.0, is_nan(difference));
            }
        }
    }
    let total = group_sum(lane, sum);
    if lane == 0u && group * GROUP_SIZE < num_pixels {
        partials[loss.first_partial + group] = total;
    }
}
