"""Scenes, cameras and images equal those of the program."""

import json

import numpy as np
import pytest
from conftest import SYNTH, differing, program, read_ply

import catalyst4d as c4d


@pytest.mark.parametrize("t", [0.0, 0.37, 1.0])
def test_splats_equal_the_export_bit_for_bit(scene, tmp_path, t):
    file = tmp_path / "frame.ply"
    done = program("export", scene.path, "--time", t, "-o", file)
    assert done.returncode == 0, done.stderr
    exported = read_ply(file)
    assert differing(scene.at(t), exported) == []
    exported["means"] = exported["means"] + np.float32(1e-6)
    assert differing(scene.at(t), exported) == ["means"], "the comparison finds one changed array"


def test_activated_values_are_those_of_the_stored_ones(scene):
    raw, activated = scene.at(0.0), scene.at(0.0, activated=True)
    assert list(activated) == ["means", "quats", "scales", "opacities", "sh"]
    np.testing.assert_allclose(activated["scales"], np.exp(raw["log_scales"]), rtol=2e-6)
    logits = raw["opacity_logits"].astype(np.float64)
    np.testing.assert_allclose(activated["opacities"], 1 / (1 + np.exp(-logits)), rtol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(activated["quats"], axis=1), 1, rtol=1e-6)


def test_properties(scene):
    assert scene.num_splats == len(scene.at(0.0)["means"])
    assert scene.times[0] == scene.time_range[0] and scene.times[-1] == scene.time_range[1]
    assert scene.info() == json.loads(program("info", scene.path, "--json").stdout)
    assert np.linalg.norm(scene.up) == 1.0 and scene.background.shape == (3,)
    assert scene.path in repr(scene)


def test_images_equal_the_program_bit_for_bit(run, tmp_path):
    passes = ["rgb", "alpha", "depth", "flow", "mask"]
    output = tmp_path / "images"
    flags = ["--size", "64x48", "--times", "0,0.5", "--format", "npy", "--gpu", "cpu"]
    done = program("render", run.path, *flags, "--passes", ",".join(passes), "-o", output)
    assert done.returncode == 0, done.stderr
    images = run.render("front", [0, 0.5], passes, size=(64, 48), gpu="cpu")
    assert len(images) == 2 * len(passes)
    for image in images:
        file = output / image.pass_name / f"{image.frame:05}.npy"
        expected = np.load(file).reshape(image.array.shape)
        assert image.array.tobytes() == expected.tobytes(), file
    assert images.of("rgb").shape == (2, 48, 64, 3)
    assert images.of("rgb").std() > 0.01, "the images show something"

    camera, = run.cameras("front", size=(64, 48))
    single = run.render(camera, 0.5, passes, gpu="cpu")
    assert single["rgb"].tobytes() == images.of("rgb")[1].tobytes(), "the same camera"
    other = run.render(camera.resized(65, 48), 0.5, gpu="cpu")
    assert other["rgb"].shape == (48, 65, 3)


def test_orbits_have_times(scene):
    cameras = scene.cameras("orbit", frames=3, size=(32, 32))
    assert [camera.time for camera in cameras] == [0.0, 0.5, 1.0]
    images = scene.render(cameras, gpu="cpu")
    assert [image.time for image in images] == [0.0, 0.5, 1.0]
    assert images[0].array.tobytes() != images[2].array.tobytes()


def test_cameras_of_files(scene, tmp_path):
    program("freeze", scene.path, "--views", 3, "-o", tmp_path / "frame")
    found = c4d.Cameras.open(tmp_path / "frame")
    assert len(found) == 3 and found[0].width > 0 and found.format
    with pytest.raises(c4d.InputError, match="next: Specify a data set"):
        c4d.Cameras.open(tmp_path / "none")


def test_cameras_are_checked():
    camera = c4d.Camera.look_at([0, 0, -4], [0, 0, 0], [0, 1, 0], 0.8, 64, 48)
    np.testing.assert_allclose(camera.position, [0, 0, -4], atol=1e-12)
    again = c4d.Camera(camera.viewmat, camera.K, 64, 48)
    assert again == camera and again != camera.resized(32, 24)
    with pytest.raises(ValueError, match="not a rotation"):
        c4d.Camera(2 * camera.viewmat, camera.K, 64, 48)
    with pytest.raises(ValueError, match=r"viewmat has shape \[3, 3\], expected \[4, 4\]"):
        c4d.Camera(np.eye(3), camera.K, 64, 48)


def test_single_frames_open():
    frame = c4d.Scene.open(SYNTH / "edited.ply")
    assert differing(frame.at(0.0), read_ply(SYNTH / "edited.ply")) == []


def test_files_are_written_as_by_the_program(scene, tmp_path):
    scene.export(tmp_path / "ours.splat", time=0.5)
    program("export", scene.path, "--time", 0.5, "-o", tmp_path / "theirs.splat")
    assert (tmp_path / "ours.splat").read_bytes() == (tmp_path / "theirs.splat").read_bytes()
    scene.render_to(tmp_path / "sheet.png", size=(32, 32), frames=2, gpu="cpu")
    assert (tmp_path / "sheet.png").stat().st_size > 100
