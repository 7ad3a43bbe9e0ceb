"""A node that joins a live mission over Zenoh: it hears what is said in every encoding.

Needs ``pip install 'plumage[node]'`` and a mission in real time or lockstep (README, "Several processes").

>>> with Node("as-pontes", connect="tcp/127.0.0.1:7447") as node:          # doctest: +SKIP
...     for topic, envelope in node.messages("va/*/reading", timeout_s=10.0):
...         print(topic, envelope["message"]["co2_ppm"])
"""

from __future__ import annotations

import json
import queue
from collections.abc import Iterator
from types import TracebackType
from typing import Any

import zenoh

from . import _plumage

__all__ = ["Node"]


class Node:
    """One more participant of a mission.

    mission: its name, as in the scenario.
    connect: where a process of the mission listens.
    listen: where others of the mission reach this node: on this machine alone, unless stated.
    config: of Zenoh, in place of the two, such as for TLS and passwords (README, "Several processes").
    """

    def __init__(
        self,
        mission: str,
        *,
        connect: str = "tcp/127.0.0.1:7447",
        listen: str = "tcp/127.0.0.1:0",
        config: zenoh.Config | None = None,
    ) -> None:
        # Refuses a name that is none before anything is opened.
        _plumage.key(mission, "sc/main/plan")
        self.mission = mission
        if config is None:
            config = zenoh.Config()
            config.insert_json5("mode", '"peer"')
            config.insert_json5("connect/endpoints", json.dumps([connect]))
            config.insert_json5("listen/endpoints", json.dumps([listen]))
            config.insert_json5("scouting/multicast/enabled", "false")
        self._session = zenoh.open(config)

    def __enter__(self) -> Node:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leaves the mission."""
        self._session.close()

    def messages(
        self, *topics: str, timeout_s: float | None = None
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        """What is said from now on: topic, and envelope with ``sender``, ``sequence``, ``time_ns`` and ``message``.

        topics: such as ``va/1/state``; ``*`` stands for one part (``va/*/reading``). All of the vehicles, the world and the
            controller if none is given.
        timeout_s: ends when nothing came for so long; never if not given.

        Raises InputError for what is no message of this version.
        """
        said: queue.SimpleQueue[Any] = queue.SimpleQueue()
        wanted = topics or ("va/*/*", "ws/main/*", "sc/main/*")
        # Heard from now on, not from when the first message is asked for.
        subscribers = [
            self._session.declare_subscriber(f"plumage/{self.mission}/{topic}", said.put) for topic in wanted
        ]
        return self._heard(said, subscribers, timeout_s)

    def _heard(
        self, said: queue.SimpleQueue[Any], subscribers: list[Any], timeout_s: float | None
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        try:
            while True:
                try:
                    sample = said.get(timeout=timeout_s)
                except queue.Empty:
                    return
                yield self._decoded(sample)
        finally:
            for subscriber in subscribers:
                subscriber.undeclare()

    def latest(self, topic: str, *, timeout_s: float = 10.0) -> dict[str, Any]:
        """The next envelope on a topic; raises TimeoutError where none comes in time."""
        for _, envelope in self.messages(topic, timeout_s=timeout_s):
            return envelope
        raise TimeoutError(f"{topic}: nothing was said in {timeout_s} s")

    def _decoded(self, sample: zenoh.Sample) -> tuple[str, dict[str, Any]]:
        as_json = sample.encoding in (zenoh.Encoding.APPLICATION_JSON, zenoh.Encoding.TEXT_JSON)
        return _plumage.decode(self.mission, str(sample.key_expr), sample.payload.to_bytes(), as_json)
