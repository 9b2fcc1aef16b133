"""A process beside this one does the same as an object here, tells what goes wrong there, and leaves nothing running."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from lhdmap.errors import InputError
from lhdmap.messages import Message
from lhdmap.pipeline import build
from lhdmap.pipeline.beside import HelperDied, Here, ProcessBeside
from lhdmap.pipeline.build import BuildRequest, BuildResult, build_map


class Unsendable(Exception):
    """Holds what cannot be pickled."""

    def __init__(self) -> None:
        super().__init__("locked")
        self.lock = threading.Lock()


class NeedsTwo(Exception):
    """Is pickled, and cannot be made again from that."""

    def __init__(self, one: int = 1, *, two: int = 2) -> None:
        super().__init__(one, two, "too many")


class Notebook:
    """Keeps numbers; writes them when it is closed."""

    def __init__(self, path: Path, first: int = 0) -> None:
        if first < 0:
            raise InputError("a number was wanted")
        self._path, self._numbers = path, [first]

    def add(self, number: int, padding: bytes = b"") -> None:
        """Keep a number."""
        if number == 13:
            raise InputError("13 is refused")
        self._numbers.append(number)

    def numbers(self) -> list[int]:
        """Return all numbers."""
        return self._numbers

    def fail(self, kind: type[Exception]) -> None:
        """Raise an error of this kind."""
        raise kind()

    def process(self) -> int:
        """Return the process that this is in."""
        return os.getpid()

    def close(self) -> None:
        """Write the numbers."""
        self._path.write_text(json.dumps(self._numbers), encoding="utf-8")


@pytest.mark.parametrize("kind", [Here, ProcessBeside])
def test_what_is_told_is_done_in_order_and_closed(kind: Any, tmp_path: Path) -> None:
    with kind(Notebook, tmp_path / "kept", first=7) as notebook:
        for number in range(100, 400):
            notebook.tell(Notebook.add, number, padding=bytes(4000))
        assert notebook.ask(Notebook.numbers) == [7, *range(100, 400)]
        assert (notebook.ask(Notebook.process) == os.getpid()) == (kind is Here)
        notebook.tell(Notebook.add, 1)
    assert json.loads((tmp_path / "kept").read_text(encoding="utf-8")) == [7, *range(100, 400), 1]
    assert not multiprocessing.active_children()


def test_several_threads_tell(tmp_path: Path) -> None:
    with ProcessBeside(Notebook, tmp_path / "kept") as notebook:

        def tell(start: int) -> None:
            for number in range(start, start + 500):
                notebook.tell(Notebook.add, number, bytes(2000))

        threads = [threading.Thread(target=tell, args=(start,)) for start in (1000, 2000, 3000)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        found = notebook.ask(Notebook.numbers)
    assert sorted(found) == [0, *range(1000, 1500), *range(2000, 2500), *range(3000, 3500)]
    assert [n for n in found if 2000 <= n < 3000] == list(range(2000, 2500))


def test_an_error_there_comes_out_of_the_next_question(tmp_path: Path) -> None:
    with ProcessBeside(Notebook, tmp_path / "kept") as notebook:
        notebook.tell(Notebook.add, 13)
        notebook.tell(Notebook.add, 14)
        with pytest.raises(InputError, match="13 is refused") as caught:
            notebook.ask(Notebook.numbers)
    assert "in add" in caught.value.__notes__[0]
    assert json.loads((tmp_path / "kept").read_text(encoding="utf-8")) == [0]


@pytest.mark.parametrize("kind", [Unsendable, NeedsTwo])
def test_an_error_that_cannot_be_sent_is_told_in_words(kind: Any, tmp_path: Path) -> None:
    with (
        ProcessBeside(Notebook, tmp_path / "kept") as notebook,
        pytest.raises(RuntimeError, match=kind.__name__) as caught,
    ):
        notebook.ask(Notebook.fail, kind)
    assert "in fail" in caught.value.__notes__[0]


def test_an_object_that_cannot_be_made(tmp_path: Path) -> None:
    with ProcessBeside(Notebook, tmp_path / "kept", -1) as notebook, pytest.raises(InputError, match="wanted"):
        notebook.ask(Notebook.numbers)


def test_a_process_that_is_killed_is_told_of(tmp_path: Path) -> None:
    with ProcessBeside(Notebook, tmp_path / "kept") as notebook:
        os.kill(notebook.ask(Notebook.process), signal.SIGKILL)

        for _ in range(200):  # more than the pipe and the queue hold: nothing may wait for the dead
            notebook.tell(Notebook.add, 1, bytes(200_000))
        with pytest.raises(HelperDied, match="--one-process"):
            notebook.ask(Notebook.numbers)


def test_ctrl_c_is_left_to_the_side_that_tells(tmp_path: Path) -> None:
    with ProcessBeside(Notebook, tmp_path / "kept") as notebook:
        os.kill(notebook.ask(Notebook.process), signal.SIGINT)
        notebook.tell(Notebook.add, 5)
    assert json.loads((tmp_path / "kept").read_text(encoding="utf-8")) == [0, 5]


def test_a_map_made_with_a_helper_is_the_same(
    built: BuildResult, untold: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "_BESIDE_FROM_S", 0.0)
    monkeypatch.setattr(build, "_cores", lambda: 2)
    found = build_map(BuildRequest([untold], tmp_path / "map", helper=True))
    assert {path.name for path in found.folder.iterdir()} == {path.name for path in built.folder.iterdir()}
    for name in ("trajectory.tum", "cloud.ply", "pile.json"):
        assert (found.folder / name).read_bytes() == (built.folder / name).read_bytes()
    sizes = [(folder / "recording.rrd").stat().st_size for folder in (found.folder, built.folder)]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.02)
    assert not multiprocessing.active_children()


def test_a_helper_that_is_killed_costs_the_recorded_scans_only(
    built: BuildResult, untold: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "_BESIDE_FROM_S", 0.0)
    monkeypatch.setattr(build, "_cores", lambda: 2)

    def killing(messages: Iterable[tuple[str, Message]], _: float) -> Iterable[tuple[str, Message]]:
        for number, item in enumerate(messages):
            if number == 100:
                (helper,) = multiprocessing.active_children()
                helper.kill()
            yield item

    found = build_map(BuildRequest([untold], tmp_path / "map", progress=killing, helper=True))
    assert {path.name for path in found.folder.iterdir()} == {path.name for path in built.folder.iterdir()}
    for name in ("trajectory.tum", "cloud.ply"):
        assert (found.folder / name).read_bytes() == (built.folder / name).read_bytes()
    pile, wanted = (json.loads((f.folder / "pile.json").read_text(encoding="utf-8")) for f in (found, built))
    assert pile["status"] == wanted["status"]
    assert any("--one-process" in warning for warning in found.warnings)
