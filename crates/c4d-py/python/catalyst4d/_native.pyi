from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__version__: str

OnMessage = Callable[[str, str], object] | None
OnProgress = Callable[[str, int, int], object] | None

def run_command(
    arguments: Sequence[str], on_message: OnMessage = None, on_progress: OnProgress = None
) -> None: ...
def set_num_threads(threads: int | None = None) -> None:
    """Starts the thread pool of the process, with one thread per core by default.

    Call it before the first computation; later, a different number raises a UsageError.
    """

def read_run(path: str | PathLike[str]) -> dict[str, Any]: ...
def open_cameras(path: str | PathLike[str], trained: bool) -> dict[str, Any]: ...
def write_ply(
    path: str | PathLike[str],
    means: NDArray[np.float32],
    quats: NDArray[np.float32],
    log_scales: NDArray[np.float32],
    opacity_logits: NDArray[np.float32],
    sh: NDArray[np.float32],
    overwrite: bool = False,
) -> None: ...
def build_anchors(
    points: NDArray[np.float64],
    k: int,
    grouping: str,
    max_edge_ratio: float,
    radius: str | float,
    radius_factor: float,
    num_lines: int,
    seed: int,
) -> dict[str, Any]: ...
def solve_transport(
    a: NDArray[np.float64] | None,
    b: NDArray[np.float64] | None,
    cost: NDArray[np.float64] | None,
    points: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
    lambda_ent: float,
    lambda_a: float,
    lambda_b: float,
    reference: str,
    tol: float,
    max_sweeps: int,
    acceleration: str,
    gamma: float,
    beta: float | None,
    cutoff: float,
) -> Transport: ...
def rasterize(
    means: NDArray[np.floating],
    quats: NDArray[np.floating],
    log_scales: NDArray[np.floating],
    opacity_logits: NDArray[np.floating],
    sh: NDArray[np.floating],
    camera: Camera,
    background: Sequence[float],
    features: NDArray[np.floating] | None = None,
    exact_gradients: bool = False,
) -> Rasterized: ...

@final
class Camera:
    """A pinhole camera. OpenCV axes: x right, y down, z forward; pixel centres at half-integers.

    viewmat: world to camera, [4,4]. K: intrinsics in pixels, [3,3] without skew.
    width, height: pixels. near: near plane, world units. time: scene time of its image, or None.
    """

    def __init__(
        self,
        viewmat: Any,
        K: Any,
        width: int,
        height: int,
        *,
        near: float = 0.2,
        time: float | None = None,
        name: str = "",
    ) -> None: ...
    @staticmethod
    def look_at(
        eye: Sequence[float],
        target: Sequence[float],
        up: Sequence[float],
        fov_y: float,
        width: int,
        height: int,
        *,
        near: float = 0.2,
    ) -> Camera: ...
    @property
    def viewmat(self) -> NDArray[np.float64]: ...
    @property
    def K(self) -> NDArray[np.float64]: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def near(self) -> float: ...
    @property
    def time(self) -> float | None: ...
    @property
    def name(self) -> str: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    def resized(self, width: int, height: int) -> Camera: ...

@final
class Scene:
    @staticmethod
    def open(
        path: str | PathLike[str], arguments: Sequence[str], on_message: OnMessage = None
    ) -> Scene: ...
    @property
    def num_splats(self) -> int: ...
    @property
    def sh_degree(self) -> int: ...
    @property
    def time_range(self) -> tuple[float, float]: ...
    @property
    def times(self) -> NDArray[np.float32] | None: ...
    @property
    def kind(self) -> str: ...
    @property
    def edit_time(self) -> float: ...
    @property
    def up(self) -> list[float]: ...
    @property
    def fps(self) -> float | None: ...
    @property
    def background(self) -> list[float]: ...
    def at(self, t: float, activated: bool = False, original: bool = False) -> Any: ...
    def cameras(self, arguments: Sequence[str], on_message: OnMessage = None) -> list[Camera]: ...
    def render(
        self,
        arguments: Sequence[str],
        cameras: Sequence[Camera] | None = None,
        on_message: OnMessage = None,
        on_progress: OnProgress = None,
    ) -> list[tuple[int, float, Camera, str, NDArray[np.float32]]]: ...

@final
class Transport:
    def summary(self) -> dict[str, Any]: ...
    def plan(self) -> NDArray[np.float64]: ...
    def transport_cost(self) -> float: ...
    def best_rows(self) -> NDArray[np.int64]: ...

@final
class Rasterized:
    def images(self) -> dict[str, Any]: ...
    def backward(
        self,
        v_rgb: NDArray[np.floating] | None = None,
        v_alpha: NDArray[np.floating] | None = None,
        v_depth: NDArray[np.floating] | None = None,
        v_features: NDArray[np.floating] | None = None,
    ) -> dict[str, Any]: ...
