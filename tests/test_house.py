"""The house: imports point one way, starting is cheap, the shipped files say what the code says, the wheel is whole."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import lhdmap
import pytest
from lhdmap.config import Settings, load_settings, settings_table, settings_toml
from lhdmap.errors import ConfigError, UsageError
from lhdmap.extras import LIBRARIES
from lhdmap.machine import Machine, load_machine, machine_toml
from lhdmap.resources import resource
from lhdmap.rockbreaker.machine import Rockbreaker, load_rockbreaker, rockbreaker_toml
from lhdmap.simulation.scenario import load_scenario, scenario_toml

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "lhdmap"

FLOORS = [
    {"errors"},
    {"messages", "settings", "resources", "names", "interrupts", "descriptions", "extras"},
    {"geometry", "tables", "provenance", "outputs", "json_files", "roles", "settings_tree"},
    {"trajectory", "runfolder", "machine_sections"},
    {"machine", "mapfolder"},
    {"kinematics"},
    {"mine"},
    {"scan_matching"},
    {"logs", "proprioception", "odometry", "integration"},
    {"pile", "rockbreaker"},
    {"topology"},
    {"movement", "landmarks"},
    {"driving"},
    {"guidance", "executor", "tracking"},
    {"docking"},
    {"loading"},
    {"navigation"},
    {"traffic"},
    {"haulage"},
    {"production"},
    {"exports", "console"},
    {"smoothing", "simulation", "evaluation"},
    {"update"},
    {"localization"},
    {"report"},
    {"config"},
    {"pipeline"},
    {"front", "replay", "batch", "live"},
    {"cli"},
    {"__main__"},
]
"""Each part imports from the floors below it only, and from itself: docs/architecture.md draws them."""

HEAVY = {
    "numpy", "scipy", "numba", "open3d", "rerun", "matplotlib", "pyarrow", "gtsam", "small_gicp", "kiss_icp", "laspy",
    "rosbags", "mcap", "rich", "cv2", "skimage", "ezdxf", "starlette", "uvicorn", "websockets", "pyotp",
}  # fmt: skip


def _part(path: Path) -> str:
    relative = path.relative_to(PACKAGE)
    return relative.parts[0].removesuffix(".py")


def _imports(path: Path) -> Iterator[str]:
    """Yield the parts of lhdmap that a file imports, inside functions too, but not those for type checkers alone."""
    for name in _imported(path):
        first, _, rest = name.partition(".")
        if first == "lhdmap" and rest and rest != "__version__":
            yield rest.split(".")[0]


def _imported(path: Path) -> Iterator[str]:
    """Yield all that a file imports, as `_imports` does."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {
        id(node)
        for guard in ast.walk(tree)
        if isinstance(guard, ast.If) and "TYPE_CHECKING" in ast.unparse(guard.test)
        for node in ast.walk(guard)
    }
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import hides where it points"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        yield from names


def _level(part: str) -> int:
    return next(level for level, parts in enumerate(FLOORS) if part in parts)


MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def test_every_part_has_its_floor() -> None:
    assert {_part(path) for path in MODULES} == set.union(*FLOORS)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_imports_point_one_way(path: Path) -> None:
    part = _part(path)
    allowed = set.union(set(), *FLOORS[: _level(part)], {part})
    assert set(_imports(path)) <= allowed


def test_the_rule_finds_a_wrong_import(tmp_path: Path) -> None:
    file = tmp_path / "stage.py"
    file.write_text("from lhdmap.report.page import write_report\nimport lhdmap.cli.main\n", encoding="utf-8")
    assert list(_imports(file)) == ["report", "cli"]


OF_AN_EXTRA = {
    "console/app.py", "console/fence.py", "console/serve.py", "console/sockets.py",
    "live/dds_types.py", "live/foxglove.py", "live/over_dds.py", "live/over_zenoh.py",
}  # fmt: skip
"""What is of an extra as a whole, the console's server and the live sources: loaded once its libraries have been found."""


def test_optional_libraries_are_loaded_in_one_place() -> None:
    """Elsewhere they are named for type checkers alone, or asked for with `lhdmap.extras.library`."""
    for path in (path for path in MODULES if path.relative_to(PACKAGE).as_posix() not in OF_AN_EXTRA):
        found = {name.split(".")[0] for name in _imported(path)} & set(LIBRARIES)
        assert not found, f"{path} imports {found}"


@pytest.mark.parametrize("statement", ["import lhdmap", "from lhdmap.cli.main import main; main(['--help'])"])
def test_starting_loads_nothing_heavy(statement: str) -> None:
    code = f"import sys; {statement}; print(*sorted(sys.modules), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[0] for name in done.stderr.split()}
    assert "lhdmap" in loaded
    assert loaded.isdisjoint(HEAVY)


