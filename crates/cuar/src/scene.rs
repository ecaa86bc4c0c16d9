//! [`OffsetScene`]: a scene with the refined colours.

use gs_core::{DynamicScene, SceneError, Splats, TimeRange};

/// A dynamic scene in which some rows have a constant offset of SH and some rows are invisible.
#[derive(Debug, Clone)]
pub struct OffsetScene<'a> {
    scene: &'a dyn DynamicScene,
    rows: &'a [u32],
    d_sh: &'a [[f32; 3]],
    faded: &'a [u32],
}

impl<'a> OffsetScene<'a> {
    /// `rows` of `scene` with `d_sh` (`[rows,K,3]`) added at every time, and the rows `faded`
    /// invisible.
    pub(crate) fn new(
        scene: &'a dyn DynamicScene,
        rows: &'a [u32],
        d_sh: &'a [[f32; 3]],
        faded: &'a [u32],
    ) -> Self {
        Self { scene, rows, d_sh, faded }
    }
}

/// Adds offsets to rows; rows whose offset is zero keep every bit.
pub(crate) fn add(splats: &mut Splats, rows: &[u32], d_sh: &[[f32; 3]]) {
    let coeffs = splats.sh_coeffs();
    for (k, &row) in rows.iter().enumerate() {
        let row = row as usize;
        let stored = &mut splats.sh[row * coeffs..(row + 1) * coeffs];
        for (rgb, change) in stored.iter_mut().zip(&d_sh[k * coeffs..]) {
            for channel in 0..3 {
                // −0 + 0 is +0: not the same bits
                if change[channel] != 0.0 {
                    rgb[channel] += change[channel];
                }
            }
        }
    }
}

/// Opacity logit of rows that fade ([`crate::Refined::faded`]): below the faintest alpha that is
/// drawn.
pub const FADED_LOGIT: f32 = -12.0;

/// Makes `rows` invisible.
pub(crate) fn fade(splats: &mut Splats, rows: &[u32]) {
    for &row in rows {
        splats.opacity_logits[row as usize] = FADED_LOGIT;
    }
}

impl DynamicScene for OffsetScene<'_> {
    fn num_splats(&self) -> usize {
        self.scene.num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.scene.sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        self.scene.time_range()
    }

    fn num_frames(&self) -> Option<usize> {
        self.scene.num_frames()
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.at_into(t, out)?;
        add(out, self.rows, self.d_sh);
        fade(out, self.faded);
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.geometry_into(t, out)
    }

    fn fades(&self) -> bool {
        self.scene.fades()
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.scene.dynamic_mask()
    }
}
