//! Networks, preprocessing and tokens against independent implementations (`fixtures/nn-vit`).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use nn_vit::{
    CONTEXT, ClipNetwork, Dino, Lpips, LpipsBackbone, NetworkError, Planes, Preprocessing, Rgb8,
    Tokenizer, WeightTensor, Weights,
};
use std::collections::BTreeMap;
use std::fs;
use test_support::noise::Lcg;
use test_support::{fixture, seeded_weights};

fn text(name: &str) -> String {
    fs::read_to_string(fixture(&format!("nn-vit/{name}"))).unwrap()
}

/// Expected values by name.
fn expected(name: &str) -> Vec<f64> {
    let text = text("expected.txt");
    let line = text.lines().find_map(|line| line.strip_prefix(&format!("{name} ")));
    line.unwrap().split(' ').map(|value| value.parse().unwrap()).collect()
}

fn weights(case: &str) -> Weights {
    let tensors = seeded_weights(case).into_iter();
    Weights(tensors.map(|(name, shape, values)| (name, WeightTensor { shape, values })).collect())
}

/// Stripes with noise.
struct Picture(usize, usize, Vec<u8>);

impl Picture {
    fn new(width: usize, height: usize, seed: u32) -> Self {
        let mut lcg = Lcg(seed);
        let mut pixels = Vec::new();
        for y in 0..height {
            for x in 0..width {
                for c in 0..3 {
                    let stripes = ((x * (3 + c) + y * (5 - c)) % 64) as f64 / 63.0;
                    let value = (0.6 * stripes + 0.4 * lcg.sample()) * 255.0 + 0.5;
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "0 to 255"
                    )]
                    pixels.push(value as u8);
                }
            }
        }
        Self(width, height, pixels)
    }

    fn rgb(&self) -> Rgb8<'_> {
        Rgb8 { width: self.0, height: self.1, pixels: &self.2 }
    }

    fn planes(&self, mode: Preprocessing) -> Planes {
        mode.apply(self.rgb()).unwrap()
    }
}

fn worst(found: impl IntoIterator<Item = f32>, expected: &[f64]) -> f64 {
    let found: Vec<f32> = found.into_iter().collect();
    assert_eq!(found.len(), expected.len(), "number of values");
    found.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
}

#[test]
fn preprocessing_equals_pillow_and_pytorch() {
    let pictures = [("tall", [300, 410], 1), ("wide", [341, 256], 2), ("small", [100, 90], 3)];
    let modes = [
        Preprocessing::Pil,
        Preprocessing::VbenchVideo,
        Preprocessing::Squash,
        Preprocessing::Dino,
    ];
    for (label, [width, height], seed) in pictures {
        let picture = Picture::new(width, height, seed);
        for mode in modes {
            let planes = picture.planes(mode);
            let part = planes
                .values
                .chunks_exact(planes.width)
                .enumerate()
                .filter(|(row, _)| (row % planes.height).is_multiple_of(16))
                .flat_map(|(_, line)| line.iter().copied().step_by(8));
            let expected = expected(&format!("preprocess/{}/{label}", mode.name()));
            let errors: Vec<f64> =
                part.zip(&expected).map(|(a, b)| (f64::from(a) - b).abs()).collect();
            assert_eq!(errors.len(), expected.len(), "{} {label}", mode.name());
            // Halves may be rounded either way: one of 255 levels in a few values.
            let ties = errors.iter().filter(|error| **error > 2e-6).count();
            let worst = errors.iter().fold(0.0, |a: f64, b| a.max(*b));
            let place = format!("{} {label}: {worst:e}, {ties} of {}", mode.name(), errors.len());
            assert!(worst < 1.001 / 255.0 / 0.224 && ties * 100 < errors.len(), "{place}");
        }
    }
    // Negative control: the modes differ.
    let picture = Picture::new(300, 410, 1);
    let [pil, video] = [modes[0], modes[1]].map(|mode| picture.planes(mode).values);
    let video: Vec<f64> = video.into_iter().map(f64::from).collect();
    assert!(worst(pil, &video) > 0.05, "antialiasing is visible");
}

