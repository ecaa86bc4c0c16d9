//! Networks of the neural metrics, loaded from the user's folder of weights.

use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use gs_io::pth::PthError;
use nn_vit::{
    ClipNetwork, Dino, Lpips, LpipsBackbone, NetworkError, Tokenizer, WeightTensor, Weights,
};
use safetensors::{Dtype, SafeTensors};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// File extensions of weights.
const EXTENSIONS: [&str; 4] = ["safetensors", "pth", "pt", "bin"];
/// Files with the merges of the tokenizer, in order of preference.
const MERGES: [&str; 4] =
    ["merges.txt", "bpe_simple_vocab_16e6.txt.gz", "bpe_simple_vocab_16e6.txt", "tokenizer.json"];
/// Largest accepted file of merges, bytes; CLIP's have 1 to 4 MB.
const MAX_MERGES: u64 = 64 << 20;

/// A network and its file.
pub(crate) struct Loaded<T> {
    pub(crate) network: T,
    /// Name of the file and the start of its SHA-256.
    pub(crate) file: String,
}

/// Contents of the folder.
#[derive(Default)]
pub(crate) struct Networks {
    pub(crate) clip: Option<Loaded<ClipNetwork>>,
    pub(crate) tokenizer: Option<Tokenizer>,
    pub(crate) dino: Option<Loaded<Dino>>,
    /// AlexNet, VGG-16.
    pub(crate) lpips: [Option<Loaded<Lpips>>; 2],
}

/// Tensors of a file.
struct File {
    path: PathBuf,
    weights: Weights,
}

impl File {
    /// Name and hash for reports.
    fn describe(&self) -> Outcome<String> {
        let mut file = std::fs::File::open(&self.path)
            .map_err(|error| Failure::bad_input(format!("{}: {error}", self.path.display())))?;
        let mut hash = Sha256::new();
        std::io::copy(&mut file, &mut hash).map_err(Failure::failed)?;
        let hash = format!("{:x}", hash.finalize());
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        Ok(format!("{name} sha256:{}", hash.get(..16).unwrap_or_default()))
    }

    fn refused(&self, error: &NetworkError) -> Failure {
        Failure::bad_input(format!("{}: {error}", self.path.display()))
            .next("Copy the file again, or leave it out of the folder of --weights.")
    }

    fn load<T>(&self, network: Result<T, NetworkError>) -> Outcome<Option<Loaded<T>>> {
        let network = network.map_err(|error| self.refused(&error))?;
        Ok(Some(Loaded { network, file: self.describe()? }))
    }

    fn shape(&self, name: &str) -> &[usize] {
        self.weights.0.get(name).map_or(&[], |tensor| &tensor.shape)
    }
}

impl Networks {
    /// The files that were read, except the merges.
    pub(crate) fn files(&self) -> Vec<&str> {
        let clip = self.clip.iter().map(|loaded| loaded.file.as_str());
        let dino = self.dino.iter().map(|loaded| loaded.file.as_str());
        let lpips = self.lpips.iter().flatten().map(|loaded| loaded.file.as_str());
        clip.chain(dino).chain(lpips).collect()
    }

    /// The networks of a folder; files are recognised by their tensors. Networks without files are
    /// `None`.
    pub(crate) fn open(folder: &Path, console: &Console) -> Outcome<Self> {
        let entries = std::fs::read_dir(folder).map_err(|error| {
            Failure::bad_input(format!("--weights {}: {error}", folder.display()))
                .next("Specify a folder with weights; docs/EVALUATION.md lists the files.")
        })?;
        let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        paths.sort();
        let mut networks = Self::default();
        let (mut backbones, mut heads) = (<[Option<File>; 2]>::default(), <[_; 2]>::default());
        for path in paths {
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            if !EXTENSIONS.contains(&extension) {
                continue;
            }
            let file = File { weights: read(&path, extension)?, path };
            if file.weights.has("vision_model.embeddings.class_embedding") {
                networks.clip = file.load(ClipNetwork::open(&file.weights))?;
            } else if ["blocks.0.attn.qkv.weight", "encoder.layer.0.layernorm_before.weight"]
                .iter()
                .any(|name| file.weights.has(name))
            {
                networks.dino = file.load(Dino::open(&file.weights))?;
            } else if let Some(which) = match *file.shape("features.0.weight") {
                [64, 3, 11, 11] => Some(0),
                [64, 3, 3, 3] => Some(1),
                _ => None,
            } {
                backbones[which] = Some(file);
            } else if let Some(which) = match *file.shape("lin1.model.1.weight") {
                [1, 192, 1, 1] => Some(0),
                [1, 128, 1, 1] if file.shape("lin4.model.1.weight") == [1, 512, 1, 1] => Some(1),
                _ => None,
            } {
                heads[which] = Some(file);
            } else {
                console.warn(format!(
                    "{}: not weights of CLIP, DINO or LPIPS; ignored",
                    file.path.display()
                ));
            }
        }
        for (which, kind) in [LpipsBackbone::Alex, LpipsBackbone::Vgg].into_iter().enumerate() {
            let (Some(backbone), Some(heads)) = (&backbones[which], &heads[which]) else {
                continue;
            };
            let network = Lpips::open(kind, &backbone.weights, &heads.weights);
            networks.lpips[which] = backbone.load(network)?.map(|loaded| {
                let heads = heads.path.file_name().unwrap_or_default().to_string_lossy();
                Loaded { file: format!("{} with {heads}", loaded.file), ..loaded }
            });
        }
        networks.tokenizer = tokenizer(folder)?;
        Ok(networks)
    }
}

