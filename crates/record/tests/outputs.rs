//! Summary and KML of a mission, from its messages.

use crate::synthetic;
use protocol::key::Name;
use protocol::message::{GapCause, Message, Peak, PeakStatus, VehicleKind};
use protocol::{Envelope, SimTime, Topic};
use record::contour::PlumeLine;
use record::kml::{Map, MapFeatures, StackMarker, document};
use record::summary::{
    CORRECTED, GapSummary, ModelNumbers, Outcome, PlaceOfPeak, Summariser, SummaryContext, TruePeak,
};
use record::text;
use record::tracks::Tracks;
use std::sync::Arc;

fn numbers(axis_deg: f64, height_m: f64) -> ModelNumbers {
    ModelNumbers::from(&synthetic::model(axis_deg, height_m, 410.0, 0))
}

fn known() -> SummaryContext {
    SummaryContext {
        source_deg: (43.4417, -7.8631),
        noise_ppm: 3.0,
        seed: 7,
        gas: plume::Gas::Co2,
        scenario: synthetic::scenario(449.0),
        team: (1..=6).map(|k| k.to_string()).collect(),
        frame: synthetic::frame(),
        before: numbers(130.0, 450.0),
        reality: Some(numbers(118.0, 486.0)),
        true_peak: Some(TruePeak(Arc::new(|_| {
            Some(PlaceOfPeak {
                lat_deg: 43.4365,
                lon_deg: -7.8498,
                alt_amsl_m: 826.0,
                co2_ppm: 1025.0,
            })
        }))),
        true_flux: Vec::new(),
    }
}

fn peak() -> Peak {
    Peak {
        lat_deg: 43.4365,
        lon_deg: -7.8498,
        alt_amsl_m: 826.0,
        co2_ppm: 1025.0,
        sd_ppm: 0.0,
        time_s: 600.0,
        status: PeakStatus::Confirmed,
    }
}

#[test]
fn the_summary_has_the_fields_of_its_schema() {
    let mut summariser = Summariser::new(known());
    for (topic, envelope) in synthetic::mission(6000) {
        summariser.take(&topic, &envelope);
    }
    let summary = summariser.summary("ab12", 2.0);
    let json: serde_json::Value = serde_json::from_str(&summary.to_json()).unwrap();
    let keys = |v: &serde_json::Value| -> Vec<String> {
        let mut keys: Vec<String> = v.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys
    };
    let expect = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
    assert_eq!(
        keys(&json),
        expect(
            "contradictions digest flux gap gas mechanisms model peak real_time_factor schema seed sim_s vehicles wall_s"
        )
    );
    assert_eq!(
        keys(&json["vehicles"][0]),
        expect(
            "distance_m id kind outcome peak_alt_amsl_m peak_lat_deg peak_lon_deg peak_ppm \
             peak_time_s"
        )
    );
    assert_eq!(
        keys(&json["peak"]),
        expect("came_near error_m estimate highest_reading known_s status truth")
    );
    assert_eq!(keys(&json["model"]), expect("after before reality"));
    assert_eq!(
        keys(&json["model"]["after"]),
        expect(
            "axis_deg background_ppm c_max_distance_m c_max_ppm effective_height_agl_m \
             sigma_y_scale sigma_z_scale"
        )
    );
    assert_eq!(
        keys(&json["model"]["after"]["axis_deg"]),
        expect("high95 low95 sd value")
    );
    assert_eq!(json["schema"], "plumage.summary/1");
    assert_eq!(json["vehicles"].as_array().unwrap().len(), 6);
    assert_eq!(json["vehicles"][5]["kind"], "real");
    // The model as last said, and the highest reading of each vehicle as an independent pass
    // over the messages finds it.
    for vehicle in &summary.vehicles {
        let highest = synthetic::mission(6000)
            .filter_map(|(_, e)| match e.message {
                Message::Reading(r) if e.sender.name().as_str() == vehicle.id => Some(r.co2_ppm),
                _ => None,
            })
            .fold(f64::MIN, f64::max);
        assert_eq!(vehicle.peak_ppm, Some(highest));
    }
    assert!((summary.real_time_factor - 599.9 / 2.0).abs() < 1e-9);
    let text = text::summary(&summary);
    assert!(text.contains("5 simulated and 1 real"), "{text}");
    assert!(
        text.contains("axis (towards)         130 ± 10 ->     118.02 ± 0.32"),
        "{text}"
    );
}

