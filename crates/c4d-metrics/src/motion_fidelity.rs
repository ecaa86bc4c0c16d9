//! Difference between the motion of an edit and that of its source.

use crate::FlowField;

/// Mean distance of two rendered flows of the same size, pixels, over the pixels where both are
/// known and `mask` (`[H,W]`) equals `inside`; lower is better. `None` without such pixels.
pub fn motion_fidelity(
    edited: &FlowField,
    source: &FlowField,
    mask: &[bool],
    inside: bool,
) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for ((a, b), _) in edited
        .vectors()
        .iter()
        .zip(source.vectors())
        .zip(mask)
        .filter(|(_, masked)| **masked == inside)
    {
        let gap = (a[0] - b[0]).hypot(a[1] - b[1]);
        if gap.is_finite() {
            sum += f64::from(gap);
            count += 1;
        }
    }
    (count > 0).then(|| sum / count as f64)
}
