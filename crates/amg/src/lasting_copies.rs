//! Copies of short-lived splats, for example of a whole dancer.
//!
//! A copy moves like its original, at its own place. If the original is one generation of a
//! surface, the copy would fade with it, and no later generation is there to replace it. Such
//! copies last: each follows its original extended over the whole clip, with the edit's opacity and
//! colours ([`RowKind::Copied`]).
//!
//! * Where the edit copied most of the later generations, too, the copies are complete. They stay
//!   exact copies, and fade in and out as their originals.
//! * Where it copied a few of them, these represent a surface that now lasts: they are hidden, or
//!   the surface would be there twice.
//! * A copy that lies exactly on its original, as densification makes it, is the original for the
//!   identity map. It fades, as later generations stand for both.

use crate::beside_copies::Companion;
use crate::carriers;
use crate::color_change::ColorChange;
use crate::generations::Generations;
use crate::identity::IdentityMap;
use crate::inheritance::Inherited;
use crate::row_index::index;
use crate::row_kind::RowKind;
use crate::work::Row;

/// Minimum presence over the clip, 0 to 1, from which a splat needs no replacement. Halving or
/// nearly doubling it changes nothing on generated scenes with lives of 0.05 to 1.5 clips: no splat
/// visible in frame 1 has a minimum presence between 0.25 and 1.
const LASTS: f64 = 0.5;

/// Marks the copies that last, and the splats that move with copies. Returns what hidden copies
/// inherit, and marks these as [`RowKind::Descendant`].
pub(crate) fn mark(
    generations: &Generations,
    identity: &IdentityMap,
    group_of: &[u32],
    beside: &[Companion],
    rows: &mut [Row],
) -> Vec<Inherited> {
    for companion in beside {
        rows[companion.row].0 = RowKind::Copied;
    }
    let num_sources = generations.lives.len();
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
                if !lasts(generations, id) {
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

/// Splats that are invisible in the edit frame and descend mainly from copied ones.
fn later_generations(generations: &Generations, copied: &[bool]) -> Vec<bool> {
    let descends = |ancestry: &crate::generations::Ancestry| {
        let from_copied = ancestry.of.iter().filter(|(id, _)| copied[*id as usize]);
        from_copied.map(|entry| entry.1).sum::<f32>() > 0.5
    };
    generations.ancestries.iter().map(descends).collect()
}

fn lasts(generations: &Generations, id: usize) -> bool {
    let lives = &generations.lives;
    (0..lives.times.len()).all(|k| lives.presence(k, id) >= LASTS)
}
