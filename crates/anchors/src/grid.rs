//! A uniform grid over small balls, traversed by lines.

#![expect(
    clippy::cast_sign_loss,
    reason = "cell coordinates: casting saturates, which is what a value outside the grid needs"
)]

use crate::Line;
use crate::vec3::Vec3;

/// One ball in one cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) center: Vec3,
    pub(crate) id: u32,
}

/// Balls of one common radius, each listed in every cell its bounding box touches.
#[derive(Debug)]
pub(crate) struct Grid {
    /// Lower corner of cell (1,1,1); a border of empty cells absorbs rounding at the faces.
    low: Vec3,
    high: Vec3,
    cell: f64,
    dims: [usize; 3],
    /// One bit per cell: a traversal mostly visits empty cells, and the bits fit into a cache.
    occupied: Vec<u64>,
    starts: Vec<u32>,
    entries: Vec<Entry>,
    reach: f64,
}

/// Smallest cell edge in units of the ball radius: narrower cells only list balls more often.
const CELL_PER_RADIUS: f64 = 4.0;

/// Smallest cell edge in units of the box's diagonal over the cube root of the number of balls.
/// Balances the number of steps, which is larger in narrow cells, with that of tests, which is
/// larger in wide ones (measured; flat around the optimum), and keeps the number of cells
/// proportional to that of the balls.
const CELL_PER_SPACING: f64 = 0.4;

impl Grid {
    /// Grid of the balls `(center, id)` of radius `reach`; there must be at least one.
    pub(crate) fn new(balls: &[Entry], reach: f64) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for ball in balls {
            for d in 0..3 {
                low[d] = low[d].min(ball.center[d] - reach);
                high[d] = high[d].max(ball.center[d] + reach);
            }
        }
        let diagonal = (0..3).map(|d| (high[d] - low[d]).powi(2)).sum::<f64>().sqrt();
        let spacing = diagonal / (balls.len() as f64).cbrt();
        let cell = (CELL_PER_RADIUS * reach).max(CELL_PER_SPACING * spacing);
        // One more for the upper face, two for the border.
        let dims = [0, 1, 2].map(|d| ((high[d] - low[d]) / cell) as usize + 3);
        let mut grid = Self {
            low,
            high,
            cell,
            dims,
            occupied: Vec::new(),
            starts: Vec::new(),
            entries: Vec::new(),
            reach,
        };
        grid.fill(balls);
        grid
    }

    /// Radius of the balls.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    fn fill(&mut self, balls: &[Entry]) {
        let cells: usize = self.dims.iter().product();
        let mut starts = vec![0_u32; cells + 1];
        for ball in balls {
            self.for_each_cell(ball, |cell| starts[cell + 1] += 1);
        }
        self.occupied = vec![0; cells.div_ceil(64)];
        for cell in 0..cells {
            self.occupied[cell / 64] |= u64::from(starts[cell + 1] > 0) << (cell % 64);
            starts[cell + 1] += starts[cell];
        }
        let mut next = starts.clone();
        let mut entries = vec![balls[0]; starts[cells] as usize];
        for ball in balls {
            self.for_each_cell(ball, |cell| {
                entries[next[cell] as usize] = *ball;
                next[cell] += 1;
            });
        }
        self.starts = starts;
        self.entries = entries;
    }

    fn for_each_cell(&self, ball: &Entry, mut each: impl FnMut(usize)) {
        let corner =
            |sign: f64| [0, 1, 2].map(|d| self.coordinate(d, ball.center[d] + sign * self.reach));
        let (from, to) = (corner(-1.0), corner(1.0));
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    each((z * self.dims[1] + y) * self.dims[0] + x);
                }
            }
        }
    }

    /// Cell coordinate along an axis, inside the border.
    fn coordinate(&self, axis: usize, x: f64) -> usize {
        // Casting saturates, so a value below `low` lands in cell 1.
        (((x - self.low[axis]) / self.cell) as usize).min(self.dims[axis] - 3) + 1
    }

    /// Calls `each` with the entries of every occupied cell that the line passes, in the order of
    /// the line. A ball is visited once for each of its cells. No ball within `reach` of the line
    /// is missed, as long as `reach` exceeds the true radius by the rounding of the traversal.
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators would branch")]
    #[inline]
    pub(crate) fn walk(&self, line: &Line, mut each: impl FnMut(&[Entry])) {
        let Some((enter, exit)) = self.clip(line) else { return };
        let mut cell = 0;
        let mut steps = [0_isize; 3];
        let (mut next, mut delta) = ([f64::INFINITY; 3], [0.0; 3]);
        let mut stride = 1;
        for d in 0..3 {
            let direction = line.direction[d];
            let coordinate = self.coordinate(d, line.point[d] + enter * direction);
            cell += coordinate * stride;
            if direction.abs() > 0.0 {
                let ahead = if direction > 0.0 { coordinate } else { coordinate - 1 };
                next[d] = (self.low[d] + ahead as f64 * self.cell - line.point[d]) / direction;
                delta[d] = self.cell / direction.abs();
                steps[d] =
                    if direction > 0.0 { stride.cast_signed() } else { -stride.cast_signed() };
            }
            stride *= self.dims[d];
        }
        // A walk through the grid has at most this many steps. The bound ends walks along lines so
        // far away that their position is lost to rounding.
        for _ in 0..self.dims.iter().sum() {
            let Some(word) = self.occupied.get(cell / 64) else { return };
            if word >> (cell % 64) & 1 == 1 {
                each(&self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize]);
            }
            // Selections instead of branches: the next face cannot be predicted.
            let x = (next[0] <= next[1]) & (next[0] <= next[2]);
            let y = !x & (next[1] <= next[2]);
            let nearest = if x {
                next[0]
            } else if y {
                next[1]
            } else {
                next[2]
            };
            if nearest > exit || nearest.is_nan() {
                return;
            }
            let step = if x {
                steps[0]
            } else if y {
                steps[1]
            } else {
                steps[2]
            };
            cell = cell.wrapping_add_signed(step);
            next[0] += if x { delta[0] } else { 0.0 };
            next[1] += if y { delta[1] } else { 0.0 };
            next[2] += if x | y { 0.0 } else { delta[2] };
        }
    }

    /// Parameters at which the line enters and leaves the box of the grid.
    fn clip(&self, line: &Line) -> Option<(f64, f64)> {
        let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
        for d in 0..3 {
            let (p, direction) = (line.point[d], line.direction[d]);
            if direction.abs() > 0.0 {
                let (a, b) = ((self.low[d] - p) / direction, (self.high[d] - p) / direction);
                enter = enter.max(a.min(b));
                exit = exit.min(a.max(b));
            } else if p < self.low[d] || p > self.high[d] {
                return None;
            }
        }
        (enter <= exit).then_some((enter, exit))
    }
}
