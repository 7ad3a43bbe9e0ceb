//! Tracks and the logs of autopilots, and readings joined with them.
//!
//! GPX and KML are written by hand as their schemas have them; ULog and DataFlash byte by byte from the format
//! documents (docs.px4.io, *ULog File Format*; ArduPilot's `LogStructure.h`) and read the same by `pyulog` 1.3.0 and
//! `pymavlink` 2.4.50 (`DFReader`); the telemetry log is pymavlink's (`tests/oracle/telemetry_log.py`).

use crate::common::import;
use std::fmt::Write as _;

/// `date -u -d 2024-05-01T10:00:00Z +%s`
const MAY: f64 = 1_714_557_600.0;

fn iso(of_minute_s: usize) -> String {
    format!(
        "2024-05-01T10:{:02}:{:02}Z",
        of_minute_s / 60,
        of_minute_s % 60
    )
}

/// A height that tells when it is.
fn height(time_s: f64) -> f64 {
    700.0 + 60.0 * (time_s / 41.0).sin() + 25.0 * (time_s / 13.0).cos()
}

/// A track of 10 minutes at one point a second.
fn gpx() -> String {
    let mut text =
        "<?xml version=\"1.0\"?><gpx version=\"1.1\" creator=\"hand\"><trk><trkseg>\n".to_owned();
    for k in 0..600 {
        let (lat, ele) = (43.44 + 1e-5 * k as f64, height(k as f64));
        let _ = writeln!(
            text,
            "<trkpt lat=\"{lat:.7}\" lon=\"-7.86\"><ele>{ele:.2}</ele><time>{}</time></trkpt>",
            iso(k)
        );
    }
    text + "</trkseg></trk></gpx>"
}

/// The number in `row` and `column` of a CSV text.
fn cell(csv: &str, row: usize, column: &str) -> f64 {
    let at = csv
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|h| h == column)
        .unwrap();
    let text = csv
        .lines()
        .nth(row + 1)
        .unwrap()
        .split(',')
        .nth(at)
        .unwrap();
    text.parse().unwrap_or(f64::NAN)
}

#[test]
fn a_gas_log_gets_its_places_from_a_track() {
    let gas = "time,CH4 (ppb)\n2024-05-01T10:01:00.5Z,1901\n2024-05-01T10:01:02Z,1902\n2024-05-01T12:00:00Z,1903\n";
    let (csv, report) = import(
        &[("track.gpx", gpx().as_bytes()), ("gas.csv", gas.as_bytes())],
        "",
    )
    .unwrap();
    assert_eq!(csv.lines().count(), 4);
    assert!(
        (cell(&csv, 0, "lat_deg") - (43.44 + 60.5e-5)).abs() < 1e-9,
        "{csv}"
    );
    assert!((cell(&csv, 1, "alt_amsl_m") - height(62.0)).abs() < 0.006);
    assert_eq!(cell(&csv, 1, "ch4_ppb"), 1902.0);
    assert!(cell(&csv, 2, "lat_deg").is_nan());
    let notices = report.notices.join("\n");
    assert!(
        notices.contains("2 of 3 rows lie within")
            && notices.contains("its clock agrees with that of track.gpx"),
        "{notices}"
    );
}

#[test]
fn a_clock_that_is_off_is_set_by_what_both_measure_and_the_mapping_says_so() {
    // A log whose clock is 17.5 s late, with the pressure of the standard atmosphere (ISO 2533, eq. 12) at its height.
    let mut gas = "time,CO2 (ppm),pressure (hPa)\n".to_owned();
    for k in 0..400 {
        let true_s = 100.0 + k as f64;
        let hpa = 1013.25 * (1.0 - 0.0065 * height(true_s) / 288.15).powf(5.255_88);
        let _ = writeln!(gas, "{:.1},{},{hpa:.3}", MAY + true_s - 17.5, 421 + k);
    }
    let logs = [("track.gpx", gpx()), ("gas.csv", gas)];
    let logs: Vec<(&str, &[u8])> = logs.iter().map(|(n, t)| (*n, t.as_bytes())).collect();
    let (csv, report) = import(&logs, "").unwrap();
    let notices = report.notices.join("\n");
    assert!(
        notices.contains("clock offset of 17.5 s, at which pressure_hpa and alt_amsl_m"),
        "{notices}"
    );
    assert_eq!(cell(&csv, 0, "time_s"), MAY + 100.0);
    assert!((cell(&csv, 50, "alt_amsl_m") - height(150.0)).abs() < 0.006);
    let (again, _) = import(&logs, &report.map.to_toml(&[])).unwrap();
    assert_eq!(csv, again);
}

