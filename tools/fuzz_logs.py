"""Mutated logs against the readers: no crash, no hang, no memory blow-up, no error other than InputError.

    python -m tools.fuzz_logs --count 10000

writes one small log of each format, changes it at random (bytes flipped, overwritten, inserted, deleted, repeated,
cut), reads each copy, and reports what went wrong. Each input has a time limit, the process a memory limit.
"""

from __future__ import annotations

import argparse
import random
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import zstandard
from lhdmap.errors import InputError
from lhdmap.logs import open_log
from lhdmap.logs.doctor.health import examine
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as BagWriter
from tests.logs.small_logs import compressed, write_bag, write_breezy, write_carmen, write_db3, write_mcap

SECONDS_PER_INPUT = 10.0
MEMORY_BYTES = 2 << 30


Seed = Callable[[Path, int], Path]
SEEDS: dict[str, Seed] = {
    "mcap-zstd": lambda folder, count: write_mcap(folder / "zstd.mcap", count, CompressionType.ZSTD),
    "mcap-lz4": lambda folder, count: write_mcap(folder / "lz4.mcap", count, CompressionType.LZ4),
    "mcap-none": lambda folder, count: write_mcap(folder / "none.mcap", count, CompressionType.NONE),
    "mcap-unchunked": lambda folder, count: write_mcap(
        folder / "flat.mcap", count, CompressionType.NONE, chunked=False
    ),
    "mcap-messages": lambda folder, count: write_mcap(
        folder / "packed.mcap", count, CompressionType.NONE, packed=zstandard.compress
    ),
    "mcap-file": lambda folder, count: compressed(write_mcap(folder / "file.mcap", count, CompressionType.NONE)),
    "bag-none": lambda folder, count: write_bag(folder / "none.bag", count, None),
    "bag-lz4": lambda folder, count: write_bag(folder / "lz4.bag", count, BagWriter.CompressionFormat.LZ4),
    "bag-bz2": lambda folder, count: write_bag(folder / "bz2.bag", count, BagWriter.CompressionFormat.BZ2),
    "db3": lambda folder, count: write_db3(folder / "bag2", count),
    "carmen": lambda folder, count: write_carmen(folder / "drive.clf", count),
    "breezy": lambda folder, count: write_breezy(folder / "drive.dat", count),
}


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return a copy with one to six random changes."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 3, 6))):
        at, size = rng.randrange(len(out)), min(rng.choice((1, 2, 4, 8, 64, 1000)), len(out) // 4)
        kind = rng.randrange(7)
        if kind == 0:
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[at : at + size] = rng.randbytes(len(out[at : at + size]))
        elif kind == 2:
            out[at : at + size] = rng.choice((b"\0", b"\xff", b"\x7f")) * len(out[at : at + size])
        elif kind == 3:
            out[at:at] = rng.randbytes(size)
        elif kind == 4:
            del out[at : at + size]
        elif kind == 5:
            out[at:at] = out[at : at + 8 * size]
        else:
            del out[max(at, 64) :]
    return bytes(out)


def read_all(path: Path) -> int:
    """Examine a log, and read it; returns the number of messages, -1 where it is refused with an InputError."""
    examine(path)
    try:
        with open_log(path) as reader:
            reader.topics()
            return sum(1 for _ in reader.records())
    except InputError:
        return -1


def main() -> int:
    """Run the fuzz and return 1 where anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000, help="inputs of all formats together")
    parser.add_argument("--messages", type=int, default=60, help="scans in the log that is mutated")
    parser.add_argument("--seed", type=int, default=1, help="start of the random numbers")
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGALRM, _too_slow)
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        return _fuzz(Path(folder), arguments.count, arguments.messages, arguments.seed)


def _fuzz(folder: Path, count: int, messages: int, seed: int) -> int:
    failures = 0
    for number, (name, write) in enumerate(SEEDS.items()):
        path = write(folder, messages)
        whole, data = read_all(path), path.read_bytes()
        share = count // len(SEEDS) + (number < count % len(SEEDS))
        delivered, refused, slowest, failed = _fuzz_one(path, data, share, seed)
        failures += failed
        print(
            f"{name:15} {share} inputs of {len(data)} bytes: {failed} failures, {refused} refused, "
            f"{100 * delivered / max(whole * share, 1):.0f} % of the messages delivered, slowest {slowest:.2f} s"
        )
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak_mib:.0f} MiB, {failures} failures")
    return 1 if failures else 0


def _fuzz_one(path: Path, data: bytes, count: int, seed: int) -> tuple[int, int, float, int]:
    target = path.with_name("mutated" + "".join(path.suffixes))
    delivered = refused = failed = 0
    slowest = 0.0
    for number in range(count):
        rng = random.Random(f"{path.name} {seed} {number}")  # noqa: S311  # to repeat one input, not a secret
        target.write_bytes(mutated(data, rng))
        begin = time.monotonic()
        signal.setitimer(signal.ITIMER_REAL, SECONDS_PER_INPUT)
        try:
            got = read_all(target)
        except Exception as error:  # noqa: BLE001  # finding these is what the tool is for
            failed += 1
            print(f"FAILED {path.name} seed {seed} number {number}: {type(error).__name__}: {error}", file=sys.stderr)
            continue
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        slowest = max(slowest, time.monotonic() - begin)
        refused += got < 0
        delivered += max(got, 0)
    return delivered, refused, slowest, failed


def _too_slow(_number: int, _frame: FrameType | None) -> None:
    raise TimeoutError(f"longer than {SECONDS_PER_INPUT} s")


if __name__ == "__main__":
    sys.exit(main())
