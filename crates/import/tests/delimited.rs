//! Logs of text in the layouts in which people have them.
//!
//! The logs are written by hand from how the instruments' manuals show them; expected numbers by hand from the
//! definitions of the units: 1 ft = 0.3048 m, 1 mph = 0.44704 m/s, `date -u -d 2024-05-01T10:00:00Z +%s` = 1714557600.

use crate::common::{import, refused, text};
use proptest::prelude::*;

#[test]
fn a_european_spreadsheet_with_a_preamble_units_and_a_second_header() {
    let log = "Logger 12\nSite: hill\n\nDate;Time;Latitude;Longitude;Altitude;CO2;Temp\n;;deg;deg;m;ppm;°C\n\
        01.05.2024;10:00:00;43,4417;-7,8631;340,5;421,5;12,1\n\
        01.05.2024;10:00:01;43,4418;-7,8631;340,5;---;12,2\n\
        Date;Time;Latitude;Longitude;Altitude;CO2;Temp\n\
        01.05.2024;10:00:02;43,4419;-7,8631;341;423,5;12,2\n";
    let (csv, report) = text(log);
    assert_eq!(
        csv,
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,temperature_c\n\
         1714557600,a,43.4417,-7.8631,340.5,421.5,12.1\n\
         1714557601,a,43.4418,-7.8631,340.5,,12.2\n\
         1714557602,a,43.4419,-7.8631,341,423.5,12.2\n"
    );
    let notices = report.notices.join("\n");
    for expected in [
        "day first",
        "decimal commas",
        "read as UTC",
        "lines 1 to 3",
        "header",
        "above mean sea level",
    ] {
        assert!(notices.contains(expected), "{expected} in {notices}");
    }
}

#[test]
fn american_units_latin_1_and_quotes() {
    let log = b"\"Time stamp (UTC)\",\"Lat\",\"Lon\",\"Altitude MSL (ft)\",\"CH4, total [ppb]\",\"Wind Speed (mph)\",\"Temp (\xB0F)\"\n\
        \"5/13/2024 10:00:00 AM\",43.5,-7.5,1000,\"1901\",10,50\n";
    let map = "[[log]]\n[log.column.ch4_ppb]\nfrom = \"CH4, total [ppb]\"\n";
    let (csv, report) = import(&[("b.csv", log)], map).unwrap();
    // 1715594400: date -u -d 2024-05-13T10:00:00Z +%s
    assert_eq!(
        csv,
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppb,wind_speed_m_s,temperature_c\n\
         1715594400,b,43.5,-7.5,304.8,1901,4.4704,10\n"
    );
    assert!(report.notices.join("\n").contains("Latin-1"));
}

#[test]
fn whole_seconds_of_a_fast_log_are_spread_and_said() {
    let mut log = "time,lat,lon,alt_amsl_m,co2_ppm\n".to_owned();
    for k in 0..20 {
        log += &format!("2024-05-01T10:00:{:02}Z,43,-7,340,{}\n", k / 4, 400 + k);
    }
    let (csv, report) = text(&log);
    let times: Vec<f64> = csv
        .lines()
        .skip(1)
        .map(|l| l.split(',').next().unwrap().parse().unwrap())
        .collect();
    for (k, time) in times.iter().enumerate() {
        assert_eq!(*time, 1_714_557_600.0 + 0.25 * k as f64);
    }
    assert!(
        report
            .notices
            .join("\n")
            .contains("15 of 20 rows share a time")
    );
}

#[test]
fn counts_since_1970_are_told_by_their_size() {
    for (unit, stamp) in [
        ("s", "1714557600.5"),
        ("ms", "1714557600500"),
        ("us", "1714557600500000"),
    ] {
        let log = format!("timestamp,lat,lon,alt_amsl_m,co2_ppm\n{stamp},43,-7,340,421\n");
        let (csv, report) = text(&log);
        assert!(csv.contains("\n1714557600.5,"), "{csv}");
        assert!(
            report
                .notices
                .join("\n")
                .contains(&format!("{unit} since 1970"))
        );
    }
}

#[test]
fn local_times_are_read_with_the_stated_zone_and_times_count_from_the_stated_zero() {
    let log = "local time,lat,lon,alt_amsl_m,co2_ppm\n2024-05-01 12:00:05,43,-7,340,421\n";
    let map = "zero = \"2024-05-01T10:00:00Z\"\n[[log]]\nzone = \"+02:00\"\n";
    let (csv, _) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    assert!(csv.contains("\n5,a,"), "{csv}");
    let (csv, report) = text(log);
    assert!(csv.contains("\n1714564805,a,"), "{csv}");
    assert!(
        report
            .notices
            .join("\n")
            .contains("local time without a time zone")
    );
}

