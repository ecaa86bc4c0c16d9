// Needs: shared/frame.wgsl, shared/tile.wgsl, variants/channels
// Composites one tile front to back. One group = one tile, one lane = 2x2 pixels.
//
// In: `tile_ranges`, `entries`, `projected`, `colors` [N]. Out: the planes of `image` that this dispatch's channels belong
// to; with the first channels also alpha and `pixel_states` [H,W] = (bits of the final transmittance, 1 + index within the tile of
// the last entry drawn).

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> tile_ranges: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<vec2u>;
@group(0) @binding(3) var<storage, read> projected: array<vec4f>;
@group(0) @binding(4) var<storage, read> colors: array<Color>;
@group(0) @binding(5) var<storage, read_write> image: array<f32>;
@group(0) @binding(6) var<storage, read_write> pixel_states: array<vec2u>;

var<workgroup> num_finished: atomic<u32>;
var<workgroup> all_finished: u32;

@compute @workgroup_size(64)
fn rasterize(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = block_of(frame, tile.xy, lane);
    let tile_id = tile.y * frame.tile_bounds.x + tile.x;
    let first = tile_ranges[2u * tile_id];
    let num_entries = tile_ranges[2u * tile_id + 1u] - first;
    let x = vec4f(block.x);
    let y = vec4f(block.y);

    var finished = !block.inside;
    var reported = false;
    var transmittance = vec4f(1.0);
    var last = vec4u(0u);
    var composited: array<Color, 4>;
    if lane == 0u {
        atomicStore(&num_finished, 0u);
    }
    workgroupBarrier();

    for (var start = 0u; start < num_entries; start += TILE_LANES) {
        if all(finished) && !reported {
            reported = true;
            atomicAdd(&num_finished, 1u);
        }
        // The staged entries have been read, and all finished lanes are counted.
        workgroupBarrier();
        if lane == 0u {
            all_finished = atomicLoad(&num_finished);
        }
        if workgroupUniformLoad(&all_finished) == TILE_LANES {
            break;
        }
        if start + lane < num_entries {
            let entry = entries[first + start + lane];
            stage_entry(lane, entry, projected[2u * entry.x], projected[2u * entry.x + 1u]);
        }
        workgroupBarrier();
        let count = min(TILE_LANES, num_entries - start);
        for (var j = 0u; j < count; j++) {
            let near = stage_near[j];
            let far = stage_far[j];
            let p = exponent(near, far, near.x - x, near.y - y);
            let candidate = !finished & (p >= vec4f(far.z)) & (p <= vec4f(0.0));
            if !any(candidate) {
                continue;
            }
            let alpha = min(vec4f(MAX_ALPHA), far.y * exp(min(p, vec4f(0.0))));
            let next = transmittance * (1.0 - alpha);
            let seen = candidate & (alpha >= vec4f(ALPHA_THRESHOLD));
            let stops = seen & (next < vec4f(TRANSMITTANCE_THRESHOLD));
            finished = finished | stops;
            let drawn = seen & !stops;
            if any(drawn) {
                let weight = select(vec4f(0.0), alpha * transmittance, drawn);
                let color = colors[stage_ids[j].x];
                composited[0] = color_add_scaled(composited[0], weight.x, color);
                composited[1] = color_add_scaled(composited[1], weight.y, color);
                composited[2] = color_add_scaled(composited[2], weight.z, color);
                composited[3] = color_add_scaled(composited[3], weight.w, color);
                transmittance = select(transmittance, next, drawn);
                last = select(last, vec4u(start + j + 1u), drawn);
            }
        }
    }

    let channels = frame_channels(frame);
    for (var k = 0u; k < 4u; k++) {
        if !block.inside[k] {
            continue;
        }
        let pixel = block.pixel[k];
        for (var c = 0u; c < CHANNELS; c++) {
            let channel = frame.first_channel + c;
            if channel < channels {
                var value = color_quad(composited[k], c / 4u)[c % 4u];
                if channel < 3u * frame.rgb {
                    value += transmittance[k] * frame.background[channel];
                }
                image[frame_address(frame, channel, pixel)] = value;
            }
        }
        if frame.first_channel == 0u {
            image[frame.alpha_base + pixel] = 1.0 - transmittance[k];
            pixel_states[pixel] = vec2u(bitcast<u32>(transmittance[k]), last[k]);
        }
    }
}