#[test]
fn logs_that_share_no_time_are_refused_with_what_they_are_apart() {
    let gas = "time,CH4 (ppb)\n2024-05-01T12:01:00,1901\n2024-05-01T12:01:02,1902\n";
    let error = import(
        &[("track.gpx", gpx().as_bytes()), ("gas.csv", gas.as_bytes())],
        "",
    )
    .unwrap_err()
    .to_string();
    assert!(
        error.contains("-2.02 h") && error.contains("--zone"),
        "{error}"
    );
    let map = "[[log]]\nname = \"gas*\"\nzone = \"+02:00\"\n";
    let (csv, _) = import(
        &[("track.gpx", gpx().as_bytes()), ("gas.csv", gas.as_bytes())],
        map,
    )
    .unwrap();
    assert_eq!(cell(&csv, 0, "time_s"), MAY + 60.0);
}

#[test]
fn a_track_without_times_is_refused() {
    let line = "<kml><Placemark><LineString><coordinates>1,2,3 4,5,6</coordinates></LineString></Placemark></kml>";
    let gas = "time_s,co2_ppm\n0,421\n";
    let error = import(&[("a.kml", line.as_bytes()), ("g.csv", gas.as_bytes())], "")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("a.kml: 1 lines (LineString)") && error.contains("gx:Track"),
        "{error}"
    );
    let gpx = "<gpx><trk><trkseg><trkpt lat=\"1\" lon=\"2\"/><trkpt lat=\"1\" lon=\"2\"></trkpt></trkseg></trk></gpx>";
    let error = import(&[("a.gpx", gpx.as_bytes()), ("g.csv", gas.as_bytes())], "")
        .unwrap_err()
        .to_string();
    assert!(error.contains("without times"), "{error}");
}

#[test]
fn a_kml_track_says_from_what_its_heights_count() {
    let kml = |mode: &str| {
        format!(
            "<kml xmlns:gx=\"http://www.google.com/kml/ext/2.2\"><gx:Track><altitudeMode>{mode}</altitudeMode>\
             <when>2024-05-01T10:00:00Z</when><when>2024-05-01T10:00:02Z</when>\
             <gx:coord>-7.86 43.44 100</gx:coord><gx:coord>-7.86 43.45 200</gx:coord></gx:Track></kml>"
        )
    };
    let gas = "time,co2_ppm\n2024-05-01T10:00:01Z,421\n";
    let read = |mode: &str, map: &str| {
        import(
            &[("t.kml", kml(mode).as_bytes()), ("g.csv", gas.as_bytes())],
            map,
        )
    };
    let (csv, _) = read("absolute", "").unwrap();
    assert!(
        (cell(&csv, 0, "lat_deg") - 43.445).abs() < 1e-9 && cell(&csv, 0, "alt_amsl_m") == 150.0
    );
    let error = read("relativeToGround", "").unwrap_err().to_string();
    assert!(error.contains("--base-amsl-m"), "{error}");
    let (csv, _) = read("relativeToGround", "[[log]]\nbase_amsl_m = 340\n").unwrap();
    assert_eq!(cell(&csv, 0, "alt_amsl_m"), 490.0);
}

