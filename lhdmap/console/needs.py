"""What the console needs that the core does not."""

from __future__ import annotations

import importlib.util

from lhdmap.errors import UsageError

_PACKAGES = ("starlette", "uvicorn", "websockets", "pyotp")


def check_installed(what: str) -> None:
    """Raise UsageError with the line that installs what is missing; `what` needs it."""
    missing = [name for name in _PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        verb = "which is" if len(missing) == 1 else "which are"
        raise UsageError(f"{what} needs {', '.join(missing)}, {verb} not installed: pip install 'lhdmap[console]'")
