//! Trained scenes of other methods, read and evaluated, match their reference implementations
//! (`fixtures/bases`) within the tolerances of its README.

use gs_core::{Splats, covariance, sh};
use gs_io::{OpenOptions, OpenedScene, SceneKind, detect, open_scene_as};
use std::path::{Path, PathBuf};
use test_support::compare::{assert_close, max_abs_diff, widen};
use test_support::fixture;
use test_support::golden::Golden;

fn base(name: &str) -> PathBuf {
    fixture("bases").join(name)
}

fn golden(name: &str) -> Golden {
    Golden::open(base(name).join("expected.safetensors"))
}

fn open(path: &Path, kind: &SceneKind, options: &OpenOptions) -> OpenedScene {
    assert_eq!(detect(path).unwrap(), *kind, "{}", path.display());
    let source = open_scene_as(path, kind, options).unwrap();
    assert!(source.warnings.is_empty(), "{:?}", source.warnings);
    assert_eq!(source.repair.damaged(), 0, "sound rows");
    source
}

/// Time `index` of a tensor whose first axis is time, or constant.
fn at(golden: &Golden, name: &str, index: usize) -> Vec<f64> {
    let values = golden.f64s_of(name);
    let times = golden.shape(name)[0];
    let rows = values.len() / times;
    let index = if times == 1 { 0 } else { index };
    values[index * rows..(index + 1) * rows].to_vec()
}

/// Values of any floating-point tensor, as doubles.
trait Widened {
    fn f64s_of(&self, name: &str) -> Vec<f64>;
}

impl Widened for Golden {
    fn f64s_of(&self, name: &str) -> Vec<f64> {
        if name.ends_with("_f64") { self.f64s(name) } else { widen(&self.f32s(name)) }
    }
}

fn each<const D: usize>(rows: impl Iterator<Item = [f32; D]>) -> Vec<f64> {
    rows.flatten().map(f64::from).collect()
}

fn means(splats: &Splats) -> Vec<f64> {
    each(splats.means.iter().copied())
}

fn opacities(splats: &Splats) -> Vec<f64> {
    (0..splats.len()).map(|row| f64::from(splats.opacity(row))).collect()
}

fn rotations(splats: &Splats) -> Vec<f64> {
    each((0..splats.len()).map(|row| splats.rotation(row)))
}

fn scales(splats: &Splats) -> Vec<f64> {
    each((0..splats.len()).map(|row| splats.scale(row)))
}

/// Covariances of the splats.
fn covariances(splats: &Splats) -> Vec<f64> {
    (0..splats.len())
        .flat_map(|row| {
            let rotation = splats.rotation(row).map(f64::from);
            covariance(rotation, splats.scale(row).map(f64::from))
        })
        .collect()
}

/// Covariances that the rasteriser computes from quaternions and scales as given.
fn rasterized(quats: &[f64], scales: &[f64]) -> Vec<f64> {
    let quats = quats.as_chunks::<4>().0.iter();
    quats.zip(scales.as_chunks::<3>().0).flat_map(|(q, s)| covariance(*q, *s)).collect()
}

/// Errors relative to the sizes of the splats: differences of covariances over the traces.
fn relative_to_traces(actual: &[f64], expected: &[f64]) -> f64 {
    let rows = actual.as_chunks::<6>().0.iter().zip(expected.as_chunks::<6>().0);
    let errors = rows.map(|(a, e)| max_abs_diff(a, e) / (e[0] + e[3] + e[5]));
    errors.fold(0.0, f64::max)
}

/// Compares covariances of scenes whose quaternions are passed
/// to the rasteriser without normalisation.
fn check_rasterized(name: &str, kind: &SceneKind, tolerance: f64, of_trace: f64) {
    let source = open(&base(name).join("model"), kind, &OpenOptions::default());
    let golden = golden(name);
    assert!(!source.scene.fades(), "{name}: opacities are constant");
    for (index, t) in golden.f32s("times").into_iter().enumerate() {
        let splats = source.scene.at(t).unwrap();
        let what = |part: &str| format!("{name} at {t}: {part}");
        let close = |part: &str, actual: &[f64], expected: &[f64], tolerance: f64| {
            assert_close(&what(part), actual, expected, tolerance, 0.0);
        };
        close("means", &means(&splats), &at(&golden, "means", index), tolerance);
        close("opacity", &opacities(&splats), &at(&golden, "opacity", index), 1e-6);
        let sh = each(splats.sh.iter().copied());
        close("shs", &sh, &at(&golden, "shs", index), 0.0);
        let (quats, sizes) = (at(&golden, "rotations", index), at(&golden, "scales", index));
        let expected = rasterized(&quats, &sizes);
        let error = relative_to_traces(&covariances(&splats), &expected);
        assert!(error < of_trace, "{}: {error}", what("covariances"));
        // Negative control: with normalised quaternions, shapes differ.
        let unit = |q: &[f64; 4]| gs_core::quat::normalize(*q);
        let normalized: Vec<f64> = quats.as_chunks::<4>().0.iter().flat_map(unit).collect();
        let other = relative_to_traces(&rasterized(&normalized, &sizes), &expected);
        assert!(other > 0.05, "{}: {other}", what("negative control"));
    }
}

