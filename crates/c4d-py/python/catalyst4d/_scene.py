"""Scenes, their cameras and their images."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Union

import numpy as np

from . import _native
from ._arrays import Splats
from ._flags import flags
from ._messages import Progress, receiver, run
from ._native import Camera

Path = Union[str, "os.PathLike[str]"]


class Scene:
    """A dynamic scene, a run, or one frame, as ``c4d`` opens it. See :meth:`open`."""

    def __init__(self, native: _native.Scene, path: str, options: Mapping[str, object]) -> None:
        self._native = native
        self._options = dict(options)
        self.path = path
        """The path as given."""

    @classmethod
    def open(cls, path: Path, **options: object) -> Scene:
        """Opens any scene that ``c4d`` reads.

        Args:
            path: A model folder, numbered frames, a clip, a run folder, or one frame.
            options: Flags that affect reading: ``iteration=``, ``set={"no_dshs": True}``,
                ``strict=True``, ``axes=``.

        Raises:
            InputError: If the path is not a scene, or its files are damaged.
        """
        text = os.fspath(path)
        return cls(_native.Scene.open(text, flags(options), receiver()), text, options)

    @property
    def num_splats(self) -> int:
        """Number of splats N, equal at every time."""
        return self._native.num_splats

    @property
    def sh_degree(self) -> int:
        """Degree of the harmonics, 0 to 3."""
        return self._native.sh_degree

    @property
    def time_range(self) -> tuple[float, float]:
        """First and last time; scene times have no unit, usually 0 and 1."""
        return self._native.time_range

    @property
    def times(self) -> np.ndarray | None:
        """Times of the stored frames, [F]; None for scenes that are continuous in time."""
        return self._native.times

    @property
    def kind(self) -> str:
        """Kind of the path, as text."""
        return self._native.kind

    @property
    def edit_time(self) -> float:
        """Time of the edited frame of a run, else the first time."""
        return self._native.edit_time

    @property
    def up(self) -> np.ndarray:
        """The world's upward direction, unit vector, [3]."""
        return np.array(self._native.up)

    @property
    def fps(self) -> float | None:
        """Frames per second, if the files store them."""
        return self._native.fps

    @property
    def background(self) -> np.ndarray:
        """Background colour of the model's training, else black, 0 to 1, [3]."""
        return np.array(self._native.background, np.float32)

    def info(self) -> dict:
        """The report of ``c4d info --json``."""
        return info(self.path, **self._options)

    def at(self, t: float, *, activated: bool = False) -> Splats:
        """The splats at time ``t``.

        Args:
            t: Scene time, within :attr:`time_range`.
            activated: With True, ``scales`` (standard deviations, world units) and ``opacities``
                (0 to 1) instead of ``log_scales`` and ``opacity_logits``, and unit quaternions.

        Returns:
            Arrays of 32-bit floats, shapes as in :class:`Splats`; bit-identical to the output of
            ``c4d export --time``.
        """
        return self._native.at(t, activated=activated)

    def cameras(self, cameras: Path = "front", **options: object) -> list[Camera]:
        """The cameras that ``c4d render`` uses.

        Args:
            cameras: ``front``, ``orbit``, ``spiral``, or a data set, ``cameras.json`` or model
                folder.
            options: Flags of ``c4d render``: ``views=``, ``split=``, ``size=``, ``frames=``, ….
        """
        return self._native.cameras(flags({"cameras": cameras, **options}), receiver())

    def render(
        self,
        camera: Camera | Sequence[Camera] | Path = "front",
        t: float | Sequence[float] | None = None,
        passes: str | Sequence[str] = "rgb",
        *,
        progress: Progress | None = None,
        **options: object,
    ) -> Images | dict[str, np.ndarray]:
        """Renders images in memory, with the values of ``c4d render --format npy``.

        Args:
            camera: One camera, several, or a value that :meth:`cameras` accepts.
            t: One time, or several. By default the cameras' own times, else those of the clip.
            passes: One or more of ``rgb`` [H,W,3], ``alpha`` [H,W], ``depth`` [H,W] (Σ zαT, world
            units), ``flow`` [H,W,2] (pixels since the edited frame, NaN where no splat is
            visible), ``uncertainty``, ``evidence`` and ``mask`` [H,W].
            progress: Called as ``progress(stage, done, total)``.
            options: Flags of ``c4d render``: ``size=(W, H)``, ``background=``, ``gpu=``, ….

        Returns:
            For one camera and one time a dictionary of arrays by pass, else :class:`Images`.
        """
        passes = [passes] if isinstance(passes, str) else list(passes)
        single = isinstance(camera, Camera) and isinstance(t, (int, float, np.number))
        given = None
        if isinstance(camera, Camera):
            given = [camera]
        elif isinstance(camera, (str, os.PathLike)):
            options["cameras"] = camera
        else:
            given = list(camera)
        if t is not None:
            options["times"] = [t] if isinstance(t, (int, float, np.number)) else list(t)
        words = flags({"passes": passes, **options})
        images = Images(
            [
                RenderedImage(frame, time, used, name, array)
                for frame, time, used, name, array in self._native.render(
                    words, given, receiver(), progress
                )
            ]
        )
        return {image.pass_name: image.array for image in images} if single else images

    def render_to(self, output: Path, *, progress: Progress | None = None, **options: object) -> str:
        """``c4d render`` to files: a video, images, a contact sheet.

        Args:
            output: Folder, or file whose name determines the format.
            options: Flags of ``c4d render``.
        """
        words = flags({"output": output, **options, **self._options})
        run("render", self.path, *words, progress=progress)
        return os.fspath(output)

    def export(self, output: Path, *, progress: Progress | None = None, **options: object) -> str:
        """``c4d export``: frames and clips for other tools, or a page that plays in any browser.

        Args:
            output: Folder or file; its name determines the format if that is unambiguous.
            options: Flags of ``c4d export``: ``to=``, ``frames=``, ``time=``, ….
        """
        words = flags({"output": output, **options, **self._options})
        run("export", self.path, *words, progress=progress)
        return os.fspath(output)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.path!r}: {self.kind}, {self.num_splats} splats)"