#[test]
fn clip_equals_double_precision() {
    let clip = ClipNetwork::open(&weights("clip")).unwrap();
    assert_eq!((clip.image_size(), clip.num_features()), (224, 32), "sizes");
    let image = Picture::new(300, 410, 1).planes(Preprocessing::Pil);
    let features = clip.image_features(&image).unwrap();
    let error = worst(features, &expected("clip/image"));
    assert!(error < 1e-6, "image: {error:e}");
    let mut tokens = [0; CONTEXT];
    tokens[..6].copy_from_slice(&[598, 17, 230, 5, 411, 599]);
    let error = worst(clip.text_features(&tokens).unwrap(), &expected("clip/text"));
    assert!(error < 1e-6, "text: {error:e}");
    // Negative control: a different word.
    tokens[2] = 231;
    let error = worst(clip.text_features(&tokens).unwrap(), &expected("clip/text"));
    assert!(error > 1e-3, "a different text: {error:e}");
    tokens[2] = 600;
    assert!(clip.text_features(&tokens).is_err(), "a token that is not in the vocabulary");
}

#[test]
fn dino_equals_double_precision_at_any_size() {
    let dino = Dino::open(&weights("dino")).unwrap();
    for (label, [width, height]) in
        [("square", [224, 224]), ("wide", [298, 224]), ("tall", [224, 306])]
    {
        let image = Picture::new(width, height, 4).planes(Preprocessing::Dino);
        let error = worst(dino.features(&image).unwrap(), &expected(&format!("dino/{label}")));
        // worst seen 2.3e-7
        assert!(error < 1e-6, "{label}: {error:e}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let clip = ClipNetwork::open(&weights("clip")).unwrap();
    let lpips = Lpips::open(LpipsBackbone::Alex, &weights("alex"), &weights("alex-heads")).unwrap();
    let (a, b) = (Picture::new(300, 410, 1), Picture::new(300, 410, 2));
    let input = a.planes(Preprocessing::Pil);
    let results: Vec<(Vec<f32>, f64)> = [1, 2, 7]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let features = clip.image_features(&input).unwrap();
                (features, lpips.distance(a.rgb(), b.rgb()).unwrap())
            })
        })
        .collect();
    assert!(results.iter().all(|result| *result == results[0]), "equal");
}

#[test]
fn dino_of_hugging_face_is_the_same_network() {
    let original = weights("dino");
    let mut renamed = Weights::default();
    let width = 128;
    for (name, tensor) in &original.0 {
        let part = |first: &str, second: &str| name.replace(first, second);
        let name = match name.as_str() {
            "cls_token" => "embeddings.cls_token".to_owned(),
            "pos_embed" => "embeddings.position_embeddings".to_owned(),
            _ if name.starts_with("patch_embed.proj") => {
                part("patch_embed.proj", "embeddings.patch_embeddings.projection")
            }
            _ if name.starts_with("norm.") => part("norm.", "layernorm."),
            _ => part("blocks.", "encoder.layer.")
                .replace(".norm1", ".layernorm_before")
                .replace(".norm2", ".layernorm_after")
                .replace(".attn.proj", ".attention.output.dense")
                .replace(".mlp.fc1", ".intermediate.dense")
                .replace(".mlp.fc2", ".output.dense"),
        };
        if !name.contains(".attn.qkv") {
            renamed.0.insert(name, tensor.clone());
            continue;
        }
        let thirds = tensor.values.chunks_exact(tensor.values.len() / 3);
        for (values, third) in thirds.zip(["query", "key", "value"]) {
            let name = name.replace(".attn.qkv", &format!(".attention.attention.{third}"));
            let mut shape = tensor.shape.clone();
            shape[0] = width;
            renamed.0.insert(name, WeightTensor { shape, values: values.to_vec() });
        }
    }
    let image = Picture::new(224, 224, 4).planes(Preprocessing::Dino);
    let [one, other] =
        [&original, &renamed].map(|weights| Dino::open(weights).unwrap().features(&image).unwrap());
    assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-6), "equal features");
}