#[test]
fn the_wind_of_a_mast_is_joined_and_said_to_be_the_platforms() {
    let gas = "time,lat,lon,alt_amsl_m,co2_ppm\n2024-05-01T10:00:30Z,43,-7,500,421\n";
    let mast = "time,wind speed (m/s),wind dir (deg)\n2024-05-01T10:00:00Z,4,350\n2024-05-01T10:01:00Z,6,20\n";
    let map = "[[log]]\nzone = \"UTC\"\n";
    let (csv, report) = import(
        &[("g.csv", gas.as_bytes()), ("mast.csv", mast.as_bytes())],
        map,
    )
    .unwrap();
    // Half way on the short way round from 350 to 20.
    assert_eq!(
        (
            cell(&csv, 0, "wind_speed_m_s"),
            cell(&csv, 0, "wind_from_deg")
        ),
        (5.0, 5.0)
    );
    assert!(
        report
            .notices
            .join("\n")
            .contains("the wind of mast.csv was measured at the platform's place")
    );
}

#[test]
fn days_of_one_campaign_are_put_one_after_the_other() {
    let day = |d: usize, v: usize| {
        format!("time,lat,lon,alt_amsl_m,co2_ppm\n2024-05-{d:02}T10:00:00Z,43,-7,500,{v}\n")
    };
    let logs = [("b.csv", day(2, 422)), ("a.csv", day(1, 421))];
    let logs: Vec<(&str, &[u8])> = logs.iter().map(|(n, t)| (*n, t.as_bytes())).collect();
    let (csv, _) = import(&logs, "[[log]]\nplatform = \"drone\"\n").unwrap();
    assert_eq!(cell(&csv, 0, "co2_ppm"), 421.0);
    assert_eq!(cell(&csv, 1, "co2_ppm"), 422.0);
}

/// A ULog, written from its documentation.
struct Ulog(Vec<u8>);

impl Ulog {
    fn new() -> Self {
        let mut bytes = vec![0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, 1];
        bytes.extend(1_000_000_u64.to_le_bytes());
        let mut log = Self(bytes);
        log.message(b'B', &[0; 40]);
        log
    }

    fn message(&mut self, kind: u8, payload: &[u8]) {
        self.0
            .extend(u16::try_from(payload.len()).unwrap().to_le_bytes());
        self.0.push(kind);
        self.0.extend(payload);
    }

    fn subscribe(&mut self, id: u16, topic: &str) {
        let payload = [&[0][..], &id.to_le_bytes(), topic.as_bytes()].concat();
        self.message(b'A', &payload);
    }

    fn data(&mut self, id: u16, fields: &[&[u8]]) {
        let payload = [&id.to_le_bytes()[..], &fields.concat()].concat();
        self.message(b'D', &payload);
    }
}

/// 20 s of a flight at 10 rows a second with GPS and a gas sensor at one.
fn ulog() -> Vec<u8> {
    let mut log = Ulog::new();
    for format in [
        "vehicle_attitude:uint64_t timestamp;float[4] q;",
        "vehicle_angular_velocity:uint64_t timestamp;float[3] xyz;",
        "vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;",
        "debug_key_value:uint64_t timestamp;char[10] key;float value;",
    ] {
        log.message(b'F', format.as_bytes());
    }
    for (id, topic) in [
        "vehicle_attitude",
        "vehicle_angular_velocity",
        "vehicle_gps_position",
        "debug_key_value",
    ]
    .into_iter()
    .enumerate()
    {
        log.subscribe(u16::try_from(id).unwrap(), topic);
    }
    for k in 0..200_u64 {
        let us = 5_000_000 + k * 100_000;
        // A roll of 30 degrees: q = (cos 15°, sin 15°, 0, 0).
        let q: Vec<u8> = [0.965_925_8_f32, 0.258_819_05, 0.0, 0.0]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let rates: Vec<u8> = [0.1_f32, -0.2, 0.3]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        log.data(0, &[&us.to_le_bytes(), &q]);
        log.data(1, &[&us.to_le_bytes(), &rates]);
        if k % 10 == 0 {
            let utc_us = 1_714_557_600_000_000 + k * 100_000;
            let lat = 434_400_000 + i32::try_from(k).unwrap() * 100;
            let place = [lat, -78_600_000, 700_250].map(i32::to_le_bytes).concat();
            log.data(2, &[&us.to_le_bytes(), &utc_us.to_le_bytes(), &place]);
            log.data(
                3,
                &[
                    &(us + 50_000).to_le_bytes(),
                    b"co2\0\0\0\0\0\0\0",
                    &(421.5_f32).to_le_bytes(),
                ],
            );
        }
    }
    log.0
}

