"""The tree of frames that a log's transforms make: one resolver of mounts, for `doctor` and for the pipeline.

Transforms are walked both ways, through common ancestors (`base_footprint` as the parent of base and scanner) and published
inverses. A name space in front of the frames (`robot1/base_link`) is taken off.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np

from lhdmap.geometry import se3
from lhdmap.messages import BODY_FRAMES, FloatArray, Mount

# Robots without a base_link: the frame under the base on the floor, which is what base_link is here.
_STANDS_FOR = {"base_footprint": "base_link"}
_BODIES = (*BODY_FRAMES, *_STANDS_FOR)
_SAME = 1e-6
_Edges = Mapping[str, Mount]


class FrameTree:
    """Transforms between frames; the last one that a log states of a child holds for the whole log.

    Those of `/tf` (`static=False`) count where they never changed and no static one leads to a body.
    """

    def __init__(self) -> None:
        self._static: dict[str, Mount] = {}
        self._loose: dict[str, Mount] = {}
        self._moving: set[str] = set()
        self._stated_anew: dict[str, None] = {}
        self._prefixes: dict[str, None] = {}

    def add(self, mount: Mount, *, static: bool = True) -> None:
        """Take one transform of the log; one of a frame to itself, and one that is no pose, are left out."""
        child = mount.child_frame
        if child == mount.parent_frame or not np.isfinite(mount.T_parent_child).all():
            return
        edges = self._static if static else self._loose
        changed = child in edges and not _same(edges[child], mount)
        if static and changed:
            self._stated_anew[child] = None
        elif changed:
            self._moving.add(child)
        edges[child] = mount

    @property
    def remarks(self) -> list[str]:
        """What was odd in the transforms, one line each."""
        prefixes = [f"the frames of the log carry the prefix '{prefix}/': it is taken off" for prefix in self._prefixes]
        anew = [
            f"the mount of '{child}' is stated more than once, differently: the last one is used for the whole log"
            for child in self._stated_anew
        ]
        return prefixes + anew

    def transforms(self) -> list[Mount]:
        """Return the transforms that hold for the whole log."""
        return list((self._constant() | self._static).values())

    def mount(self, frame: str) -> Mount | None:
        """Return the pose of a sensor's frame on `base_link` or `rear_link`, None where no transforms lead to either."""
        found = _nearest_body(frame, self._static) or _nearest_body(frame, self._constant() | self._static)
        if found is None:
            return None
        body, T_body_sensor = found
        prefix, _, name = body.rpartition("/")
        if prefix:
            self._prefixes[prefix] = None
        return Mount(0, _STANDS_FOR.get(name, name), frame, T_body_sensor)

    def _constant(self) -> dict[str, Mount]:
        return {child: mount for child, mount in self._loose.items() if child not in self._moving}


def _same(one: Mount, other: Mount) -> bool:
    close = np.allclose(one.T_parent_child, other.T_parent_child, rtol=0.0, atol=_SAME)
    return one.parent_frame == other.parent_frame and close


def _nearest_body(frame: str, edges: _Edges) -> tuple[str, FloatArray] | None:
    """Return the body that is reached first from a frame (a stand-in only where there is no body), and `T_body_frame` (4, 4)."""
    bodies: list[tuple[bool, int, int, str, FloatArray]] = [
        (name in _STANDS_FOR, hops, _BODIES.index(name), reached, T)
        for hops, reached, T in _walk(_named(frame, edges), edges)
        if (name := reached.rpartition("/")[2]) in _BODIES
    ]
    if not bodies:
        return None
    *_, body, T_body_frame = min(bodies, key=lambda one: one[:3])
    return body, T_body_frame


def _named(frame: str, edges: _Edges) -> str:
    """Return the name that the transforms have for a sensor's frame: with or without a name space in front of it."""
    known = {name for child, mount in edges.items() for name in (child, mount.parent_frame)}
    if frame in known:
        return frame
    alike = [name for name in known if name.rpartition("/")[2] == frame.rpartition("/")[2]]
    return alike[0] if len(alike) == 1 else frame


def _walk(start: str, edges: _Edges) -> Iterator[tuple[int, str, FloatArray]]:
    """Yield how far away each frame is that can be reached from `start`, its name, and `T_frame_start` (4, 4)."""
    children: dict[str, list[Mount]] = {}
    for mount in edges.values():
        children.setdefault(mount.parent_frame, []).append(mount)
    seen, waiting = {start}, deque[tuple[int, str, FloatArray]]([(0, start, np.eye(4))])
    while waiting:
        hops, frame, T_frame_start = waiting.popleft()
        yield hops, frame, T_frame_start
        above = edges.get(frame)
        steps: list[tuple[str, FloatArray]] = [] if above is None else [(above.parent_frame, above.T_parent_child)]
        steps += [(below.child_frame, se3.inverse(below.T_parent_child)) for below in children.get(frame, ())]
        for name, T_name_frame in steps:
            if name not in seen:
                seen.add(name)
                waiting.append((hops + 1, name, T_name_frame @ T_frame_start))
