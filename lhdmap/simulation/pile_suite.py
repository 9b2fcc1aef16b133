"""Suites: lists of scenes that are written as logs with their truth and a table in the style of Table 6."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from lhdmap.errors import ConfigError
from lhdmap.interrupts import obey
from lhdmap.runfolder import RunFolderWriter, RunInfo
from lhdmap.settings import setting
from lhdmap.settings_tree import load_tree, part
from lhdmap.simulation.pile_files import row_of, write_table
from lhdmap.simulation.pile_scenes import scene
from lhdmap.simulation.pile_sections import VARIANTS
from lhdmap.simulation.scenario import DriftScenario

TABLE = "truth.csv"
Told = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class SuitePart:
    """One `[[scenes]]` of a suite: so many seeds of a variant."""

    variant: str = setting("normal", choices=VARIANTS, doc="Kind of scene.")
    first_seed: int = setting(0, minimum=0, doc="First of the seeds.")
    count: int = setting(1, minimum=1, maximum=100_000, doc="How many seeds, one after the other.")
    flat_floor: bool = setting(False, doc="Whether the floor has no waves.")


@dataclass(frozen=True, slots=True)
class Suite:
    """A suite file."""

    scenes: tuple[SuitePart, ...] = part(tuple)


class SuiteScene(NamedTuple):
    """One scene of a suite."""

    variant: str
    seed: int
    flat_floor: bool

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"{self.variant}{'_flat' if self.flat_floor else ''}_{self.seed}"

    def scenario(self) -> DriftScenario:
        """Return its scenario."""
        return scene(self.variant, self.seed, flat_floor=self.flat_floor)


def load_suite(path: Path) -> list[SuiteScene]:
    """Return the scenes of a suite file: TOML with `[[scenes]]`, each with variant, first_seed, count, flat_floor.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong, or a scene is in it twice.
    """
    parts = load_tree(Suite, path, "suite file").scenes
    if not parts:
        raise ConfigError(f"{path}: at least one [[scenes]] was wanted")
    found = [SuiteScene(one.variant, one.first_seed + k, one.flat_floor) for one in parts for k in range(one.count)]
    if len(set(found)) < len(found):
        raise ConfigError(f"{path}: a scene is in it twice; give each [[scenes]] its own first_seed")
    return found


def write_suite(
    scenes: list[SuiteScene],
    folder: Path,
    *,
    jobs: int = 1,
    told: Told | None = None,
    force: bool = False,
    sources: Sequence[Path] = (),
) -> Path:
    """Write the logs of all scenes into `folder`, with their truth and the table `truth.csv`; return the table.

    What is in the partial folder already (from a run that was interrupted) stays. `told(name, done, of)` hears of each
    finished scene; `sources` are the files that say which scenes.

    Raises:
        UsageError: the folder is there already, without `force`.
        OSError: a file cannot be written.
    """
    with RunFolderWriter("suite", folder, force=force, inputs=sources, resumed=True) as growing:
        wanted = [one for one in scenes if not _finished(one, growing.path)]
        for done, name in enumerate(_written(wanted, growing.path, jobs), start=1):
            growing.finished(growing.path / f"{name}.mcap")
            if told is not None:
                told(name, done, len(wanted))
        rows = (row_of(growing.path / f"{one.name}.pile.json", growing.path) for one in scenes)
        write_table(growing.path / TABLE, rows)
        return growing.complete(RunInfo(sources, more={"scenes": [one.name for one in scenes]})) / TABLE


def _finished(one: SuiteScene, folder: Path) -> bool:
    return (folder / f"{one.name}.mcap").exists()  # it gets its name last


def _written(scenes: list[SuiteScene], folder: Path, jobs: int) -> Iterator[str]:
    if jobs == 1:
        for one in scenes:
            yield _write(one, folder)
        return
    with ProcessPoolExecutor(jobs, initializer=obey) as pool:
        try:
            yield from pool.map(_write, scenes, [folder] * len(scenes))
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _write(one: SuiteScene, folder: Path) -> str:
    """Write one scene; what a run that was interrupted has left of it is replaced."""
    from lhdmap.simulation.drive import simulate_drift

    simulate_drift(one.scenario(), folder / f"{one.name}.mcap", force=True)
    return one.name
