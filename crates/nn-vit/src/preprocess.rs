//! Conversion of 8-bit images to network inputs, as in different programs. Features differ by up to
//! a few thousandths, so every reported number should state its mode.

use crate::NetworkError;
use crate::pil;
use crate::rgb8::Rgb8;

/// Side of the networks' input, pixels.
pub(crate) const SIDE: usize = 224;
const CLIP: Normalisation = Normalisation {
    mean: [0.481_454_66, 0.457_827_5, 0.408_210_73],
    std: [0.268_629_54, 0.261_302_6, 0.275_777_1],
};
const IMAGENET: Normalisation =
    Normalisation { mean: [0.485, 0.456, 0.406], std: [0.229, 0.224, 0.225] };
/// Parameter of PyTorch's bicubic interpolation.
const BICUBIC: f64 = -0.75;

struct Normalisation {
    mean: [f32; 3],
    std: [f32; 3],
}

/// The input of a network: an image whose channels are normalised by the mean and deviation of the
/// training images.
#[derive(Debug, Clone, PartialEq)]
pub struct Planes {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// RGB, `[3, height, width]`, row-major.
    pub values: Vec<f32>,
}

impl Planes {
    pub(crate) fn index(&self, channel: usize, row: usize, column: usize) -> usize {
        (channel * self.height + row) * self.width + column
    }
}

/// Conversion of an image to the input of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preprocessing {
    /// CLIP's own code: Pillow's bicubic filter (antialiased) to a short side of 224, centre crop.
    /// Also VBench's background consistency from frames.
    Pil,
    /// VBench's background consistency from videos: PyTorch's bicubic interpolation of 8-bit
    /// tensors, without antialiasing, rounded to 8 bits; centre crop.
    VbenchVideo,
    /// CLIP metrics of Instruct-NeRF2NeRF and its successors: the whole image squashed to 224×224
    /// by PyTorch's bicubic interpolation, neither rounded nor clamped.
    Squash,
    /// VBench's subject consistency: PyTorch's bilinear interpolation of 8-bit tensors to a short
    /// side of 224, rounded to 8 bits, not cropped; ImageNet's mean and deviation.
    Dino,
}

impl Preprocessing {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pil => "pil",
            Self::VbenchVideo => "vbench-video",
            Self::Squash => "ip2p",
            Self::Dino => "vbench-dino",
        }
    }

    /// The input of the network, `[3, height, width]`.
    ///
    /// # Errors
    /// If the image is empty or the size of its buffer does not match.
    pub fn apply(self, image: Rgb8<'_>) -> Result<Planes, NetworkError> {
        let Rgb8 { width, height, pixels } = image;
        if width == 0 || height == 0 || pixels.len() != width * height * 3 {
            let len = pixels.len();
            return Err(NetworkError::Image { width, height, len, min_side: 1 });
        }
        let [rows, columns] = short_side(height, width);
        let planes = match self {
            Self::Pil => {
                let resized = pil::resize(image, columns, rows);
                crop(&to_planes(&resized, rows, columns))
            }
            Self::VbenchVideo => crop(&resized(image, rows, columns, bicubic, true)),
            Self::Squash => resized(image, SIDE, SIDE, bicubic, false),
            Self::Dino => resized(image, rows, columns, bilinear, true),
        };
        Ok(normalised(planes, if self == Self::Dino { &IMAGENET } else { &CLIP }))
    }
}

/// Rows and columns if the short side is 224, the long one truncated as in torchvision.
fn short_side(height: usize, width: usize) -> [usize; 2] {
    if height <= width { [SIDE, SIDE * width / height] } else { [SIDE * height / width, SIDE] }
}

/// 8-bit pixels as planes, 0 to 255.
fn to_planes(pixels: &[u8], height: usize, width: usize) -> Planes {
    let channel = |c: usize| pixels.iter().skip(c).step_by(3).map(|&v| f32::from(v));
    Planes { width, height, values: (0..3).flat_map(channel).collect() }
}

/// An interpolation of PyTorch: values, sizes, new sizes, and source pixels per new pixel.
type Interpolation = fn(&[f32], [usize; 2], [usize; 2], [f64; 2]) -> Vec<f32>;

