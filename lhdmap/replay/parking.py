"""Where the machines of a mission are parked: `parks_of(scenario, network)`."""

from __future__ import annotations

from lhdmap.errors import UsageError
from lhdmap.mine.network import Network
from lhdmap.replay.scenario import Scenario


def parks_of(scenario: Scenario, network: Network) -> list[str]:
    """Return where each machine stands at first: the first one where the scenario says, the others at the other parks in order.

    Raises:
        UsageError: there are too few.
    """
    known = [place.name for place in network.plan.places if place.kind == "park"]
    first = scenario.start if scenario.start in known or not known else known[0]
    parks = [first, *(name for name in known if name != first)]
    if len(parks) < scenario.machines or not known:
        raise UsageError(
            f"machines = {scenario.machines}: each needs a place to park, mine '{network.plan.name}' has {len(known)}"
            f"{': ' + ', '.join(known) if known else ''}"
        )
    return parks[: scenario.machines]
