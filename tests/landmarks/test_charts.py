"""The report's charts of a tunnel: what they show, and that they can be drawn where there is little to show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.report import charts
from lhdmap.report.landmark_charts import distinctness_chart, similarity_chart

from tests.landmarks.conftest import Taught

SETTINGS = LandmarkSettings()


def test_the_matrix_and_its_keys_are_drawn(rough: Taught) -> None:
    with charts.styled():
        figure = similarity_chart(rough.landmarks, "t")
    (image,) = figure.axes[0].images
    expected = 1e3 * np.sqrt(rough.landmarks.similarity["t"])
    assert np.asarray(image.get_array()) == pytest.approx(expected)
    keys = rough.landmarks.at_m[rough.landmarks.key]
    drawn = sorted({float(np.asarray(line.get_xdata())[0]) for line in figure.axes[0].lines})
    assert drawn == pytest.approx(sorted(keys))
    assert charts.svg_uri(figure).startswith("data:image/svg+xml")


def test_stretches_that_are_not_distinctive_are_shaded(smooth: Taught, rough: Taught) -> None:
    with charts.styled():
        shaded, plain = (distinctness_chart(one.landmarks, "t", SETTINGS) for one in (smooth, rough))
    assert len(shaded.axes[1].patches) == 1
    assert len(plain.axes[1].patches) == 0
    assert charts.svg_uri(shaded).startswith("data:image/svg+xml")


def test_what_is_not_compared_or_hardly_there_is_drawn_too(rough: Taught) -> None:
    near = dataclasses.replace(SETTINGS, window_m=20.0)
    few = landmarks_of(rough.scans[:3], {"t": rough.world.frame()}, {"t"}, SETTINGS)
    part = landmarks_of(rough.scans[:40], {"t": rough.world.frame()}, {"t"}, near)
    nothing = dataclasses.replace(few, similarity={})
    with charts.styled():
        for one in (few, part, nothing):
            for figure in (similarity_chart(one, "t"), distinctness_chart(one, "t", SETTINGS)):
                assert len(figure.axes) >= 2
                assert charts.svg_uri(figure).startswith("data:image/svg+xml")
