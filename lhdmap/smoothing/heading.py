"""Heading over the whole drive: the scans' turn and the gyroscope's, weighed by what each is wrong by.

Scans drift with the way and in bends, a gyroscope with time: its bias is constant for minutes, its noise walks. Over blocks of
some seconds both say how far the machine has turned; their difference is

    gyro - scans = bias dt + scale turn + noise(gyro) - noise(scans)

Bias (in segments that walk) and scale are the least squares solution of all blocks: standing still teaches the bias without
anyone saying that the machine stands. Then each block's turn is the mean of both by their variances. Robust: what is beyond
Tukey's cut-off is no gyroscope's noise, and a gyroscope is not used at all where it is not like the scans over the drive.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

_BLOCK_S, _STILL_M = 4.0, 0.02
_SEGMENT_S, _MOST_SEGMENTS = 60.0, 300
_JITTER_RAD = math.radians(0.02)  # of a scan's heading, at both ends of a block: it does not add up
_WALK_RAD, _PER_TURN = math.radians(0.011), 0.001  # of scans, per root metre and per radian turned
_SCALE_STD = 0.003
_CUTOFF = 6.0
_ROUNDS = 6
_MOST_OUT, _MOST_LOUDER = 0.2, 30.0
_MOST_SPREAD, _CLEARLY = 2.5, 1.4
_DEG_PER_SQRT_H = math.radians(1.0) / 60.0  # in rad per root second
_DEG_PER_H = math.radians(1.0) / 3600.0


class GyroNoise(NamedTuple):
    """What a gyroscope is wrong by: angle random walk (rad/√s), bias (rad/s) and its walk (rad/s/√s), standard deviations."""

    walk: float
    bias: float
    bias_walk: float

    @classmethod
    def of(cls, noise_deg_sqrt_h: float, bias_deg_h: float, bias_walk_deg_h: float) -> GyroNoise:
        """Return it from the units of data sheets."""
        return cls(noise_deg_sqrt_h * _DEG_PER_SQRT_H, bias_deg_h * _DEG_PER_H, bias_walk_deg_h * _DEG_PER_H / 60.0)


class Path(NamedTuple):
    """A planar path: times (N,), poses (N, 3) with the heading unwrapped."""

    times_ns: npt.NDArray[np.int64]
    poses: FloatArray


class Heading(NamedTuple):
    """By how much the heading of each pose is to be turned (N,), rad; what of the scans' variance is left (0 to 1).

    `bias_rps`: mean of the gyroscope's, with its deviation, `walk`: its noise as found (rad/√s), `left_out`: share of blocks that
    were.
    """

    turned_rad: FloatArray
    share: FloatArray
    bias_rps: float
    bias_std_rps: float
    walk: float
    left_out: float


class _Blocks(NamedTuple):
    """Blocks between poses `ends` (K + 1,): dt (s), turns by scans and gyroscope (rad), variance of the scans' (rad²)."""

    ends: npt.NDArray[np.int64]
    dt: FloatArray
    scans: FloatArray
    gyro: FloatArray
    variance: FloatArray


def fused_heading(path: Path, turned: FloatArray, noise: GyroNoise) -> Heading | str:
    """Return how the headings change; a text where the gyroscope is not to be used says why.

    `turned` (N, 2): turn by the gyroscope up to each pose (rad), seconds of it that are not known; NaN where it says nothing.
    """
    blocks = _blocks(path, turned)
    known = np.isfinite(blocks.gyro)
    if known.sum() < 2:
        return ""
    difference = np.where(known, blocks.gyro - blocks.scans, 0.0)
    walk, usual = noise.walk, float(np.median((difference / blocks.dt)[known]))
    first = (difference - usual * blocks.dt) / np.sqrt(blocks.variance + walk**2 * blocks.dt)
    weight = _weights(
        first, known, float(1.4826 * np.median(np.abs(first[known])))
    )  # a jump would be bias and noise else
    spread = 1.0  # of the scans' deviations
    for _ in range(_ROUNDS):
        scans = spread**2 * blocks.variance
        variance = scans + walk**2 * blocks.dt
        bias, scale, bias_std = _constants(blocks, difference, weight / variance, noise)
        off = difference - bias * blocks.dt - scale * blocks.scans
        sigmas = off / np.sqrt(variance)
        louder = float(1.4826 * np.median(np.abs(sigmas[known])))
        if louder > 1.0:  # the scans' fault as far as such scans are known; beyond that it is the gyroscope
            wider = min(spread * louder, _MOST_SPREAD)
            rest = louder**2 * variance - wider**2 * blocks.variance - walk**2 * blocks.dt
            spread, walk = wider, math.sqrt(walk**2 + max(float(np.median((rest / blocks.dt)[known])), 0.0))
        weight = _weights(sigmas, known, louder)
    left_out = float(1.0 - (weight[known] > 0.0).mean())
    if left_out > _MOST_OUT or walk > _MOST_LOUDER * noise.walk:
        return f"gyroscope: it is not like the scans over {100.0 * left_out:.0f} % of the drive; heading is the scans' alone"
    believed = np.where(weight > 0.0, scans / (scans + walk**2 * blocks.dt), 0.0)
    turns = np.concatenate([[0.0], np.cumsum(believed * off)])
    share = 1.0 - believed
    t = (path.times_ns - path.times_ns[0]) * 1e-9
    at = t[blocks.ends]
    inside = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(share) - 1)
    return Heading(np.interp(t, at, turns), share[inside], float(bias.mean()), bias_std, walk, left_out)


