//! Identification of edited splats with source splats.

mod exact;
mod moved;
mod row;
mod signature;
mod stored;
mod tolerance;

pub use row::Identity;

use crate::AmgError;
use crate::options::IdentityParams;
use crate::row_index::index;
use crate::similarity::Similarity;
use gs_core::Splats;
use tolerance::match_by_tolerance;

/// Relation of every edited splat to the source splats, by value, for any order of rows.
///
/// First by bits (`−0` equals `0`), in the order: all fields, geometry. Rows with equal bits are
/// paired in order, each source once while there are enough sources. Then, for the remaining rows,
/// the nearest source splats are compared within tolerances:
///
/// * mean: 2e-6 of its largest coordinate (text PLY), or 1e-3 of the middle standard deviation;
/// * shape: quaternions within 2e-3 rad for any sign and norm, and scales within 1e-3; or, because
///   editors reorder axes, sorted scales within 1e-3 and covariances within 5e-3;
/// * opacity: 2e-3 after the sigmoid (editors clamp logits); colour: 1e-3 per SH coefficient,
///   missing degrees count as 0.
///
/// [`IdentityParams::tolerance`] scales all of them.
///
/// With [`IdentityParams::precision`], the comparison by bits is replaced: a row is identified with
/// the source splat that agrees with it in every stored value within the precision of the file
/// format, the nearest one if there are several. Values that the format does not store are not
/// compared. The tolerances above apply to the remaining rows.
///
/// Of the rows that remain, groups of at least eight are identified as moved source splats
/// ([`Identity::Moved`]) if they share a signature (proportions, opacity, base colour) with source
/// splats and one similarity maps the source positions to theirs. This covers selections that an
/// editor moved, rotated and scaled, with or without rotating and scaling the splats themselves,
/// and whole scenes saved with different axes. Residuals of the similarity are below 4e-6 of the
/// largest coordinate or 2e-3 of the middle standard deviation, plus the rounding of the file
/// format.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentityMap {
    /// One entry per edited splat, `[M]`.
    pub rows: Vec<Identity>,
    /// Source splats without an identical edited splat, ascending.
    pub removed: Vec<u32>,
    /// Number of [`Identity::Unchanged`] rows.
    pub unchanged: usize,
    /// Number of [`Identity::Recolored`] rows.
    pub recolored: usize,
    /// Number of [`Identity::Moved`] rows.
    pub moved: usize,
    /// Number of [`Identity::Edited`] rows.
    pub edited: usize,
    /// Similarity of each group, from the source's frame to the edit's.
    pub similarities: Vec<Similarity>,
}

impl IdentityMap {
    /// Compares `edited` with `source`, both at the edit frame. With `params.enabled` off, every
    /// row is [`Identity::Edited`].
    ///
    /// # Errors
    /// If the arrays of either cloud have inconsistent lengths.
    pub fn of(source: &Splats, edited: &Splats, params: &IdentityParams) -> Result<Self, AmgError> {
        source.check_shapes().map_err(|source| AmgError::Shape { which: "source", source })?;
        edited.check_shapes().map_err(|source| AmgError::Shape { which: "edited", source })?;
        let mut rows = vec![Identity::Edited; edited.len()];
        let mut similarities = Vec::new();
        if params.enabled {
            if let Some(precision) = &params.precision {
                stored::matches(source, edited, precision, &mut rows);
            } else {
                exact::match_by_bits(source, edited, f64::from(params.tolerance), &mut rows);
            }
            if params.tolerance > 0.0 {
                match_by_tolerance(source, edited, f64::from(params.tolerance), &mut rows);
            }
            if params.moved && params.tolerance > 0.0 {
                let precision = params.precision.as_deref();
                let tolerance = f64::from(params.tolerance);
                similarities = moved::find(source, edited, precision, tolerance, &mut rows);
            }
        }
        Ok(Self::count(rows, similarities, source.len()))
    }

