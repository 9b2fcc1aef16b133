"""The pile along the machine's heading: heights over the floor in cells, dug by the lip, sliding where they are too steep."""

from __future__ import annotations

import math

import numba as nb

from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.linkage import floor_angle
from lhdmap.simulation.ground.records import Record

BUCKET_LENGTH_M = 1.4  # over which the content spreads
_PUSHED = 6  # cells ahead of the lip that get what is pushed on
_REACH = 100  # cells ahead of the lip that slide while it is in the pile
_DUMPED_RAD = -0.65  # floor angle at which nothing stays in the bucket
_ROUNDED_RAD = 0.5  # floor angle from which on the whole heap stays


@nb.njit(cache=True, nogil=True)
def capacity(rock: Record, rig: Record, psi_rad: float) -> float:
    """Return what the bucket holds at a floor angle, m³: the heap when racked, a share of it level, nothing when dumped."""
    heap = rock.heap * rig.nominal_m3
    if psi_rad >= 0.0:
        return heap * (rock.level_share + (1.0 - rock.level_share) * min(psi_rad / _ROUNDED_RAD, 1.0))
    return heap * rock.level_share * max(1.0 - psi_rad / _DUMPED_RAD, 0.0)


@nb.njit(cache=True, nogil=True)
def height_at(heights: FloatArray, rock: Record, x_m: float) -> float:
    """Return the pile's height at x, linear between the middles of cells; before the first cell there is none."""
    place = (x_m - rock.origin_m) / rock.step_m
    i = math.floor(place)
    if i < 0:
        return 0.0
    if i + 1 >= len(heights):
        return heights[-1]
    return heights[i] + (place - i) * (heights[i + 1] - heights[i])


@nb.njit(cache=True, nogil=True)
def take(state: Record, rig: Record, rock: Record, volume_m2: float) -> float:
    """Put a volume (in place, per metre of width) into the bucket and return what has no room."""
    room = capacity(rock, rig, floor_angle(rig, state.boom_rad, state.bucket_rad))
    full = min(state.content_m3 / max(room, 1e-3), 1.0)
    taken = volume_m2 * rock.entering * (1.0 - full**4)
    state.content_m3 += taken * rock.swell * rig.width_m
    return volume_m2 - taken


@nb.njit(cache=True, nogil=True)
def put_ahead(heights: FloatArray, cell: int, rock: Record, volume_m2: float) -> None:
    """Spread a volume over the cells ahead of one."""
    first = min(max(cell, 0), len(heights) - _PUSHED)
    for k in range(first, first + _PUSHED):
        heights[k] += volume_m2 / (_PUSHED * rock.step_m)


@nb.njit(cache=True, nogil=True)
def cut(state: Record, rig: Record, rock: Record, heights: FloatArray, before_m: float, now_m: float) -> None:
    """Let the lip pass the cells between two places: what is over it goes into the bucket or is pushed on."""
    first = math.floor((before_m - rock.origin_m) / rock.step_m + 0.5) + 1
    last = math.floor((now_m - rock.origin_m) / rock.step_m + 0.5)
    level = max(state.lip_z_m, 0.0)
    for k in range(max(first, 0), min(last, len(heights) - 1) + 1):
        over = heights[k] - level
        if over > 0.0:
            heights[k], state.busy = level, 1.0
            put_ahead(heights, k + 1, rock, take(state, rig, rock, over * rock.step_m))


@nb.njit(cache=True, nogil=True)
def slide(state: Record, rig: Record, rock: Record, heights: FloatArray, share: float, in_pile: bool) -> float:
    """Let what stands steeper than the face's slope slide by a share of its excess; returns the largest excess, m.

    At the lip the bucket's content holds the face up; what slides over that goes into the bucket.
    """
    drop, worst = rock.slope * rock.step_m, 0.0
    tip = math.floor((state.lip_x_m - rock.origin_m) / rock.step_m + 0.5) if in_pile else -1
    last = len(heights) - 1 if tip < 0 else min(tip + _REACH, len(heights) - 1)
    for k in range(max(tip, 0), last):
        if k == tip:
            level = max(state.lip_z_m, 0.0) + state.content_m3 / (rig.width_m * BUCKET_LENGTH_M)
            excess = heights[k + 1] - level - drop
            if excess > 0.0:
                moved = 0.5 * excess * share * rock.step_m
                left = take(state, rig, rock, moved)
                heights[k + 1] -= (moved - left) / rock.step_m
            continue
        excess = heights[k + 1] - heights[k] - drop
        if excess > 0.0:
            heights[k + 1] -= 0.5 * share * excess
            heights[k] += 0.5 * share * excess
            worst = max(worst, excess)
        elif heights[k] - heights[k + 1] - drop > 0.0:
            excess = heights[k] - heights[k + 1] - drop
            heights[k] -= 0.5 * share * excess
            heights[k + 1] += 0.5 * share * excess
            worst = max(worst, excess)
    return worst


@nb.njit(cache=True, nogil=True)
def spill(state: Record, rig: Record, rock: Record, heights: FloatArray, step_s: float) -> None:
    """Let what the bucket does not hold fall on the floor below its lip."""
    room = capacity(rock, rig, floor_angle(rig, state.boom_rad, state.bucket_rad))
    over = state.content_m3 - room
    if over <= 0.0:
        return
    lost = over * min(step_s / 0.3, 1.0)
    state.content_m3 -= lost
    state.busy = 1.0
    state.spilled_m3 += lost
    cell = math.floor((state.lip_x_m - rock.origin_m) / rock.step_m + 0.5)
    put_ahead(heights, cell, rock, lost / (rock.swell * rig.width_m))


@nb.njit(cache=True, nogil=True)
def settle(state: Record, rig: Record, rock: Record, heights: FloatArray) -> None:
    """Let the face slide until it stands, with no bucket in it."""
    for _ in range(4000):
        if slide(state, rig, rock, heights, 1.0, in_pile=False) < 1e-3:
            break


@nb.njit(cache=True, nogil=True)
def take_boulder(state: Record, rig: Record, rock: Record, heights: FloatArray, volume_m3: float) -> None:
    """Put a boulder of the pile into the bucket: its volume comes off the face above the lip."""
    area = volume_m3 / (rock.swell * rig.width_m)
    left = area
    first = max(math.floor((state.lip_x_m + 0.3 - rock.origin_m) / rock.step_m + 0.5), 0)
    for k in range(first, len(heights)):
        taken = min(left / rock.step_m, 0.5 * heights[k])
        heights[k] -= taken
        left -= taken * rock.step_m
        if left <= 0.0:
            break
    state.content_m3 += (area - left) * rock.swell * rig.width_m
