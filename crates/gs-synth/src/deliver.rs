//! [`deliver`]: an edit as an editor leaves it that only sees pictures of frame 1.

use crate::{
    Edit, EditedFrame, SynthError, SynthScene,
    edit::{Draft, Removal, drafted},
    part::Tag,
    truth,
};
use gs_core::Splats;

/// Share of a splat's unoccluded weight that some picture must show for the editor to change the
/// splat.
pub const PICTURE_WEIGHT: f32 = 0.1;

/// Most rounds of removal: each may uncover splats for the next.
const ROUNDS: usize = 12;

/// As [`crate::apply_edits`], but splats that the editor's pictures of frame 1 do not show keep
/// what they had: the source's colour, where they descend from a source splat, and their existence,
/// where the edit removes them. `shown` gives the largest share of each splat's unoccluded weight
/// that any picture shows, `[N]` in 0 to 1, for splats as they are then; it is asked again after
/// every round of removal.
///
/// Rows are not those of `apply_edits` where an edit removes something. The truth has the true
/// motion of these splats, with these colours.
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
            .map(|i| draft.doomed[i] && visible[i] >= PICTURE_WEIGHT)
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

/// Gives splats that no picture shows their source's colour back.
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
