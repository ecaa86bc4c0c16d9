// Needs: shared/frame.wgsl, shared/tile.wgsl, shared/tile_backward.wgsl and the variants
// Gradient of the channels alone, dL/df_i = sum over pixels of alpha_i T_i g, front to back in one pass: transmittance is the
// forward's own, no opacity gradient, no geometry. One group = one tile, one lane = 2x2 pixels.

fn backward_tile(tile: vec2u, lane: u32) {
    let block = block_of(frame, tile, lane);
    let first = tile_ranges[2u * (tile.y * frame.tile_bounds.x + tile.x)];
    let walked = open_tile(block, lane);
    let x = vec4f(block.x);
    let y = vec4f(block.y);
    var transmittance = vec4f(1.0);

    for (var start = 0u; start < walked; start += TILE_LANES) {
        let count = min(TILE_LANES, walked - start);
        // The entries staged before have been read.
        workgroupBarrier();
        if lane < count {
            let entry = entries[first + start + lane];
            stage_entry(lane, entry, projected[2u * entry.x], projected[2u * entry.x + 1u]);
        }
        workgroupBarrier();
        for (var base = 0u; base < count; base += SUM_ENTRIES) {
            let group = min(SUM_ENTRIES, count - base);
            var drew = false;
            for (var step = 0u; step < group; step++) {
                let j = base + step;
                var v_color: Color;
                let near = stage_near[j];
                let far = stage_far[j];
                let p = exponent(near, far, near.x - x, near.y - y);
                let candidate = (vec4u(start + j) < last_ids) & (p >= vec4f(far.z)) & (p <= vec4f(0.0));
                if any(candidate) {
                    let alpha = min(vec4f(MAX_ALPHA), far.y * exp(min(p, vec4f(0.0))));
                    let drawn = candidate & (alpha >= vec4f(ALPHA_THRESHOLD));
                    if any(drawn) {
                        drew = true;
                        let weight = select(vec4f(0.0), alpha * transmittance, drawn);
                        v_color = weigh_upstream(weight);
                        transmittance = select(transmittance, transmittance * (1.0 - alpha), drawn);
                    }
                }
                put_color(step, lane, v_color);
            }
            deliver_group(base, group, drew, lane);
        }
    }
}
