//! What goes over the wire: golden bytes, JSON, and what is refused.

use proptest::prelude::*;
use protocol::key::Name;
use protocol::message::{
    Ambient, ControlLevel, EventMessage, MavlinkFrame, Mode, Population, PromisingPoint, Severity,
};
use protocol::{AgentId, Envelope, Message, ProtocolError, SimTime, Topic, WIRE_VERSION};

fn topic() -> Topic {
    Topic::Ambient(Name::new("3").unwrap())
}

fn ambient() -> Envelope {
    Envelope {
        sender: AgentId::ws(),
        sequence: 7,
        time: SimTime::from_ns(20_000_000),
        message: Message::Ambient(Ambient {
            wind_ned_m_s: [1.0, -2.0, 0.0],
            gust_ned_m_s: [0.0; 3],
            temperature_k: 288.15,
            pressure_pa: 97_000.0,
            co2_ppm: 449.0,
            ground_amsl_m: 340.0,
        }),
    }
}

/// Laid out by hand from the bincode 2 specification: version byte; "ws/main" as length and
/// UTF-8; 7 and the zigzag of 20,000,000 as variable-length integers (0xfc and four bytes,
/// little endian); variant 6; ten doubles, little endian.
#[test]
fn golden_bytes() {
    let mut expected = vec![2u8, 7];
    expected.extend(b"ws/main");
    expected.push(7);
    expected.push(0xfc);
    expected.extend(40_000_000u32.to_le_bytes());
    expected.push(6);
    for value in [
        1.0f64, -2.0, 0.0, 0.0, 0.0, 0.0, 288.15, 97_000.0, 449.0, 340.0,
    ] {
        expected.extend(value.to_le_bytes());
    }
    assert_eq!(ambient().to_bytes(), expected);
    assert_eq!(Envelope::from_bytes(&topic(), &expected), Ok(ambient()));
}

#[test]
fn json_reads_as_the_readme_shows_and_back() {
    let json: serde_json::Value = serde_json::from_str(&ambient().to_json()).unwrap();
    assert_eq!(json["wire_version"], 2);
    assert_eq!(json["sender"], "ws/main");
    assert_eq!(json["time_ns"], 20_000_000);
    assert_eq!(json["message"]["co2_ppm"], 449.0);
    assert_eq!(
        Envelope::from_json(&topic(), &json.to_string()),
        Ok(ambient())
    );
}

#[test]
fn frames_are_hexadecimal_in_json() {
    let topic = Topic::MavlinkRx(Name::new("6").unwrap());
    let envelope = Envelope {
        sender: AgentId::va("6").unwrap(),
        sequence: 1,
        time: SimTime::ZERO,
        message: Message::Mavlink(MavlinkFrame {
            bytes: vec![0xfd, 0x09, 0x00],
        }),
    };
    assert!(envelope.to_json().contains("\"hex\":\"fd0900\""));
    assert_eq!(
        Envelope::from_json(&topic, &envelope.to_json()),
        Ok(envelope.clone())
    );
    assert_eq!(
        Envelope::from_bytes(&topic, &envelope.to_bytes()),
        Ok(envelope)
    );
}

#[test]
fn another_wire_version_is_named() {
    let mut bytes = ambient().to_bytes();
    bytes[0] = WIRE_VERSION + 1;
    let refused = Envelope::from_bytes(&topic(), &bytes).unwrap_err();
    assert_eq!(
        refused,
        ProtocolError::WireVersion {
            theirs: WIRE_VERSION + 1,
            ours: WIRE_VERSION
        }
    );
    let json = ambient()
        .to_json()
        .replace("\"wire_version\":2", "\"wire_version\":9");
    assert!(matches!(
        Envelope::from_json(&topic(), &json),
        Err(ProtocolError::WireVersion { theirs: 9, .. })
    ));
}

#[test]
fn what_does_not_belong_on_a_topic_is_refused() {
    let model = Topic::Model;
    assert!(matches!(
        Envelope::from_bytes(&model, &ambient().to_bytes()),
        Err(ProtocolError::WrongMessage {
            found: "Ambient",
            expected: "Model",
            ..
        })
    ));
    let mut forged = ambient();
    forged.sender = AgentId::sc();
    assert!(matches!(
        Envelope::from_bytes(&topic(), &forged.to_bytes()),
        Err(ProtocolError::ForeignSender { .. })
    ));
}

