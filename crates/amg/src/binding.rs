//! [`Binding`]: the source splats whose motion each edited splat follows, for all times.

use crate::AmgError;
use crate::inheritance::Inherited;
use crate::moved_group::MovedGroup;
use crate::persistent::PersistentSplats;
use crate::row_index::index;
use crate::row_kind::RowKind;
use gs_core::Splats;

/// Data for edits of surfaces that short-lived splats represent.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceBinding {
    /// Splats of the edit frame that edited splats follow, extended over the whole clip.
    pub persistent: PersistentSplats,
    /// Inherited edits of the rows of kind [`RowKind::Descendant`], in ascending order of rows.
    pub inherited: Vec<Inherited>,
}

/// A sparse matrix: for each of `M` edited splats, ids of source splats and normalised weights.
/// Independent of time.
///
/// Invariants, verified by [`Binding::from_parts`] and [`Binding::blending`]: rows in order and
/// complete; ids below `num_sources`; weights finite, not negative, summing to 1 within 1e-4 per
/// non-empty row; exact and moved rows have one entry, blended rows at least one, static and field
/// rows none; moved and copied rows have a group.
#[derive(Debug, Clone, PartialEq)]
pub struct Binding {
    offsets: Vec<u32>,
    source_ids: Vec<u32>,
    weights: Vec<f32>,
    kinds: Vec<RowKind>,
    num_sources: usize,
    groups: Vec<MovedGroup>,
    /// Group of each row, `[M]`, if there are groups.
    group_of: Vec<u32>,
    /// Present if edits apply to surfaces instead of splats.
    surface: Option<SurfaceBinding>,
}

impl Binding {
    /// A binding from its arrays: `offsets` `[M+1]`, `source_ids` and `weights` `[nnz]`, `kinds`
    /// `[M]`.
    ///
    /// # Errors
    /// If an invariant of the type does not hold; the message names the row.
    pub fn from_parts(
        offsets: Vec<u32>,
        source_ids: Vec<u32>,
        weights: Vec<f32>,
        kinds: Vec<RowKind>,
        num_sources: usize,
    ) -> Result<Self, AmgError> {
        Self::from_parts_with_groups(
            offsets,
            source_ids,
            weights,
            kinds,
            num_sources,
            Vec::new(),
            Vec::new(),
        )
    }

    /// As [`Binding::from_parts`], with the groups of [`RowKind::Moved`] and [`RowKind::Copied`]
    /// rows: `group_of` `[M]` contains an index into `groups` for each of them; other entries are
    /// ignored.
    ///
    /// # Errors
    /// As [`Binding::from_parts`], and if a similarity is invalid or a carrier is out of range.
    pub fn from_parts_with_groups(
        offsets: Vec<u32>,
        source_ids: Vec<u32>,
        weights: Vec<f32>,
        kinds: Vec<RowKind>,
        num_sources: usize,
        groups: Vec<MovedGroup>,
        group_of: Vec<u32>,
    ) -> Result<Self, AmgError> {
        let surface = None;
        Self { offsets, source_ids, weights, kinds, num_sources, groups, group_of, surface }
            .verified()
    }

    /// A binding of rows `[M]` of `(source id, weight)`: rows without sources are static, the
    /// others blend the motion of their sources. Weights need not sum to 1.
    ///
    /// # Errors
    /// If an id is not below `num_sources`, or weights are negative, not finite or all zero; the
    /// message names the row.
    pub fn blending(rows: &[Vec<(u32, f32)>], num_sources: usize) -> Result<Self, AmgError> {
        let kind = |row: &[_]| if row.is_empty() { RowKind::Static } else { RowKind::Blended };
        let binding = Self::from_rows(rows.iter().map(|row| (kind(row), &row[..])), num_sources);
        binding.verified()
    }

    /// A binding from rows of `(kind, [(source id, weight)])`; weights are normalised here.
    pub(crate) fn from_rows<'a>(
        rows: impl ExactSizeIterator<Item = (RowKind, &'a [(u32, f32)])> + Clone,
        num_sources: usize,
    ) -> Self {
        let nnz = rows.clone().map(|(_, entries)| entries.len()).sum();
        let mut binding = Self {
            offsets: Vec::with_capacity(rows.len() + 1),
            source_ids: Vec::with_capacity(nnz),
            weights: Vec::with_capacity(nnz),
            kinds: Vec::with_capacity(rows.len()),
            num_sources,
            groups: Vec::new(),
            group_of: Vec::new(),
            surface: None,
        };
        binding.offsets.push(0);
        for (kind, entries) in rows {
            let total: f32 = entries.iter().map(|entry| entry.1).sum();
            binding.kinds.push(kind);
            binding.source_ids.extend(entries.iter().map(|entry| entry.0));
            binding.weights.extend(entries.iter().map(|entry| entry.1 / total));
            binding.offsets.push(index(binding.source_ids.len()));
        }
        binding
    }

