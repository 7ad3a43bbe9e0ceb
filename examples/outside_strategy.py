"""Run a search strategy outside the program: climb from the best reading so far.

Needs `pip install eclipse-zenoh` and a mission in real time whose scenario has `search.strategy = "outside"` and whose
processes run with `--json`. A vehicle close to its destination, or a minute after the last one, receives another: around the
best reading so far, ever closer to it. While no reading stands out, destinations are around the start of the search. Start and
threshold default to those of as-pontes. On the host of the mission the script finds the mission's key by itself; elsewhere
set --mission-key or PLUMAGE_MISSION_KEY.

    python3 outside_strategy.py --mission as-pontes --connect tcp/127.0.0.1:7447
"""

import argparse
import json
import math
import random
import threading
import time

import zenoh

from mission_key import Speaker, find_key

METRES_PER_DEGREE = 111_195.0
NEAR_M = 150.0
PATIENCE_S = 60.0


def displaced(lat_deg, lon_deg, east_m, north_m):
    east_deg = east_m / (METRES_PER_DEGREE * math.cos(math.radians(lat_deg)))
    return lat_deg + north_m / METRES_PER_DEGREE, lon_deg + east_deg


def distance_m(a, b):
    east = (b[1] - a[1]) * math.cos(math.radians(a[0]))
    return METRES_PER_DEGREE * math.hypot(b[0] - a[0], east)


class Climb:
    """Destinations around the best reading, in a circle that shrinks with every visit."""

    def __init__(self, arguments):
        self.site = (arguments.lat, arguments.lon, arguments.alt)
        self.radius_m = arguments.radius
        self.stands_out_ppm = arguments.stands_out
        self.lowest_ppm = math.inf
        self.best = None  # ppm, (lat, lon, alt)
        self.lock = threading.Lock()
        self.destinations = {}  # vehicle: (place, since)

    def read(self, message):
        place = (message["lat_deg"], message["lon_deg"], message["alt_amsl_m"])
        with self.lock:
            ppm = message["co2_ppm"]
            self.lowest_ppm = min(self.lowest_ppm, ppm)
            least = self.best[0] if self.best else self.lowest_ppm + self.stands_out_ppm
            if ppm > least:
                self.best = (ppm, place)

    def destination(self, vehicle, here):
        """Return the vehicle's next place, if it is time for one."""
        with self.lock:
            place, since = self.destinations.get(vehicle, (None, 0.0))
            if place and distance_m(here, place) > NEAR_M and time.monotonic() - since < PATIENCE_S:
                return None
            lat, lon, alt = self.best[1] if self.best else self.site
            spread_m = self.radius_m
            if self.best:
                self.radius_m = max(NEAR_M, 0.95 * self.radius_m)
            lat, lon = displaced(lat, lon, random.gauss(0, spread_m), random.gauss(0, spread_m))
            place = (lat, lon, alt + random.gauss(0, 0.05 * spread_m))
            self.destinations[vehicle] = (place, time.monotonic())
            return place


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mission", default="as-pontes")
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447")
    parser.add_argument("--mission-key", help="file with the mission's key")
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--lat", type=float, default=43.4467, help="start of the search")
    parser.add_argument("--lon", type=float, default=-7.8480)
    parser.add_argument("--alt", type=float, default=850.0, help="m above mean sea level")
    parser.add_argument("--radius", type=float, default=1000.0, help="radius around it, m")
    parser.add_argument("--stands-out", type=float, default=20.0, help="excess over the lowest reading that counts as plume, ppm")
    arguments = parser.parse_args()

    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([arguments.connect]))
    config.insert_json5("scouting/multicast/enabled", "false")
    root = f"plumage/{arguments.mission}/va"
    climb = Climb(arguments)
    sequence = 0

    with zenoh.open(config) as session:
        speaker = Speaker(session, arguments.mission, find_key(arguments.mission, arguments.mission_key))

        def heard(sample):
            nonlocal sequence
            vehicle, topic = str(sample.key_expr).split("/")[-2:]
            envelope = json.loads(sample.payload.to_string())
            message = envelope["message"]
            if topic == "reading":
                climb.read(message)
                return
            if not message["airborne"]:
                return
            place = climb.destination(vehicle, (message["lat_deg"], message["lon_deg"]))
            if place is None:
                return
            sequence += 1
            told = {
                "wire_version": envelope["wire_version"],
                "sender": "op/main",
                "sequence": sequence,
                "time_ns": envelope["time_ns"],
                "message": dict(zip(("lat_deg", "lon_deg", "alt_amsl_m"), place)),
            }
            speaker.put(f"{root}/{vehicle}/destination", told)
            print(f"{envelope['time_ns'] * 1e-9:7.1f} s: {vehicle} to {place[0]:.4f}, {place[1]:.4f}, {place[2]:.0f} m")

        subscribers = [session.declare_subscriber(f"{root}/*/{topic}", heard) for topic in ("reading", "state")]
        end = time.monotonic() + arguments.seconds
        try:
            while time.monotonic() < end:
                time.sleep(0.2)
        except KeyboardInterrupt:
            pass
        for subscriber in subscribers:
            subscriber.undeclare()


if __name__ == "__main__":
    main()
