//! Neural metrics of `c4d eval`, on networks with seeded random weights.

use crate::support::{c4d, failure, fixture, success};
use crate::synth_run::synth_run;
use gs_io::pth::{self, NamedTensor};
use safetensors::{Dtype, tensor::TensorView};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use test_support::seeded_weights;

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn write_safetensors(case: &str, path: &Path) {
    let tensors: Vec<_> = seeded_weights(case)
        .into_iter()
        .map(|(name, shape, values)| (name, shape, bytes(&values)))
        .collect();
    let views = tensors.iter().map(|(name, shape, data)| {
        (name, TensorView::new(Dtype::F32, shape.clone(), data).unwrap())
    });
    fs::write(path, safetensors::serialize(views, None).unwrap()).unwrap();
}

fn write_pth(case: &str, path: &Path) {
    let tensors = seeded_weights(case);
    let named: Vec<NamedTensor<'_>> =
        tensors.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
    pth::write(&named, fs::File::create(path).unwrap()).unwrap();
}

/// A typical folder of weights: Hugging Face's file, checkpoints of PyTorch, heads of `lpips`.
fn weights(folder: &Path) -> PathBuf {
    let weights = folder.join("weights");
    fs::create_dir(&weights).unwrap();
    write_safetensors("clip", &weights.join("model.safetensors"));
    write_pth("dino", &weights.join("dino_vitbase16_pretrain.pth"));
    write_pth("alex", &weights.join("alexnet-owt-7be5be79.pth"));
    fs::copy(fixture("nn-vit/lpips_alex.pth"), weights.join("alex.pth")).unwrap();
    weights
}

fn items(folder: &Path, weights: &Path, more: &[&str]) -> (Vec<Value>, String) {
    let file = folder.join("metrics.json");
    let (stdout, _) = success(
        c4d(["eval"])
            .arg(folder.join("run"))
            .args(["--frames", "3", "--size", "96x72", "--metrics", "neural", "-w", "--weights"])
            .arg(weights)
            .args(more)
            .arg("-o")
            .arg(&file),
    );
    let document: Value = serde_json::from_slice(&fs::read(file).unwrap()).unwrap();
    (document["items"].as_array().unwrap().clone(), stdout)
}

fn item<'a>(items: &'a [Value], id: &str) -> &'a Value {
    items.iter().find(|item| item["id"] == id).unwrap_or_else(|| panic!("no {id}"))
}

#[test]
fn metrics_are_measured_for_the_available_weights() {
    let folder = tempfile::tempdir().unwrap();
    let weights = weights(folder.path());
    let run = synth_run(folder.path());
    let (all, stderr) = items(folder.path(), &weights, &["--truth", run.to_str().unwrap()]);
    assert_eq!(item(&all, "lpips_alex")["value"], 0.0, "the run is its own truth");
    let file = item(&all, "lpips_alex")["weights"].as_str().unwrap();
    assert!(
        file.contains("alexnet-owt-7be5be79.pth sha256:") && file.contains("alex.pth"),
        "{file}"
    );
    for id in ["vbench_subject_consistency", "vbench_background_consistency"] {
        let value = item(&all, id)["value"].as_f64().unwrap();
        let source = item(&all, &format!("{id}_src"))["value"].as_f64().unwrap();
        assert!(0.0 < value && value < 1.0 && value != source, "{id}: {value}, source {source}");
    }
    assert_eq!(item(&all, "vbench_subject_consistency")["params"]["preprocessing"], "vbench-dino");
    assert!(item(&all, "clip_frame_consistency")["value"].is_number(), "CLIP");
    let reason = item(&all, "clip_text_sim")["reason"].as_str().unwrap();
    assert!(reason.contains("merges.txt"), "{reason}");
    let reason = item(&all, "lpips_vgg")["reason"].as_str().unwrap();
    assert!(reason.contains("VGG-16"), "{reason}");
    assert!(stderr.contains("vbench_consistency"), "{stderr}");

    // The source against the edit: a distance.
    let source = fixture("synth/source");
    let (all, _) = items(folder.path(), &weights, &["--truth", source.to_str().unwrap()]);
    let distance = item(&all, "lpips_alex")["value"].as_f64().unwrap();
    assert!(distance > 1e-6, "the edit is detected: {distance:e}");
}

#[test]
fn prompts_are_compared_if_a_tokenizer_is_available() {
    let folder = tempfile::tempdir().unwrap();
    let weights = weights(folder.path());
    synth_run(folder.path());
    // Merges of single characters only, because the test's vocabulary has only 600 entries.
    let merges: Vec<String> = (0..48_894).map(|at| format!("unused{at} merge{at}")).collect();
    fs::write(weights.join("merges.txt"), format!("#version\n{}", merges.join("\n"))).unwrap();
    let stderr = failure(
        c4d(["eval"])
            .arg(folder.path().join("run"))
            .args(["--frames", "2", "--size", "64x48", "--prompt", "red", "--weights"])
            .arg(&weights),
        3,
    );
    // The end of a text is token 49407, which is not in the test's weights.
    assert!(
        stderr.contains("token_embedding") && stderr.contains("both from the same source"),
        "{stderr}"
    );
}

#[test]
fn errors_name_unusable_folders() {
    let folder = tempfile::tempdir().unwrap();
    synth_run(folder.path());
    let eval = |weights: &Path| {
        failure(
            c4d(["eval"])
                .arg(folder.path().join("run"))
                .args(["--frames", "2", "--size", "64x48", "--weights"])
                .arg(weights),
            3,
        )
    };
    let stderr = eval(&folder.path().join("missing"));
    assert!(stderr.contains("--weights") && stderr.contains("EVALUATION.md"), "{stderr}");
    let weights = folder.path().join("weights");
    fs::create_dir(&weights).unwrap();
    fs::write(weights.join("ViT-B-32.pt"), b"PK not a file of tensors").unwrap();
    let stderr = eval(&weights);
    assert!(stderr.contains("ViT-B-32.pt") && stderr.contains("model.safetensors"), "{stderr}");
    fs::remove_file(weights.join("ViT-B-32.pt")).unwrap();
    write_safetensors("clip", &weights.join("model.safetensors"));
    let whole = fs::read(weights.join("model.safetensors")).unwrap();
    for len in [0, 7, 100, whole.len() / 2] {
        fs::write(weights.join("model.safetensors"), &whole[..len]).unwrap();
        let stderr = eval(&weights);
        assert!(stderr.contains("model.safetensors"), "cut to {len}: {stderr}");
    }
}
