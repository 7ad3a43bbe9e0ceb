"""A ladder of questions that ground stations ask an ArduPlane, asked of the stand-in by pymavlink.

    pip install pymavlink
    mav-bridge stand-in --scenario scenarios/as-pontes.toml --vehicle 6 --hands-off &
    python tests/oracle/mavlink_ladder.py 14550 [SPEED]

SPEED is how many times faster than the clock it flies its mission (1 by default). Each rung says what
an ArduPlane 4.8 does with the question, read from its source (ArduPlane/GCS_MAVLink_Plane.cpp,
libraries/GCS_MAVLink/GCS_Common.cpp and MissionItemProtocol.cpp): it answers, or it refuses in so
many words, or it is silent. Two things differ on purpose: the stand-in has no files to send, and it
tells PROTOCOL_VERSION and CURRENT_MODE, which an ArduPlane of that version does not know. The order is that of QGroundControl, MAVProxy and MAVSDK when they connect:
who is there, what it can, its modes, its parameters, its mission, fence and rally points; then a
mission is uploaded, read back and flown. Ends with 0 if every rung holds. Written for pymavlink 2.4.
"""

import os
import sys
import time

os.environ["MAVLINK20"] = "1"  # or pymavlink begins with the first version, which names no list
from pymavlink import mavutil  # noqa: E402

m = mavutil.mavlink
link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{sys.argv[1]}")
SPEED = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
HOME = (434_435_000, -78_655_000)  # set from HOME_POSITION below
MISSION, FENCE, RALLY = 0, 1, 2
MANUAL, AUTO, RTL, LOITER, TAKEOFF, GUIDED = 0, 10, 11, 12, 13, 15
answered, refused, silent, failures = 0, 0, 0, []


def rung(name, expected, got, seen=""):
    """One question: `expected` and `got` are "answers", "refuses" or "is silent"."""
    global answered, refused, silent
    answered += got == "answers"
    refused += got == "refuses"
    silent += got == "is silent"
    holds = expected == got
    print("ok  " if holds else "FAIL", name, got, "" if holds else f"(ArduPlane {expected}) {seen}", flush=True)
    if not holds:
        failures.append(name)


def come(kind, holds=lambda message: True, within_s=3.0):
    """The next message of a kind that `holds`, None for silence."""
    end = time.time() + within_s
    while time.time() < end:
        message = link.recv_match(type=kind, blocking=True, timeout=0.5)
        if message is not None and holds(message):
            return message
    return None


def clear():
    """Forgets what was sent so far."""
    while link.recv_msg() is not None:
        pass


def said(message):
    return "answers" if message is not None else "is silent"


# Who is there, and what it tells by itself ------------------------------------------------------------

heartbeat = link.wait_heartbeat(timeout=30)
me = (link.target_system, link.target_component)
plane = heartbeat.autopilot == m.MAV_AUTOPILOT_ARDUPILOTMEGA and heartbeat.type == m.MAV_TYPE_FIXED_WING
rung("HEARTBEAT of an ArduPlane", "answers", "answers" if plane else "refuses", heartbeat)
heard, end = {}, time.time() + 2.5
while time.time() < end:
    message = link.recv_match(blocking=True, timeout=0.5)
    if message is not None:
        heard[message.get_type()] = message
for kind in ["SYS_STATUS", "POWER_STATUS", "MEMINFO", "SYSTEM_TIME", "GPS_RAW_INT", "RAW_IMU",
             "SCALED_PRESSURE", "ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT",
             "RC_CHANNELS", "SERVO_OUTPUT_RAW", "MISSION_CURRENT", "NAV_CONTROLLER_OUTPUT", "VFR_HUD",
             "BATTERY_STATUS", "VIBRATION", "EKF_STATUS_REPORT", "AHRS", "AHRS2"]:
    rung(f"stream {kind}", "answers", said(heard.get(kind)))
status = heard.get("SYS_STATUS")
healthy = status is not None and status.onboard_control_sensors_health & m.MAV_SYS_STATUS_GEOFENCE
rung("no fence is no breach", "answers", "answers" if healthy else "refuses", status)


def command(number, *parameters, whole=None, place=(0, 0, 0.0)):
    """The result of a command, as int if `whole` is a frame; None for silence."""
    clear()
    p = (list(parameters) + [0.0] * 7)[:7]
    if whole is None:
        link.mav.command_long_send(*me, number, 0, *p)
    else:
        link.mav.command_int_send(*me, whole, number, 0, 0, *p[:4], *place)
    ack = come("COMMAND_ACK", lambda ack: ack.command == number)
    return None if ack is None else ack.result


