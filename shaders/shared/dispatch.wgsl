// Needs: nothing
// Index of an invocation. A dispatch has at most 65535 groups per
// dimension, so long ones are folded into y.

const GROUP_SIZE: u32 = 256u;
const FOLD: u32 = 65535u;

fn group_index(workgroup: vec3u) -> u32 {
    return workgroup.y * FOLD + workgroup.x;
}