#[test]
fn deformable3dgs() {
    for name in ["deformable3dgs/blender_6dof_w40", "deformable3dgs/real_w40"] {
        check_rasterized(name, &SceneKind::Deformable3dgs, 1e-5, 1e-4);
    }
}

#[test]
fn grid4d() {
    for name in ["grid4d/dnerf_w64", "grid4d/real_depth1_w48"] {
        check_rasterized(name, &SceneKind::Grid4d, 5e-5, 5e-4);
    }
}

#[test]
fn dash() {
    let name = "dash/n3v_w64";
    check_rasterized(name, &SceneKind::Dash, 1e-5, 1e-4);
    let options = OpenOptions::default();
    let source = open(&base(name).join("model"), &SceneKind::Dash, &options);
    let expected = golden(name).u8s("dynamic");
    let found = source.scene.dynamic_mask().unwrap();
    assert!(found.iter().zip(&expected).all(|(found, e)| *found == (*e == 1)), "the column");
}

#[test]
fn ed3dgs() {
    for name in ["ed3dgs/early_anneal", "ed3dgs/hyper_d0"] {
        let options = OpenOptions::default();
        let source = open(&base(name).join("model"), &SceneKind::Ed3dgs, &options);
        let golden = golden(name);
        let (mut tested, shown) = (0, golden.shape("shs")[1]);
        for (index, t) in golden.f32s("times").into_iter().enumerate() {
            if !source.scene.time_range().contains(t) {
                continue;
            }
            tested += 1;
            let splats = source.scene.at(t).unwrap();
            let close = |part: &str, actual: &[f64], expected: &[f64], tolerance: f64| {
                assert_close(&format!("{name} at {t}: {part}"), actual, expected, tolerance, 0.0);
            };
            close("means", &means(&splats), &at(&golden, "means", index), 1e-5);
            close("rotations", &rotations(&splats), &at(&golden, "rotations", index), 1e-5);
            close("scales", &scales(&splats), &at(&golden, "scales", index), 1e-6);
            close("opacity", &opacities(&splats), &at(&golden, "opacity", index), 3e-6);
            let sh = each(splats.sh[..16 * shown].iter().copied());
            close("shs", &sh, &at(&golden, "shs", index), 5e-6);
            let mut geometry = Splats::default();
            source.scene.geometry_into(t, &mut geometry).unwrap();
            assert_eq!(geometry.means, splats.means, "{name}: geometry alone agrees");
            assert_eq!(geometry.quats, splats.quats, "{name}: geometry alone agrees");
        }
        assert!(tested >= 4, "{name}: {tested} times");
    }
}

#[test]
fn dynamic3dgs() {
    let (name, options) = ("dynamic3dgs", OpenOptions::default());
    let golden = golden(name);
    let folder = base(name).join("model/output/exp1/blob");
    for path in [folder.clone(), folder.join("params.npz")] {
        let source = open(&path, &SceneKind::Dynamic3dgs, &options);
        assert_eq!(source.scene.num_frames(), Some(21), "frames");
        for (index, t) in golden.f32s("times").into_iter().enumerate() {
            let splats = source.scene.at(t).unwrap();
            let close = |part: &str, actual: &[f64], expected: &[f64], tolerance: f64| {
                assert_close(&format!("{name} at {t}: {part}"), actual, expected, tolerance, 0.0);
            };
            close("means", &means(&splats), &at(&golden, "means", index), 0.0);
            close("rotations", &rotations(&splats), &at(&golden, "rotations", index), 1e-6);
            close("scales", &scales(&splats), &at(&golden, "scales", index), 1e-6);
            close("opacity", &opacities(&splats), &at(&golden, "opacity", index), 1e-6);
            let rgb = splats.sh.iter().map(|dc| dc.map(|channel| channel * sh::C0 + 0.5));
            close("colors", &each(rgb), &at(&golden, "colors", index), 1e-6);
        }
    }
}

