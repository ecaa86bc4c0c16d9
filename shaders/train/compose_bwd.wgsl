// Needs: shared/dispatch.wgsl, train/crop.wgsl
// Backward of `compose`. One invocation = one pixel of the crop.
//
// In: `v_render` [h,w,3]; `pixel_flags` [h,w]. Out, where edited splats are visible: `v_planes` of
// the whole image, [H,W,3] from `features_base`.

@group(0) @binding(0) var<uniform> crop: Crop;
@group(0) @binding(1) var<storage, read> v_render: array<f32>;
@group(0) @binding(2) var<storage, read> pixel_flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> v_planes: array<f32>;

@compute @workgroup_size(256)
fn compose_bwd(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let p = group_index(workgroup) * GROUP_SIZE + lane;
    if p >= crop.size.x * crop.size.y || (flags_of(pixel_flags[p / 4u], p) & LIVE) == 0u {
        return;
    }
    let q = crop.features_base + 3u * whole_pixel(crop, p);
    for (var c = 0u; c < 3u; c++) {
        v_planes[q + c] = v_render[3u * p + c];
    }
}
