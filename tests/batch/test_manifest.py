"""Manifests: what is read, and what is refused with its line."""

from __future__ import annotations

from pathlib import Path

import pytest
from lhdmap.batch.manifest import read_manifest
from lhdmap.errors import InputError, LhdmapError, UsageError


def _write(folder: Path, text: str) -> Path:
    path = folder / "m.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_rows_become_command_lines(tmp_path: Path) -> None:
    text = (
        "log, map, machine, config, command\na.mcap,,m.toml,,\nsub/b.bag,a_map,,c.toml,localize\n/c.mcap,,,,doctor\n\n"
    )
    first, second, third = read_manifest(_write(tmp_path, text))
    out = tmp_path / "out"
    assert first.words(out) == [
        *("build-map", str(tmp_path / "a.mcap"), "--json", "--one-process"),
        *("--machine", str(tmp_path / "m.toml"), "-o", str(out / "a_map")),
    ]
    assert second.words(out, force=True) == [
        *("localize", str(tmp_path / "sub" / "b.bag"), "--json", "--map", str(tmp_path / "a_map")),
        *("--config", str(tmp_path / "c.toml"), "-o", str(out / "b_localization"), "--force"),
    ]
    assert third.words(out) == ["doctor", "/c.mcap", "--json"]


def test_results_of_the_same_name_are_told_apart(tmp_path: Path) -> None:
    text = "log,name\nx/a.mcap,\ny/a.mcap,\nz/a.mcap,\nb.mcap,a_map_2\n"
    names = [task.name for task in read_manifest(_write(tmp_path, text))]
    assert names == ["a_map", "a_map_3", "a_map_4", "a_map_2"]


@pytest.mark.parametrize(
    ("text", "kind", "told"),
    [
        ("log\n", InputError, "no rows"),
        ("map\nx\n", UsageError, "no column log"),
        ("log,comand\na,pile\n", UsageError, "did you mean 'command'"),
        ("log,command\na,pil\n", UsageError, "line 2: unknown command 'pil'; did you mean 'pile'"),
        ("log,command\na,localize\n", UsageError, "'localize' wants a map"),
        ("log,map\na,m\n", UsageError, "'build-map' takes no map"),
        ("log,command\n,pile\n", UsageError, "log is empty"),
        ("log\na,b\n", UsageError, "more cells"),
        ("log,name\na,../x\n", UsageError, "without a path"),
        ("log,name\na,rows\n", UsageError, "none of"),
    ],
)
def test_what_is_wrong_is_refused(tmp_path: Path, text: str, kind: type[LhdmapError], told: str) -> None:
    with pytest.raises(kind, match=told):
        read_manifest(_write(tmp_path, text))


def test_a_manifest_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not readable"):
        read_manifest(tmp_path / "none.csv")


def test_known_columns_are_told_once(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as told:
        read_manifest(_write(tmp_path, "qqqq,log\n1,a\n"))
    assert str(told.value).count("known:") == 1
