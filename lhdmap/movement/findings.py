"""What check-map says: findings, and the verdict over them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found: how bad it is, which rule found it, where (ids or names), in words.

    An `error` means that the map is not ready to run on; a `warning`, that somebody should look at it first.
    """

    severity: Severity
    rule: str
    where: str
    text: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """All findings, the worst first; `ready`: none is an error."""

    findings: tuple[Finding, ...]

    @property
    def ready(self) -> bool:
        """Whether the map can be run on."""
        return not any(one.severity == "error" for one in self.findings)

    @property
    def reasons(self) -> list[str]:
        """Why it is not ready."""
        return [f"{one.where}: {one.text}" for one in self.findings if one.severity == "error"]

    def count(self, severity: Severity) -> int:
        """Return how many findings there are of a severity."""
        return sum(one.severity == severity for one in self.findings)


def verdict_of(findings: Iterable[Finding]) -> Verdict:
    """Return the verdict over findings, sorted by severity."""
    return Verdict(tuple(sorted(findings, key=lambda one: SEVERITIES.index(one.severity))))


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """Return the object that `lhdmap check-map --json` prints (contract: topology)."""
    counts = {f"{severity}s": verdict.count(severity) for severity in SEVERITIES}
    return {"ready": verdict.ready, **counts, "findings": [asdict(one) for one in verdict.findings]}
