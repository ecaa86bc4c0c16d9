//! Model folders are written and read back.
use gs_core::{DynamicScene, Splats};
use gs_deform::{
    Head, Heads, HexPlane, HexPlaneField, HexPlaneNetwork, HexPlaneScene, Linear, Mask, PLANE_AXES,
    Plane,
};
use gs_io::{Existing, checkpoint4dgs};

/// Deterministic pseudo-random values.
fn values(count: usize, seed: usize) -> Vec<f32> {
    (0..count).map(|i| ((i * 7919 + seed * 104_729) % 1009) as f32 / 1009.0 - 0.3).collect()
}

fn linear(inputs: usize, outputs: usize, seed: usize) -> Linear {
    Linear { weight: values(inputs * outputs, seed), bias: values(outputs, seed + 1) }
}

fn network() -> HexPlaneNetwork {
    let plane = |scale: usize, p: usize| {
        let columns = 5 * scale;
        let rows = if PLANE_AXES[p].1 == 3 { 7 } else { columns };
        Plane { columns, rows, texels: values(columns * rows * 4, p + 6 * scale) }
    };
    let head = |outputs, seed| {
        Some(Head { hidden: linear(12, 12, seed), out: linear(12, outputs, seed + 9) })
    };
    HexPlaneNetwork {
        planes: HexPlane {
            aabb: [[1.5, 1.0, 2.0], [-1.0, -0.5, -2.0]],
            channels: 4,
            levels: [1, 2].map(|scale| std::array::from_fn(|p| plane(scale, p))).to_vec(),
        },
        trunk: vec![linear(8, 12, 3), linear(12, 12, 4)],
        heads: Heads { means: head(3, 5), quats: head(4, 6), ..Heads::default() },
        mask: Mask::One,
        grid_pe: 0,
        apply_rotation: false,
    }
}

fn splats() -> Splats {
    let rows = 30;
    let triples = |seed| values(rows * 3, seed).as_chunks::<3>().0.to_vec();
    Splats {
        means: triples(11),
        quats: values(rows * 4, 12).as_chunks::<4>().0.to_vec(),
        log_scales: triples(13),
        opacity_logits: values(rows, 14),
        sh: triples(15),
        sh_degree: 0,
    }
}

#[test]
fn a_written_model_has_the_same_field() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("model");
    checkpoint4dgs::write(&dir, 600, &splats(), &network(), Existing::Refuse).unwrap();
    let read = checkpoint4dgs::open(&dir, &gs_io::model_folder::Overrides::default()).unwrap();
    assert!(read.report.warnings.is_empty(), "{:?}", read.report.warnings);
    let written = HexPlaneScene::new(splats(), HexPlaneField::new(network()).unwrap()).unwrap();
    for t in [0.0, 0.37, 1.0] {
        assert_eq!(read.scene.at(t).unwrap(), written.at(t).unwrap(), "bit for bit at {t}");
    }
    assert_ne!(written.at(0.37).unwrap().means, splats().means, "the comparison can fail");
    let again = checkpoint4dgs::write(&dir, 600, &splats(), &network(), Existing::Refuse);
    assert!(again.is_err(), "existing output is not overwritten by default");
    checkpoint4dgs::write(&dir, 601, &splats(), &network(), Existing::Replace).unwrap();
}

#[test]
fn networks_with_a_mask_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let head = Head { hidden: linear(12, 12, 1), out: linear(12, 1, 2) };
    let masked = HexPlaneNetwork { mask: Mask::StaticMlp(head), ..network() };
    let dir = folder.path().join("model");
    let error = checkpoint4dgs::write(&dir, 1, &splats(), &masked, Existing::Refuse).unwrap_err();
    assert!(error.to_string().contains("mask"), "{error}");
    assert!(!dir.exists(), "no output remains");
}
