"""The excavation by name: `paper`, `paper-tuned` (the same law with other numbers), `adaptive`."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.loading.digging_settings import ExcavationSettings, PaperDigSettings, TunedDigSettings
from lhdmap.loading.excavation_adaptive import AdaptiveDig
from lhdmap.loading.excavation_paper import PaperDig

Excavation = PaperDig | AdaptiveDig


class DigSettings(NamedTuple):
    """The three sections of the settings that a dig needs."""

    excavation: ExcavationSettings = ExcavationSettings()
    paper: PaperDigSettings = PaperDigSettings()
    tuned: TunedDigSettings = TunedDigSettings()


def excavation_of(settings: DigSettings, method: str = "") -> Excavation:
    """Return the controller of a method, of that of the settings where none is told; ends `boom`, `racked` or `advance`."""
    match method or settings.excavation.method:
        case "paper":
            return PaperDig(settings.excavation, settings.paper)
        case "paper-tuned":
            return PaperDig(settings.excavation, settings.tuned)
    return AdaptiveDig(settings.excavation)
