//! Recordings: written, cut short, damaged, foreign, out of order, and read back.

use crate::synthetic;
use protocol::digest::Digest;
use protocol::key::Name;
use protocol::{Envelope, Message, SimTime, Topic};
use record::recording::RecordingEnd;
use record::{RecordError, Recorder, RunInfo, ThreadedRecorder, read_mcap};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

fn info() -> RunInfo {
    RunInfo {
        mission: Name::new("as-pontes").unwrap(),
        scenario_toml: "[mission]\nname = \"as-pontes\"\n".to_owned(),
        gas: plume::Gas::Ch4,
        files: [("aircraft/mine.toml".to_owned(), b"name = 1".to_vec())].into(),
        start_unix_ns: Some(1_795_782_600_000_000_000),
        state_hz: None,
        seed: 7,
        versions: BTreeMap::from([("plumage".to_owned(), "0.1.0".to_owned())]),
    }
}

fn fresh(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("plumage-{name}-{}.mcap", std::process::id()));
    let _ = fs::remove_file(&path);
    path
}

fn digest_of_mission(ticks: u64) -> String {
    let mut digest = Digest::new();
    for (topic, envelope) in synthetic::mission(ticks) {
        digest.add(&topic, &envelope);
    }
    digest.hex()
}

fn record(path: &std::path::Path, ticks: u64) {
    let mut recorder = Recorder::create(path, &info()).unwrap();
    for (topic, envelope) in synthetic::mission(ticks) {
        recorder.record(&topic, &envelope).unwrap();
    }
    let digest = digest_of_mission(ticks);
    recorder.finish(Some(&digest)).unwrap();
}

#[test]
fn what_was_recorded_is_read_back_bit_for_bit() {
    let path = fresh("whole");
    record(&path, 200);
    let recording = read_mcap(&path).unwrap();
    assert_eq!(recording.info, info());
    let read: Result<Vec<_>, _> = recording.envelopes().unwrap().collect();
    let said: Vec<_> = synthetic::mission(200).collect();
    assert_eq!(read.unwrap(), said);
    let digest = digest_of_mission(200);
    let ending = RecordingEnd::Complete {
        digest: Some(digest.clone()),
    };
    assert_eq!(recording.digest().unwrap(), (digest, ending));
    fs::remove_file(path).unwrap();
}

#[test]
fn a_recording_from_a_thread_is_the_same_and_waits_rather_than_drops() {
    let path = fresh("thread");
    let mut recorder = ThreadedRecorder::create(&path, &info()).unwrap();
    for (topic, envelope) in synthetic::mission(1000) {
        recorder.record(&topic, &envelope).unwrap();
    }
    let finished = recorder.finish(None).unwrap();
    assert_eq!(finished.messages, synthetic::mission(1000).count() as u64);
    let (digest, _) = read_mcap(&path).unwrap().digest().unwrap();
    assert_eq!(digest, digest_of_mission(1000));
    fs::remove_file(path).unwrap();
}

/// Ten messages a second of each simulated vehicle, of which one is kept; all others stay.
#[test]
fn a_thinned_recording_holds_simulated_states_at_its_rate_and_the_digest_of_the_run() {
    let info = RunInfo {
        state_hz: Some(1.0),
        ..info()
    };
    let path = fresh("thinned");
    let mut recorder = ThreadedRecorder::create(&path, &info).unwrap();
    for (topic, envelope) in synthetic::mission(200) {
        recorder.record(&topic, &envelope).unwrap();
    }
    let digest = digest_of_mission(200);
    recorder.finish(Some(&digest)).unwrap();
    let recording = read_mcap(&path).unwrap();
    assert_eq!(recording.info, info);
    let read: Vec<(Topic, Envelope)> = recording
        .envelopes()
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap();
    let is_periodic = |topic: &Topic| matches!(topic, Topic::State(_) | Topic::Reading(_));
    let is_real = |topic: &Topic| {
        topic
            .vehicle()
            .is_some_and(|v| v.as_str() == synthetic::REAL)
    };
    // 200 ticks of 0.1 s: the first of each second is kept.
    let kept = |(topic, envelope): &(Topic, Envelope)| {
        !is_periodic(topic) || is_real(topic) || envelope.time.ns() % 1_000_000_000 == 0
    };
    let expected: Vec<_> = synthetic::mission(200).filter(kept).collect();
    assert_eq!(read, expected);
    assert_eq!(recording.digest().unwrap().0, digest);

    // Cut short, it has no digest, and its messages are all there.
    let whole = fresh("thinned-cut");
    let mut recorder = Recorder::create(&whole, &info).unwrap();
    for (topic, envelope) in synthetic::mission(20) {
        recorder.record(&topic, &envelope).unwrap();
    }
    recorder.flush().unwrap();
    let cut = fresh("thinned-cut-copy");
    fs::copy(&whole, &cut).unwrap();
    let why = read_mcap(&cut).unwrap().digest().unwrap_err().to_string();
    assert!(why.contains("record.state_hz"), "{why}");
    drop(recorder);
    for file in [path, whole, cut] {
        fs::remove_file(file).unwrap();
    }
}

