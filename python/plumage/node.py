"""A node that joins a live mission over Zenoh: it hears what is said in every encoding, and says what an operator or a
strategy outside the program may say.

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
    """Where a node connects and listens: a list, one for each mode, or none."""
    found: list[str] = []
    for what in ("connect/endpoints", "listen/endpoints"):
        given = json.loads(config.get_json(what))
        lists = given.values() if isinstance(given, dict) else [given or []]
        found += [one for each in lists for one in each]
    return found


class Node:
    """One more participant of a mission.

    mission: its name, as in the scenario.
    connect: where a process of the mission listens.
    listen: where others of the mission reach this node: on this machine alone, unless stated.
    config: of Zenoh, in place of the two, such as for TLS and passwords (docs/processes.md).
    mission_key: file of the mission's key, which is needed to say something. Without one the key is found as the commands find
        it: in PLUMAGE_MISSION_KEY, or on the mission's own host in this user's file of it.
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

    def say(self, topic: str, message: Mapping[str, Any], *, timeout_s: float = 10.0) -> None:
        """Says something in the operator's name, sealed by the mission's key.

        topic: of a vehicle: ``va/1/control``, ``va/1/destination`` or ``va/1/swap``.
        message: as the bus has it, such as ``{"wish": "home"}``.
        timeout_s: how long the mission may take to let this node in, and the vehicle to be there.

        What the vehicle makes of it is in its events (``va/1/event``). A mission that was begun anew needs a new node.

        Raises InputError for what the operator cannot say there, and where no key is found; TimeoutError where the mission has
        another key or the vehicle is not there.
        """
        end = time.monotonic() + timeout_s
        if self._speaker is None:
            self._speaker = self._joined(end, timeout_s)
        now_ns = time.monotonic_ns() - self._begun_ns
        key, (payload, seal) = self._speaker.say(topic, json.dumps(dict(message)), now_ns)
        vehicle = topic.rsplit("/", 1)[0]
        while not self._is_there(vehicle):
            if time.monotonic() > end:
                raise TimeoutError(f"{vehicle} is not on the bus within {timeout_s} s")
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
        """Who shall fly a vehicle: ``plumage control``.

        vehicle: its id, such as ``"1"``.
        wish: take a simulated one over, give one back to automatic flight, or bring one home.
        sticks: of a takeover: ``roll`` and ``pitch`` (−1 to 1) and ``throttle`` (0 to 1), to be repeated, for their silence is
            a lost remote control. Without: held level.
        """
        message = {"wish": wish, "sticks": None if sticks is None else dict(sticks)}
        self.say(f"va/{vehicle}/control", message, timeout_s=timeout_s)

    def send_to(
        self, vehicle: str, lat_deg: float, lon_deg: float, alt_amsl_m: float, *, timeout_s: float = 10.0
    ) -> None:
        """Where a vehicle shall look next while ``search.strategy`` is ``outside``, or fly when it was taken over.

        lat_deg, lon_deg: of WGS84, degrees; alt_amsl_m: m above mean sea level.
        """
        place = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_amsl_m": alt_amsl_m}
        self.say(f"va/{vehicle}/destination", place, timeout_s=timeout_s)

    def _joined(self, end: float, timeout_s: float) -> _plumage.Speaker:
        """Who speaks for this node, when who keeps the mission's time has told the number of the run."""
        speaker = _plumage.Speaker(self.mission, self._endpoints, self._mission_key)
        while time.monotonic() < end:
            asked_ns = time.monotonic_ns()
            payload, code = speaker.question()
            # Strangers may answer as well, and first: theirs do not hold.
            replies = self._session.get(
                speaker.time_key,
                payload=payload,
                attachment=code,
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=max(_AGAIN_S, end - time.monotonic()),
            )
            for reply in replies:
                if reply.ok is None or reply.ok.attachment is None:
                    continue
                now_ns = speaker.answered(reply.ok.payload.to_bytes(), reply.ok.attachment.to_bytes())
                if now_ns is not None:
                    self._begun_ns = (asked_ns + time.monotonic_ns()) // 2 - now_ns
                    return speaker
            time.sleep(_AGAIN_S)
        raise TimeoutError(
            f"mission '{self.mission}' does not let this node in within {timeout_s} s: is its key another one (mission_key=, "
            "PLUMAGE_MISSION_KEY), or is it in lockstep? What moves a vehicle is for missions in real time"
        )

    def _is_there(self, agent: str) -> bool:
        return any(reply.ok for reply in self._session.liveliness().get(f"plumage/{self.mission}/{agent}/alive"))

    def _decoded(self, sample: zenoh.Sample) -> tuple[str, dict[str, Any]]:
        as_json = sample.encoding in (zenoh.Encoding.APPLICATION_JSON, zenoh.Encoding.TEXT_JSON)
        return _plumage.decode(self.mission, str(sample.key_expr), sample.payload.to_bytes(), as_json)
