"""Flies the stand-in by clients that are not ours: pymavlink, MAVSDK or MAVProxy.

    pip install pymavlink mavsdk pyserial; pip install --no-deps MAVProxy
    mav-bridge stand-in --scenario scenarios/as-pontes.toml --vehicle 6 --hands-off &
    python tests/oracle/mavlink_clients.py pymavlink 14550      # or: mavsdk, mavproxy

The client connects, reads what a ground station shows, asks for parameters and missions, takes off,
and flies by commands. Ends with 0 if all came and every command was answered as it must be; tells
what did not. Written for pymavlink 2.4, mavsdk 4 and MAVProxy 1.8.
The whole ladder of questions is in mavlink_ladder.py.
"""

import asyncio
import json
import math
import os
import subprocess
import sys
import tempfile
import threading
import time

GOTO = (43.4350, -7.8450, 450.0)
RTL, LOITER, TAKEOFF, GUIDED = 11, 12, 13, 15
failures = []


def expect(what, holds, seen=""):
    print("ok  " if holds else "FAIL", what, seen, flush=True)
    if not holds:
        failures.append(what)


# pymavlink ---------------------------------------------------------------------------------------


def by_pymavlink(port):
    from pymavlink import mavutil

    m = mavutil.mavlink
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    heartbeat = link.wait_heartbeat(timeout=30)
    expect("heartbeat of an ArduPlane", heartbeat.autopilot == 3 and heartbeat.type == 1)
    me = (link.target_system, link.target_component)

    def command(number, *parameters, whole=False):
        """The result of a command, None for silence."""
        p = (list(parameters) + [0.0] * 7)[:7]
        if whole:
            p[4:6] = [int(p[4]), int(p[5])]
            link.mav.command_int_send(*me, m.MAV_FRAME_GLOBAL, number, 0, 0, *p)
        else:
            link.mav.command_long_send(*me, number, 0, *p)
        end = time.time() + 3
        while time.time() < end:
            ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1)
            if ack and ack.command == number:
                return ack.result
        return None

    for name in ["SYS_STATUS", "GPS_RAW_INT", "ATTITUDE", "GLOBAL_POSITION_INT", "VFR_HUD",
                 "LOCAL_POSITION_NED", "BATTERY_STATUS", "EXTENDED_SYS_STATE", "SCALED_PRESSURE",
                 "NAMED_VALUE_FLOAT"]:
        expect(f"stream {name}", link.recv_match(type=name, blocking=True, timeout=5) is not None)
    # A message asked for comes after the answer.
    for name in ["AUTOPILOT_VERSION", "HOME_POSITION", "GPS_GLOBAL_ORIGIN", "ATTITUDE_QUATERNION"]:
        number = getattr(m, f"MAVLINK_MSG_ID_{name}")
        for whole in (False, True):
            result = command(m.MAV_CMD_REQUEST_MESSAGE, number, whole=whole)
            message = link.recv_match(type=name, blocking=True, timeout=2)
            expect(f"{name} asked for, whole={whole}", result == 0 and message is not None, result)
    for older, name in [(520, "AUTOPILOT_VERSION"), (410, "HOME_POSITION")]:
        result = command(older, 1)
        message = link.recv_match(type=name, blocking=True, timeout=2)
        expect(f"{name} by command {older}", result == 0 and message is not None, result)
    expect("a message it has not", command(m.MAV_CMD_REQUEST_MESSAGE, 11000) == m.MAV_RESULT_FAILED)
    expect("interval", command(m.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 100_000) == 0)
    link.mav.command_long_send(*me, 510, 0, 30, 0, 0, 0, 0, 0, 0)
    told = link.recv_match(type="MESSAGE_INTERVAL", blocking=True, timeout=3)
    expect("interval told", told is not None and told.interval_us == 100_000, told)
    # Nothing is met with silence, not even a number that no dialect knows.
    for number in [m.MAV_CMD_DO_DIGICAM_CONTROL, m.MAV_CMD_DO_SET_ROI, 40_404]:
        for whole in (False, True):
            result = command(number, whole=whole)
            expect(f"command {number}, whole={whole}", result == m.MAV_RESULT_UNSUPPORTED, result)
    link.mav.set_mode_send(link.target_system, 1, LOITER)
    # Obeyed without an acknowledgement, as by ArduPlane 4.8.
    until, shown = time.time() + 3, None
    while time.time() < until and (shown is None or shown.custom_mode != LOITER):
        shown = link.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
    expect("SET_MODE", shown is not None and shown.custom_mode == LOITER, shown)

    link.mav.param_request_list_send(*me)
    parameters = {}
    while not parameters or len(parameters) < count:
        p = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=3)
        if p is None:
            break
        parameters[p.param_id], count = p.param_value, p.param_count
    expect("all parameters", len(parameters) >= 9 and "TKOFF_ALT" in parameters, parameters)
    link.mav.request_data_stream_send(*me, m.MAV_DATA_STREAM_ALL, 10, 1)
    start, positions = time.time(), 0
    while time.time() < start + 3:
        positions += link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=1) is not None
    expect("10 Hz by REQUEST_DATA_STREAM", 20 <= positions <= 32, positions)

    def mode(number):
        result = command(m.MAV_CMD_DO_SET_MODE, 1, number)
        end = time.time() + 5
        while time.time() < end:
            shown = link.recv_match(type="HEARTBEAT", blocking=True, timeout=2)
            if shown and shown.custom_mode == number:
                return result == 0
        return False

    expect("mode TAKEOFF", mode(TAKEOFF))
    expect("arming", command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0)
    end = time.time() + 40
    while time.time() < end:
        position = link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=2)
        if position and position.relative_alt > 40_000:
            break
    expect("in the air", position.relative_alt > 40_000, position.relative_alt)
    expect("mode GUIDED", mode(GUIDED))
    far = (GOTO[0] * 1e7, GOTO[1] * 1e7, GOTO[2])
    goto = (-1, 0, 100, 0, *far)
    expect("goto", command(m.MAV_CMD_DO_REPOSITION, *goto, whole=True) == 0)
    expect("goto in floats", command(m.MAV_CMD_DO_REPOSITION, *goto) == m.MAV_RESULT_UNSUPPORTED)
    expect("speed", command(m.MAV_CMD_DO_CHANGE_SPEED, 0, 16) == 0)
    expect("hold", command(m.MAV_CMD_NAV_LOITER_UNLIM) == 0 and mode(LOITER))
    expect("return", command(m.MAV_CMD_NAV_RETURN_TO_LAUNCH) == 0)
    expect("no disarming in flight", command(m.MAV_CMD_COMPONENT_ARM_DISARM, 0) == m.MAV_RESULT_FAILED)