/// What a killed program leaves: all that the system was given, without the file's end.
#[test]
fn a_killed_recorder_loses_less_than_a_second() {
    let path = fresh("killed");
    let mut recorder = ThreadedRecorder::create(&path, &info()).unwrap();
    for n in 0..400 {
        for (topic, envelope) in synthetic::tick(n) {
            recorder.record(&topic, &envelope).unwrap();
        }
        // Not a multiple of the chunk, so that something is always on its way.
        if n % 37 == 36 {
            let left = fresh("killed-copy");
            // The thread may be in the midst of writing; what is in the file now is what counts.
            fs::copy(&path, &left).unwrap();
            let recording = read_mcap(&left).unwrap();
            let mut messages = recording.envelopes().unwrap();
            let last = messages.by_ref().map(|m| m.unwrap().1.time).max();
            let lost_s =
                SimTime::of_tick(n, synthetic::TICK_NS).since_s(last.unwrap_or(SimTime::ZERO));
            assert!(lost_s < 1.0, "{lost_s} s lost at tick {n}");
            let loss = messages.ending().loss().unwrap();
            assert!(loss.contains("cut short"), "{loss}");
            fs::remove_file(left).unwrap();
        }
    }
    recorder.finish(None).unwrap();
    fs::remove_file(path).unwrap();
}

#[test]
fn a_file_cut_anywhere_reads_up_to_the_cut() {
    let path = fresh("cut");
    record(&path, 100);
    let whole = fs::read(&path).unwrap();
    let said: Vec<_> = synthetic::mission(100).collect();
    let cut = fresh("cut-short");
    let mut most = 0;
    for length in (0..whole.len()).step_by(whole.len() / 60) {
        fs::write(&cut, &whole[..length]).unwrap();
        let Ok(recording) = read_mcap(&cut) else {
            assert!(
                length < 1500,
                "the front is small and readable: cut at {length}"
            );
            continue;
        };
        let read: Vec<_> = recording.envelopes().unwrap().map(Result::unwrap).collect();
        assert!(read.len() >= most, "a longer file holds no less");
        most = read.len();
        assert_eq!(read, said[..read.len()]);
    }
    assert!(most > said.len() * 9 / 10, "{most} of {}", said.len());
    fs::remove_file(path).unwrap();
    fs::remove_file(cut).unwrap();
}

#[test]
fn damage_and_foreign_files_are_refused_in_words() {
    let path = fresh("foreign");
    fs::write(&path, b"time_s,platform,lat_deg\n0,1,43.4\n").unwrap();
    let refused = read_mcap(&path).unwrap_err().to_string();
    assert!(refused.contains("not an MCAP file"), "{refused}");

    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    writer.finish().unwrap();
    let refused = read_mcap(&path).unwrap_err().to_string();
    assert!(refused.contains("no scenario"), "{refused}");

    assert!(matches!(
        read_mcap(&fresh("none")),
        Err(RecordError::File { .. })
    ));
    fs::remove_file(path).unwrap();
}

#[test]
fn no_damage_passes_unsaid() {
    let path = fresh("damage");
    record(&path, 50);
    let whole = fs::read(&path).unwrap();
    let said: Vec<_> = synthetic::mission(50).collect();
    // The index behind the messages serves other tools only and is not read here. It begins where
    // the footer says: before the offset of offsets, the checksum and the closing magic.
    let footer = whole.len() - 8 - 4 - 8 - 8;
    let index = u64::from_le_bytes(whole[footer..footer + 8].try_into().unwrap()) as usize;
    for at in (8..index).step_by(211) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        fs::write(&path, &bytes).unwrap();
        let Ok(recording) = read_mcap(&path) else {
            continue;
        };
        let mut messages = recording.envelopes().unwrap();
        let read: Vec<_> = messages.by_ref().collect();
        let refused = read.iter().any(Result::is_err) || messages.ending().loss().is_some();
        assert!(
            refused,
            "byte {at} of {} turned over, and nothing said",
            whole.len()
        );
        for message in read.into_iter().flatten() {
            assert!(said.contains(&message), "byte {at} made up a message");
        }
    }
    fs::remove_file(path).unwrap();
}

