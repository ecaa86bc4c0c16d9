//! [`TileSet`]: a part of an image, in whole tiles.

use crate::image_formation::TILE_SIZE;

const TILE: usize = TILE_SIZE as usize;

/// Some of the 16×16 tiles of an image; see [`crate::Rasterizer::prepare_tiles_into`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TileSet {
    /// Image size `[W, H]`, pixels.
    size: [usize; 2],
    /// Whether each tile is in the set, row by row.
    tiles: Vec<bool>,
}

impl TileSet {
    /// No tile of an image of `width`×`height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let count = width.div_ceil(TILE) * height.div_ceil(TILE);
        Self { size: [width, height], tiles: vec![false; count] }
    }

    /// Every tile that contains a set pixel of `mask` (`[H,W]`; pixels beyond its end are not set).
    pub fn around(mask: &[bool], width: usize, height: usize) -> Self {
        let mut set = Self::new(width, height);
        let across = set.across();
        for (y, row) in mask.chunks(width.max(1)).take(height).enumerate() {
            for (tx, pixels) in row.chunks(TILE).enumerate() {
                if pixels.contains(&true) {
                    set.tiles[y / TILE * across + tx] = true;
                }
            }
        }
        set
    }

    /// The set with these flags, one per tile, row by row; `None` if their number is wrong.
    pub fn from_flags(flags: Vec<bool>, width: usize, height: usize) -> Option<Self> {
        let set = Self { size: [width, height], tiles: flags };
        (set.tiles.len() == set.across() * height.div_ceil(TILE)).then_some(set)
    }

    /// A flag per tile, row by row.
    pub fn flags(&self) -> &[bool] {
        &self.tiles
    }

    /// Image size `[W, H]`, pixels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Whether no tile is in the set.
    pub fn is_empty(&self) -> bool {
        !self.tiles.contains(&true)
    }

    /// Adds the tiles that overlap a rectangle of pixels `x0, y0, x1, y1` (upper bounds exclusive)
    /// and lie inside the image.
    pub fn insert(&mut self, rect: [usize; 4]) {
        let across = self.across();
        for ty in self.tiles_of(rect, 1) {
            for tx in self.tiles_of(rect, 0) {
                self.tiles[ty * across + tx] = true;
            }
        }
    }

    /// Whether a tile of the set overlaps a rectangle of pixels, as in [`TileSet::insert`].
    pub fn overlaps(&self, rect: [usize; 4]) -> bool {
        let across = self.across();
        self.tiles_of(rect, 1)
            .any(|ty| self.tiles_of(rect, 0).any(|tx| self.tiles[ty * across + tx]))
    }

    /// Whether the set contains tile `(tx, ty)`; false outside the image.
    pub fn has_tile(&self, tx: usize, ty: usize) -> bool {
        tx < self.across() && self.tiles.get(ty * self.across() + tx).is_some_and(|&on| on)
    }

    /// Whether the set contains pixel `(x, y)`; false outside the image.
    pub fn contains(&self, x: usize, y: usize) -> bool {
        x < self.size[0] && y < self.size[1] && self.has_tile(x / TILE, y / TILE)
    }

    /// Removes the tiles that `other`, of an image of the same size, does not contain.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn intersect(&mut self, other: &Self) {
        assert!(self.size == other.size, "tiles of {:?} and {:?} pixels", self.size, other.size);
        for (own, other) in self.tiles.iter_mut().zip(&other.tiles) {
            *own &= other;
        }
    }

    /// The set with every tile that lies within `margin` pixels of one of its tiles.
    #[must_use]
    pub fn grown(&self, margin: usize) -> Self {
        let mut grown = Self::new(self.size[0], self.size[1]);
        for (i, _) in self.tiles.iter().enumerate().filter(|(_, on)| **on) {
            let [x, y] = [i % self.across() * TILE, i / self.across() * TILE];
            grown.insert([
                x.saturating_sub(margin),
                y.saturating_sub(margin),
                x + TILE + margin,
                y + TILE + margin,
            ]);
        }
        grown
    }

    /// The smallest rectangle of pixels that contains the set, `x0, y0, x1, y1`, inside the image;
    /// all 0 if the set is empty.
    pub fn bounds(&self) -> [usize; 4] {
        let mut bounds = [usize::MAX, usize::MAX, 0, 0];
        for (i, _) in self.tiles.iter().enumerate().filter(|(_, on)| **on) {
            let [tx, ty] = [i % self.across(), i / self.across()];
            bounds = [
                bounds[0].min(tx * TILE),
                bounds[1].min(ty * TILE),
                bounds[2].max(((tx + 1) * TILE).min(self.size[0])),
                bounds[3].max(((ty + 1) * TILE).min(self.size[1])),
            ];
        }
        if bounds[2] == 0 { [0; 4] } else { bounds }
    }

    fn across(&self) -> usize {
        self.size[0].div_ceil(TILE)
    }

    /// Tiles of the image that overlap a rectangle, along an axis.
    fn tiles_of(&self, rect: [usize; 4], axis: usize) -> std::ops::Range<usize> {
        let end = rect[axis + 2].min(self.size[axis]);
        if rect[axis] < end { rect[axis] / TILE..end.div_ceil(TILE) } else { 0..0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation against flags of single pixels.
    #[test]
    fn agrees_with_pixels() {
        let (width, height) = (53, 41);
        let mut set = TileSet::new(width, height);
        assert!(set.is_empty() && set.bounds() == [0; 4] && !set.overlaps([0, 0, 53, 41]));
        set.insert([17, 3, 33, 16]);
        set.insert([50, 40, 99, 99]);
        set.insert([20, 20, 20, 30]);
        set.insert([60, 0, 70, 10]);
        let inside = |x: usize, y: usize| ((16..48).contains(&x) && y < 16) || (x >= 48 && y >= 32);
        let mut mask = vec![false; width * height];
        for y in 0..height {
            for x in 0..width {
                assert_eq!(set.contains(x, y), inside(x, y), "pixel {x}, {y}");
                mask[y * width + x] = inside(x, y) && x % 16 == 5 && y % 16 == 7;
            }
        }
        assert!(!set.contains(53, 40) && !set.contains(5, 41), "outside the image");
        assert_eq!(set.bounds(), [16, 0, 53, 41]);
        assert_eq!(TileSet::from_flags(set.flags().to_vec(), width, height), Some(set.clone()));
        assert_eq!(TileSet::from_flags(vec![true; 3], width, height), None);
        // The last tile has no pixel (53, 39): it is cut off by the border.
        mask[39 * width + 52] = true;
        assert_eq!(TileSet::around(&mask, width, height), set);
        assert!(set.overlaps([0, 0, 17, 1]) && !set.overlaps([0, 0, 16, 41]));
        assert!(!set.overlaps([17, 0, 17, 9]), "an empty rectangle");
        let grown = set.grown(1);
        assert!(grown.contains(15, 0) && grown.contains(0, 16) && !grown.contains(0, 32));
        assert_eq!(set.grown(0), set);
        let mut common = grown;
        common.intersect(&set);
        assert_eq!(common, set);
    }
}
