"""Each setting changes what a user gets: one that does not is a promise that nobody keeps, and has to go."""

from __future__ import annotations

import functools

import pytest
from lhdmap.config import Settings, setting_names, settings_from

from tests.settings.cases import case_of
from tests.settings.probes import PROBES


@functools.cache
def found(probe: str, chosen: tuple[tuple[str, object], ...]) -> str:
    """Return the digest of a probe with these settings over the defaults."""
    return PROBES[probe](settings_from(dict(chosen)))


@pytest.mark.parametrize("name", setting_names())
def test_a_changed_setting_changes_an_output(name: str) -> None:
    case = case_of(name)
    base = dict(case.base)
    assert found(case.probe, tuple(base.items())) != PROBES[case.probe](settings_from(base | {name: case.value}))


@pytest.mark.parametrize("probe", PROBES)
def test_the_same_settings_give_the_same_output(probe: str) -> None:
    """What differs by chance would let every setting pass."""
    assert found(probe, ()) == PROBES[probe](Settings())
