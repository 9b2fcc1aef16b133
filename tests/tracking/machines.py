"""The machines of the tests: the loader and the truck, from their files."""

from __future__ import annotations

from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.machine import Machine, load_machine
from lhdmap.resources import resource

LOADER, TRUCK = Machine(), load_machine(resource("pipelines/machines/truck_28t.toml"))
MODELS = {"loader": drive_model(LOADER), "truck": drive_model(TRUCK)}
BODIES = {"loader": bodies_of(LOADER), "truck": bodies_of(TRUCK)}
LENGTHS = {name: (model.front_m, model.rear_m) for name, model in MODELS.items()}
