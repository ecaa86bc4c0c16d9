//! Invalid scenes and options.

use crate::decoder::decode;
use crate::still::{Frames, row_of};
use gs_core::Camera;
use gs_player::{
    Annotations, EncodeOptions, Encoded, Legend, Overlay, Page, PageScenes, PlayerError, encode,
    encode_annotated, page, served_page, source_file,
};

fn encoded(scene: &Frames, times: &[f32]) -> Result<Encoded, PlayerError> {
    encode(scene, None, times, &EncodeOptions::default(), &mut |_, _| {})
}

#[test]
fn missing_frames_and_invisible_scenes_are_errors() {
    let error = encoded(&Frames(vec![row_of(3)]), &[]).unwrap_err();
    assert!(matches!(error, PlayerError::NoFrames), "{error}");
    let error = encoded(&Frames(vec![row_of(0)]), &[0.0]).unwrap_err();
    assert!(matches!(error, PlayerError::NothingVisible { rows: 0, .. }), "{error}");
    let error = encoded(&Frames(vec![row_of(1)]), &vec![0.0; 70_000]).unwrap_err();
    assert!(error.to_string().contains("70000 frames, expected at most 65535"), "{error}");
}

#[test]
fn invalid_and_invisible_rows_are_omitted_and_counted() {
    let mut frames = vec![row_of(9), row_of(9)];
    frames[1].means[0][1] = f32::NAN;
    frames[0].quats[1] = [0.0; 4];
    frames[1].log_scales[2][2] = f32::INFINITY;
    frames[0].sh[3][0] = f32::NEG_INFINITY;
    frames[0].opacity_logits[4] = f32::NAN;
    for frame in &mut frames {
        frame.opacity_logits[5] = -40.0;
    }
    frames[1].means[6] = [1e30, 0.0, 0.0];
    let encoded = encoded(&Frames(frames), &[0.0, 1.0]).unwrap();
    assert_eq!((encoded.report.not_finite, encoded.report.invisible), (5, 1), "counted");
    assert_eq!(encoded.report.first, 3, "the others are kept");
    assert_eq!(decode(&encoded.payload).groups, [3, 0, 0, 0], "and written");
}

#[test]
fn distant_rows_are_clamped_to_the_grid_and_counted() {
    let mut splats = row_of(40);
    splats.means[7] = [3e38, -3e38, 0.0];
    let encoded = encoded(&Frames(vec![splats]), &[0.0]).unwrap();
    assert_eq!(encoded.report.clamped, 1, "counted");
    assert_eq!(decode(&encoded.payload).rows(false).len(), 40, "kept");
}

#[test]
fn single_frames_and_single_points_are_valid_scenes() {
    let mut splats = row_of(4);
    splats.means.fill([1.0, 2.0, 3.0]);
    let encoded = encoded(&Frames(vec![splats]), &[0.0]).unwrap();
    let payload = decode(&encoded.payload);
    assert_eq!(payload.frames, 1, "a still");
    assert_eq!(
        payload.attributes["position"].value(0, 0),
        [0.0; 3],
        "at the origin of the payload"
    );
    assert_eq!(payload.origin, [1.0, 2.0, 3.0], "the origin is their position");
    assert_eq!(encoded.report.moving, 0, "nothing moves");
}

#[test]
fn options_out_of_range_are_refused() {
    let scene = Frames(vec![row_of(2)]);
    let default = EncodeOptions::default();
    for (name, options) in [
        ("sh_degree", EncodeOptions { sh_degree: 4, ..default }),
        ("position_steps", EncodeOptions { position_steps: f64::NAN, ..default }),
        ("rotation_step", EncodeOptions { rotation_step: 0.0, ..default }),
        ("scale_step", EncodeOptions { scale_step: f64::INFINITY, ..default }),
        ("tolerance", EncodeOptions { tolerance: 0.2, ..default }),
    ] {
        let error = encode(&scene, None, &[0.0], &options, &mut |_, _| {}).unwrap_err().to_string();
        assert!(error.contains(name), "names the option: {error}");
    }
}