    /// The same with the groups of its moved rows.
    pub(crate) fn with_groups(self, groups: Vec<MovedGroup>, group_of: Vec<u32>) -> Self {
        if groups.is_empty() { self } else { Self { groups, group_of, ..self } }
    }

    /// The same with data for surfaces.
    ///
    /// # Errors
    /// If ids are out of range, values are not finite, or the rows that inherit are not exactly
    /// those of kind [`RowKind::Descendant`], in order.
    pub fn with_surface(self, surface: SurfaceBinding) -> Result<Self, AmgError> {
        let binding = Self { surface: Some(surface), ..self };
        match binding.surface_fault() {
            Some(what) => Err(AmgError::Binding { what }),
            None => Ok(binding),
        }
    }

    fn surface_fault(&self) -> Option<String> {
        let none = SurfaceBinding::default();
        let surface = self.surface.as_ref().unwrap_or(&none);
        let descendants = (0..self.len()).filter(|&row| self.kinds[row] == RowKind::Descendant);
        if !descendants.eq(surface.inherited.iter().map(|inherited| inherited.row as usize)) {
            return Some(format!(
                "{} rows inherit an edit, expected the {} rows of kind Descendant in order",
                surface.inherited.len(),
                self.count(RowKind::Descendant)
            ));
        }
        let (rows, groups) = (self.len(), self.groups.len());
        if let Some(at) = surface.inherited.iter().position(|i| i.fault(rows, groups)) {
            return Some(format!("inherited edit {at} is invalid: {:?}", surface.inherited[at]));
        }
        surface.persistent.fault(self.num_sources)
    }

    fn verified(self) -> Result<Self, AmgError> {
        match self.fault() {
            Some(what) => Err(AmgError::Binding { what }),
            None => Ok(self),
        }
    }

    fn fault(&self) -> Option<String> {
        let rows = self.kinds.len();
        if self.offsets.len() != rows + 1 || self.offsets[0] != 0 {
            return Some(format!(
                "offsets has {} entries starting at {:?}, expected {} starting at 0",
                self.offsets.len(),
                self.offsets.first(),
                rows + 1
            ));
        }
        let nnz = self.source_ids.len();
        if self.weights.len() != nnz || self.offsets[rows] as usize != nnz {
            return Some(format!(
                "{nnz} source ids, {} weights and a last offset of {}, expected the same number",
                self.weights.len(),
                self.offsets[rows]
            ));
        }
        if let Some(row) = (0..rows).find(|&row| self.offsets[row] > self.offsets[row + 1]) {
            return Some(format!("offsets decrease at row {row}"));
        }
        if self.group_of.len() != if self.groups.is_empty() { 0 } else { rows } {
            return Some(format!(
                "group_of has {} entries for {} groups, expected {rows}, or 0 without groups",
                self.group_of.len(),
                self.groups.len()
            ));
        }
        (0..self.groups.len())
            .find_map(|group| self.group_fault(group))
            .or_else(|| (0..rows).find_map(|row| self.row_fault(row)))
    }

    fn group_fault(&self, number: usize) -> Option<String> {
        let group = &self.groups[number];
        if !group.similarity.is_valid() {
            return Some(format!(
                "the similarity of group {number} is invalid: {:?}",
                group.similarity
            ));
        }
        let improper = |&&(id, weight): &&(u32, f32)| {
            id as usize >= self.num_sources || !(weight > 0.0 && weight.is_finite())
        };
        let (id, weight) = group.carriers.iter().find(improper)?;
        Some(format!(
            "group {number} follows source {id} with weight {weight}, expected an id below {} and a weight above 0",
            self.num_sources
        ))
    }

