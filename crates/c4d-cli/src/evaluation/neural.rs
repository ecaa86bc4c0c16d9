//! Neural metrics: CLIP, consistency as in VBench, LPIPS.

use super::item::Item;
use super::networks::{Loaded, Networks};
use super::pictures::Sight;
use super::series::{Series, mean};
use super::truth::Truth;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::renderer::Renderer;
use gs_core::Image;
use nn_vit::{ClipNetwork, NetworkError, Planes, Preprocessing, Rgb8};

/// Maximum number of frames per view that are compared with a text, evenly spaced.
const FRAMES: usize = 30;
/// Norm of a feature change below which its direction is undefined.
const NO_CHANGE: f32 = 1e-6;

/// Texts that images are compared with.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Prompts<'a> {
    /// Description of the edited scene.
    pub(crate) edit: Option<&'a str>,
    /// Description of the source.
    pub(crate) source: Option<&'a str>,
}

/// Indices of the frames that are compared with a text: `round(k (T − 1)/29)`; all if there are at
/// most 30.
pub(crate) fn sampled_frames(count: usize) -> Vec<usize> {
    if count <= FRAMES {
        return (0..count).collect();
    }
    (0..FRAMES).map(|k| (k * (count - 1) + (FRAMES - 1) / 2) / (FRAMES - 1)).collect()
}

/// Features of all frames of a view, for the edit and for its source.
type Pair = [Vec<Vec<f32>>; 2];

/// Features and distances of the rendered images.
struct Features {
    /// CLIP, with CLIP's own preprocessing, `[V]`.
    clip: Vec<Pair>,
    /// CLIP, with VBench's preprocessing.
    background: Vec<Pair>,
    /// DINO.
    subject: Vec<Pair>,
    lpips: [Series; 2],
}

/// Renders all views and computes the neural metrics.
pub(crate) fn neural(
    sight: &mut Sight<'_>,
    device: &Device,
    networks: &Networks,
    prompts: Prompts<'_>,
) -> Outcome<Vec<Item>> {
    let views = sight.cameras.len();
    let empty = || vec![Pair::default(); views];
    let lpips = || Series::new(views, sight.times.len());
    let mut found = Features {
        clip: empty(),
        background: empty(),
        subject: empty(),
        lpips: [lpips(), lpips()],
    };
    let scenes =
        [Some(sight.subject.scene), sight.subject.edit.as_ref().map(|_| sight.subject.source)];
    let mut renderers = scenes.map(|scene| scene.map(|_| Renderer::new(device, sight.background)));
    let mut progress = sight.console.progress("features", (sight.times.len() * views) as u64);
    for (frame, &t) in sight.times.iter().enumerate() {
        if let Some(truth) = &mut sight.truth {
            truth.seek(t)?;
        }
        for (scene, renderer) in scenes.iter().zip(&mut renderers) {
            if let (Some(scene), Some(renderer)) = (scene, renderer) {
                renderer.seek(*scene, t)?;
            }
        }
        for (view, camera) in sight.cameras.iter().enumerate() {
            for (side, renderer) in renderers.iter_mut().enumerate() {
                let Some(renderer) = renderer else { continue };
                let mut picture = renderer.render(camera)?.rgb_image();
                if let Some(retouch) = sight.retouch.filter(|_| side == 0) {
                    picture = retouch(view, frame, picture);
                }
                found.add(networks, &picture, [view, side])?;
                if side == 0
                    && networks.lpips.iter().any(Option::is_some)
                    && let Some(truth) = &mut sight.truth
                    && let Some(truth) = truth.picture(camera, t)?
                {
                    found.compare(networks, [&picture, &truth], [view, frame])?;
                }
            }
            progress.step();
        }
    }
    progress.finish();
    items(sight, networks, prompts, &found)
}

/// An image's bytes.
struct Bytes {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Bytes {
    fn of(image: &Image) -> Self {
        Self { width: image.width, height: image.height, pixels: image.to_bytes() }
    }

    fn rgb(&self) -> Rgb8<'_> {
        Rgb8 { width: self.width, height: self.height, pixels: &self.pixels }
    }

    fn planes(&self, mode: Preprocessing) -> Outcome<Planes> {
        mode.apply(self.rgb()).map_err(|error| refused(&error))
    }
}

fn refused(error: &NetworkError) -> Failure {
    Failure::failed(error.to_string())
}

impl Features {
    fn add(&mut self, networks: &Networks, picture: &Image, [view, side]: [usize; 2]) -> Outcome {
        let bytes = Bytes::of(picture);
        if let Some(Loaded { network: clip, .. }) = &networks.clip {
            let features =
                |mode| clip.image_features(&bytes.planes(mode)?).map_err(|error| refused(&error));
            self.clip[view][side].push(features(Preprocessing::Pil)?);
            self.background[view][side].push(features(Preprocessing::VbenchVideo)?);
        }
        if let Some(Loaded { network: dino, .. }) = &networks.dino {
            let planes = bytes.planes(Preprocessing::Dino)?;
            let features = dino.features(&planes).map_err(|error| refused(&error))?;
            self.subject[view][side].push(features);
        }
        Ok(())
    }