fn read(path: &Path, extension: &str) -> Outcome<Weights> {
    let refused = |what: String| {
        let next = if path.file_name().is_some_and(|name| name == "ViT-B-32.pt") {
            "OpenAI's .pt files are programs, not weights. Take model.safetensors of openai/clip-vit-base-patch32 from Hugging Face."
        } else {
            "Copy the file again, or leave it out of the folder of --weights."
        };
        Failure::bad_input(format!("{}: {what}", path.display())).next(next)
    };
    let mut tensors = BTreeMap::new();
    if extension != "safetensors" {
        gs_io::pth::with_file(path, |root| {
            for (name, tensor) in root.into_state_dict()? {
                let (shape, values) = (tensor.shape().to_vec(), tensor.to_f32s());
                tensors.insert(name, WeightTensor { shape, values });
            }
            Ok::<_, PthError>(())
        })
        .map_err(|error| refused(chain(&error)))?;
        return Ok(Weights(tensors));
    }
    let bytes = gs_io::read_file(path).map_err(|error| refused(chain(&error)))?;
    let file = SafeTensors::deserialize(&bytes).map_err(|error| refused(error.to_string()))?;
    for (name, view) in file.tensors() {
        let data = view.data();
        let values = match view.dtype() {
            Dtype::F32 => data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
            Dtype::F16 => data
                .as_chunks::<2>()
                .0
                .iter()
                .map(|b| half::f16::from_le_bytes(*b).to_f32())
                .collect(),
            Dtype::BF16 => data
                .as_chunks::<2>()
                .0
                .iter()
                .map(|b| half::bf16::from_le_bytes(*b).to_f32())
                .collect(),
            // Position indices.
            _ => continue,
        };
        tensors.insert(name, WeightTensor { shape: view.shape().to_vec(), values });
    }
    Ok(Weights(tensors))
}

/// The tokenizer of the first file of [`MERGES`] in the folder.
fn tokenizer(folder: &Path) -> Outcome<Option<Tokenizer>> {
    let Some(path) = MERGES.iter().map(|name| folder.join(name)).find(|path| path.exists()) else {
        return Ok(None);
    };
    let refused = |what: String| {
        Failure::bad_input(format!("{}: {what}", path.display()))
            .next("Copy the file again from the source of the weights.")
    };
    let file = std::fs::File::open(&path).map_err(|error| refused(error.to_string()))?;
    let mut text = String::new();
    let read = match path.extension().and_then(|e| e.to_str()) {
        Some("gz") => flate2::read::GzDecoder::new(file).take(MAX_MERGES).read_to_string(&mut text),
        _ => file.take(MAX_MERGES).read_to_string(&mut text),
    };
    read.map_err(|error| refused(error.to_string()))?;
    if path.extension().is_some_and(|e| e == "json") {
        text = merges_of(&text).ok_or_else(|| refused("no list `model.merges`".to_owned()))?;
    }
    Tokenizer::from_merges(&text).map(Some).map_err(|error| refused(error.to_string()))
}

/// The merges of a `tokenizer.json`, one per line after a title line.
fn merges_of(json: &str) -> Option<String> {
    let document: serde_json::Value = serde_json::from_str(json).ok()?;
    let mut text = String::from("merges\n");
    for merge in document["model"]["merges"].as_array()? {
        let line = match merge {
            serde_json::Value::String(line) => line.clone(),
            pair => format!("{} {}", pair[0].as_str()?, pair[1].as_str()?),
        };
        text.push_str(&line);
        text.push('\n');
    }
    Some(text)
}
