# The telemetry log of crates/import/tests/data: pip install pymavlink==2.4.50; python3 telemetry_log.py telemetry.tlog
# A telemetry log of 60 s: MAVLink 2, a vehicle (system 3) and a ground station (255).
import struct, math, sys
from pymavlink.dialects.v20 import ardupilotmega as m
out = open(sys.argv[1], 'wb')
class Null:
    def write(self, b): pass
v = m.MAVLink(Null(), srcSystem=3, srcComponent=1); g = m.MAVLink(Null(), srcSystem=255, srcComponent=190)
T0 = 1714557600.0  # 2024-05-01T10:00:00Z
def say(mav, t, msg): out.write(struct.pack('>Q', round((T0+t)*1e6)) + msg.pack(mav))
for k in range(60):
    t = float(k)
    say(v, t, m.MAVLink_heartbeat_message(1, 3, 0, 10, 4, 3))
    say(g, t+.01, m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    say(v, t+.1, m.MAVLink_global_position_int_message(int(t*1000), round((43.44+1e-4*t)*1e7), round(-7.86*1e7), round((700+t)*1000), 360000, 1800, 0, -100, 0))
    say(v, t+.2, m.MAVLink_wind_message(-90.0, 6.5, 0.0))
    say(v, t+.3, m.MAVLink_scaled_pressure_message(int(t*1000), 930.25, 0.0, 4200))
    say(v, t+.35, m.MAVLink_attitude_message(int(t*1000), math.radians(10), math.radians(-2), math.radians(90), 0.1, 0.0, -0.1))
    say(v, t+.6, m.MAVLink_named_value_float_message(int(t*1000), b'CO2', 421.0+t))
out.write(b'\x00\x01')
out.close()
