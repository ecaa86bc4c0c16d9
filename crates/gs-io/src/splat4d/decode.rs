//! Decoding of frames: values stored once, and a cursor into the changing values.

use super::Splat4dError;
use super::streams::{HEAD, Head, Symbols, attribute, unzigzag};
use super::value::Attribute;
use crate::bytes8::{dc_of, logit_of};
use gs_core::Splats;

/// Grid steps, in the units of [`super::value::values`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Grids {
    /// Steps of changing values, by attribute.
    pub(super) moving: [f64; 5],
    /// Step of positions and logarithmic sizes that are stored once.
    pub(super) fixed_pos: f64,
    pub(super) fixed_scale: f64,
}

/// Values that are stored once.
#[derive(Debug)]
pub(super) struct Fixed {
    /// All splats, with the first frame's values where they change.
    pub(super) base: Splats,
    /// Rows whose attribute changes.
    pub(super) changing: [Vec<u32>; 5],
}

/// Attributes of the static section's streams, in order: a bit
/// map of the static splats, then values.
const ORDER: [Attribute; 10] = {
    use Attribute::{Alpha, Pos, Rgb, Rot, Scale};
    [Pos, Rot, Rgb, Alpha, Scale, Pos, Scale, Rgb, Alpha, Rot]
};
/// Kind of its streams.
const STATIC: u8 = 2;
/// Kinds of the streams of a group of frames.
const KEY: u8 = 0;
const DELTA: u8 = 1;

/// Reads the static section of `n` splats; `room` as [`Head::unpack`].
pub(super) fn fixed(
    section: &[u8],
    n: usize,
    grids: &Grids,
    room: &mut u64,
) -> Result<Fixed, Splat4dError> {
    let cut = || Splat4dError::Stream("the static section is truncated".to_owned());
    // Tested before allocating: the values alone take this many bytes per splat.
    let values: usize = Attribute::ALL.iter().map(|attribute| attribute.channels()).sum();
    if n.saturating_mul(values) as u64 > *room {
        return Err(Splat4dError::Stream(format!(
            "{} bytes cannot contain {n} splats",
            section.len()
        )));
    }
    let mut rest = section;
    let mut next = |index: usize| -> Result<Symbols, Splat4dError> {
        let (head, after) = rest.split_first_chunk::<HEAD>().ok_or_else(cut)?;
        let head = Head::parse(head);
        let expected = ORDER[index];
        if (head.attribute, head.kind) != (expected.id(), STATIC) {
            return Err(Splat4dError::Stream(format!(
                "stream {index} of the static section is of attribute {}, kind {}; expected {}, kind {STATIC}",
                head.attribute,
                head.kind,
                expected.id()
            )));
        }
        let (payload, after) = after.split_at_checked(head.packed).ok_or_else(cut)?;
        rest = after;
        let count = if index < 5 { n.div_ceil(8) } else { n * expected.channels() };
        head.unpack(payload, count, room)
    };
    let mut changing: [Vec<u32>; 5] = Default::default();
    for (index, rows) in changing.iter_mut().enumerate() {
        next(index)?.each(0..n.div_ceil(8), |at, bits| {
            for bit in 0..8 {
                let row = 8 * at + bit;
                if row < n && bits >> (7 - bit) & 1 == 0 {
                    #[expect(clippy::cast_possible_truncation, reason = "counted in 32 bits")]
                    rows.push(row as u32);
                }
            }
        });
    }
    let running = |symbols: &Symbols, step: f64| {
        let mut out = vec![[0.0; 3]; n];
        let mut sum = [0_i32; 3];
        symbols.each(0..3 * n, |at, symbol| {
            let k = at % 3;
            sum[k] = sum[k].wrapping_add(unzigzag(symbol));
            out[at / 3][k] = scaled(sum[k], step);
        });
        out
    };
    let means = running(&next(5)?, grids.fixed_pos);
    let log_scales = running(&next(6)?, grids.fixed_scale);
    let mut sh = vec![[0.0; 3]; n];
    next(7)?.each(0..3 * n, |at, symbol| sh[at / 3][at % 3] = dc(whole(symbol)));
    let mut opacity_logits = vec![0.0; n];
    next(8)?.each(0..n, |at, symbol| opacity_logits[at] = logit(whole(symbol)));
    let mut quats = vec![[0.0; 4]; n];
    next(9)?.each(0..4 * n, |at, symbol| quats[at / 4][at % 4] = part(whole(symbol) - 128.0));
    let base = Splats { means, quats, log_scales, opacity_logits, sh, sh_degree: 0 };
    Ok(Fixed { base, changing })
}

#[expect(clippy::cast_possible_truncation, reason = "scenes are single precision")]
fn scaled(bin: i32, step: f64) -> f32 {
    (f64::from(bin) * step) as f32
}

