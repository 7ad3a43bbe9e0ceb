# The recording of crates/import/tests/data: pip install mcap==1.6.0 mcap-ros2-support==0.6.0; python3 ros2_recording.py ros2-recording
# A recording of ROS 2 by the packages mcap 1.6.0 and mcap-ros2-support 0.6.0.
import sys
from mcap_ros2.writer import Writer
NAVSAT = """std_msgs/Header header
sensor_msgs/NavSatStatus status
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 COVARIANCE_TYPE_UNKNOWN=0
uint8 position_covariance_type
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: sensor_msgs/NavSatStatus
int8 STATUS_NO_FIX = -1
int8 status
uint16 service
"""
T0 = 1714557600
with open(sys.argv[1], 'wb') as f:
    w = Writer(f)
    fix = w.register_msgdef('sensor_msgs/msg/NavSatFix', NAVSAT)
    gas = w.register_msgdef('std_msgs/msg/Float32', 'float32 data\n')
    air = w.register_msgdef('sensor_msgs/msg/FluidPressure', "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n================================================================================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n")
    for k in range(10):
        at = (T0 + k) * 10**9
        head = {'stamp': {'sec': T0 + k, 'nanosec': 0}, 'frame_id': 'gps'}
        w.write_message('/fix', fix, {'header': head, 'status': {'status': 0, 'service': 1}, 'latitude': 43.44 + k * 1e-4, 'longitude': -7.86, 'altitude': 754.5 + k, 'position_covariance': [0.0] * 9, 'position_covariance_type': 0}, log_time=at + 10**8, publish_time=at)
        w.write_message('/air', air, {'header': head, 'fluid_pressure': 93025.0, 'variance': 0.0}, log_time=at, publish_time=at)
        w.write_message('/sensors/co2', gas, {'data': 421.0 + k}, log_time=at + 5 * 10**8, publish_time=at)
    w.finish()
