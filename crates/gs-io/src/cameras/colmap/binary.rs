//! `cameras.bin` and `images.bin`: little-endian records behind a 64-bit count.

use super::{ColmapCamera, ColmapImage, lens_models::MODELS};
use crate::cameras::CamerasError;

/// Smallest size of a camera, bytes: id, model, width, height, two parameters.
const MIN_CAMERA: u64 = 4 + 4 + 8 + 8 + 2 * 8;
/// Smallest size of an image, bytes: id, quaternion,
/// translation, camera, empty name, count of points.
const MIN_IMAGE: u64 = 4 + 4 * 8 + 3 * 8 + 4 + 1 + 8;
/// Bytes of a point of an image.
const POINT: u64 = 24;

struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: u64, at: impl Fn() -> String) -> Result<&'a [u8], CamerasError> {
        let taken =
            usize::try_from(count).ok().and_then(|count| self.bytes.split_at_checked(count));
        let Some((taken, rest)) = taken else {
            return Err(CamerasError::Truncated {
                at: at(),
                needed: count,
                left: self.bytes.len(),
            });
        };
        self.bytes = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, at: impl Fn() -> String) -> Result<[u8; N], CamerasError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N as u64, at)?);
        Ok(array)
    }

    fn u32(&mut self, at: impl Fn() -> String) -> Result<u32, CamerasError> {
        Ok(u32::from_le_bytes(self.array(at)?))
    }

    fn u64(&mut self, at: impl Fn() -> String) -> Result<u64, CamerasError> {
        Ok(u64::from_le_bytes(self.array(at)?))
    }

    fn f64(&mut self, at: impl Fn() -> String) -> Result<f64, CamerasError> {
        Ok(f64::from_le_bytes(self.array(at)?))
    }

    /// A count of records of at least `size` bytes each, checked against the bytes left.
    fn count(&mut self, what: &str, size: u64) -> Result<u64, CamerasError> {
        let count = self.u64(|| format!("the count of {what}"))?;
        if count > self.bytes.len() as u64 / size {
            return Err(CamerasError::Truncated {
                at: format!("{count} {what}"),
                needed: count.saturating_mul(size),
                left: self.bytes.len(),
            });
        }
        Ok(count)
    }
}

/// Parses a `cameras.bin`.
///
/// # Errors
/// If the bytes end early or a camera has an unknown model.
pub fn parse_cameras_bin(bytes: &[u8]) -> Result<Vec<ColmapCamera>, CamerasError> {
    let mut reader = Reader { bytes };
    let count = reader.count("cameras", MIN_CAMERA)?;
    (0..count)
        .map(|index| {
            let at = || format!("camera {} of {count}", index + 1);
            let id = reader.u32(at)?;
            let number = reader.u32(at)?;
            let (model, params) = usize::try_from(number)
                .ok()
                .and_then(|number| MODELS.get(number).copied())
                .ok_or_else(|| {
                    CamerasError::malformed(at(), "a lens model from 0 to 17", number)
                })?;
            let (width, height) = (reader.u64(at)?, reader.u64(at)?);
            let params = (0..params).map(|_| reader.f64(at)).collect::<Result<_, _>>()?;
            Ok(ColmapCamera { id, model, width, height, params })
        })
        .collect()
}

/// Parses an `images.bin`, without the observed points.
///
/// # Errors
/// If the bytes end early.
pub fn parse_images_bin(bytes: &[u8]) -> Result<Vec<ColmapImage>, CamerasError> {
    let mut reader = Reader { bytes };
    let count = reader.count("images", MIN_IMAGE)?;
    (0..count)
        .map(|index| {
            let at = || format!("image {} of {count}", index + 1);
            let id = reader.u32(at)?;
            let mut numbers = [0.0; 7];
            for number in &mut numbers {
                *number = reader.f64(at)?;
            }
            let [w, x, y, z, tx, ty, tz] = numbers;
            let camera_id = reader.u32(at)?;
            let length = reader.bytes.iter().position(|byte| *byte == 0).ok_or_else(|| {
                CamerasError::malformed(at(), "a name that ends with a zero byte", "no zero byte")
            })?;
            let name = reader.take(length as u64, at)?;
            reader.take(1, at)?;
            let points = reader.u64(at)?;
            reader.take(points.saturating_mul(POINT), at)?;
            Ok(ColmapImage {
                id,
                quat: [w, x, y, z],
                translation: [tx, ty, tz],
                camera_id,
                name: String::from_utf8_lossy(name).into_owned(),
            })
        })
        .collect()
}
