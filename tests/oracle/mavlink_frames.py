"""Golden MAVLink 2 frames, by an implementation that is not ours.

Run:   pip install pymavlink==2.4.50
       python tests/oracle/mavlink_frames.py > tests/oracle/mavlink_frames.csv

Each row: direction, name, the frame in hexadecimal. `from-vehicle` frames are what an ArduPlane
of system 1 sends (sequence 0, 1, 2, ...), `to-vehicle` ones what a ground station of system 255,
component 190 must send. The last frames of each direction are signed with the key 00 01 .. 1f,
link 3, time 37e12.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as m


class Sink:
    def write(self, _):
        pass


def frames(sender, direction, messages):
    for name, message in messages:
        packed = message.pack(sender)
        sender.seq = (sender.seq + 1) % 256
        print(f"{direction},{name},{bytes(packed).hex()}")


def sign(sender):
    sender.signing.secret_key = bytes(range(32))
    sender.signing.link_id = 3
    sender.signing.timestamp = 37_000_000_000_000
    sender.signing.sign_outgoing = True


print("direction,name,hex")
plane = m.MAVLink(Sink(), srcSystem=1, srcComponent=1)
heartbeat = m.MAVLink_heartbeat_message(
    m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, 0x99, 15, m.MAV_STATE_ACTIVE, 3
)
frames(
    plane,
    "from-vehicle",
    [
        ("heartbeat", heartbeat),
        ("attitude", m.MAVLink_attitude_message(60_000, 0.25, -0.05, -math.pi / 2, 0.1, 0.2, 0.3)),
        ("vfr_hud", m.MAVLink_vfr_hud_message(17.5, 21.0, 270, 55, 650.25, -0.5)),
        ("scaled_pressure", m.MAVLink_scaled_pressure_message(60_000, 937.5, 1.8, 3150)),
        ("hygrometer", m.MAVLink_hygrometer_sensor_message(0, 1525, 7000)),
        ("wind", m.MAVLink_wind_message(-108.0, 8.25, 0.0)),
        ("extended", m.MAVLink_extended_sys_state_message(0, m.MAV_LANDED_STATE_IN_AIR)),
        (
            "position",
            m.MAVLink_global_position_int_message(
                60_000, 434_417_000, -78_631_000, 650_250, 310_250, -200, -2_100, 50, 27_000
            ),
        ),
        ("co2", m.MAVLink_named_value_float_message(60_000, b"CO2", 512.5)),
        ("ack", m.MAVLink_command_ack_message(m.MAV_CMD_DO_REPOSITION, m.MAV_RESULT_ACCEPTED)),
        ("parameter", m.MAVLink_param_value_message(b"FS_GCS_ENABL", 0.0, 9, 1, 2)),
        ("text", m.MAVLink_statustext_message(m.MAV_SEVERITY_WARNING, b"GCS Failsafe On")),
    ],
)
sign(plane)
frames(plane, "from-vehicle", [("signed_heartbeat", heartbeat)])

ground = m.MAVLink(Sink(), srcSystem=255, srcComponent=190)
frames(
    ground,
    "to-vehicle",
    [
        ("heartbeat", m.MAVLink_heartbeat_message(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)),
        (
            "rate",
            m.MAVLink_command_long_message(
                1, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 33, 100_000, 0, 0, 0, 0, 0
            ),
        ),
        ("guided", m.MAVLink_command_long_message(1, 1, m.MAV_CMD_DO_SET_MODE, 0, 1, 15, 0, 0, 0, 0, 0)),
        (
            "reposition",
            m.MAVLink_command_int_message(
                1, 1, m.MAV_FRAME_GLOBAL, m.MAV_CMD_DO_REPOSITION, 0, 0,
                -1.0, 0.0, 120.0, 0.0, 434_417_000, -78_631_000, 700.0,
            ),
        ),
        (
            "speed",
            m.MAVLink_command_long_message(1, 1, m.MAV_CMD_DO_CHANGE_SPEED, 0, 0, 16.5, -1, 0, 0, 0, 0),
        ),
        ("arm", m.MAVLink_command_long_message(1, 1, m.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)),
        ("land", m.MAVLink_command_long_message(1, 1, m.MAV_CMD_DO_LAND_START, 0, 0, 0, 0, 0, 0, 0, 0)),
        ("read", m.MAVLink_param_request_read_message(1, 1, b"FS_GCS_ENABL", -1)),
    ],
)
sign(ground)
frames(
    ground,
    "to-vehicle",
    [("signed_heartbeat", m.MAVLink_heartbeat_message(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))],
)
