//! `cameras.json` of the 3DGS reference: camera-to-world poses, focal lengths in pixels.
//!
//! Keys beyond that schema: `cx`, `cy` (principal point in pixels, default the image centre),
//! `near` (near plane in world units, default that of training) and `time` (scene time; if absent,
//! the camera is used at any time). Unknown keys are ignored.

mod entry;
mod read;
mod write;

pub use read::{parse, read_file};
pub use write::{to_json, write_file};

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::Camera;

    #[test]
    fn round_trip() {
        let mut camera =
            Camera::look_at([3.0, 1.0, -2.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0], 0.7, 640, 480);
        camera.name = "cam00/0007".to_owned();
        camera.time = Some(0.25);
        camera.intrinsics.cx = 300.5;
        camera.near = 0.037;
        let (back, _) = parse(to_json(std::slice::from_ref(&camera)).unwrap().as_bytes()).unwrap();
        assert_eq!(back.len(), 1, "one");
        assert_eq!((&back[0].name, back[0].time), (&camera.name, Some(0.25)), "name and time");
        assert_eq!(back[0].intrinsics, camera.intrinsics, "intrinsics");
        assert_eq!(back[0].near, camera.near, "near plane");
        for (row, (ours, theirs)) in back[0].viewmat.iter().zip(camera.viewmat).enumerate() {
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() < 1e-12, "row {row}: {a} {b}");
            }
        }
    }

    #[test]
    fn reads_the_reference_schema() {
        let text = r#"[{"id": 0, "img_name": "r_0", "width": 800, "height": 600, "position": [1, 2, 3],
            "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fy": 1100.0, "fx": 1111.0}]"#;
        let (cameras, _) = parse(text.as_bytes()).unwrap();
        assert_eq!(cameras[0].intrinsics.cy, 300.0, "centred");
        assert_eq!(cameras[0].position(), [1.0, 2.0, 3.0], "centre");
        assert_eq!(cameras[0].time, None, "every time");
    }

    #[test]
    fn invalid_cameras_are_omitted() {
        let camera = |fx: &str, position: &str| {
            format!(
                r#"{{"width": 8, "height": 6, "position": {position}, "rotation": [[1,0,0],[0,1,0],[0,0,1]], "fy": 1.0, "fx": {fx}}}"#
            )
        };
        let good = camera("1.0", "[1, 2, 3]");
        for bad in [camera("NaN", "[0, 0, 0]"), camera("1.0", "[0, null, -Infinity]")] {
            let (cameras, notes) = parse(format!("[{bad}, {good}]").as_bytes()).unwrap();
            assert_eq!(cameras.len(), 1, "the valid one is kept");
            assert_eq!(cameras[0].position(), [1.0, 2.0, 3.0], "and is the valid one");
            assert!(notes[0].starts_with("1 of 2 views are omitted"), "{notes:?}");
            assert!(parse(format!("[{bad}]").as_bytes()).is_err(), "none is left");
        }
    }

    #[test]
    fn malformed_files_are_refused() {
        let camera = |width: &str, rotation: &str| {
            format!(
                r#"[{{"width": {width}, "height": 6, "position": [1, 2, 3], "rotation": {rotation}, "fy": 1.0, "fx": 1.0}}]"#
            )
        };
        let good = "[[1,0,0],[0,1,0],[0,0,1]]";
        assert!(parse(camera("8", good).as_bytes()).is_ok(), "no name and id");
        for text in [
            "",
            "{}",
            "[]",
            "[{}]",
            "null",
            &camera("0", good),
            &camera("1e99", good),
            &camera("-5", good),
            &camera("8", "[[2,0,0],[0,1,0],[0,0,1]]"),
            &camera("8", "[[1,0],[0,1]]"),
        ] {
            assert!(parse(text.as_bytes()).is_err(), "{text}");
        }
    }
}
