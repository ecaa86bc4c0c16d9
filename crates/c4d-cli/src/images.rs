//! Image files: PNG, OpenEXR and NumPy arrays.

use crate::failure::{Failure, Outcome};
#[cfg(not(feature = "exr"))]
use crate::features::missing;
use gs_core::Image;
use image::ImageEncoder;
use npyz::WriterBuilder;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes 8 bits per channel: RGB for three channels, grey for one. `path` is for messages.
pub(crate) fn write_png(writer: impl Write, path: &Path, image: &Image) -> Outcome {
    let color = match image.channels {
        1 => image::ExtendedColorType::L8,
        _ => image::ExtendedColorType::Rgb8,
    };
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    image::codecs::png::PngEncoder::new(writer)
        .write_image(&image.to_bytes(), side(image.width), side(image.height), color)
        .map_err(|error| Failure::write(path, &error))
}

/// Always an error: the feature `exr` is not part of this build.
#[cfg(not(feature = "exr"))]
pub(crate) fn write_exr(_path: &Path, _image: &Image, _channels: &[&str]) -> Outcome {
    Err(missing("exr", "--format npy needs none"))
}

/// Writes 32-bit float channels with the given names, one per channel of the image, ZIP-compressed.
#[cfg(feature = "exr")]
pub(crate) fn write_exr(path: &Path, image: &Image, channels: &[&str]) -> Outcome {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes,
        Vec2, WritableImage,
    };
    let list = channels
        .iter()
        .enumerate()
        .map(|(c, name)| {
            let samples = image.data.iter().skip(c).step_by(image.channels).copied().collect();
            AnyChannel::new(*name, FlatSamples::F32(samples))
        })
        .collect();
    let layer = Layer::new(
        Vec2(image.width, image.height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(list),
    );
    ExrImage::from_layer(layer).write().to_file(path).map_err(|error| Failure::write(path, &error))
}

/// Writes a `[height, width, channels]` array of 32-bit floats.
pub(crate) fn write_npy(path: &Path, image: &Image) -> Outcome {
    let file = File::create(path).map_err(|error| Failure::write(path, &error))?;
    let side = |pixels: usize| u64::try_from(pixels).unwrap_or(u64::MAX);
    let write = || -> std::io::Result<()> {
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&[side(image.height), side(image.width), side(image.channels)])
            .writer(BufWriter::new(file))
            .begin_nd()?;
        writer.extend(image.data.iter().copied())?;
        writer.finish()
    };
    write().map_err(|error| Failure::write(path, &error))
}
