"""Messages of commands: warnings become Python warnings, other messages are logged."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable

from . import _native

logger = logging.getLogger("catalyst4d")

#: ``progress(stage, done, total)``, called on the calling thread.
Progress = Callable[[str, int, int], object]


class SceneWarning(UserWarning):
    """A warning of ``c4d``."""


def receiver(results: list[str] | None = None) -> Callable[[str, str], None]:
    """A callback for messages; results are appended to ``results``."""

    def receive(kind: str, text: str) -> None:
        if kind == "warning":
            warnings.warn(text, SceneWarning, stacklevel=4)
        elif kind == "result" and results is not None:
            results.append(text)
        else:
            logger.log(logging.DEBUG if kind == "detail" else logging.INFO, "%s", text)

    return receive


def run(*arguments: object, progress: Progress | None = None) -> list[str]:
    """Runs ``c4d ARGUMENTS`` in this process.

    Args:
        arguments: Words of the command line, without ``c4d``.
        progress: Called as ``progress(stage, done, total)`` on this thread.

    Returns:
        The lines that the program prints on standard output.

    Raises:
        Error: With the text of the command line.
    """
    results: list[str] = []
    words = [str(argument) for argument in arguments]
    _native.run_command(words, receiver(results), progress)
    return results
