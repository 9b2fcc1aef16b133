"""Where the files that lhdmap reads are: settings of the pipelines, dataset descriptions, small samples.

An installed lhdmap carries them in its own folder `share`; in a checkout they are the top-level folders of that name.
"""

from __future__ import annotations

from pathlib import Path

from lhdmap.errors import UsageError

_PACKAGE = Path(__file__).resolve().parent


def resource(name: str) -> Path:
    """Return the path of a shipped file or folder, e.g. `pipelines/default.toml`.

    Raises:
        UsageError: nothing of that name ships with lhdmap.
    """
    for root in (_PACKAGE / "share", _PACKAGE.parent):
        path = root / name
        if path.exists():
            return path
    raise UsageError(f"'{name}' does not ship with lhdmap")
