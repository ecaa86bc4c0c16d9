//! Renders a scene at given times, reusing memory between frames.

use crate::device::{self, Device};
use crate::failure::{Failure, Outcome, chain};
use gs_core::{Camera, DynamicScene, Image, Rasterizer, RenderOutput, RenderParams, Splats};
use gs_raster_cpu::CpuRasterizer;
#[cfg(feature = "gpu")]
use gs_raster_wgpu::WgpuRasterizer;

/// A rasteriser with the buffers of its last frame.
#[derive(Debug)]
pub(crate) struct Renderer {
    engine: Engine,
    splats: Splats,
    output: RenderOutput,
    params: RenderParams,
}

#[derive(Debug)]
enum Engine {
    Cpu(Box<Stage<CpuRasterizer>>),
    #[cfg(feature = "gpu")]
    Gpu(Box<Stage<WgpuRasterizer>>),
}

#[derive(Debug)]
struct Stage<R: Rasterizer> {
    raster: R,
    prepared: Option<R::Prepared>,
}

impl<R: Rasterizer> Stage<R> {
    fn render(
        &mut self,
        splats: &Splats,
        camera: &Camera,
        params: &RenderParams,
        output: &mut RenderOutput,
    ) -> Result<(), gs_core::RasterError> {
        match &mut self.prepared {
            Some(prepared) => self.raster.prepare_into(splats, camera, prepared)?,
            None => self.prepared = Some(self.raster.prepare(splats, camera)?),
        }
        match &mut self.prepared {
            Some(prepared) => self.raster.forward_into(prepared, splats, &[], params, output),
            None => Ok(()),
        }
    }
}

impl Renderer {
    /// Renders on this device over this background.
    pub(crate) fn new(device: &Device, background: [f32; 3]) -> Self {
        let engine = match device {
            Device::Cpu => {
                Engine::Cpu(Box::new(Stage { raster: CpuRasterizer::default(), prepared: None }))
            }
            #[cfg(feature = "gpu")]
            Device::Gpu(raster) => {
                Engine::Gpu(Box::new(Stage { raster: raster.clone(), prepared: None }))
            }
        };
        let params =
            RenderParams { background: background.map(f64::from), ..RenderParams::default() };
        Self { engine, splats: Splats::default(), output: RenderOutput::default(), params }
    }

    /// Sets the time of the scene for following renders.
    pub(crate) fn seek(&mut self, scene: &dyn DynamicScene, t: f32) -> Outcome {
        scene.at_into(t, &mut self.splats).map_err(|error| Failure::bad_input(chain(&error)))
    }

    /// Renders the scene at the time set by [`Renderer::seek`].
    pub(crate) fn render(&mut self, camera: &Camera) -> Outcome<&RenderOutput> {
        let Self { engine, splats, output, params } = self;
        match engine {
            Engine::Cpu(stage) => stage.render(splats, camera, params, output),
            #[cfg(feature = "gpu")]
            Engine::Gpu(stage) => stage.render(splats, camera, params, output),
        }
        .map_err(|error| device::failure(&error))?;
        Ok(output)
    }

    /// As [`Renderer::render`]; also returns the rendered splats.
    pub(crate) fn render_with_splats(
        &mut self,
        camera: &Camera,
    ) -> Outcome<(&RenderOutput, &Splats)> {
        self.render(camera)?;
        Ok((&self.output, &self.splats))
    }
}

/// Two images of the same height, side by side with a thin grey line between them.
pub(crate) fn side_by_side(left: &Image, right: &Image) -> Image {
    const LINE: usize = 4;
    let (height, channels) = (left.height.min(right.height), left.channels);
    let mut joined = Image::zeros(left.width + LINE + right.width, height, channels);
    for y in 0..height {
        let start = y * joined.width * channels;
        let row = &mut joined.data[start..start + joined.width * channels];
        let (l, rest) = row.split_at_mut(left.width * channels);
        let (line, r) = rest.split_at_mut(LINE * channels);
        l.copy_from_slice(&left.data[y * left.width * channels..][..left.width * channels]);
        line.fill(0.5);
        r.copy_from_slice(&right.data[y * right.width * channels..][..right.width * channels]);
    }
    joined
}

/// Images of one size in a grid, each reduced by averaging so that the sheet is at most `max_width`
/// pixels wide. The number of columns gives the sheet about the aspect ratio of a screen.
pub(crate) fn contact_sheet(images: &[Image], max_width: usize) -> Image {
    const GAP: usize = 4;
    const SCREEN_ASPECT: f64 = 1.6;
    let Some(first) = images.first() else { return Image::default() };
    let aspect = first.width as f64 / first.height.max(1) as f64;
    let sheet_aspect = |columns: usize| {
        let error = columns as f64 * aspect / images.len().div_ceil(columns) as f64 / SCREEN_ASPECT;
        error.ln().abs()
    };
    let columns = (1..=images.len())
        .min_by(|&a, &b| sheet_aspect(a).total_cmp(&sheet_aspect(b)))
        .unwrap_or(1);
    let rows = images.len().div_ceil(columns);
    let factor = (first.width * columns).div_ceil(max_width).max(1);
    let (width, height) = ((first.width / factor).max(1), (first.height / factor).max(1));
    let mut sheet = Image::zeros(
        columns * width + (columns - 1) * GAP,
        rows * height + (rows - 1) * GAP,
        first.channels,
    );
    sheet.data.fill(1.0);
    for (i, image) in images.iter().enumerate() {
        let (left, top) = ((i % columns) * (width + GAP), (i / columns) * (height + GAP));
        for y in 0..height {
            for x in 0..width {
                let mean = box_mean(image, x * factor, y * factor, factor);
                sheet.pixel_mut(left + x, top + y).copy_from_slice(&mean);
            }
        }
    }
    sheet
}

fn box_mean(image: &Image, x0: usize, y0: usize, side: usize) -> Vec<f32> {
    let mut sum = vec![0.0; image.channels];
    let mut count = 0.0_f32;
    for y in y0..(y0 + side).min(image.height) {
        for x in x0..(x0 + side).min(image.width) {
            for (total, value) in sum.iter_mut().zip(image.pixel(x, y)) {
                *total += value.clamp(0.0, 1.0);
            }
            count += 1.0;
        }
    }
    sum.iter().map(|total| total / count.max(1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_sheets_arrange_and_average_images() {
        let image = |value: f32| Image::from_data(4, 4, 1, vec![value; 16]).unwrap();
        let sheet = contact_sheet(&[image(0.25), image(0.75), image(0.5)], 4);
        assert_eq!(
            (sheet.width, sheet.height),
            (2 * 2 + 4, 2 * 2 + 4),
            "halved, 2×2 grid with gaps"
        );
        assert_eq!(sheet.pixel(0, 0), [0.25], "first");
        assert_eq!(sheet.pixel(6, 0), [0.75], "second");
        assert_eq!(sheet.pixel(0, 6), [0.5], "third, below");
        assert_eq!(sheet.pixel(7, 6), [1.0], "empty cell");
    }

    #[test]
    fn side_by_side_contains_both_images() {
        let joined = side_by_side(
            &Image::from_data(1, 1, 3, vec![0.1; 3]).unwrap(),
            &Image::from_data(1, 1, 3, vec![0.9; 3]).unwrap(),
        );
        assert_eq!(joined.width, 6, "1 + 4 + 1");
        assert_eq!(joined.pixel(0, 0), [0.1; 3], "left");
        assert_eq!(joined.pixel(5, 0), [0.9; 3], "right");
    }
}
