"""What the console needs that the core does not."""

from __future__ import annotations

from lhdmap.errors import InstallationError
from lhdmap.extras import is_installed

_LIBRARIES = ("starlette", "uvicorn", "websockets", "pyotp")


def check_installed(what: str) -> None:
    """Raise InstallationError with the line that installs what is missing; `what` needs it."""
    missing = [name for name in _LIBRARIES if not is_installed(name)]
    if missing:
        raise InstallationError(f"{what}: not installed: {', '.join(missing)}; pip install 'lhdmap[console]'")