#[test]
fn a_scenario_that_readings_contradict_is_listed_with_the_key() {
    let found = |background_ppm: f64| {
        let scenario = synthetic::scenario(background_ppm);
        let mut summariser = Summariser::new(SummaryContext {
            scenario,
            ..known()
        });
        for (topic, envelope) in synthetic::mission(6000) {
            // The corrections of this mission are made up, too.
            if !matches!(topic, Topic::Model) {
                summariser.take(&topic, &envelope);
            }
        }
        summariser.summary("", 1.0).contradictions
    };
    assert_eq!(found(449.0), []);
    let slipped = found(44.9);
    assert_eq!(slipped[0].key, "background.co2_ppm");
    assert_eq!(slipped[0].prior.value, 44.9);
    assert!(slipped[0].posterior.value > 430.0, "{slipped:?}");
}

#[test]
fn the_way_is_the_way_flown() {
    // 18 m/s due north for 100 s, with a jitter of 2 m across at 10 Hz: 1800 m, not the 4000 m
    // of a sum over every step.
    let mut summariser = Summariser::new(known());
    let (topic, mut envelope) = synthetic::tick(0)
        .into_iter()
        .find(|(topic, _)| matches!(topic, Topic::State(_)))
        .unwrap();
    for n in 0..=1000 {
        let at = air::geo::Enu {
            east_m: if n % 2 == 0 { 2.0 } else { -2.0 },
            north_m: 1.8 * f64::from(n),
        };
        let place = synthetic::frame().to_geodetic(at);
        envelope.time = SimTime::from_s(0.1 * f64::from(n));
        if let Message::State(state) = &mut envelope.message {
            state.lat_deg = place.lat_deg;
            state.lon_deg = place.lon_deg;
            state.alt_amsl_m = 800.0;
        }
        summariser.take(&topic, &envelope);
    }
    let way = summariser.summary("", 1.0).vehicles[0].distance_m;
    assert!((way - 1800.0).abs() < 0.1 * 1800.0, "{way}");
}

#[test]
fn the_summary_tells_how_each_vehicle_ended() {
    let mut summariser = Summariser::new(known());
    // Until when each is in the air, and until when it is heard, s.
    let fates = [
        ("1", 30, 60, Outcome::Landed),
        ("2", 60, 60, Outcome::Airborne),
        ("3", 60, 40, Outcome::Lost),
        ("4", 0, 60, Outcome::NeverFlew),
        ("5", 60, 52, Outcome::Airborne),
        ("6", 30, 40, Outcome::Landed),
    ];
    for (topic, mut envelope) in synthetic::mission(600) {
        if let (Topic::State(id), Message::State(state)) = (&topic, &mut envelope.message) {
            let t = envelope.time.s();
            let fate = fates.iter().find(|f| f.0 == id.as_str()).unwrap();
            if t > f64::from(fate.2) {
                continue;
            }
            state.airborne = t < f64::from(fate.1);
        }
        summariser.take(&topic, &envelope);
    }
    let ended = summariser.summary("", 1.0).vehicles;
    for (vehicle, fate) in ended.iter().zip(&fates) {
        assert_eq!((vehicle.id.as_str(), vehicle.outcome), (fate.0, fate.3));
    }
    let json = serde_json::to_value(ended[3].outcome).unwrap();
    assert_eq!(json, "never-flew");
}

#[test]
fn an_angle_is_compared_the_short_way_round() {
    let axis = &CORRECTED[0];
    assert!((axis.error(359.0, 2.0) + 3.0).abs() < 1e-9);
    assert!((CORRECTED[1].error(359.0, 2.0) - 357.0).abs() < 1e-9);
}

#[test]
fn a_mission_without_real_vehicle_or_peak_has_words_and_nulls() {
    let summary = Summariser::new(SummaryContext {
        reality: None,
        true_peak: None,
        true_flux: Vec::new(),
        ..known()
    })
    .summary("", 0.0);
    let json: serde_json::Value = serde_json::from_str(&summary.to_json()).unwrap();
    assert!(json["model"]["reality"].is_null() && json["real_time_factor"].is_null());
    let text = text::summary(&summary);
    assert!(
        text.contains("there is no peak") && text.contains("no real vehicle"),
        "{text}"
    );
}

