"""Keyword arguments as flags of the command line."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence


def flags(options: Mapping[str, object]) -> list[str]:
    """``{"frames": 30, "no_refine": True}`` as ``["--frames=30", "--no-refine"]``.

    ``None`` and ``False`` omit a flag. Sequences are joined with commas, sizes of two numbers with
    ``x``. ``set`` takes a mapping and is repeated.
    """
    words: list[str] = []
    for name, value in options.items():
        words += flag(name, value)
    return words


def flag(name: str, value: object) -> list[str]:
    """The words of one flag."""
    word = ("-" if len(name) == 1 else "--") + name.replace("_", "-")
    if value is None or value is False:
        return []
    if value is True:
        return [word]
    if isinstance(value, Mapping):
        return [f"{word}={key}={_text(item)}" for key, item in value.items()]
    return [f"{word}={_joined(name, value)}"] if len(name) > 1 else [word, _joined(name, value)]


def _joined(name: str, value: object) -> str:
    if isinstance(value, (str, os.PathLike)) or not hasattr(value, "__len__"):
        return _text(value)
    assert isinstance(value, Sequence) or hasattr(value, "__iter__")
    separator = "x" if name.endswith("size") else ","
    return separator.join(_text(item) for item in value)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return str(value.item() if hasattr(value, "item") else value)
