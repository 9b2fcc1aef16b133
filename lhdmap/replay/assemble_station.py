"""Who is at the station of a replay: the script, or whoever attends the machine."""

from __future__ import annotations

from lhdmap.errors import UsageError
from lhdmap.replay.namespace import Scribes
from lhdmap.replay.parts import Parts
from lhdmap.replay.process import Process
from lhdmap.replay.processes.attended import Attended
from lhdmap.replay.processes.shown import Shown, plan_of
from lhdmap.replay.processes.station import Station
from lhdmap.replay.scenario import AUTONOMOUS, GRIZZLY, HAULAGE, Scenario


def check_attended(scenario: Scenario) -> None:
    """Raise UsageError where a scenario has nobody who asks, or is armed."""
    if scenario.kind in (GRIZZLY, HAULAGE) or scenario.who != AUTONOMOUS:
        who = f"driver = '{scenario.who}'" if scenario.kind == "tram" else f"kind = '{scenario.kind}'"
        raise UsageError(f"{who}: an operator at a console or terminal was wanted, and nobody asks or is armed here")


def station_of(scenario: Scenario, parts: Parts, journal: Scribes, assists: int = 5) -> Process:
    """Return the scripted operator at the station, or the machine's end of the link to its attendant."""
    scribe = journal.of(Station.name)
    if parts.attendant is None:
        return Station(scenario.wanted_modes, scenario.rearm_s, scenario.assist_s, scribe, assists)
    parts.attendant.shows(plan_of(parts))
    attended = Attended(parts.attendant, scenario.wanted_modes, Shown(on_map=parts.autonomous is not None), scribe)
    journal.listen(attended.heard)
    return attended
