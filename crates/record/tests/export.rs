//! What was flown, exported and read back.

use crate::synthetic;
use formats::cdr::{Cdr, Definitions, short};
use formats::mcap_records::Records;
use mcap::records::Record;
use plume::Gas;
use protocol::digest::Digest;
use protocol::key::Name;
use protocol::message::{Message, Model};
use record::export::foxglove::{Converter, PlumeShape};
use record::export::{Flown, columns, geojson, netcdf, ros2};
use record::kml::MapFeatures;
use record::{Recorder, Recording, RunInfo, read_mcap};
use std::collections::BTreeMap;
use std::path::PathBuf;

const START_NS: i64 = 1_795_782_600_000_000_000;
const TICKS: u64 = 120;

fn path(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("plumage-{name}-{}.mcap", std::process::id()));
    let _ = std::fs::remove_file(&path);
    path
}

fn info() -> RunInfo {
    RunInfo {
        mission: Name::new("made-up").unwrap(),
        scenario_toml: String::new(),
        gas: Gas::Co2,
        files: BTreeMap::new(),
        start_unix_ns: Some(START_NS),
        state_hz: None,
        seed: 1,
        versions: BTreeMap::new(),
    }
}

fn recorded(name: &str) -> Recording {
    let path = path(name);
    let mut recorder = Recorder::create(&path, &info()).unwrap();
    for (topic, envelope) in synthetic::mission(TICKS) {
        recorder.record(&topic, &envelope).unwrap();
    }
    recorder.finish(None).unwrap();
    read_mcap(&path).unwrap()
}

fn flown(name: &str) -> Flown {
    let recording = recorded(name);
    let flown = Flown::of_recording(&recording).unwrap();
    std::fs::remove_file(recording.path()).unwrap();
    flown
}

fn around() -> MapFeatures {
    MapFeatures {
        mission: "made-up".to_owned(),
        shown: record::colour::Shown::CO2,
        stacks: Vec::new(),
        fence: vec![(43.40, -7.90), (43.47, -7.80), (43.40, -7.80)],
        fence_top_amsl_m: 1200.0,
        peak: None,
    }
}

#[test]
fn csv_is_observations_and_says_what_was_said() {
    let flown = flown("csv");
    let text = String::from_utf8(formats::table::csv(&columns::columns(&flown)).unwrap()).unwrap();
    let read = scenario::observations::parse(&[("out.csv", &text)], Gas::Co2).unwrap();
    assert_eq!(read.platforms, ["1", "2", "3", "4", "5", "6"]);
    let said = synthetic::mission(TICKS).filter_map(|(topic, envelope)| match envelope.message {
        Message::Reading(r) => Some((topic.path(), envelope.time.s(), r.co2_ppm, r.lat_deg)),
        _ => None,
    });
    let rows = read.rows.iter().map(|row| {
        let name = format!("va/{}/reading", read.platforms[row.platform]);
        (name, row.time_s, row.co2_ppm.unwrap(), row.lat_deg)
    });
    assert_eq!(rows.collect::<Vec<_>>(), said.collect::<Vec<_>>());
    let last = text.lines().last().unwrap();
    // 11.9 s after date -u -d @1795782600.
    assert!(last.ends_with("real,2026-11-27T12:30:11.900Z"), "{last}");
    let again = Flown::of_observations("out", &read, Some(START_NS));
    assert_eq!(again.readings.len(), flown.readings.len());
}

