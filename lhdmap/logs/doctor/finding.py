"""One thing that the examination of a log found."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Severity(StrEnum):
    """How much a finding matters.

    `note`: information; `remark`: the software works round it; `problem`: it makes the result worse or needs an option;
    `fatal`: it makes the log unusable.
    """

    NOTE = "note"
    REMARK = "remark"
    PROBLEM = "problem"
    FATAL = "fatal"


class LogFinding(NamedTuple):
    """What was found, in which topic ("" for the log as a whole), and what to do about it ("" for nothing)."""

    severity: Severity
    topic: str
    text: str
    advice: str = ""
