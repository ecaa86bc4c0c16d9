//! Whether an edit moves as its source does.

use crate::FlowField;

/// Mean distance of two rendered flows, pixels, over pixels where both are known and `mask` is
/// `inside`; less is better. `None` without such pixels.
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