fn whole(symbol: u32) -> f64 {
    f64::from(symbol.min(255))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a byte, as the format specifies"
)]
fn level(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

fn dc(value: f64) -> f32 {
    dc_of(f32::from(level(value)) / 255.0)
}

fn logit(value: f64) -> f32 {
    logit_of(level(value))
}

/// Component of a quaternion from 128ths.
#[expect(clippy::cast_possible_truncation, reason = "a small number")]
fn part(value: f64) -> f32 {
    (value.clamp(-128.0, 127.0) / 128.0) as f32
}

/// A decompressed group of frames: by attribute, the first frame's grid
/// points and the differences between frames.
#[derive(Debug)]
struct Group {
    index: usize,
    keys: [Symbols; 5],
    deltas: [Symbols; 5],
}

/// Reads the group `index`, which has `frames` frames.
fn group(
    chunk: &[u8],
    index: usize,
    frames: usize,
    changing: &[Vec<u32>; 5],
    room: &mut u64,
) -> Result<Group, Splat4dError> {
    let broken = |what: String| Splat4dError::Stream(format!("group {index} of frames: {what}"));
    let cut = || broken("it is truncated".to_owned());
    let (count, rest) = chunk.split_first_chunk::<2>().ok_or_else(cut)?;
    let count = usize::from(u16::from_le_bytes(*count));
    let (heads, mut rest) = rest.split_at_checked(count * HEAD).ok_or_else(cut)?;
    let mut group = Group { index, keys: Default::default(), deltas: Default::default() };
    let mut seen = [[false; 5]; 2];
    for head in heads.as_chunks::<HEAD>().0 {
        let head = Head::parse(head);
        let (payload, after) = rest.split_at_checked(head.packed).ok_or_else(cut)?;
        rest = after;
        let attribute = attribute(head.attribute)?;
        let slot = attribute as usize;
        let values = changing[slot].len() * attribute.channels();
        let (into, expected) = match head.kind {
            KEY => (&mut group.keys[slot], values),
            DELTA => (&mut group.deltas[slot], values.saturating_mul(frames - 1)),
            kind => return Err(broken(format!("a stream is of kind {kind}, expected 0 or 1"))),
        };
        if std::mem::replace(&mut seen[usize::from(head.kind)][slot], true) {
            return Err(broken(format!("two streams of attribute {slot}, kind {}", head.kind)));
        }
        *into = head.unpack(payload, expected, room)?;
    }
    for slot in (0..5).filter(|&slot| !changing[slot].is_empty()) {
        if !seen[0][slot] || (frames > 1 && !seen[1][slot]) {
            return Err(broken(format!("attribute {slot} changes, but its streams are missing")));
        }
    }
    Ok(group)
}

/// A position in the clip: grid points of the changing values at one frame.
#[derive(Debug, Default)]
pub(super) struct Cursor {
    group: Option<Group>,
    /// Within the group.
    frame: usize,
    bins: [Vec<i32>; 5],
}

impl Cursor {
    /// Moves to the first frame of a group, decompressing it if it is not the current one.
    pub(super) fn enter(
        &mut self,
        chunk: &[u8],
        index: usize,
        frames: usize,
        changing: &[Vec<u32>; 5],
        room: &mut u64,
    ) -> Result<(), Splat4dError> {
        // The old group is freed before the new one is allocated.
        let decoded = self.group.take().filter(|group| group.index == index);
        let decoded = match decoded {
            Some(decoded) => decoded,
            None => group(chunk, index, frames, changing, room)?,
        };
        for (bins, key) in self.bins.iter_mut().zip(&decoded.keys) {
            bins.clear();
            key.each(0..key.len(), |_, symbol| bins.push(unzigzag(symbol)));
        }
        self.frame = 0;
        self.group = Some(decoded);
        Ok(())
    }

    /// Whether `frame` of group `index` is ahead, so that [`Cursor::advance`] can reach it.
    pub(super) fn is_before(&self, index: usize, frame: usize) -> bool {
        self.group.as_ref().is_some_and(|group| group.index == index) && self.frame <= frame
    }

    /// Advances to a later `frame` of the current group.
    pub(super) fn advance(&mut self, frame: usize) {
        let Some(group) = &self.group else { return };
        for step in self.frame..frame {
            for (bins, delta) in self.bins.iter_mut().zip(&group.deltas) {
                let start = step * bins.len();
                delta.each(start..start + bins.len(), |at, symbol| {
                    bins[at] = bins[at].wrapping_add(unzigzag(symbol));
                });
            }
        }
        self.frame = frame;
    }

    /// Rows whose changing rotation is zero at this frame.
    pub(super) fn without_rotation<'a>(
        &'a self,
        changing: &'a [Vec<u32>; 5],
    ) -> impl Iterator<Item = usize> + 'a {
        let slot = Attribute::Rot as usize;
        let zero = |(_, bins): &(&u32, &[i32; 4])| **bins == [0; 4];
        changing[slot]
            .iter()
            .zip(self.bins[slot].as_chunks::<4>().0)
            .filter(zero)
            .map(|(&row, _)| row as usize)
    }

    /// Writes the changing values into `splats`, which are otherwise those of [`Fixed::base`].
    pub(super) fn put(&self, fixed: &Fixed, grids: &Grids, splats: &mut Splats) {
        let of = |attribute: Attribute| {
            let slot = attribute as usize;
            (
                fixed.changing[slot].iter().map(|&row| row as usize),
                &self.bins[slot],
                grids.moving[slot],
            )
        };
        let (rows, bins, step) = of(Attribute::Pos);
        for (row, bins) in rows.zip(bins.as_chunks::<3>().0) {
            splats.means[row] = bins.map(|bin| scaled(bin, step));
        }
        let (rows, bins, step) = of(Attribute::Scale);
        for (row, bins) in rows.zip(bins.as_chunks::<3>().0) {
            splats.log_scales[row] = bins.map(|bin| scaled(bin, step));
        }
        let (rows, bins, step) = of(Attribute::Rgb);
        for (row, bins) in rows.zip(bins.as_chunks::<3>().0) {
            splats.sh[row] = bins.map(|bin| dc(f64::from(bin) * step));
        }
        let (rows, bins, step) = of(Attribute::Alpha);
        for (row, &bin) in rows.zip(bins) {
            splats.opacity_logits[row] = logit(f64::from(bin) * step);
        }
        let (rows, bins, step) = of(Attribute::Rot);
        for (row, bins) in rows.zip(bins.as_chunks::<4>().0) {
            splats.quats[row] = bins.map(|bin| part(f64::from(bin) * step));
        }
    }
}