# MAVSDK ------------------------------------------------------------------------------------------


async def by_mavsdk(port):
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.action import ActionAsync
    from mavsdk.asyncio.plugins.info import InfoAsync
    from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkMessage
    from mavsdk.asyncio.plugins.mission_raw import MissionItem, MissionRawAsync
    from mavsdk.asyncio.plugins.param import ParamAsync
    from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, TelemetryAsync

    def item(seq, command, north_m, east_m, up_m, p=(0.0, 0.0, 0.0, 0.0), kind=0):
        x, y = (round(v * 1e7) for v in (GOTO[0] + north_m / 111_195, GOTO[1] + east_m / 80_750))
        return MissionItem(seq, 3, command, int(seq == 0), 1, *map(float, p), x, y, float(up_m), kind)

    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    vehicle = await sdk.first_autopilot(timeout_s=30)
    expect("connected", vehicle is not None and await vehicle.is_connected())
    telemetry, action, direct = TelemetryAsync(vehicle), ActionAsync(vehicle), MavlinkDirectAsync(vehicle)

    async def come(what, subscription, holds=lambda value: True, within_s=10):
        """Waits for a value of the kind asked for."""
        last = None
        try:
            async with asyncio.timeout(within_s):
                async for last in subscription:
                    if holds(last):
                        break
            expect(what, True, str(last).replace("\n", " ")[:120])
        except TimeoutError:
            expect(what, False, f"last: {last}")
        return last

    async def answered(what, call, error=None):
        """Awaits a call; `error` is the word it must be refused with."""
        try:
            value = await asyncio.wait_for(call, 20)
            expect(what, error is None, str(value)[:120])
            return value
        except Exception as refused:  # each plugin has an exception of its own
            expect(what, error is not None and error in str(refused), refused)

    await answered("rate of quaternions", telemetry.set_rate_attitude_quaternion(5.0))
    for name in ["position", "home", "in_air", "landed_state", "armed", "attitude_euler",
                 "attitude_quaternion", "attitude_angular_velocity_body", "velocity_ned", "raw_gps",
                 "battery", "flight_mode", "heading", "fixedwing_metrics", "scaled_pressure",
                 "position_velocity_ned"]:
        await come(name, getattr(telemetry, f"subscribe_{name}")())
    await come("gps_info", telemetry.subscribe_gps_info(), lambda g: g.num_satellites > 5)
    await come("health", telemetry.subscribe_health(), lambda h: h.is_global_position_ok and h.is_home_position_ok)
    await answered("origin", telemetry.get_gps_global_origin())
    info = InfoAsync(vehicle)
    await answered("version", info.get_version())
    await answered("identification", info.get_identification())
    parameters = ParamAsync(vehicle)
    every = await answered("all parameters", parameters.get_all_params())
    names = [p.name for p in every.int_params + every.float_params] if every else []
    expect("parameters by type", "FS_GCS_ENABL" in names and "RTL_ALTITUDE" in names, names)
    await answered("integer parameter", parameters.get_param_int("FS_GCS_ENABL"))
    await answered("set parameter", parameters.set_param_int("TKOFF_ALT", 50))
    raw = MissionRawAsync(vehicle)
    aboard = await answered("download of the landing sequence", raw.download_mission())
    expect("home, a landing start and a landing", [i.command for i in aboard or []] == [16, 189, 21])
    mission = [item(seq, *what) for seq, what in enumerate([(16, 0, 0, 0), (22, 0, 0, 60), (16, 500, 0, 90)])]
    await answered("upload", raw.upload_mission(mission))
    back = await answered("download", raw.download_mission())
    what = lambda i: (i.seq, i.command, i.x, i.y, i.z)
    expect("mission read back", [what(i) for i in (back or [])[1:]] == [what(i) for i in mission[1:]], back)
    fence = [item(seq, 5001, n, e, 0, (4, 0, 0, 0), 1) for seq, (n, e) in enumerate(
        [(3000, 3000), (3000, -3000), (-3000, -3000), (-3000, 3000)])]
    await answered("upload of a fence", raw.upload_geofence(fence))
    back = await answered("download of the fence", raw.download_geofence())
    expect("fence read back", [(i.x, i.y) for i in back or []] == [(i.x, i.y) for i in fence], back)
    # To clear, MAVSDK uploads one item to an ArduPilot.
    await answered("clear", raw.clear_mission())

    await answered("take-off of a multicopter", action.takeoff(), "FAILED")
    mode = dict(target_system=0, target_component=1, command=176, confirmation=0, param1=1,
                param2=TAKEOFF, param3=0, param4=0, param5=0, param6=0, param7=0)
    await direct.send_message(MavlinkMessage("COMMAND_LONG", 245, 190, 0, 1, json.dumps(mode)))
    await come("mode TAKEOFF", telemetry.subscribe_flight_mode(), lambda m: m == FlightMode.TAKEOFF)
    await answered("arming", action.arm())
    await come("climbs", telemetry.subscribe_position(), lambda p: p.relative_altitude_m > 40, 40)
    await come("flies", telemetry.subscribe_in_air(), lambda flies: flies)
    await come("in the air", telemetry.subscribe_landed_state(), lambda s: s == LandedState.IN_AIR)
    await answered("hold", action.hold())
    await come("mode LOITER", telemetry.subscribe_flight_mode(), lambda m: m == FlightMode.HOLD)
    await answered("goto", action.goto_location(*GOTO, math.nan))
    start = await come("before", telemetry.subscribe_position())
    await come("climbs to the place", telemetry.subscribe_position(),
               lambda p: p.absolute_altitude_m > start.absolute_altitude_m + 10, 40)
    await answered("disarming in flight", action.disarm(), "FAILED")
    await answered("return", action.return_to_launch())
    await come("mode RTL", telemetry.subscribe_flight_mode(), lambda m: m == FlightMode.RETURN_TO_LAUNCH)


