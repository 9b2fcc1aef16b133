"""Names of files as a person reads them: of any bytes, of `.`, and for libraries that take UTF-8 alone."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_SURROGATE = re.compile("[\ud800-\udfff]")  # what Python makes of bytes that are not UTF-8


def shown(text: object) -> str:
    r"""Return a path, or a text with one in it, so that it can be written anywhere; bytes that are not UTF-8 as `\xfc`."""
    return _SURROGATE.sub(_escaped, str(text))


def name_of(path: Path) -> str:
    """Return the name of a file or folder, also of `.` and `..`, which stand for one."""
    return path.name if path.name not in ("", "..") else path.resolve().name


def beside(path: Path, what: str) -> Path:
    """Return the default place of a result: `drive.mcap` gives `drive_WHAT` in the same folder, `.` is beside itself."""
    whole = path.absolute() if path.name not in ("", "..") else path.resolve()
    stem = whole.name[:1] + whole.name[1:].partition(".")[0]
    return whole.parent / f"{stem}_{what}"


@contextmanager
def in_utf8(path: Path) -> Iterator[Path]:
    """Give a path to the same file, which need not exist yet, for programs that take paths in UTF-8 alone (Rerun).

    It begins with no dash and holds to the end of the `with` statement.
    """
    if shown(path) == str(path):
        yield path.absolute()
        return
    with tempfile.TemporaryDirectory(prefix="lhdmap-") as folder:
        link = Path(folder) / f"file{shown(path.suffix)}"
        link.symlink_to(path.absolute())
        yield link


def _escaped(found: re.Match[str]) -> str:
    code = ord(found.group())
    return f"\\x{code - 0xDC00:02x}" if 0xDC80 <= code <= 0xDCFF else f"\\u{code:04x}"
