"""Exceptions: the errors of the command line, with the same text."""

from __future__ import annotations


class Error(RuntimeError):
    """An error of ``c4d``, with the same text as on the command line.

    Attributes:
        what: What happened, where, what was expected and found.
        next_step: How to proceed.
        exit_code: The exit code of the command line.
    """

    exit_code = 1

    def __init__(self, what: str, next_step: str) -> None:
        super().__init__(f"{what}\n  next: {next_step}")
        self.what = what
        self.next_step = next_step

    def __reduce__(self):
        return type(self), (self.what, self.next_step)


class UsageError(Error, ValueError):
    """Invalid or inconsistent arguments."""

    exit_code = 2


class InputError(Error, ValueError):
    """An input file is missing, malformed or of a different kind."""

    exit_code = 3


class NoGpuError(Error):
    """No usable GPU although one was requested."""

    exit_code = 4


class StrictWarnings(Error):
    """Finished, but with warnings, under ``strict=True``."""

    exit_code = 6


_CLASSES = {kind.exit_code: kind for kind in (UsageError, InputError, NoGpuError, StrictWarnings)}


def exception_of(exit_code: int, what: str, next_step: str) -> Error:
    """The exception for an exit code of the command line."""
    return _CLASSES.get(exit_code, Error)(what, next_step)
