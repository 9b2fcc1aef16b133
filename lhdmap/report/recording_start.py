"""How a recording begins: Rerun loaded, the stream into the file, and a server for viewers on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lhdmap.names import in_utf8, shown
from lhdmap.report.recording_end import rerun

APPLICATION = "lhdmap"
LOOPBACK, _LIVE_MEMORY = "127.0.0.1", "64MB"


def open_recording(path: Path, title: str, start_ns: int, live_port: int | None) -> tuple[Any, Any]:
    """Return the module of Rerun, and a stream into the file; what goes wrong is told by `close`, in our words."""
    rr = rerun()
    title = shown(title)
    stream = rr.RecordingStream(APPLICATION, recording_id=f"{title} {start_ns}")
    with in_utf8(path) as written:  # it is open from here on
        if live_port is None:
            stream.save(written)
        else:  # never a connection to a viewer: a slow one would hold up the run
            server = rr.GrpcServerSink(bind_ip=LOOPBACK, port=live_port, server_memory_limit=_LIVE_MEMORY)
            stream.set_sinks(rr.FileSink(written), server)
    stream.send_recording_name(title)
    stream.log("map", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    return rr, stream