#[test]
fn scgs() {
    for name in ["scgs/blender_w64", "scgs/real_local_frame_mask_w64"] {
        let kind = SceneKind::Scgs;
        let source = open(&base(name).join("model"), &kind, &OpenOptions::default());
        let golden = golden(name);
        for (index, t) in golden.f32s("times").into_iter().enumerate() {
            let splats = source.scene.at(t).unwrap();
            let close = |part: &str, actual: &[f64], expected: &[f64], tolerance: f64| {
                assert_close(&format!("{name} at {t}: {part}"), actual, expected, tolerance, 0.0);
            };
            close("means", &means(&splats), &at(&golden, "means", index), 1e-5);
            close("rotations", &rotations(&splats), &at(&golden, "rotations", index), 3e-5);
            let sizes: Vec<f64> = at(&golden, "scales", index).into_iter().map(f64::abs).collect();
            close("scales", &scales(&splats), &sizes, 1e-6);
            close("opacity", &opacities(&splats), &at(&golden, "opacity", index), 2e-6);
            let sh = each(splats.sh.iter().copied());
            close("shs", &sh, &at(&golden, "shs", index), 0.0);
        }
    }
}

#[test]
fn spacetime_lite() {
    let name = "spacetime_lite";
    let golden = golden(name);
    let model = base(name).join("model");
    let file = model.join("point_cloud/iteration_30000/point_cloud.ply");
    for path in [&model, &file] {
        let source = open(path, &SceneKind::Spacetime, &OpenOptions::default());
        for (index, t) in golden.f32s("times").into_iter().enumerate() {
            let splats = source.scene.at(t).unwrap();
            let close = |part: &str, actual: &[f64], expected: &[f64]| {
                assert_close(&format!("{name} at {t}: {part}"), actual, expected, 3e-6, 0.0);
            };
            close("means", &means(&splats), &at(&golden, "means", index));
            close("rotations", &rotations(&splats), &at(&golden, "rotations", index));
            close("scales", &scales(&splats), &at(&golden, "scales", index));
            close("opacity", &opacities(&splats), &at(&golden, "opacity", index));
            let rgb = splats.sh.iter().map(|dc| dc.map(|channel| channel * sh::C0 + 0.5));
            close("colors", &each(rgb), &at(&golden, "colors", index));
        }
    }
}

#[test]
fn freetimegs() {
    let files = [
        ("vanilla", "ckpt_29999.ftgs.ply"),
        ("vanilla", "ckpt_29999.pt"),
        ("older_fork_pt", "ckpt_6999.pt"),
    ];
    for (name, file) in files {
        let golden = golden(&format!("freetimegs/{name}"));
        let path = base("freetimegs").join(name).join("ckpts").join(file);
        let source = open(&path, &SceneKind::FreeTime, &OpenOptions::default());
        let frames = (name == "vanilla").then_some(60);
        assert_eq!(source.scene.num_frames(), frames, "{file}: frames");
        for (index, t) in golden.f32s("times").into_iter().enumerate() {
            let splats = source.scene.at(t).unwrap();
            let close = |part: &str, actual: &[f64], expected: &[f64]| {
                assert_close(&format!("{file} at {t}: {part}"), actual, expected, 2e-6, 0.0);
            };
            close("means", &means(&splats), &at(&golden, "means", index));
            // As passed to gsplat, which normalises them.
            let quats = at(&golden, "rotations", index);
            let unit = |q: &[f64; 4]| gs_core::quat::normalize(*q);
            let expected: Vec<f64> = quats.as_chunks::<4>().0.iter().flat_map(unit).collect();
            close("rotations", &rotations(&splats), &expected);
            close("scales", &scales(&splats), &at(&golden, "scales", index));
            close("opacity", &opacities(&splats), &at(&golden, "opacity", index));
            let sh = each(splats.sh.iter().copied());
            close("shs", &sh, &at(&golden, "shs", index));
        }
    }
}