    /// `edited` with the exact values of the source in the rows that are source splats at their
    /// original position: all values in unchanged rows, geometry in recoloured ones. SH above the
    /// degree of the edited splats is dropped.
    #[must_use]
    pub fn restore_in_place(&self, source: &Splats, edited: &Splats) -> Splats {
        let mut restored = edited.clone();
        let coeffs = edited.sh_coeffs();
        let shared = coeffs.min(source.sh_coeffs());
        for (row, identity) in self.rows.iter().enumerate() {
            let Some(id) = identity.in_place() else { continue };
            let id = id as usize;
            restored.means[row] = source.means[id];
            restored.quats[row] = source.quats[id];
            restored.log_scales[row] = source.log_scales[id];
            if matches!(identity, Identity::Unchanged(_)) {
                restored.opacity_logits[row] = source.opacity_logits[id];
                restored.sh[row * coeffs..][..shared].copy_from_slice(&source.sh_of(id)[..shared]);
            }
        }
        restored
    }

    /// As [`IdentityMap::restore_in_place`]; in addition, moved rows get the values of the source
    /// transformed by their similarity, where the edited values agree with them. For formats that
    /// round values.
    #[must_use]
    pub fn restore(&self, source: &Splats, edited: &Splats) -> Splats {
        let mut restored = self.restore_in_place(source, edited);
        for (group, similarity) in (0..).zip(&self.similarities) {
            let (rows, ids): (Vec<usize>, Vec<usize>) =
                self.members(group).map(|(row, id)| (row, id as usize)).unzip();
            let placed =
                similarity.transform(&source.select(&ids).with_sh_degree(edited.sh_degree));
            for (i, row) in rows.into_iter().enumerate() {
                moved::restore_row(&placed, i, &mut restored, row);
            }
        }
        restored
    }

    /// Rows and source ids of group `group`.
    pub fn members(&self, group: u32) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.rows.iter().enumerate().filter_map(move |(row, identity)| match *identity {
            Identity::Moved { source, group: of } if of == group => Some((row, source)),
            _ => None,
        })
    }

    /// Number of rows that are source splats, moved or not.
    pub fn matched(&self) -> usize {
        self.unchanged + self.recolored + self.moved
    }

    /// The group that is the whole scene, saved with different axes, scale or origin: that of
    /// [`IdentityMap::whole_file`], if it contains at least a quarter of the scene. A smaller group
    /// is a selection.
    pub fn whole_scene(&self) -> Option<u32> {
        let group = self.whole_file()?;
        let mut sources: Vec<u32> = self.members(group).map(|(_, source)| source).collect();
        sources.sort_unstable();
        sources.dedup();
        (4 * sources.len() >= sources.len() + self.removed.len()).then_some(group)
    }

    /// The group that contains more than half of the rows, if almost no row is at its position in
    /// the source.
    pub fn whole_file(&self) -> Option<u32> {
        let mut sizes = vec![0_usize; self.similarities.len()];
        for row in &self.rows {
            if let Identity::Moved { group, .. } = row {
                sizes[*group as usize] += 1;
            }
        }
        let (group, size) =
            (0..).zip(sizes).max_by_key(|&(group, n)| (n, std::cmp::Reverse(group)))?;
        let in_place = self.unchanged + self.recolored;
        (2 * size > self.rows.len() && 20 * in_place < size).then_some(group)
    }

    fn count(rows: Vec<Identity>, similarities: Vec<Similarity>, num_sources: usize) -> Self {
        let mut present = vec![false; num_sources];
        let mut map = Self {
            rows,
            removed: Vec::new(),
            unchanged: 0,
            recolored: 0,
            moved: 0,
            edited: 0,
            similarities,
        };
        for row in &map.rows {
            match *row {
                Identity::Unchanged(_) => map.unchanged += 1,
                Identity::Recolored(_) => map.recolored += 1,
                Identity::Moved { .. } => map.moved += 1,
                Identity::Edited => map.edited += 1,
            }
            if let Some(id) = row.source() {
                present[id as usize] = true;
            }
        }
        map.removed = (0..num_sources).filter(|&id| !present[id]).map(index).collect();
        map
    }
}
