"""The team of a mission as a ground station sees it, by pymavlink.

    pip install pymavlink
    plumage run scenarios/as-pontes.toml --speed 10 --duration 240 --gcs udpout:127.0.0.1:14550 &
    python tests/oracle/mavlink_team.py link 14550
    python tests/oracle/mavlink_team.py log team.tlog

`link` listens to six vehicles, takes over the second by FBWA, flies it by sticks, gives it back, is
refused the sixth, which is a real one, sends the fifth to a place, but not out of its fence, and calls the third home.
Both print each position that they hear:
system, time (ms), latitude, longitude (1e-7 deg), altitude (mm). Ends with 0 if all was as it must be. Written
for pymavlink 2.4.
"""

import os
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

m = mavutil.mavlink
TEAM = {1, 2, 3, 4, 5, 6}
MANUAL, FBWA, RTL, LOITER, GUIDED = 0, 5, 11, 12, 15
failures = []


def expect(what, holds, seen=""):
    print("ok  " if holds else "FAIL", what, seen, file=sys.stderr, flush=True)
    if not holds:
        failures.append(what)


def show(message):
    """Prints a position."""
    if message is not None and message.get_type() == "GLOBAL_POSITION_INT":
        row = (message.get_srcSystem(), message.time_boot_ms, message.lat, message.lon, message.alt)
        print(*row, flush=True)
    return message


def by_link(port):
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255)
    heard = {}

    def come(system, kind, holds=lambda message: True, within_s=15):
        """The next message of a kind from a system; keeps the positions of all."""
        end = time.time() + within_s
        while time.time() < end:
            message = show(link.recv_match(blocking=True, timeout=1))
            if message is None:
                continue
            heard.setdefault(message.get_srcSystem(), set()).add(message.get_type())
            if (message.get_srcSystem(), message.get_type()) == (system, kind) and holds(message):
                return message
        return None

    def mode(system, number):
        """The result of a mode asked for, and whether it is then shown."""
        link.mav.command_long_send(system, 1, m.MAV_CMD_DO_SET_MODE, 0, 1, number, 0, 0, 0, 0, 0)
        ack = come(system, "COMMAND_ACK")
        return None if ack is None else ack.result

    def send_to(system, lat, lon, alt_amsl_m):
        """The result of sending a vehicle to a place."""
        place = (lat, lon, alt_amsl_m)
        link.mav.command_int_send(system, 1, m.MAV_FRAME_GLOBAL, m.MAV_CMD_DO_REPOSITION, 0, 0, -1, 0, 0, 0, *place)
        ack = come(system, "COMMAND_ACK", lambda ack: ack.command == m.MAV_CMD_DO_REPOSITION)
        return None if ack is None else ack.result

    flies = lambda h: h.system_status in (m.MAV_STATE_ACTIVE, m.MAV_STATE_CRITICAL)
    expect("the second flies", come(2, "HEARTBEAT", flies, 60) is not None)
    expect("the fifth flies", come(5, "HEARTBEAT", flies, 60) is not None)
    expect("six vehicles, each of its own", set(heard) == TEAM, heard.keys())
    usual = {"HEARTBEAT", "GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD", "SYS_STATUS", "NAMED_VALUE_FLOAT"}
    for system in TEAM:
        expect(f"usual messages of {system}", usual <= heard.get(system, set()), heard.get(system))
    expect("take-over", mode(2, FBWA) == 0)
    expect("it is shown", come(2, "HEARTBEAT", lambda h: h.custom_mode == FBWA) is not None)
    for _ in range(20):
        link.mav.manual_control_send(2, 0, 500, 600, 0, 0)
        come(2, "ATTITUDE", within_s=1)
    expect("it banks by the stick", come(2, "ATTITUDE", lambda a: a.roll > 0.15, 3) is not None)
    expect("others fly on", come(1, "HEARTBEAT", lambda h: h.custom_mode == GUIDED) is not None)
    # Not sent out of its fence, which ends at 43.480 degrees north; sent a kilometre away, the fifth comes there.
    start = come(5, "GLOBAL_POSITION_INT")
    expect("not out of its fence", send_to(5, 435_610_000, start.lon, 600) == m.MAV_RESULT_DENIED)
    place = (start.lat + 90_000, start.lon)
    expect("it is sent to a place", send_to(5, *place, 600) == 0)
    near = lambda p: abs(p.lat - place[0]) < 20_000 and abs(p.lon - place[1]) < 30_000
    expect("and comes there", come(5, "GLOBAL_POSITION_INT", near, 20) is not None)
    expect("in LOITER", come(5, "HEARTBEAT", lambda h: h.custom_mode == LOITER) is not None)
    expect("hand-back", mode(2, GUIDED) == 0)
    expect("it is shown, too", come(2, "HEARTBEAT", lambda h: h.custom_mode == GUIDED) is not None)
    expect("a real one has a pilot of its own", mode(6, MANUAL) == m.MAV_RESULT_FAILED)
    expect("the third is called home", mode(3, RTL) == 0)
    link.mav.mission_request_list_send(4, 1, 0)
    count = come(4, "MISSION_COUNT")
    expect("no missions", count is not None and count.count == 0)
    link.mav.param_request_read_send(5, 1, b"MAV_SYSID", -1)
    sysid = come(5, "PARAM_VALUE")
    expect("parameters of its own", sysid is not None and sysid.param_value == 5)


def by_log(path):
    log = mavutil.mavlink_connection(path)
    systems, last, back = set(), 0.0, 0
    while True:
        message = show(log.recv_msg())
        if message is None:
            break
        systems.add(message.get_srcSystem())
        back += message._timestamp < last
        last = message._timestamp
    expect("six vehicles and the ground station", systems == TEAM | {255}, systems)
    expect("in the order of time", back == 0, back)
    expect("of this year", abs(last - time.time()) < 3600, last)


if __name__ == "__main__":
    if sys.argv[1] == "link":
        by_link(int(sys.argv[2]))
    else:
        by_log(sys.argv[2])
    print(len(failures), "failures", failures, file=sys.stderr)
    sys.exit(bool(failures))
