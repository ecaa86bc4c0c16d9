// Needs: shared/dispatch.wgsl, shared/frame.wgsl, shared/activation.wgsl, shared/sh.wgsl, variants/channels
// Opacity and channel values of each visible splat. One invocation = one splat of this chunk of the harmonics.
//
// In: stored parameters; `sh` of this chunk's splats, [chunk,K,3]; `features` [N,F]. Out: `colors` [N,CHANNELS] for the channels from
// `first_channel` on, padded with zeros; with the first channels also the opacity in `projected`, -1 for a splat whose colour,
// opacity or a feature is not finite: it draws nothing and has no gradient.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> means: array<f32>;
@group(0) @binding(2) var<storage, read> opacity_logits: array<f32>;
@group(0) @binding(3) var<storage, read> sh: array<f32>;
@group(0) @binding(4) var<storage, read> features: array<f32>;
@group(0) @binding(5) var<storage, read_write> projected: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> colors: array<f32>;

@compute @workgroup_size(256)
fn shade(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let within = group_index(workgroup) * GROUP_SIZE + lane;
    if within >= frame.num_chunk_splats {
        return;
    }
    let i = frame.first_splat + within;
    let depth = projected[2u * i + 1u].z;
    if projected[2u * i + 1u].w <= 0.0 {
        return;
    }
    var rgb = vec3f(0.0);
    if frame.first_channel == 0u {
        var opacity = sigmoid(opacity_logits[i]);
        if is_nan(opacity_logits[i]) {
            opacity = -1.0;
        }
        if frame.rgb == 1u {
            let mean = vec3f(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
            let y = sh_basis(frame.sh_degree, sh_direction(mean, frame.camera_pos));
            let coeffs = (frame.sh_degree + 1u) * (frame.sh_degree + 1u);
            rgb = vec3f(0.5);
            for (var k = 0u; k < coeffs; k++) {
                let at = 3u * (within * coeffs + k);
                rgb += y[k] * vec3f(sh[at], sh[at + 1u], sh[at + 2u]);
            }
            // Before the clamp, which would hide minus infinity.
            if !is_finite3(rgb) {
                opacity = -1.0;
            }
            rgb = max(rgb, vec3f(0.0));
        }
        for (var f = 0u; f < frame.num_features; f++) {
            if !is_finite(features[i * frame.num_features + f]) {
                opacity = -1.0;
            }
        }
        projected[2u * i + 1u].y = opacity;
    }
    let own = 3u * frame.rgb + frame.depth;
    for (var k = 0u; k < CHANNELS; k++) {
        let channel = frame.first_channel + k;
        var value = 0.0;
        if channel < 3u * frame.rgb {
            value = rgb[channel];
        } else if channel < own {
            value = depth;
        } else if channel - own < frame.num_features {
            value = features[i * frame.num_features + channel - own];
        }
        colors[i * CHANNELS + k] = value;
    }
}