/// The bytes of the file's chunks in the middle are spoilt one after the other.
#[test]
fn a_damaged_chunk_costs_its_own_messages_alone() {
    let path = fresh("spoilt");
    record(&path, 200);
    let whole = fs::read(&path).unwrap();
    let said: Vec<_> = synthetic::mission(200).collect();
    let mut lost_most = 0;
    for part in [3, 5, 8] {
        let mut bytes = whole.clone();
        bytes[whole.len() * part / 10] ^= 1;
        fs::write(&path, &bytes).unwrap();
        let mut messages = read_mcap(&path).unwrap().in_order().unwrap();
        let read: Vec<_> = messages.by_ref().map(Result::unwrap).collect();
        assert!(read.iter().all(|m| said.contains(m)));
        let RecordingEnd::Damaged { what, digest } = messages.ending() else {
            panic!("the damage is not told");
        };
        assert!(what.contains("in one place") && digest.is_some(), "{what}");
        lost_most = lost_most.max(said.len() - read.len());
    }
    // A chunk holds .4 s, which is 4 of the 200 ticks.
    assert!(
        lost_most > 0 && lost_most <= said.len() * 5 / 200,
        "{lost_most}"
    );
    fs::remove_file(path).unwrap();
}

/// As `mcap compress` and its like leave it: LZ4, and metadata and attachments behind the messages.
#[test]
fn a_recording_that_another_tool_wrote_anew_is_read() {
    let (path, other) = (fresh("own"), fresh("anew"));
    record(&path, 30);
    let mut records = formats::mcap_records::Records::new(fs::File::open(&path).unwrap()).unwrap();
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let mut writer = options.create(fs::File::create(&other).unwrap()).unwrap();
    let (mut channels, mut behind) = (BTreeMap::new(), Vec::new());
    while let Some(record) = records.record().unwrap() {
        use mcap::records::Record;
        match record {
            Record::Channel(c) => {
                let id = writer
                    .add_channel(0, &c.topic, "json", &BTreeMap::new())
                    .unwrap();
                channels.insert(c.id, id);
            }
            Record::Message { mut header, data } => {
                // The recorder's times are those of the start that the scenario says.
                let since_ns = header.log_time - 1_795_782_600_000_000_000;
                assert!(since_ns < 3_000_000_000 && header.log_time == header.publish_time);
                header.channel_id = channels[&header.channel_id];
                writer.write_to_known_channel(&header, &data).unwrap();
            }
            other => behind.push(other),
        }
    }
    for record in behind {
        use mcap::records::Record;
        match record {
            Record::Metadata(m) => writer.write_metadata(&m).unwrap(),
            Record::Attachment { header, data, .. } => writer
                .attach(&mcap::Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })
                .unwrap(),
            _ => {}
        }
    }
    writer.finish().unwrap();
    let read = read_mcap(&other).unwrap();
    assert_eq!(read.info, info());
    let (digest, end) = read.digest().unwrap();
    assert_eq!(
        end,
        RecordingEnd::Complete {
            digest: Some(digest.clone())
        }
    );
    assert_eq!(digest, digest_of_mission(30));
    for path in [path, other] {
        fs::remove_file(path).unwrap();
    }
}

#[test]
fn another_wire_version_is_named() {
    let path = fresh("version");
    let mut info = info();
    // Metadata of ours wins over a version of that name, so the field is written last here.
    info.versions
        .insert("wire_version".to_owned(), "200".to_owned());
    Recorder::create(&path, &info)
        .unwrap()
        .finish(None)
        .unwrap();
    assert!(
        read_mcap(&path).is_ok(),
        "what a caller says of versions cannot spoil the recording"
    );
    let bytes = fs::read(&path).unwrap();
    let needle = b"\x0c\x00\x00\x00wire_version\x01\x00\x00\x002";
    let at = bytes
        .windows(needle.len())
        .position(|w| w == needle)
        .unwrap();
    let mut other = bytes;
    other[at + needle.len() - 1] = b'9';
    fs::write(&path, other).unwrap();
    let refused = read_mcap(&path).unwrap_err().to_string();
    assert!(refused.contains("wire version 9"), "{refused}");
    fs::remove_file(path).unwrap();
}

#[test]
fn nothing_recorded_is_overwritten() {
    let path = fresh("exists");
    record(&path, 5);
    let before = fs::read(&path).unwrap();
    assert!(matches!(
        Recorder::create(&path, &info()),
        Err(RecordError::Exists { .. })
    ));
    assert_eq!(fs::read(&path).unwrap(), before);
    fs::remove_file(path).unwrap();
}

