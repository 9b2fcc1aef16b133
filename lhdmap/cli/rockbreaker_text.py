"""What `lhdmap rockbreaker` prints: a plan and a workspace in words."""

from __future__ import annotations

from typing import Any


def plan_text(values: dict[str, Any]) -> str:
    """Return the plan in words."""
    lines = [f"folder       {values['folder']}"]
    if values.get("rock"):
        rock = values["rock"]
        lines.append(f"rock         at {_point(rock['top_m'])} m: {rock['why']}")
    if not values["feasible"]:
        return "\n".join([*lines, f"not feasible {values['reason']['text']}"])
    duration_s, bound_s = values["duration_s"], values["bound_s"]
    ends = f"{_point(values['from_m'])} to {_point(values['to_m'])} m"
    lines += [
        f"trajectory   {values['path'].upper()}, {values['timing']}: {duration_s:.2f} s, {ends}",
        f"orientation  {values['phi_from_deg']:.2f}° to {values['phi_to_deg']:.2f}°",
        f"set by       {values['limiting']} at {values['limit_reached_at_s']:.1f} s; oil {values['pump_volume_l']:.2f} L",
        f"bound        {bound_s:.2f} s on any path: {duration_s / max(bound_s, 1e-9):.2f} times that",
        f"checked      {'yes' if values['checked'] else 'NO'}, highest flow over its limit {values['max_flow_ratio']:.5f}",
        f"planned in   {values['planning_ms']:.1f} ms",
    ]
    if values["timing"] == "limit":
        lines.append("note         a bound for this path, not a motion: speed jumps at its ends")
    return "\n".join(lines)


def _point(values: Any) -> str:
    return "(" + ", ".join(f"{float(value):.2f}" for value in values) + ")"


def workspace_text(values: dict[str, Any]) -> str:
    """Return the workspace in words."""
    lines = [f"folder       {values['folder']}"] if values["folder"] else []
    lines += [
        f"theta{k + 1}       {low:.3f} to {high:.3f} deg" for k, (low, high) in enumerate(values["theta_limits_deg"])
    ]
    lines.append(
        f"slice        {values['area_m2']:.2f} m2 at theta1 = 0, {values['vertical_area_m2']:.2f} m2 with a vertical breaker"
    )
    if values["reached"] is False:
        lines.append("phi          the tip cannot be there")
    elif values["reached"]:
        text = ", ".join(f"{low:.3f} to {high:.3f}" for low, high in values["phi_intervals_deg"])
        lines.append(f"phi          {text} deg; nearest to vertical {values['phi_deg']:.3f} deg")
    return "\n".join(lines)