#[test]
fn native_4d_gaussians() {
    for name in ["fudan4dgs/shfs4d", "fudan4dgs/no_shfs4d"] {
        let golden = golden(name);
        let (model, kind) = (base(name).join("model"), SceneKind::Gaussian4d);
        let error = open_scene_as(&model, &kind, &OpenOptions::default()).unwrap_err();
        assert!(error.to_string().contains("--set time_duration=START,END"), "{error}");
        let options = OpenOptions::default().with_time_duration(0.0, 10.0);
        let source = open(&model, &kind, &options);
        let camera = golden.f32s("camera_center");
        let visible = golden.u8s("visible");
        for (index, time) in golden.f32s("times").into_iter().enumerate() {
            let t = time / 10.0;
            let splats = source.scene.at(t).unwrap();
            let n = splats.len();
            let what = |part: &str| format!("{name} at {time}: {part}");
            let close = |part: &str, actual: &[f64], expected: &[f64], tolerance: f64| {
                assert_close(&what(part), actual, expected, tolerance, 0.0);
            };
            close("means", &means(&splats), &at(&golden, "means", index), 5e-6);
            let drawn = &visible[index * n..(index + 1) * n];
            let expected: Vec<f64> = at(&golden, "opacity", index)
                .into_iter()
                .zip(drawn)
                .map(|(opacity, drawn)| if *drawn == 1 { opacity } else { 0.0 })
                .collect();
            close("opacity", &opacities(&splats), &expected, 2e-6);
            let full = at(&golden, "covariance_f64", index);
            let upper: Vec<f64> = full
                .as_chunks::<9>()
                .0
                .iter()
                .flat_map(|c| [c[0], c[1], c[2], c[4], c[5], c[8]])
                .collect();
            let error = relative_to_traces(&covariances(&splats), &upper);
            assert!(error < 1e-6, "{}: {error}", what("covariances"));
            // The reference evaluates colours in the direction of the stored centres, which are
            // those of the moved splats at their own times.
            let canonical = stored_centres(&model);
            let colors = (0..n).map(|row| {
                let arm = [0, 1, 2].map(|k| canonical[row][k] - camera[k]);
                let length = arm.iter().map(|a| a * a).sum::<f32>().sqrt();
                sh::color(3, splats.sh_of(row), arm.map(|a| a / length)).map(|c| c.max(0.0))
            });
            close("colors", &each(colors), &at(&golden, "colors", index), 3e-6);
        }
    }
}

#[test]
fn fourdgs_container() {
    let (path, golden) = (base("4dgs/birth/scene.4dgs"), golden("4dgs/birth"));
    let source = open(&path, &SceneKind::Fourdgs, &OpenOptions::default());
    let n = source.scene.num_splats();
    let (visible, times) = (golden.u8s("visible"), golden.f64s("times"));
    let (means_at, opacity_at) = (golden.f64s("means"), golden.f64s("opacity"));
    let duration: f64 = 4.0;
    for (index, time) in times.into_iter().enumerate() {
        if time >= duration {
            continue; // Windows are half-open: at the end nothing is visible; our last time lies just before.
        }
        #[expect(clippy::cast_possible_truncation, reason = "scene times are single precision")]
        let t = (time / duration.next_down()) as f32;
        let splats = source.scene.at(t).unwrap();
        let (found, opacities) = (means(&splats), opacities(&splats));
        for row in 0..n {
            let at = index * n + row;
            if visible[at] == 0 {
                assert!(opacities[row] < 2e-6, "row {row} at {time}: {}", opacities[row]);
                continue;
            }
            // Our times are single precision; velocities are up to a few units per second.
            let close = |a: f64, b: f64| (a - b).abs() < 3e-6;
            let centre = (0..3).all(|k| close(found[3 * row + k], means_at[3 * at + k]));
            assert!(centre, "row {row} at {time}");
            assert!(close(opacities[row], opacity_at[at]), "row {row} at {time}");
        }
        let flat = |name: &str| widen(&golden.f32s(name));
        let sizes = scales(&splats);
        assert_close("scales", &sizes, &flat("scales"), 1e-6, 1e-6);
        let wxyz: Vec<f64> = flat("rotations_xyzw")
            .as_chunks::<4>()
            .0
            .iter()
            .flat_map(|&[x, y, z, w]| [w, x, y, z])
            .collect();
        assert_close("rotations", &rotations(&splats), &wxyz, 1e-6, 0.0);
        let (coeffs, bytes) = (splats.sh_coeffs(), golden.u8s("sh_bytes"));
        let colors = flat("colors");
        for row in 0..n {
            let sh = splats.sh_of(row);
            for channel in 0..3 {
                let rgb = f64::from(sh[0][channel] * sh::C0 + 0.5);
                assert!((rgb - colors[4 * row + channel]).abs() < 1e-6, "colour of {row}");
                for k in 1..coeffs {
                    let byte = bytes[row * 3 * (coeffs - 1) + channel * (coeffs - 1) + k - 1];
                    let expected = -4.0 + 8.0 * f32::from(byte) / 255.0;
                    assert!((sh[k][channel] - expected).abs() < 1e-6, "SH of {row}");
                }
            }
        }
    }
}

/// Centres stored in a checkpoint.
fn stored_centres(model: &Path) -> Vec<[f32; 3]> {
    let file = std::fs::read_dir(model)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| path.extension().is_some_and(|extension| extension == "pth"))
        .unwrap();
    let bytes = std::fs::read(file).unwrap();
    let tensors = gs_io::pth::read(&bytes).unwrap().into_state_dict().unwrap();
    let (_, centres) = tensors.into_iter().find(|(name, _)| name == "0.1").unwrap();
    centres.to_f32s().as_chunks::<3>().0.to_vec()
}
