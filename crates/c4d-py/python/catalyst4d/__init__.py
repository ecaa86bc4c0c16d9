"""Edit one frame of a dynamic Gaussian-splat scene and propagate the edit to every time.

Every function runs the code of the command ``c4d``. Keyword arguments are its flags (``frames=30``
is ``--frames 30``, ``no_refine=True`` is ``--no-refine``), and errors are exceptions with the same
text.
"""

from __future__ import annotations

import os as _os

if not _os.path.isabs(_os.environ.get("XDG_RUNTIME_DIR", "")):
    # Without a desktop session, Mesa's device selection prints errors about Wayland.
    _os.environ.setdefault("NODEVICE_SELECT", "1")

from . import _native, anchors, raster, uot
from ._arrays import Splats, from_gsplat, write_ply
from ._errors import Error, InputError, NoGpuError, StrictWarnings, UsageError
from ._messages import SceneWarning, run
from ._native import Camera, set_num_threads
from ._run import Binding, Run, edit, evaluate, propagate, refine
from ._scene import Cameras, Images, RenderedImage, Scene, info

__version__ = _native.__version__

__all__ = [
    "Binding",
    "Camera",
    "Cameras",
    "Error",
    "Images",
    "InputError",
    "NoGpuError",
    "RenderedImage",
    "Run",
    "Scene",
    "SceneWarning",
    "Splats",
    "StrictWarnings",
    "UsageError",
    "anchors",
    "edit",
    "evaluate",
    "from_gsplat",
    "info",
    "propagate",
    "raster",
    "refine",
    "run",
    "set_num_threads",
    "uot",
    "write_ply",
]
