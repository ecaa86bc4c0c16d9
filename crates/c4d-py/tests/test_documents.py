"""Runs the examples of the documents and the notebook unchanged."""

import os
import re
import shutil
import subprocess
import sys

import nbformat
import pytest
from conftest import REPOSITORY, SYNTH, program
from nbclient import NotebookClient

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("document", ["README.md", "crates/c4d-py/README.md", "docs/PYTHON.md"])
def test_examples_run_in_order(document, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(SYNTH / "source", "demo/source")
    shutil.copy(SYNTH / "edited.ply", "demo/edited.ply")
    blocks = BLOCK.findall((REPOSITORY / document).read_text(encoding="utf-8"))
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, document, "exec"), names)  # noqa: S102


def test_the_notebook_runs():
    folder = REPOSITORY / "crates" / "c4d-py" / "examples"
    notebook = nbformat.read(folder / "scene_edit_propagate.ipynb", as_version=4)
    notebook.metadata.kernelspec.name = "python3"
    client = NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(folder)}})
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 2, sys.executable


def test_ray_renders_parts_on_three_workers(tmp_path):
    pytest.importorskip("ray", reason="Ray has no wheel for this Python")
    example = REPOSITORY / "crates" / "c4d-py" / "examples" / "render_with_ray.py"
    flags = ["--frames", "6", "--size", "48x36"]
    clip, whole = tmp_path / "clip.mp4", tmp_path / "whole.mp4"
    words = [sys.executable, str(example), SYNTH / "source", clip, "--parts", "3"]
    words += ["--workers", "3", *flags]
    subprocess.run(list(map(str, words)), check=True, timeout=300)
    made = program(
        "render", SYNTH / "source", *flags, "--cameras", "orbit", "-g", "cpu", "-o", whole
    )
    assert made.returncode == 0, made.stderr
    assert clip.read_bytes() == whole.read_bytes()
