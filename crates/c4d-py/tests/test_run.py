"""Propagation, from files and from arrays."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import SYNTH, differing, program, read_ply

import catalyst4d as c4d


def test_runs_equal_those_of_the_program(run, scene, tmp_path):
    output = tmp_path / "theirs"
    flags = ["--edited", SYNTH / "edited.ply", "--no-refine", "-o", output]
    done = program("propagate", scene.path, *flags)
    assert done.returncode == 0, done.stderr
    assert (output / "scene.c4d").read_bytes() == (Path(run.path) / "scene.c4d").read_bytes()


@pytest.mark.parametrize("activated", [False, True])
def test_arrays_propagate_like_the_file(run, scene, activated):
    edited = c4d.Scene.open(SYNTH / "edited.ply").at(0.0, activated=activated)
    ours = c4d.propagate(scene, edited, no_refine=True)
    same = differing(ours.edited, run.edited) == []
    assert same != activated, "activated values are rounded, stored ones exact"
    if not activated:
        assert differing(ours.at(0.5), run.at(0.5)) == []
    else:
        np.testing.assert_allclose(ours.at(0.5)["means"], run.at(0.5)["means"], atol=1e-3)


def test_temporary_runs_are_deleted(scene):
    run = c4d.propagate(scene, scene.at(0.0), no_refine=True)
    folder = Path(run.path)
    assert folder.exists() and differing(run.at(0.7), scene.at(0.7)) == []
    del run
    assert not folder.exists()


def test_binding_is_a_sparse_matrix(run, scene):
    binding = run.binding
    matrix = binding.to_scipy()
    assert matrix.shape == binding.shape == (len(run.edited["means"]), scene.num_splats)
    assert np.shares_memory(matrix.data, binding.data)
    used = np.diff(matrix.indptr) > 0
    np.testing.assert_allclose(matrix.sum(axis=1)[used], 1, atol=1e-5)
    kinds = np.array(binding.kinds)
    unchanged = np.flatnonzero(kinds == "unchanged")
    assert 0 < len(unchanged) < len(kinds)
    rows = binding.indices[binding.indptr[unchanged]]
    now, then = run.at(0.6), scene.at(0.6)
    assert now["means"][unchanged].tobytes() == then["means"][rows].tobytes()
    edited = np.flatnonzero(kinds == "blended")
    assert len(edited) > 0
    assert not np.array_equal(now["means"][edited], run.edited["means"][edited]), "they move"


def test_runs_are_scenes(run, scene):
    assert differing(run.at(run.edit_time), read_ply(SYNTH / "edited.ply")) == []
    assert differing(run.source_at(0.5), scene.at(0.5)) == []
    assert run.report
    assert "seed" in run.config and not run.is_refined


def test_refinement_and_evaluation(scene, tmp_path):
    run = c4d.propagate(scene, SYNTH / "edited.ply", tmp_path / "run", no_refine=True)
    shutil.copytree(tmp_path / "run", tmp_path / "theirs")
    stages = []
    with pytest.warns(c4d.SceneWarning, match="no artifact was found"):
        refined = c4d.refine(
            run,
            preset="paper",
            samples=4,
            refine_size=(48, 48),
            gpu="cpu",
            progress=lambda stage, done, total: stages.append((stage, done, total)),
        )
    assert stages and all(0 <= done <= total for _, done, total in stages)
    flags = ["--preset", "paper", "--samples", 4, "--refine-size", "48x48", "--gpu", "cpu"]
    done = program("refine", tmp_path / "theirs", *flags)
    assert done.returncode == 0, done.stderr
    theirs = (tmp_path / "theirs" / "scene.c4d").read_bytes()
    assert (tmp_path / "run" / "scene.c4d").read_bytes() == theirs
    reports = [refined.report["refine"], c4d.Run.open(tmp_path / "theirs").report["refine"]]
    for report in reports:
        del report["timings"]
    assert reports[0] == reports[1]

    report = c4d.evaluate(refined, frames=2, size=(48, 48), gpu="cpu")
    file = tmp_path / "eval.json"
    flags = ["--frames", 2, "--size", "48x48", "--gpu", "cpu", "-o", file]
    program("eval", refined.path, *flags)
    assert list(report) == list(json.loads(file.read_text()))


def test_edits_by_operations(scene, tmp_path):
    file = c4d.edit(
        scene,
        ("select", "moving"),
        ("color", "#b3202a"),
        output=tmp_path / "edited.ply",
        gpu="cpu",
    )
    edited, before = read_ply(file), scene.at(0.0)
    assert differing(edited, before) == ["sh"]


def test_errors_have_the_text_of_the_program(scene, tmp_path):
    cases = [
        (c4d.InputError, ["propagate", "absent", "--edited=x.ply", "--output=out"], 3),
        (c4d.UsageError, ["render", scene.path, "--times=7", f"--output={tmp_path}/x"], 2),
        (c4d.UsageError, ["export", scene.path, "--tim=0", "--output=x.ply"], 2),
    ]
    for kind, words, code in cases:
        done = program(*words)
        with pytest.raises(kind) as caught:
            c4d.run(*words)
        assert done.returncode == code == caught.value.exit_code
        message = done.stderr.removeprefix("error: ").rstrip()
        assert str(caught.value).startswith(message.splitlines()[0]), done.stderr
        if words[0] != "export":
            assert str(caught.value) == message
            assert caught.value.next_step in message
    with pytest.raises(c4d.InputError, match="absent does not exist"):
        c4d.propagate("absent", "x.ply")
    with pytest.raises(c4d.UsageError):
        c4d.propagate(scene, SYNTH / "edited.ply", no_such_flag=True)


def test_wrong_arrays_are_errors(scene):
    frame = scene.at(0.0)
    with pytest.raises(ValueError, match="sh missing"):
        c4d.propagate(scene, {key: value for key, value in frame.items() if key != "sh"})
    with pytest.raises(ValueError, match="quats.*rows"):
        c4d.propagate(scene, {**frame, "quats": frame["quats"][:-1]})
    with pytest.raises(ValueError, match=r"means has shape \[1500, 2\], expected \[N, 3\]"):
        c4d.propagate(scene, {**frame, "means": frame["means"][:, :2]})
    with pytest.raises(ValueError, match="from_gsplat"):
        c4d.propagate(scene, {"sh0": 0})
    raw = {**frame, "scales": frame["log_scales"]}
    del raw["log_scales"]
    with pytest.raises(ValueError, match="activated values"):
        c4d.propagate(scene, raw)


def test_gsplat_parameters(scene):
    frame = scene.at(0.0)
    params = {
        "means": frame["means"],
        "quats": frame["quats"],
        "scales": frame["log_scales"],
        "opacities": frame["opacity_logits"],
        "sh0": frame["sh"][:, :1],
        "shN": frame["sh"][:, 1:],
    }
    assert differing(c4d.from_gsplat(params), frame) == []


class Tensor:
    """A tensor of another library, which exports its memory."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_tensors_are_shared():
    from catalyst4d._arrays import as_numpy

    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    assert np.shares_memory(as_numpy(Tensor(array), np.float32), array)
    assert not np.shares_memory(as_numpy(Tensor(array), np.float64), array)