    fn row_fault(&self, row: usize) -> Option<String> {
        let (ids, weights) = self.row(row);
        let kind = self.kinds[row];
        let entries_fit = match kind {
            RowKind::Static | RowKind::Field => ids.is_empty(),
            RowKind::Unchanged
            | RowKind::Recolored
            | RowKind::Moved
            | RowKind::Descendant
            | RowKind::Copied => ids.len() == 1,
            RowKind::Blended => !ids.is_empty(),
        };
        if !entries_fit {
            return Some(format!("row {row} is {kind:?} but has {} sources", ids.len()));
        }
        let has_group = self.group_number(row).is_some_and(|g| g < self.groups.len());
        if matches!(kind, RowKind::Moved | RowKind::Copied) && !has_group {
            return Some(format!(
                "row {row} is {kind:?}, but its group is not one of the {} groups",
                self.groups.len()
            ));
        }
        if let Some(id) = ids.iter().find(|&&id| id as usize >= self.num_sources) {
            return Some(format!(
                "row {row} refers to source {id}, expected below {}",
                self.num_sources
            ));
        }
        let total: f32 = weights.iter().sum();
        let proper = weights.iter().all(|w| *w >= 0.0) && (total - 1.0).abs() <= 1e-4;
        (!ids.is_empty() && !proper)
            .then(|| format!("weights of row {row} sum to {total}, expected 1 and none negative"))
    }

    /// `M`, the number of edited splats.
    pub fn len(&self) -> usize {
        self.kinds.len()
    }

    /// Whether there are no edited splats.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// Number of source splats the ids refer to.
    pub fn num_sources(&self) -> usize {
        self.num_sources
    }

    /// Start of each row in [`Binding::source_ids`], and the end of the last, `[M+1]`.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// Source ids of all rows, `[nnz]`.
    pub fn source_ids(&self) -> &[u32] {
        &self.source_ids
    }

    /// Normalised weights, `[nnz]`.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Kind of every row, `[M]`.
    pub fn kinds(&self) -> &[RowKind] {
        &self.kinds
    }

    /// Sources and weights of edited splat `row`.
    ///
    /// # Panics
    /// If `row` is out of range.
    pub fn row(&self, row: usize) -> (&[u32], &[f32]) {
        let range = self.offsets[row] as usize..self.offsets[row + 1] as usize;
        (&self.source_ids[range.clone()], &self.weights[range])
    }

    /// Id of the source with the largest weight in a row, the lowest id if several have it; `None`
    /// for static and field rows.
    ///
    /// # Panics
    /// If `row` is out of range.
    pub fn heaviest(&self, row: usize) -> Option<u32> {
        let (ids, weights) = self.row(row);
        let order =
            |a: &usize, b: &usize| weights[*a].total_cmp(&weights[*b]).then(ids[*b].cmp(&ids[*a]));
        (0..ids.len()).max_by(order).map(|at| ids[at])
    }

    /// Groups of moved and copied rows.
    pub fn groups(&self) -> &[MovedGroup] {
        &self.groups
    }

    /// Index of each row's group, `[M]`, meaningful for moved and copied rows; empty without
    /// groups.
    pub fn group_of(&self) -> &[u32] {
        &self.group_of
    }

    /// Data for surfaces, if edits apply to them.
    pub fn surface(&self) -> Option<&SurfaceBinding> {
        self.surface.as_ref()
    }

    /// Inherited edit of row `row`, if any.
    pub(crate) fn inherited(&self, row: usize) -> Option<&Inherited> {
        let inherited = &self.surface.as_ref()?.inherited;
        let at = inherited.binary_search_by_key(&row, |inherited| inherited.row as usize).ok()?;
        inherited.get(at)
    }

    /// Index of the group of moved row `row`.
    pub(crate) fn group_number(&self, row: usize) -> Option<usize> {
        self.group_of.get(row).map(|&group| group as usize)
    }

    /// Number of rows of `kind`.
    pub fn count(&self, kind: RowKind) -> usize {
        self.kinds.iter().filter(|&&k| k == kind).count()
    }

    /// Verifies that this binding fits a source of `num_sources` splats and `edited`.
    pub(crate) fn check(&self, num_sources: usize, edited: &Splats) -> Result<(), AmgError> {
        let (rows, splats) = (self.len(), edited.len());
        if self.num_sources != num_sources || rows != splats {
            return Err(AmgError::Binding {
                what: format!(
                    "made for {} source and {rows} edited splats, found {num_sources} and {splats}",
                    self.num_sources
                ),
            });
        }
        match self.surface_fault() {
            Some(what) => Err(AmgError::Binding { what }),
            None => Ok(()),
        }
    }
}
