"""Places that results go to: nothing that is there is written over unless that is asked for, and then only at the end.

A folder grows as `NAME.partial`, files as `partial.NAME`; they get their names when all is complete. Until then what
was there stays whole.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import warnings
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from lhdmap.descriptions import described
from lhdmap.errors import InputError, LhdmapWarning, UsageError, mark_kept
from lhdmap.interrupts import before_interrupt, undisturbed

PARTIAL_SUFFIX = ".partial"
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
MARK = ".lhdmap"  # in a folder that grows: whose it is; locked as long as its run goes on


def free_folder(target: Path, *, force: bool = False, inputs: Sequence[Path] = ()) -> None:
    """Refuse a folder that must not be made or replaced; to be called before the work.

    Raises:
        UsageError: the target is no name, is there already without `force`, was not made by lhdmap, or holds an input.
    """
    if target.name in ("", ".."):
        raise UsageError(f"-o {target}: the name of a folder to make was wanted")
    _spare(inputs, target, target.with_name(target.name + PARTIAL_SUFFIX))
    if not os.path.lexists(target):
        return
    if not force:
        raise UsageError(f"{target}: is there already; -o OTHER makes another folder, --force replaces this one")
    if target.is_symlink() or not target.is_dir():
        raise UsageError(
            f"{target}: is {_kind(target)}, --force replaces folders of lhdmap only; take another name, -o OTHER"
        )
    if described(target) is None and any(target.iterdir()):
        raise UsageError(
            f"{target}: was not made by lhdmap (no map.json or run.json of it), --force does not replace it; -o OTHER"
        )


def free_files(paths: Sequence[Path], *, force: bool = False, inputs: Sequence[Path] = ()) -> None:
    """Refuse files that must not be written; to be called before the work.

    Raises:
        UsageError: one is there already without `force`, is no ordinary file, or is an input.
    """
    for path in paths:
        if not os.path.lexists(path):
            continue
        if path.is_symlink() or not path.is_file():
            raise UsageError(f"{path}: is {_kind(path)}, a new file was wanted; take another name")
        if any(one.exists() and path.samefile(one) for one in inputs):
            raise UsageError(f"{path}: is the input itself; take another name")
        if not force:
            raise UsageError(f"{path}: exists already; another name is wanted, or --force to replace it")


def _spare(inputs: Sequence[Path], *doomed: Path) -> None:
    """Refuse to replace a folder that holds an input, or where the user is."""
    for folder in (one.resolve() for one in doomed if one.is_dir()):
        inside = [path for path in (*inputs, Path.cwd()) if path.resolve().is_relative_to(folder)]
        if inside:
            raise UsageError(f"{folder}: would be replaced, and {inside[0]} is in it; take another name, -o OTHER")


def _kind(path: Path) -> str:
    if path.is_symlink():
        return "a link"
    return "a folder" if path.is_dir() else "a file" if path.is_file() else "no ordinary file"


class OutputFolder:
    """A context manager: the folder grows at `path`, and gets its name with `complete`.

    Left without that, it keeps the partial name if something in it is `finished`, and is removed otherwise. A partial folder
    that an interrupted run has left is replaced, or gone on with where it is to be `resumed`.

    Raises:
        UsageError: `free_folder` refuses it, or another run is making it at this moment.
        InputError: it cannot be made.
    """

    def __init__(
        self, target: Path, *, force: bool = False, inputs: Sequence[Path] = (), resumed: bool = False
    ) -> None:
        free_folder(target, force=force, inputs=inputs)
        self.target, self.path = target, target.with_name(target.name + PARTIAL_SUFFIX)
        self.finished: list[str] = []
        self._force, self._inputs = force, inputs
        self._mine = False
        self._end = contextlib.ExitStack()
        self._end.enter_context(before_interrupt(self._leave))
        try:
            self._begin(resumed=resumed)
        except BaseException:
            self._end.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Keep what is finished, and say so on the error."""
        self._end.close()
        kept = self._leave()
        if kept is not None and error is not None:
            mark_kept(error, kept)
        _name_place(error, self.path)

    def complete(self) -> Path:
        """Give the folder its name and return it; what it replaces is removed then, and not before.

        Raises:
            UsageError: the name was taken meanwhile.
            InputError: the folder cannot be renamed.
        """
        self.finished.append("all of it")
        free_folder(self.target, force=self._force, inputs=self._inputs)
        old = self.target.with_name(f"{self.target.name}.replaced-{os.getpid()}")
        try:
            with undisturbed():
                (self.path / MARK).unlink(missing_ok=True)
                replaces = self.target.is_dir()
                if replaces:
                    self.target.rename(old)
                self._rename(old if replaces else None)
                self._mine = False
                if replaces:
                    shutil.rmtree(old, ignore_errors=True)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be renamed to {self.target.name}: {error.strerror}") from error
        return self.target

    def _rename(self, old: Path | None) -> None:
        try:
            self.path.rename(self.target)
        except OSError:
            if old is not None:
                old.rename(self.target)
            raise

    def _begin(self, *, resumed: bool) -> None:
        """Make the folder, mark it as that of a run that goes on."""
        try:
            if self.path.is_dir() and not self.path.is_symlink():
                self._take_over(resumed=resumed)
            self.path.mkdir(parents=True, exist_ok=resumed)
            lock = self._end.enter_context((self.path / MARK).open("w", encoding="ascii"))
        except OSError as error:
            raise InputError(f"{self.path}: the output folder cannot be made: {error.strerror}") from error
        if not locked(lock.fileno()):
            raise UsageError(f"{self.path}: another run is writing it; wait for that one, or -o OTHER")
        self._mine = True

    def _take_over(self, *, resumed: bool) -> None:
        """Remove the partial folder of a run that was interrupted; raises UsageError where it may be something else."""
        mark = self.path / MARK
        if any(self.path.iterdir()):
            if not mark.is_file():
                raise UsageError(f"{self.path}: is in the way and may not be lhdmap's; move it away, or -o OTHER")
            with mark.open("a", encoding="ascii") as lock:
                if not locked(lock.fileno()):
                    raise UsageError(f"{self.path}: another run is writing it; wait for that one, or -o OTHER")
            verb = "gone on with" if resumed else "replaced"
            warnings.warn(f"{self.path}, left over from an interrupted run, is {verb}", LhdmapWarning, stacklevel=5)
        if resumed:
            self.finished.append("all that is there")
        else:
            shutil.rmtree(self.path)

    def _leave(self) -> Path | None:
        """Return the partial folder, if something in it is finished; remove it otherwise."""
        if not self._mine:
            return None
        if self.finished:
            return self.path
        shutil.rmtree(self.path, ignore_errors=True)
        return None