#[test]
fn a_height_that_does_not_count_from_the_sea_needs_a_statement() {
    let log = |header: &str| format!("time_s,lat,lon,{header},co2_ppm\n0,43,-7,100,421\n");
    for (header, key, value, expected) in [
        (
            "height_above_takeoff(feet)",
            "base_amsl_m",
            340.0,
            340.0 + 30.48,
        ),
        ("HAE (m)", "undulation_m", 54.5, 45.5),
        // The standard atmosphere is 27.3 ft a hPa at sea level (ICAO Doc 7488: 8.32 m): 10 hPa above the standard.
        ("pressure_altitude_m", "qnh_hpa", 1023.25, 182.8),
    ] {
        let error = refused(&log(header), "");
        assert!(error.contains(&key.replace('_', "-")), "{error}");
        let map = format!("[[log]]\n{key} = {value}\n");
        let (csv, _) = import(&[("a.csv", log(header).as_bytes())], &map).unwrap();
        let alt: f64 = csv
            .lines()
            .nth(1)
            .unwrap()
            .split(',')
            .nth(4)
            .unwrap()
            .parse()
            .unwrap();
        assert!((alt - expected).abs() < 0.6, "{header}: {alt}");
    }
}

#[test]
fn an_instrument_that_stands_still_is_told_where() {
    let log = "TIMESTAMP,CH4\n2024-05-01 10:00:00,1.95\n";
    let error = refused(log, "");
    assert!(error.contains("--set lat_deg=VALUE"), "{error}");
    let map = "[[log]]\n[log.column.lat_deg]\nvalue = 43.5\n[log.column.lon_deg]\nvalue = -7.5\n\
        [log.column.alt_amsl_m]\nvalue = 340\n";
    let (csv, _) = import(&[("mast.csv", log.as_bytes())], map).unwrap();
    assert!(csv.contains("1714557600,mast,43.5,-7.5,340,1.95"), "{csv}");
}

#[test]
fn masses_in_a_volume_are_said_with_their_air() {
    let log = "time_s,lat,lon,alt_amsl_m,SO2 (ug/m3)\n0,43,-7,340,100\n";
    let (csv, report) = text(log);
    // EU directive 2008/50/EC: at 293 K and 101.3 kPa 1 ppb of SO2 is 2.66 ug/m3.
    let ppb: f64 = csv
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(5)
        .unwrap()
        .parse()
        .unwrap();
    assert!((ppb - 100.0 / 2.66).abs() < 0.1, "{ppb}");
    assert!(
        report
            .notices
            .join("\n")
            .contains("assumed: \"SO2 (ug/m3)\" is a mass concentration in air at 20 °C")
    );
}

#[test]
fn rows_that_run_back_are_sorted_and_platforms_told_apart() {
    let log = "time_s,station,lat,lon,alt_amsl_m,co2_ppm\n2,a,43,-7,340,1\n2,b,43,-7,340,2\n1,a,43,-7,340,3\n";
    let (csv, report) = text(log);
    let rows: Vec<&str> = csv.lines().skip(1).collect();
    assert_eq!(
        rows,
        ["1,a,43,-7,340,3", "2,a,43,-7,340,1", "2,b,43,-7,340,2"]
    );
    assert_eq!(report.platforms, ["a", "b"]);
    assert!(report.notices.join("\n").contains("sorted"));
}

#[test]
fn what_cannot_be_read_is_refused_with_where_and_what_to_do() {
    for (log, map, expected) in [
        ("a,b,c\n1,2,3\n", "", "no header found"),
        ("", "", "the file is empty"),
        ("time_s,lat,lon,alt_amsl_m,co2_ppm\n", "", "no header found"),
        (
            "time,lat,lon,alt_amsl_m,co2_ppm\n03/04/2024 10:00,43,-7,340,421\n",
            "",
            "--date-order dmy or mdy",
        ),
        (
            "time_s,lat,lon,alt_amsl_m,SO2\n0,43,-7,340,5\n",
            "",
            "the unit of so2 is unknown",
        ),
        (
            "time_s,lat,lon,alt_amsl_m,speed\n0,43,-7,340,5\n",
            "",
            "no gas",
        ),
        (
            "Julian days,lat,lon,alt_amsl_m,co2_ppm\n12.5,43,-7,340,421\n",
            "",
            "fractions of days",
        ),
        (
            "time_s,lat,lon,alt_amsl_m,co2_ppm\n0,43,-7,340,421\n",
            "[[log]]\ntime = \"clock\"\n",
            "no column is called \"clock\"",
        ),
        (
            "time,lat,lon,alt_amsl_m,co2_ppm\n45413.41666,43,-7,340,421\n45413.41667,43,-7,340,421\n",
            "",
            "day numbers of a spreadsheet",
        ),
        (
            "time_s,lat,lon,alt_amsl_m,co2_ppm\n0,43,-7,340,421\n1,43,-7,340,over\n",
            "",
            "line 3: 1 cells for co2_ppm are not numbers, such as \"over\"",
        ),
    ] {
        let error = refused(log, map);
        assert!(
            error.starts_with("a.csv") && error.contains(expected),
            "{expected} in {error}"
        );
    }
}