#[test]
fn a_bag_reads_back_by_its_own_definitions() {
    let flown = flown("ros2");
    let bag = ros2::bag(&flown, Some(synthetic::frame()), Some(55.0), "out").unwrap();
    let mut records = Records::new(&bag.mcap[..]).unwrap();
    let (mut schemas, mut channels) = (BTreeMap::new(), BTreeMap::new());
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut last = 0;
    while let Some(record) = records.record().unwrap() {
        match record {
            Record::Schema { header, data } => {
                let text = String::from_utf8(data.into_owned()).unwrap();
                let definitions = Definitions::parse(&header.name, &text);
                schemas.insert(header.id, (short(&header.name).to_owned(), definitions));
            }
            Record::Channel(channel) => {
                channels.insert(channel.id, channel);
            }
            Record::Message { header, data } => {
                let channel = &channels[&header.channel_id];
                let (kind, definitions) = &schemas[&channel.schema_id];
                let mut found = Vec::new();
                let mut cdr = Cdr::new(&data).unwrap();
                cdr.all(definitions, kind, "", 0, &mut found).unwrap();
                let value = |name: &str| found.iter().find(|f| f.0 == name).unwrap().1;
                assert!(header.log_time >= last);
                last = header.log_time;
                let stamp = value("header.stamp.sec") * 1e9 + value("header.stamp.nanosec");
                assert!((stamp - header.log_time as f64).abs() < 1e3);
                match kind.as_str() {
                    "NavSatFix" => assert!((value("altitude") - 55.0 - 826.0).abs() < 71.0),
                    "Odometry" => {
                        // The synthetic vehicles fly level: the velocity in their own axes is as fast as over ground.
                        let speed = |of: &str| ["x", "y", "z"].map(|k| value(&format!("{of}.{k}")));
                        let body = speed("twist.twist.linear")
                            .map(|v| v * v)
                            .iter()
                            .sum::<f64>()
                            .sqrt();
                        assert!(
                            body < 17.0 && value("pose.pose.position.z") > 400.0,
                            "{body}"
                        );
                    }
                    _ => {}
                }
                *counts.entry(kind.clone()).or_default() += 1;
            }
            _ => {}
        }
    }
    let each = TICKS as usize * 6;
    for kind in ["NavSatFix", "Odometry", "TwistStamped", "GasReading"] {
        assert_eq!(counts[kind], each, "{kind}");
    }
    assert!(
        bag.metadata
            .contains(&format!("message_count: {}\n", 4 * each))
    );
}

#[test]
fn maps_and_trajectories_hold_every_reading() {
    let flown = flown("maps");
    let text = geojson::collection(&flown, Some(&around()), &[]);
    let all: serde_json::Value = serde_json::from_str(&text).unwrap();
    let features = all["features"].as_array().unwrap();
    let count = |what: &str| {
        features
            .iter()
            .filter(|f| f["properties"]["what"] == what)
            .count()
    };
    assert_eq!(
        (count("reading"), count("track"), count("fence")),
        (720, 6, 1)
    );
    let fence = features
        .iter()
        .find(|f| f["properties"]["what"] == "fence")
        .unwrap();
    // Anticlockwise, though the corners were given clockwise: 43.40, -7.80 follows the first.
    assert_eq!(
        fence["geometry"]["coordinates"][0][0][0],
        fence["geometry"]["coordinates"][0][0][3]
    );
    let bytes = netcdf::trajectories(&flown);
    assert_eq!(&bytes[..4], b"CDF\x02");
    // Each of its numbers of readings has eight bytes: time, place, gas, wind, air and attitude.
    assert!(bytes.len() > 720 * 8 * 12);
}

#[test]
fn a_recording_with_foxgloves_messages_is_the_same_recording() {
    let recording = recorded("plain");
    let beside = path("beside");
    let mut recorder = Recorder::create(&beside, &recording.info).unwrap();
    let plume = |_: &Model| PlumeShape::default();
    let mut converter = Converter::new(Some(START_NS), synthetic::frame(), around(), plume);
    let (mut digest, mut said) = (Digest::new(), converter.begin());
    for message in recording.in_order().unwrap() {
        let (topic, envelope) = message.unwrap();
        recorder.record(&topic, &envelope).unwrap();
        digest.add(&topic, &envelope);
        said.extend(converter.take(&topic, &envelope));
        for said in said.drain(..) {
            let schema = said.kind.json_schema();
            let fields = schema["properties"].as_object().unwrap();
            assert!(
                said.json
                    .as_object()
                    .unwrap()
                    .keys()
                    .all(|k| fields.contains_key(k))
            );
            let schema = (said.kind.name(), &schema);
            recorder
                .beside(&said.topic, schema, said.time, &said.json.to_string())
                .unwrap();
        }
    }
    recorder.finish(Some(&digest.hex())).unwrap();
    let again = read_mcap(&beside).unwrap();
    assert_eq!(again.digest().unwrap().0, recording.digest().unwrap().0);
    for path in [recording.path(), &beside] {
        std::fs::remove_file(path).unwrap();
    }
}
