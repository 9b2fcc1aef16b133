"""`live` as a function: a source in; the log, and the folder that `build-map` or `localize` would make of it, out.

source -> Link (thread) -> Inbox, which records -> LiveContainer -> LogSource -> the stages of build_map or localize
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lhdmap.config import Settings, settings_table
from lhdmap.live.followed import Followed, Thinned
from lhdmap.live.inbox import MOST_BYTES, MOST_MESSAGES, Inbox
from lhdmap.live.recorder import LiveRecorder
from lhdmap.live.source import LiveSource
from lhdmap.live.tally import MessageTally
from lhdmap.live.warm_up import warm_up
from lhdmap.live.watch import Status, Watch
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.outputs import free_folder
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.localize_run import LocalizeRequest, localize
from lhdmap.runfolder import RunFolderWriter, RunInfo

KIND = "live"
LOG, MAP, PLACES = "log.mcap", "map", "localization"


def _nothing(_: object) -> None:
    """Tell nobody."""


@dataclass(frozen=True, slots=True)
class LiveRequest:
    """What is to be followed, and what is to be made of it.

    `map`: localize on it instead of building one; `start` (4,) about where the machine is then. `for_s`: how long, None until the
    source ends, or Ctrl-C. `show` is told the status at an interval (s), `say` what happens. `most`: messages and bytes that may
    wait. `warm`: have all kernels ready before the first message. `live_port`: where viewers on this machine may follow.
    """

    source: LiveSource
    target: Path
    map: Path | None = None
    settings: Settings = field(default_factory=Settings)
    topics: Mapping[str, str] = field(default_factory=dict)
    machine: Machine | None = None
    start: FloatArray | None = None
    for_s: float | None = None
    force: bool = False
    helper: bool = False
    warm: bool = True
    live_port: int | None = None
    interval_s: float = 1.0
    show: Callable[[Status], None] = _nothing
    say: Callable[[str], None] = _nothing
    most: tuple[int, int] = (MOST_MESSAGES, MOST_BYTES)


@dataclass(frozen=True, slots=True)
class LiveResult:
    """The folder; the figures of `live --json`: those of the stream, and those of the map or the localization."""

    folder: Path
    summary: dict[str, Any]
    warnings: list[str]


def live(request: LiveRequest) -> LiveResult:
    """Follow a running machine until it ends, and write its folder.

    Raises:
        UsageError: the folder is there already.
        InputError: the source cannot be used, or no scan came.
    """
    inputs = [] if request.map is None else [request.map]
    free_folder(request.target, force=request.force, inputs=inputs)
    with RunFolderWriter(KIND, request.target, force=request.force, inputs=inputs) as folder:
        if request.warm:
            request.say("kernels are made ready; the first time after installation it takes a minute or two")
            warm_up(request.settings, request.machine)
        request.say(f"{request.source.address}: followed from now on")
        log = folder.path / LOG
        with _followed(request, log) as followed:
            folder.finished(log)
            made = _map if request.map is None else _places
            inner, summary, told = made(request, followed, log)
        told = [*followed.inbox.said, *told]
        stream = followed.observer.figures()
        figures = {"source": request.source.address, "stream": stream, **summary}
        options = settings_table(request.settings) | {"request": {"source": request.source.address}}
        more = {"map": MAP} if request.map is None else {}
        path = folder.complete(RunInfo((), options, {**summary, "stream": stream}, told, more=more))
    return LiveResult(path, {"run": str(path), "log": str(path / LOG), inner: str(path / inner), **figures}, told)


def _followed(request: LiveRequest, log: Path) -> Followed:
    inbox = Inbox(LiveRecorder(log), MessageTally(), waits=request.source.waits, most=request.most, heard=request.say)
    observer = Watch(inbox, request.show, request.interval_s)
    return Followed(request.source, inbox, observer, live_port=request.live_port, for_s=request.for_s)


def _map(request: LiveRequest, followed: Followed, log: Path) -> tuple[str, dict[str, Any], list[str]]:
    """Build the map while the machine drives; where messages were dropped, from the log, in which they are."""
    target, names = log.parent / MAP, {log: request.target / LOG}
    asked = BuildRequest(
        [log],
        target,
        request.settings,
        request.topics,
        request.machine,
        helper=request.helper,
        recorded_as=names,
        stream=followed,
    )
    try:
        result = build_map(asked)
    except Thinned:
        followed.inbox.say("messages were dropped: the map is built anew from the log, which has them")
        result = build_map(replace(asked, stream=None))
    summary = {key: value for key, value in result.summary.items() if key != "map"}
    return MAP, summary, result.warnings + _seen_otherwise(request, followed, log)


def _places(request: LiveRequest, followed: Followed, log: Path) -> tuple[str, dict[str, Any], list[str]]:
    """Localize while the machine drives."""
    assert request.map is not None  # noqa: S101
    result = localize(
        LocalizeRequest(
            [log],
            request.map,
            log.parent / PLACES,
            request.settings,
            request.topics,
            request.machine,
            request.start,
            stream=followed,
            recorded_as={log: request.target / LOG},
        )
    )
    summary = dict(result.summary)
    told: list[str] = summary.pop("warnings")
    return PLACES, summary, told + _seen_otherwise(request, followed, log)


def _seen_otherwise(request: LiveRequest, followed: Followed, log: Path) -> list[str]:
    """Return what a look through the whole log finds that one through its first seconds could not."""
    with LogSource([log], request.topics, force=True) as source:
        whole = source.survey
    begun = followed.survey
    if whole.repairs == begun.repairs and whole.left_out == begun.left_out:
        return []
    roles = ", ".join(sorted(set(whole.left_out) ^ set(begun.left_out))) or "a scanner's repair"
    again = f"lhdmap build-map {request.target / LOG} goes by the whole"
    return [f"the whole log tells otherwise of {roles} than its first seconds did: {again}"]
