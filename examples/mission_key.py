"""Find the key of a mission and publish on its bus.

Needs `pip install eclipse-zenoh`. Every message carries a seal in Zenoh's attachment, which proves that its publisher holds
the mission's key: docs/security.md describes the layout. Subscribers need none of this.
"""

import hashlib
import hmac
import json
import os
import pathlib
import struct
import time

import zenoh


def find_key(mission, file=None):
    """Return the mission's key: from a file, from PLUMAGE_MISSION_KEY, or from the file of the first process on this host."""
    if file is None and "PLUMAGE_MISSION_KEY" in os.environ:
        return bytes.fromhex(os.environ["PLUMAGE_MISSION_KEY"])
    if file is None:
        folder = os.environ.get("XDG_RUNTIME_DIR") or os.environ.get("XDG_STATE_HOME") or "~/.local/state"
        file = pathlib.Path(folder).expanduser() / "plumage" / f"{mission}.key"
    return bytes.fromhex(pathlib.Path(file).read_text())


def code(key, what, *parts):
    return hmac.new(key, what + b"".join(parts), hashlib.sha256).digest()


def answer_code(key, question, answer):
    return code(key, b"plumage answer\0", struct.pack(">Q", len(question)), question, answer)


class Speaker:
    """Publish on the bus of a mission that runs in real time."""

    def __init__(self, session, mission, key):
        self.session, self.key = session, key
        self.stream = int.from_bytes(os.urandom(8), "big")
        self.number = 0
        self.run = self._join(f"plumage/{mission}/clock/main/now")

    def _join(self, time_key):
        """Ask the keeper of the mission's time for the number of the run, until it answers."""
        while True:
            question = os.urandom(16).hex()
            asked = json.dumps({"question": question, "stream": self.stream}).encode()
            replies = self.session.get(
                time_key,
                payload=asked,
                attachment=answer_code(self.key, b"", asked),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
            for reply in replies:
                if not reply.ok or reply.ok.attachment is None:
                    continue
                answer = reply.ok.payload.to_bytes()
                expected = answer_code(self.key, question.encode(), answer)
                if hmac.compare_digest(expected, reply.ok.attachment.to_bytes()):
                    return json.loads(answer)["run"]
            time.sleep(0.1)

    def put(self, key_expression, envelope):
        """Publish an envelope, a dictionary."""
        said, key_bytes = json.dumps(envelope).encode(), key_expression.encode()
        self.number += 1
        numbers = struct.pack(">QQQ", self.run, self.stream, self.number)
        length = struct.pack(">Q", len(key_bytes))
        seal = numbers + code(self.key, b"plumage message\0", numbers, length, key_bytes, said)
        self.session.put(key_expression, said, encoding=zenoh.Encoding.APPLICATION_JSON, attachment=seal)
