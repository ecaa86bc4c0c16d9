//! Hash of the inputs of a fit, for checkpoints.

use crate::{EditedPicture, FitOptions};
use gs_core::Splats;

/// FNV-1a, 64 bits.
struct Fnv(u64);

impl Fnv {
    fn bytes(&mut self, bytes: impl IntoIterator<Item = u8>) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn floats(&mut self, values: &[f32]) {
        self.bytes((values.len() as u64).to_le_bytes());
        for value in values {
            self.0 = (self.0 ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// Hash of the inputs and options, without the intervals of previews and checkpoints.
pub(crate) fn of(start: &Splats, pictures: &[EditedPicture], options: &FitOptions) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    hash.floats(start.means.as_flattened());
    hash.floats(start.quats.as_flattened());
    hash.floats(start.log_scales.as_flattened());
    hash.floats(&start.opacity_logits);
    hash.floats(start.sh.as_flattened());
    for picture in pictures {
        hash.floats(&picture.image.data);
        let mask = picture.mask.as_deref().unwrap_or_default();
        hash.bytes(mask.iter().map(|&on| u8::from(on)));
        hash.bytes(format!("{:?}", picture.camera).into_bytes());
    }
    let timeless = FitOptions { preview_secs: None, checkpoint_secs: 0.0, ..options.clone() };
    hash.bytes(format!("{timeless:?}").into_bytes());
    hash.0
}
