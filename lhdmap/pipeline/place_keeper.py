"""Keeps the place of a `Localizer`: judged by the walls, checked by searches, taken up again near by, or found anew.

unknown --a search finds--> candidate --a second one agrees--> tracking
           candidate --denied--> unknown, or lost where a place was known before
           tracking --the walls do not agree, or two checks deny--> lost --near by, or a search--> tracking, candidate
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from lhdmap.geometry import se2
from lhdmap.localization.changes import WorldChanges
from lhdmap.localization.finder import Finder
from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING
from lhdmap.localization.search import CHECK, CONFIRM, FIND, PlaceCandidate, Search
from lhdmap.messages import FloatArray
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.look_carried import CarriedLook, CarriedRules
from lhdmap.pipeline.look_near import NearLook
from lhdmap.pipeline.place_held import HeldPlace
from lhdmap.pipeline.tracks_on_map import TracksOnMap
from lhdmap.pipeline.way_driven import WayDriven

_LEAST_KNOWN = 0.3  # of the hits are in room that the map knows, or what it does not know counts against the place
_DENIALS = 2  # checks in a row
# Deviations (m, m, rad) of a place that a search, or a look near by, has found.
_SEARCHED_STD = np.array([0.1, 0.1, math.radians(1.0)])
_FOUND_NEAR_STD = np.array([0.15, 0.15, math.radians(1.0)])


class PlaceKeeper:
    """`judge`, `look_near` and `look_around` after each match: they change the `place`.

    `digs`: what is seen is known to differ from the map then, and a place is not given up for that.
    """

    def __init__(
        self,
        place: HeldPlace,
        on_map: TracksOnMap,
        finder: Finder,
        world: WorldChanges,
        way: WayDriven,
        confirm_m: float,
    ) -> None:
        self._place, self._on_map, self._finder, self._world, self._way = place, on_map, finder, world, way
        self._confirm_m = confirm_m
        self._near, self._carried = NearLook(on_map.walls), CarriedLook(on_map.walls)
        self._denials = 0
        self.digs = False

    def judge(self) -> None:
        """Decide by the support whether the place still holds."""
        place = self._place
        if place.tracker is None or place.status == LOST or place.support.newest is None or self.digs:
            return
        wanted = self._on_map.wanted_support(place.tracker)
        mean = place.support.falls_short(wanted)
        if mean is not None:
            self._drop(f"the map's walls agree with {mean:.0%} of the hits, {wanted:.0%} were wanted")

    def support_told(self, support: float, pose: FloatArray, height_m: float, points: FloatArray) -> float:
        """Return a support as the share of those hits (N, 2) at a pose (3,) the map can tell of: doors stand open elsewhere."""
        known = 1.0 - self._world.unknown_share(pose, height_m, points)
        return min(support / known, 1.0) if known >= _LEAST_KNOWN else support

    def look_near(self, points: FloatArray) -> None:
        """Take a lost place up again near where the odometry has carried it, by hits (N, 2)."""
        place, tracker, way = self._place, self._place.tracker, self._way
        if place.status != LOST or tracker is None:
            return
        wanted = partial(self._on_map.wanted_support, tracker)
        found = self._near.look(way.stamp_ns, way.travelled_m, tracker, points, wanted)
        if found is None:
            told = partial(self.support_told, height_m=tracker.height_m, points=points)
            found = self._carried.look(way.travelled_m, tracker, points, CarriedRules(wanted, told))
        if found is not None:
            place.hold(self._on_map.at(found, _FOUND_NEAR_STD, tracker.height_m), TRACKING)

    def look_around(self, step: OdometryStep) -> None:
        """Take over what a search has said, and begin the next one that is due."""
        place, way = self._place, self._way
        said = self._finder.answer(way.stamp_ns, step.pose_odom_base)
        if said is not None and said.purpose == self._purpose:
            self._take_over(said)
        if place.trial_m is not None and way.travelled_m - place.trial_m < self._confirm_m:
            return
        tracker = None if self._purpose == FIND else place.tracker
        claimed = None if tracker is None else np.append(tracker.pose, tracker.height_m)
        came = None
        if place.status == TRACKING and tracker is not None:
            pose_map_odom = se2.compose(tracker.pose, se2.inverse(step.pose_odom_base))
            came = partial(self._world.stands_in, pose_map_odom, tracker.height_m)
        self._finder.ask(self._purpose, way.stamp_ns, way.travelled_m, step.pose_odom_base, claimed, came)

    @property
    def _purpose(self) -> str:
        return {TRACKING: CHECK, CANDIDATE: CONFIRM}.get(self._place.status, FIND)

    def _take_over(self, said: Search) -> None:
        """Try the place that was found, keep or drop the one on trial, drop the tracked one that is contradicted."""
        place = self._place
        if said.claimed is not None:
            place.probability = said.claimed.probability
        if said.purpose == FIND and not said.refused:
            self._try(said.candidates[0])
        elif said.purpose == FIND:
            place.facts.withheld += bool(said.candidates)
        elif said.purpose == CONFIRM and said.confirms:
            place.status, place.trial_m = TRACKING, None
        elif said.purpose == CONFIRM or (self._denied_again(said) and not self.digs):
            self._drop(said.denied or said.refused or "a search finds another place")

    def _denied_again(self, said: Search) -> bool:
        """Return whether two checks in a row say that the machine is not where it is tracked: one may be of a bend or a niche.

        That another place fits counts always; that this one does not, where the walls are smooth: in others their support tells.
        """
        tells = not said.refused or self._place.support.barely_held
        self._denials = self._denials + 1 if said.denied and tells else 0
        return self._denials >= _DENIALS

    def _drop(self, why: str) -> None:
        """Give the place up, and search from now on."""
        self._denials = 0
        self._finder.again()
        if self._place.give_up(self._way.stamp_ns, why):
            self._near.lost(self._way.stamp_ns, self._way.travelled_m)
            self._carried.lost(self._way.travelled_m)
            self._finder.forget()

    def _try(self, found: PlaceCandidate) -> None:
        """Put a place that a search has found on trial; one where the odometry has led to from the last place needs none."""
        place, travelled_m = self._place, self._way.travelled_m
        height_m = self._on_map.height_m(found.pose, found.height_m)
        as_carried = False
        if place.tracker is not None:
            self._world.found(travelled_m, place.tracker.pose, found.pose)
            as_carried = place.status == LOST and self._carried.leads_to(travelled_m, place.tracker.pose, found.pose)
        place.hold(self._on_map.at(found.pose, _SEARCHED_STD, height_m), TRACKING if as_carried else CANDIDATE)
        place.trial_m, place.probability = None if as_carried else travelled_m, found.probability
