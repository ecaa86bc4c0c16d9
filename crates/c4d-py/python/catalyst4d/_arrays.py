"""Splats as dictionaries of arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TypedDict

import numpy as np
from numpy.typing import DTypeLike

from . import _native


class Splats(TypedDict):
    """Stored parameters of N splats; K = (degree + 1)² harmonics.

    means: centres, world units, [N,3]. quats: rotations wxyz, normalised on use, [N,4].
    log_scales: logarithms of the standard deviations along the local axes, [N,3].
    opacity_logits: opacities before the sigmoid, [N]. sh: harmonics, DC first, [N,K,3].
    """

    means: np.ndarray
    quats: np.ndarray
    log_scales: np.ndarray
    opacity_logits: np.ndarray
    sh: np.ndarray


RAW = ("means", "quats", "log_scales", "opacity_logits", "sh")


def as_numpy(value: object, dtype: DTypeLike | None = None) -> np.ndarray:
    """A contiguous array; host memory is shared if its layout and type allow it.

    Accepts NumPy arrays, objects with ``__array__``, and DLPack exporters. Tensors are detached
    from their graph and copied from their device.
    """
    for method in ("detach", "cpu"):
        if hasattr(value, method):
            value = getattr(value, method)()
    if hasattr(value, "__dlpack__") and not hasattr(value, "__array__"):
        value = np.from_dlpack(value)
    return np.ascontiguousarray(value, dtype=dtype)


def from_gsplat(params: Mapping[str, object]) -> Splats:
    """Splats from the parameters of gsplat, nerfstudio or DGE, all before activation.

    Args:
        params: ``means`` [N,3], ``quats`` [N,4] wxyz, ``scales`` [N,3] (logarithms), ``opacities``
            [N] (logits), ``sh0`` [N,1,3], ``shN`` [N,K-1,3]. nerfstudio's ``features_dc`` [N,3] and
            ``features_rest`` [N,K-1,3] are accepted instead of the last two.
    """
    first = "sh0" if "sh0" in params else "features_dc"
    rest = "shN" if "shN" in params else "features_rest"
    means = as_numpy(params["means"], np.float32)
    count = len(means)
    harmonics = [as_numpy(params[first], np.float32).reshape(count, 1, 3)]
    if rest in params:
        harmonics.append(as_numpy(params[rest], np.float32).reshape(count, -1, 3))
    return {
        "means": means,
        "quats": as_numpy(params["quats"], np.float32),
        "log_scales": as_numpy(params["scales"], np.float32),
        "opacity_logits": as_numpy(params["opacities"], np.float32).reshape(count),
        "sh": np.concatenate(harmonics, axis=1),
    }


def stored(splats: Mapping[str, object], dtype: DTypeLike = np.float32) -> Splats:
    """Contiguous arrays of stored parameters, from stored or activated parameters.

    ``scales`` and ``opacities`` are activated values: standard deviations, and opacities 0 to 1.
    They are converted in double precision.

    Raises:
        ValueError: For missing or contradictory entries and values out of range.
    """
    if "sh0" in splats or "features_dc" in splats:
        raise ValueError(
            "these are parameters in gsplat's names, whose scales and opacities are not activated"
            "\n  next: Convert them with catalyst4d.from_gsplat."
        )
    unchanged = ("means", "quats", "sh")
    result = {name: as_numpy(splats[name], dtype) for name in unchanged if name in splats}
    for raw, activated in (("log_scales", "scales"), ("opacity_logits", "opacities")):
        if (raw in splats) == (activated in splats):
            raise ValueError(f"splats: expected either {raw} or {activated}")
        if raw in splats:
            result[raw] = as_numpy(splats[raw], dtype)
            continue
        values = as_numpy(splats[activated], np.float64)
        low = values.min(initial=0.0) < 0.0
        if low or (activated == "opacities" and values.max(initial=0.0) > 1.0):
            raise ValueError(
                f"splats: {activated} are activated values, found {values.min():g} to {values.max():g}"
                f"\n  next: Pass values before activation as {raw}."
            )
        with np.errstate(divide="ignore"):
            logits = np.log(values) if raw == "log_scales" else np.log(values) - np.log1p(-values)
        result[raw] = np.ascontiguousarray(logits, dtype)
    missing = [name for name in RAW if name not in result]
    if missing:
        raise ValueError(f"splats: {', '.join(missing)} missing; expected {', '.join(RAW)}")
    result["opacity_logits"] = result["opacity_logits"].reshape(-1)
    return {name: result[name] for name in RAW}  # type: ignore[return-value]


def write_ply(path: str | os.PathLike, splats: Mapping[str, object], *, overwrite: bool = False) -> None:
    """Writes splats as a 3DGS PLY that keeps every bit.

    Args:
        splats: Stored or activated parameters, as in :class:`Splats`.
        overwrite: Whether to replace an existing file.
    """
    raw = stored(splats)
    _native.write_ply(
        path,
        raw["means"],
        raw["quats"],
        raw["log_scales"],
        raw["opacity_logits"],
        raw["sh"],
        overwrite=overwrite,
    )
