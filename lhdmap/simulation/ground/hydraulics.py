"""Engine, hydrostatic transmission and cylinders of the digging machine, one sub-step at a time."""

from __future__ import annotations

import math

import numba as nb

from lhdmap.simulation.ground.records import Record

_PA = 1e5


@nb.njit(cache=True, nogil=True)
def engine(state: Record, rig: Record, propel: float, full_rpm: bool, step_s: float) -> None:
    """Move engine speed and the pump's stroke on; both are shares of their largest."""
    wanted = 1.0 if full_rpm else rig.idle + (1.0 - rig.idle) * abs(propel)
    state.engine += (wanted - state.engine) * -math.expm1(-step_s / rig.engine_lag_s)
    state.stroke += (propel - state.stroke) * -math.expm1(-step_s / rig.pump_lag_s)


@nb.njit(cache=True, nogil=True)
def transmission(state: Record, rig: Record, step_s: float) -> float:
    """Move the pressure on and return the drive's force at the tyres, N.

    ṗ = K (Q - D w/r - C p), the pump's flow Q within the engine's power; the relief valve's pressure falls with the
    engine's speed. Implicit in the leakage, the pressure is the state that breaks the loop of power and flow.
    """
    per_m = rig.displacement_m3 / rig.wheel_radius_m
    flow = rig.gear_mps * state.stroke * state.engine * per_m
    most = rig.power_w * state.engine / max(abs(state.pressure_pa), 1e5)
    flow = min(max(flow, -most), most)
    change = rig.bulk_pa * step_s * (flow - per_m * state.wheel_mps)
    pressure = (state.pressure_pa + change) / (1.0 + rig.bulk_pa * step_s * rig.leakage_m3)
    relief = rig.relief_pa * (0.55 + 0.45 * state.engine)
    state.pressure_pa = min(max(pressure, -relief), relief)
    return per_m * state.pressure_pa


@nb.njit(cache=True, nogil=True)
def cylinders(state: Record, rig: Record, tilt: float, lift: float, step_s: float) -> None:
    """Move boom and bucket: the speeds fall with the fourth power of the share of the largest force that is met."""
    revved = max(state.engine - rig.idle, 0.0) / max(1.0 - rig.idle, 1e-6)
    share = (rig.idle_share + (1.0 - rig.idle_share) * revved) * (rig.shared if tilt != 0.0 and lift != 0.0 else 1.0)
    gone = -math.expm1(-step_s / rig.linkage_lag_s)
    tilting, lifting = _meets(state.tilting, tilt), _meets(state.lifting, lift)
    wanted = rig.tilt_rps * share * tilt * max(1.0 - tilting**4, 0.0)
    state.bucket_rps += (wanted - state.bucket_rps) * gone
    wanted = rig.lift_rps * share * lift * max(1.0 - lifting**4, 0.0)
    state.boom_rps += (wanted - state.boom_rps) * gone
    state.bucket_rad += state.bucket_rps * step_s
    state.boom_rad += state.boom_rps * step_s
    pressed = False
    if state.bucket_rad >= rig.bucket_max_rad or state.bucket_rad <= rig.bucket_min_rad:
        state.bucket_rad = min(max(state.bucket_rad, rig.bucket_min_rad), rig.bucket_max_rad)
        state.bucket_rps = 0.0
        pressed = tilt > 0.0 if state.bucket_rad >= rig.bucket_max_rad else tilt < 0.0
    state.at_stop += ((abs(tilt) if pressed else 0.0) - state.at_stop) * gone
    if state.boom_rad >= rig.boom_max_rad or state.boom_rad <= rig.boom_min_rad:
        state.boom_rad = min(max(state.boom_rad, rig.boom_min_rad), rig.boom_max_rad)
        state.boom_rps = 0.0


@nb.njit(cache=True, nogil=True)
def _meets(share: float, command: float) -> float:
    """Return the share of a cylinder's force that works against a command; `share` is positive against lifting."""
    return min(max(share if command > 0.0 else -share, 0.0), 1.0)