/// The map of 300 s with a name that XML would trip over, moved east by `east_deg`.
#[test]
fn each_verdict_of_the_reality_gap_is_a_sentence() {
    let cause = |mechanisms: &[&str]| GapCause {
        mechanisms: mechanisms.iter().map(ToString::to_string).collect(),
        probability: 0.9,
    };
    let said = |verdict: &str, causes: &[GapCause]| {
        text::gap(&GapSummary {
            verdict: verdict.to_owned(),
            causes: causes.to_vec(),
        })
    };
    assert_eq!(
        said("unexplained", &[]),
        "Reality gap in flight: unexplained: the readings deviate from the model, and no listed mechanism accounts for it."
    );
    let (lag, set) = (
        cause(&["sensor-lag"]),
        cause(&["sensor-gain", "emission-scale"]),
    );
    for (verdict, causes) in [
        ("none", vec![]),
        ("insufficient", vec![]),
        ("named", vec![lag.clone()]),
        ("ambiguous", vec![set]),
        ("unexplained", vec![lag]),
    ] {
        let text = said(verdict, &causes);
        assert!(
            text.starts_with(&format!("Reality gap in flight: {verdict}: ")),
            "{text}"
        );
        for cause in causes {
            assert!(text.contains(&cause.mechanisms.join(" or ")), "{text}");
        }
    }
}

fn kml_text(east_deg: f64) -> String {
    let moved = |lon_deg: f64| air::geo::wrap_signed_deg(lon_deg + east_deg);
    let mut tracks = Tracks::new(500, 0.5);
    for (topic, mut envelope) in synthetic::mission(3000) {
        if let Message::Reading(reading) = &mut envelope.message {
            reading.lon_deg = moved(reading.lon_deg);
        }
        tracks.take(&topic, &envelope);
    }
    assert_eq!(tracks.by_vehicle()["6"].kind, VehicleKind::Real);
    let around = MapFeatures {
        mission: "a < b & \"c\"".to_owned(),
        shown: record::colour::Shown::CO2,
        stacks: vec![StackMarker {
            name: "As Pontes".to_owned(),
            lat_deg: 43.4417,
            lon_deg: moved(-7.8631),
            height_m: 356.0,
        }],
        fence: [(43.40, -7.90), (43.40, -7.80), (43.47, -7.80)]
            .map(|(lat, lon)| (lat, moved(lon)))
            .to_vec(),
        fence_top_amsl_m: 1200.0,
        peak: Some(peak()),
    };
    let line = |excess_ppm: f64| PlumeLine {
        excess_ppm,
        corners: [-7.87, -7.84, -7.82, -7.87]
            .map(|lon| [moved(lon), 43.44, 826.0])
            .to_vec(),
    };
    document(&Map {
        start_unix_ns: Some(1_795_782_600_000_000_000),
        tracks: &tracks,
        around: &around,
        plume: &[line(20.0), line(100.0)],
    })
    .unwrap()
}

/// The elements of a document in order, each with its parent's number (of the document itself 0) and its text.
fn elements(text: &str) -> Vec<(String, usize, String)> {
    let mut reader = quick_xml::Reader::from_str(text);
    let mut all: Vec<(String, usize, String)> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Start(e) => {
                let name = String::from_utf8(e.name().as_ref().to_vec()).unwrap();
                all.push((name, open.last().copied().unwrap_or(0), String::new()));
                open.push(all.len() - 1);
            }
            quick_xml::events::Event::End(_) => {
                open.pop();
            }
            quick_xml::events::Event::Text(t) => {
                if let Some(at) = open.last() {
                    all[*at].2 += std::str::from_utf8(&t).unwrap().trim();
                }
            }
            quick_xml::events::Event::Eof => return all,
            _ => {}
        }
    }
}

