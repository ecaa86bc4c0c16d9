//! `c4d freeze --views` and `c4d edit --views`: writes pictures and reads edited pictures.

use crate::support::{c4d, failure, fixture, listing, success};
use image::{DynamicImage, GrayImage, ImageBuffer, Rgb, RgbImage, RgbaImage};
use std::fs;
use std::path::{Path, PathBuf};

/// A frozen frame with four small pictures.
fn frozen(dir: &Path) -> PathBuf {
    let frame = dir.join("frame");
    let scene = fixture("synth/source");
    success(
        c4d(["freeze", "--views", "4", "--size", "64x48", "-g", "cpu", "-o"])
            .arg(&frame)
            .arg(scene),
    );
    frame
}

fn edit(frame: &Path, views: &Path, output: &Path) -> assert_cmd::Command {
    let mut command = c4d(["edit", "-g", "cpu", "--steps", "20"]);
    command.arg(frame).arg("--views").arg(views).arg("-o").arg(output);
    command
}

/// Colours the middle of the picture red.
fn redden(path: &Path) {
    let mut picture = image::open(path).unwrap().to_rgb8();
    for y in 16..34 {
        for x in 24..40 {
            let Rgb([r, _, _]) = picture.get_pixel_mut(x, y);
            *r = r.saturating_add(120);
        }
    }
    picture.save(path).unwrap();
}

#[test]
fn pictures_are_written_edited_and_fitted() {
    let dir = tempfile::tempdir().unwrap();
    let frame = frozen(dir.path());
    let views = frame.join("views");
    let pictures = ["view_00.png", "view_01.png", "view_02.png", "view_03.png"];
    assert_eq!(listing(&views), pictures, "one PNG a camera");
    let (cameras, _) = gs_io::cameras_json::read_file(&frame.join("cameras.json")).unwrap();
    assert_eq!(cameras.len(), 4, "cameras of the pictures");
    assert_eq!((cameras[0].width, cameras[0].height), (64, 48), "their size");

    let same = dir.path().join("same.ply");
    let (_, stderr) = success(&mut edit(&frame, &views, &same));
    assert!(stderr.contains("no picture differs"), "{stderr}");
    let ply = frame.join("point_cloud.ply");
    assert!(fs::read(&same).unwrap() == fs::read(&ply).unwrap(), "byte for byte");

    for name in pictures {
        redden(&views.join(name));
    }
    // other forms of the same picture
    let jpeg = image::open(views.join("view_03.png")).unwrap();
    jpeg.save(views.join("view_03.jpg")).unwrap();
    fs::remove_file(views.join("view_03.png")).unwrap();
    let deep = image::open(views.join("view_02.png")).unwrap().to_rgb16();
    deep.save(views.join("view_02.png")).unwrap();
    let opaque = image::open(views.join("view_01.png")).unwrap().to_rgba8();
    opaque.save(views.join("view_01.png")).unwrap();

    let edited = dir.path().join("edited.ply");
    let (result, stderr) = success(&mut edit(&frame, &views, &edited));
    assert!(stderr.contains("4 of 4 pictures are edited"), "{stderr}");
    assert!(result.contains("edited.ply ("), "{result}");
    let (before, after) = (
        gs_io::ply::read_file(&ply).unwrap().splats,
        gs_io::ply::read_file(&edited).unwrap().splats,
    );
    assert!(before != after, "something changed");
    let kept = before.means.iter().zip(&before.quats).zip(&before.sh).take(before.len());
    let now: Vec<_> = after.means.iter().zip(&after.quats).zip(&after.sh).collect();
    let unchanged = kept.filter(|row| now.contains(row)).count();
    assert!(
        2 * unchanged > before.len(),
        "most splats are unchanged: {unchanged} of {}",
        before.len()
    );
    let left = listing(dir.path());
    assert!(!left.iter().any(|name| name.contains(".fit")), "no work folder is left: {left:?}");
    failure(&mut edit(&frame, &views, &edited), 2);
}

/// No output is written in any of these cases.
#[test]
fn pictures_that_do_not_fit_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let frame = frozen(dir.path());
    let views = frame.join("views");
    let output = dir.path().join("edited.ply");
    let picture = views.join("view_01.png");
    let good = fs::read(&picture).unwrap();
    let refused = |what: &str| {
        let stderr = failure(&mut edit(&frame, &views, &output), 3);
        assert!(stderr.contains(what) && stderr.contains("next: "), "{what}: {stderr}");
        assert!(!output.exists(), "{what}: no output is written");
        fs::write(&picture, &good).unwrap();
    };
    fs::remove_file(&picture).unwrap();
    refused("1 of 4 pictures are missing: view_01");
    RgbImage::new(32, 48).save(&picture).unwrap();
    refused("32×48 pixels, expected 64×48");
    RgbaImage::new(64, 48).save(&picture).unwrap();
    refused("transparent pixels");
    fs::write(&picture, b"no picture").unwrap();
    refused("view_01.png");
    let extra = views.join("holiday.png");
    fs::write(&extra, &good).unwrap();
    refused("no camera for the pictures holiday");
    fs::remove_file(extra).unwrap();
    let twin = views.join("view_01.jpg");
    RgbImage::new(64, 48).save(&twin).unwrap();
    refused("two pictures for one view");
    fs::remove_file(twin).unwrap();

    let masks = dir.path().join("masks");
    fs::create_dir(&masks).unwrap();
    for k in 0..4 {
        let side = if k == 2 { 20 } else { 48 };
        GrayImage::new(64, side).save(masks.join(format!("view_0{k}.png"))).unwrap();
    }
    let mut command = edit(&frame, &views, &output);
    let stderr = failure(command.arg("--mask").arg(&masks), 3);
    assert!(stderr.contains("64×20 pixels, expected 64×48"), "{stderr}");
    // A greyscale picture is accepted.
    let grey = image::open(&picture).unwrap().to_luma8();
    let grey: ImageBuffer<_, _> = grey;
    DynamicImage::ImageLuma8(grey).save(&picture).unwrap();
    let (_, stderr) = success(&mut edit(&frame, &views, &output));
    assert!(stderr.contains("1 of 4 pictures are edited"), "{stderr}");

    let other = dir.path().join("other.ply");
    let stderr = failure(edit(&frame, &views, &other).args(["--reference", "nobody"]), 2);
    assert!(stderr.contains("view_00, view_01"), "{stderr}");
    let stderr = failure(edit(&frame, &views, &other).arg("--resume"), 2);
    assert!(stderr.contains("no unfinished fit"), "{stderr}");
    failure(&mut edit(&frame, &views, &dir.path().join("edited.spz")), 2);
    failure(&mut edit(&frame, &views, &frame.join("point_cloud.ply")), 2);
}
