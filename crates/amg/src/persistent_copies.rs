//! Copies of short-lived splats, for example of a whole dancer.
//!
//! A copy moves like its original, under the similarity of its group. If the original is
//! short-lived, the copy would fade with it, and there are no copies of the later generations to
//! replace it. Such copies are made persistent: each follows its original extended over the whole
//! clip, with the edit's opacity and colours ([`RowKind::Copied`]).
//!
//! * If the edit also copied most of the later generations, the copies are complete. They remain
//!   exact copies, and fade in and out with their originals.
//! * If it copied only a few of them, these are hidden: the persistent copies already represent
//!   their surface.
//! * The identity map does not distinguish a copy exactly at the position of its original, as
//!   densification produces it, from the original. It fades, because later generations replace
//!   both.

use crate::carriers;
use crate::color_change::ColorChange;
use crate::generations::Generations;
use crate::guide_input::Row;
use crate::identity::IdentityMap;
use crate::inheritance::Inherited;
use crate::near_copies::Companion;
use crate::row_index::index;
use crate::row_kind::RowKind;

/// Splats whose presence (0 to 1) never falls below this are persistent. Halving or nearly doubling
/// it changes nothing on generated scenes with lifetimes of 0.05 to 1.5 clips: no splat visible in
/// frame 1 has a minimum presence between 0.25 and 1.
const MIN_PERSISTENT_PRESENCE: f64 = 0.5;

/// Marks copies that are made persistent, and splats that move with copies. Returns what hidden
/// copies inherit, and marks these as [`RowKind::Descendant`].
pub(crate) fn mark(
    generations: &Generations,
    identity: &IdentityMap,
    group_of: &[u32],
    companions: &[Companion],
    rows: &mut [Row],
) -> Vec<Inherited> {
    for companion in companions {
        rows[companion.row].0 = RowKind::Copied;
    }
    let num_sources = generations.lifetimes.len();
    let mut hidden = Vec::new();
    for (number, is_copy) in (0..).zip(carriers::copies(identity, num_sources)) {
        if !is_copy {
            continue;
        }
        let mut copied = vec![false; num_sources];
        identity.members(number).for_each(|(_, id)| copied[id as usize] = true);
        let later = later_generations(generations, &copied);
        let found = (0..num_sources).filter(|&id| later[id]);
        let (all, there) =
            found.fold((0, 0), |(all, there), id| (all + 1, there + usize::from(copied[id])));
        if 2 * there >= all {
            continue;
        }
        for (row, id) in identity.members(number) {
            let id = id as usize;
            if generations.is_shown(id) {
                if !is_persistent(generations, id) {
                    rows[row].0 = RowKind::Copied;
                }
            } else if later[id] {
                rows[row].0 = RowKind::Descendant;
                hidden.push(Inherited {
                    row: index(row),
                    confidence: generations.ancestries[id].confidence,
                    opacity: 0.0,
                    color: ColorChange::NONE,
                    group: Some(group_of[row]),
                });
            }
        }
    }
    hidden
}

/// Flags of the splats that are invisible in the edit frame and descend mainly from copied ones,
/// `[N]`.
fn later_generations(generations: &Generations, copied: &[bool]) -> Vec<bool> {
    let descends = |ancestry: &crate::generations::Ancestry| {
        let from_copied = ancestry.of.iter().filter(|(id, _)| copied[*id as usize]);
        from_copied.map(|entry| entry.1).sum::<f32>() > 0.5
    };
    generations.ancestries.iter().map(descends).collect()
}

fn is_persistent(generations: &Generations, id: usize) -> bool {
    let lifetimes = &generations.lifetimes;
    (0..lifetimes.times.len()).all(|k| lifetimes.presence(k, id) >= MIN_PERSISTENT_PRESENCE)
}
