"""A stranger on loopback: says what moves vehicles without the mission's key, as anybody with `pip install eclipse-zenoh` can.

    stranger.py ENDPOINT MISSION SETPOINT CONTROL    (binary envelopes, hexadecimal)

Sends 100 setpoints and commands to va/1 and va/2, in JSON and in binary, the last ones with a seal made by a key of its own, and
prints what the vehicles say of them.
"""

import json
import os
import sys
import time

import zenoh

endpoint, mission, setpoint_hex, control_hex = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
config.insert_json5("scouting/multicast/enabled", "false")
setpoint = {"path": "go-to", "lat_deg": 43.523, "lon_deg": -7.8631, "alt_amsl_m": 2500.0, "airspeed_m_s": 18.0, "orbit_radius_m": 80.0}
control = {"wish": "take-over", "sticks": {"roll": 0.0, "pitch": -1.0, "throttle": 1.0}}
with zenoh.open(config) as session:
    latest = {"time_ns": 0}
    times = session.declare_subscriber(f"plumage/{mission}/va/*/state", lambda s: latest.update(json.loads(s.payload.to_string())))
    events = session.declare_subscriber(f"plumage/{mission}/va/*/event", lambda s: print(s.payload.to_string(), flush=True))
    modes = session.declare_subscriber(f"plumage/{mission}/va/*/mode", lambda s: print(s.payload.to_string(), flush=True))
    while not latest["time_ns"]:
        time.sleep(0.1)
    for k in range(1, 26):
        for sender, key, message, binary in [
            ("sc/main", "va/1/setpoint", setpoint, setpoint_hex),
            ("op/main", "va/2/control", control, control_hex),
        ]:
            told = {"wire_version": 2, "sender": sender, "sequence": 10**6 + k, "time_ns": latest["time_ns"], "message": message}
            seal = os.urandom(56) if k > 15 else None
            key = f"plumage/{mission}/{key}"
            session.put(key, json.dumps(told), encoding=zenoh.Encoding.APPLICATION_JSON, attachment=seal)
            session.put(key, bytes.fromhex(binary), attachment=seal)
        time.sleep(0.05)
    time.sleep(3)
