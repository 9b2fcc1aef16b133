"""The page in a headless Chromium: request, answer, arming, and a page that hangs or is frozen."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from typing import NamedTuple

import pytest

for _name in ("starlette", "uvicorn", "websockets", "pyotp"):
    pytest.importorskip(_name, reason="the extra console is not installed")

from lhdmap.console.audit import check  # noqa: E402
from lhdmap.console.messages import Ask  # noqa: E402
from lhdmap.console.settings import ConsoleSettings  # noqa: E402

from tests.console.browser import Tab, browser, chromium  # noqa: E402
from tests.console.loader import Loader  # noqa: E402
from tests.console.served import Served, console  # noqa: E402

pytestmark = pytest.mark.skipif(not chromium(), reason="no Chromium is installed: apt-get install chromium")

SETTINGS = ConsoleSettings(latency_limit_s=3.0)  # a busy machine that runs tests is slow, not far away
MARGIN_S = 0.25  # of such a machine; the limit itself holds with a clock that is an input, in test_link.py
ASK = Ask(
    1, "loading", "charging", "time limit <b>15 s</b>", "free the machine", ("charged at 20 s",), (("fill", "0.31"),),
    tuple((0.1 * k, 2.0) for k in range(100)), ((8.0, -2.0), (8.0, 2.0)),
)  # fmt: skip


class Scene(NamedTuple):
    served: Served
    loader: Loader
    tab: Tab


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    """Return an operator's page that has the seat, and a machine that is connected."""
    with (
        console(tmp_path_factory.mktemp("console"), SETTINGS) as served,
        Loader(served.url, served.key, SETTINGS) as loader,
        browser(tmp_path_factory.mktemp("chromium")) as tab,
    ):
        tab.call("Runtime.enable")
        tab.log_in(served.url, "anna", served.code("anna"))
        tab.click("#seat")
        tab.wait("mine()")
        yield Scene(served, loader, tab)


def armed(scene: Scene) -> None:
    if not scene.loader.watchdog.armed:
        scene.tab.click(".machine .rearm")
    scene.loader.wait(armed=True)


def stops(scene: Scene, since_s: float) -> None:
    scene.loader.wait(armed=False, for_s=3.0)
    assert "silent" in scene.loader.watchdog.causes[0]
    assert scene.loader.stopped_s - since_s < SETTINGS.heartbeat_limit_s + MARGIN_S
    assert scene.loader.commands[-1].by == "watch"


def comes_back(scene: Scene) -> None:
    """Wait until the page gives signs of life again: the machine does not arm itself."""
    until = time.monotonic() + 5.0
    while scene.loader.link.fault():
        assert time.monotonic() < until
        time.sleep(0.01)
    time.sleep(0.3)
    assert not scene.loader.watchdog.armed
    scene.tab.wait("document.querySelector('.machine .state').textContent === 'not armed'")


def test_a_request_is_shown_as_text_with_its_evidence_and_answered_once(scene: Scene) -> None:
    scene.loader.request = ASK
    scene.tab.wait("document.querySelector('.machine .request').hidden === false")
    text = scene.tab.run("document.querySelector('.machine .request').innerText")
    assert "time limit <b>15 s</b>" in text
    assert "charged at 20 s" in text
    assert "0.31" in text
    drawn = scene.tab.run(
        "[...document.querySelector('.cloud').getContext('2d').getImageData(0,0,300,300).data].some((v) => v)"
    )
    assert drawn
    scene.tab.click("[data-answer=go_on]")
    scene.tab.wait("document.querySelector('.machine .request').hidden")
    assert [(one.kind, one.number, one.answer, one.by) for one in scene.loader.commands] == [
        ("answer", 1, "go_on", "anna")
    ]
    check(scene.served.audit_path, [scene.loader.commands[0].audit])


def test_a_page_that_hangs_stops_the_machine_which_waits_to_be_armed(scene: Scene) -> None:
    armed(scene)
    since_s = time.monotonic()
    scene.tab.send(
        "Runtime.evaluate", expression="{ const t = performance.now(); while (performance.now() - t < 1500); }"
    )
    stops(scene, since_s)
    comes_back(scene)
    assert "silent" in scene.tab.run("document.querySelector('#alarms').innerText")
    armed(scene)


def test_a_browser_that_is_frozen_stops_the_machine(scene: Scene) -> None:
    armed(scene)
    since_s = time.monotonic()
    scene.tab.freeze(signal.SIGSTOP)
    try:
        stops(scene, since_s)
    finally:
        scene.tab.freeze(signal.SIGCONT)
    comes_back(scene)


def test_a_page_that_nobody_sees_stops_the_machine(scene: Scene) -> None:
    armed(scene)
    since_s = time.monotonic()
    scene.tab.run("Object.defineProperty(document, 'hidden', { value: true, configurable: true })")
    stops(scene, since_s)
    scene.tab.run("delete document.hidden")
    comes_back(scene)


def test_the_stop_button_stops(scene: Scene) -> None:
    armed(scene)
    scene.tab.click(".machine .stop")
    scene.loader.wait(armed=False)
    assert scene.loader.watchdog.causes == ("stopped by anna",)


def test_who_leaves_the_seat_leaves_no_machine_running(scene: Scene) -> None:
    armed(scene)
    since_s = time.monotonic()
    scene.tab.click("#seat")
    stops(scene, since_s)
    scene.tab.wait("document.querySelector('.machine .rearm').disabled")
    scene.tab.click("#seat")
    scene.tab.wait("mine()")