# MAVProxy ----------------------------------------------------------------------------------------

WAYPOINTS = """QGC WPL 110
0 0 0 16 0 0 0 0 43.4294 -7.8404 340 1
1 0 3 22 0 0 0 0 43.4294 -7.8404 60 1
2 0 3 16 0 0 0 0 43.4340 -7.8404 80 1
3 0 3 16 0 0 0 0 43.4340 -7.8350 100 1
""".replace(" ", "\t").replace("QGC\tWPL\t110", "QGC WPL 110")


def by_mavproxy(port):
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "tour.txt"), "w") as file:
            file.write(WAYPOINTS)
        program = [sys.executable, "-u", "-m", "MAVProxy.mavproxy", f"--master=udpin:127.0.0.1:{port}",
                   "--state-basedir=" + folder, "--default-modules=cmdlong,wp,mode,arm,param,fence,rally"]
        session = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, bufsize=1, cwd=folder)
        # A line that never comes must not hold up the rest.
        guard = threading.Timer(120, session.kill)
        guard.start()
        said = []

        def after(command, answer, within_s=20):
            """Gives a command and waits for a line with the answer."""
            if command:
                session.stdin.write(command + "\n")
            end = time.time() + within_s
            while time.time() < end:
                line = session.stdout.readline()
                if not line:
                    break
                said.append(line)
                if answer in line:
                    return expect(f"{command or 'at start'}: {answer}", True)
            expect(f"{command or 'at start'}: {answer}", False, said[-5:])

        try:
            after("", "Detected vehicle 6:1")
            after("", "Received 18 parameters")
            after("wp load tour.txt", "Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
            after("wp list", "Saved 4 waypoints")
            after("mode LOITER", "Mode LOITER")
            after("mode AUTO", "Mode AUTO")
            after("arm throttle", "Throttle armed")
            after("", "AP: Takeoff complete", 60)
            after("wp set 2", "waypoint 2")
            after("mode RTL", "Mode RTL")
            # What MAVProxy says of a vehicle whose SYS_STATUS has no word on its fence.
            expect("no fence breach", not any("fence breach" in line for line in said), said)
        finally:
            guard.cancel()
            session.kill()


if __name__ == "__main__":
    if sys.argv[1] == "mavsdk":
        asyncio.run(by_mavsdk(int(sys.argv[2])))
    elif sys.argv[1] == "mavproxy":
        by_mavproxy(int(sys.argv[2]))
    else:
        by_pymavlink(int(sys.argv[2]))
    print(len(failures), "failures", failures)
    sys.exit(bool(failures))
