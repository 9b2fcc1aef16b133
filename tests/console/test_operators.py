"""Codes that count once, tries that end, a seat for one, alarms that can be managed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("pyotp", reason="the extra console is not installed")

import pyotp
from lhdmap.console.alarms import ASKS, STOPPED, WARNING, Alarms
from lhdmap.console.operators import Operators, Tries, machine_key
from lhdmap.console.sessions import SEAT_SILENT_S, Seat, Sessions
from lhdmap.console.settings import ConsoleSettings
from lhdmap.errors import InputError, UsageError

NOW_S = 1_800_000_000.0


def added(folder: Path) -> pyotp.TOTP:
    made = pyotp.parse_uri(Operators(folder).add("anna"))
    assert isinstance(made, pyotp.TOTP)
    return made


def test_a_code_counts_once_and_an_older_one_not_any_more_after_a_restart_too(tmp_path: Path) -> None:
    totp = added(tmp_path)
    one = Operators(tmp_path)
    assert one.accepts("anna", totp.at(NOW_S), NOW_S)
    assert not one.accepts("anna", totp.at(NOW_S), NOW_S)
    assert not Operators(tmp_path).accepts("anna", totp.at(NOW_S), NOW_S + 1.0)
    assert not one.accepts("anna", totp.at(NOW_S - 30.0), NOW_S)
    assert Operators(tmp_path).accepts("anna", totp.at(NOW_S + 30.0), NOW_S + 30.0)


def test_wrong_names_codes_and_times_are_refused(tmp_path: Path) -> None:
    totp = added(tmp_path)
    one, right = Operators(tmp_path), totp.at(NOW_S)
    wrong = f"{(int(right) + 1) % 10**6:06d}"
    assert not one.accepts("anna", wrong, NOW_S)
    assert not one.accepts("bert", right, NOW_S)
    assert not one.accepts("anna", right, NOW_S + 90.0)
    assert one.accepts("anna", right, NOW_S + 30.0)  # a clock may be off by a period


def test_secrets_are_their_owners_alone(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "console"
    added(folder)
    machine_key(folder, make=True)
    assert {path.stat().st_mode & 0o077 for path in folder.iterdir()} == {0}
    assert len(machine_key(folder)) == 64
    with pytest.raises(InputError, match="lhdmap console"):
        machine_key(tmp_path)


@pytest.mark.parametrize("name", ["", "anna", "a/b", "x" * 50, "<b>"])
def test_a_name_is_new_and_one(tmp_path: Path, name: str) -> None:
    added(tmp_path)
    with pytest.raises(UsageError):
        Operators(tmp_path).add(name)


def test_a_damaged_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "operators.json").write_text(json.dumps({"anna": 3}))
    with pytest.raises(InputError, match=r"operators\.json"):
        Operators(tmp_path)


def test_after_so_many_wrong_codes_none_is_looked_at_for_a_while() -> None:
    tries = Tries(ConsoleSettings())
    for k in range(5):
        assert tries.allowed(k)
        tries.wrong(k)
    assert not tries.allowed(59.9)
    assert tries.allowed(60.0)


def test_a_session_ends_by_time_and_by_hand() -> None:
    sessions = Sessions(ConsoleSettings(session_h=1.0))
    token = sessions.open("anna", 0.0)
    assert sessions.name(token, 3599.0) == "anna"
    assert sessions.name(token, 3600.0) == ""
    assert sessions.name(token + "A", 1.0) == sessions.name(None, 1.0) == ""
    sessions.close(token)
    assert sessions.name(token, 1.0) == ""


def test_one_sits_the_others_wait_until_he_leaves_or_is_long_silent() -> None:
    seat = Seat()
    assert seat.take("anna", "p1", 0.0)
    assert not seat.take("bert", "p2", SEAT_SILENT_S - 0.1)
    assert not seat.take("anna", "p3", SEAT_SILENT_S - 0.1)  # another page of hers
    assert seat.holds("anna", "p1")
    assert not seat.holds("bert", "p1")
    assert not seat.leave("p2")
    assert seat.take("bert", "p2", SEAT_SILENT_S)
    assert not seat.holds("anna", "p1")
    assert seat.leave("p2")
    assert not seat.holds("", "")


def test_alarms_are_ranked_and_counted_and_warnings_limited() -> None:
    alarms = Alarms(ConsoleSettings(alarms_most=3, alarms_window_s=60.0))
    for k in range(5):
        alarms.raises(f"w{k}", WARNING, "one", f"warning {k}", float(k))
    alarms.raises("w0", WARNING, "one", "warning 0", 5.0)
    alarms.raises("asks", ASKS, "one", "asks", 5.0)
    alarms.raises("stopped", STOPPED, "two", "stopped", 6.0)
    shown = alarms.shown(6.0)
    assert [(alarm.rank, alarm.text, alarm.times) for alarm in shown] == [
        (STOPPED, "stopped", 1), (ASKS, "asks", 1), (WARNING, "warning 2", 1), (WARNING, "warning 1", 1), (WARNING, "warning 0", 2)
    ]  # fmt: skip
    assert alarms.held_back == 2
    alarms.clear("stopped", "two")
    assert [alarm.rank for alarm in alarms.shown(62.5)] == [ASKS]
    assert alarms.held_back == 0
