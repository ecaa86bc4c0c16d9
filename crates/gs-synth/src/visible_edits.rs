//! [`apply_visible_edits`]: the result of an editor that works only on images of frame 1.

use crate::{
    Edit, EditedFrame, SynthError, SynthScene,
    edit::{Draft, Removal, drafted},
    math::{rng, uniform},
    part::Tag,
    truth,
};
use gs_core::{Splats, sh};

/// Share of a splat's unoccluded weight that must be visible in some
/// image for the editor to change the splat.
pub const PICTURE_WEIGHT: f32 = 0.1;

/// Largest number of removal rounds; each may uncover splats for the next.
const ROUNDS: usize = 12;

/// Colour that an editor leaves on splats that its pictures do not show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum UnseenColor {
    /// The colour of the source.
    #[default]
    Source,
    /// Black, for splats that the edit changes or removes: their new colours start at black, and no
    /// picture changes them.
    Black,
    /// Random colours for these splats.
    Random,
}

/// As [`crate::apply_edits`], but splats that are hidden in the editor's images of frame 1 are not
/// changed: they keep the colour of the source splat from which they descend (or get a different
/// one, see `unseen`), and are not removed. `shown` returns the largest share of each splat's unoccluded
/// weight that is visible in any image, `[N]` in 0 to 1; it is called again after every round of
/// removal.
///
/// If an edit removes splats, rows differ from those of `apply_edits`. The truth has the true
/// motion of the returned splats, with their colours.
///
/// # Errors
/// As [`crate::apply_edits`], or if `shown` fails.
pub fn apply_visible_edits<E: From<SynthError>>(
    scene: &SynthScene,
    edits: &[Edit],
    seed: u64,
    unseen: UnseenColor,
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
    color_unseen(scene, &mut draft, &visible, unseen, seed);
    Ok(truth::finish(scene, draft))
}

/// Restores the source's colour of splats that are hidden in all images, or sets a meaningless one.
fn color_unseen(
    scene: &SynthScene,
    draft: &mut Draft,
    visible: &[f32],
    unseen: UnseenColor,
    seed: u64,
) {
    let coeffs = draft.splats.sh_coeffs();
    let mut rng = rng(seed, 90);
    for i in (0..draft.rows.len()).filter(|&i| visible[i] < PICTURE_WEIGHT) {
        let Some(source) = draft.source_rows[i] else { continue };
        let is_touched = draft.tags[i] != Tag::Unchanged || draft.removed[i];
        let own = &mut draft.splats.sh[i * coeffs..(i + 1) * coeffs];
        own.copy_from_slice(scene.frame1.sh_of(source as usize));
        let color = match unseen {
            UnseenColor::Black if is_touched => [0.0; 3],
            UnseenColor::Random if is_touched => [(); 3].map(|()| uniform(&mut rng, 0.0, 1.0)),
            _ => {
                if draft.tags[i] == Tag::Recoloured {
                    draft.tags[i] = Tag::Unchanged;
                }
                continue;
            }
        };
        own.fill([0.0; 3]);
        own[0] = sh::dc_from_rgb(color);
        if draft.tags[i] == Tag::Unchanged {
            draft.tags[i] = Tag::Recoloured;
        }
    }
}
