// Needs: shared/dispatch.wgsl, shared/sh.wgsl, train/offsets.wgsl
// Change of the colours of visible splats due to offsets of their
// harmonics. One invocation = one entry.
//
// In: `entries`; `d_sh` [rows,K,3] from `first_row`. Out, for entries with such rows: `changes`
// [entries,3], before the clamp at 0; `features` [N,3], after it.

@group(0) @binding(0) var<uniform> offsets: Offsets;
@group(0) @binding(1) var<storage, read> entries: array<Entry>;
@group(0) @binding(2) var<storage, read> d_sh: array<f32>;
@group(0) @binding(3) var<storage, read_write> changes: array<f32>;
@group(0) @binding(4) var<storage, read_write> features: array<f32>;

@compute @workgroup_size(256)
fn change_colors(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(workgroup) * GROUP_SIZE + lane;
    if k >= offsets.num_entries {
        return;
    }
    let entry = entries[k];
    if entry.row < offsets.first_row || entry.row - offsets.first_row >= offsets.num_rows {
        return;
    }
    let y = sh_basis(offsets.sh_degree, entry.towards);
    let coeffs = (offsets.sh_degree + 1u) * (offsets.sh_degree + 1u);
    let first = 3u * coeffs * (entry.row - offsets.first_row);
    var change = vec3f(0.0);
    for (var i = 0u; i < coeffs; i++) {
        let at = first + 3u * i;
        change += y[i] * vec3f(d_sh[at], d_sh[at + 1u], d_sh[at + 2u]);
    }
    let clamped = max(entry.color + change, vec3f(0.0)) - max(entry.color, vec3f(0.0));
    for (var c = 0u; c < 3u; c++) {
        changes[3u * k + c] = change[c];
        features[3u * entry.splat + c] = clamped[c];
    }
}
