"""IREDES: sums are those of the records, the schema holds, and the check finds what is wrong."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest
from lhdmap.haulage.records import Cycle, Phase
from lhdmap.production.iredes import iredes_xml, trips_of
from lhdmap.production.iredes_schema import NAMESPACE, faults_of

from tests.haulage.drives import Drive
from tests.haulage.sites import hejase
from tests.haulage.test_mission import ORDER
from tests.production.records import cycle, intervals, shift


def read(cycles: list[Cycle]) -> ET.Element:
    return ET.fromstring(iredes_xml(cycles).encode())  # noqa: S314  # our own


def texts(root: ET.Element, name: str) -> list[str]:
    return [one.text or "" for one in root.iter(f"{{{NAMESPACE}}}{name}")]


def test_sums_are_those_of_the_records() -> None:
    root = read(shift())
    assert list(faults_of(root)) == []
    assert texts(root, "LTPPCyclTot") == ["4"]
    assert texts(root, "LTPPdistTot") == ["0.7"]  # 684 m in steps of 0.1 km
    assert texts(root, "LTPPloadTot") == ["40.70"]
    assert texts(root, "LTPPLmass") == ["40.70"]
    assert texts(root, "LTPPLdist") == ["0.68"]
    assert texts(root, "Traffic") == ["PT20.0S"]
    assert texts(root, "LTPPMaction") == ["Load", "Dump"] * 4
    assert texts(root, "LTPPMwaitgen") == ["PT0.0S"] * 3 + ["PT20.0S"] + ["PT0.0S"] * 4
    assert [float(text) for text in texts(root, "LTPPMpayld")][1::2] == pytest.approx([9.35, 9.9, 10.45, 11.0])
    assert texts(root, "LTPPMisstart")[0] == "2023-11-14T22:13:20.000Z"
    assert texts(root, "LTPPMissEnd")[-1] == "2023-11-14T22:20:20.000Z"


def test_trips_follow_each_other_from_point_to_point() -> None:
    drive = Drive(hejase())
    drive.run(ORDER, 3000.0)
    rest = drive.task.rest()
    assert rest is not None
    trips = trips_of([*drive.cycles, rest])
    assert [(one.begin[0], one.end[0], one.action) for one in trips] == [
        ("park", "L1", "Load"), ("L1", "D1", "Dump"), ("D1", "L1", "Load"), ("L1", "D1", "Dump"), ("D1", "P1", "Parking"),
    ]  # fmt: skip
    assert list(faults_of(read([*drive.cycles, rest]))) == []


def test_waits_at_points_are_no_rock_and_cannot_dump() -> None:
    waits = intervals(
        (Phase.RETURN, 10.0, "", "", 30.0), (Phase.QUEUE_LOAD, 7.0, "DP1", "", 0.0), (Phase.LOAD, 25.0, "", "", 0.0),
        (Phase.HAUL, 10.0, "", "", 30.0), (Phase.QUEUE_DUMP, 5.0, "", "", 0.0), (Phase.DUMP, 9.0, "", "", 0.0),
    )  # fmt: skip
    root = read([cycle(1, 0.0)._replace(intervals=waits)])
    assert (texts(root, "NoRock"), texts(root, "CantDump")) == (["PT7.0S"], ["PT5.0S"])
    assert texts(root, "LTPPMwaitPoint") == ["PT7.0S", "PT5.0S"]
    assert list(faults_of(root)) == []


def test_what_is_not_known_still_makes_a_valid_report() -> None:
    bare = Cycle("lhd", 1, "", "", shift()[0].intervals)
    assert list(faults_of(read([bare]))) == []
    assert list(faults_of(read([]))) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("<LTPPCyclTot>4</LTPPCyclTot>", "", "LTPPCyclTot is missing"),
        ("<LTPPCyclTot>4</LTPPCyclTot>", "<LTPPCyclTot>four</LTPPCyclTot>", "is no count"),
        ("<LTPPloadTot>40.70</LTPPloadTot>", "<LTPPloadTot>40.7</LTPPloadTot>", "2 digits"),
        ("<LTPPloadTot>40.70</LTPPloadTot>", "<LTPPloadTot>nan</LTPPloadTot>", "2 digits"),
        ("<Traffic>PT20.0S</Traffic>", "<Traffic>20 s</Traffic>", "is no duration"),
        ("<LTPPMaction>Load</LTPPMaction>", "<LTPPMaction>Sing</LTPPMaction>", "one of Load"),
        ("<LTPPwrkDist>0.7</LTPPwrkDist>", "<LTPPwrkdist>0.7</LTPPwrkdist>", "LTPPwrkdist is not known"),
        (
            "<LTPPdistTot>0.7</LTPPdistTot>",
            "<LTPPdistTot>0.7</LTPPdistTot><LTPPdistTot>0.7</LTPPdistTot>",
            "stands 2 times",
        ),
        ("2023-11-14T22:20:20.000Z</LTPPMissEnd>", "2023-11-14T21:20:20.000Z</LTPPMissEnd>", "LTPPMissEnd is before"),
        ("<LTPPLoadRep", "<LTPPloadRep", "LTPPLoadRep was wanted"),
    ],
)
def test_the_check_finds_what_is_wrong(old: str, new: str, told: str) -> None:
    text = iredes_xml(shift())
    assert old in text
    text = text.replace(old, new, 1).replace(
        "</LTPPLoadRep>", "</LTPPloadRep>" if old == "<LTPPLoadRep" else "</LTPPLoadRep>"
    )
    root = ET.fromstring(text.encode())  # noqa: S314  # our own
    assert any(told in fault for fault in faults_of(root))
