from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet, read_sheets, write_sheets


def test_sheets_are_read_back(tmp_path: Path) -> None:
    cells = np.zeros((4, 6), np.uint8)
    cells[1, 2], cells[3, 5] = FREE, OCCUPIED
    sheets = [Sheet(cells, np.array([-1.0, 2.0]), 0.5, 3.0, (2.5, 3.5)), Sheet(cells.T.copy(), np.zeros(2), 0.2)]
    again = read_sheets(write_sheets(tmp_path / "free_space.npz", sheets))
    assert [one.cell_m for one in again] == [0.5, 0.2]
    np.testing.assert_array_equal(again[0].cells, cells)
    np.testing.assert_array_equal(again[0].at(np.array([[0.1, 2.6]])), [[1, 2]])
    np.testing.assert_allclose(again[0].middles_m(np.array([[1, 2]])), [[0.25, 2.75]])


def test_what_is_no_such_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        read_sheets(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no")
    with pytest.raises(InputError):
        read_sheets(tmp_path / "text.npz")
