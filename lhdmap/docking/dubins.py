"""Dubins' shortest ways: closed forms of the six words, in units of the radius (Dubins 1957; Shkel and Lumelsky 2001)."""

from __future__ import annotations

import math
from typing import NamedTuple


class Word(NamedTuple):
    """Turns (1 left, 0 straight, -1 right) and their lengths (m), in the order of the way."""

    turns: tuple[int, int, int]
    lengths_m: tuple[float, float, float]

    @property
    def length_m(self) -> float:
        """Length of the way."""
        return sum(self.lengths_m)


def words(start: tuple[float, float, float], goal: tuple[float, float, float], radius_m: float) -> list[Word]:
    """Return the words from a pose (x, y, course) to another that exist, shortest first."""
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    d, bearing = math.hypot(dx, dy) / radius_m, math.atan2(dy, dx)
    a, b = _turn(start[2] - bearing), _turn(goal[2] - bearing)
    sa, sb, ca, cb, cab = math.sin(a), math.sin(b), math.cos(a), math.cos(b), math.cos(a - b)
    found = []
    for first, last in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        if first == last:
            square = 2.0 + d * d - 2.0 * cab + first * 2.0 * d * (sa - sb)
            straight = math.sqrt(max(square, 0.0))
            across = (
                math.atan2(first * (cb - ca), d + first * (sa - sb)) if straight > 1e-6 else b
            )  # one circle: one turn
            parts = (_turn(first * (across - a)), straight, _turn(last * (b - across)))
        else:
            square = d * d - 2.0 + 2.0 * cab + first * 2.0 * d * (sa + sb)
            if square < 0.0:
                continue
            straight = math.sqrt(square)
            side = math.atan2(-first * (ca + cb), d + first * (sa + sb)) - math.atan2(-2.0 * first, straight)
            parts = (_turn(first * (side - a)), straight, _turn(first * (side - b)))
        found.append(Word((first, 0, last), _scaled(parts, radius_m)))
    for first in (1, -1):
        cosine = (6.0 - d * d + 2.0 * cab + first * 2.0 * d * (sb - sa)) / 8.0
        if abs(cosine) > 1.0:
            continue
        middle = 2.0 * math.pi - math.acos(cosine)
        if first < 0:
            start_turn = _turn(a - math.atan2(ca - cb, d - sa + sb) + 0.5 * middle)
        else:
            start_turn = _turn(-a - math.atan2(ca - cb, d + sa - sb) + 0.5 * middle)
        end_turn = _turn(first * (b - a) - start_turn + middle)
        found.append(Word((first, -first, first), _scaled((start_turn, middle, end_turn), radius_m)))
    return sorted(found, key=lambda word: word.length_m)


def end_of(start: tuple[float, float, float], word: Word, radius_m: float) -> tuple[float, float, float]:
    """Return the pose at the end of a word."""
    x, y, course = start
    for turn, length in zip(word.turns, word.lengths_m, strict=True):
        if turn == 0:
            x, y = x + length * math.cos(course), y + length * math.sin(course)
            continue
        after = course + turn * length / radius_m
        x += turn * radius_m * (math.sin(after) - math.sin(course))
        y -= turn * radius_m * (math.cos(after) - math.cos(course))
        course = after
    return x, y, course


def _scaled(parts: tuple[float, float, float], radius_m: float) -> tuple[float, float, float]:
    return parts[0] * radius_m, parts[1] * radius_m, parts[2] * radius_m


def _turn(angle: float) -> float:
    """Return an angle in [0, 2π); what is short of a whole turn by rounding alone is none."""
    turned = angle % (2.0 * math.pi)
    return 0.0 if turned > 2.0 * math.pi - 1e-7 else turned
