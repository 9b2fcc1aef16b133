"""What is said of a pile: the estimate, and the form of `pile.json`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

STATUSES = ("loadable", "too_shallow", "wall", "hang_up", "none")
FRAME = "map"


class Boulder(NamedTuple):
    """An oversized rock: centre (3,), metres, frame of the estimate; its largest extent (m)."""

    center_m: FloatArray
    size_m: float


class AttackPoint(NamedTuple):
    """Where to drive into the pile: point on the toe (3,), metres, and heading (rad) in the frame of the estimate."""

    point_m: FloatArray
    heading_rad: float


@dataclass(frozen=True, slots=True)
class PileEstimate:
    """One estimate of the pile; lengths in metres in the frame `map`.

    `status`: None where it was not looked for or cannot be said; `reason` says why, and there are no `probabilities` then.
    `probabilities`: of each status, they add up to 1. `inclination_deg` has the sign of Table 6: 0 is floor, -50 a pile, -90 a
    wall, beyond an overhang; `heights_m`: lowest and highest of the heights over the floor at the toe that it was fitted to.
    `left_limit_m`, `right_limit_m` (3,): E_L and E_R at the toe. `toe_m` (K, 3): the toe from left to right. `face_m` (N, 3):
    points of the face; `residuals_m` (N,): how far they stand out of the fitted face towards the machine. What is not known is
    NaN.
    """

    status: str | None = "none"
    probabilities: dict[str, float] = field(default_factory=lambda: {"none": 1.0})
    center_m: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    left_limit_m: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    right_limit_m: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    width_m: float = math.nan
    width_std_m: float = math.nan
    inclination_deg: float = math.nan
    inclination_std_deg: float = math.nan
    heights_m: tuple[float, float] = (math.nan, math.nan)
    volume_m3: float = math.nan
    volume_std_m3: float = math.nan
    boulders: tuple[Boulder, ...] = ()
    attack: AttackPoint | None = None
    toe_m: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    face_m: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    residuals_m: FloatArray = field(default_factory=lambda: np.zeros(0))
    warnings: tuple[str, ...] = ()
    reason: str = ""

    @classmethod
    def unknown(cls, reason: str, warnings: tuple[str, ...] = ()) -> PileEstimate:
        """Return an estimate without status and measures, because `reason`."""
        return cls(status=None, probabilities={}, reason=reason, warnings=warnings)

    @property
    def found(self) -> bool:
        """Whether a face was found and measured."""
        return math.isfinite(self.inclination_deg) and math.isfinite(self.width_m)


class Snapshot(NamedTuple):
    """An estimate at a moment of the drive; `distance_m` from `base_link` to the nearest point of the toe (NaN: unknown)."""

    stamp_ns: int
    distance_m: float
    estimate: PileEstimate


class PileApproach(NamedTuple):
    """What was decided of one pile, and the last estimate of it."""

    decision: Snapshot
    last: Snapshot


@dataclass(frozen=True, slots=True)
class PileReport:
    """Outcome of a drive: the decision (None: not identified), the last estimate, and how it came about.

    `reason`: why no pile was looked for (empty: it was); status and probabilities are then null.
    `around_m` (N, 3): hits around the pile in the map, thinned, for pictures; `warnings`: what is to be said of the log.
    `piles`: all that was decided on the drive, this one too, in the order of time: the decision and the last estimate of each.
    """

    decision: Snapshot | None
    last: Snapshot | None
    history: tuple[Snapshot, ...] = ()
    method: str = "surface"
    around_m: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    warnings: tuple[str, ...] = ()
    piles: tuple[PileApproach, ...] = ()
    reason: str = ""

    @property
    def estimate(self) -> PileEstimate:
        """What is said of the pile: the last estimate, without measures where it is none; unknown where none was looked for."""
        if self.last is not None:
            return _of_a_pile(self.last.estimate)
        return PileEstimate.unknown(self.reason) if self.reason else PileEstimate()

    def middles_m(self) -> list[FloatArray]:
        """Return the middles (3,) of all piles that were decided on the drive; a bare wall is none."""
        estimates = [self.estimate, *(one.last.estimate for one in self.piles)]
        middles = [one.center_m for one in estimates if one.status not in (None, "none", "wall")]
        return [middle for middle in middles if np.isfinite(middle).all()]

    def to_json(self) -> dict[str, Any]:
        """Return the content of `pile.json`: the last estimate, and when and how far away it was decided.

        A warning is said once, at the top.
        """
        best = self.estimate
        table = estimate_json(best)
        table["warnings"] = list(dict.fromkeys([*self.warnings, *best.warnings]))
        table["method"] = self.method
        table["identified"] = self.decision is not None
        table["decided_at_ns"] = self.decision.stamp_ns if self.decision else None
        table["distance_at_decision_m"] = _number(self.decision.distance_m) if self.decision else None
        table["decision"] = estimate_json(self.decision.estimate) if self.decision else None
        table["piles"] = [_approach_json(one) for one in self.piles]
        for part in (table["decision"], *table["piles"]):
            if part is not None:
                part["warnings"] = [text for text in part["warnings"] if text not in table["warnings"]]
        return table


def _approach_json(pile: PileApproach) -> dict[str, Any]:
    """Return what was decided in one approach as JSON values: the last estimate, and when and how far away it was decided."""
    return {
        **estimate_json(_of_a_pile(pile.last.estimate)),
        "decided_at_ns": pile.decision.stamp_ns,
        "distance_at_decision_m": _number(pile.decision.distance_m),
    }


def _of_a_pile(estimate: PileEstimate) -> PileEstimate:
    """Return the estimate, or only status, probabilities and warnings where what was measured does not close the drift."""
    if estimate.status != "none":  # an unknown one has no measures
        return estimate
    return PileEstimate(probabilities=estimate.probabilities, warnings=estimate.warnings)


def estimate_json(estimate: PileEstimate) -> dict[str, Any]:
    """Return an estimate as JSON values; null where something is not known."""
    attack = estimate.attack
    return {
        "status": estimate.status,
        "reason": estimate.reason or None,
        "probabilities": _shares(estimate),
        "center_m": _vector(estimate.center_m),
        "left_limit_m": _vector(estimate.left_limit_m),
        "right_limit_m": _vector(estimate.right_limit_m),
        "width_m": _number(estimate.width_m),
        "width_std_m": _number(estimate.width_std_m),
        "inclination_deg": _number(estimate.inclination_deg),
        "inclination_std_deg": _number(estimate.inclination_std_deg),
        "inclination_heights_m": _vector(np.array(estimate.heights_m)),
        "volume_m3": _number(estimate.volume_m3),
        "volume_std_m3": _number(estimate.volume_std_m3),
        "frame": FRAME,
        "points": len(estimate.face_m),
        "boulders": [{"center_m": _vector(one.center_m), "size_m": _number(one.size_m)} for one in estimate.boulders],
        "attack_point_m": None if attack is None else _vector(attack.point_m),
        "attack_heading_rad": None if attack is None else _number(attack.heading_rad),
        "warnings": list(estimate.warnings),
    }


def _shares(estimate: PileEstimate) -> dict[str, float] | None:
    if estimate.status is None:
        return None
    return {name: float(estimate.probabilities.get(name, 0.0)) for name in STATUSES}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _vector(values: FloatArray) -> list[float] | None:
    return [float(value) for value in values] if np.isfinite(values).all() else None
