"""What looks at a run and changes nothing in it: the pile's stage, the Rerun recording, the report."""

from __future__ import annotations

import threading
from pathlib import Path

from lhdmap.config import Settings
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.beside import Here, ProcessBeside
from lhdmap.pipeline.cost import CompileClock, Spent, peak_memory_mib
from lhdmap.pipeline.pile import PileWatch, PlacedScan
from lhdmap.report import charts
from lhdmap.report.data import ReportData
from lhdmap.report.live_recording import add_pose_now
from lhdmap.report.page import write_report
from lhdmap.report.pile_recording import add_pile
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.run_recording import record_run


class Inspection:
    """Takes placed scans while the run goes on, and writes recording and report once it is over.

    `live_port`: where viewers on this machine may follow the recording.
    """

    def __init__(
        self, folder: Path, title: str, start_ns: int, settings: Settings, live_port: int | None = None
    ) -> None:
        self._folder = folder
        self._pile = PileWatch(settings)
        drawn = folder / "recording.rrd"
        # `MapOutcome` warns of it: a helper process is not heard
        self._recording = RecordingWriter(drawn, title, start_ns, settings.recording, warns=False, live_port=live_port)
        self._written = False
        self._compiling = CompileClock().start()
        threading.Thread(target=charts.load, name="charts").start()

    def look(self, scan: PlacedScan) -> None:
        """Show the pile's stage a scan."""
        self._pile.update(scan)

    def pile(self) -> PileReport:
        """Return what the stage says of the pile."""
        return self._pile.report()

    def record(self, stamp_ns: int, points_map: FloatArray, name: str) -> None:
        """Record an integrated sweep, points (N, 3) in map."""
        self._recording.add_scan(stamp_ns, points_map, name)

    def place(self, stamp_ns: int, pose: FloatArray) -> None:
        """Show those who follow where the machine is: x, y, z (m), roll, pitch, heading (rad)."""
        add_pose_now(self._recording, stamp_ns, pose)

    def write(self, data: ReportData, machine: Machine) -> None:
        """Complete the recording and write the report."""
        record_run(self._recording, data, machine)
        if data.pile is not None:
            add_pile(self._recording, data.pile, said=data.warnings)
        self._recording.close()
        self._written = True
        write_report(data, self._folder / "report.html")

    def spent(self) -> Spent:
        """Return what the process has needed."""
        return Spent(peak_memory_mib(), self._compiling.seconds)

    def close(self) -> None:
        """Close the recording; what was recorded before an interruption is kept."""
        self._compiling.stop()
        if not self._written:
            self._recording.close()


Inspector = Here[Inspection] | ProcessBeside[Inspection]


class PileBeside:
    """The pile's stage of an inspection, as the mapping pipeline takes it."""

    def __init__(self, inspector: Inspector) -> None:
        self._inspector = inspector

    @property
    def apart(self) -> bool:
        """Whether it works in a process of its own, which one other thread may ask."""
        return isinstance(self._inspector, ProcessBeside)

    def update(self, scan: PlacedScan) -> None:
        """Show it a scan."""
        self._inspector.tell(Inspection.look, scan)

    def report(self) -> PileReport:
        """Return what it says of the pile."""
        return self._inspector.ask(Inspection.pile)
