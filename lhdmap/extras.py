"""Optional libraries: they are loaded here alone, when they are used; one that is missing is named with its install line.

The extras are those of pyproject.toml; docs/install.md has their sizes.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from types import ModuleType
from typing import NamedTuple

from lhdmap.errors import InstallationError


class Library(NamedTuple):
    """A distribution, the extra of lhdmap that installs it, and what else it needs where it is there but does not load."""

    distribution: str
    extra: str
    hint: str = ""


_OPEN3D = "on Debian it needs: apt-get install libegl1 libgl1 libx11-6 libusb-1.0-0"
LIBRARIES = {
    "open3d": Library("open3d", "sim", _OPEN3D),
    "small_gicp": Library("small-gicp", "points"),
    "kiss_icp": Library("kiss-icp", "points"),
    "rerun": Library("rerun-sdk", "view"),
    "ezdxf": Library("ezdxf", "export"),
    "pye57": Library("pye57", "e57"),
    "distributed": Library("distributed", "cluster"),
    "fsspec": Library("fsspec", "store"),
    "zenoh": Library("eclipse-zenoh", "live"),
    "websockets": Library("websockets", "live"),
    "cyclonedds": Library("cyclonedds", "dds"),
    "starlette": Library("starlette", "console"),
    "uvicorn": Library("uvicorn", "console"),
    "pyotp": Library("pyotp", "console"),
}
"""By the name that is imported."""


def library(name: str) -> ModuleType:
    """Return a module of an optional library, `rerun` or `kiss_icp.config`.

    Raises:
        InstallationError: it is not installed, or is there and cannot be loaded.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InstallationError(missing_text(error, name)) from error


def is_installed(name: str) -> bool:
    """Return whether an optional library is there, without loading it."""
    if name in sys.modules:
        return sys.modules[name] is not None
    return importlib.util.find_spec(name) is not None


def require(name: str) -> None:
    """Raise InstallationError where an optional library is not installed."""
    if not is_installed(name):
        raise InstallationError(install_line(name))


def install_line(name: str) -> str:
    """Return `not installed: rerun-sdk; pip install 'lhdmap[view]'` of an optional library."""
    found = LIBRARIES[name]
    return f"not installed: {found.distribution}; pip install 'lhdmap[{found.extra}]'"


def missing_text(error: ImportError, wanted: str = "") -> str:
    """Return what a person is told of a failed import: what is missing and how it gets there."""
    name = (wanted or error.name or "").partition(".")[0]
    absent = isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] in (name, "")
    if name not in LIBRARIES:
        what = f"not installed: {error.name}" if absent and error.name else f"the installation is not complete: {error}"
        return f"{what}; pip install --upgrade --force-reinstall lhdmap"
    if absent:
        return install_line(name)
    found = LIBRARIES[name]
    cause = " ".join(str(error).split())
    return f"{found.distribution} cannot be loaded: {cause}\n{found.hint or install_line(name).partition('; ')[2]}"
