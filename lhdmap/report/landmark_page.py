"""The section on landmarks: how many there are, where tunnels are not distinctive, matrix and walls of the longest ones."""

from __future__ import annotations

from lhdmap.landmarks.model import Landmarks
from lhdmap.report import charts, markup
from lhdmap.report.data import ReportData
from lhdmap.report.landmark_charts import distinctness_chart, similarity_chart

_MOST_TUNNELS = 3
_SHORTEST_M = 20.0


def landmarks_section(data: ReportData, landmarks: Landmarks) -> str:
    """Return the section's content, empty without landmarks."""
    if data.topology is None or not len(landmarks):
        return ""
    names = {tunnel.id: tunnel.name for tunnel in data.topology.tunnels}
    lengths = {tunnel.id: tunnel.length_m for tunnel in data.topology.tunnels}
    unclear = sum(b - a for tunnel in data.topology.tunnels for a, b in tunnel.not_distinctive_m)
    text = f"{len(landmarks)} landmarks, {int(landmarks.key.sum())} of them keys. "
    text += f"Not distinctive: {unclear:.0f} of {sum(lengths.values()):.0f} m of tunnels."
    shown = sorted(
        (one for one in landmarks.similarity if lengths.get(one, 0.0) >= _SHORTEST_M), key=lambda one: -lengths[one]
    )
    parts = [markup.paragraph(text)]
    for tunnel in shown[:_MOST_TUNNELS]:
        matrix = charts.svg_uri(similarity_chart(landmarks, tunnel))
        parts.append(
            markup.picture(matrix, f"{names[tunnel]}: how alike its landmarks are, with its keys and their radii")
        )
        walls = charts.svg_uri(distinctness_chart(landmarks, tunnel, data.landmark_settings))
        parts.append(
            markup.picture(walls, f"{names[tunnel]}: its walls, and how clearly they tell where along it one is")
        )
    return "".join(parts)
