"""Rows put together to what was weak or lost, and why."""

from __future__ import annotations

from lhdmap.localization.episodes import episodes
from lhdmap.localization.rows import CANDIDATE, LOST, NOWHERE, TRACKING, UNKNOWN, LocalizationRow

TENTH_NS = 100_000_000


def rows(*parts: tuple[str, int, float]) -> list[LocalizationRow]:
    """Rows of a status, so many, with a deviation along."""
    out: list[LocalizationRow] = []
    for status, count, along in parts:
        for _ in range(count):
            placed = status != UNKNOWN
            out.append(
                NOWHERE._replace(
                    stamp_ns=len(out) * TENTH_NS, status=status, node="t" if placed else "", rho_m=0.1 * len(out),
                    std_along_m=along, std_across_m=0.01, source="walls",
                )
            )  # fmt: skip
    return out


def test_a_drive_that_tracks_has_none() -> None:
    assert episodes(rows((TRACKING, 50, 0.02)), []) == []


def test_each_kind_in_order_with_its_reason() -> None:
    drive = rows((UNKNOWN, 10, 0.1), (CANDIDATE, 5, 0.1), (TRACKING, 20, 0.02), (LOST, 10, 0.3), (TRACKING, 5, 0.02))
    found = episodes(drive, [(34 * TENTH_NS, "no wall agrees")])
    assert [one.kind for one in found] == [UNKNOWN, CANDIDATE, LOST]
    assert [(one.from_ns, one.to_ns) for one in found] == [
        (0, 9 * TENTH_NS),
        (10 * TENTH_NS, 14 * TENTH_NS),
        (35 * TENTH_NS, 44 * TENTH_NS),
    ]
    assert found[2].why == "no wall agrees"
    assert found[2].node == "t"


def test_a_weak_stretch_says_how_weak_and_a_short_one_is_left_out() -> None:
    drive = rows(
        (TRACKING, 10, 0.02), (TRACKING, 10, 0.3), (TRACKING, 10, 0.02), (TRACKING, 1, 0.3), (TRACKING, 9, 0.02)
    )
    (one,) = episodes(drive, [])
    assert one.kind == "weak"
    assert "30 cm along" in one.why


def test_weak_stretches_close_to_each_other_are_one() -> None:
    drive = rows((TRACKING, 10, 0.3), (TRACKING, 2, 0.02), (TRACKING, 10, 0.3))
    assert len(episodes(drive, [])) == 1
