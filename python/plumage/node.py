"""Join a live mission over Zenoh: receive its messages in any encoding, and publish commands of an operator or of an
outside strategy.

Needs ``pip install 'plumage[node]'`` and a mission in real time or lockstep (docs/processes.md).

>>> with Node("as-pontes", connect="tcp/127.0.0.1:7447") as node:          # doctest: +SKIP
...     for topic, envelope in node.messages("va/*/reading", timeout_s=10.0):
...         print(topic, envelope["message"]["co2_ppm"])
...     node.control("1", "home")
"""

from __future__ import annotations

import json
import os
import queue
import time
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Any, Literal

import zenoh

from . import _plumage

__all__ = ["Node"]

#: Time between two questions to who keeps the mission's time, and between two looks for a vehicle, s.
_AGAIN_S = 0.1


def _endpoints(config: zenoh.Config) -> list[str]:
    """Return the endpoints at which a node connects and listens."""
    found: list[str] = []
    for what in ("connect/endpoints", "listen/endpoints"):
        given = json.loads(config.get_json(what))
        lists = given.values() if isinstance(given, dict) else [given or []]
        found += [one for each in lists for one in each]
    return found


class Node:
    """Participant of a mission.

    mission: name of the mission, as in the scenario.
    connect: endpoint of a process of the mission.
    listen: endpoint at which others reach this node; on this machine only by default.
    config: Zenoh configuration instead of these two, such as for TLS and passwords (docs/processes.md).
    mission_key: file with the mission key, which publishing needs. By default the key is found as by the commands: in
        PLUMAGE_MISSION_KEY, or on the mission's host in this user's key file.
    """

    def __init__(
        self,
        mission: str,
        *,
        connect: str = "tcp/127.0.0.1:7447",
        listen: str = "tcp/127.0.0.1:0",
        config: zenoh.Config | None = None,
        mission_key: str | os.PathLike[str] | None = None,
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
        self._endpoints = _endpoints(config)
        self._mission_key = mission_key
        self._speaker: _plumage.Speaker | None = None
        #: The clock of this process when the mission began, ns.
        self._begun_ns = 0
        # Zenoh types only a part of its calls.
        self._session: Any = zenoh.open(config)

    def __enter__(self) -> Node:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the mission."""
        self._session.close()

    def messages(
        self, *topics: str, timeout_s: float | None = None
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        """Iterate over messages from now on: topic, and envelope with ``sender``, ``sequence``, ``time_ns`` and ``message``.

        topics: such as ``va/1/state``; ``*`` matches one part (``va/*/reading``). By default all topics of vehicles, world
            and controller.
        timeout_s: end after this time without a message; never by default.

        Raises InputError for a message of another version.
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
        """Return the next envelope on a topic; raises TimeoutError if none comes in time."""
        for _, envelope in self.messages(topic, timeout_s=timeout_s):
            return envelope
        raise TimeoutError(f"{topic}: no message within {timeout_s} s")

    def say(self, topic: str, message: Mapping[str, Any], *, timeout_s: float = 10.0) -> None:
        """Publish a message as the operator, sealed with the mission key.

        topic: topic of a vehicle: ``va/1/control``, ``va/1/destination`` or ``va/1/swap``.
        message: message as on the bus, such as ``{"wish": "home"}``.
        timeout_s: longest wait until the mission admits this node and the vehicle is present.

        The vehicle answers by an event (``va/1/event``). A restarted mission needs a new node.

        Raises InputError if the operator cannot publish there or no key is found; TimeoutError if the mission has another
        key or the vehicle is not present.
        """
        end = time.monotonic() + timeout_s
        if self._speaker is None:
            self._speaker = self._joined(end, timeout_s)
        now_ns = time.monotonic_ns() - self._begun_ns
        key, (payload, seal) = self._speaker.say(topic, json.dumps(dict(message)), now_ns)
        vehicle = topic.rsplit("/", 1)[0]
        while not self._is_there(self._speaker, vehicle, end):
            if time.monotonic() > end:
                raise TimeoutError(f"{vehicle} did not join the bus within {timeout_s} s")
            time.sleep(_AGAIN_S)
        self._session.put(
            key, payload, attachment=seal, congestion_control=zenoh.CongestionControl.BLOCK, express=True
        )

    def control(
        self,
        vehicle: str,
        wish: Literal["take-over", "hand-back", "home"],
        *,
        sticks: Mapping[str, float] | None = None,
        timeout_s: float = 10.0,
    ) -> None:
        """Take over a vehicle, hand it back or call it home, like ``plumage control``.

        vehicle: id of the vehicle, such as ``"1"``.
        wish: take over a simulated vehicle, hand a vehicle back to automatic flight, or call it home.
        sticks: for a takeover: ``roll`` and ``pitch`` (−1 to 1) and ``throttle`` (0 to 1); repeat them, since their absence
            counts as a lost remote control. Without sticks the vehicle flies level.
        """
        message = {"wish": wish, "sticks": None if sticks is None else dict(sticks)}
        self.say(f"va/{vehicle}/control", message, timeout_s=timeout_s)

    def send_to(
        self, vehicle: str, lat_deg: float, lon_deg: float, alt_amsl_m: float, *, timeout_s: float = 10.0
    ) -> None:
        """Send a vehicle to a place: its next search point if ``search.strategy`` is ``outside``, or after a takeover.

        lat_deg, lon_deg: WGS84, degrees; alt_amsl_m: m above mean sea level.
        """
        place = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_amsl_m": alt_amsl_m}
        self.say(f"va/{vehicle}/destination", place, timeout_s=timeout_s)

    def _joined(self, end: float, timeout_s: float) -> _plumage.Speaker:
        """Return the speaker of this node once the mission's time keeper has given the number of the run."""
        speaker = _plumage.Speaker(self.mission, self._endpoints, self._mission_key)
        while time.monotonic() < end:
            asked_ns = time.monotonic_ns()
            payload, code = speaker.question()
            for answer in self._answers(speaker.time_key, payload, end, code):
                now_ns = speaker.answered(*answer)
                if now_ns is not None:
                    self._begun_ns = (asked_ns + time.monotonic_ns()) // 2 - now_ns
                    return speaker
            time.sleep(_AGAIN_S)
        raise TimeoutError(
            f"mission '{self.mission}' did not admit this node within {timeout_s} s; check that it has the same key (mission_key=, "
            "PLUMAGE_MISSION_KEY) and runs in real time, since commands need real time, not lockstep"
        )

    def _is_there(self, speaker: _plumage.Speaker, agent: str, end: float) -> bool:
        """Call an agent: anybody can show its token, and only a holder of the mission key can answer a new question."""
        key, question = speaker.call(agent)
        return any(speaker.is_there(agent, question, *answer) for answer in self._answers(key, question, end))

    def _answers(self, key: str, question: bytes, end: float, code: bytes | None = None) -> Iterator[tuple[bytes, bytes]]:
        """Payload and code of every answer. Strangers may answer as well, and first: theirs do not hold."""
        replies = self._session.get(
            key,
            payload=question,
            attachment=code,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=max(_AGAIN_S, end - time.monotonic()),
        )
        for reply in replies:
            if reply.ok is not None and reply.ok.attachment is not None:
                yield reply.ok.payload.to_bytes(), reply.ok.attachment.to_bytes()

    def _decoded(self, sample: zenoh.Sample) -> tuple[str, dict[str, Any]]:
        as_json = sample.encoding in (zenoh.Encoding.APPLICATION_JSON, zenoh.Encoding.TEXT_JSON)
        return _plumage.decode(self.mission, str(sample.key_expr), sample.payload.to_bytes(), as_json)
