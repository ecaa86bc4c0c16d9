//! Seeded random weights of the networks in `fixtures/nn-vit`.

use crate::fixture::fixture;
use crate::noise::Lcg;
use std::fs;

/// A tensor: name, shape, row-major values.
pub type SeededTensor = (String, Vec<usize>, Vec<f32>);

/// The tensors of a case (`clip`, `dino`, `alex`, `vgg`, or the heads of the last two), as the
/// script next to the fixtures makes them.
///
/// # Panics
/// If the fixture is missing or malformed.
#[expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
pub fn seeded_weights(case: &str) -> Vec<SeededTensor> {
    let text = fs::read_to_string(fixture("nn-vit/shapes.txt")).unwrap();
    let mut tensors = Vec::new();
    let mut lcg = None;
    for line in text.lines() {
        let fields: Vec<&str> = line.split(' ').collect();
        if fields[0] != case {
            continue;
        }
        let lcg = lcg.get_or_insert_with(|| Lcg(fields[1].parse().unwrap()));
        let name = fields[2].to_owned();
        let shape: Vec<usize> = fields[3..].iter().map(|size| size.parse().unwrap()).collect();
        let fan_in: usize = shape[1..].iter().product();
        let scaled = |value: f64| {
            let u = 2.0 * value - 1.0;
            let value = if shape.len() > 1 {
                u * (3.0 / fan_in as f64).sqrt()
            } else {
                0.1 * u + if name.ends_with("weight") { 1.0 } else { 0.0 }
            };
            #[expect(clippy::cast_possible_truncation, reason = "weights are single precision")]
            let value = value as f32;
            value
        };
        let values = lcg.take(shape.iter().product()).into_iter().map(scaled).collect();
        tensors.push((name.clone(), shape.clone(), values));
    }
    tensors
}
