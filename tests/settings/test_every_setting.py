"""Each setting changes what a user gets: one that does not is a promise that nobody keeps, and has to go."""

from __future__ import annotations

import functools
import itertools

import pytest
from lhdmap.config import Settings, setting_names, settings_from

from tests.settings.cases import case_of
from tests.settings.probes import PROBES, digest


@functools.cache
def found(probe: str, chosen: tuple[tuple[str, object], ...]) -> list[str]:
    """Return the digests of a probe's parts with these settings over the defaults."""
    return [digest(part) for part in PROBES[probe](settings_from(dict(chosen)))]


def same(probe: str, chosen: tuple[tuple[str, object], ...], settings: Settings) -> bool:
    """Return whether a probe gives the same with other settings; it runs until it differs."""
    known, parts = found(probe, chosen), PROBES[probe](settings)
    return all(digest(part) == then for part, then in itertools.zip_longest(parts, known))


@pytest.mark.parametrize("name", setting_names())
def test_a_changed_setting_changes_an_output(name: str) -> None:
    case = case_of(name)
    base = dict(case.base)
    assert not same(case.probe, tuple(base.items()), settings_from(base | {name: case.value}))


@pytest.mark.parametrize("probe", PROBES)
def test_the_same_settings_give_the_same_output(probe: str) -> None:
    """What differs by chance would let every setting pass."""
    assert same(probe, (), Settings())
