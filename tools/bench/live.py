"""Two scanners of 761 beams at 50 Hz, live: what is lost, how late poses are, what memory it takes.

    python -m tools.bench.live zenoh|mcap [--seconds 300] [--cuts 30] [-o FILE.json]

A process of its own plays a simulated drive of 40 m forwards and backwards with stamps of now, over zenoh on this machine or
into an MCAP file that is flushed at each message; `lhdmap live` follows it in another. `--cuts N`: the link is cut for 2 s each
N seconds: over zenoh what is sent meanwhile is gone, the file (as on a share that hangs) gets it afterwards. `--again`: the log is
mapped once more by `build-map`, and the map compared with the live one.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from lhdmap.live.zenoh_keys import dds_type
from lhdmap.logs.formats import open_log
from lhdmap.roles import SCAN
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings
from tests.live.peers import GrowingLog, Sent, messages_of

SCENARIO = DriftScenario(
    seed=3,
    truth=False,
    drift=DriftSettings(pieces=((22.0, 0.0, -4.0), (16.0, 12.0, 0.0), (24.0, 0.0, 3.0)), mesh_m=0.08),
    drive=DriveSettings(distance_m=40.0, speed_kmh=10.0, standstill_s=1.0),
    scanner=ScannerSettings(beams=761, rate_hz=50.0, sweep=True),
)
_NOT_BACKWARDS = ("tachometer", "odom")  # played backwards they would say the wrong direction
_FIXED = "tf2_msgs/msg/TFMessage"
_PORT, _CUT_S = 17448, 2.0
_SCANS = "/lidar/"
_COMPARED = (".tum", ".parquet", ".laz", ".ply", ".csv")


def played(log: Path, seconds: float, begin: Callable[[], None] = lambda: None) -> Iterator[Sent]:
    """Yield the drive's messages forwards and backwards at their pace, with stamps of now; `begin` is called before the first."""
    messages = messages_of(log)
    begin()
    yield from (one._replace(log_time_ns=time.time_ns()) for one in messages if one.type_name == _FIXED)
    moving = [one for one in messages if one.type_name != _FIXED and not any(w in one.topic for w in _NOT_BACKWARDS)]
    began_ns, ahead_ns = time.time_ns(), 0
    while True:
        for before, one in zip([None, *moving[:-1]], moving, strict=True):
            ahead_ns += 0 if before is None else abs(one.log_time_ns - before.log_time_ns)
            if ahead_ns > seconds * 1e9:
                return
            time.sleep(max((began_ns + ahead_ns - time.time_ns()) * 1e-9, 0.0))
            yield stamped(one, time.time_ns())
        moving.reverse()


def stamped(message: Sent, now_ns: int) -> Sent:
    """Return a message with another header stamp and log time."""
    stamp = np.array(divmod(now_ns, 1_000_000_000), "<u4").tobytes()
    return message._replace(log_time_ns=now_ns, data=message.data[:4] + stamp + message.data[12:])


def send_file(log: Path, target: Path, seconds: float, cuts_s: float, result: Any) -> None:
    """Write the drive into a growing file; while the link is cut, what is to be written waits."""
    sent, grown, waiting = Counter[str](), GrowingLog(target), list[Sent]()
    cuts, next_cut_s, back_s = 0, time.monotonic() + (cuts_s or np.inf), 0.0
    for message in played(log, seconds):
        now_s = time.monotonic()
        if now_s > next_cut_s:
            cuts, next_cut_s, back_s = cuts + 1, now_s + cuts_s, now_s + _CUT_S
        waiting.append(message)
        sent[message.topic] += 1
        if now_s > back_s:
            for one in waiting:
                grown.write(one)
            waiting.clear()
    for one in waiting:
        grown.write(one)
    grown.finish()
    result.put((dict(sent), dict(sent), cuts))


def send_zenoh(log: Path, _target: Path, seconds: float, cuts_s: float, result: Any) -> None:
    """Publish the drive as rmw_zenoh would; while the link is cut it goes on, and nobody hears it."""
    import zenoh

    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{_PORT}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    sent, linked, cuts, heard = Counter[str](), Counter[str](), 0, _Session(config)
    next_cut_s, back_s = time.monotonic() + (cuts_s or np.inf), 0.0
    for message in played(log, seconds, heard.opened):
        now_s = time.monotonic()
        if now_s > next_cut_s:
            heard.close()
            cuts, next_cut_s, back_s = cuts + 1, now_s + cuts_s, now_s + _CUT_S
        if not heard.open and now_s > back_s:
            heard.opened()
        sent[message.topic] += 1
        if heard.open:
            heard.put(message, sent[message.topic])
            linked[message.topic] += 1
    time.sleep(0.5)
    heard.close()
    result.put((dict(sent), dict(linked), cuts))


