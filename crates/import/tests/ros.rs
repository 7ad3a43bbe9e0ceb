//! Recordings of ROS 2 with several receivers.

use crate::common::import;
use formats::cdr::CdrWriter;
use std::collections::BTreeMap;
use std::io::Cursor;

/// 2024-05-01T10:00:00Z, ns since 1970.
const MAY_NS: i64 = 1_714_557_600_000_000_000;

const FIX: &str = "std_msgs/Header header\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n\
    ================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
const PRESSURE: &str = "std_msgs/Header header\nfloat64 fluid_pressure\n\
    ================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
const NUMBER: &str = "float64 data\n";

/// A recording of ten seconds with these topics: of a position its latitude, of others their value.
fn recording(topics: &[(&str, &str, f64)]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    for (topic, kind, value) in topics {
        let text = match *kind {
            "sensor_msgs/msg/NavSatFix" => FIX,
            "sensor_msgs/msg/FluidPressure" => PRESSURE,
            _ => NUMBER,
        };
        let schema = writer.add_schema(kind, "ros2msg", text.as_bytes()).unwrap();
        let channel = writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .unwrap();
        for second in 0..10 {
            let unix_ns = MAY_NS + second * 1_000_000_000;
            let message = CdrWriter::default();
            let message = match *kind {
                "sensor_msgs/msg/NavSatFix" => message
                    .header(unix_ns, "gps")
                    .f64(*value)
                    .f64(-7.0)
                    .f64(400.0),
                "sensor_msgs/msg/FluidPressure" => message.header(unix_ns, "air").f64(*value),
                _ => message.f64(*value),
            };
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: second as u32,
                log_time: unix_ns as u64,
                publish_time: unix_ns as u64,
            };
            writer
                .write_to_known_channel(&header, &message.finish())
                .unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

const POSITION: &str = "sensor_msgs/msg/NavSatFix";
const AIR: &str = "sensor_msgs/msg/FluidPressure";
const VALUE: &str = "std_msgs/msg/Float64";

fn rows(topics: &[(&str, &str, f64)], map: &str) -> Result<(Vec<String>, String), String> {
    let bytes = recording(topics);
    let map = format!("[[log]]\nundulation_m = 50\n{map}");
    let (csv, report) = import(&[("two.mcap", &bytes)], &map).map_err(|e| e.to_string())?;
    let lines = csv.lines().map(str::to_owned).collect();
    Ok((lines, report.notices.join("\n")))
}

#[test]
fn two_receivers_are_never_one() {
    let topics = [
        ("/uav/fix", POSITION, 43.5),
        ("/base/fix", POSITION, 43.0),
        ("/sensors/co2", VALUE, 421.0),
    ];
    let why = rows(&topics, "").unwrap_err();
    assert!(
        why.contains("/base/fix, /uav/fix") && why.contains("[log.column.lat_deg]"),
        "{why}"
    );
    let stated = "[log.column.lat_deg]\nfrom = \"/uav/fix.latitude\"\n[log.column.co2_ppm]\nunit = \"ppm\"\n";
    let (lines, _) = rows(&topics, stated).unwrap();
    assert_eq!(
        lines[0],
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm"
    );
    assert_eq!(lines[1], "1714557600,two,43.5,-7,350,421");
    assert_eq!(lines.len(), 11);
}

#[test]
fn two_vehicles_are_two_platforms_and_a_base_station_is_none() {
    let topics = [
        ("/north/fix", POSITION, 43.5),
        ("/north/co2", VALUE, 421.0),
        ("/south/fix", POSITION, 43.4),
        ("/south/co2", VALUE, 500.0),
        ("/base/fix", POSITION, 43.0),
    ];
    let (lines, _) = rows(&topics, "[log.column.co2_ppm]\nunit = \"ppm\"\n").unwrap();
    assert_eq!(lines[1], "1714557600,north,43.5,-7,350,421");
    assert_eq!(lines[2], "1714557600,south,43.4,-7,350,500");
    assert_eq!(lines.len(), 21);
    // One receiver before and after its filter: the filtered position, and that is said.
    let mavros = [
        ("/mavros/global_position/raw/fix", POSITION, 43.0),
        ("/mavros/global_position/global", POSITION, 43.5),
        ("/sensors/co2", VALUE, 421.0),
    ];
    let (lines, notices) = rows(&mavros, "").unwrap();
    assert_eq!(lines[1], "1714557600,two,43.5,-7,350,421");
    assert!(
        notices
            .contains("of /mavros/global_position/global, not of /mavros/global_position/raw/fix"),
        "{notices}"
    );
}

#[test]
fn the_pressure_of_an_airspeed_sensor_is_not_the_airs() {
    let topics = [
        ("/uav/fix", POSITION, 43.5),
        ("/sensors/co2", VALUE, 421.0),
        ("/mavros/imu/diff_pressure", AIR, 300.0),
        ("/weather/static_pressure", AIR, 94_400.0),
    ];
    let (lines, _) = rows(&topics, "").unwrap();
    assert_eq!(lines[1], "1714557600,two,43.5,-7,350,421,944");
    let two = [
        topics[0],
        topics[1],
        ("/a/pressure", AIR, 95_000.0),
        ("/b/pressure", AIR, 90_000.0),
    ];
    let (lines, notices) = rows(&two, "").unwrap();
    assert_eq!(
        lines[0],
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm"
    );
    assert!(
        notices.contains("pressure_hpa is not used: /a/pressure, /b/pressure have it"),
        "{notices}"
    );
}
