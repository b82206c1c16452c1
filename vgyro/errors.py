"""One family of errors: each says what is wrong, where, and what to do about it."""

from __future__ import annotations

from typing import Self


class VgyroError(Exception):
    """Base of every error that a user can cause or cure.

    what   : one sentence, without a full stop
    where  : file, key, line, byte, window or gyro; None if there is no place
    remedy : one sentence that says what to do
    """

    exit_code = 1

    def __init__(self, what: str, where: str | None = None, remedy: str | None = None) -> None:
        self.what, self.where, self.remedy = what, where, remedy
        super().__init__(what)

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        cure = f" {_sentence(self.remedy[:1].upper() + self.remedy[1:])}" if self.remedy else ""
        return f"{place}{_sentence(self.what)}{cure}"

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:
        return type(self), (self.what, self.where, self.remedy)


def _sentence(text: str) -> str:
    return text if text.endswith(("?", "!")) else f"{text.rstrip('.')}."


class UsageError(VgyroError):
    """The command line asks for something that does not exist."""

    exit_code = 2


class ConfigError(VgyroError):
    """config.yaml, a board, a twin or a manifest is wrong."""

    exit_code = 3


class DataError(VgyroError):
    """A recording cannot be used as it is: damaged, empty, of another board."""

    exit_code = 4


class TooShort(DataError):
    """A series holds fewer samples than the method needs."""


class EngineError(VgyroError):
    """The chosen engine cannot do what was asked."""

    exit_code = 5
