// Needs: shared/frame.wgsl, shared/tile.wgsl, shared/tile_backward.wgsl and the variants
// Backward of `rasterize`, back to front. One group = one tile, one lane = 2x2 pixels; each group of entries is summed over the tile.
//
// With g the upstream gradient, sigma_i = sum_ch g f_i and R_i = sum over entries k behind i of alpha_k T_k sigma_k:
//   dL/dalpha_i = T_i sigma_i - (R_i + T_final (background . g_rgb - g_alpha)) / (1 - alpha_i).
// The last term belongs to the first channels only. T_i is restored from the final transmittance.

@group(0) @binding(4) var<storage, read> colors: array<Color>;

fn sum4(v: vec4f) -> f32 {
    return (v.x + v.y) + (v.z + v.w);
}

fn backward_tile(tile: vec2u, lane: u32) {
    let block = block_of(frame, tile, lane);
    let first = tile_ranges[2u * (tile.y * frame.tile_bounds.x + tile.x)];
    let walked = open_tile(block, lane);
    let x = vec4f(block.x);
    let y = vec4f(block.y);

    var rest = vec4f(0.0);
    if frame.first_channel == 0u {
        for (var k = 0u; k < 4u; k++) {
            if block.inside[k] {
                var through = -v_image[frame.alpha_base + block.pixel[k]];
                if frame.rgb == 1u {
                    through += dot(v_out[k].a.xyz, frame.background);
                }
                rest[k] = final_t[k] * through;
            }
        }
    }
    // `rest` holds R_i plus the last term from here on.
    var transmittance = final_t;

    var end = walked;
    while end > 0u {
        let count = min(TILE_LANES, end);
        let start = end - count;
        // The entries staged before have been read.
        workgroupBarrier();
        if lane < count {
            let entry = entries[first + start + lane];
            stage_entry(lane, entry, projected[2u * entry.x], projected[2u * entry.x + 1u]);
        }
        workgroupBarrier();
        var top = count;
        while top > 0u {
            let group = min(SUM_ENTRIES, top);
            let base = top - group;
            var drew = false;
            for (var step = 0u; step < group; step++) {
                let j = top - 1u - step;
                var v_near = vec4f(0.0);
                var v_far = vec4f(0.0);
                var v_color: Color;
                let near = stage_near[j];
                let far = stage_far[j];
                let dx = near.x - x;
                let dy = near.y - y;
                let p = exponent(near, far, dx, dy);
                let candidate = (vec4u(start + j) < last_ids) & (p >= vec4f(far.z)) & (p <= vec4f(0.0));
                if any(candidate) {
                    // The conic of a very thin splat may be indefinite by rounding: elsewhere p may be large, and infinity times 0 is NaN.
                    let falloff = exp(min(p, vec4f(0.0)));
                    let raw = far.y * falloff;
                    let alpha = min(vec4f(MAX_ALPHA), raw);
                    let drawn = candidate & (alpha >= vec4f(ALPHA_THRESHOLD));
                    if any(drawn) {
                        drew = true;
                        let inverse = 1.0 / (1.0 - alpha);
                        let before = transmittance * inverse;
                        let weight = select(vec4f(0.0), alpha * before, drawn);
                        let color = colors[stage_ids[j].x];
                        let sigma = vec4f(
                            color_dot(color, v_out[0]), color_dot(color, v_out[1]),
                            color_dot(color, v_out[2]), color_dot(color, v_out[3]),
                        );
                        v_color = weigh_upstream(weight);
                        var v_alpha = select(vec4f(0.0), before * sigma - rest * inverse, drawn);
                        rest += weight * sigma;
                        transmittance = select(transmittance, before, drawn);
                        if frame.exact_gradients == 1u {
                            // Where opacity is capped, the true derivative is zero; the reference passes the gradient on.
                            v_alpha = select(v_alpha, vec4f(0.0), raw > vec4f(MAX_ALPHA));
                        }
                        let v_p = raw * v_alpha;
                        v_near = vec4f(
                            -sum4((near.z * dx + near.w * dy) * v_p),
                            -sum4((near.w * dx + far.x * dy) * v_p),
                            -0.5 * sum4(dx * dx * v_p),
                            -sum4(dx * dy * v_p),
                        );
                        v_far.x = -0.5 * sum4(dy * dy * v_p);
                        v_far.y = sum4(falloff * v_alpha);
                    }
                }
                put_quad((j - base) * ENTRY_QUADS, lane, v_near);
                put_quad((j - base) * ENTRY_QUADS + 1u, lane, v_far);
                put_color(j - base, lane, v_color);
            }
            deliver_group(base, group, drew, lane);
            top = base;
        }
        end = start;
    }
}
