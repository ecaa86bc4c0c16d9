//! Approximates values over time by few linear segments: each segment ends at a *knot* on the grid
//! of steps, and every frame between two knots lies within the tolerance of the straight line. One
//! pass over the frames; memory is used only for rows that move.

/// Longest segment, frames; gaps are stored as bytes.
pub(crate) const MAX_GAP: u32 = 255;
/// Largest stored magnitude, so that differences of two values fit 32 bits.
const LIMIT: f64 = 1_073_741_823.0;
/// Marks rows that have not moved yet.
const RESTING: u32 = u32::MAX;

/// Rounds to the grid of steps: halves upwards, as `Math.floor(x + 0.5)` does.
#[expect(clippy::cast_possible_truncation, reason = "clamped to 31 bits")]
pub(crate) fn round(value: f64) -> i32 {
    (value + 0.5).floor().clamp(-LIMIT, LIMIT) as i32
}

/// Whether [`round`] would have to clamp.
pub(crate) fn is_beyond(value: f64) -> bool {
    value.abs() > LIMIT
}

/// End of a segment of one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Knot {
    pub(crate) row: u32,
    pub(crate) frame: u32,
}

/// The tracks of one attribute of all rows, in steps.
#[derive(Debug)]
pub(crate) struct Tracks {
    pub(crate) channels: usize,
    tolerance: f64,
    /// First frame, `[rows, channels]`.
    pub(crate) base: Vec<i32>,
    /// Knots after the first frame: by time until [`Tracks::finish`], then by row and time.
    pub(crate) knots: Vec<Knot>,
    /// Values at the knots, `[knots, channels]`.
    pub(crate) values: Vec<i32>,
    slots: Vec<u32>,
    open: Vec<Piece>,
    lines: Vec<Line>,
}

/// The open segment of a row.
#[derive(Debug)]
struct Piece {
    start: u32,
    /// Whether every frame since the start lies within the tolerance of its value.
    rests: bool,
}

/// One channel of an open segment.
#[derive(Debug, Clone, Copy)]
struct Line {
    start: i32,
    /// Value at the newest frame; end of the segment if the next frame does not fit.
    end: i32,
    /// Range of slopes that keep all frames so far within the tolerance.
    low: f64,
    high: f64,
}

impl Tracks {
    /// Tracks of `rows` rows; `tolerance` in steps.
    pub(crate) fn new(rows: usize, channels: usize, tolerance: f64) -> Self {
        Self {
            channels,
            tolerance,
            base: vec![0; rows * channels],
            knots: Vec::new(),
            values: Vec::new(),
            slots: vec![RESTING; rows],
            open: Vec::new(),
            lines: Vec::new(),
        }
    }

    /// Sets the stored value of the first frame.
    pub(crate) fn start(&mut self, row: usize, values: &[i32]) {
        self.base[row * self.channels..][..self.channels].copy_from_slice(values);
    }

    /// Adds frame `frame` of a row; frames must be added in order, from 1.
    pub(crate) fn push(&mut self, row: u32, frame: u32, values: &[f64]) {
        let slot = match self.slots[row as usize] {
            RESTING => {
                let base = &self.base[row as usize * self.channels..][..self.channels];
                let near = |(b, x): (&i32, &f64)| (x - f64::from(*b)).abs() <= self.tolerance;
                if base.iter().zip(values).all(near) {
                    return;
                }
                self.depart(row, frame - 1)
            }
            slot => slot as usize,
        };
        if !self.extend(slot, frame, values) {
            self.knot(row, slot, frame - 1);
            self.extend(slot, frame, values);
        }
    }

    /// Opens the first segment of a row that was static until `frame`.
    fn depart(&mut self, row: u32, frame: u32) -> usize {
        let slot = self.open.len();
        #[expect(clippy::cast_possible_truncation, reason = "no more slots than rows")]
        let stored = slot as u32;
        self.slots[row as usize] = stored;
        // The static time takes as many segments as its length needs.
        let mut reached = 0;
        while reached < frame {
            reached = frame.min(reached + MAX_GAP);
            self.knots.push(Knot { row, frame: reached });
            let start = row as usize * self.channels;
            self.values.extend_from_slice(&self.base[start..start + self.channels]);
        }
        self.open.push(Piece { start: frame, rests: true });
        for channel in 0..self.channels {
            let value = self.base[row as usize * self.channels + channel];
            self.lines.push(Line::from(value));
        }
        slot
    }

    /// Tries to extend the open segment to `frame`.
    fn extend(&mut self, slot: usize, frame: u32, values: &[f64]) -> bool {
        let piece = &mut self.open[slot];
        let elapsed = frame - piece.start;
        let dt = f64::from(elapsed);
        let lines = &mut self.lines[slot * self.channels..][..self.channels];
        let fits = |(line, x): (&Line, &f64)| {
            let slope = (f64::from(round(*x)) - f64::from(line.start)) / dt;
            line.low <= slope && slope <= line.high
        };
        if elapsed > MAX_GAP || !lines.iter().zip(values).all(fits) {
            return false;
        }
        for (line, &x) in lines.iter_mut().zip(values) {
            let offset = x - f64::from(line.start);
            line.low = line.low.max((offset - self.tolerance) / dt);
            line.high = line.high.min((offset + self.tolerance) / dt);
            line.end = round(x);
            piece.rests &= offset.abs() <= self.tolerance;
        }
        true
    }

