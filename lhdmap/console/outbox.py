"""What waits to be sent: in order, bounded; of what is replaced by newer news only the newest is kept."""

from __future__ import annotations

import asyncio
from collections import OrderedDict

_MOST = 500


class Outbox:
    """Belongs to one event loop. `lost`: how many of the oldest were dropped."""

    def __init__(self, most: int = _MOST) -> None:
        self._waiting: OrderedDict[str, str] = OrderedDict()
        self._ready = asyncio.Event()
        self._most, self._count, self.lost = most, 0, 0

    def put(self, text: str, key: str = "") -> None:
        """Have a text sent; one that waits under the same key is replaced and goes to the end."""
        self._count += 1
        name = key or f"#{self._count}"
        self._waiting.pop(name, None)
        self._waiting[name] = text
        if len(self._waiting) > self._most:
            self._waiting.popitem(last=False)
            self.lost += 1
        self._ready.set()

    async def take(self) -> str:
        """Return the oldest text, once there is one."""
        while not self._waiting:
            self._ready.clear()
            await self._ready.wait()
        return self._waiting.popitem(last=False)[1]
