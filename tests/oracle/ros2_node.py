# A mission as ROS 2 on rmw_zenoh hears it: a router as rmw_zenohd, the types of rosbags, and the keys of rmw_zenoh's design.
# python3 ros2_node.py PLUMAGE SCENARIO OUT PORT; the scenario has a mission.start. Prints how many messages were heard.
import pathlib
import struct
import subprocess
import sys
from collections import Counter

import zenoh
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

plumage, scenario, out, port = sys.argv[1:]
out = pathlib.Path(out)
endpoint = f"tcp/127.0.0.1:{port}"
DOMAIN = 7

config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", f'["{endpoint}"]')
config.insert_json5("scouting/multicast/enabled", "false")
router = zenoh.open(config)
heard, tokens = [], []
said = router.declare_subscriber(f"{DOMAIN}/**", heard.append)
shown = router.liveliness().declare_subscriber(f"@ros2_lv/{DOMAIN}/**", lambda token: tokens.append(str(token.key_expr)))
subprocess.run(
    [plumage, "run", scenario, "--duration", "150", "--speed", "15", "--no-serve", "--out", out,
     f"--ros2={endpoint}", "--ros2-domain", str(DOMAIN), "--undulation-m", "55"],
    check=True, stdout=subprocess.DEVNULL,
)
router.close()
subprocess.run(
    [plumage, "export", out / "mission.mcap", "--to", "ros2", "--undulation-m", "55", "--out", out / "bag"],
    check=True, stdout=subprocess.DEVNULL,
)

store = get_typestore(Stores.ROS2_JAZZY)
bag, kinds = Counter(), {}
with Reader(out / "bag") as reader:
    for connection in reader.connections:
        kinds[connection.topic] = connection.msgtype
        if connection.msgtype.startswith("plumage_msgs") and connection.msgtype not in store.types:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
    for connection, time_ns, raw in reader.messages():
        bag[connection.topic, time_ns, bytes(raw)] += 1

publishers = {}
for token in set(tokens):
    parts = token.split("/")
    assert parts[1] == str(DOMAIN) and parts[3] == "0" and parts[6:9] == ["%", "%", "plumage"], token
    if parts[5] == "MP":
        publishers[parts[9].replace("%", "/")] = parts[10:]
assert any(token.split("/")[5] == "NN" for token in tokens), tokens
assert publishers.keys() == kinds.keys(), (publishers.keys(), kinds.keys())

last = {}
for sample in heard:
    _, *topic, kind, type_hash = str(sample.key_expr).split("/")
    topic = "/" + "/".join(topic)
    package, namespace, name = kinds[topic].split("/")
    assert kind == f"{package}::{namespace}::dds_::{name}_", kind
    assert type_hash == store.hash_rihs01(kinds[topic]), (kinds[topic], type_hash)
    assert publishers[topic] == [kind, type_hash, "::,10:,:,:,,"], publishers[topic]
    number, time_ns, length, identity = struct.unpack("<qqB16s", sample.attachment.to_bytes())
    before, of = last.get(topic, (None, identity))
    assert length == 16 and identity == of and (before is None or number == before + 1), (topic, number, before)
    last[topic] = number, identity
    raw = sample.payload.to_bytes()
    stamp = store.deserialize_cdr(raw, kinds[topic]).header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == time_ns
    bag[topic, time_ns, raw] -= 1
    assert bag[topic, time_ns, raw] >= 0, topic
assert len({identity for _, identity in last.values()}) == len(kinds)
missing = sum(bag.values())
# What was said before the two had found each other.
assert missing < len(heard) / 5, (missing, len(heard))
print(f"{len(heard)} heard, {missing} not")
