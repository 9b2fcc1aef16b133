"""Names of files: of any bytes, of `.` and `..`, with spaces and dots."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from lhdmap.names import beside, in_utf8, name_of, shown

LATIN_1 = os.fsdecode(b"M\xfcller drive")
pytestmark = pytest.mark.skipif(os.name != "posix", reason="names are bytes on POSIX alone")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("/a/drive.mcap", "/a/drive.mcap"),
        ("Müller ⛏", "Müller ⛏"),
        (LATIN_1, "M\\xfcller drive"),
        (Path(LATIN_1) / "b", "M\\xfcller drive/b"),
        ("\ud83d", "\\ud83d"),
    ],
)
def test_shown_can_be_written(text: object, wanted: str) -> None:
    assert shown(text) == wanted
    assert shown(text).encode()


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (".", "drive_map"), ("./", "drive_map"), ("../drive", "drive_map"), ("../drive/", "drive_map"), ("sub/..", "drive_map"),
        ("..", "../above_map"), ("sub", "drive/sub_map"), ("a.mcap", "drive/a_map"), ("a b.mcap.zstd", "drive/a b_map"),
        (".a.mcap", "drive/.a_map"), ("-x.bag", "drive/-x_map"), ("link.mcap", "drive/link_map"),
    ],
)  # fmt: skip
def test_results_lie_beside_their_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str, wanted: str
) -> None:
    folder = tmp_path / "above" / "drive"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "far.mcap").touch()
    (folder / "link.mcap").symlink_to(tmp_path / "far.mcap")
    monkeypatch.chdir(folder)
    assert Path(os.path.normpath(beside(Path(given), "map"))) == Path(os.path.normpath(folder.parent / wanted))


def test_the_name_of_a_folder_that_is_given_as_a_dot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "drive" / "sub").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "drive")
    assert [name_of(Path(text)) for text in (".", "sub/..", "../drive/", "a.mcap")] == [
        "drive",
        "drive",
        "drive",
        "a.mcap",
    ]


@pytest.mark.parametrize("name", ["plain.rrd", "-x.rrd", LATIN_1 + ".rrd"])
def test_a_path_for_programs_that_take_utf8_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path(name)
    with in_utf8(path) as written:
        assert str(written).encode()
        assert not str(written).startswith("-")
        assert written.suffix == ".rrd"
        written.write_text("new")
    assert path.read_text() == "new"
    with in_utf8(path) as read:
        assert read.read_text() == "new"
    assert read == path.absolute() or not read.exists()