def _name_place(error: BaseException | None, path: Path) -> None:
    """Say on an error that the disk is full which one: the operating system names no file where writing to an open one fails."""
    if isinstance(error, OSError) and error.filename is None and error.errno in _FULL:
        error.filename = str(path)


def locked(descriptor: int) -> bool:
    """Take the lock of an open file and return whether it was free, or there is no such thing here.

    It is given back with the file, by a crash too.
    """
    try:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):  # some network drives have no locks
        return True
    return True


class OutputFiles:
    """A context manager: files that are written at `at(path)` and get their names together, the last one last.

    Left by an error, none of them is there.

    Raises:
        UsageError: `free_files` refuses one.
    """

    def __init__(self, *paths: Path | None, force: bool = False, inputs: Sequence[Path] = ()) -> None:
        self._paths = [path for path in paths if path is not None]
        free_files(self._paths[::-1], force=force, inputs=inputs)
        self._end = contextlib.ExitStack()

    def at(self, path: Path) -> Path:
        """Return where the file is to be written."""
        return path.with_name(f"partial.{path.name}")

    def __enter__(self) -> Self:
        """Make the folders that the files go to; raises InputError where that fails."""
        for folder in {path.parent for path in self._paths}:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                reason = "is a file" if isinstance(error, FileExistsError) else error.strerror
                raise InputError(f"{folder}: the output folder cannot be made: {reason}") from error
        self._drop()  # what a run that was killed has left
        self._end.enter_context(before_interrupt(self._drop))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Name the files, or remove them."""
        self._end.close()
        if kind is not None:
            self._drop()
            _name_place(error, self._paths[-1])
            return
        with undisturbed():
            for path in self._paths:
                self.at(path).replace(path)

    def _drop(self) -> None:
        for path in map(self.at, self._paths):
            for left in (path, path.with_name(path.name + PARTIAL_SUFFIX)):
                left.unlink(missing_ok=True)
