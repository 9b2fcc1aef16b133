"""lhdmap: perception and mapping for load-haul-dump machines in underground mines.

    import lhdmap

    drive = lhdmap.build_map("drive.mcap", out="map")  # or lhdmap.open_map("map"), of a map that is there
    drive.trajectory.positions_m, drive.cloud().points_m, drive.report, drive.warnings

The package imports nothing heavy: `import lhdmap` stays cheap, and what is named here is loaded when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lhdmap.errors import ConfigError, EvaluationShortfall, InputError, LhdmapError, LhdmapWarning, UsageError

if TYPE_CHECKING:
    from lhdmap.front import Map, build_map, open_map

__version__ = "0.1.0"
__all__ = [
    "ConfigError",
    "EvaluationShortfall",
    "InputError",
    "LhdmapError",
    "LhdmapWarning",
    "Map",
    "UsageError",
    "__version__",
    "build_map",
    "open_map",
]

_LATER = {"Map", "build_map", "open_map"}  # of lhdmap.front, which loads numpy and the pipeline


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER})


if not TYPE_CHECKING:  # a type checker shall see unknown names as such

    def __getattr__(name: str) -> Any:
        """Load what is heavy when it is first asked for (PEP 562)."""
        if name not in _LATER:
            raise AttributeError(f"module 'lhdmap' has no attribute '{name}'")
        from lhdmap import front

        return getattr(front, name)
