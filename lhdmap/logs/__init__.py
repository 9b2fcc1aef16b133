"""Logs: readers of all formats behind one Protocol, topic roles, stamps, health, and a writer of MCAP."""

from lhdmap.logs.base import LogReader, TopicInfo
from lhdmap.logs.formats import open_log
from lhdmap.logs.source import LogSource
from lhdmap.logs.topics import assign_topics

__all__ = ["LogReader", "LogSource", "TopicInfo", "assign_topics", "open_log"]
