"""The nodes of a cluster before the rows: the same versions on all of them, kernels made ready once on each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from lhdmap import __version__
from lhdmap.batch.work import Warm
from lhdmap.errors import InputError
from lhdmap.extras import library

_TALK = ("python", "distributed", "dask", "cloudpickle", "msgpack")
"""What the scheduler must have in common with the others, to understand them."""
_LIBRARIES = ("numpy", "scipy", "numba")
_WORK = (*_TALK, "lhdmap", *_LIBRARIES)
"""And the workers, to come to the same digits."""
OWN_VERSION = "__import__('lhdmap').__version__"
"""Asked of each worker in words: an older lhdmap does not have the functions of this one, and may be no installed distribution."""
_LOOK_S = 2.0


def check_versions(client: Any) -> None:
    """Raise InputError with the names of the nodes whose versions are not those of this process.

    `get_versions(check=True)` itself warns only, names no worker, and knows installed distributions, not what is imported.
    """
    found = client.get_versions(packages=list(_LIBRARIES))
    own = client.run(eval, OWN_VERSION, on_error="return")
    names = {address: info.get("name", address) for address, info in workers_of(client).items()}
    here = {**found["client"]["packages"], "lhdmap": __version__}
    different = list(_differences("the scheduler", found["scheduler"], here, _TALK))
    for address, info in found["workers"].items():
        told = own.get(address)
        there = {**((info or {}).get("packages") or {}), "lhdmap": told if isinstance(told, str) else ""}
        different += _differences(f"worker {names.get(address, '')} at {address}", {"packages": there}, here, _WORK)
    if different:
        raise InputError(f"versions differ: {'; '.join(different)}\ninstall the same lhdmap and libraries on all nodes")


def _differences(
    who: str, info: Mapping[str, Any] | None, here: Mapping[str, Any], names: tuple[str, ...]
) -> Iterator[str]:
    packages = (info or {}).get("packages") or {}
    for name in names:
        there, own = _version(name, packages), _version(name, here)
        if there != own:
            yield f"{who} has {f'{name} {there}' if there else f'no {name}'}, here {own}"


def _version(name: str, packages: Mapping[str, Any]) -> str:
    """Return a version, of Python its first two numbers: what is sent around does not hang on the third."""
    told = str(packages.get(name) or "")
    return ".".join(told.split(".")[:2]) if name == "python" else told


def workers_of(client: Any) -> Mapping[str, Mapping[str, Any]]:
    """Return what the scheduler knows of its workers, by address."""
    return client.scheduler_info(n_workers=-1).get("workers") or {}


def warm_nodes(client: Any, warm: Warm) -> None:
    """Run the warm-up on one worker of each node and wait for all; a node that fails is told of, its rows compile themselves."""
    wait = library("distributed").wait
    nodes = {str(info.get("host")): address for address, info in sorted(workers_of(client).items(), reverse=True)}
    warm.told(f"kernels are made ready, once on each of {len(nodes)} {'node' if len(nodes) == 1 else 'nodes'}")
    futures = {
        client.submit(
            _seconds, warm.call, key=f"lhdmap-warm-{host}-{time.time_ns()}", workers=[address], pure=False
        ): host
        for host, address in nodes.items()
    }
    pending = set(futures)
    while pending:
        try:
            ended, pending = wait(pending, timeout=_LOOK_S, return_when="FIRST_COMPLETED")
        except TimeoutError:
            there = workers_of(client)
            ended = {future for future in pending if nodes[futures[future]] not in there}
            pending = pending - ended
        for future in ended:
            warm.told(f"node {futures[future]}: {_came_to(future)}")


def _came_to(future: Any) -> str:
    if future.status == "finished":
        return f"kernels ready in {future.result():.1f} s"
    why = (
        f"{type(future.exception()).__name__}: {future.exception()}"
        if future.status == "error"
        else "its worker is gone"
    )
    future.cancel()
    return f"kernels are left to the rows: {why}"


def _seconds(call: Callable[[], object]) -> float:
    """Run on a worker."""
    began_s = time.monotonic()
    call()
    return time.monotonic() - began_s
