"""What waits to be sent is bounded, and newer news replaces older."""

from __future__ import annotations

import asyncio

from lhdmap.console.outbox import Outbox


def test_newer_news_replaces_older_and_the_rest_keeps_its_order() -> None:
    async def run() -> list[str]:
        box = Outbox()
        for text, key in (("status 1", "status"), ("event 1", ""), ("status 2", "status"), ("event 2", "")):
            box.put(text, key)
        return [await box.take() for _ in range(3)]

    assert asyncio.run(run()) == ["event 1", "status 2", "event 2"]


def test_the_oldest_are_dropped_and_counted() -> None:
    async def run() -> tuple[int, str]:
        box = Outbox(most=3)
        for k in range(5):
            box.put(f"{k}")
        return box.lost, await box.take()

    assert asyncio.run(run()) == (2, "2")


def test_who_takes_waits_until_there_is_something() -> None:
    async def run() -> str:
        box = Outbox()
        taken = asyncio.create_task(box.take())
        await asyncio.sleep(0)
        assert not taken.done()
        box.put("now")
        return await taken

    assert asyncio.run(run()) == "now"
