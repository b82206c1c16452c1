"""What a job does not load: much of a short job's time is its imports."""

from __future__ import annotations

import sys


class _Hidden:
    """Says of one package that it is not installed."""

    def __init__(self, package: str) -> None:
        self.package = package

    def find_spec(self, name: str, *_: object) -> None:
        if name == self.package:
            raise ModuleNotFoundError(f"{name} is hidden", name=name)


def keep_pandas_away() -> None:
    """Let pyarrow find, once and for the life of the process, that there is no pandas.

    It imports pandas with the first array that it makes, in case that is one of pandas: longer than all other imports
    of a job together. Who needs pandas imports it as ever, and then pyarrow finds it, too.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    hidden = _Hidden("pandas")
    sys.meta_path.insert(0, hidden)
    try:
        # A text and a missing value: both of the places in pyarrow that ask for pandas do so now.
        pa.array(["", None]).to_numpy(zero_copy_only=False)
    finally:
        sys.meta_path.remove(hidden)
