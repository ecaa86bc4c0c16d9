//! COLMAP's lens models: their numbers, names and parameters.

use super::ColmapCamera;
use crate::cameras::CamerasError;
use crate::cameras::lens::Lens;
use gs_core::Intrinsics;

/// Name and number of parameters, by model number.
pub(super) const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

/// The model of this name.
pub(super) fn by_name(name: &str) -> Option<(&'static str, usize)> {
    MODELS.into_iter().find(|(known, _)| *known == name)
}

impl ColmapCamera {
    /// The pinhole part with its distortion.
    pub(crate) fn lens(&self) -> Result<Lens, CamerasError> {
        let p = &self.params;
        let one_focal = |f: f64, cx: f64, cy: f64| Intrinsics { fx: f, fy: f, cx, cy };
        let (intrinsics, radial, rational, tangential) = match (self.model, p.as_slice()) {
            ("SIMPLE_PINHOLE", &[f, cx, cy]) => {
                (one_focal(f, cx, cy), [0.0; 3], [0.0; 3], [0.0; 2])
            }
            ("PINHOLE", &[fx, fy, cx, cy]) => {
                (Intrinsics { fx, fy, cx, cy }, [0.0; 3], [0.0; 3], [0.0; 2])
            }
            ("SIMPLE_RADIAL", &[f, cx, cy, k]) => {
                (one_focal(f, cx, cy), [k, 0.0, 0.0], [0.0; 3], [0.0; 2])
            }
            ("RADIAL", &[f, cx, cy, k1, k2]) => {
                (one_focal(f, cx, cy), [k1, k2, 0.0], [0.0; 3], [0.0; 2])
            }
            ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
                (Intrinsics { fx, fy, cx, cy }, [k1, k2, 0.0], [0.0; 3], [p1, p2])
            }
            ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
                (Intrinsics { fx, fy, cx, cy }, [k1, k2, k3], [k4, k5, k6], [p1, p2])
            }
            _ => {
                return Err(CamerasError::Lens {
                    camera: self.id.to_string(),
                    model: self.model.to_owned(),
                });
            }
        };
        let lens = Lens::pinhole(intrinsics, self.width as f64, self.height as f64);
        Ok(Lens { radial, rational, tangential, ..lens })
    }
}