#[test]
fn lpips_equals_double_precision() {
    let (a, b) = (Picture::new(70, 65, 5), Picture::new(70, 65, 6));
    for (name, backbone) in [("alex", LpipsBackbone::Alex), ("vgg", LpipsBackbone::Vgg)] {
        let heads = weights(&format!("{name}-heads"));
        let lpips = Lpips::open(backbone, &weights(name), &heads).unwrap();
        let expected = expected(&format!("lpips/{name}"))[0];
        let found = lpips.distance(a.rgb(), b.rgb()).unwrap();
        // worst seen 2.2e-6
        assert!((found - expected).abs() < 5e-6 * expected.abs(), "{name}: {found} {expected}");
        assert_eq!(lpips.distance(a.rgb(), a.rgb()).unwrap(), 0.0, "{name}: equal images");
        let small = Picture::new(backbone.min_side(), backbone.min_side(), 1);
        assert!(lpips.distance(small.rgb(), small.rgb()).is_ok(), "{name}: the smallest image");
        let small = Picture::new(backbone.min_side() - 1, 64, 1);
        assert!(lpips.distance(small.rgb(), small.rgb()).is_err(), "{name}: too small");
        assert!(lpips.distance(a.rgb(), small.rgb()).is_err(), "{name}: two sizes");
    }
}

/// CLIP's list of merges, with placeholders for the merges that the test's texts do not use.
fn merges() -> String {
    let known: BTreeMap<usize, String> = text("merges.txt")
        .lines()
        .map(|line| line.split_once(' ').unwrap())
        .map(|(at, merge)| (at.parse().unwrap(), merge.to_owned()))
        .collect();
    let mut lines = vec!["a title".to_owned()];
    for at in 0..49_152 - 258 {
        lines.push(known.get(&at).cloned().unwrap_or_else(|| format!("unused{at} merge{at}")));
    }
    lines.join("\n")
}

#[test]
fn tokens_equal_those_of_clip() {
    let tokenizer = Tokenizer::from_merges(&merges()).unwrap();
    for line in text("tokens.txt").lines() {
        let (text, ids) = line.split_once('\t').unwrap();
        let expected: Vec<u32> = ids.split(' ').map(|id| id.parse().unwrap()).collect();
        let found = tokenizer.encode(text);
        assert_eq!(found[..expected.len()], expected, "{text}");
        assert!(found[expected.len()..].iter().all(|id| *id == 0), "{text}: padding");
    }
    let long = tokenizer.encode(&"cat ".repeat(200));
    assert_eq!((long[1], long[CONTEXT - 1]), (2368, 49407), "a long text is truncated");
}

#[test]
fn malformed_inputs_are_errors() {
    let missing = ClipNetwork::open(&Weights::default()).unwrap_err();
    assert!(missing.to_string().contains("vision_model.embeddings.class_embedding"), "{missing}");
    let mut wrong = weights("dino");
    wrong.0.get_mut("norm.weight").unwrap().shape = vec![3];
    assert!(matches!(Dino::open(&wrong), Err(NetworkError::Shape { .. })), "a wrong shape");
    let mut nan = weights("dino");
    nan.0.get_mut("norm.weight").unwrap().values[0] = f32::NAN;
    assert!(matches!(Dino::open(&nan), Err(NetworkError::NotFinite { .. })), "NaN");
    // Every tensor made empty, or extended by a row.
    for case in ["clip", "dino"] {
        let whole = weights(case);
        for name in whole.0.keys() {
            for rows in [0, 1, whole.0[name].shape[0] + 1] {
                let mut damaged = whole.clone();
                let tensor = damaged.0.get_mut(name).unwrap();
                tensor.shape[0] = rows;
                tensor.values.resize(tensor.shape.iter().product(), 0.0);
                let image = Picture::new(224, 224, 1);
                if let Ok(clip) = ClipNetwork::open(&damaged) {
                    let _ = clip.image_features(&image.planes(Preprocessing::Pil));
                    let _ = clip.text_features(&[599; CONTEXT]);
                }
                if let Ok(dino) = Dino::open(&damaged) {
                    let _ = dino.features(&image.planes(Preprocessing::Dino));
                }
            }
        }
    }
    assert!(Tokenizer::from_merges("title\na b").is_err(), "few merges");
    assert!(Tokenizer::from_merges("title\nab").is_err(), "no pair");
    let empty = Rgb8 { width: 0, height: 3, pixels: &[] };
    assert!(Preprocessing::Pil.apply(empty).is_err(), "an empty image");
}