def _weights(sigmas: FloatArray, known: npt.NDArray[np.bool_], spread: float) -> FloatArray:
    """Return Tukey's weights of blocks that are so many deviations off; `spread`: what they usually are."""
    weights: FloatArray = known * np.maximum(1.0 - (sigmas / (_CUTOFF * max(spread, 1.0))) ** 2, 0.0) ** 2
    return weights


def _blocks(path: Path, turned: FloatArray) -> _Blocks:
    """Return the drive in blocks of some seconds; the gyroscope's turn is NaN where part of it is not known."""
    t = (path.times_ns - path.times_ns[0]) * 1e-9
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path.poses[:, :2], axis=0).T))])
    ends = _ends(t, way_m)
    curve = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path.poses[:, 2])))])
    scans = np.diff(path.poses[ends, 2])
    gyro, unknown_s = np.diff(turned[ends, 0]), np.diff(turned[ends, 1])
    variance = _JITTER_RAD**2 + _WALK_RAD**2 * np.diff(way_m[ends]) + (_PER_TURN * np.diff(curve[ends])) ** 2
    return _Blocks(ends, np.diff(t[ends]), scans, np.where(unknown_s == 0.0, gyro, np.nan), variance)


def _ends(t: FloatArray, way_m: FloatArray) -> npt.NDArray[np.int64]:
    """Return the rows between blocks: each some seconds, and one for all the time that the machine stands.

    The scans' jitter then counts once for a rest, and the bias is as well known as the rest is long.
    """
    ends = np.unique(np.append(np.searchsorted(t, np.arange(0.0, t[-1], _BLOCK_S)), len(t) - 1))
    still = np.diff(way_m[ends]) < _STILL_M
    inner = np.zeros(len(ends), dtype=bool)
    inner[1:-1] = still[1:] & still[:-1]
    return ends[~inner]


def _constants(
    blocks: _Blocks, difference: FloatArray, information: FloatArray, noise: GyroNoise
) -> tuple[FloatArray, float, float]:
    """Return the bias of each block (K,), rad/s, the error of the scale, and the deviation of the mean bias, by least squares."""
    at = np.cumsum(blocks.dt) - 0.5 * blocks.dt
    length_s = max(_SEGMENT_S, float(at[-1]) / _MOST_SEGMENTS)
    segment = (at / length_s).astype(np.int64)
    size = int(segment[-1]) + 2
    H, g = np.zeros((size, size)), np.zeros(size)
    np.add.at(H, (segment, segment), information * blocks.dt**2)
    H[:-1, -1] = np.bincount(segment, information * blocks.dt * blocks.scans)
    np.add.at(g, segment, information * blocks.dt * difference)
    H[-1, :-1] = H[:-1, -1]
    H[-1, -1] = float((information * blocks.scans**2).sum()) + 1.0 / _SCALE_STD**2
    g[-1] = float((information * blocks.scans * difference).sum())
    tie = 1.0 / max(noise.bias_walk**2 * length_s, 1e-24)
    for k in range(size - 2):
        H[k : k + 2, k : k + 2] += tie * np.array([[1.0, -1.0], [-1.0, 1.0]])
    mean = np.append(np.bincount(segment, blocks.dt) / blocks.dt.sum(), 0.0)
    # A bias that the scans clearly see to be larger than it should be is no reason to believe the scans less.
    free = np.linalg.inv(H + np.diag(1e-9 * np.diag(H)))
    seen2 = float(mean @ free @ g) ** 2 - _CLEARLY**2 * float(mean @ free @ mean)
    H[0, 0] += 1.0 / max(noise.bias**2, seen2, 1e-18)
    P = np.linalg.inv(H)
    found = P @ g
    return found[segment], float(found[-1]), math.sqrt(float(mean @ P @ mean))


def moves_of(path: Path, turned_rad: FloatArray) -> FloatArray:
    """Return what moves each pose (N, 3), `pose_map_odom`, where the heading turns by `turned_rad` (N,) more: the path follows."""
    middle = 0.5 * (turned_rad[1:] + turned_rad[:-1])
    dx, dy = np.diff(path.poses[:, 0]), np.diff(path.poses[:, 1])
    c, s = np.cos(middle), np.sin(middle)
    x = path.poses[0, 0] + np.concatenate([[0.0], np.cumsum(c * dx - s * dy)])
    y = path.poses[0, 1] + np.concatenate([[0.0], np.cumsum(s * dx + c * dy)])
    c, s = np.cos(turned_rad), np.sin(turned_rad)
    x -= c * path.poses[:, 0] - s * path.poses[:, 1]
    y -= s * path.poses[:, 0] + c * path.poses[:, 1]
    return np.column_stack([x, y, turned_rad])