#[test]
fn the_mapping_file_that_is_written_does_the_same_again() {
    let log = "Zeit;Breite;Höhe;Gas\n2024-05-01 10:00:00;43°26'30,12\"N;1000;1901\n";
    let map = "[[log]]\ntime = \"Zeit\"\nzone = \"+02:00\"\ndecimal = \",\"\nbase_amsl_m = 12\n\
        [log.column.lat_deg]\nfrom = \"Breite\"\nunit = \"dms\"\n[log.column.lon_deg]\nvalue = -7.5\n\
        [log.column.alt_amsl_m]\nfrom = \"Höhe\"\nunit = \"ft\"\ndatum = \"ground\"\n\
        [log.column.ch4_ppb]\nfrom = \"Gas\"\nunit = \"ppb\"\nscale = 1.1\noffset = -1.1\n";
    let (first, report) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    // 43 + 26/60 + 30.12/3600; 1000 ft + 12 m; 1901 · 1.1 − 1.1
    assert!(
        first.contains("1714550400,a,43.4417,-7.5,316.8,2090"),
        "{first}"
    );
    let again = report.map.to_toml(&report.notices);
    let (second, _) = import(&[("a.csv", log.as_bytes())], &again).unwrap();
    assert_eq!(first, second, "{again}");
}

#[test]
fn plumages_own_columns_go_through_as_they_are() {
    let log = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,wind_speed_m_s,wind_from_deg,temperature_c,\
        relative_humidity_pct,pressure_hpa,sd_ppm,averaging_s\n0.5,x,43.1,-7.25,700.5,421.25,5.5,270,12.5,55,930.25,2,300\n";
    assert_eq!(text(log).0, log);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_layout_does_not_matter(
        rows in proptest::collection::vec((-89.0..89.0_f64, -179.0..179.0_f64, 0.0..3000.0_f64, 300.0..3000.0_f64), 3..30),
        delimiter in prop_oneof![Just(','), Just(';'), Just('\t'), Just('|')],
        comma in any::<bool>(),
        utf16 in any::<bool>(),
        preamble in 0..3_usize,
        crlf in any::<bool>(),
    ) {
        let number = |v: f64| {
            let text = format!("{v:.4}");
            let text = if comma { text.replace('.', ",") } else { text };
            if comma && delimiter == ',' { format!("\"{text}\"") } else { text }
        };
        let end = if crlf { "\r\n" } else { "\n" };
        let mut log = format!("made by hand{end}").repeat(preamble);
        log += &["Time", "Latitude", "Longitude", "alt_amsl_m", "CO2 (ppm)"].join(&delimiter.to_string());
        log += end;
        let mut expected = String::from("time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm\n");
        for (k, (lat, lon, alt, gas)) in rows.iter().enumerate() {
            let cells = [format!("2024-05-01 10:00:{k:02}"), number(*lat), number(*lon), number(*alt), number(*gas)];
            log += &cells.join(&delimiter.to_string());
            log += end;
            let four = |v: f64| format!("{v:.4}").parse::<f64>().unwrap();
            expected += &format!("{},a,{},{},{},{}\n", 1_714_557_600 + k, four(*lat), four(*lon), four(*alt), four(*gas));
        }
        let bytes = if utf16 {
            [vec![0xFF, 0xFE], log.encode_utf16().flat_map(u16::to_le_bytes).collect()].concat()
        } else {
            log.into_bytes()
        };
        prop_assert_eq!(import(&[("a.csv", &bytes)], "").unwrap().0, expected);
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400), head in any::<bool>()) {
        let mut log = if head { b"time,lat,lon,alt_amsl_m,co2_ppm\n".to_vec() } else { Vec::new() };
        log.extend(bytes);
        let _ = import(&[("a.csv", &log)], "");
    }
}
