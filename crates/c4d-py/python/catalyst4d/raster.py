"""The differentiable rasteriser, on the CPU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import DTypeLike

from . import _native
from ._arrays import as_numpy, stored
from ._native import Camera


class Rasterized:
    """Images of splats. See :func:`rasterize`."""

    def __init__(self, native: _native.Rasterized, dtype: DTypeLike) -> None:
        self._native = native
        self._dtype = dtype
        images = native.images()
        self.rgb: np.ndarray = images["rgb"]
        """Colour over the background, [H,W,3]."""
        self.alpha: np.ndarray = images["alpha"]
        """Coverage, [H,W]."""
        self.depth: np.ndarray = images["depth"]
        """Σ zαT, world units, not divided by the coverage, [H,W]."""
        self.features: np.ndarray = images["features"]
        """Composited features, no background, [H,W,C]."""

    def backward(
        self,
        v_rgb: object = None,
        v_alpha: object = None,
        v_depth: object = None,
        v_features: object = None,
    ) -> dict[str, np.ndarray]:
        """Gradients of a loss, from its gradients with respect to the images (None counts as zero).

        Returns:
            Gradients of the stored parameters, with their names and shapes; ``features`` [N,C];
            ``means2d`` [N,2], with respect to the projected centres, per pixel.
        """
        double = lambda value: None if value is None else as_numpy(value, self._dtype)  # noqa: E731
        return self._native.backward(*map(double, (v_rgb, v_alpha, v_depth, v_features)))


def rasterize(
    splats: Mapping[str, object],
    camera: Camera,
    *,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    features: object = None,
    exact_gradients: bool = False,
    dtype: DTypeLike = np.float32,
) -> Rasterized:
    """Renders splats, and stores the data for their gradients.

    Args:
        splats: Stored or activated parameters, as :meth:`Scene.at` returns.
        camera: The camera.
        background: Colour, 0 to 1, [3].
        features: Additional channels to composite, [N,C].
        exact_gradients: False: the gradients of the reference kernels that trained published
        models. True: the exact derivative.
        dtype: ``float32``, or ``float64`` for comparisons with finite differences.

    Raises:
        ValueError: For inconsistent shapes or an invalid camera.
    """
    dtype = np.dtype(dtype)
    if dtype not in (np.float32, np.float64):
        raise ValueError(f"dtype {dtype}: expected float32 or float64")
    arrays = stored(splats, dtype)
    channels = None if features is None else as_numpy(features, dtype)
    native = _native.rasterize(
        arrays["means"],
        arrays["quats"],
        arrays["log_scales"],
        arrays["opacity_logits"],
        arrays["sh"],
        camera,
        [float(value) for value in background],
        channels,
        exact_gradients,
    )
    return Rasterized(native, dtype)
