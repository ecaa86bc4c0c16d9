//! Change of the colour of a surface while it moves.

use crate::FlowField;
use crate::flow_field::Corners;
use gs_core::Image;

/// `Σ_{p∈V} ‖a(p) − b(p + F(p))‖² / (C·|V|)` of images `[H,W,C]`, `b` sampled bilinearly: data
/// range 1, usually stated ×10³. Its level depends on texture and flow; compare it with the value
/// of the scene before the edit. `V` is `visible` ([`FlowField::visible`]); `None` if it is empty
/// or shapes differ.
pub fn warp_error(a: &Image, b: &Image, flow: &FlowField, visible: &[bool]) -> Option<f64> {
    let [width, height] = flow.size();
    let shape = (width, height, a.channels);
    if (a.width, a.height, a.channels) != shape || (b.width, b.height, b.channels) != shape {
        return None;
    }
    let channels = a.channels;
    let (mut sum, mut count) = (0.0, 0_usize);
    for (p, _) in visible.iter().enumerate().filter(|(_, visible)| **visible) {
        let v = flow.vectors()[p];
        let (x, y) = ((p % width) as f32 + v[0], (p / width) as f32 + v[1]);
        let Some(corners) = Corners::of(x, y, width, height) else { continue };
        for c in 0..channels {
            let there: f32 =
                corners.0.iter().map(|(index, weight)| weight * b.data[index * channels + c]).sum();
            sum += f64::from(a.data[p * channels + c] - there).powi(2);
        }
        count += 1;
    }
    (count > 0).then(|| sum / (count * channels) as f64)
}