def test_nothing_in_the_library_prints_or_exits() -> None:
    for path in MODULES:
        if path.parent != PACKAGE / "cli":
            calls = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
            said = {ast.unparse(call) for call in calls} & {"print", "exit", "sys.exit", "quit", "os._exit"}
            if path.name == "beside.py":  # ends the process that it started itself
                said -= {"os._exit"}
            assert not said or path.name == "__main__.py", f"{path} calls {said}"


def test_tests_import_no_tool_but_the_one_that_they_test() -> None:
    """What tests share with tools is theirs; the tests of the tools are in `tests/tools`."""
    for path in sorted(path for path in (ROOT / "tests").rglob("*.py") if path.parent.name != "tools"):
        assert not [name for name in _imported(path) if name.split(".")[0] == "tools"], path


LONG_FILES: set[str] = set()
"""Files of more than 300 lines that are still to be split: no new ones, and whoever splits one takes it off."""

LARGE_CLASSES = {
    "replay/processes/executive.py:Executive", "replay/processes/site_executive.py:SiteExecutive",
    "simulation/mine_world/world.py:MineWorld",
}  # fmt: skip
"""Classes of more than twelve attributes that are still to be taken apart, as `LONG_FILES`."""

NAMES_TWICE = {
    "Asked", "Attempt", "Beat", "Beside", "Bodies", "Bumper", "Candidate", "Chance", "Change", "Column", "Command",
    "Crossing", "Cut", "Cycle", "Decision", "Digging", "Drift", "Drive", "Edge", "Errand", "Errors", "Event", "Face",
    "Facts", "Field", "Figure", "Floor", "Found", "Gains", "Grid", "Guard", "Help", "Landmarks", "Layout", "Ledger",
    "Leg", "Limits", "Link", "Load", "Loader", "Moment", "Operator", "Pairs", "Path", "PileTruth", "Place", "Plan",
    "Plant", "Profile", "Reach", "Refusal", "Request", "Rig", "Rock", "Room", "Row", "Rule", "Run", "Sampled", "Seen",
    "Series", "Shaking", "Signals", "SkidFactor", "Span", "Speeds", "Start", "State", "Station", "Status", "Step",
    "Stop", "Stops", "Table", "Target", "Task", "Trajectory", "Tries", "Truth", "Tunnel", "Vehicle", "Walls", "Watch",
    "Way", "Weighing", "WheelSettings", "Whereabouts", "Word",
}  # fmt: skip
"""Names that several classes have still, as `LONG_FILES`; none of them in the rooms of `UNIQUE`."""

UNIQUE = ("odometry", "scan_matching", "geometry", "pile", "logs")


def _classes() -> Iterator[tuple[str, ast.ClassDef]]:
    for path in MODULES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                yield path.relative_to(PACKAGE).as_posix(), node


def _attributes(tree: ast.ClassDef) -> set[str]:
    """Return the names that a class sets on itself."""
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and ast.unparse(node.value) == "self"
    }


def test_files_are_short() -> None:
    long = {p.relative_to(PACKAGE).as_posix() for p in MODULES if len(p.read_text(encoding="utf-8").splitlines()) > 300}
    assert long == LONG_FILES


def test_classes_are_small() -> None:
    assert {f"{path}:{tree.name}" for path, tree in _classes() if len(_attributes(tree)) > 12} == LARGE_CLASSES


def test_names_of_classes_are_unique() -> None:
    named: dict[str, list[str]] = {}
    for path, tree in _classes():
        if not tree.name.startswith("_"):
            named.setdefault(tree.name, []).append(path)
    twice = {name: paths for name, paths in named.items() if len(paths) > 1}
    assert not {name for name, paths in twice.items() if any(path.split("/")[0] in UNIQUE for path in paths)}
    assert set(twice) == NAMES_TWICE


def test_constants_of_the_odometry_have_their_reason() -> None:
    """A comment beside it or above it, above the lines that belong to it, or a docstring below."""
    for path in sorted((PACKAGE / "odometry").rglob("*.py")):
        lines, body = path.read_text(encoding="utf-8").splitlines(), ast.parse(path.read_text(encoding="utf-8")).body
        for node, after in pairwise([*body, ast.Pass()]):
            if isinstance(node, ast.Assign) and re.match(
                r"_?[A-Z][A-Z0-9_]+\b", ast.unparse(node.targets[0]).lstrip("(")
            ):
                beside = any("#" in line for line in lines[node.lineno - 1 : node.end_lineno])
                above = lines[node.lineno - 2].startswith("#")
                assert beside or above or isinstance(after, ast.Expr), (
                    f"{path.name}:{node.lineno} {lines[node.lineno - 1]}"
                )