#[test]
fn a_px4_log_gives_observations_and_a_flight() {
    let (csv, report) = import(&[("f.ulg", &ulog())], "").unwrap();
    assert_eq!(report.output, import::map::Output::Observations);
    // The last reading is behind the last fix.
    assert_eq!(csv.lines().count(), 21);
    assert_eq!(cell(&csv, 0, "time_s"), MAY + 0.05);
    // 100e-7 degrees in a tenth of a second; half of one.
    assert!(
        (cell(&csv, 0, "lat_deg") - 43.440_005).abs() < 1e-9,
        "{csv}"
    );
    assert_eq!(
        (cell(&csv, 0, "alt_amsl_m"), cell(&csv, 0, "co2_ppm")),
        (700.25, 421.5)
    );
    let (csv, _) = import(&[("f.ulg", &ulog())], "output = \"flight\"\n").unwrap();
    assert_eq!(csv.lines().count(), 201);
    assert!((cell(&csv, 5, "roll_deg") - 30.0).abs() < 1e-4, "{csv}");
    // 0.1 rad/s
    assert!((cell(&csv, 5, "roll_rate_deg_s") - 5.729_6).abs() < 1e-3);
    assert!(cell(&csv, 5, "pitch_deg").abs() < 1e-4);
}

/// A DataFlash log, written from ArduPilot's `LogStructure.h`.
fn dataflash() -> Vec<u8> {
    let mut log = Vec::new();
    let padded = |text: &str, to: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(to, 0);
        bytes
    };
    for (kind, length, name, kinds, labels) in [
        (128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        (
            130,
            3 + 8 + 1 + 1 + 4 + 2 + 4 + 4 + 4,
            "GPS",
            "QBBIHLLe",
            "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt",
        ),
        (
            131,
            3 + 8 + 2 + 2 + 2,
            "ATT",
            "QccC",
            "TimeUS,Roll,Pitch,Yaw",
        ),
        (132, 3 + 8 + 4, "GAS", "Qf", "TimeUS,CH4"),
        (133, 3 + 8 + 1 + 2 + 2, "XKF2", "QBcc", "TimeUS,C,VWN,VWE"),
    ] {
        log.extend([0xA3, 0x95, 128, kind, length]);
        log.extend([padded(name, 4), padded(kinds, 16), padded(labels, 64)].concat());
    }
    log.extend(b"noise");
    for k in 0..30_u64 {
        let us = (60_000_000 + k * 1_000_000).to_le_bytes();
        // GPS week 2312 began on 2024-04-28; 10:00:18 of GPS time on its fourth day is 10:00:00 UTC.
        let ms = u32::try_from(3 * 86_400_000 + 36_018_000 + k * 1000).unwrap();
        log.extend([0xA3, 0x95, 130]);
        log.extend([&us[..], &[0, 3], &ms.to_le_bytes(), &2312_u16.to_le_bytes()].concat());
        let lat = 434_400_000 + i32::try_from(k).unwrap() * 1000;
        log.extend([lat, -78_600_000, 70_025].map(i32::to_le_bytes).concat());
        // A second receiver, elsewhere.
        log.extend([0xA3, 0x95, 130]);
        log.extend(
            [
                &us[..],
                &[1, 3],
                &ms.to_le_bytes(),
                &2312_u16.to_le_bytes(),
                &[0; 12],
            ]
            .concat(),
        );
        log.extend([0xA3, 0x95, 131]);
        log.extend(
            [
                &us[..],
                &1050_i16.to_le_bytes(),
                &(-200_i16).to_le_bytes(),
                &9000_u16.to_le_bytes(),
            ]
            .concat(),
        );
        log.extend([0xA3, 0x95, 132]);
        log.extend([&us[..], &1.95_f32.to_le_bytes()].concat());
        log.extend([0xA3, 0x95, 133]);
        // 5 m/s towards east: from 270 degrees.
        log.extend([&us[..], &[0], &0_i16.to_le_bytes(), &500_i16.to_le_bytes()].concat());
    }
    log
}