def obeyed(name, result, expected=m.MAV_RESULT_ACCEPTED):
    if result is None:
        got = "is silent"
    else:
        got = "answers" if result == m.MAV_RESULT_ACCEPTED else "refuses"
    wanted = "answers" if expected == m.MAV_RESULT_ACCEPTED else "refuses"
    if result is not None and result != expected and got == wanted:
        got = f"refuses otherwise ({result} for {expected})"
    rung(name, wanted, got, result)


def requested(name, number, which=0, by=None, expected="answers"):
    """A message by REQUEST_MESSAGE or by a command of its own; it comes after the answer."""
    result = command(by, 1) if by else command(m.MAV_CMD_REQUEST_MESSAGE, number, which)
    kind = m.mavlink_map[number].msgname if number in m.mavlink_map else f"UNKNOWN_{number}"
    message = come(kind, within_s=2.0) if result == 0 else None
    got = "is silent" if result is None else said(message) if result == 0 else "refuses"
    rung(name, expected, got, result)
    return message


# QGroundControl's and MAVSDK's first questions -------------------------------------------------------------

version = requested("AUTOPILOT_VERSION", m.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
needed = (m.MAV_PROTOCOL_CAPABILITY_MISSION_INT | m.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
          | m.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE | m.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY)
able = version is not None and version.capabilities & needed == needed
rung("capabilities for missions, fences and rally points", "answers", "answers" if able else "refuses", version)
requested("AUTOPILOT_VERSION by the older command", m.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
          by=m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES)
link.mav.autopilot_version_request_send(*me)
rung("AUTOPILOT_VERSION_REQUEST", "answers", said(come("AUTOPILOT_VERSION")))
requested("PROTOCOL_VERSION", 300)  # no longer in every dialect
modes = requested("AVAILABLE_MODES, the first", m.MAVLINK_MSG_ID_AVAILABLE_MODES, 1)
last = requested("AVAILABLE_MODES, the last", m.MAVLINK_MSG_ID_AVAILABLE_MODES, modes.number_modes if modes else 1)
requested("CURRENT_MODE", m.MAVLINK_MSG_ID_CURRENT_MODE)
requested("COMPONENT_METADATA", 397, expected="refuses")
requested("COMPONENT_INFORMATION", 395, expected="refuses")
home = requested("HOME_POSITION", m.MAVLINK_MSG_ID_HOME_POSITION)
requested("HOME_POSITION by the older command", m.MAVLINK_MSG_ID_HOME_POSITION, by=m.MAV_CMD_GET_HOME_POSITION)
requested("GPS_GLOBAL_ORIGIN", m.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
requested("ATTITUDE_QUATERNION", m.MAVLINK_MSG_ID_ATTITUDE_QUATERNION)
requested("EXTENDED_SYS_STATE", m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
requested("a message that no ArduPlane has", m.MAVLINK_MSG_ID_CAMERA_INFORMATION, expected="refuses")
if home is not None:
    HOME = (home.latitude, home.longitude)

obeyed("SET_MESSAGE_INTERVAL", command(m.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 200_000))
clear()
link.mav.command_long_send(*me, m.MAV_CMD_GET_MESSAGE_INTERVAL, 0, 30, 0, 0, 0, 0, 0, 0)
told = come("MESSAGE_INTERVAL", lambda told: told.message_id == 30)
rung("GET_MESSAGE_INTERVAL", "answers", said(told if told and told.interval_us == 200_000 else None), told)
link.mav.request_data_stream_send(*me, m.MAV_DATA_STREAM_RC_CHANNELS, 10, 1)
clear()
came = [come("RC_CHANNELS", within_s=0.5) for _ in range(10)]
rung("REQUEST_DATA_STREAM", "answers", said(came[-1]))
obeyed("DO_SEND_BANNER", command(m.MAV_CMD_DO_SEND_BANNER))

# Clocks and files --------------------------------------------------------------------------------------

clear()
link.mav.timesync_send(0, 4711)
rung("TIMESYNC", "answers", said(come("TIMESYNC", lambda t: t.ts1 == 4711 and t.tc1 != 0)))
link.mav.ping_send(1, 9, 0, 0)
rung("PING", "is silent", said(come("PING", lambda p: p.seq == 9 and p.target_system == 255)))


def file_request(opcode, path=b""):
    """The opcode of the answer to a request of the file protocol: 128 yes, 129 no."""
    payload = bytearray(251)
    payload[0], payload[3], payload[4] = 1, opcode, len(path)
    payload[12:12 + len(path)] = path
    clear()
    link.mav.file_transfer_protocol_send(0, *me, payload)
    answer = come("FILE_TRANSFER_PROTOCOL")
    return None if answer is None else answer.payload[3]


# ArduPlane has files and the stand-in none: it says so instead of leaving who asks waiting.
for name, opcode, path, expected in [("end of all file sessions", 2, b"", 128),
                                     ("list of files", 3, b"/", 129),
                                     ("parameters as a file", 4, b"@PARAM/param.pck", 129)]:
    got = file_request(opcode, path)
    rung(name, "answers" if expected == 128 else "refuses",
         "is silent" if got is None else "answers" if got == 128 else "refuses", got)
clear()
link.mav.log_request_list_send(*me, 0, 0xFFFF)
rung("list of logs", "answers", said(come("LOG_ENTRY", lambda entry: entry.num_logs == 0)))

# Parameters --------------------------------------------------------------------------------------------

clear()
link.mav.param_request_list_send(*me)
parameters, count = {}, None
while count is None or len(parameters) < count:
    p = come("PARAM_VALUE")
    if p is None:
        break
    parameters[p.param_index], count = p.param_id, p.param_count
rung("PARAM_REQUEST_LIST", "answers", "answers" if count and len(parameters) == count else "is silent", parameters)
link.mav.param_request_read_send(*me, b"WP_RADIUS", -1)
rung("PARAM_REQUEST_READ by name", "answers", said(come("PARAM_VALUE", lambda p: p.param_id == "WP_RADIUS")))
link.mav.param_request_read_send(*me, b"", 0)
rung("PARAM_REQUEST_READ by number", "answers", said(come("PARAM_VALUE", lambda p: p.param_index == 0)))
link.mav.param_request_read_send(*me, b"NO_SUCH_NAME", -1)
rung("PARAM_REQUEST_READ of a name it has not", "is silent", said(come("PARAM_VALUE", within_s=1.0)))
link.mav.param_set_send(*me, b"WP_RADIUS", 60.0, m.MAV_PARAM_TYPE_INT16)
kept = come("PARAM_VALUE", lambda p: p.param_id == "WP_RADIUS" and p.param_value == 60.0)
rung("PARAM_SET", "answers", said(kept))

# Missions, fences, rally points --------------------------------------------------------------------------------


def item(seq, number, north_m=0.0, east_m=0.0, up_m=0.0, p=(0, 0, 0, 0), kind=MISSION, frame=None):
    """An item some metres from home."""
    relative = m.MAV_FRAME_GLOBAL_RELATIVE_ALT if frame is None else frame
    x = HOME[0] + round(north_m / 111_195 * 1e7)
    y = HOME[1] + round(east_m / (111_195 * 0.7262) * 1e7)  # cos 43.43 deg
    return m.MAVLink_mission_item_int_message(*me, seq, relative, number, 0, 1, *map(float, p), x, y, float(up_m), kind)


def upload(items, kind):
    """The result of an upload, None for silence; items are asked for by the older message."""
    clear()
    link.mav.mission_count_send(*me, len(items), kind)
    while True:
        ask = come(["MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"])
        if ask is None or ask.mission_type != kind:
            return None
        if ask.get_type() == "MISSION_ACK":
            return ask.type
        link.mav.send(items[ask.seq])


def download(kind):
    """The items of a list, None for silence."""
    clear()
    link.mav.mission_request_list_send(*me, kind)
    told = come("MISSION_COUNT")
    if told is None or told.mission_type != kind:
        return None
    items = []
    for seq in range(told.count):
        link.mav.mission_request_int_send(*me, seq, kind)
        items.append(come("MISSION_ITEM_INT", lambda i: i.seq == seq and i.mission_type == kind))
    return items


def same(sent, back):
    # ArduPlane keeps no place of a command that needs none.
    place = lambda i: (0, 0) if i.command == m.MAV_CMD_DO_CHANGE_SPEED else (i.x, i.y)
    what = lambda i, x, y: (i.seq, i.command, x, y, round(i.z, 2), i.param1, i.param2, i.param3)
    return back is not None and None not in back and [what(i, *place(i)) for i in sent] == [what(i, i.x, i.y) for i in back]


def transferred(name, result, expected=m.MAV_MISSION_ACCEPTED):
    got = "is silent" if result is None else "answers" if result == m.MAV_MISSION_ACCEPTED else "refuses"
    wanted = "answers" if expected == m.MAV_MISSION_ACCEPTED else "refuses"
    if result is not None and result != expected and got == wanted:
        got = f"refuses otherwise ({result} for {expected})"
    rung(name, wanted, got, result)


TOUR = [
    item(0, m.MAV_CMD_NAV_WAYPOINT),
    item(1, m.MAV_CMD_NAV_TAKEOFF, up_m=60),
    item(2, m.MAV_CMD_NAV_WAYPOINT, 500, 0, 80),
    item(3, m.MAV_CMD_DO_CHANGE_SPEED, p=(0, 20, 0, 0)),
    item(4, m.MAV_CMD_NAV_WAYPOINT, 500, 600, 100),
    item(5, m.MAV_CMD_NAV_LOITER_TURNS, 0, 800, 80, p=(1, 0, 90, 0)),
    item(6, m.MAV_CMD_DO_LAND_START),
    item(7, m.MAV_CMD_NAV_LAND),
]
SQUARE = [item(k, m.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, n, e, p=(4, 0, 0, 0), kind=FENCE)
          for k, (n, e) in enumerate([(3000, 3000), (3000, -3000), (-3000, -3000), (-3000, 3000)])]
POINT = [item(0, m.MAV_CMD_NAV_RALLY_POINT, 300, 200, 90, kind=RALLY)]
for name, kind, items in [("mission", MISSION, TOUR), ("fence", FENCE, SQUARE), ("rally points", RALLY, POINT)]:
    before = download(kind)
    rung(f"download of the {name} on board", "answers", "is silent" if before is None else "answers")
    transferred(f"upload of a {name}", upload(items, kind))
    back = download(kind)
    # Item 0 of a mission is home, whatever was sent as such.
    skip = 1 if kind == MISSION else 0
    whole = back is not None and same(items[skip:], back[skip:])
    rung(f"{name} read back", "answers", "answers" if whole else "refuses", back)
clear()
link.mav.mission_request_send(*me, 2, MISSION)
rung("MISSION_REQUEST, the older form", "answers", said(come("MISSION_ITEM", lambda i: i.seq == 2)))
clear()
link.mav.mission_request_int_send(*me, 99, MISSION)
ack = come("MISSION_ACK")
transferred("an item beyond the end", None if ack is None else ack.type, m.MAV_MISSION_INVALID_SEQUENCE)
odd = [TOUR[0], item(1, m.MAV_CMD_NAV_ROI, 10, 10, 10)]
transferred("upload with a command that it has not", upload(odd, MISSION), m.MAV_MISSION_UNSUPPORTED)
off = [TOUR[0], item(1, m.MAV_CMD_NAV_WAYPOINT, up_m=50, frame=m.MAV_FRAME_LOCAL_NED)]
transferred("upload in a frame that it has not", upload(off, MISSION), m.MAV_MISSION_UNSUPPORTED_FRAME)
rung("after that the old mission is on board", "answers",
     "answers" if same(TOUR[1:], (download(MISSION) or [None])[1:]) else "refuses")
clear()
link.mav.mission_write_partial_list_send(*me, 2, 2, MISSION)
ask = come(["MISSION_REQUEST", "MISSION_REQUEST_INT"])
link.mav.send(TOUR[2])
ack = come("MISSION_ACK")
transferred("MISSION_WRITE_PARTIAL_LIST", None if ask is None or ack is None else ack.type)
for name, kind in [("fence", FENCE), ("rally points", RALLY)]:
    clear()
    link.mav.mission_clear_all_send(*me, kind)
    ack = come("MISSION_ACK", lambda ack: ack.mission_type == kind)
    transferred(f"MISSION_CLEAR_ALL of the {name}", None if ack is None else ack.type)
clear()
link.mav.mission_set_current_send(*me, 2)
rung("MISSION_SET_CURRENT", "answers", said(come("MISSION_CURRENT", lambda c: c.seq == 2)))
obeyed("DO_SET_MISSION_CURRENT", command(m.MAV_CMD_DO_SET_MISSION_CURRENT, 0))
obeyed("DO_SET_MISSION_CURRENT beyond the end", command(m.MAV_CMD_DO_SET_MISSION_CURRENT, 99), m.MAV_RESULT_DENIED)

# Commands on the ground ---------------------------------------------------------------------------------

link.mav.set_mode_send(link.target_system, 1, LOITER)
clear()
shown = come("HEARTBEAT", lambda h: h.custom_mode == LOITER)
rung("SET_MODE", "answers", said(shown))
obeyed("DO_CHANGE_SPEED in LOITER", command(m.MAV_CMD_DO_CHANGE_SPEED, 0, 17), m.MAV_RESULT_FAILED)
obeyed("DO_SET_MODE", command(m.MAV_CMD_DO_SET_MODE, 1, GUIDED))
obeyed("DO_SET_MODE to a mode it has not", command(m.MAV_CMD_DO_SET_MODE, 1, 99), m.MAV_RESULT_FAILED)
obeyed("DO_CHANGE_SPEED in GUIDED", command(m.MAV_CMD_DO_CHANGE_SPEED, 0, 17))
obeyed("NAV_TAKEOFF, a quadplane's", command(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 50), m.MAV_RESULT_FAILED)
obeyed("DO_SET_HOME to here", command(m.MAV_CMD_DO_SET_HOME, 1))
obeyed("RUN_PREARM_CHECKS", command(m.MAV_CMD_RUN_PREARM_CHECKS))
obeyed("PREFLIGHT_CALIBRATION of the gyroscopes", command(m.MAV_CMD_PREFLIGHT_CALIBRATION, 1))
obeyed("DO_FENCE_ENABLE without a fence", command(m.MAV_CMD_DO_FENCE_ENABLE, 1), m.MAV_RESULT_FAILED)
obeyed("a camera that is not there", command(m.MAV_CMD_IMAGE_START_CAPTURE), m.MAV_RESULT_UNSUPPORTED)
obeyed("a command that no dialect has", command(40_404), m.MAV_RESULT_UNSUPPORTED)
RELATIVE = m.MAV_FRAME_GLOBAL_RELATIVE_ALT
there = (HOME[0] + 40_000, HOME[1] + 40_000, 90.0)
reposition = lambda place: command(m.MAV_CMD_DO_REPOSITION, -1, 0, 100, 0, whole=RELATIVE, place=place)
obeyed("DO_REPOSITION", reposition(there))
obeyed("DO_REPOSITION to 0, 0", reposition((0, 0, 90.0)), m.MAV_RESULT_DENIED)
obeyed("DO_REPOSITION to the ground", reposition((*there[:2], 0.0)), m.MAV_RESULT_DENIED)
obeyed("DO_REPOSITION in floats", command(m.MAV_CMD_DO_REPOSITION, -1, 0, 100, 0), m.MAV_RESULT_UNSUPPORTED)
obeyed("back to LOITER", command(m.MAV_CMD_DO_SET_MODE, 1, LOITER))
obeyed("DO_REPOSITION outside GUIDED", reposition(there), m.MAV_RESULT_FAILED)

# The mission is flown -----------------------------------------------------------------------------------

obeyed("MISSION_START", command(m.MAV_CMD_MISSION_START))
obeyed("arming in AUTO", command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1))
obeyed("no disarming in flight", command(m.MAV_CMD_COMPONENT_ARM_DISARM, 0) if come(
    "EXTENDED_SYS_STATE", lambda s: s.landed_state != 1, 60) else None, m.MAV_RESULT_FAILED)
reached, down = [], None
end = time.time() + 30 + 600 / SPEED
while time.time() < end and down is None:
    message = link.recv_match(type=["MISSION_ITEM_REACHED", "HEARTBEAT"], blocking=True, timeout=1)
    if message is not None and message.get_type() == "MISSION_ITEM_REACHED":
        reached.append(message.seq)
    elif message is not None and not message.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED:
        down = message
rung("every item of the mission is reached", "answers",
     "answers" if reached[-5:] == [2, 3, 4, 5, 6] else "refuses", reached)
rung("it lands and disarms in AUTO", "answers", "answers" if down and down.custom_mode == AUTO else "refuses", down)

asked = answered + refused + silent
print(f"{asked} questions: {answered} answered, {refused} refused, {silent} met with silence; {len(failures)} not as"
      f" ArduPlane {failures}")
sys.exit(bool(failures))
