"""Steps per second of JSBSim's loop with the coefficients of the X8 (no servos, no autopilot).

    pip install jsbsim && python3 benches/peers/jsbsim_loop.py
"""
import os
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "tests", "oracle"))
import jsbsim_aircraft as j  # noqa: E402

STEPS = 200_000
fdm = j.load(tempfile.mkdtemp(), os.path.join(HERE, "..", "..", "aircraft", "x8.toml"), 0.01, 1.225)
j.start(fdm, 18.0, 0.0308, 0.0308, 0.0, (0.0370, 0.0, 0.0, 0.1219))
begin = time.perf_counter()
for _ in range(STEPS):
    fdm.run()
print(f"JSBSim, one vehicle, step of 10 ms: {STEPS / (time.perf_counter() - begin):,.0f} steps/s")
