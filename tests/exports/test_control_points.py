from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.exports.control_points import read_control_points

from tests.topology.maps import ladder


def read(tmp_path: Path, text: str, name: str = "points.csv") -> list[tuple[str, list[float], list[float], float]]:
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return [(p.name, p.map_m.tolist(), p.grid_m.tolist(), p.std_m) for p in read_control_points(file, ladder())]


WANTED = [("A", [1.0, 2.0, 3.0], [700000.125, 9000000.25, -400.5], 0.03)]


@pytest.mark.parametrize(
    "text",
    [
        "name,x,y,z,E,N,Z\nA,1,2,3,700000.125,9000000.25,-400.5\n",
        "# from the survey\n\nname, x, y, z, E, N, Z\n\n A , 1, 2, 3, 700000.125, 9000000.25, -400.5\n",
        "name;map_x_m;map_y_m;map_z_m;grid_E_m;grid_N_m;grid_Z_m\nA;1;2;3;700000.125;9000000.25;-400.5\n",
        "Name,Easting,Northing,Elevation,map x,map y,map z\nA,700000.125,9000000.25,-400.5,1,2,3\n",
        "\ufeffname\tx\ty\tz\tE\tN\tZ\tstd_m\nA\t1\t2\t3\t700000.125\t9000000.25\t-400.5\t\n",
    ],
)
def test_columns_by_their_names(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text) == WANTED


def test_a_toml_file(tmp_path: Path) -> None:
    text = """
    [[control_point]]
    name = "A"
    map_m = [1, 2, 3]
    grid_m = [700000.125, 9000000.25, -400.5]
    [[control_point]]
    name = "mark at the draw point"
    at = "DP1"
    grid_m = [1.0, 2.0, 3.0]
    std_m = 0.01
    """
    first, second = read(tmp_path, text, "points.toml")
    assert first == WANTED[0]
    assert second[1] == pytest.approx([0.0, -26.0, 0.0])
    assert second[3] == 0.01


def test_places_of_the_map_by_name(tmp_path: Path) -> None:
    dp, ap, given = read(tmp_path, "name,x,y,z,E,N,Z\nDP1,,,,1,2,3\ni1.t1,,,,1,2,3\nQ,4,5,6,1,2,3\n")
    np.testing.assert_allclose([dp[1], ap[1], given[1]], [[0.0, -26.0, 0.0], [6.0, 0.0, 0.0], [4.0, 5.0, 6.0]])
    assert read(tmp_path, "name,E,N,Z\nDP1,1,2,3\n")[0] == dp
    assert read(tmp_path, "name,at,E,N,Z\nmark 7,DP1,1,2,3\n")[0][:2] == ("mark 7", dp[1])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "empty"),
        ("A,1,2,3,4,5,6\n", "name, x, y, z, E, N, Z were wanted"),
        ("name,x,y,z,E,N\nA,1,2,3,4,5\n", "name, x, y, z, E, N, Z were wanted"),
        ("name,x,y,z,E,N,Z\nA,1,2,3,4,5\n", "line 2: Z is ''"),
        ("name,x,y,z,E,N,Z\nA,1,2,3,4,5,nan\n", "line 2: Z is 'nan'"),
        ("name,x,y,z,E,N,Z\n\nA,1,2,far,4,5,6\n", "line 3: z is 'far'"),
        ("name,x,y,z,E,N,Z\nA,1,,3,4,5,6\n", "y is ''"),
        ("name,x,y,z,E,N,Z\n,1,2,3,4,5,6\n", "has no name"),
        ("name,x,y,z,E,N,Z\nA,1,2,3,4,5,6\nA,1,2,3,4,5,6\n", "A is there twice"),
        ("name,E,N,Z\nDP2,4,5,6\n", "DP2 is not on the map.*did you mean 'DP1'"),
        ("name,E,N,Z\nT1,4,5,6\n", "T1 is no point but a node"),
        ("name,x,y,z,E,N,Z,std_m\nA,1,2,3,4,5,6,0\n", "std_m 0; more than 0"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[[control_point]]\nname = 'A'\nmap_m = [1, 2]\n", "three numbers"),
        ("[[control_point]]\nname = 'A'\nmap_mm = [1, 2, 3]\n", "unknown setting 'map_mm'; did you mean 'map_m'"),
        ("[[control_point]]\nname = 'A'\nmap_m = [1, 2, 3]\ngrid_m = [1, true, 3]\n", "N is True"),
        ("control_point = 3\n", "control_point"),
        ("[[control_point\n", "not a readable"),
    ],
)
def test_toml_mistakes(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        read(tmp_path, text, "points.toml")


def test_a_missing_file_and_bytes_that_are_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="none"):
        read_control_points(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"b\.csv"):
        read_control_points(tmp_path / "b.csv")
    (tmp_path / "n.csv").write_text("name,E,N,Z\nDP1,1,2,3\n")
    with pytest.raises(InputError, match="no places"):
        read_control_points(tmp_path / "n.csv")
