// Needs: shared/frame.wgsl, shared/tile.wgsl, variants/channels, variants/backward, variants/sum, variants/sink
// Shared by both backward passes over tiles: bindings, upstream
// gradients, summation of a group of entries.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> tile_ranges: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<vec2u>;
@group(0) @binding(3) var<storage, read> projected: array<vec4f>;
@group(0) @binding(5) var<storage, read> pixel_states: array<vec2u>;
@group(0) @binding(6) var<storage, read> v_image: array<f32>;

var<workgroup> tile_last: atomic<u32>;
var<workgroup> num_walked: u32;
var<workgroup> group_drawn: atomic<u32>;
var<workgroup> group_drawn_copy: u32;
var<workgroup> quarters: array<vec4f, 64>;

// Upstream gradients of the lane's four pixels.
var<private> v_out: array<Color, 4>;
// Final transmittance of the pixels.
var<private> final_t: vec4f;
// 1 + index of the last entry drawn; 0 outside the image.
var<private> last_ids: vec4u;

fn read_pixel(block: Block, k: u32) {
    final_t[k] = 1.0;
    last_ids[k] = 0u;
    if !block.inside[k] {
        return;
    }
    let pixel = block.pixel[k];
    let state = pixel_states[pixel];
    final_t[k] = bitcast<f32>(state.x);
    last_ids[k] = state.y;
    let count = min(CHANNELS, frame_channels(frame) - frame.first_channel);
    var color: Color;
    for (var c = 0u; c < count; c++) {
        color = color_with(color, c, v_image[frame_address(frame, frame.first_channel + c, pixel)]);
    }
    v_out[k] = color;
}

// Reads the lane's pixels and returns the number of list entries
// used by any pixel of the tile. Uniform.
fn open_tile(block: Block, lane: u32) -> u32 {
    if lane == 0u {
        atomicStore(&tile_last, 0u);
    }
    workgroupBarrier();
    read_pixel(block, 0u);
    read_pixel(block, 1u);
    read_pixel(block, 2u);
    read_pixel(block, 3u);
    atomicMax(&tile_last, max(max(last_ids.x, last_ids.y), max(last_ids.z, last_ids.w)));
    workgroupBarrier();
    if lane == 0u {
        num_walked = atomicLoad(&tile_last);
        atomicStore(&group_drawn, 0u);
    }
    return workgroupUniformLoad(&num_walked);
}

// Sum of the lane's four pixels' gradients of the channels, weighted.
fn weigh_upstream(weight: vec4f) -> Color {
    var sum: Color;
    sum = color_add_scaled(sum, weight.x, v_out[0]);
    sum = color_add_scaled(sum, weight.y, v_out[1]);
    sum = color_add_scaled(sum, weight.z, v_out[2]);
    return color_add_scaled(sum, weight.w, v_out[3]);
}

// Stores the lane's gradient of the channels of the group's entry `e`.
fn put_color(e: u32, lane: u32, color: Color) {
    let at = e * ENTRY_QUADS + GEOMETRY_QUADS;
    put_quad(at, lane, color_quad(color, 0u));
    if QUADS > 1u {
        put_quad(at + 1u, lane, color_quad(color, 1u));
    }
}

// Adds the lanes' contributions to a group of entries staged from
// `base`, if any lane drew. Uniform control flow.
fn deliver_group(base: u32, count: u32, drew: bool, lane: u32) {
    if drew {
        atomicStore(&group_drawn, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        group_drawn_copy = atomicLoad(&group_drawn);
        atomicStore(&group_drawn, 0u);
    }
    if workgroupUniformLoad(&group_drawn_copy) == 0u {
        return;
    }
    if lane < 4u * count * ENTRY_QUADS {
        quarters[lane] = take_quarter(lane / 4u, lane % 4u);
    }
    // The contributions must be read before the next group overwrites
    // them, and the quarters must be complete.
    workgroupBarrier();
    if lane < count * ENTRY_QUADS {
        let sum = (quarters[4u * lane] + quarters[4u * lane + 1u]) + (quarters[4u * lane + 2u] + quarters[4u * lane + 3u]);
        deliver(stage_ids[base + lane / ENTRY_QUADS], lane % ENTRY_QUADS, sum);
    }
}
