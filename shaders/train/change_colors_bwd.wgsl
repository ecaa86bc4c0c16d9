// Needs: shared/dispatch.wgsl, shared/sh.wgsl, train/offsets.wgsl
// Backward of `change_colors`. One invocation = one entry; no two have the same row.
//
// In: `entries`; `changes` [entries,3]; `v_features` [N,3]. Out, for entries with rows of this
// dispatch: `v_sh` [rows,K,3] from `first_row`.

@group(0) @binding(0) var<uniform> offsets: Offsets;
@group(0) @binding(1) var<storage, read> entries: array<Entry>;
@group(0) @binding(2) var<storage, read> changes: array<f32>;
@group(0) @binding(3) var<storage, read> v_features: array<f32>;
@group(0) @binding(4) var<storage, read_write> v_sh: array<f32>;

@compute @workgroup_size(256)
fn change_colors_bwd(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
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
    for (var c = 0u; c < 3u; c++) {
        // A colour clamped at 0 has no derivative.
        var v_color = 0.0;
        if entry.color[c] + changes[3u * k + c] >= 0.0 {
            v_color = v_features[3u * entry.splat + c];
        }
        for (var i = 0u; i < coeffs; i++) {
            v_sh[first + 3u * i + c] = y[i] * v_color;
        }
    }
}
