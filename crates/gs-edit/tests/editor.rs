//! Selections and actions on splats: partitions, inverses, exactness of colour, hostile values.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use gs_core::{Camera, Image, Rasterizer, RenderParams, Splats, quat, sh};
use gs_edit::{
    ColorMap, EditError, Editor, Motion, Resources, Script, Selector, SelectorInput, StyleTransfer,
    base_color,
};
use gs_raster_cpu::CpuRasterizer;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};

/// A ball of `num` splats with SH of degree 3 whose colours stay between 0.15 and 0.85 in every
/// direction.
fn ball(num: usize, seed: u64) -> Splats {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut splats = Splats::with_capacity(num, 3);
    while splats.len() < num {
        let mean: [f32; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        if mean.iter().map(|v| v * v).sum::<f32>() > 1.0 {
            continue;
        }
        splats.means.push(mean);
        splats.quats.push(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        splats.log_scales.push(std::array::from_fn(|_| rng.random_range(-4.0..-2.0)));
        splats.opacity_logits.push(rng.random_range(-2.0..4.0));
        splats.sh.push(sh::dc_from_rgb(std::array::from_fn(|_| rng.random_range(0.3..0.7))));
        for _ in 1..16 {
            splats.sh.push(std::array::from_fn(|_| rng.random_range(-0.02..0.02)));
        }
    }
    splats
}

fn edited(splats: &Splats, options: &[(&str, &str)]) -> Result<Splats, EditError> {
    edited_with(splats, options, &resources(splats))
}

fn edited_with(
    splats: &Splats,
    options: &[(&str, &str)],
    resources: &Resources,
) -> Result<Splats, EditError> {
    let mut editor = Editor::new(splats.clone())?;
    for step in &Script::parse(options.iter().copied())?.steps {
        editor.apply(step, resources)?;
    }
    Ok(editor.into_splats())
}

/// The resources used by the selections: two parts, a mask, a list.
fn resources(splats: &Splats) -> Resources {
    let num = splats.len();
    let moving: Vec<bool> = splats.means.iter().map(|mean| mean[0] > -0.3).collect();
    let part =
        |(i, mean): (usize, &[f32; 3])| u32::from(moving[i]) * (1 + u32::from(mean[1] > 0.5));
    Resources {
        num_splats: num,
        motion: Some(Motion { parts: splats.means.iter().enumerate().map(part).collect(), moving }),
        masks: [("masks".to_owned(), (0..num).map(|i| i % 3 == 0).collect())].into(),
        ids: [("rows.txt".to_owned(), vec![(0, 9), (num as u64 - 1, num as u64 - 1)])].into(),
        ..Resources::default()
    }
}

fn camera() -> Camera {
    Camera::look_at([0.3, 0.4, -3.0], [0.0; 3], [0.0, 1.0, 0.0], 0.9, 96, 80)
}

fn render(splats: &Splats) -> (Vec<f32>, Vec<f32>) {
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(splats, &camera()).unwrap();
    let out = raster.forward(&mut prepared, splats, &[], &RenderParams::default()).unwrap();
    (out.rgb, out.alpha)
}

fn psnr(a: &Splats, b: &Splats) -> f64 {
    let (a, b) = (render(a).0, render(b).0);
    let squares: f64 = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    -10.0 * (squares / a.len() as f64).max(1e-20).log10()
}

const EXPRESSIONS: [&str; 22] = [
    "all",
    "box -.5,-.5,-.5,.5,.5,.5",
    "box inf,0,inf,inf,inf,inf",
    "sphere .2,.1,0,.6",
    "plane 1,2,-1,.1",
    "opacity<.5",
    "size .03..0.1",
    "x>=0",
    "red>.5 & blue<.6",
    "saturation>.3",
    "brightness .4..0.6",
    "color #888~.2",
    "hue 200..300",
    "hue 300..40",
    "mask masks",
    "moving",
    "part 2",
    "ids rows.txt",
    "connected 0,0,0 gap .15 of (x>0 | y>.2)",
    "connected .4,.4,.4",
    "near .2 part 2",
    "grow .1 shrink .1 sphere 0,0,0,.7",
];

#[test]
fn a_selection_and_its_inverse_partition_the_splats() {
    let splats = ball(800, 1);
    let resources = resources(&splats);
    let origins: Vec<Option<u32>> = (0..800).map(Some).collect();
    let frame = SelectorInput { splats: &splats, origins: &origins, resources: &resources };
    for text in EXPRESSIONS {
        let chosen = Selector::parse(text).unwrap().evaluate(frame).unwrap();
        let others = Selector::parse(&format!("!({text})")).unwrap().evaluate(frame).unwrap();
        assert!(chosen.iter().zip(&others).all(|(a, b)| a != b), "{text}");
        let count = chosen.iter().filter(|&&c| c).count();
        assert!(
            count > 0 && (count < 800 || text == "all" || text.starts_with("connected .4")),
            "{text}: {count}"
        );
        // Deleting one equals keeping the other, and together they are all splats.
        if count < 800 {
            let deleted = edited(&splats, &[("select", text), ("delete", "")]).unwrap();
            let kept = edited(&splats, &[("select", &format!("!({text})")), ("keep", "")]).unwrap();
            assert_eq!(deleted, kept, "{text}");
            assert_eq!(deleted.len(), 800 - count, "{text}");
        }
    }
}

#[test]
fn set_operations_agree_with_their_definitions() {
    let splats = ball(500, 2);
    let resources = resources(&splats);
    let origins: Vec<Option<u32>> = (0..500).map(Some).collect();
    let of = |text: &str| {
        let frame = SelectorInput { splats: &splats, origins: &origins, resources: &resources };
        Selector::parse(text).unwrap().evaluate(frame).unwrap()
    };
    assert_eq!(of("!(x>0 & y>0)"), of("!x>0 | !y>0"), "De Morgan");
    assert_eq!(of("x>0 | y>0 & z>0"), of("x>0 | (y>0 & z>0)"), "precedence");
    assert_eq!(of("grow 9 ids rows.txt"), of("all"), "grown over everything");
    assert_eq!(of("near .2 x>0"), of("grow .2 x>0 & !x>0"), "near is the rim");
    assert_eq!(of("shrink .2 x>0"), of("!(grow .2 !x>0)"), "shrinking grows the others");
    assert_eq!(of("sphere 0,0,0,.5"), of("sphere 0,0,0,.5 & all"), "neutral");
}

#[test]
fn maps_of_splats_equal_maps_of_renders() {
    let splats = ball(600, 3);
    let (before, alpha) = render(&splats);
    let maps = [
        ("hue", "50", ColorMap::hue(50.0)),
        ("saturation", "0.4", ColorMap::saturation(0.4)),
        ("brightness", "0.1", ColorMap::brightness(0.1)),
        ("brightness", "-0.1", ColorMap::brightness(-0.1)),
        ("levels", "0.1,1.1", ColorMap::levels(0.1, 1.1)),
        ("tint", "#fb9:.8", ColorMap::tint([1.0, 187.0 / 255.0, 0.6], 0.8)),
    ];
    for (option, argument, map) in maps {
        let (found, _) = render(&edited(&splats, &[(option, argument)]).unwrap());
        let mut worst = 0.0_f64;
        for ((before, found), alpha) in before.chunks(3).zip(found.chunks(3)).zip(&alpha) {
            let linear = map.apply_linear([0, 1, 2].map(|c| f64::from(before[c])));
            for c in 0..3 {
                let expected = linear[c] + map.offset[c] * f64::from(*alpha);
                worst = worst.max((expected - f64::from(found[c])).abs());
            }
        }
        assert!(worst < 1e-5, "--{option} {argument}: {worst}");
        assert!(worst > 0.0, "--{option} {argument}: something was compared");
    }
}

#[test]
fn the_color_action_keeps_the_shading() {
    let splats = ball(600, 4);
    let red = edited(&splats, &[("color", "#c22")]).unwrap();
    for row in 0..splats.len() {
        let luma = |rgb: [f64; 3]| 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
        let (old, new) = (base_color(&splats, row), base_color(&red, row));
        assert!((new[1] - new[2]).abs() < 1e-5 && new[0] > 5.0 * new[1], "red: {new:?}");
        let ratio = luma(new) / luma(old);
        let first = luma(base_color(&red, 0)) / luma(base_color(&splats, 0));
        assert!((ratio - first).abs() < 1e-4, "shading of splat {row}: {ratio} {first}");
    }
    let same = edited(&splats, &[("color", "#c22:0"), ("tint", "#123:0")]).unwrap();
    assert!(psnr(&splats, &same) > 100.0, "no strength changes nothing");
}

#[test]
fn inverse_operations_restore_the_splats() {
    let splats = ball(600, 5);
    for (there, back) in [
        (vec![("translate", "1,-2,.5")], vec![("translate", "-1,2,-.5")]),
        (vec![("rotate", "0,70,0")], vec![("rotate", "0,-70,0")]),
        (vec![("rotate", "30,0,0@1,2,3")], vec![("rotate", "-30,0,0@1,2,3")]),
        (
            vec![("rotate", "10,20,30")],
            vec![("rotate", "0,0,-30"), ("rotate", "0,-20,0"), ("rotate", "-10,0,0")],
        ),
        (vec![("scale", "3")], vec![("scale", ".333333333333")]),
        (vec![("scale", ".25@0,1,0")], vec![("scale", "4@0,1,0")]),
        (vec![("opacity", ".5")], vec![("opacity", "2")]),
        (vec![("hue", "77")], vec![("hue", "-77")]),
        (vec![("saturation", "2.5")], vec![("saturation", ".4")]),
        (vec![("brightness", ".3")], vec![("brightness", "-.3")]),
        // c ↦ (c − .2)/.5 and c ↦ .5c + .2 = (c + .4)/2, from black −.4 to white 1.6.
        (vec![("levels", ".2,.7")], vec![("levels", "-.4,1.6")]),
    ] {
        let changed = edited(&splats, &there).unwrap();
        assert!(psnr(&splats, &changed) < 50.0, "{there:?} changes something");
        let both: Vec<_> = there.iter().chain(&back).copied().collect();
        let found = edited(&splats, &both).unwrap();
        let db = psnr(&splats, &found);
        assert!(db >= 60.0, "{there:?}, then {back:?}: {db:.1} dB");
    }
    let copied = edited(&splats, &[("select", "x>0"), ("duplicate", ""), ("delete", "")]).unwrap();
    assert_eq!(copied, splats, "copies become the selection");
}

#[test]
fn rotations_include_the_harmonics() {
    // Rotated as a whole, the scene looks the same from a rotated camera.
    let splats = ball(400, 6);
    let turned = edited(&splats, &[("rotate", "20,-35,50@0,0,0")]).unwrap();
    let half = [20.0_f64, -35.0, 50.0].map(|d| 0.5 * d.to_radians());
    let about = |axis: usize| {
        let mut q = [half[axis].cos(), 0.0, 0.0, 0.0];
        q[axis + 1] = half[axis].sin();
        q
    };
    let q = quat::mul(about(2), quat::mul(about(1), about(0)));
    let eye = quat::rotate(q, [0.3, 0.4, -3.0]);
    let up = quat::rotate(q, [0.0, 1.0, 0.0]);
    let raster = CpuRasterizer::default();
    let camera = Camera::look_at(eye, [0.0; 3], up, 0.9, 96, 80);
    let mut prepared = raster.prepare(&turned, &camera).unwrap();
    let found = raster.forward(&mut prepared, &turned, &[], &RenderParams::default()).unwrap();
    let (expected, _) = render(&splats);
    let worst = expected.iter().zip(&found.rgb).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn unselected_splats_keep_their_bits_and_order() {
    let splats = ball(400, 7);
    let options = [
        ("select", "x>.2"),
        ("hue", "90"),
        ("translate", "0,2,0"),
        ("select", "y>1"),
        ("rotate", "0,40,0"),
        ("scale", "2"),
        ("opacity", ".3"),
        ("duplicate", ""),
        ("translate", "1,0,0"),
    ];
    let found = edited(&splats, &options).unwrap();
    let untouched: Vec<usize> = (0..400).filter(|&i| splats.means[i][0] <= 0.2).collect();
    assert!(untouched.len() > 100, "enough to compare");
    assert_eq!(found.select(&untouched), splats.select(&untouched), "bits and order");
    assert_eq!(found.len(), 400 + (400 - untouched.len()), "copies come last");
}

#[test]
fn matched_colours_have_the_moments_of_the_picture() {
    let splats = ball(3000, 8);
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(9);
    let pixels: Vec<f32> = (0..64 * 64)
        .flat_map(|_| {
            let t = rng.random_range(0.0_f32..1.0);
            [0.2 + 0.7 * t, 0.1 + 0.2 * t + rng.random_range(0.0..0.05), 0.4, 1.0]
        })
        .collect();
    let mut resources = resources(&splats);
    let picture = gs_core::Image::from_data(64, 64, 4, pixels.clone()).unwrap();
    resources.images.insert("sunset.png".to_owned(), picture);
    for options in
        [&[("match-colors", "sunset.png")][..], &[("match-colors", "sunset.png"), ("sliced", "")]]
    {
        let found = edited_with(&splats, options, &resources).unwrap();
        let weight = |row: usize| {
            let mut scales = found.scale(row);
            scales.sort_by(f32::total_cmp);
            f64::from(found.opacity(row) * scales[1] * scales[2])
        };
        let (mut mean, mut total) = ([0.0; 3], 0.0);
        for row in 0..found.len() {
            total += weight(row);
            for c in 0..3 {
                mean[c] += weight(row) * base_color(&found, row)[c];
            }
        }
        for c in 0..3 {
            let expected: f64 = pixels.chunks(4).map(|p| f64::from(p[c])).sum::<f64>() / 4096.0;
            assert!(
                (mean[c] / total - expected).abs() < 5e-3,
                "{options:?}, channel {c}: {}",
                mean[c] / total
            );
        }
        assert_eq!(found.means, splats.means, "only colours change");
    }
    let empty =
        gs_core::Image::from_data(2, 1, 4, vec![0.5, 0.5, 0.5, 0.0, 1.0, 1.0, 1.0, 0.1]).unwrap();
    resources.images.insert("empty.png".to_owned(), empty);
    let error = edited_with(&splats, &[("match-colors", "empty.png")], &resources).unwrap_err();
    assert!(matches!(error, EditError::EmptyImage(_)), "{error}");
}

/// Turns the harmonics of all splats to a constant, and records its input.
struct ConstantStyle(Option<Splats>);

impl StyleTransfer for ConstantStyle {
    fn transfer(
        &mut self,
        splats: &Splats,
        _selected: &[bool],
        _picture: &Image,
    ) -> Result<Splats, Box<dyn std::error::Error + Send + Sync>> {
        let mut styled = splats.clone();
        styled.sh.fill([0.25; 3]);
        self.0 = Some(splats.clone());
        Ok(styled)
    }
}

#[test]
fn styles_change_the_selection_by_their_strength() {
    let splats = ball(400, 8);
    let mut resources = resources(&splats);
    let picture = Image::from_data(2, 1, 3, vec![0.1, 0.2, 0.3, 0.9, 0.8, 0.2]).unwrap();
    resources.images.insert("style.png".to_owned(), picture);
    let script = Script::parse([("select", "x>0"), ("style", "style.png:.5")]).unwrap();
    let mut editor = Editor::new(splats.clone()).unwrap();
    let mut style = ConstantStyle(None);
    for step in &script.steps {
        editor.apply_with(step, &resources, &mut style).unwrap();
    }
    let matched = edited_with(
        &splats,
        &[("select", "x>0"), ("match-colors", "style.png"), ("sliced", "")],
        &resources,
    );
    assert_eq!(style.0, Some(matched.unwrap()), "the transfer starts at the matched colours");
    for row in 0..splats.len() {
        let (old, new) = (splats.sh_of(row), editor.splats().sh_of(row));
        for (old, new) in old.iter().flatten().zip(new.iter().flatten()) {
            let expected = if splats.means[row][0] > 0.0 { 0.5 * old + 0.125 } else { *old };
            assert!((new - expected).abs() < 1e-6, "splat {row}: {new} {expected}");
        }
    }
    let error = editor.apply(&script.steps[1], &resources).unwrap_err();
    assert!(matches!(error, EditError::Style { .. }), "no transfer: {error}");
}

#[test]
fn grafts_are_appended_and_selected() {
    let (splats, graft) = (ball(100, 10), ball(20, 11).with_sh_degree(1));
    let mut resources = resources(&splats);
    resources.splats.insert("hat.ply".to_owned(), graft.clone());
    let options = [("graft", "hat.ply@0,5,0,0,0,90,.5"), ("translate", "1,0,0")];
    let found = edited_with(&splats, &options, &resources).unwrap();
    assert_eq!(found.len(), 120, "appended");
    assert_eq!(found.select(&(0..100).collect::<Vec<_>>()), splats, "the scene is untouched");
    for (row, mean) in graft.means.iter().enumerate() {
        let expected = [1.0 - 0.5 * mean[1], 5.0 + 0.5 * mean[0], 0.5 * mean[2]];
        let placed = found.means[100 + row];
        assert!((0..3).all(|k| (placed[k] - expected[k]).abs() < 1e-5), "{placed:?} {expected:?}");
    }
    let moved = edited_with(
        &splats,
        &[("graft", "hat.ply"), ("select", "moving"), ("delete", "")],
        &resources,
    );
    let kept = moved.unwrap();
    assert!(
        graft.means.iter().all(|mean| kept.means.contains(mean)),
        "grafts have no motion of the scene"
    );
}

#[test]
fn errors_leave_the_splats_unchanged() {
    let splats = ball(50, 12);
    for options in [
        vec![("select", "x>9"), ("hue", "20")],
        vec![("delete", "")],
        vec![("select", "x>0"), ("delete", ""), ("hue", "20")],
        vec![("translate", "1e300,0,0")],
        vec![
            ("scale", "1e6"),
            ("scale", "1e6"),
            ("scale", "1e6"),
            ("scale", "1e6"),
            ("scale", "1e6"),
            ("scale", "1e6"),
            ("scale", "1e6"),
        ],
        vec![("select", "part 3"), ("delete", "")],
    ] {
        let resources = resources(&splats);
        let mut editor = Editor::new(splats.clone()).unwrap();
        let steps = Script::parse(options.iter().copied()).unwrap().steps;
        let mut last = editor.splats().clone();
        let failed = steps.iter().any(|step| {
            let failed = editor.apply(step, &resources).is_err();
            if failed {
                assert_eq!(*editor.splats(), last, "{options:?}: as before the step");
            }
            last = editor.splats().clone();
            failed
        });
        assert!(failed, "{options:?} is refused");
    }
    let mut outside = resources(&splats);
    outside.ids.insert("rows.txt".to_owned(), vec![(3, 50)]);
    let error =
        edited_with(&splats, &[("select", "ids rows.txt"), ("delete", "")], &outside).unwrap_err();
    assert!(error.to_string().contains("splat 50 does not exist"), "{error}");
    let missing =
        edited_with(&splats, &[("select", "mask none"), ("delete", "")], &outside).unwrap_err();
    assert!(matches!(missing, EditError::Missing { .. }), "{missing}");
}

#[test]
fn hostile_splats_are_edited_without_a_panic() {
    let mut splats = ball(60, 13);
    splats.means[0] = [f32::NAN; 3];
    splats.means[1] = [f32::INFINITY, 0.0, 0.0];
    splats.means[2] = [3e38; 3];
    splats.quats[3] = [0.0; 4];
    splats.log_scales[4] = [f32::NEG_INFINITY; 3];
    splats.log_scales[5] = [200.0; 3];
    splats.opacity_logits[6] = f32::INFINITY;
    splats.opacity_logits[7] = f32::NEG_INFINITY;
    splats.sh[8 * 16] = [f32::NAN; 3];
    let resources = resources(&splats);
    for expression in EXPRESSIONS {
        for (option, argument) in [
            ("rotate", "10,0,0"),
            ("scale", "2"),
            ("opacity", ".5"),
            ("color", "#f00"),
            ("hue", "20"),
            ("duplicate", ""),
        ] {
            // Non-finite values are rejected or kept, and never spread to other splats.
            if let Ok(found) =
                edited_with(&splats, &[("select", expression), (option, argument)], &resources)
            {
                let broken = |splats: &Splats| (0..60).filter(|&i| !splats.is_finite(i)).count();
                assert!(broken(&found) <= broken(&splats), "{expression} --{option}");
            }
        }
    }
}

proptest! {
    #[test]
    fn any_text_is_parsed_or_rejected(text in "[a-z0-9 .,<>&|!()~#:@\"-]{0,60}") {
        if let Err(error) = Selector::parse(&text) {
            prop_assert!(error.column >= 1 && error.column <= text.chars().count() + 1, "{}", error);
        }
        let _ = Script::parse([("select", text.as_str())]);
        for option in gs_edit::ACTION_OPTIONS {
            let _ = gs_edit::Action::parse(option.name, &text);
        }
        let _ = gs_edit::parse_ids(&text);
    }

    #[test]
    fn words_in_any_order_are_parsed_or_rejected(
        words in proptest::collection::vec(
            prop_oneof![
                Just("all"), Just("&"), Just("|"), Just("!"), Just("("), Just(")"), Just("moving"),
                Just("grow"), Just(".1"), Just("size"), Just("<"), Just("color"), Just("#e33"), Just("~"),
                Just("connected 0,0,0"), Just("of"), Just("gap"), Just("part 2"), Just("mask a"),
            ],
            0..14,
        )
    ) {
        let text = words.join(" ");
        if let Ok(selector) = Selector::parse(&text) {
            let again = Selector::parse(&format!("({text})"));
            prop_assert_eq!(again.ok(), Some(selector), "parentheses change nothing");
        }
    }
}