@dataclass(frozen=True)
class RenderedImage:
    """One image of a render."""

    frame: int
    """Index of the time."""
    time: float
    """Scene time."""
    camera: Camera
    pass_name: str
    """Name of the pass."""
    array: np.ndarray
    """[H,W] or [H,W,C], 32-bit floats."""


class Images(tuple):
    """Images in order of frame, camera and pass."""

    def of(self, name: str) -> np.ndarray:
        """The images of one pass as one array, [number,H,W] or [number,H,W,C]."""
        return np.stack([image.array for image in self if image.pass_name == name])


@dataclass(frozen=True)
class Cameras(Sequence):
    """The cameras of a data set. See :meth:`open`."""

    cameras: tuple[Camera, ...]
    """All views, in the order of the data set."""
    path: tuple[Camera, ...]
    """The camera path of the reference's videos; empty for data sets without one."""
    format: str
    """Layout of the data set."""
    notes: tuple[str, ...]
    """Assumptions and omissions, one sentence each."""
    _splits: Mapping[str, Sequence[int]]

    @classmethod
    def open(cls, path: Path, *, trained: bool = False) -> Cameras:
        """Reads a data set, one of its camera files, or a model folder.

        Args:
            trained: Reads the cameras as 4DGaussians and Swift4D do in training, else as stored.

        The near plane is that of training, 0.2 world units; ``Scene.cameras`` adapts it to the
        scene.
        """
        found = _native.open_cameras(path, trained)
        return cls(
            cameras=tuple(found["cameras"]),
            path=tuple(found["path"]),
            format=found["format"],
            notes=tuple(found["notes"]),
            _splits={name: found[name] for name in ("train", "test", "val")},
        )

    def split(self, name: str) -> list[Camera]:
        """The views of ``train``, ``test`` or ``val``."""
        return [self.cameras[index] for index in self._splits[name]]

    def __len__(self) -> int:
        return len(self.cameras)

    def __getitem__(self, index):
        return self.cameras[index]


def info(path: Path, **options: object) -> dict:
    """The report of ``c4d info --json`` on any path."""
    words = flags({"json": True, **options})
    return json.loads("\n".join(run("info", os.fspath(path), *words)))
