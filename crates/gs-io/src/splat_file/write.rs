//! Writing `.splat`.

use crate::bytes8::{channel_of, unorm8};
use crate::content::splat_rows::ROW;
use crate::format_losses::FormatLosses;
use gs_core::{Splats, quat};
use rayon::prelude::*;
use std::io::{self, Write};

/// Writes a `.splat` frame and returns the losses.
///
/// # Errors
/// If the arrays of `splats` have inconsistent lengths ([`io::ErrorKind::InvalidInput`]) or writing
/// fails.
pub fn write(splats: &Splats, out: &mut impl Write) -> io::Result<FormatLosses> {
    splats.check_shapes().map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
    let rows: Vec<[u8; ROW]> =
        (0..splats.len()).into_par_iter().map(|i| format_row(splats, i)).collect();
    out.write_all(rows.as_flattened())?;
    let mut losses = FormatLosses::none();
    if splats.sh_degree > 0 {
        losses.push(format!(
            "SH degree {} becomes 0: colour no longer depends on the view",
            splats.sh_degree
        ));
    }
    losses.push(
        "colour, opacity and rotation have 8 bits: ±1/510 of full scale, rotations within 2°",
    );
    let clipped = |dc: &f32| !(0.0..=1.0).contains(&channel_of(*dc));
    let coeffs = splats.sh_coeffs();
    let count = splats.sh.iter().step_by(coeffs).filter(|dc| dc.iter().any(clipped)).count();
    if count > 0 {
        losses.push(format!("colours of {count} splats outside 0 to 1 are clipped"));
    }
    Ok(losses)
}

fn format_row(splats: &Splats, i: usize) -> [u8; ROW] {
    let mut row = [0; ROW];
    for (axis, value) in splats.means[i].into_iter().chain(splats.scale(i)).enumerate() {
        row[4 * axis..][..4].copy_from_slice(&value.to_le_bytes());
    }
    for channel in 0..3 {
        row[24 + channel] = unorm8(channel_of(splats.sh_of(i)[0][channel]));
    }
    row[27] = unorm8(splats.opacity(i));
    let q = quat::normalize(splats.quats[i]);
    for (component, value) in q.into_iter().enumerate() {
        // 127/128 is the largest value; 1 cannot be stored.
        row[28 + component] = unorm8((value * 128.0 + 128.0) / 255.0);
    }
    row
}
