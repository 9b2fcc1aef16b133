"""Folders of ROS 2 bags: what metadata.yaml names, what is compressed, what is missing; the same messages every time."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from lhdmap.errors import InputError
from lhdmap.logs import open_log
from lhdmap.logs.ros_messages import definition, serialized
from lhdmap.messages import LaserScan
from mcap.writer import Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

START, STEP, COUNT = 1_700_000_000 * 10**9, 40_000_000, 12
KIND = "sensor_msgs/msg/LaserScan"
STAMPS = [START + i * STEP for i in range(COUNT)]


def _scan(stamp: int) -> LaserScan:
    ranges = np.random.default_rng(stamp % 1000).uniform(1.0, 9.0, 181).astype(np.float32)
    return LaserScan(stamp, "laser", -1.5, 0.0174, 0.0, 0.1, 80.0, ranges)


def _mcap(path: Path, stamps: list[int], packed: Callable[[bytes], bytes] = bytes) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        channel = writer.register_channel(
            "/scan", "cdr", writer.register_schema(KIND, "ros2msg", definition(KIND).encode())
        )
        for stamp in stamps:
            writer.add_message(channel, stamp, packed(serialized(_scan(stamp))[1]), stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _metadata(folder: Path, names: list[str], extra: str = "") -> None:
    listed = "".join(f"\n    - {name}" for name in names)
    text = (
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  duration:\n    nanoseconds: 1\n"
        f"  relative_file_paths:{listed}\n  message_count: 12\n{extra}"
    )
    (folder / "metadata.yaml").write_text(text)


def _split(folder: Path, parts: int = 3, named: int | None = None) -> Path:
    """Write a bag in parts of four scans; `metadata.yaml` names the first ones (all by default)."""
    folder.mkdir()
    size = COUNT // parts
    for k in range(parts):
        _mcap(folder / f"drive_{k}.mcap", STAMPS[k * size : (k + 1) * size])
    _metadata(folder, [f"drive_{k}.mcap" for k in range(parts if named is None else named)])
    return folder


def _read(path: Path) -> tuple[list[int], list[str], list[str]]:
    """Return stamps, damage and remarks."""
    with open_log(path) as reader:
        messages = [record.message for record in reader.records()]
        assert all(
            isinstance(one, LaserScan) and np.array_equal(one.ranges_m, _scan(one.stamp_ns).ranges_m)
            for one in messages
        )
        return [one.stamp_ns for one in messages], reader.damage, reader.remarks


def test_a_split_bag(tmp_path: Path) -> None:
    assert _read(_split(tmp_path / "drive")) == (STAMPS, [], [])


def test_a_named_file_that_is_missing_is_told(tmp_path: Path) -> None:
    folder = _split(tmp_path / "drive")
    (folder / "drive_1.mcap").unlink()
    stamps, damage, remarks = _read(folder)
    assert stamps == STAMPS[:4] + STAMPS[8:]
    assert damage == ["drive_1.mcap is named in metadata.yaml and is not there: its messages are missing"]
    assert remarks == []


def test_damage_is_told_with_the_name_of_its_file(tmp_path: Path) -> None:
    folder = _split(tmp_path / "drive")
    file = folder / "drive_2.mcap"
    file.write_bytes(file.read_bytes()[:-60])
    stamps, damage, _ = _read(folder)
    assert stamps == STAMPS
    assert damage
    assert all(line.startswith("drive_2.mcap: ") for line in damage)


def test_a_file_that_is_not_named_is_not_read(tmp_path: Path) -> None:
    """Messages of a copy would all be there twice."""
    folder = _split(tmp_path / "drive")
    _mcap(folder / "drive_filtered.mcap", STAMPS)
    _mcap(folder / "drive_7.mcap", STAMPS)
    stamps, damage, remarks = _read(folder)
    assert (stamps, damage) == (STAMPS, [])
    assert [line.split()[0] for line in remarks] == ["drive_filtered.mcap", "drive_7.mcap"]
    assert all("not named in metadata.yaml: not read" in line for line in remarks)


def test_the_last_part_of_a_recorder_that_died_is_read(tmp_path: Path) -> None:
    stamps, damage, remarks = _read(_split(tmp_path / "drive", named=1))
    assert (stamps, damage) == (STAMPS, [])
    assert [line.split()[0] for line in remarks] == ["drive_1.mcap", "drive_2.mcap"]


def test_a_folder_whose_files_were_given_new_names(tmp_path: Path) -> None:
    folder = _split(tmp_path / "drive", parts=1)
    (folder / "drive_0.mcap").rename(folder / "monday.mcap")
    stamps, damage, remarks = _read(folder)
    assert (stamps, damage) == (STAMPS, [])
    assert "names drive_0.mcap, not there: the files that are in the folder are read instead" in remarks[0]


def test_a_folder_that_holds_nothing_of_what_is_named(tmp_path: Path) -> None:
    _metadata(tmp_path, ["drive_0.mcap"])
    with pytest.raises(InputError, match=r"no \.mcap or \.db3 file .* names drive_0\.mcap"), open_log(tmp_path):
        pass


@pytest.mark.parametrize(
    "text",
    [
        "",
        "rosbag2_bagfile_information:\n",
        "\0\1\2",
        "relative_file_paths: [unclosed\n  - a: b: c",
        "relative_file_paths:\n  - {a: 1\n",
        "relative_file_paths: 7\n",
        "&a [*a, *a]",
    ],
)
def test_metadata_that_says_nothing_stops_nothing(tmp_path: Path, text: str) -> None:
    folder = _split(tmp_path / "drive")
    (folder / "metadata.yaml").write_text(text)
    stamps, damage, remarks = _read(folder)
    assert (stamps, damage) == (STAMPS, [])
    assert ["metadata.yaml is empty or broken" in line for line in remarks] == [True]


@pytest.mark.parametrize(
    "listed",
    [
        "\n  - drive_0.mcap\n  - drive_1.mcap\n",
        "\n    - 'drive_0.mcap'\n    - \"drive_1.mcap\"\n",
        " [drive_0.mcap, drive_1.mcap]\n",
        "\r\n  - drive_0.mcap\r\n  - drive_1.mcap\r\n",
        "\n    - drive/drive_0.mcap\n    - drive/drive_1.mcap\n",  # as ROS 2 Dashing wrote them
        "\n    - C:\\bags\\drive_0.mcap\n    - C:\\bags\\drive_1.mcap",
        "\n    - drive_0.mcap\n    - drive_1.mcap\n  files:\n    - path: drive_0.mcap\n      broken: [\n",
    ],
)
def test_the_ways_to_name_files(tmp_path: Path, listed: str) -> None:
    folder = _split(tmp_path / "drive", named=2)
    (folder / "drive_2.mcap").rename(folder / "copy.mcap")
    (folder / "metadata.yaml").write_bytes(
        f"rosbag2_bagfile_information:\n  version: 99\n  relative_file_paths:{listed}".encode()
    )
    stamps, damage, remarks = _read(folder)
    assert (stamps, damage) == (STAMPS[:8], [])
    assert [line.split()[0] for line in remarks] == ["copy.mcap"]


def test_a_name_that_is_no_ascii(tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    _mcap(folder / "Brücke_0.mcap", STAMPS)
    _metadata(folder, ['"Br\\xFCcke_0.mcap"'])
    assert _read(folder) == (STAMPS, [], [])


@pytest.mark.parametrize("suffix", [".zstd", ".zst"])
@pytest.mark.parametrize("with_metadata", [True, False])
def test_files_compressed_as_a_whole(tmp_path: Path, suffix: str, with_metadata: bool) -> None:
    folder = _split(tmp_path / "drive")
    for file in folder.glob("*.mcap"):
        file.with_name(file.name + suffix).write_bytes(zstandard.compress(file.read_bytes()))
        file.unlink()
    (folder / "metadata.yaml").unlink()
    if with_metadata:
        _metadata(folder, [f"drive_{k}.mcap{suffix}" for k in range(3)])
    assert _read(folder) == (STAMPS, [], [])


@pytest.mark.parametrize("with_metadata", [True, False])
def test_files_that_lie_beside_their_compressed_copies(tmp_path: Path, with_metadata: bool) -> None:
    folder = _split(tmp_path / "drive")
    for file in folder.glob("*.mcap"):
        file.with_name(file.name + ".zstd").write_bytes(zstandard.compress(file.read_bytes()))
    _metadata(folder, [f"drive_{k}.mcap.zstd" for k in range(3)])
    if not with_metadata:
        (folder / "metadata.yaml").unlink()
    stamps, damage, remarks = _read(folder)
    assert (stamps, damage) == (STAMPS, [])
    assert len(remarks) == 3


def test_files_that_were_unpacked_since(tmp_path: Path) -> None:
    folder = _split(tmp_path / "drive")
    _metadata(folder, [f"drive_{k}.mcap.zstd" for k in range(3)])
    assert _read(folder) == (STAMPS, [], [])


NONE, MESSAGE, FILE, STORAGE = (CompressionMode[name] for name in ("NONE", "MESSAGE", "FILE", "STORAGE"))
MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3


@pytest.mark.parametrize(
    ("storage", "mode"),
    [*((MCAP, mode) for mode in (NONE, MESSAGE, FILE, STORAGE)), *((SQLITE, mode) for mode in (NONE, MESSAGE, FILE))],
)
@pytest.mark.parametrize("with_metadata", [True, False])
def test_bags_of_another_writer(
    tmp_path: Path, storage: StoragePlugin, mode: CompressionMode, with_metadata: bool
) -> None:
    folder = tmp_path / "drive"
    writer = BagWriter(folder, version=9, storage_plugin=storage)
    if mode is not NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/scan", KIND, typestore=get_typestore(Stores.ROS2_HUMBLE))
        for stamp in STAMPS:
            writer.write(connection, stamp, serialized(_scan(stamp))[1])
    if not with_metadata:
        (folder / "metadata.yaml").unlink()
    assert _read(folder) == (STAMPS, [], [])


def test_messages_compressed_one_by_one_in_an_mcap_file(tmp_path: Path) -> None:
    assert _read(_mcap(tmp_path / "log.mcap", STAMPS, zstandard.compress)) == (STAMPS, [], [])


def test_a_compressed_message_that_is_broken_costs_itself(tmp_path: Path) -> None:
    def broken(data: bytes) -> bytes:
        packed = zstandard.compress(data)
        return packed if data != serialized(_scan(STAMPS[5]))[1] else packed[: len(packed) // 2]

    stamps, damage, _ = _read(_mcap(tmp_path / "log.mcap", STAMPS, broken))
    assert stamps == STAMPS[:5] + STAMPS[6:]
    assert "a message was skipped" in damage[0]


def test_a_database_of_compressed_messages_that_is_cut(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/scan", KIND, typestore=get_typestore(Stores.ROS2_HUMBLE))
        for stamp in STAMPS:
            writer.write(connection, stamp, zstandard.compress(serialized(_scan(stamp))[1]))
    (file,) = (tmp_path / "bag").glob("*.db3")
    database = sqlite3.connect(file)
    database.execute("VACUUM")
    database.close()
    cut = tmp_path / "cut.db3"
    cut.write_bytes(file.read_bytes()[:-4096])
    stamps, damage, _ = _read(cut)
    assert set(stamps) < set(STAMPS)
    assert len(stamps) >= COUNT // 2
    assert damage