#[test]
fn titles_are_escaped() {
    let encoded = encoded(&Frames(vec![row_of(2)]), &[0.0]).unwrap();
    let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 64, 48);
    let mut settings = Page {
        title: "</title><script>alert(1)</script>{{payload}}",
        fps: 30.0,
        camera: &camera,
        target: [0.0, 0.0, 1.0],
        up: [0.0, -1.0, 0.0],
        limits: None,
        background: [0.0; 3],
        poster: None,
    };
    let sources = [PageScenes { encoded: &encoded, names: ["</script><b>", "Edited"] }];
    let text = page(&sources, &settings).unwrap();
    assert!(!text.contains("<script>alert") && !text.contains("</script><b>"), "escaped");
    assert_eq!(text.matches("data-bytes=").count(), 1, "one block, none from the title");
    for word in ["http://", "https://", "fetch(", "XMLHttpRequest", "@import", "url("] {
        assert!(!text.contains(word), "no external resources: {word}");
    }
    settings.fps = f64::NAN;
    assert!(page(&sources, &settings).unwrap_err().to_string().contains("fps"), "no frame rate");
}

#[test]
fn incompatible_sources_are_refused() {
    let still = encoded(&Frames(vec![row_of(2)]), &[0.0]).unwrap();
    let moving = encoded(&Frames(vec![row_of(2)]), &[0.0, 1.0]).unwrap();
    let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.8, 64, 48);
    let settings = Page {
        title: "T",
        fps: 30.0,
        camera: &camera,
        target: [0.0, 0.0, 1.0],
        up: [0.0, -1.0, 0.0],
        limits: None,
        background: [0.0; 3],
        poster: None,
    };
    let source = |encoded| PageScenes { encoded, names: ["A", "B"] };
    let refused = |sources: &[PageScenes<'_>]| page(sources, &settings).unwrap_err().to_string();
    assert!(refused(&[]).contains("expected 1 to 4"), "none");
    assert!(refused(&[source(&still); 5]).contains("`sources` is 5"), "five");
    assert!(refused(&[source(&still), source(&moving)]).contains("`frames` is 2"), "frames");
    let served = served_page(&[source(&still)], &settings).unwrap();
    assert!(!served.contains("application/vnd.c4d"), "a served page has no payload");
    assert!(served.contains("connect-src 'self'"), "and may fetch it");
    let file = source_file(&still).unwrap();
    let length = u32::from_le_bytes(file[..4].try_into().unwrap()) as usize;
    let meta: serde_json::Value = serde_json::from_slice(&file[4..4 + length]).unwrap();
    assert_eq!(meta["splats"][0], 2, "described");
    assert_eq!(file[4 + length..], still.payload, "complete");
}

#[test]
fn mismatched_overlays_are_refused() {
    let scene = Frames(vec![row_of(3)]);
    let good = Overlay {
        name: "parts".to_owned(),
        title: "Parts".to_owned(),
        palette: vec![[0; 3], [255; 3]],
        legend: Legend { classes: vec![(1, "a".to_owned())], scale: None },
        entries: [vec![0, 1, 0], Vec::new()],
    };
    let result = |overlays: &[Overlay]| {
        let annotations = Annotations { overlays, row_numbers: false };
        let options = EncodeOptions::default();
        encode_annotated(&scene, None, &[0.0], &options, &annotations, &mut |_, _| {})
    };
    assert!(result(std::slice::from_ref(&good)).is_ok(), "fits");
    let refused = |overlay: Overlay| result(&[overlay]).unwrap_err().to_string();
    let short = Overlay { entries: [vec![0, 1], Vec::new()], ..good.clone() };
    assert!(refused(short).contains("entries for 2 and 0 splats"), "too few");
    let beyond = Overlay { entries: [vec![0, 2, 0], Vec::new()], ..good.clone() };
    assert!(refused(beyond).contains("entry 2 of a palette of 2 colours"), "no colour");
    let named = Overlay { name: "A b".to_owned(), ..good.clone() };
    assert!(refused(named).contains("lower-case letters"), "name");
    let classes = Legend { classes: vec![(7, "b".to_owned())], scale: None };
    let legend = Overlay { legend: classes, ..good.clone() };
    assert!(refused(legend).contains("entry 7"), "legend");
    let twice = result(&[good.clone(), good]).unwrap_err().to_string();
    assert!(twice.contains("given twice"), "{twice}");
}
