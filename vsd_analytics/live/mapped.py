"""Live messages that are no VSD frame messages: which `[[source]]` reads them, and the records they hold."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from typing import Any

from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.formats.adapters import adapter
from vsd_analytics.ingest.intake.pipeline import options_of_rule
from vsd_analytics.ingest.intake.quarantine_writer import SourceReading
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch
from vsd_analytics.ingest.reading.frame_rows import FrameRows
from vsd_analytics.ingest.reading.json_messages import JsonMessages
from vsd_analytics.ingest.reading.raw import without_zones
from vsd_analytics.live.batches import FRAMES, TOPIC, ReceivedMessage
from vsd_analytics.site.model import ReadingRule, Site


class MappedReader:
    """Reads the messages of one `[[source]]`.

    Args:
        site: The site.
        profile: How they are read.

    Raises:
        UsageError: E101, its format is no JSON message, or its mapping lacks something.
    """

    def __init__(self, site: Site, profile: ReadingRule) -> None:
        reader = adapter(profile.format or "json")
        if not isinstance(reader, JsonMessages):
            raise UsageError(
                f"[[source]] {profile.rule_id} is of format {profile.format}, which no message can have",
                fix='format = "json", with persons and map; or take its topics out',
            )
        self.rule_id, self.topics = profile.rule_id, profile.topics
        self._reader = reader
        self._options: IngestOptions = options_of_rule(site, profile)
        reader.check(self._options)
        self.reading = SourceReading(reader.name, self._options, first_line="")
        self._rows = self._new_rows()

    def reads(self, topic: str) -> bool:
        """Return whether messages of a topic are read so."""
        if topic.startswith(TOPIC):
            return topic.removeprefix(TOPIC) == self.rule_id
        return any(topic_matches(pattern, topic) for pattern in self.topics)

    def add(self, number: int, delivery: ReceivedMessage) -> None:
        """Add one message, or the messages of an array; one that cannot be used is rejected."""
        try:
            payload: Any = json.loads(delivery.payload)
        except (ValueError, RecursionError) as error:
            self._rows.reject(number, "bad-json", f"this is no JSON: {str(error)[:200]}", delivery.payload)
            return
        for message in payload if isinstance(payload, list) else [payload]:
            if isinstance(message, dict):
                wrong = self._rows.attempt(partial(self._reader.take, message, self._rows, self._options, number))
            else:
                wrong = [("bad-json", f"this is no JSON object: {str(message)[:40]!r}")]
            for reason, detail in wrong:
                record = json.dumps(message).encode() if isinstance(payload, list) else delivery.payload
                self._rows.reject(number, reason, detail, record)

    def batch(self) -> RawBatch:
        """Return the records added since the last call."""
        batch = self._rows.batch(0, first_line="")
        return batch if self._options.zone is None else without_zones(batch)

    def forget(self) -> None:
        """Forget the records added since the last call of `batch`."""
        self._rows = self._new_rows()

    def _new_rows(self) -> FrameRows:
        return FrameRows(self._options, engine=self._reader.engine)


def mapped_readers(site: Site) -> list[MappedReader]:
    """Return a reader of each `[[source]]` whose messages can come live, in the order of `vsd.toml`."""
    readers = []
    for profile in site.sources:
        if profile.topics or profile.persons is not None or profile.format == "json":
            if profile.rule_id == FRAMES:
                raise UsageError(
                    f"[[source]] {FRAMES}: this id stands for VSD frame messages",
                    fix="give the source another id",
                )
            readers.append(MappedReader(site, profile))
    return readers


def topics_of(site_topics: Sequence[str], readers: Sequence[MappedReader]) -> tuple[str, ...]:
    """Return the topic filters to subscribe to: the broker's, then those of sources, each once."""
    return tuple(dict.fromkeys([*site_topics, *(topic for reader in readers for topic in reader.topics)]))


def topic_matches(pattern: str, topic: str) -> bool:
    """Return whether a topic filter takes in a topic, by the rules of MQTT; `$share/GROUP/` before it says nothing."""
    wanted = pattern.split("/")[2:] if pattern.startswith("$share/") else pattern.split("/")
    levels = topic.split("/")
    if levels[0].startswith("$") and wanted[0] in ("+", "#"):
        return False
    for i, level in enumerate(wanted):
        if level == "#":
            return True
        if i >= len(levels) or (level not in ("+", levels[i])):
            return False
    return len(wanted) == len(levels)