class _Session:
    """A session of zenoh with its publishers; mounts are kept for those who come late, as rmw_zenoh does."""

    def __init__(self, config: Any) -> None:
        self._config = config
        self._session: Any = None
        self._publishers: dict[str, Any] = {}
        self._mounts: list[Sent] = []

    @property
    def open(self) -> bool:
        return self._session is not None

    def opened(self) -> None:
        """Open it, and wait until somebody listens to scans."""
        import zenoh

        self._session = zenoh.open(self._config)
        waited = self._session.declare_publisher(f"0/waited/{dds_type(SCAN)}/RIHS01_0")
        while not waited.matching_status.matching:
            time.sleep(0.02)
        for message in self._mounts:
            self.put(message, 1)

    def close(self) -> None:
        if self._session is not None:
            self._session.close()
        self._session, self._publishers = None, {}

    def put(self, message: Sent, number: int) -> None:
        """Publish a message; where the network is behind, wait: by default zenoh drops what a burst has too much, unheard."""
        import zenoh
        from zenoh import ext

        fixed, topic = message.type_name == _FIXED, message.topic
        if topic not in self._publishers:
            cache = ext.CacheConfig(10)
            self._publishers[topic] = (
                ext.declare_advanced_publisher(self._session, _key(message), cache=cache, publisher_detection=True)
                if fixed
                else self._session.declare_publisher(_key(message), congestion_control=zenoh.CongestionControl.BLOCK)
            )
        if fixed and message not in self._mounts:
            self._mounts.append(message)
        count = (ext.Int64(number), ext.Int64(message.log_time_ns), b"0123456789abcdef")
        self._publishers[topic].put(message.data, attachment=ext.z_serialize(count))


def _key(message: Sent) -> str:
    return f"0{message.topic}/{dds_type(message.type_name)}/RIHS01_0"


def watch_memory(process: int, every_s: float, until: threading.Event, found: list[float]) -> None:
    """Note the resident memory (MiB) of a process over time."""
    while not until.wait(every_s):
        try:
            words = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()
        except OSError:
            return
        found.append(int(words[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20)


def run(how: str, seconds: float, cuts_s: float, work: Path, *, again: bool = False) -> dict[str, Any]:
    """Run sender and `lhdmap live`; return the figures."""
    log = simulate_drift(SCENARIO, work / "drive.mcap").log
    context = multiprocessing.get_context("spawn")
    result = context.Queue()
    send, target = (send_zenoh, work / "grows.mcap") if how == "zenoh" else (send_file, work / "grows.mcap")
    source = f"zenoh:tcp/127.0.0.1:{_PORT}" if how == "zenoh" else str(target)
    command = [sys.executable, "-m", "lhdmap", "live", source, "-o", str(work / "run"), "--json"]
    command += ["--for", str(seconds + 15.0)] if how == "zenoh" else ["--quiet-end", "20"]
    with (work / "out.json").open("w") as out, (work / "said").open("w") as said:
        follower = subprocess.Popen(command, stdout=out, stderr=said)
        while "followed from now on" not in (work / "said").read_text() and follower.poll() is None:
            time.sleep(0.2)
        sender = context.Process(target=send, args=(log, target, seconds, cuts_s, result))
        sender.start()
        over, memory = threading.Event(), list[float]()
        watch = threading.Thread(target=watch_memory, args=(follower.pid, 10.0, over, memory))
        watch.start()
        sent, linked, cuts = result.get(timeout=seconds + 120.0)
        sender.join(20.0)
        stream_ended, load = len(memory), os.getloadavg()
        follower.wait(3600.0)
        over.set()
        watch.join()
    told = json.loads((work / "out.json").read_text())
    figures = _figures(told, sent, linked, work / "run" / "log.mcap")
    if again and "failed" not in figures:
        figures["unlike_build_map"] = unlike(work / "run" / "map", mapped(work / "run" / "log.mcap", work / "again"))
    return {"how": how, "seconds": seconds, "cuts": cuts, **figures} | {
        "memory_mib_each_10_s": [round(value) for value in memory[: stream_ended + 1]],
        "load_average_of_the_stream": load,
    }


def mapped(log: Path, target: Path) -> Path:
    """Build the map of the log as anybody would."""
    subprocess.run([sys.executable, "-m", "lhdmap", "build-map", str(log), "-o", str(target)], check=True)
    return target


def unlike(one: Path, other: Path) -> list[str]:
    """Return the names of the files of two map folders whose bytes or rows differ; JSON and reports hold paths and times."""
    names = {path.name for folder in (one, other) for path in folder.iterdir() if path.suffix in _COMPARED}
    return sorted(name for name in names if not _same(one / name, other / name))


def _same(one: Path, other: Path) -> bool:
    if not (one.exists() and other.exists()):
        return False
    if one.suffix != ".parquet":
        return one.read_bytes() == other.read_bytes()
    tables = [pq.read_table(path).to_pandas() for path in (one, other)]
    return bool(tables[0].equals(tables[1]))  # where both have no value they are alike


def _figures(told: dict[str, Any], sent: dict[str, int], linked: dict[str, int], log: Path) -> dict[str, Any]:
    if "stream" not in told:
        return {"failed": told}
    with open_log(log) as reader:
        counts = {name: info.count or 0 for name, info in reader.topics().items()}
    scans = {topic: sent[topic] for topic in sent if topic.startswith(_SCANS)}
    kept = ("scans", "distance_m", "degenerate_share", "lost_stretches", "peak_memory_mib")
    return {
        "scans_sent": sum(scans.values()),
        "scans_sent_while_linked": sum(linked[topic] for topic in scans),
        "scans_lost": sum(linked[topic] - counts.get(topic, 0) for topic in scans),
        "stream": told["stream"],
        **{key: told[key] for key in kept},
        "warnings": told["warnings"][-6:],
    }


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("how", choices=("zenoh", "mcap"))
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--cuts", type=float, default=0.0, metavar="SECONDS", help="cut the link so often")
    parser.add_argument("--again", action="store_true", help="compare with build-map of the log")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        found = run(arguments.how, arguments.seconds, arguments.cuts, Path(folder), again=arguments.again)
    text = json.dumps(found, indent=1)
    if arguments.output is not None:
        arguments.output.write_text(text + "\n", encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