def test_default_toml_is_what_the_code_says() -> None:
    text = resource("pipelines/default.toml").read_text(encoding="utf-8")
    assert text.strip() == settings_toml().strip(), "run make config"
    assert load_settings(resource("pipelines/default.toml")) == Settings()


def test_the_machine_file_is_the_default_machine() -> None:
    remark, _, text = resource("pipelines/machines/lhd_11t.toml").read_text(encoding="utf-8").partition("\n")
    assert remark.startswith("#")
    assert text == machine_toml(Machine())
    assert load_machine(resource("pipelines/machines/lhd_11t.toml")) == Machine()


def test_the_rockbreaker_file_is_the_default_machine() -> None:
    text = resource("pipelines/machines/rockbreaker_table1.toml").read_text(encoding="utf-8")
    assert text == rockbreaker_toml(Rockbreaker())
    assert load_rockbreaker(resource("pipelines/machines/rockbreaker_table1.toml")) == Rockbreaker()


def test_the_demo_scenario_says_all_that_can_be_said() -> None:
    file = resource("datasets/demo_drift.toml")
    whole = tomllib.loads(scenario_toml(load_scenario(file)))
    assert tomllib.loads(file.read_text(encoding="utf-8")) == whole


def test_every_setting_has_meaning_unit_and_source() -> None:
    lines = settings_toml().splitlines()
    settings = [(before, line) for before, line in pairwise(lines) if re.match(r"\w+ = ", line)]
    assert len(settings) > 50
    for before, line in settings:
        assert re.fullmatch(r"# .+ Unit: .+\. Source: .+\.", before), line


def test_settings_survive_the_way_through_a_file(tmp_path: Path) -> None:
    changed = load_settings(None, ["odometry.step_m=0.25", "odometry.method=range_flow"])
    file = tmp_path / "mine.toml"
    file.write_text(settings_toml(changed), encoding="utf-8")
    assert load_settings(file) == changed
    assert settings_table(changed)["odometry"]["step_m"] == 0.25


@pytest.mark.parametrize(
    ("assignment", "told"),
    [
        ("odometry.metod='anchored'", "did you mean 'method'"),
        ("odometri.method='anchored'", "did you mean 'odometry'"),
        ("odometry.step_m='far'", "float"),
        ("odometry.step_m=true", "float"),
        ("odometry.step_m=nan", "not a number"),
        ("odometry.step_m=-1.0", "outside"),
        ("odometry.method=7", "str"),
        ("odometry.method='magic'", "one of"),
        ("odometry", "section.key=value"),
    ],
)
def test_wrong_settings_are_refused(assignment: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        load_settings(None, [assignment])


def test_a_file_of_settings_is_named_where_it_is_wrong(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("odometry = 3\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"mine\.toml.*is a section"):
        load_settings(file)


def test_what_does_not_ship_is_said() -> None:
    with pytest.raises(UsageError, match="does not ship"):
        resource("pipelines/none.toml")


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return next(folder.glob("*.whl"))


def test_the_wheel_runs_without_the_checkout(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    code = (
        "import lhdmap; from lhdmap.resources import resource; from lhdmap.config import load_settings, Settings;"
        "assert load_settings(resource('pipelines/default.toml')) == Settings();"
        "print(lhdmap.__file__, resource('datasets/demo_drift.toml'), resource('pipelines/machines/lhd_11t.toml'))"
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert all(path.startswith(str(tmp_path / "site")) for path in done.stdout.split())


def test_the_wheel_is_typed_licensed_and_small(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {"lhdmap/py.typed", "lhdmap/report/style.css", "lhdmap/share/datasets/mit_csail.clf.bz2"} <= names
    assert {f"lhdmap/share/evaluation/rockbreaker_table{k}.csv" for k in (2, 3)} <= names
    assert f"lhdmap-{lhdmap.__version__}.dist-info/licenses/LICENSE" in names
    assert wheel.stat().st_size < 5_000_000


MARKDOWN = [path for path in [*ROOT.glob("*.md"), *ROOT.glob("*/*.md")] if not path.parent.name.startswith(".")]


@pytest.mark.parametrize("page", MARKDOWN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if not target.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_the_commands_that_the_readme_names_exist() -> None:
    from lhdmap.cli.main import COMMANDS

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"^lhdmap ([a-z-]+)", text, re.MULTILINE)) <= set(COMMANDS)
    assert set(re.findall(r"^make ([a-z]+)", text, re.MULTILINE)) <= targets
