"""The first lines of the program: from here on Ctrl-C ends it with exit code 4, also while the rest is being loaded."""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # what `signal` is made of: there at once
import os
import sys

EARLY = '{"error": {"kind": "interrupted", "message": "interrupted", "exit_code": 4}}\n'


def entry_point() -> None:
    """Console script: `main` with the process's exit code."""
    _signal.signal(_signal.SIGINT, _end_early)
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # libraries' thread pools wait for each other: one each
        os.environ.setdefault(threads, "1")
    import gc

    from lhdmap.cli import interrupt
    from lhdmap.cli.main import main

    interrupt.take_over()
    gc.set_threshold(100_000, 20, 20)  # the libraries' hundreds of thousands of lasting objects are walked less often
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="surrogateescape")  # names of files that are no text come out as they went in
    _leave(main())


def _end_early(_number: int, _frame: object) -> None:
    os.write(2, b"lhdmap: interrupted\n")
    if "--json" in sys.argv:
        os.write(1, EARLY.encode())
    os._exit(4)


def _leave(exit_code: int) -> None:
    """End with a code, without taking the libraries down in order: that would take as long as a small command."""
    _signal.signal(_signal.SIGINT, _signal.SIG_IGN)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        pass
    except OSError as error:
        if exit_code == 0:  # told already otherwise
            os.write(2, f"lhdmap: standard output: {error.strerror}\n".encode())
            exit_code = 3
    sys.stderr.flush()
    os._exit(exit_code)
