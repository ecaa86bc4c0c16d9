// Needs: shared/dispatch.wgsl, train/crop.wgsl
// The render of a crop: the original, plus the change where edited splats are visible; and the
// masks of the losses. One invocation = one pixel.
//
// In: `planes` of the whole image, [H,W,3] from `features_base`; `original` [h,w,3]; `pixel_flags`
// [h,w]. Out: `render` [h,w,3]; `fore` and `back` [h,w].

@group(0) @binding(0) var<uniform> crop: Crop;
@group(0) @binding(1) var<storage, read> planes: array<f32>;
@group(0) @binding(2) var<storage, read> original: array<f32>;
@group(0) @binding(3) var<storage, read> pixel_flags: array<u32>;
@group(0) @binding(4) var<storage, read_write> render: array<f32>;
@group(0) @binding(5) var<storage, read_write> fore: array<f32>;
@group(0) @binding(6) var<storage, read_write> back: array<f32>;

@compute @workgroup_size(256)
fn compose(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let p = group_index(workgroup) * GROUP_SIZE + lane;
    if p >= crop.size.x * crop.size.y {
        return;
    }
    let flags = flags_of(pixel_flags[p / 4u], p);
    let q = crop.features_base + 3u * whole_pixel(crop, p);
    for (var c = 0u; c < 3u; c++) {
        var value = original[3u * p + c];
        if (flags & LIVE) != 0u {
            value += planes[q + c];
        }
        render[3u * p + c] = value;
    }
    fore[p] = f32((flags & FORE) != 0u);
    back[p] = f32((flags & BACK) != 0u);
}
