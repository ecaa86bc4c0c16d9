//! LPIPS: weighted distances of normalised features of a classification network.

use crate::NetworkError;
use crate::convolution::{Convolution, Maps, max_pool};
use crate::rgb8::Rgb8;
use crate::weights::Weights;
use ndarray::Array1;

const KIND: &str = "torchvision's backbone and the heads of the package lpips 0.1";
/// Mean and deviation of images in [−1, 1].
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Added to the length of a feature vector.
const EPSILON: f32 = 1e-10;

/// Networks of LPIPS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LpipsBackbone {
    /// torchvision's `alexnet`; the default in papers.
    Alex,
    /// torchvision's `vgg16`.
    Vgg,
}

/// A step of a backbone.
#[derive(Debug, Clone, Copy)]
enum BackboneStep {
    /// Index in torchvision's `features`; outputs, inputs, kernel; stride, padding.
    Convolution(usize, [usize; 3], [usize; 2]),
    /// Size and stride.
    MaxPool(usize, usize),
    /// Features are compared here.
    Compare,
}

const ALEX: &[BackboneStep] = {
    use BackboneStep::{Compare, Convolution, MaxPool};
    &[
        Convolution(0, [64, 3, 11], [4, 2]),
        Compare,
        MaxPool(3, 2),
        Convolution(3, [192, 64, 5], [1, 2]),
        Compare,
        MaxPool(3, 2),
        Convolution(6, [384, 192, 3], [1, 1]),
        Compare,
        Convolution(8, [256, 384, 3], [1, 1]),
        Compare,
        Convolution(10, [256, 256, 3], [1, 1]),
        Compare,
    ]
};

const VGG: &[BackboneStep] = {
    use BackboneStep::{Compare, Convolution, MaxPool};
    &[
        Convolution(0, [64, 3, 3], [1, 1]),
        Convolution(2, [64, 64, 3], [1, 1]),
        Compare,
        MaxPool(2, 2),
        Convolution(5, [128, 64, 3], [1, 1]),
        Convolution(7, [128, 128, 3], [1, 1]),
        Compare,
        MaxPool(2, 2),
        Convolution(10, [256, 128, 3], [1, 1]),
        Convolution(12, [256, 256, 3], [1, 1]),
        Convolution(14, [256, 256, 3], [1, 1]),
        Compare,
        MaxPool(2, 2),
        Convolution(17, [512, 256, 3], [1, 1]),
        Convolution(19, [512, 512, 3], [1, 1]),
        Convolution(21, [512, 512, 3], [1, 1]),
        Compare,
        MaxPool(2, 2),
        Convolution(24, [512, 512, 3], [1, 1]),
        Convolution(26, [512, 512, 3], [1, 1]),
        Convolution(28, [512, 512, 3], [1, 1]),
        Compare,
    ]
};

impl LpipsBackbone {
    fn steps(self) -> &'static [BackboneStep] {
        match self {
            Self::Alex => ALEX,
            Self::Vgg => VGG,
        }
    }

    /// Smallest side of an image, pixels: the last feature map has at least one pixel.
    pub fn min_side(self) -> usize {
        match self {
            Self::Alex => 31,
            Self::Vgg => 16,
        }
    }
}

/// LPIPS, version 0.1.
///
/// Zhang et al. 2018, The Unreasonable Effectiveness of Deep Features as a Perceptual Metric.
#[derive(Debug, Clone)]
pub struct Lpips {
    backbone: LpipsBackbone,
    convolutions: Vec<Convolution>,
    /// Weights of the channels at each comparison.
    heads: Vec<Array1<f32>>,
}

impl Lpips {
    /// The network with these weights of the backbone (`features.0.weight`, …) and of the heads
    /// (`lin0.model.1.weight`, …).
    ///
    /// # Errors
    /// If a tensor is missing, has a different shape, or is not finite.
    pub fn open(
        backbone: LpipsBackbone,
        weights: &Weights,
        heads: &Weights,
    ) -> Result<Self, NetworkError> {
        let (mut convolutions, mut lines) = (Vec::new(), Vec::new());
        let mut channels = 0;
        for step in backbone.steps() {
            match *step {
                BackboneStep::Convolution(index, shape, geometry) => {
                    let name = format!("features.{index}");
                    convolutions.push(Convolution::open(weights, &name, shape, geometry, KIND)?);
                    channels = shape[0];
                }
                BackboneStep::MaxPool(..) => {}
                BackboneStep::Compare => {
                    let name = format!("lin{}.model.1.weight", lines.len());
                    let values = heads.values(&name, &[1, channels, 1, 1], KIND)?;
                    lines.push(Array1::from(values.to_vec()));
                }
            }
        }
        Ok(Self { backbone, convolutions, heads: lines })
    }

    /// Distance of two images of the same size, 0 or more; 0 for equal ones. Lower is better.
    ///
    /// # Errors
    /// If the sizes differ or are below [`LpipsBackbone::min_side`].
    pub fn distance(&self, first: Rgb8<'_>, second: Rgb8<'_>) -> Result<f64, NetworkError> {
        let min_side = self.backbone.min_side();
        for Rgb8 { width, height, pixels } in [first, second] {
            let fits = (width, height) == (first.width, first.height)
                && pixels.len() == width * height * 3
                && width.min(height) >= min_side;
            if !fits {
                return Err(NetworkError::Image { width, height, len: pixels.len(), min_side });
            }
        }
        let [first, second] = [first, second].map(|image| self.features(image));
        let parts = first.iter().zip(&second).zip(&self.heads);
        Ok(parts.map(|((first, second), head)| difference(first, second, head)).sum())
    }

    fn features(&self, image: Rgb8<'_>) -> Vec<Maps> {
        let plane = |c: usize| {
            let scaled = move |&v: &u8| (f32::from(v) / 127.5 - 1.0 - SHIFT[c]) / SCALE[c];
            image.pixels.iter().skip(c).step_by(3).map(scaled)
        };
        let Rgb8 { width, height, .. } = image;
        let mut x = Maps { channels: 3, height, width, values: (0..3).flat_map(plane).collect() };
        let mut convolutions = self.convolutions.iter();
        let mut found = Vec::new();
        for step in self.backbone.steps() {
            match *step {
                BackboneStep::Convolution(..) => {
                    if let Some(convolution) = convolutions.next() {
                        x = convolution.apply(&x);
                    }
                }
                BackboneStep::MaxPool(size, stride) => x = max_pool(&x, size, stride),
                BackboneStep::Compare => found.push(x.clone()),
            }
        }
        found
    }
}

/// `Σ_c w_c (a_c/|a| − b_c/|b|)²`, averaged over the pixels.
fn difference(first: &Maps, second: &Maps, head: &Array1<f32>) -> f64 {
    let pixels = first.height * first.width;
    let length = |maps: &Maps, p: usize| {
        let squares = (0..maps.channels).map(|c| maps.values[c * pixels + p].powi(2));
        squares.sum::<f32>().sqrt() + EPSILON
    };
    let mut sum = 0.0;
    for p in 0..pixels {
        let (a, b) = (length(first, p), length(second, p));
        for (c, weight) in head.iter().enumerate() {
            let at = c * pixels + p;
            sum += f64::from(weight * (first.values[at] / a - second.values[at] / b).powi(2));
        }
    }
    sum / pixels as f64
}
