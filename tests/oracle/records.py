# What a mission leaves, read by programs of others: pip install fastkml lxml pyogrio mcap rosbags xarray netCDF4 pyarrow
# foxglove-sdk protobuf; python3 records.py FOLDER, which holds mission.mcap, tracks.kml and the exports (tests/clients.rs).
# What each reads is compared with what the package mcap finds in the recording.
import json
import math
import sys
import zipfile
from pathlib import Path

import numpy
import pyarrow.parquet
import pyogrio
import xarray
from fastkml.validator import get_schema_parser
from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory
from lxml import etree
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
import foxglove.messages

folder = Path(sys.argv[1])
START_NS = 1_795_782_600 * 10**9


def own():
    """Readings of the recording: their number, and the highest by vehicle."""
    count, highest, times = 0, {}, []
    with open(folder / "mission.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        names = [a.name for a in reader.iter_attachments()]
        assert "scenario.toml" in names and "files/aircraft/x8.toml" in names, names
        for _, channel, message in reader.iter_messages():
            if channel.topic.endswith("/reading"):
                said = json.loads(message.data)
                assert message.log_time == START_NS + said["time_ns"]
                vehicle = channel.topic.split("/")[-2]
                ppm = said["message"]["co2_ppm"]
                highest[vehicle] = max(highest.get(vehicle, -math.inf), ppm)
                times.append(said["time_ns"])
                count += 1
    return count, highest, times


def same(found, expected):
    assert abs(found - expected) <= 1e-9 * abs(expected), (found, expected)


COUNT, HIGHEST, TIMES = own()
TOP = max(HIGHEST.values())

# OGC's schema, with Google's extension as far as it comes with it; and GDAL.
for document in [folder / "tracks.kml", folder / "out.kml"]:
    schema = get_schema_parser()
    tree = etree.parse(document)
    assert schema.validate(tree), list(schema.error_log)[:3]
    spaces = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
    assert len(tree.findall(".//gx:Track", spaces)) == len(HIGHEST)
    assert tree.find(".//gx:Track/k:when", spaces).text.startswith("2026-11-27T12:30:")
    layers = [pyogrio.raw.read(document, layer=name)[2] for name, _ in pyogrio.list_layers(document)]
    assert sum(len(shapes) for shapes in layers) > 10
with zipfile.ZipFile(folder / "out.kmz") as packed:
    assert packed.testzip() is None and packed.namelist() == ["doc.kml"]
    assert packed.read("doc.kml") == (folder / "out.kml").read_bytes()

info = pyogrio.read_info(folder / "out.geojson")
whats, ppm = [pyogrio.raw.read(folder / "out.geojson", columns=[c])[3][0] for c in ["what", "co2_ppm"]]
assert (whats == "reading").sum() == COUNT, (info, COUNT)
same(numpy.nanmax(ppm[whats == "reading"]), TOP)
for what in ["track", "plume", "stack", "fence"]:
    assert (whats == what).any(), what

table = pyarrow.parquet.read_table(folder / "out.parquet")
assert table.num_rows == COUNT and str(table.schema.field("time_utc").type) == "timestamp[ns, tz=UTC]"
same(max(table["co2_ppm"].to_pylist()), TOP)
rows = (folder / "out.csv").read_text().splitlines()
assert len(rows) == COUNT + 1 and rows[0].startswith("time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,"), rows[0]

flown = xarray.open_dataset(folder / "out.nc")
assert flown.attrs["featureType"] == "trajectory" and flown.sizes["obs"] == COUNT
at = 0
for name, size in zip(flown["trajectory"].values, flown["row_size"].values):
    of_vehicle = flown["co2"].values[at:at + int(size)]
    at += int(size)
    same(of_vehicle.max(), HIGHEST[name.decode().strip("\0") if isinstance(name, bytes) else name])
assert at == COUNT
first = flown["time"].values.min().astype("datetime64[ns]").astype(int)
assert abs(int(first) - START_NS - min(TIMES)) < 1000, first

store = get_typestore(Stores.ROS2_HUMBLE)
with Reader(folder / "out-ros2") as bag:
    for connection in bag.connections:
        if connection.msgtype.startswith("plumage_msgs"):
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
    kinds = {c.msgtype.split("/")[-1] for c in bag.connections}
    assert kinds == {"NavSatFix", "Odometry", "TwistStamped", "GasReading"}, kinds
    readings, fixes, top = 0, 0, -math.inf
    for connection, time_ns, raw in bag.messages():
        message = store.deserialize_cdr(raw, connection.msgtype)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert stamp == time_ns and stamp >= START_NS
        if connection.msgtype.endswith("GasReading"):
            readings += 1
            top = max(top, message.mole_fraction_ppm)
        elif connection.msgtype.endswith("NavSatFix"):
            fixes += 1
            assert 43 < message.latitude < 44 and 300 < message.altitude < 2000
        elif connection.msgtype.endswith("Odometry"):
            q = message.pose.pose.orientation
            assert abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 1e-9
    assert readings == COUNT and fixes > COUNT / 4, (readings, fixes)
    same(top, TOP)


def protobuf(name):
    """The class of Foxglove's own definition of a message."""
    schema = getattr(foxglove.messages, name).get_schema()
    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove." + name))


def to_protobuf(value):
    """Foxglove's JSON has times as sec and nsec, protobuf's as text."""
    if isinstance(value, list):
        return [to_protobuf(v) for v in value]
    if not isinstance(value, dict):
        return value
    if set(value) == {"sec", "nsec"}:
        if value["sec"] < 10**6:
            return f'{value["sec"]}.{value["nsec"]:09d}s'
        return str(numpy.datetime64(value["sec"] * 10**9 + value["nsec"], "ns")) + "Z"
    return {k: to_protobuf(v) for k, v in value.items()}


kinds, classes, mission = {}, {}, 0
with open(folder / "out-foxglove.mcap", "rb") as file:
    for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
        if not schema.name.startswith("foxglove."):
            mission += 1
            continue
        name = schema.name.removeprefix("foxglove.")
        kinds[name] = kinds.get(name, 0) + 1
        if kinds[name] > 200:
            continue
        said = json.loads(message.data)
        known = classes.setdefault(name, protobuf(name))
        json_format.ParseDict(to_protobuf(said), known())
        assert set(said) <= set(json.loads(schema.data)["properties"])
assert set(kinds) >= {"LocationFix", "FrameTransform", "SceneUpdate", "Grid", "Log"}, kinds
print("readings", COUNT, "highest", TOP, "foxglove", kinds, "mission", mission)
