//! A picture of uncovered background: a red board has moved away from a green wall that it hid in
//! the edited frame.
//!
//! From left to right: the edited frame; the later frame before refinement, which is the ground
//! truth; after refinement; after refinement without the occlusion test, which paints the wall in
//! the colour of the board.
//!
//! `cargo run --release -p cuar --example uncovered [uncovered.png]`
#![expect(clippy::print_stdout, reason = "prints its results")]

#[path = "../tests/suite/common/mod.rs"]
mod common;

use common::{render, slide::Slide};
use gs_core::Image;
use std::error::Error;

/// Output pixels per pixel.
const ZOOM: usize = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "uncovered.png".to_owned());
    let scene = Slide::new();
    let camera = &Slide::cameras(128, 96)[1];
    let (ours, untested) = (scene.refined(true), scene.refined(false));
    let before = render(&scene, 1.0, camera);
    let after = [&ours, &untested].map(|refined| render(&refined.scene(&scene), 1.0, camera));
    for (name, image) in ["with the occlusion test", "without"].into_iter().zip(&after) {
        let (mut wall, mut board, mut count) = (0.0, 0.0, 0.0);
        for (x, y) in (28..68).flat_map(|y| (46..74).map(move |x| (x, y))) {
            let distance = |other: &[f32]| {
                let own = image.pixel(x, y).iter().zip(other);
                own.map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
            };
            wall += distance(before.pixel(x, y));
            board += distance(&Slide::BOARD);
            count += 1.0;
        }
        let (wall, board) = (wall / count, board / count);
        println!(
            "{name}: uncovered wall is {wall:.4} from the wall's colour, {board:.4} from the board's"
        );
    }
    let first = render(&scene, 0.0, camera);
    let images: [&Image; 4] = [&first, &before, &after[0], &after[1]];
    let (width, height) = (before.width * ZOOM, before.height * ZOOM);
    let mut bytes = Vec::with_capacity(width * height * 3 * images.len());
    for y in 0..height {
        for image in images {
            for x in 0..width {
                for value in image.pixel(x / ZOOM, y / ZOOM) {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "clamped to 0..=255"
                    )]
                    bytes.push((value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
                }
            }
        }
    }
    let (width, height) = (u32::try_from(width * images.len())?, u32::try_from(height)?);
    image::save_buffer(&path, &bytes, width, height, image::ColorType::Rgb8)?;
    println!("{path}");
    Ok(())
}