    /// Computes LPIPS; images smaller than a backbone's minimum size have no value.
    fn compare(
        &mut self,
        networks: &Networks,
        pair: [&Image; 2],
        [view, frame]: [usize; 2],
    ) -> Outcome {
        let [one, other] = pair.map(Bytes::of);
        for (series, lpips) in self.lpips.iter_mut().zip(&networks.lpips) {
            let Some(Loaded { network, .. }) = lpips else { continue };
            match network.distance(one.rgb(), other.rgb()) {
                Ok(distance) => series.set(view, frame, Some(distance)),
                Err(NetworkError::Image { .. }) => {}
                Err(error) => return Err(refused(&error)),
            }
        }
        Ok(())
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum()
}

/// Cosine of the angle between `a1 − a0` and `b1 − b0`; `None` if either is shorter than
/// [`NO_CHANGE`].
fn direction(a: [&[f32]; 2], b: [&[f32]; 2]) -> Option<f64> {
    let change = |[from, to]: [&[f32]; 2]| -> Vec<f32> {
        from.iter().zip(to).map(|(from, to)| to - from).collect()
    };
    let (a, b) = (change(a), change(b));
    let lengths = [dot(&a, &a).sqrt(), dot(&b, &b).sqrt()];
    let defined = lengths.iter().all(|length| *length > f64::from(NO_CHANGE));
    defined.then(|| dot(&a, &b) / (lengths[0] * lengths[1]))
}

/// VBench's consistency of a video: for each frame after the first, the average similarity to the
/// previous and the first frame, each clamped to at least 0; then the mean over frames.
fn consistency(frames: &[Vec<f32>]) -> Option<f64> {
    let similar = |a: &[f32], b: &[f32]| dot(a, b).max(0.0);
    mean(
        frames
            .windows(2)
            .map(|pair| 0.5 * (similar(&pair[0], &pair[1]) + similar(&frames[0], &pair[1]))),
    )
}

fn items(
    sight: &Sight<'_>,
    networks: &Networks,
    prompts: Prompts<'_>,
    found: &Features,
) -> Outcome<Vec<Item>> {
    let mut items = clip_items(sight, networks, prompts, &found.clip)?;
    let is_edited = sight.subject.edit.is_some();
    let score = |views: &[Pair], side: usize| -> Vec<Option<f64>> {
        views.iter().map(|view| consistency(&view[side])).collect()
    };
    let mut parts = Vec::new();
    for (id, source, views, file, mode) in [
        (
            "vbench_subject_consistency",
            "vbench_subject_consistency_src",
            &found.subject,
            networks.dino.as_ref().map(|loaded| &loaded.file),
            Preprocessing::Dino,
        ),
        (
            "vbench_background_consistency",
            "vbench_background_consistency_src",
            &found.background,
            networks.clip.as_ref().map(|loaded| &loaded.file),
            Preprocessing::VbenchVideo,
        ),
    ] {
        let Some(file) = file else {
            let which = if mode == Preprocessing::Dino { "DINO ViT-B/16" } else { "CLIP ViT-B/32" };
            items.push(lacking(id, which));
            items.push(lacking(source, which));
            continue;
        };
        let item = |id: &str, values| {
            Item::of_views(id, values).with("preprocessing", mode.name()).weights(file)
        };
        let values = score(views, 0);
        parts.push(values.clone());
        items.push(item(id, values));
        items.push(if is_edited {
            item(source, score(views, 1))
        } else {
            Item::missing(source, "the scene is not a run: nothing was edited")
        });
    }
    items.push(match &parts[..] {
        [subject, background] => {
            let both = subject.iter().zip(background);
            let values = both.map(|(a, b)| Some(f64::midpoint((*a)?, (*b)?))).collect();
            Item::of_views("vbench_consistency", values)
        }
        _ => lacking("vbench_consistency", "DINO ViT-B/16 and CLIP ViT-B/32"),
    });
    let lpips = ["lpips_alex", "lpips_vgg"].into_iter().zip(&found.lpips).zip(&networks.lpips);
    for ((id, series), network) in lpips {
        items.push(match (network, &sight.truth) {
            (None, _) if id == "lpips_alex" => lacking(id, "AlexNet, and LPIPS heads for it"),
            (None, _) => lacking(id, "VGG-16, and LPIPS heads for it"),
            (_, None) => Item::missing(id, "no ground truth given (--truth)"),
            (Some(loaded), Some(truth)) => {
                let truth = match truth {
                    Truth::Scene { .. } => "scene",
                    Truth::Photos(_) => "photographs",
                };
                Item::of_frames(id, series).with("truth", truth).weights(&loaded.file)
            }
        });
    }
    Ok(items)
}

/// An item without a value because weights are missing.
fn lacking(id: &str, which: &str) -> Item {
    Item::missing(id, &format!("needs --weights with {which}"))
}

const CLIP_IDS: [&str; 4] =
    ["clip_text_sim", "clip_direction_sim", "clip_frame_consistency", "clip_direction_consistency"];

fn clip_items(
    sight: &Sight<'_>,
    networks: &Networks,
    prompts: Prompts<'_>,
    views: &[Pair],
) -> Outcome<Vec<Item>> {
    let Some(Loaded { network: clip, file }) = &networks.clip else {
        return Ok(CLIP_IDS.iter().map(|id| lacking(id, "CLIP ViT-B/32")).collect());
    };
    let text = |prompt: Option<&str>| -> Outcome<Option<Vec<f32>>> {
        let (Some(prompt), Some(tokenizer)) = (prompt, &networks.tokenizer) else {
            return Ok(None);
        };
        features_of(clip, &tokenizer.encode(prompt)).map(Some)
    };
    let texts = [text(prompts.edit)?, text(prompts.source)?];
    let chosen = sampled_frames(sight.times.len());
    let named = |item: Item| item.with("preprocessing", Preprocessing::Pil.name()).weights(file);
    let of_views = |id: &str, value: &dyn Fn(&Pair) -> Option<f64>| {
        named(Item::of_views(id, views.iter().map(value).collect()))
    };
    let no_text = |id: &str, flag: &str| {
        let reason = if networks.tokenizer.is_none() {
            "needs --weights with merges.txt or tokenizer.json".to_owned()
        } else {
            format!("no text to compare with: {flag}")
        };
        Item::missing(id, &reason)
    };
    let not_edited = |id: &str| Item::missing(id, "the scene is not a run: nothing was edited");
    let is_edited = sight.subject.edit.is_some();
    let mut items = Vec::new();
    items.push(match &texts[0] {
        Some(text) => {
            of_views(CLIP_IDS[0], &|[edit, _]| mean(chosen.iter().map(|&at| dot(&edit[at], text))))
                .with("frames", chosen.len())
                .with("prompt", prompts.edit.unwrap_or_default())
        }
        None => no_text(CLIP_IDS[0], "--prompt"),
    });
    items.push(match &texts {
        _ if !is_edited => not_edited(CLIP_IDS[1]),
        [Some(edit_text), Some(source_text)] => {
            of_views(CLIP_IDS[1], &|[edit, source]| {
                mean(chosen.iter().filter_map(|&at| {
                    direction([&source[at], &edit[at]], [source_text, edit_text])
                }))
            })
            .with("frames", chosen.len())
            .with("prompt", prompts.edit.unwrap_or_default())
            .with("source_prompt", prompts.source.unwrap_or_default())
        }
        _ => no_text(CLIP_IDS[1], "--prompt and --source-prompt"),
    });
    items.push(of_views(CLIP_IDS[2], &|[edit, _]| {
        mean(edit.windows(2).map(|pair| dot(&pair[0], &pair[1])))
    }));
    items.push(if is_edited {
        of_views(CLIP_IDS[3], &|[edit, source]| {
            mean(edit.windows(2).zip(source.windows(2)).filter_map(|(edit, source)| {
                direction([&edit[0], &edit[1]], [&source[0], &source[1]])
            }))
        })
    } else {
        not_edited(CLIP_IDS[3])
    });
    Ok(items)
}

fn features_of(clip: &ClipNetwork, tokens: &[u32; nn_vit::CONTEXT]) -> Outcome<Vec<f32>> {
    clip.text_features(tokens).map_err(|error| {
        Failure::bad_input(error.to_string())
            .next("The merges and the weights belong to different networks; take both from the same source.")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_frames_are_even_and_include_the_ends() {
        assert_eq!(sampled_frames(4), [0, 1, 2, 3], "all");
        let chosen = sampled_frames(300);
        assert_eq!((chosen.len(), chosen[0], chosen[29]), (30, 0, 299), "thirty");
        assert!(chosen.is_sorted_by(|a, b| a < b), "each once");
    }

    #[test]
    fn consistency_is_that_of_vbench() {
        let frames = [vec![1.0, 0.0], vec![0.6, 0.8], vec![-1.0, 0.0]];
        // (0.6 + 0.6)/2 for the second frame; 0 for the third, whose similarities are negative.
        let score = consistency(&frames).unwrap();
        assert!((score - 0.3).abs() < 1e-6, "{score}");
        assert_eq!(consistency(&frames[..1]), None, "one frame has no pairs");
        let still = [vec![0.6, 0.8], vec![0.6, 0.8]];
        assert!((consistency(&still).unwrap() - 1.0).abs() < 1e-6, "a still video");
    }

    #[test]
    fn directions_are_of_changes() {
        let (a, b) = ([0.0, 1.0], [1.0, 1.0]);
        let along = direction([&a, &b], [&[0.0, 0.0], &[0.5, 0.0]]).unwrap();
        assert!((along - 1.0).abs() < 1e-6, "alike: {along}");
        let against = direction([&b, &a], [&[0.0, 0.0], &[0.5, 0.0]]).unwrap();
        assert!((against + 1.0).abs() < 1e-6, "opposite: {against}");
        assert_eq!(direction([&a, &a], [&a, &b]), None, "no change has no direction");
    }
}
