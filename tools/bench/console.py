"""Measure the console in a headless Chromium: `python -m tools.bench.console [--runs 10] [--screenshot FILE.png]`.

How long until a request is on the screen, until a machine stops after its operator's page hangs or freezes, what a line of the
audit costs. Page and machine are on one computer, so both clocks are one.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import signal
import statistics
import tempfile
import time
from pathlib import Path

from lhdmap.console.audit import Audit
from lhdmap.console.settings import ConsoleSettings
from tests.console.browser import Tab, browser
from tests.console.loader import Loader
from tests.console.served import console
from tests.console.test_browser import ASK

_SETTINGS = ConsoleSettings(latency_limit_s=3.0)
_HANG = "{ const t = performance.now(); window.hungAt = Date.now(); while (performance.now() - t < 1200); }"
_WATCH = """
window.shownAt = 0;
new MutationObserver(() => {
  const box = document.querySelector('.machine .request');
  if (box.hidden) window.shownAt = 0;
  else if (!window.shownAt) requestAnimationFrame(() => { window.shownAt = Date.now(); });
}).observe(document.querySelector('.machine'), { subtree: true, attributes: true, childList: true });
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--screenshot", type=Path)
    arguments = parser.parse_args()
    with contextlib.ExitStack() as open_things:
        folder = Path(open_things.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        served = open_things.enter_context(console(folder / "console", _SETTINGS))
        loader = open_things.enter_context(Loader(served.url, served.key, _SETTINGS))
        tab = open_things.enter_context(browser(folder / "chromium"))
        tab.call("Runtime.enable")
        tab.log_in(served.url, "anna", served.code("anna"))
        tab.click("#seat")
        tab.wait("mine() && document.querySelector('.machine') !== null")
        tab.run(_WATCH)
        _tell("request on the screen, ms", [_visible(loader, tab) for _ in range(arguments.runs)])
        _tell("round trip, ms", [_round_trip(loader) for _ in range(arguments.runs)])
        _tell("stop after the page hangs, ms", [_hangs(loader, tab) for _ in range(arguments.runs)])
        _tell("stop after the browser freezes, ms", [_freezes(loader, tab) for _ in range(arguments.runs)])
        if arguments.screenshot:
            _screenshot(loader, tab, arguments.screenshot)
        audit = Audit(folder / "other.jsonl")
        _tell("line of the audit, ms", [_line(audit) for _ in range(20 * arguments.runs)])
    return 0


def _tell(what: str, values: list[float]) -> None:
    print(f"{what:36} median {statistics.median(values):7.1f}  most {max(values):7.1f}  n {len(values)}")


def _visible(loader: Loader, tab: Tab) -> float:
    loader.request = None
    tab.wait("document.querySelector('.machine .request').hidden && !window.shownAt")
    asked_s = time.time()
    loader.request = ASK
    return float(tab.wait("window.shownAt")) - 1e3 * asked_s


def _round_trip(loader: Loader) -> float:
    time.sleep(0.25)
    return 1e3 * loader.link._watch.round_trip_s  # noqa: SLF001


def _armed(loader: Loader, tab: Tab) -> None:
    loader.request = None
    tab.click(".machine .rearm")
    loader.wait(armed=True)
    time.sleep(0.3)


def _hangs(loader: Loader, tab: Tab) -> float:
    _armed(loader, tab)
    offset_s = time.time() - time.monotonic()
    tab.run(_HANG)
    return 1e3 * (loader.stopped_s + offset_s) - float(tab.run("window.hungAt"))


def _freezes(loader: Loader, tab: Tab) -> float:
    _armed(loader, tab)
    since_s = time.monotonic()
    tab.freeze(signal.SIGSTOP)
    loader.wait(armed=False)
    tab.freeze(signal.SIGCONT)
    return 1e3 * (loader.stopped_s - since_s)


def _screenshot(loader: Loader, tab: Tab, path: Path) -> None:
    loader.request = ASK
    tab.wait("!document.querySelector('.machine .request').hidden")
    path.write_bytes(base64.b64decode(tab.call("Page.captureScreenshot", format="png")["data"]))


def _line(audit: Audit) -> float:
    since_s = time.perf_counter()
    audit.write(since_s, "anna", "command", machine="loader", kind="answer", number=1, answer="go_on")
    return 1e3 * (time.perf_counter() - since_s)


if __name__ == "__main__":
    raise SystemExit(main())
