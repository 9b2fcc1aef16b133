"""What a person is told while it runs."""

from __future__ import annotations

import io
import math
import sys

import pytest
from lhdmap.cli.console import Console
from lhdmap.cli.live import status_text
from lhdmap.cli.main import main
from lhdmap.live.watch import Status

NOW = Status(
    42.5, (61.02, -3.11, 0.42, math.radians(12.4)), "odom", "", 2125, 63.0, True, 0.04, 0, 3, 0, 0, 0, 0, "", 14.2
)


def test_a_status_says_what_is_and_leaves_out_what_is_not() -> None:
    assert status_text(NOW) == (
        "   42.5 s | odom 61.02 -3.11 0.42 m 12.4° | 63.0 m driven | 2125 scans, 4 % weak (now) | 3 waiting | 14 ms late"
    )
    odd = NOW._replace(pose=None, weak=False, waiting=0, dropped=7, reconnects=2, latency_ms=math.nan, pile="wall")
    assert status_text(odd) == "   42.5 s | no pose yet | 2125 scans, 4 % weak | pile wall | 7 dropped | 2 reconnects"
    assert "| map 61.02" in status_text(NOW._replace(frame="map", place="tracking"))


def test_a_refreshed_line_is_ended_before_another_text(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(sys, "stderr", written)
    monkeypatch.setenv("COLUMNS", "21")
    console = Console()
    console.status("first", terminal=True)
    console.status("second", terminal=True)
    console.note("a note")
    console.status("a plain one", terminal=False)
    assert written.getvalue() == f"\r{'first':<20}\r{'second':<20}\na note\na plain one\n"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["a.mcap", "--for", "0"], "--for 0: seconds above 0 were wanted"),
        (["a.mcap", "--quiet-end", "nan"], "--quiet-end nan: seconds above 0 were wanted"),
        (["a.mcap", "--start", "T1"], "--map was wanted beside it"),
        (["http://x", "-o", "never"], "a source was wanted"),
    ],
)
def test_requests_that_cannot_be_met(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", *words]) == 2
    assert told in capsys.readouterr().err
