"""A node in a live mission of processes of its own."""

from __future__ import annotations

import pathlib
import socket
import subprocess

import plumage
import pytest
from conftest import AS_PONTES, CLONE

pytest.importorskip("zenoh")

from plumage.node import Node


@pytest.fixture(scope="module")
def mission(command):
    """The reference mission in real time: controller, world and two of its aircraft."""
    programs = pathlib.Path(command).parent
    for name in ("sc", "ws", "va"):
        if not (programs / name).is_file():
            pytest.skip(f"no {programs / name}: cargo build --release builds it")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        at = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    shared = ["--scenario", str(AS_PONTES), "--duration", "120"]
    join = ["--connect", at, "--listen", "tcp/127.0.0.1:0"]
    processes = [subprocess.Popen([programs / "sc", *shared, "--listen", at], cwd=CLONE, stderr=subprocess.DEVNULL)]
    try:
        for more in (["ws"], ["va", "--vehicles", "1,2"]):
            arguments = [programs / more[0], *shared, *join, *more[1:]]
            processes.append(subprocess.Popen(arguments, cwd=CLONE, stderr=subprocess.DEVNULL))
        yield at
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(timeout=30)


def test_a_node_hears_a_mission(mission):
    with Node("as-pontes", connect=mission) as node:
        first = node.latest("va/1/state", timeout_s=60.0)
        assert first["sender"] == "va/1" and first["message"]["kind"] == "simulated"
        assert node.latest("va/1/state")["time_ns"] > first["time_ns"]


def test_a_vehicle_obeys_an_operator(mission):
    with Node("as-pontes", connect=mission) as node:
        node.latest("va/1/state", timeout_s=60.0)
        modes = node.messages("va/1/mode", timeout_s=20.0)
        node.control("1", "take-over")
        assert next(e for _, e in modes if e["message"]["level"] == "pilot")["sender"] == "va/1"
        # It is taken over, so that a place is flown to; a place that nobody may fly to is refused by the vehicle itself.
        events = node.messages("va/1/event", timeout_s=20.0)
        node.send_to("1", 43.9, -7.8631, 800.0)
        assert next(e for _, e in events if e["message"]["code"] == "setpoint-refused")
        node.control("1", "hand-back")
        assert next(e for _, e in modes if e["message"]["level"] != "pilot")


def test_a_vehicle_does_not_believe_who_has_another_key(mission, tmp_path):
    other = tmp_path / "other.key"
    other.write_text("a7" * 32)
    other.chmod(0o600)
    with Node("as-pontes", connect=mission, mission_key=other) as stranger:
        with pytest.raises(TimeoutError, match="check that it has the same key"):
            stranger.control("2", "take-over", timeout_s=3.0)
    # Even with the run's number, which whoever holds the key is told.
    with Node("as-pontes", connect=mission) as node:
        node.latest("va/2/state", timeout_s=60.0)
        # A process says for all of its vehicles what it did not take.
        heard = node.messages("va/2/mode", "va/*/event", timeout_s=3.0)
        node.say("va/2/control", {"wish": "home", "sticks": None})
        key, (payload, _) = node._speaker.say("va/2/control", '{"wish": "take-over", "sticks": null}', 0)
        node._session.put(key, payload, attachment=bytes(56))
        said = [envelope["message"] for _, envelope in heard]
    assert any(m.get("code") == "bad-message" for m in said)
    assert not any(m.get("level") == "pilot" for m in said)


def test_only_what_an_operator_says_is_said(mission):
    with Node("as-pontes", connect=mission) as node:
        with pytest.raises(plumage.InputError, match="va/1/state"):
            node.say("va/1/state", {"wish": "home"})
        with pytest.raises(plumage.InputError, match="landing"):
            node.control("1", "landing")
        with pytest.raises(TimeoutError, match="va/17 did not join the bus"):
            node.control("17", "home", timeout_s=1.0)


def test_who_shows_a_token_of_a_vehicle_is_not_taken_for_it(mission):
    with Node("as-pontes", connect=mission) as node, Node("as-pontes", connect=mission) as stranger:
        token = stranger._session.liveliness().declare_token("plumage/as-pontes/va/17/alive")
        # Also who answers the call, without the mission key.
        answers = stranger._session.declare_queryable(
            "plumage/as-pontes/va/17/call",
            lambda query: query.reply("plumage/as-pontes/va/17/call", b"{}", attachment=bytes(32)),
        )
        with pytest.raises(TimeoutError, match="va/17 did not join the bus"):
            node.control("17", "home", timeout_s=3.0)
        answers.undeclare()
        token.undeclare()


def test_another_host_needs_a_key_that_is_given(monkeypatch):
    monkeypatch.delenv("PLUMAGE_MISSION_KEY", raising=False)
    with pytest.raises(plumage.InputError, match="is not on this host"):
        plumage._plumage.Speaker("as-pontes", ["tcp/192.0.2.1:7447"], None)


def test_what_is_no_message_of_a_mission_is_refused():
    key = plumage._plumage.key("as-pontes", "va/3/control")
    assert key == "plumage/as-pontes/va/3/control"
    with pytest.raises(plumage.InputError):
        plumage._plumage.key("as pontes", "va/3/control")
    said = b'{"wire_version":0,"sender":"op/main","sequence":1,"time_ns":0,"message":{"wish":"home","sticks":null}}'
    for payload, as_json in ((said, True), (said[:-1], True), (said, False)):
        with pytest.raises(plumage.InputError):
            plumage._plumage.decode("as-pontes", key, payload, as_json)
