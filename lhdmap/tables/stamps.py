"""Stamps as they are written: decimal numbers in a unit that a header names, or that their size gives away."""

from __future__ import annotations

import decimal

import numpy as np

from lhdmap.messages import FloatArray

NS_PER_S = 1_000_000_000
_LARGEST_NS = 2**63 - 1
_UNIT_NAMES = {1: "nanoseconds", 1_000: "microseconds", 1_000_000: "milliseconds", NS_PER_S: "seconds"}
_EPOCH_S = (9e8, 5e9)  # 1998 to 2128
_LONGEST_STEP_S = 1e4
_STEPS_S = (0.0005, 5.0)  # between poses of a vehicle


def stamp_ns(text: str, unit_ns: int = NS_PER_S) -> int:
    """Return a decimal number of units as integer nanoseconds, without rounding through a float.

    Raises:
        ValueError: it is no finite number.
        OverflowError: nanoseconds in 64 bits do not reach so far (292 years).
    """
    whole, _, fraction = text.partition(".")
    if unit_ns == NS_PER_S and fraction.isdigit() and whole.lstrip("+-").isdigit() and len(whole) < 10:
        sign = -1 if whole.startswith("-") else 1
        return int(whole) * NS_PER_S + sign * int(fraction[:9].ljust(9, "0"))
    return _exact(text, unit_ns)


def _exact(text: str, unit_ns: int) -> int:
    try:
        value = decimal.Decimal(text)
    except decimal.InvalidOperation:
        raise ValueError(f"'{text}' is no number") from None
    if value.is_nan():
        raise ValueError(f"'{text}' is no time")
    with decimal.localcontext(prec=60):
        if value.copy_abs() > decimal.Decimal(_LARGEST_NS) / unit_ns:
            raise OverflowError(f"{text[:40]} is beyond what nanoseconds in 64 bits hold, 292 years")
        return int((value * unit_ns).to_integral_value(decimal.ROUND_HALF_EVEN))


def guessed_unit_ns(values: FloatArray) -> int:
    """Return how many nanoseconds the unit of stamps (N,) has; 0 where their size does not say it.

    Stamps since 1970 show it by their size. Others are seconds, unless hours would lie between two poses: then it is the one unit
    in which these are milliseconds to seconds apart.
    """
    known = of_epoch(values)
    if known:
        return known
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    step = float(np.median(steps)) if len(steps) else 0.0
    if step < _LONGEST_STEP_S:
        return NS_PER_S
    fitting = [unit for unit in (1, 1_000, 1_000_000) if _STEPS_S[0] <= step * unit / NS_PER_S <= _STEPS_S[1]]
    return fitting[0] if len(fitting) == 1 else 0


def contradiction(values: FloatArray, unit_ns: int) -> str:
    """Return in words why stamps (N,) cannot be in a unit that was named, or ''."""
    known = of_epoch(values)
    if known in (0, unit_ns):
        return ""
    return f"the header says {_UNIT_NAMES[unit_ns]}, but the stamps are {_UNIT_NAMES[known]} since 1970 by their size"


def unit_name(unit_ns: int) -> str:
    """Return the unit in words."""
    return _UNIT_NAMES[unit_ns]


def of_epoch(values: FloatArray) -> int:
    """Return how many nanoseconds the unit of stamps since 1970 has; 0 where they are none by their size."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0
    low, high = float(finite.min()), float(finite.max())
    units = (
        unit for unit in _UNIT_NAMES if _EPOCH_S[0] * NS_PER_S <= low * unit and high * unit <= _EPOCH_S[1] * NS_PER_S
    )
    return next(units, 0)
