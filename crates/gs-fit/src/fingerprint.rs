//! Hash of the inputs of a fit, for checkpoints.

use crate::{EditedPicture, FitOptions};
use gs_core::{Fnv1a, Splats};

fn floats(hash: &mut Fnv1a, values: &[f32]) {
    hash.bytes((values.len() as u64).to_le_bytes());
    for value in values {
        hash.word(value.to_bits().into());
    }
}

/// Hash of the inputs and options, without the intervals of previews and checkpoints.
pub(crate) fn of(start: &Splats, pictures: &[EditedPicture], options: &FitOptions) -> u64 {
    let mut hash = Fnv1a::default();
    floats(&mut hash, start.means.as_flattened());
    floats(&mut hash, start.quats.as_flattened());
    floats(&mut hash, start.log_scales.as_flattened());
    floats(&mut hash, &start.opacity_logits);
    floats(&mut hash, start.sh.as_flattened());
    for picture in pictures {
        floats(&mut hash, &picture.image.data);
        let mask = picture.mask.as_deref().unwrap_or_default();
        hash.bytes(mask.iter().map(|&on| u8::from(on)));
        hash.bytes(format!("{:?}", picture.camera).into_bytes());
    }
    let timeless = FitOptions { preview_secs: None, checkpoint_secs: 0.0, ..options.clone() };
    hash.bytes(format!("{timeless:?}").into_bytes());
    hash.finish()
}
