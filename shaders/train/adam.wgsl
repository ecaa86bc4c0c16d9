// Needs: shared/dispatch.wgsl
// Adam (Kingma & Ba 2015) over rows of parameters, with a rate per column and a flag that skips
// rows. One invocation = one value.
//
// In: `grads` [rows,columns] from `first_grad`; `rates` [columns]; `skip`, one flag per splat, read
// from `first_row` if `skips`. In and out: `params`, `m`, `v` [rows,columns]. A skipped row keeps
// value and moments, bit for bit.

struct AdamStep {
    num_values: u32,
    columns: u32,
    first_grad: u32,
    first_row: u32,
    skips: u32,
    beta1: f32,
    beta2: f32,
    // 1 - beta, and 1 - beta^step: rounded once, by the host.
    rest1: f32,
    rest2: f32,
    correct1: f32,
    correct2: f32,
    epsilon: f32,
}

@group(0) @binding(0) var<uniform> adam: AdamStep;
@group(0) @binding(1) var<storage, read> grads: array<f32>;
@group(0) @binding(2) var<storage, read> rates: array<f32>;
@group(0) @binding(3) var<storage, read> skip: array<u32>;
@group(0) @binding(4) var<storage, read_write> params: array<f32>;
@group(0) @binding(5) var<storage, read_write> m: array<f32>;
@group(0) @binding(6) var<storage, read_write> v: array<f32>;

@compute @workgroup_size(256)
fn adam_step(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(workgroup) * GROUP_SIZE + lane;
    if k >= adam.num_values {
        return;
    }
    if adam.skips == 1u && skip[adam.first_row + k / adam.columns] != 0u {
        return;
    }
    let g = grads[adam.first_grad + k];
    let first = adam.beta1 * m[k] + adam.rest1 * g;
    let second = adam.beta2 * v[k] + adam.rest2 * g * g;
    m[k] = first;
    v[k] = second;
    let scale = sqrt(second / adam.correct2) + adam.epsilon;
    params[k] -= rates[k % adam.columns] * (first / adam.correct1) / scale;
}