#[test]
fn a_length_beyond_the_limit_is_refused_before_it_is_allocated() {
    // A population that claims 2^60 points.
    let mut bytes = vec![WIRE_VERSION, 7];
    bytes.extend(b"sc/main");
    bytes.extend([1, 0, 8, 0, 0xfd]);
    bytes.extend((1u64 << 60).to_le_bytes());
    assert!(matches!(
        Envelope::from_bytes(&Topic::Population, &bytes),
        Err(ProtocolError::Garbage { .. })
    ));
}

fn any_message() -> impl Strategy<Value = (Topic, AgentId, Message)> {
    let va = || Name::new("a_1").unwrap();
    prop_oneof![
        (any::<[f64; 3]>(), any::<f64>()).prop_map(move |(wind, co2_ppm)| {
            let mut message = ambient().message;
            if let Message::Ambient(a) = &mut message {
                a.wind_ned_m_s = wind;
                a.co2_ppm = co2_ppm;
            }
            (topic(), AgentId::ws(), message)
        }),
        (".{0,40}", any::<bool>()).prop_map(move |(reason, setpoints_obeyed)| {
            let mode = Mode {
                level: ControlLevel::Guardian,
                reason,
                setpoints_obeyed,
            };
            (
                Topic::Mode(va()),
                AgentId::va("a_1").unwrap(),
                Message::Mode(mode),
            )
        }),
        ("[a-z-]{1,20}", ".{0,80}").prop_map(|(code, text)| {
            let event = EventMessage {
                severity: Severity::Warning,
                code,
                text,
            };
            (
                Topic::Event(AgentId::sc()),
                AgentId::sc(),
                Message::Event(event),
            )
        }),
        (
            any::<u64>(),
            prop::collection::vec(any::<[f64; 4]>(), 0..50)
        )
            .prop_map(|(generation, p)| {
                let points = p
                    .into_iter()
                    .map(
                        |[lat_deg, lon_deg, alt_amsl_m, fitness_ppm]| PromisingPoint {
                            lat_deg,
                            lon_deg,
                            alt_amsl_m,
                            fitness_ppm,
                        },
                    )
                    .collect();
                (
                    Topic::Population,
                    AgentId::sc(),
                    Message::Population(Population { generation, points }),
                )
            }),
    ]
}

proptest! {
    #[test]
    fn binary_round_trip((topic, sender, message) in any_message(), sequence: u64, ns: i64) {
        let envelope = Envelope { sender, sequence, time: SimTime::from_ns(ns), message };
        prop_assert_eq!(Envelope::from_bytes(&topic, &envelope.to_bytes()).unwrap().to_bytes(), envelope.to_bytes());
    }

    #[test]
    fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        for topic in [topic(), Topic::Model, Topic::Population, Topic::Tick] {
            let _ = Envelope::from_bytes(&topic, &bytes);
            let _ = Envelope::from_json(&topic, &String::from_utf8_lossy(&bytes));
        }
    }

    #[test]
    fn a_flipped_bit_never_panics(flip in 0usize..400) {
        let mut bytes = ambient().to_bytes();
        let bit = flip % (bytes.len() * 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
        let _ = Envelope::from_bytes(&topic(), &bytes);
    }

    #[test]
    fn a_cut_message_is_refused(keep in 0usize..94) {
        let bytes = ambient().to_bytes();
        prop_assume!(keep < bytes.len());
        prop_assert!(Envelope::from_bytes(&topic(), &bytes[..keep]).is_err());
    }
}

#[test]
fn json_of_the_version_before_is_still_read() {
    let text = r#"{"wire_version":1,"sender":"sc/main","sequence":1,"time_ns":0,"message":{"phase":"search",
        "assignments":[],"peak":{"lat_deg":43.4,"lon_deg":-7.8,"alt_amsl_m":800.0,"co2_ppm":900.0,"sd_ppm":9.0}}}"#;
    let envelope = Envelope::from_json(&Topic::Plan, text).unwrap();
    let Message::Plan(plan) = envelope.message else {
        panic!("{envelope:?}")
    };
    assert_eq!(
        plan.peak.unwrap().status,
        protocol::message::PeakStatus::Doubtful
    );
}
