"""Runs: propagated edits."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from . import _native
from ._arrays import Splats, write_ply
from ._flags import flag, flags
from ._messages import Progress, run
from ._scene import Path, Scene


@dataclass(frozen=True)
class Binding:
    """Source splats that each edited splat follows: a sparse matrix [E,N] in compressed rows.

    ``scipy.sparse.csr_array((data, indices, indptr), shape)`` takes these arrays as they are.
    """

    indptr: np.ndarray
    """Start of each row, [E+1], uint32."""
    indices: np.ndarray
    """Source splats, uint32."""
    data: np.ndarray
    """Weights, 32-bit floats; each row sums to 1."""
    kinds: tuple[str, ...]
    """Treatment of each edited splat, [E]: unchanged, recoloured, moved, blended, field, static,
    descendant or copied."""
    shape: tuple[int, int]
    """Number of edited and of source splats."""

    def to_scipy(self):
        """The matrix as a ``scipy.sparse.csr_array`` that shares the weights."""
        from scipy.sparse import csr_array  # type: ignore[import-untyped]

        indices, indptr = self.indices.view(np.int32), self.indptr.view(np.int32)
        return csr_array((self.data, indices, indptr), shape=self.shape)


class _TemporaryFolder:
    """A folder that is deleted with the last run in it."""

    def __init__(self) -> None:
        self.path = tempfile.mkdtemp(prefix="catalyst4d-")
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class Run(Scene):
    """A propagated edit: the output of :func:`propagate`, which is also a scene."""

    _folder: _TemporaryFolder | None = None
    _contents: dict | None = None

    @classmethod
    def open(cls, path: Path, **options: object) -> Run:
        """Opens a run folder."""
        contents = _native.read_run(path)
        opened = super().open(path, **options)
        assert isinstance(opened, Run)
        opened._contents = contents
        return opened

    def _read(self) -> dict:
        if self._contents is None:
            self._contents = _native.read_run(self.path)
        return self._contents

    @property
    def binding(self) -> Binding:
        """Source splats that each edited splat follows."""
        found = self._read()
        return Binding(
            indptr=found["indptr"],
            indices=found["indices"],
            data=found["data"],
            kinds=tuple(found["kinds"]),
            shape=(len(found["indptr"]) - 1, found["num_sources"]),
        )

    @property
    def edited(self) -> Splats:
        """The edited frame; with refined colours if the run is refined. Arrays as in ``at``."""
        return self._read()["edited"]

    @property
    def is_refined(self) -> bool:
        """Whether the run is refined: colours that motion reveals are repaired."""
        return self._read()["is_refined"]

    @property
    def report(self) -> dict:
        """``run.json``: counts, convergence, timings, warnings; with ``refine.json`` as
        ``"refine"`` if the run is refined."""
        report = json.loads((FilePath(self.path) / "run.json").read_text(encoding="utf-8"))
        refined = FilePath(self.path) / "refine.json"
        if refined.exists():
            report["refine"] = json.loads(refined.read_text(encoding="utf-8"))
        return report

    @property
    def config(self) -> str:
        """``c4d.toml``: the resolved configuration."""
        return (FilePath(self.path) / "c4d.toml").read_text(encoding="utf-8")

    def source_at(self, t: float, *, activated: bool = False) -> Splats:
        """The splats of the scene before the edit at time ``t``, as :meth:`Scene.at`."""
        return self._native.at(t, activated=activated, original=True)


def propagate(
    scene: Scene | Path,
    edited: Path | Mapping[str, object],
    output: Path | None = None,
    *,
    progress: Progress | None = None,
    **options: object,
) -> Run:
    """``c4d propagate``: propagates an edited frame to all times.

    Args:
        scene: The dynamic scene, or its path.
        edited: The edited frame: a file that ``c4d`` reads, or a dictionary of arrays as
            :meth:`Scene.at` returns (NumPy arrays or tensors).
        output: Run folder to write; by default a temporary one, deleted with the returned run.
        progress: Called as ``progress(stage, done, total)`` on this thread.
        options: Flags of ``c4d propagate``: ``no_refine=True``, ``preset="paper"``, ``seed=``, ….
    """
    folder = None
    if output is None:
        folder = _TemporaryFolder()
        output = os.path.join(folder.path, "run")
    if isinstance(scene, Scene):
        options = {**scene._options, **options}
    with tempfile.TemporaryDirectory(prefix="catalyst4d-") as scratch:
        if isinstance(edited, Mapping):
            file = os.path.join(scratch, "edited.ply")
            write_ply(file, edited)
        else:
            file = os.fspath(edited)
        words = flags({"edited": file, "output": output, **options})
        run("propagate", path_of(scene), *words, progress=progress)
    result = Run.open(output)
    result._folder = folder
    return result


def refine(run_: Run | Path, *, progress: Progress | None = None, **options: object) -> Run:
    """``c4d refine``: repairs colours that motion reveals, in place.

    Args:
        run_: A run or its folder.
        options: Flags of ``c4d refine``: ``samples=``, ``resume=True``, ``refine_size=``, ….

    Returns:
        The refined run.
    """
    run("refine", path_of(run_), *flags(options), progress=progress)
    refined = Run.open(path_of(run_))
    if isinstance(run_, Run):
        refined._folder = run_._folder
    return refined


def edit(
    scene: Scene | Path,
    *operations: tuple[str, object],
    output: Path,
    progress: Progress | None = None,
    **options: object,
) -> str:
    """``c4d edit``: edits a frame by selections and actions, or fits it to edited pictures.

    Args:
        scene: A scene, a frame, or its path.
        operations: Selections and actions in order, as ``("select", "moving & hue 160..200")`` and
            ``("color", "#b3202a")``.
        output: The edited PLY to write.
        options: Further flags of ``c4d edit``.

    Returns:
        The path of the edited PLY, for :func:`propagate`.
    """
    words = [word for name, value in operations for word in flag(name, value)]
    if isinstance(scene, Scene):
        options = {**scene._options, **options}
    words += flags({"output": output, **options})
    run("edit", path_of(scene), *words, progress=progress)
    return os.fspath(output)


def evaluate(
    subject: Scene | Path,
    *,
    progress: Progress | None = None,
    **options: object,
) -> dict:
    """``c4d eval``: measures a run, and its error against ground truth.

    Args:
        subject: A run, or its path.
        options: Flags of ``c4d eval``: ``truth=``, ``frames=``, ``size=``, ….

    Returns:
        The report that ``c4d eval -o`` writes.
    """
    with tempfile.TemporaryDirectory(prefix="catalyst4d-") as scratch:
        report = os.path.join(scratch, "eval.json")
        words = flags({"output": report, **options})
        run("eval", path_of(subject), *words, progress=progress)
        with open(report, encoding="utf-8") as file:
            return json.load(file)


def path_of(scene: Scene | Path) -> str:
    """The path of a scene."""
    return scene.path if isinstance(scene, Scene) else os.fspath(scene)
