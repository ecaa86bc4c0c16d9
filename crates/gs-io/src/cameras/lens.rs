//! Pinhole intrinsics with OpenCV's distortion. The distortion is measured and ignored, because
//! splats are rendered with pinhole cameras.

use gs_core::Intrinsics;

/// Intrinsics for images of `width × height` pixels; pixel centres at half-integers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lens {
    pub(crate) intrinsics: Intrinsics,
    pub(crate) width: f64,
    pub(crate) height: f64,
    /// OpenCV's k1 k2 k3, numerator.
    pub(crate) radial: [f64; 3],
    /// OpenCV's k4 k5 k6, denominator.
    pub(crate) rational: [f64; 3],
    /// OpenCV's p1 p2.
    pub(crate) tangential: [f64; 2],
}

impl Lens {
    pub(crate) fn pinhole(intrinsics: Intrinsics, width: f64, height: f64) -> Self {
        Self {
            intrinsics,
            width,
            height,
            radial: [0.0; 3],
            rational: [0.0; 3],
            tangential: [0.0; 2],
        }
    }

    /// Largest displacement of a point of the image border by the distortion, pixels.
    pub(crate) fn bend_px(&self) -> f64 {
        let k = &self.intrinsics;
        let shares = [0.0, 0.5, 1.0];
        let mut longest = 0.0_f64;
        for (i, j) in shares.iter().flat_map(|i| shares.iter().map(move |j| (i, j))) {
            let x = (i * self.width - k.cx) / k.fx;
            let y = (j * self.height - k.cy) / k.fy;
            let r2 = x * x + y * y;
            let power = |c: &[f64; 3]| r2 * (c[0] + r2 * (c[1] + r2 * c[2]));
            let scale = (1.0 + power(&self.radial)) / (1.0 + power(&self.rational));
            let [p1, p2] = self.tangential;
            let dx = x * (scale - 1.0) + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
            let dy = y * (scale - 1.0) + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
            longest = longest.max((k.fx * dx).hypot(k.fy * dy));
        }
        longest
    }

    /// The same lens for images of a different size.
    pub(crate) fn resized(&self, width: f64, height: f64) -> Self {
        let (sx, sy) = (width / self.width, height / self.height);
        let k = self.intrinsics;
        Self {
            intrinsics: Intrinsics { fx: k.fx * sx, fy: k.fy * sy, cx: k.cx * sx, cy: k.cy * sy },
            width,
            height,
            ..*self
        }
    }

    /// The same lens with the principal point in the image centre.
    pub(crate) fn centred(&self) -> Self {
        let (cx, cy) = (self.width / 2.0, self.height / 2.0);
        Self { intrinsics: Intrinsics { cx, cy, ..self.intrinsics }, ..*self }
    }

    /// Distance from the image centre to the principal point, pixels.
    pub(crate) fn off_centre_px(&self) -> f64 {
        (self.intrinsics.cx - self.width / 2.0).hypot(self.intrinsics.cy - self.height / 2.0)
    }
}

/// Ignored properties of a set of lenses, for notes: the largest of each kind.
#[derive(Debug, Default)]
pub(crate) struct LeftOut {
    bend_px: f64,
    bent: String,
    off_centre_px: f64,
    off_centre: String,
}

/// Displacements below this are not noted, pixels.
const NOTABLE_PX: f64 = 0.05;

impl LeftOut {
    /// Records the distortion of a lens, which is always ignored.
    pub(crate) fn distortion(&mut self, name: &str, lens: &Lens) {
        let bend = lens.bend_px();
        if bend > self.bend_px {
            self.bend_px = bend;
            name.clone_into(&mut self.bent);
        }
    }

    /// Records the principal point of a lens that is being centred.
    pub(crate) fn principal_point(&mut self, name: &str, lens: &Lens) {
        let off = lens.off_centre_px();
        if off > self.off_centre_px {
            self.off_centre_px = off;
            name.clone_into(&mut self.off_centre);
        }
    }

    pub(crate) fn notes(self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.bend_px > NOTABLE_PX {
            notes.push(format!(
                "lens distortion is ignored: up to {:.1} px at the image border ({}); undistort \
                the images before comparing with them",
                self.bend_px, self.bent
            ));
        }
        if self.off_centre_px > NOTABLE_PX {
            notes.push(format!(
                "principal points are set to the image centres, as in training; they differ by up \
                to {:.1} px ({})",
                self.off_centre_px, self.off_centre
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens() -> Lens {
        let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 50.0, cy: 40.0 };
        Lens::pinhole(intrinsics, 100.0, 80.0)
    }

    #[test]
    fn displacement_is_that_of_the_farthest_corner() {
        assert_eq!(lens().bend_px(), 0.0, "a pinhole has no distortion");
        let bent = Lens { radial: [0.1, 0.0, 0.0], ..lens() };
        // Corner at (0.5, 0.4): r² = 0.41, moved by r·0.1·r² = 0.02625 of the focal length.
        assert!((bent.bend_px() - 100.0 * 0.1 * 0.41_f64.powf(1.5)).abs() < 1e-12, "corner");
        let mut left_out = LeftOut::default();
        left_out.distortion("a", &bent);
        left_out.principal_point("b", &lens().centred());
        let notes = left_out.notes();
        assert_eq!(notes.len(), 1, "centred lenses need no note: {notes:?}");
        assert!(notes[0].contains("2.6 px") && notes[0].contains("(a)"), "{notes:?}");
    }

    #[test]
    fn resizing_keeps_the_view() {
        let half = lens().resized(50.0, 40.0);
        assert_eq!(half.intrinsics, Intrinsics { fx: 50.0, fy: 50.0, cx: 25.0, cy: 20.0 }, "half");
    }
}
