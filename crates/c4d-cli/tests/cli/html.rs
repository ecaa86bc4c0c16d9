//! `c4d export --to html`. The page itself is tested in a browser in `gs-player`.

use crate::support::{c4d, failure, fixture, success};

#[test]
fn a_run_becomes_one_page_with_both_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (source, edited) = (fixture("synth/source"), fixture("synth/edited.ply"));
    let (source, edited) = (source.to_str().unwrap(), edited.to_str().unwrap());
    let run = path("run");
    success(&mut c4d(["propagate", source, "--no-refine", "--edited", edited, "-o", &run]));
    let page = path("first_walk.html");
    let (out, stderr) =
        success(&mut c4d(["export", &run, "--to", "html", "--frames", "3", "-o", &page]));
    assert!(out.contains("first_walk.html"), "names the file: {out}");
    assert!(
        stderr.contains("before the edit and") && stderr.contains("the same"),
        "counts: {stderr}"
    );
    assert!(stderr.contains("positions are within"), "reports losses: {stderr}");
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.contains("<title>First walk</title>"), "title from the name");
    assert!(text.contains("src=\"data:image/jpeg;base64,"), "a poster");
    assert!(
        text.contains("\"fps\":30.0,\"frames\":3,\"scenes\":[{\"name\":\"Original\",\"source\":0,\"second\":0},{\"name\":\"Edited\",\"source\":0,\"second\":1}],"),
        "two scenes"
    );
    assert!(text.trim_end().ends_with("</html>"), "complete");

    // A scene that is not a run has no comparison; a single frame is a still image.
    let still = path("still.html");
    let arguments =
        ["export", source, "--to", "html", "--frames", "1", "--title", "A & B", "-o", &still];
    let (_, stderr) = success(&mut c4d(arguments));
    assert!(!stderr.contains("before the edit"), "one scene: {stderr}");
    let text = std::fs::read_to_string(&still).unwrap();
    assert!(text.contains("<title>A &amp; B</title>"), "title as given");
    assert!(text.contains(",0],\"overlays\":[]"), "no second scene");
}

#[test]
fn pages_refuse_invalid_inputs_like_other_exports() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let page = page.to_str().unwrap();
    let source = fixture("synth/source");
    let source = source.to_str().unwrap();
    let export =
        |more: &[&str]| c4d(["export", source, "--to", "html", "-o", page].iter().chain(more));
    let stderr = failure(&mut export(&["--sh-degree", "3"]), 2);
    assert!(stderr.contains("--sh-degree 3"), "{stderr}");
    let stderr = failure(&mut export(&["--fps", "0"]), 2);
    assert!(stderr.contains("--fps 0"), "{stderr}");
    std::fs::write(page, "mine").unwrap();
    let stderr = failure(&mut export(&["--frames", "2"]), 2);
    assert!(stderr.contains("already exists"), "{stderr}");
    assert_eq!(std::fs::read_to_string(page).unwrap(), "mine", "untouched");
}