#[test]
fn an_ardupilot_log_gives_observations_in_utc() {
    let map = "[[log]]\n[log.column.ch4_ppm]\nunit = \"ppm\"\n";
    let (csv, report) = import(&[("1.bin", &dataflash())], map).unwrap();
    assert_eq!(csv.lines().count(), 31);
    assert_eq!(cell(&csv, 2, "time_s"), MAY + 2.0);
    assert!((cell(&csv, 2, "lat_deg") - 43.440_2).abs() < 1e-9, "{csv}");
    assert_eq!(cell(&csv, 2, "alt_amsl_m"), 700.25);
    assert!((cell(&csv, 2, "ch4_ppm") - 1.95).abs() < 1e-6);
    assert_eq!(
        (
            cell(&csv, 2, "wind_speed_m_s"),
            cell(&csv, 2, "wind_from_deg")
        ),
        (5.0, 270.0)
    );
    let notices = report.notices.join("\n");
    assert!(
        notices.contains("UTC by the GPS") && notices.contains("5 bytes outside of records"),
        "{notices}"
    );
    // The autopilot's altitude is above the sea by its documents, and angles are no part of observations.
    assert!(
        !notices.contains("states no datum") && !notices.contains("roll_deg from"),
        "{notices}"
    );
    assert!(
        notices.contains("recognised but not part of this output: roll_deg, pitch_deg"),
        "{notices}"
    );
    let (csv, _) = import(&[("1.bin", &dataflash())], "output = \"flight\"\n").unwrap();
    assert_eq!(
        (cell(&csv, 3, "roll_deg"), cell(&csv, 3, "pitch_deg")),
        (10.5, -2.0)
    );
}

#[test]
fn a_telemetry_log_gives_observations_of_its_vehicle() {
    let log = include_bytes!("data/telemetry.tlog");
    let (csv, report) = import(&[("t.tlog", log)], "").unwrap();
    // 60 readings; the last is behind the last fix.
    assert_eq!(csv.lines().count(), 61);
    assert_eq!(cell(&csv, 10, "time_s"), MAY + 10.6);
    // Half a second behind the fix of second 10, which moves by 1e-4 degrees and 1 m a second.
    assert!(
        (cell(&csv, 10, "lat_deg") - 43.441_05).abs() < 1e-9,
        "{csv}"
    );
    assert_eq!(
        (cell(&csv, 10, "alt_amsl_m"), cell(&csv, 10, "co2_ppm")),
        (710.5, 431.0)
    );
    // WIND says -90: west.
    assert_eq!(
        (
            cell(&csv, 10, "wind_speed_m_s"),
            cell(&csv, 10, "wind_from_deg")
        ),
        (6.5, 270.0)
    );
    assert_eq!(cell(&csv, 10, "pressure_hpa"), 930.25);
    let notices = report.notices.join("\n");
    assert!(
        notices.contains("system 3") && notices.contains("systems [255] are ignored"),
        "{notices}"
    );
    assert!(notices.contains("2 bytes outside of frames"), "{notices}");
}

#[test]
fn files_that_are_known_and_not_read_are_told_what_to_do() {
    for (bytes, expected) in [
        (&b"\x89HDF\r\n\x1a\n0000000000"[..], "nccopy -k classic"),
        (b"PK\x03\x04aaaaaaaaaaaa", "save the spreadsheet as CSV"),
        (b"\x1f\x8b\x08aaaaaaaaaaaaaa", "gunzip"),
        (b"<?xml version=\"1.0\"?><x/>", "neither GPX nor KML"),
    ] {
        let error = import(&[("a", bytes)], "").unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn damaged_logs_make_nothing_panic() {
    for whole in [
        ulog(),
        dataflash(),
        include_bytes!("data/telemetry.tlog").to_vec(),
    ] {
        for k in 0..200 {
            let mut bytes = whole.clone();
            let at = k * 37 % bytes.len();
            bytes[at] ^= 0x55;
            bytes.truncate(bytes.len() - k);
            let _ = import(&[("a", &bytes)], "");
        }
    }
}