#[test]
fn a_number_that_is_none_is_left_out_and_counted() {
    let path = fresh("nan");
    let mut recorder = Recorder::create(&path, &info()).unwrap();
    let mut bad = 0;
    for (topic, mut envelope) in synthetic::mission(20) {
        if let Message::Reading(reading) = &mut envelope.message
            && envelope.sequence.is_multiple_of(7)
        {
            reading.co2_ppm = f64::NAN;
            bad += 1;
        }
        recorder.record(&topic, &envelope).unwrap();
    }
    let finished = recorder.finish(None).unwrap();
    assert_eq!(finished.not_finite.values().sum::<u64>(), bad);
    let read = read_mcap(&path)
        .unwrap()
        .envelopes()
        .unwrap()
        .map(Result::unwrap);
    assert_eq!(
        read.count() as u64,
        synthetic::mission(20).count() as u64 - bad
    );
    fs::remove_file(path).unwrap();
}

#[test]
fn a_recording_from_a_network_is_brought_into_order() {
    let path = fresh("network");
    let mut recorder = Recorder::create(&path, &info()).unwrap();
    // One vehicle is heard half a second late, and within a tick the senders come backwards.
    let mut heard: Vec<_> = synthetic::mission(300)
        .map(|(topic, envelope)| {
            let late = if envelope.sender.to_string() == "va/3" {
                500_000_000
            } else {
                0
            };
            (envelope.time.ns() + late, topic, envelope)
        })
        .collect();
    heard.sort_by(|a, b| (a.0, &b.2.sender, a.2.sequence).cmp(&(b.0, &a.2.sender, b.2.sequence)));
    for (_, topic, envelope) in &heard {
        recorder.record(topic, envelope).unwrap();
    }
    recorder.finish(None).unwrap();
    let (digest, _) = read_mcap(&path).unwrap().digest().unwrap();
    assert_eq!(digest, digest_of_mission(300));
    fs::remove_file(path).unwrap();
}

#[test]
fn a_message_that_comes_far_too_late_gets_its_place() {
    let path = fresh("late");
    let mut recorder = Recorder::create(&path, &info()).unwrap();
    // 20 s, as from a host that was cut off.
    for n in 1..200 {
        for (topic, envelope) in synthetic::tick(n) {
            recorder.record(&topic, &envelope).unwrap();
        }
    }
    for (topic, envelope) in synthetic::tick(0) {
        recorder.record(&topic, &envelope).unwrap();
    }
    recorder.finish(None).unwrap();
    let (digest, _) = read_mcap(&path).unwrap().digest().unwrap();
    assert_eq!(digest, digest_of_mission(200));
    fs::remove_file(path).unwrap();
}

#[test]
fn real_readings_become_observations() {
    let path = fresh("observations");
    record(&path, 300);
    let recording = read_mcap(&path).unwrap();
    let all = record::observations::of_recording(&recording).unwrap();
    assert_eq!(all.platforms, [synthetic::REAL]);
    assert_eq!(all.rows.len(), 300);
    let said: Vec<f64> = synthetic::mission(300)
        .filter_map(|(topic, e)| match e.message {
            Message::Reading(r) if topic.path() == "va/6/reading" => Some(r.co2_ppm),
            _ => None,
        })
        .collect();
    let read: Vec<f64> = all.rows.iter().filter_map(|r| r.co2_ppm).collect();
    assert_eq!(read, said);
    // As a file of the same rows would say it.
    let text = all.to_csv();
    let parsed = scenario::observations::parse(&[("mission.csv", &text)], plume::Gas::Ch4).unwrap();
    assert_eq!(parsed.rows, all.rows);
    fs::remove_file(path).unwrap();
}

#[test]
fn what_the_controller_passed_on_serves_where_readings_are_missing() {
    let path = fresh("passed-on");
    let mut recorder = Recorder::create(&path, &info()).unwrap();
    for (topic, envelope) in synthetic::mission(100) {
        if topic.path().starts_with("sc/") {
            recorder.record(&topic, &envelope).unwrap();
        }
    }
    recorder.finish(None).unwrap();
    let recording = read_mcap(&path).unwrap();
    let rows = record::observations::of_recording(&recording).unwrap().rows;
    assert_eq!(rows.len(), 100);
    fs::remove_file(&path).unwrap();

    Recorder::create(&path, &info())
        .unwrap()
        .finish(None)
        .unwrap();
    let recording = read_mcap(&path).unwrap();
    let refused = record::observations::of_recording(&recording).unwrap_err();
    assert!(refused.to_string().contains("no reading of a real vehicle"));
    fs::remove_file(path).unwrap();
}
