"""Nested settings files: what may stand in them, where a mistake is, and the way back to a file."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from lhdmap.errors import ConfigError, InputError
from lhdmap.settings import REQUIRED, Profile, check_corners, setting
from lhdmap.settings_tree import load_tree, part, tree_from, tree_toml

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Walls:
    """The rock."""

    roughness_m: float = setting(0.12, unit="m", minimum=0.0, maximum=0.5, doc="Roughness, rms.")
    kind: str = setting("rough", choices=("rough", "smooth"), doc="Kind of rock.")


@dataclass(frozen=True, slots=True)
class Niche:
    """A niche in a drift."""

    at_m: float = setting(REQUIRED, unit="m", minimum=0.0, doc="Where along the drift.")
    sides: tuple[str, ...] = setting(("left",), choices=("left", "right"), doc="On which sides.")


@dataclass(frozen=True, slots=True)
class Drift:
    """A drift."""

    line_m: tuple[Point, ...] = setting(REQUIRED, unit="m", maximum=1e5, doc="Centre line on the floor.")
    name: str = setting("", doc="Name of the drift.")
    width_m: Profile = setting(4.5, unit="m", minimum=1.0, doc="Width, or [[at_m, width], …].")
    roughness_m: float | None = setting(None, unit="m", minimum=0.0, doc="Roughness over that of [walls].")
    walls: Walls | None = None
    niches: tuple[Niche, ...] = part(tuple, key="niche")

    def __post_init__(self) -> None:
        """A line has two ends."""
        if len(self.line_m) < 2:
            raise ConfigError(f"line_m has {len(self.line_m)} points: two or more were wanted")


@dataclass(frozen=True, slots=True)
class Box:
    """A box."""

    min_m: Point = setting(REQUIRED, unit="m", doc="Lower corner.")
    max_m: Point = setting((1.0, 1.0, 1.0), unit="m", doc="Upper corner.")

    def __post_init__(self) -> None:
        check_corners(self.min_m, self.max_m)


@dataclass(frozen=True, slots=True)
class Leg:
    """One leg of a mission."""

    start: str = setting(REQUIRED, key="from", doc="Where it begins.")
    end: str = setting(REQUIRED, key="to", doc="Where it ends.")
    buckets: int = setting(1, minimum=1, doc="How often.")


@dataclass(frozen=True, slots=True)
class Plan:
    """A plan with all that such a file can have."""

    name: str = setting("mine", doc="Name of the mine.")
    seed: int = setting(0, minimum=0, doc="Seed of all that is random.")
    closed: bool = setting(False, doc="Whether it is closed.")
    walls: Walls = part(Walls)
    drifts: tuple[Drift, ...] = part(tuple, key="drift")
    boxes: dict[str, Box] = part(dict, key="box")
    joints: tuple[Walls, ...] = part(lambda: (Walls(0.1), Walls(0.2)), key="joint", names=("swing", "boom"))
    mission: tuple[Leg, ...] = part(tuple)


RING = """
name = "ring"
seed = 3
mission = [{ from = "DP1", to = "OP1", buckets = 2 }, { from = "DP2", to = "OP1" }]
[walls]
roughness_m = 0.03
[[drift]]
name = "T1"
line_m = [[0, 0, 0], [60, 0, 0], [90, 25, 2.0]]
[[drift]]
line_m = [[0, 0, 0], [0.0, -5.5, 1]]
width_m = [[0, 4.5], [20, 6]]
roughness_m = 0.2
[drift.walls]
kind = "smooth"
[[drift.niche]]
at_m = 4
[[drift.niche]]
at_m = 9.0
sides = ["left", "right"]
[box."cabin 2"]
min_m = [0, 0, 0]
[joint.boom]
kind = "smooth"
"""
EXPECTED = Plan(
    "ring",
    3,
    walls=Walls(0.03),
    drifts=(
        Drift(((0.0, 0.0, 0.0), (60.0, 0.0, 0.0), (90.0, 25.0, 2.0)), "T1"),
        Drift(
            ((0.0, 0.0, 0.0), (0.0, -5.5, 1.0)),
            width_m=((0.0, 4.5), (20.0, 6.0)),
            roughness_m=0.2,
            walls=Walls(kind="smooth"),
            niches=(Niche(4.0), Niche(9.0, ("left", "right"))),
        ),
    ),
    boxes={"cabin 2": Box((0.0, 0.0, 0.0))},
    joints=(Walls(0.1), Walls(0.2, "smooth")),
    mission=(Leg("DP1", "OP1", 2), Leg("DP2", "OP1")),
)


def test_all_forms_are_read(tmp_path: Path) -> None:
    path = tmp_path / "ring.toml"
    path.write_text(RING, encoding="utf-8")
    found = load_tree(Plan, path, "mine plan")
    assert found == EXPECTED
    assert isinstance(found.drifts[0].line_m[0][0], float)


def test_what_is_left_out_is_as_it_was() -> None:
    assert tree_from(Plan, {}) == Plan()
    over = tree_from(Plan, {"walls": {"kind": "smooth"}, "drift": []}, EXPECTED)
    assert over == replace(EXPECTED, walls=Walls(0.03, "smooth"), drifts=())


def test_the_way_back_has_comments_and_reads_the_same() -> None:
    text = tree_toml(EXPECTED, "# A ring.\n")
    assert tree_from(Plan, tomllib.loads(text)) == EXPECTED
    lines = text.splitlines()
    assert lines[0] == "# A ring."
    assert lines[lines.index("roughness_m = 0.03") - 1] == "# Roughness, rms. Unit: m. Source: lhdmap."
    assert (text.count("[[drift]]"), text.count("Centre line on the floor")) == (2, 1)
    assert text.count("# roughness_m = …") == 1
    assert '[box."cabin 2"]' in lines


@pytest.mark.parametrize("name", ['a "b" \\ c', "two\nlines\tand\x7f", "ä 𝄞", "", "[x]", "# no comment"])
def test_any_text_comes_back(name: str) -> None:
    plan = Plan(name, boxes={name: Box((0.0, 0.0, -1e-9))})
    assert tree_from(Plan, tomllib.loads(tree_toml(plan))) == plan


WRONG = [
    ("nmae = 'x'", "unknown setting 'nmae'; did you mean 'name'?"),
    ("[wals]", "unknown section 'wals'; did you mean 'walls'?"),
    ("[[drifts]]", "unknown section 'drifts'; did you mean 'drift'?"),
    ("[walls]\nroughnes_m = 1", "unknown setting 'walls.roughnes_m'; did you mean 'roughness_m'?"),
    ("[walls]\nroughness_m = 0.7", "walls.roughness_m = 0.7 is outside its range: 0 to 0.5 m was wanted"),
    ("[walls]\nkind = 'wet'", "walls.kind = 'wet': one of rough, smooth was wanted"),
    ("seed = 1.5", "seed = 1.5: a value of type int was wanted"),
    ("closed = 1", "closed = 1: a value of type bool was wanted"),
    ("walls = 3", "walls = 3: a section [walls] was wanted"),
    ("[[walls]]", "walls = several of it: a section [walls] was wanted"),
    ("[drift]", "drift = one section [drift]: [[drift]] was wanted, once for each"),
    ("drift = [3]", "drift = [3]: [[drift]] was wanted, once for each"),
    ("[[drift]]", "[[drift]] 1: line_m is missing: Centre line on the floor."),
    ("[[drift]]\nline_m = [[0,0,0]]", "[[drift]] 1: line_m has 1 points: two or more were wanted"),
    ("{T}[[drift]]\nwidht_m = 3", "[[drift]] 2: unknown setting 'widht_m'; did you mean 'width_m'?"),
    ("{T}{T}walls.kinds = ''", "[[drift]] 2: unknown setting 'walls.kinds'; did you mean 'kind'?"),
    ("{T}{T}walls = 3", "[[drift]] 2: walls = 3: a section [walls] was wanted"),
    ("{T}niche = 3", "[[drift]] 1: niche = 3: [[niche]] was wanted, once for each"),
    ("{T}[[drift.niche]]\nat = 1", "[[drift]] 1: [[niche]] 1: unknown setting 'at'; did you mean 'at_m'?"),
    (
        "{T}[[drift.niche]]\nat_m = -1",
        "[[drift]] 1: [[niche]] 1: at_m = -1 is outside its range: 0 m or more was wanted",
    ),
    (
        "{T}[[drift.niche]]\nat_m = 1\nsides = ['left', 'top']",
        "[[drift]] 1: [[niche]] 1: sides = 'top': one of left, right was wanted",
    ),
    ("[[drift]]\nline_m = [[0, 0], [1, 1]]", "[[drift]] 1: line_m has 2 values: 3 were wanted"),
    ("[[drift]]\nline_m = [[0, 0, 0], [1, 'x', 0]]", "[[drift]] 1: line_m = 'x': a value of type float was wanted"),
    ("[[drift]]\nline_m = [[0, 0, 0], [2e5, 0, 0]]", "is outside its range: 100000 m or less was wanted"),
    ("[[drift]]\nline_m = [[0, 0, 0], [nan, 0, 0]]", "[[drift]] 1: line_m is not a number"),
    ("{T}width_m = 0.5", "[[drift]] 1: width_m = 0.5 is outside its range: 1 m or more was wanted"),
    ("{T}width_m = [[0, 5], [9, 0.5]]", "width_m = [[0.0, 5.0], [9.0, 0.5]] is outside its range"),
    ("{T}width_m = [[9, 5], [0, 5]]", "[[at, value], …] with rising 'at' was wanted"),
    ("{T}width_m = []", "[[at, value], …] with rising 'at' was wanted"),
    ("{T}width_m = [4, 5]", "[[drift]] 1: width_m = 4: a list was wanted"),
    ("{T}width_m = 'wide'", "[[drift]] 1: width_m = 'wide': a value of type float was wanted"),
    ("{T}roughness_m = []", "[[drift]] 1: roughness_m = []: a value of type float was wanted"),
    ("[box.a]", "box.a.min_m is missing: Lower corner."),
    ("[box.a]\nmin_m = [2, 0, 0]", "box.a: each value of min_m must be below that of max_m"),
    ("[box]\na = 3", "box.a = 3: a section [box.a] was wanted"),
    ("[joint.bom]", "unknown section 'joint.bom'; did you mean 'boom'?"),
    ("[joint.swing]\nknd = ''", "unknown setting 'joint.swing.knd'; did you mean 'kind'?"),
    (
        "mission = [{ from = 'a', to = 'b' }, { form = 'a' }]",
        "[[mission]] 2: unknown setting 'form'; did you mean 'from'?",
    ),
    ("[[mission]]\nstart = 'a'", "[[mission]] 1: unknown setting 'start'; known: buckets, from, to"),
    ("[[mission]]\nfrom = 'a'", "[[mission]] 1: to is missing: Where it ends."),
]


@pytest.mark.parametrize(("text", "told"), WRONG, ids=[told for _, told in WRONG])
def test_a_mistake_is_told_with_its_place(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace("{T}", "[[drift]]\nline_m = [[0, 0, 0], [9, 0, 0]]\n"), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_tree(Plan, path, "mine plan")
    assert str(caught.value).startswith(f"{path}: ")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_keys_of_another_kind_of_file_are_not_known() -> None:
    with pytest.raises(ConfigError, match=r"unknown section 'walls'; known: .*seed"):
        tree_from(Plan, {"walls": {}}, without=["walls"])


def test_what_is_no_toml_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_bytes(b"\xff= [\n")
    for name in ("plan.toml", "none.toml"):
        with pytest.raises(InputError, match=rf"{name}: not a readable mine plan"):
            load_tree(Plan, tmp_path / name, "mine plan")


def test_a_setting_without_default_must_be_given_in_python_too() -> None:
    with pytest.raises(TypeError):
        Niche()