    /// Ends the open segment at `frame` and opens the next.
    fn knot(&mut self, row: u32, slot: usize, frame: u32) {
        self.knots.push(Knot { row, frame });
        for line in &mut self.lines[slot * self.channels..][..self.channels] {
            self.values.push(line.end);
            *line = Line::from(line.end);
        }
        self.open[slot] = Piece { start: frame, rests: true };
    }

    /// Ends all segments at the last frame and sorts the knots by row and time. A row that has
    /// stopped moving needs no last knot, because its value is held.
    pub(crate) fn finish(&mut self, last_frame: u32) {
        for row in 0..self.slots.len() {
            let slot = self.slots[row];
            if slot == RESTING {
                continue;
            }
            let slot = slot as usize;
            if !self.open[slot].rests {
                #[expect(clippy::cast_possible_truncation, reason = "rows are counted in 32 bits")]
                self.knot(row as u32, slot, last_frame);
            }
        }
        let mut order: Vec<usize> = (0..self.knots.len()).collect();
        order.sort_by_key(|&knot| self.knots[knot].row);
        self.values = order
            .iter()
            .flat_map(|&knot| self.values[knot * self.channels..][..self.channels].iter().copied())
            .collect();
        self.knots = order.iter().map(|&knot| self.knots[knot]).collect();
        (self.open, self.lines) = (Vec::new(), Vec::new());
    }

    /// Whether a row has knots, once finished.
    pub(crate) fn moves(&self, row: usize) -> bool {
        self.slots[row] != RESTING
    }
}

impl Line {
    fn from(value: i32) -> Self {
        Self { start: value, end: value, low: f64::NEG_INFINITY, high: f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of one row at every frame, from its knots.
    fn replay(tracks: &Tracks, frames: u32) -> Vec<f64> {
        let mut points = vec![(0, tracks.base[0])];
        points.extend(tracks.knots.iter().map(|k| k.frame).zip(tracks.values.iter().copied()));
        (0..frames)
            .map(|frame| {
                let next = points.iter().position(|point| point.0 >= frame);
                let Some(next) = next else { return f64::from(points[points.len() - 1].1) };
                if points[next].0 == frame {
                    return f64::from(points[next].1);
                }
                let (from, to) = (points[next - 1], points[next]);
                let share = f64::from(frame - from.0) / f64::from(to.0 - from.0);
                f64::from(from.1) + f64::from(to.1 - from.1) * share
            })
            .collect()
    }

    fn tracked(values: &[f64], tolerance: f64) -> Tracks {
        let mut tracks = Tracks::new(1, 1, tolerance);
        tracks.start(0, &[round(values[0])]);
        for (frame, &value) in (0..).zip(values).skip(1) {
            tracks.push(0, frame, &[value]);
        }
        tracks.finish(u32::try_from(values.len()).unwrap() - 1);
        tracks
    }

    #[test]
    fn every_frame_is_within_the_tolerance() {
        for tolerance in [1.0, 1.5, 4.0] {
            let values: Vec<f64> = (0..700)
                .map(|i| {
                    let t = f64::from(i);
                    // Static, oscillating, jumping, then static for longer than a gap.
                    if i < 280 {
                        3.2
                    } else if i < 400 {
                        90.0 * (t / 17.0).sin()
                    } else {
                        -40.4
                    }
                })
                .collect();
            let tracks = tracked(&values, tolerance);
            let worst = replay(&tracks, 700)
                .iter()
                .zip(&values)
                .map(|(found, expected)| (found - expected).abs())
                .fold(0.0, f64::max);
            assert!(worst <= tolerance, "off by {worst}, tolerance {tolerance}");
            assert!(tracks.knots.len() < 150, "{} knots", tracks.knots.len());
            let gaps = tracks.knots.windows(2).map(|pair| pair[1].frame - pair[0].frame);
            assert!(gaps.max().unwrap() <= MAX_GAP, "gaps fit in a byte");
        }
    }

    #[test]
    fn static_rows_have_no_knots_and_a_line_has_one() {
        let still = tracked(&[5.1, 5.9, 4.2, 5.0], 1.5);
        assert!(still.knots.is_empty() && !still.moves(0), "within the tolerance of its start");
        let line = tracked(&[0.0, 10.0, 20.0, 30.0], 1.5);
        assert_eq!(line.knots, [Knot { row: 0, frame: 3 }], "one piece");
        let stopped = tracked(&[0.0, 10.0, 10.0, 10.2], 1.5);
        assert_eq!(stopped.knots, [Knot { row: 0, frame: 1 }], "the last value holds");
    }
}