/// The order of elements in OGC's schema of KML 2.2 (ogckml22.xsd), as far as they are written here.
const ORDER: &[(&str, &str)] = &[
    ("Document", "name description Style Schema Folder Placemark"),
    ("Folder", "name Folder Placemark"),
    (
        "Placemark",
        "name description TimeSpan styleUrl ExtendedData Point LineString Polygon MultiGeometry gx:Track gx:MultiTrack",
    ),
    ("Style", "IconStyle LineStyle PolyStyle"),
    ("IconStyle", "color scale Icon"),
    ("LineStyle", "color width"),
    ("TimeSpan", "begin end"),
    ("Point", "extrude altitudeMode coordinates"),
    ("LineString", "altitudeMode coordinates"),
    ("Polygon", "extrude altitudeMode outerBoundaryIs"),
    ("gx:Track", "altitudeMode when gx:coord ExtendedData"),
    ("gx:MultiTrack", "altitudeMode gx:interpolate gx:Track"),
];

#[test]
fn kml_keeps_to_the_order_of_its_schema() {
    for text in [kml_text(0.0), kml_text(-172.1554)] {
        assert!(!text.contains("NaN"));
        let all = elements(&text);
        let mut last = vec![0; all.len()];
        for (name, parent, _) in &all[1..] {
            let Some((_, order)) = ORDER.iter().find(|(of, _)| *of == all[*parent].0) else {
                continue;
            };
            // Features may follow each other in any order.
            let features = |name: &str| matches!(name, "Folder" | "Placemark");
            let at = order
                .split(' ')
                .position(|n| n == name || features(n) && features(name));
            let at = at.unwrap_or_else(|| panic!("{name} in {}", all[*parent].0));
            assert!(at >= last[*parent], "{name} too late in {}", all[*parent].0);
            last[*parent] = at;
        }
    }
}

#[test]
fn kml_has_a_folder_and_a_track_with_times_and_readings_for_each_vehicle() {
    let text = kml_text(0.0);
    let all = elements(&text);
    let of = |name: &str| all.iter().filter(|e| e.0 == name).count();
    let named = |name: &str| all.iter().any(|e| e.0 == "name" && e.2 == name);
    assert!(named("Vehicle 6 (real)") && named("Plume"));
    assert_eq!(of("gx:Track"), 6);
    assert!(of("when") == of("gx:coord") && of("when") == of("gx:value"));
    assert!(of("TimeSpan") > 100);
    assert_eq!(text.matches("<Style id=\"co2-").count(), 24);
    assert!(text.contains("#co2-0") && text.contains("#co2-23"));
    // 30 s after date -u -d @1795782600.
    assert!(text.contains("<when>2026-11-27T12:30:30.000Z</when>"));
    assert!(
        text.contains("#be0a26") && text.contains("840 or more"),
        "the legend's last colour"
    );
}

#[test]
fn kml_is_cut_at_the_antimeridian() {
    // The stack stands at 179.9815° E, 1.5 km before it.
    let text = kml_text(-172.1554);
    let all = elements(&text);
    let (mut east, mut west) = (0, 0);
    let mut lines: Vec<Vec<f64>> = Vec::new();
    for (k, (name, _, text)) in all.iter().enumerate() {
        if name == "coordinates" {
            let lon = |c: &str| c.split(',').next().unwrap().parse().unwrap();
            lines.push(text.split_whitespace().map(lon).collect());
        } else if name == "gx:Track" {
            let of_track = all.iter().filter(|e| e.0 == "gx:coord" && e.1 == k);
            lines.push(
                of_track
                    .map(|e| e.2.split(' ').next().unwrap().parse().unwrap())
                    .collect(),
            );
        }
    }
    for line in &lines {
        assert!(line.iter().all(|lon| lon.abs() <= 180.0));
        for pair in line.windows(2) {
            assert!((pair[1] - pair[0]).abs() < 1.0, "{pair:?}");
        }
        east += usize::from(line.iter().all(|lon| *lon > 0.0));
        west += usize::from(line.iter().all(|lon| *lon < 0.0));
    }
    assert!(
        east > 10 && west > 10 && east + west == lines.len(),
        "{east} {west}"
    );
}

#[test]
fn a_message_on_another_topic_changes_no_track() {
    let mut tracks = Tracks::new(10, 0.0);
    for (_, envelope) in synthetic::mission(5) {
        let elsewhere = Topic::State(Name::new("1").unwrap());
        let envelope: Envelope = envelope;
        tracks.take(&elsewhere, &envelope);
    }
    assert!(tracks.by_vehicle().is_empty());
}