/// PyTorch's interpolation of all planes, with `align_corners=False`; for 8-bit tensors the result
/// is 8-bit again.
fn resized(
    image: Rgb8<'_>,
    rows: usize,
    columns: usize,
    interpolation: Interpolation,
    is_8_bit: bool,
) -> Planes {
    let planes = to_planes(image.pixels, image.height, image.width);
    let scale = [image.height as f64 / rows as f64, image.width as f64 / columns as f64];
    let mut values = Vec::with_capacity(3 * rows * columns);
    for plane in planes.values.chunks_exact(image.width * image.height) {
        values.extend(interpolation(plane, [image.height, image.width], [rows, columns], scale));
    }
    if is_8_bit {
        for value in &mut values {
            *value = value.clamp(0.0, 255.0).round_ties_even();
        }
    }
    Planes { width: columns, height: rows, values }
}

/// The central square, with Python's rounding of halves.
fn crop(planes: &Planes) -> Planes {
    let first = |size: usize| {
        let half = (size - SIDE) / 2;
        // n + ½ becomes the even neighbour.
        if (size - SIDE) % 2 == 1 && half % 2 == 1 { half + 1 } else { half }
    };
    let (top, left) = (first(planes.height), first(planes.width));
    let mut values = Vec::with_capacity(3 * SIDE * SIDE);
    for channel in 0..3 {
        for row in 0..SIDE {
            let at = planes.index(channel, top + row, left);
            values.extend_from_slice(&planes.values[at..at + SIDE]);
        }
    }
    Planes { width: SIDE, height: SIDE, values }
}

fn normalised(mut planes: Planes, Normalisation { mean, std }: &Normalisation) -> Planes {
    let len = planes.width * planes.height;
    for (channel, plane) in planes.values.chunks_exact_mut(len).enumerate() {
        for value in plane {
            *value = (*value / 255.0 - mean[channel]) / std[channel];
        }
    }
    planes
}

/// PyTorch's bicubic interpolation without antialiasing. `scale` is the distance of two new
/// samples, in units of old ones.
pub(crate) fn bicubic(
    values: &[f32],
    from: [usize; 2],
    to: [usize; 2],
    scale: [f64; 2],
) -> Vec<f32> {
    let weight = |distance: f64| {
        let (a, x) = (BICUBIC, distance.abs());
        if x <= 1.0 {
            ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0
        } else if x < 2.0 {
            ((x - 5.0) * x + 8.0) * a * x - 4.0 * a
        } else {
            0.0
        }
    };
    let taps = |axis: usize| -> Vec<[(usize, f64); 4]> {
        let last = from[axis].cast_signed() - 1;
        (0..to[axis])
            .map(|at| {
                let source = (at as f64 + 0.5) * scale[axis] - 0.5;
                let floor = source.floor();
                [-1.0, 0.0, 1.0, 2.0]
                    .map(|step| (clamped(floor + step, last), weight(source - floor - step)))
            })
            .collect()
    };
    separable(values, from, &taps(0), &taps(1))
}

/// PyTorch's bilinear interpolation without antialiasing.
fn bilinear(values: &[f32], from: [usize; 2], to: [usize; 2], scale: [f64; 2]) -> Vec<f32> {
    let taps = |axis: usize| -> Vec<[(usize, f64); 2]> {
        let last = from[axis].cast_signed() - 1;
        (0..to[axis])
            .map(|at| {
                let source = ((at as f64 + 0.5) * scale[axis] - 0.5).max(0.0);
                let floor = source.floor();
                let part = source - floor;
                [(clamped(floor, last), 1.0 - part), (clamped(floor + 1.0, last), part)]
            })
            .collect()
    };
    separable(values, from, &taps(0), &taps(1))
}

/// An index within the image.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the image")]
fn clamped(at: f64, last: isize) -> usize {
    (at as isize).clamp(0, last.max(0)) as usize
}

/// Weighted sums over columns, then rows.
fn separable<const N: usize>(
    values: &[f32],
    [_, width]: [usize; 2],
    rows: &[[(usize, f64); N]],
    columns: &[[(usize, f64); N]],
) -> Vec<f32> {
    let mut out = Vec::with_capacity(rows.len() * columns.len());
    for row in rows {
        for column in columns {
            let mut sum = 0.0;
            for &(y, wy) in row {
                let line = &values[y * width..(y + 1) * width];
                sum += wy * column.iter().map(|&(x, wx)| wx * f64::from(line[x])).sum::<f64>();
            }
            #[expect(clippy::cast_possible_truncation, reason = "images are single precision")]
            out.push(sum as f32);
        }
    }
    out
}
