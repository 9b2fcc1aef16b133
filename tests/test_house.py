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
from lhdmap.machine import Machine, load_machine, machine_toml
from lhdmap.resources import resource
from lhdmap.rockbreaker.machine import Rockbreaker, load_rockbreaker, rockbreaker_toml
from lhdmap.simulation.scenario import load_scenario, scenario_toml

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "lhdmap"

FLOORS = [
    {"errors"},
    {"messages", "settings", "resources", "names", "interrupts", "descriptions"},
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
    {"exports"},
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
    "rosbags", "mcap", "rich", "cv2", "skimage", "ezdxf",
}  # fmt: skip


def _part(path: Path) -> str:
    relative = path.relative_to(PACKAGE)
    return relative.parts[0].removesuffix(".py")


def _imports(path: Path) -> Iterator[str]:
    """Yield the parts of lhdmap that a file imports, inside functions too, but not those for type checkers alone."""
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
        for name in names:
            first, _, rest = name.partition(".")
            if first == "lhdmap" and rest and rest != "__version__":
                yield rest.split(".")[0]


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
