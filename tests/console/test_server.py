"""The console over its sockets: who gets in, who operates, what reaches a machine, and what an attacker gets."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

for _name in ("starlette", "uvicorn", "websockets", "pyotp"):
    pytest.importorskip(_name, reason="the extra console is not installed")

from lhdmap.console.audit import check  # noqa: E402
from lhdmap.console.messages import Ask, Asked, Event, Outcome, Status, Tick  # noqa: E402
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402

from tests.console.served import Page, Served, console  # noqa: E402

ASK = Ask(3, "loading", "charging", "time limit", "free it", cloud_m=((1.0, 2.0),))


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with console(tmp_path_factory.mktemp("console")) as one:
        yield one


@pytest.fixture
def anna(served: Served) -> Iterator[Page]:
    """Return a page that has the seat."""
    page = served.page(served.log_in("anna"))
    assert page.sit() == 204
    yield page
    page.sit(take=False)
    page.socket.close()


def test_a_request_is_shown_and_its_answer_reaches_the_machine_after_its_line_is_in_the_audit(
    served: Served, anna: Page
) -> None:
    machine = served.machine("m1")
    machine.say(Asked(ASK))
    shown = anna.until("asked", machine="m1")
    assert (shown["request"]["why"], shown["request"]["cloud_m"]) == ("time limit", [[1.0, 2.0]])
    assert anna.until("alarms")["alarms"][0]["text"] == "asks for help: time limit"
    assert anna.command("m1", "answer", 3, "go_on").status == 202
    command = machine.until("command")
    assert (command["kind"], command["number"], command["answer"], command["by"]) == ("answer", 3, "go_on", "anna")
    line = next(one for one in served.audit() if one["what"] == "command" and one.get("machine") == "m1")
    assert (line["who"], line["id"], line["answer"]) == ("anna", command["id"], "go_on")
    check(served.audit_path, [command["audit"]])
    machine.say(Outcome(command["id"], True))
    assert anna.until("outcome", machine="m1")["taken"]
    assert served.audit()[-1]["what"] == "outcome"
    machine.socket.close()
    assert anna.until("machine", name="m1", connected=False)


def test_arming_and_stopping_are_commands_too(served: Served, anna: Page) -> None:
    machine = served.machine("m2")
    anna.until("machine", name="m2")
    for kind in ("rearm", "stop"):
        assert anna.command("m2", kind).status == 202
        assert machine.until("command")["kind"] == kind


def test_what_does_not_fit_is_refused_noted_and_reaches_nobody(served: Served, anna: Page) -> None:
    machine = served.machine("m3")
    machine.say(Asked(ASK))
    anna.until("asked", machine="m3")
    before = len(served.audit())
    for wish in (
        ("m3", "answer", 2, "go_on"),
        ("m3", "answer", 3, "drive"),
        ("m3", "drive"),
        ("m9", "stop"),
        ("m3", "rearm", 1),
    ):
        assert anna.command(*wish).status == 409
    assert machine.nothing("command")
    assert [line["what"] for line in served.audit()[before:]] == ["refused"] * 5


def test_one_operates_the_others_watch(served: Served, anna: Page) -> None:
    machine = served.machine("m4")
    bert = served.page(served.log_in("bert"))
    second = served.page(anna.cookie)
    anna.beat("m4", 0)  # she has not been silent for long
    assert machine.until("beat")["number"] == 0
    for page in (bert, second):
        assert page.sit() == 409
        assert page.command("m4", "stop").status == 409
        page.beat("m4", 1)
    assert machine.nothing("beat")
    machine.say(Tick(1, 0.0, 0.25))
    assert bert.until("tick", machine="m4")["number"] == 1
    anna.beat("m4", 1)
    assert machine.until("beat")["by"] == "anna"
    assert anna.sit(take=False) == 204
    assert bert.sit() == 204
    bert.beat("m4", 1)
    assert machine.until("beat")["by"] == "bert"
    anna.beat("m4", 1)
    assert machine.nothing("beat")
    bert.socket.close()
    assert second.until("seat", by="")


def test_a_page_that_comes_late_is_told_what_is(served: Served, anna: Page) -> None:
    machine = served.machine("m5")
    machine.say(Status(2.0, False, "autonomous", True, ("link lost",)))
    machine.say(Event(2.0, "executor", "stops", grave=True))
    machine.say(Asked(ASK))
    anna.until("asked", machine="m5")
    late = served.page(anna.cookie)
    assert late.until("status", machine="m5")["causes"] == ["link lost"]
    assert late.until("event", machine="m5")["text"] == "stops"
    alarms = [one["text"] for one in late.until("alarms")["alarms"] if one["machine"] == "m5"]
    assert alarms == ["stopped: link lost", "asks for help: time limit", "stops"]


def test_wrong_codes_are_refused_counted_and_then_not_looked_at(served: Served) -> None:
    right = served.code("bert")
    wrong = f"{(int(right) + 1) % 10**6:06d}"
    served.later_s += 60.0
    for name, code in (("bert", wrong), ("nobody", right), ("bert", "x"), ("bert", "１２３４５６"), ("bert", "")):
        answer = served.ask("POST", "/login", {"name": name, "code": code})
        assert (answer.status, answer.cookie) == (403, "")
    assert (
        served.ask("POST", "/login", {"name": "bert", "code": str(served.secrets["bert"].at(served.now_s()))}).status
        == 429
    )
    served.later_s += 60.0
    assert served.log_in("bert")


def test_a_code_counts_once(served: Served) -> None:
    login = {"name": "bert", "code": served.code("bert")}
    assert served.ask("POST", "/login", login).status == 204
    assert served.ask("POST", "/login", login).status == 403
    served.later_s += 60.0


@pytest.mark.parametrize("origin", ["", "http://evil.example", "http://127.0.0.1", "null", "https://127.0.0.1"])
def test_another_origin_gets_nothing(served: Served, anna: Page, origin: str) -> None:
    machine = served.machine("m6")
    anna.until("machine", name="m6")
    wish = {"page": anna.number, "machine": "m6", "kind": "stop"}
    assert served.ask("POST", "/command", wish, anna.cookie, Origin=origin).status == 403
    with pytest.raises(InvalidStatus, match="403"):
        served.opened("/page", {"Cookie": anna.cookie} | ({"Origin": origin} if origin else {}))
    assert machine.nothing("command", 0.05)


def test_another_hosts_name_gets_nothing(served: Served) -> None:
    assert served.ask("GET", "/", Host="evil.example").status == 403
    assert served.ask("GET", "/", Host="").status in (400, 403)


@pytest.mark.parametrize(
    "cookie", ["", "lhdmap_console=", "lhdmap_console=anna", "lhdmap_console=" + "A" * 43, "x" * 3000]
)
def test_a_forged_cookie_opens_nothing(served: Served, anna: Page, cookie: str) -> None:
    for method, path in (("GET", "/me"), ("POST", "/seat"), ("POST", "/command"), ("POST", "/logout")):
        body = {"page": anna.number, "machine": "m1", "kind": "stop"}
        assert served.ask(method, path, body, cookie).status == 401
    with pytest.raises(InvalidStatus, match="403"):
        served.page(cookie)


def test_who_has_logged_out_is_shown_nothing_any_more(served: Served, anna: Page) -> None:
    machine = served.machine("m8")
    anna.until("machine", name="m8")
    assert served.ask("POST", "/logout", {}, anna.cookie).status == 204
    machine.say(Event(1.0, "executor", "secret"))
    with pytest.raises(ConnectionClosed):
        anna.until("event", machine="m8")


def test_a_session_that_has_ended_gives_no_sign_of_life(served: Served, anna: Page) -> None:
    machine = served.machine("m7")
    anna.until("machine", name="m7")
    assert served.ask("POST", "/logout", {}, anna.cookie).status == 204
    anna.beat("m7", 1)
    with pytest.raises(ConnectionClosed):
        anna.until("never")
    assert machine.nothing("beat")


@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer x"}, {"Authorization": "KEY", "Origin": "SELF"}])
def test_a_machine_needs_the_key_and_is_no_page(served: Served, headers: dict[str, str]) -> None:
    told = {"KEY": f"Bearer {served.key}", "SELF": served.url}
    sent = {name: told.get(value, value) for name, value in headers.items()}
    with pytest.raises(InvalidStatus, match="403"):
        served.opened("/machine", sent)


def test_what_every_answer_has(served: Served) -> None:
    answer = served.ask("GET", "/")
    told = answer.headers["content-security-policy"]
    assert "frame-src http://127.0.0.1:9090;" in told
    assert "frame-ancestors 'none'" in told
    assert "unsafe" not in told
    assert "default-src 'none'" in told
    assert answer.headers["x-content-type-options"] == "nosniff"
    cookie = served.ask("POST", "/login", {"name": "bert", "code": served.code("bert")}).headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


def test_the_page_loads_nothing_from_elsewhere(served: Served) -> None:
    for path in ("/", "/console.js", "/drawing.js", "/console.css"):
        answer = served.ask("GET", path)
        assert answer.status == 200
        assert b"://" not in answer.body.replace(b"}://${location.host}", b"")
        assert b"innerHTML" not in answer.body
