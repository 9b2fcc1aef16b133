"""Closures for the report: where they are on the final path, and how far from what they measured."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.pipeline.closures import closure_rows
from lhdmap.pipeline.track import TrackRows
from lhdmap.smoothing.evidence import Evidence


def circle() -> TrackRows:
    """Round a circle of 10 m once, a second for each degree; the heading is along it, the height rises by 1 m."""
    degrees = np.arange(361)
    angle = np.radians(degrees)
    poses = np.zeros((361, 6))
    poses[:, 0], poses[:, 1], poses[:, 2] = 10.0 * np.cos(angle), 10.0 * np.sin(angle), degrees / 360.0
    poses[:, 5] = angle + math.pi / 2
    return TrackRows(degrees.astype(np.int64) * 1_000_000_000, poses)


def evidence(offset: list[float], *, accepted: bool = True, reason: str = "") -> Evidence:
    return Evidence(0, 360_000_000_000, accepted, reason, 0.9, 0.02, np.array(offset), 1.0)


def test_a_closure_has_its_places_and_what_it_is_off() -> None:
    (row,) = closure_rows([evidence([0.3, -0.4, 0.0])], circle())
    assert row.from_m == pytest.approx([10.0, 0.0, 0.0])
    assert row.to_m == pytest.approx([10.0, 0.0, 1.0])
    assert row.residual_m == pytest.approx(0.5)
    assert row.information == pytest.approx(2500.0)


def test_those_believed_come_first_and_what_was_not_measured_is_no_number() -> None:
    nowhere = evidence([math.nan] * 3, accepted=False, reason="few hits")
    first, second = closure_rows([nowhere, evidence([0.0, 0.0, 0.0])], circle())
    assert (first.accepted, second.accepted) == (True, False)
    assert math.isnan(second.residual_m)
    assert second.reason == "few hits"


def test_none_are_none() -> None:
    assert closure_rows([], circle()) == []
