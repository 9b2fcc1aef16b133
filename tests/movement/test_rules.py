"""The rules against the cells of Tables 1 and 2 as the paper prints them, but for the four that are wrong there."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.movement.rules import NAMES, STATES, reversed_kind, rule_pairs, successors
from lhdmap.topology.model import KINDS

COLUMNS = ("front_front", "front_back", "back_front", "back_back")
MOVING = """
i   | - | - | i vi | iii v
ii  | - | - | ii v | iv vi
iii | i vi | iii v | - | -
iv  | ii v | iv vi | - | -
"""
TABLE_1 = (
    MOVING
    + """
v   | i  | iii | i  | iv
vi  | ii | iv  | ii | iii
"""
)
TABLE_2 = (
    MOVING
    + """
v   | i vi | iii v | i vi | iv vi
vi  | ii v | iv vi | ii v | iii v
"""
)
ERRATA = {
    (1, "v", "back_front"): {"ii"},
    (1, "vi", "back_front"): {"i"},
    (2, "v", "back_front"): {"ii", "v"},
    (2, "vi", "back_front"): {"i", "vi"},
}


def printed(table: str) -> dict[tuple[str, str], set[str]]:
    """Return the cells of a table as it is printed, by origin and column."""
    cells = {}
    for line in filter(None, table.splitlines()):
        origin, *entries = (cell.strip() for cell in line.split("|"))
        for column, entry in zip(COLUMNS, entries, strict=True):
            cells[origin, column] = set(entry.replace("-", "").split())
    return cells


@pytest.mark.parametrize("number", [1, 2])
def test_all_cells_are_those_printed_but_for_the_errata(number: int) -> None:
    cells = printed(TABLE_1 if number == 1 else TABLE_2)
    assert len(cells) == 24
    differ = {}
    for (origin, column), entry in cells.items():
        kind = next(kind for kind in KINDS if kind == column)
        derived = {NAMES[k] for k in successors(NAMES.index(origin), kind, within=number == 1)}
        if derived != entry:
            differ[number, origin, column] = derived
    assert differ == {key: cell for key, cell in ERRATA.items() if key[0] == number}


@given(st.sampled_from(KINDS), st.booleans(), st.integers(0, 5))
def test_gear_is_kept_and_a_change_of_gear_needs_a_stop(kind: str, within: bool, origin: int) -> None:
    for end in successors(origin, kind, within=within):  # type: ignore[arg-type]
        if STATES[origin].motion and STATES[end].motion:
            assert STATES[origin].gear == STATES[end].gear


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("within", [True, False])
def test_what_is_driven_one_way_can_be_driven_back(kind: str, within: bool) -> None:
    """The same way backwards: motions turned round, the heading kept; a stop for a stop, as far as the rules let one stop."""
    forth = rule_pairs(kind, within=within)  # type: ignore[arg-type]
    back = rule_pairs(reversed_kind(kind), within=within)  # type: ignore[arg-type]
    for origin, end in forth:
        (m0, h0), (m1, h1) = STATES[origin], STATES[end]
        if m0 and m1:
            assert (STATES.index((-m1, h1)), STATES.index((-m0, h0))) in back
