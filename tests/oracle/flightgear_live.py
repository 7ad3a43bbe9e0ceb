"""Reads a running vehicle's FlightGear packets with pymavlink's fgFDM.

    pip install pymavlink
    plumage run scenarios/as-pontes.toml --speed real --duration 20 --flightgear 1=127.0.0.1:5500 &
    python tests/oracle/flightgear_live.py 5500
"""
import socket
import sys
import time

from pymavlink import fgFDM

link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.bind(("127.0.0.1", int(sys.argv[1])))
link.settimeout(30)
fdm = fgFDM.fgFDM()
start, count = None, 0
while start is None or time.time() - start < 5:
    packet = link.recv(2048)
    start = start or time.time()
    count += 1
    assert len(packet) == fdm.packet_size(), len(packet)
    fdm.parse(packet)
    assert fdm.get("version") == 24
print("packets a second", (count - 1) / 5)
for name, units in [("latitude", "degrees"), ("longitude", "degrees"), ("altitude", "meters"),
                    ("agl", "meters"), ("phi", "degrees"), ("theta", "degrees"),
                    ("psi", "degrees"), ("vcas", "mps"), ("v_north", "mps"), ("v_east", "mps")]:
    print(name, round(fdm.get(name, units=units), 5), units)
