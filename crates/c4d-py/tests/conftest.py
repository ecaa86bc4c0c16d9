"""Fixtures: a small scene, its edit, and the program to compare with."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import catalyst4d as c4d

REPOSITORY = Path(__file__).resolve().parents[3]
SYNTH = REPOSITORY / "fixtures" / "synth"
NAME = "c4d.exe" if os.name == "nt" else "c4d"
PROGRAM = Path(os.environ.get("C4D_PROGRAM", REPOSITORY / "target" / "release" / NAME))


def program(*arguments):
    """Runs the program ``c4d``; both must be built from the same sources."""
    assert PROGRAM.exists(), f"{PROGRAM} is missing: cargo build --release --workspace --bin c4d"
    words = [str(PROGRAM), *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=False)


def read_ply(path):
    """Columns of a binary PLY of 32-bit floats, as arrays of splats."""
    data = Path(path).read_bytes()
    head, _, body = data.partition(b"end_header\n")
    lines = head.decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    table = np.frombuffer(body, "<f4").reshape(count, len(names))
    column = {name: index for index, name in enumerate(names)}
    take = lambda *wanted: table[:, [column[name] for name in wanted]]  # noqa: E731
    rest = sum(name.startswith("f_rest_") for name in names)
    first = take("f_dc_0", "f_dc_1", "f_dc_2").reshape(count, 1, 3)
    others = take(*(f"f_rest_{i}" for i in range(rest))).reshape(count, 3, rest // 3)
    return {
        "means": take("x", "y", "z"),
        "quats": take("rot_0", "rot_1", "rot_2", "rot_3"),
        "log_scales": take("scale_0", "scale_1", "scale_2"),
        "opacity_logits": take("opacity")[:, 0],
        "sh": np.concatenate([first, others.transpose(0, 2, 1)], axis=1),
    }


def differing(found, expected):
    """Names of the arrays that are not equal bit for bit."""
    assert list(found) == list(expected)
    return [
        name
        for name in found
        if found[name].shape != expected[name].shape
        or found[name].tobytes() != np.ascontiguousarray(expected[name]).tobytes()
    ]


@pytest.fixture(scope="session")
def scene():
    return c4d.Scene.open(SYNTH / "source")


@pytest.fixture(scope="session")
def run(scene, tmp_path_factory):
    output = tmp_path_factory.mktemp("run") / "run"
    return c4d.propagate(scene, SYNTH / "edited.ply", output, no_refine=True)
