"""The picture in the documentation is the table that runs."""

from __future__ import annotations

import re
from pathlib import Path

from lhdmap.loading.diagram import mermaid
from lhdmap.loading.states import TABLE, Event, State

PAGE = Path(__file__).resolve().parents[3] / "docs" / "loading.md"


def test_the_documentation_shows_the_table_that_runs() -> None:
    text = PAGE.read_text(encoding="utf-8")
    shown = re.search(r"```mermaid\n(.*?)```", text, re.DOTALL)
    assert shown is not None
    assert shown.group(1) == mermaid(), "docs/loading.md: put in what lhdmap.loading.diagram.mermaid() returns"


def test_the_diagram_has_every_state_and_every_move() -> None:
    arrows = {
        (start, end): said.split(" / ")
        for start, end, said in re.findall(r"^    (\w+) --> (\w+): (.+)$", mermaid(), re.MULTILINE)
    }
    for (start, event), end in TABLE.items():
        if event not in (Event.EMERGENCY, Event.CANCELLED):
            assert event.value in arrows[start.value, end.value]
    assert {name for arrow in arrows for name in arrow} == {state.value for state in State}
