"""A node in a live mission of processes of its own."""

from __future__ import annotations

import pathlib
import socket
import subprocess

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
