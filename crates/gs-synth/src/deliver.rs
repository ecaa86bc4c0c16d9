//! [`deliver`]: the result of an editor that works only on images of frame 1.

use crate::{
    Edit, EditedFrame, SynthError, SynthScene,
    edit::{Draft, Removal, drafted},
    part::Tag,
    truth,
};
use gs_core::Splats;

/// Share of a splat's unoccluded weight that must be visible in some
/// image for the editor to change the splat.
pub const PICTURE_WEIGHT: f32 = 0.1;

/// Largest number of removal rounds; each may uncover splats for the next.
const ROUNDS: usize = 12;

/// As [`crate::apply_edits`], but splats that are hidden in the editor's images of frame 1 are not
/// changed: they keep the colour of the source splat from which they descend, and are not removed.
/// `shown` returns the largest share of each splat's unoccluded weight that is visible in any
/// image, `[N]` in 0 to 1; it is called again after every round of removal.
///
/// If an edit removes splats, rows differ from those of `apply_edits`. The truth has the true
/// motion of the returned splats, with their colours.
///
/// # Errors
/// As [`crate::apply_edits`], or if `shown` fails.
pub fn deliver<E: From<SynthError>>(
    scene: &SynthScene,
    edits: &[Edit],
    seed: u64,
    mut shown: impl FnMut(&Splats) -> Result<Vec<f32>, E>,
) -> Result<EditedFrame, E> {
    let mut draft = drafted(scene, edits, seed, Removal::Marked)?;
    let mut visible = shown(&draft.splats)?;
    for _ in 0..ROUNDS {
        let found: Vec<bool> = (0..draft.rows.len())
            .map(|i| draft.removed[i] && visible[i] >= PICTURE_WEIGHT)
            .collect();
        if !found.contains(&true) {
            break;
        }
        draft.retain(|i| !found[i]);
        visible = shown(&draft.splats)?;
    }
    keep_unseen(scene, &mut draft, &visible);
    Ok(truth::finish(scene, draft))
}

/// Restores the source's colour of splats that are hidden in all images.
fn keep_unseen(scene: &SynthScene, draft: &mut Draft, visible: &[f32]) {
    let coeffs = draft.splats.sh_coeffs();
    for i in (0..draft.rows.len()).filter(|&i| visible[i] < PICTURE_WEIGHT) {
        let Some(source) = draft.source_rows[i] else { continue };
        let own = &mut draft.splats.sh[i * coeffs..(i + 1) * coeffs];
        own.copy_from_slice(scene.frame1.sh_of(source as usize));
        if draft.tags[i] == Tag::Recoloured {
            draft.tags[i] = Tag::Unchanged;
        }
    }
}
