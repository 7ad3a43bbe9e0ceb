//! Observations as CSV: what is read, joined, told and refused.

use plume::Gas;
use proptest::prelude::*;
use scenario::observations::{LineEnd, ObservationError, ObservationRow, Observations, parse};

const HEADER: &str = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm";

fn one(text: &str) -> Result<Observations, ObservationError> {
    parse(&[("a.csv", text)], Gas::Co2)
}

fn with_rows(rows: &str) -> Result<Observations, ObservationError> {
    one(&format!("{HEADER}\n{rows}"))
}

fn message(text: &str) -> String {
    match one(text) {
        Ok(got) => panic!("must be refused: {got:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn columns_are_found_by_name_in_any_order() {
    let text = "co2_ppm, alt_amsl_m ,lon_deg,lat_deg,platform,time_s,wind_from_deg\n\
                451.5,820,-7.86,43.44,\"red, one\",3,270\n,821,-7.87,43.45,\"red, one\",4,\n";
    let got = one(text).unwrap();
    assert_eq!(got.platforms, ["red, one"]);
    assert_eq!(got.rows.len(), 2);
    assert_eq!(got.readings(), 1);
    let first = got.rows[0];
    assert_eq!(
        (first.time_s, first.lat_deg, first.lon_deg),
        (3.0, 43.44, -7.86)
    );
    assert_eq!(
        (first.co2_ppm, first.wind_from_deg),
        (Some(451.5), Some(270.0))
    );
    assert_eq!(first.wind_speed_m_s, None);
    assert_eq!(
        (got.rows[1].co2_ppm, got.rows[1].wind_from_deg),
        (None, None)
    );
    assert!(got.notices.is_empty());
}

#[test]
fn unknown_columns_are_kept_aside_and_said_so() {
    let got = one(&format!(
        "{HEADER},battery_v\n1,a,43,-7,500,450,11.1\n2,a,43,-7,500,451,\n"
    ))
    .unwrap();
    assert_eq!(got.extra.len(), 1);
    assert_eq!(got.extra[0].name, "battery_v");
    assert_eq!(got.extra[0].cells, ["11.1", ""]);
    assert_eq!(got.notices.len(), 1);
    assert!(got.notices[0].contains("a.csv") && got.notices[0].contains("battery_v"));
}

/// The same two rows of methane with white noise, in ppm and in ppb.
const IN_PPM: &str = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,sd_ppm\n\
    0,a,43,-7,500,1.952,0.003\n1,a,43,-7,500,2.034,0.003\n";
const IN_PPB: &str = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppb,sd_ppb\n\
    0,a,43,-7,500,1952,3\n1,a,43,-7,500,2034,3\n";

#[test]
fn ppb_and_ppm_are_the_same_readings() {
    let [ppm, ppb] = [IN_PPM, IN_PPB].map(|text| parse(&[("a.csv", text)], Gas::Ch4).unwrap());
    assert_eq!(ppm.rows, ppb.rows);
    assert_eq!((ppm.gas, ppm.rows[1].co2_ppm), (Gas::Ch4, Some(2.034)));
    assert_eq!(
        (ppm.said(2.034), ppb.said(2.034)),
        ("2.034 ppm".into(), "2034 ppb".into())
    );
    // Written, they are in ppm under their own gas's name.
    assert!(
        ppb.to_csv()
            .starts_with("time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,sd_ppm")
    );
    assert_eq!(
        parse(&[("b", &ppb.to_csv())], Gas::Ch4).unwrap().rows,
        ppm.rows
    );
}

#[test]
fn several_gases_are_one_file_of_which_one_is_read() {
    let text = format!("{HEADER},ch4_ppb\n0,a,43,-7,500,450,1952\n1,a,43,-7,500,451,1953\n");
    let co2 = one(&text).unwrap();
    assert_eq!(co2.rows[0].co2_ppm, Some(450.0));
    assert!(co2.notices[0].contains("ch4_ppb") && co2.notices[0].contains("--gas ch4"));
    let ch4 = parse(&[("a.csv", &text)], Gas::Ch4).unwrap();
    assert_eq!(ch4.rows[0].co2_ppm, Some(1.952));
    assert_eq!(ch4.extra[0].cells, ["450", "451"]);
}

#[test]
fn another_gas_than_the_sources_is_refused_with_what_to_write() {
    let refused = |text: &str, gas| parse(&[("a.csv", text)], gas).unwrap_err().to_string();
    let co2 = refused(&format!("{HEADER}\n0,a,43,-7,500,450\n"), Gas::Ch4);
    for part in [
        "a.csv: line 1, column ch4_ppm",
        "the source emits CH4, and the file has co2_ppm",
        "ch4_ppm or ch4_ppb",
        "gas = \"co2\" in the scenario's [[source]]",
    ] {
        assert!(co2.contains(part), "{co2}");
    }
    assert!(refused(IN_PPB, Gas::Co2).contains("gas = \"ch4\""));
    let both = IN_PPB.replace("sd_ppb", "ch4_ppm");
    assert!(refused(&both, Gas::Ch4).contains("column ch4_ppb: beside ch4_ppm; expected one of"));
    let none = refused("time_s,platform,lat_deg,lon_deg,alt_amsl_m\n", Gas::H2s);
    assert!(none.contains("h2s_ppm (or h2s_ppb)"), "{none}");
}

#[test]
fn files_are_joined_in_order_of_time() {
    let a = format!("{HEADER}\n0,a,43,-7,500,450\n4,a,43,-7,500,452\n");
    let b = format!("{HEADER}\n2,b,43,-7,500,451\n4,b,43,-7,500,453\n");
    // The same platform goes on in a third file, before and after.
    let c = format!("{HEADER}\n3,a,43,-7,500,454\n9,a,43,-7,500,455\n");
    let got = parse(&[("a", &a), ("b", &b), ("c", &c)], Gas::Co2).unwrap();
    assert_eq!(got.platforms, ["a", "b"]);
    let order: Vec<_> = got.rows.iter().map(|r| (r.time_s, r.platform)).collect();
    assert_eq!(
        order,
        [(0.0, 0), (2.0, 1), (3.0, 0), (4.0, 0), (4.0, 1), (9.0, 0)]
    );
}

#[test]
fn a_byte_order_mark_and_windows_line_ends_do_no_harm() {
    let text = format!("\u{feff}{HEADER}\r\n1,a,43,-7,500,450\r\n");
    assert_eq!(one(&text).unwrap().rows.len(), 1);
}

#[test]
fn rows_without_place_are_left_out_and_nan_is_missing_both_aloud() {
    let got = with_rows("1,a,,-7,500,450\n2,a,43,-7,500,NaN\n3,a,43,-7,500,451\n").unwrap();
    assert_eq!(got.rows.len(), 2);
    assert_eq!(got.rows[0].co2_ppm, None);
    assert_eq!(got.notices.len(), 2);
    assert!(got.notices[0].contains("co2_ppm: 1 cells say \"nan\""));
    assert!(got.notices[1].contains("1 rows without lat_deg") && got.notices[1].contains("line 2"));
}

#[test]
fn an_exact_repetition_is_dropped_aloud() {
    let got = with_rows("1,a,43,-7,500,450\n1,a,43,-7,500,450\n2,a,43,-7,500,451\n").unwrap();
    assert_eq!(got.rows.len(), 2);
    assert!(got.notices[0].contains("1 rows that repeat"));
}

#[test]
fn empty_files_are_refused() {
    assert_eq!(parse(&[], Gas::Co2), Err(ObservationError::NoFile));
    assert!(message(" \n").contains("a.csv: line 1: the file is empty"));
    assert!(message(HEADER).contains("a.csv: line 2: no rows below the header"));
}

#[test]
fn readings_that_are_all_missing_are_refused() {
    let text = format!("{HEADER}\n1,a,43,-7,500,\n2,a,43,-7,500,nan\n");
    assert!(message(&text).contains("co2_ppm: missing in all 2 rows"));
    let text = format!("{HEADER}\n1,a,,,,450\n");
    assert!(message(&text).contains("missing in all 0 rows"));
}

#[test]
fn a_header_without_a_column_or_with_one_twice_is_refused() {
    let text = message("time_s,platform,lat_deg,lon_deg,alt_m,co2_ppm\n1,a,43,-7,500,450\n");
    assert!(text.contains("line 1, column alt_amsl_m: missing") && text.contains("alt_m"));
    let text = message(&format!("{HEADER},co2_ppm\n1,a,43,-7,500,450,451\n"));
    assert!(text.contains("column co2_ppm: named twice"));
    let text = message("time_s;platform;lat_deg;lon_deg;alt_amsl_m;co2_ppm\n1;a;43;-7;500;450\n");
    assert!(text.contains("separated by commas"));
}

#[test]
fn cells_that_are_no_number_name_file_line_and_column() {
    for (rows, column) in [
        (
            "1,a,43,-7,500,450\n2,a,43,-7,500,high",
            "line 3, column co2_ppm: found \"high\"",
        ),
        ("x,a,43,-7,500,450", "line 2, column time_s: found \"x\""),
        (",a,43,-7,500,450", "line 2, column time_s: found \"\""),
        ("1,,43,-7,500,450", "line 2, column platform: found \"\""),
        (
            "1,a,43N,-7,500,450",
            "line 2, column lat_deg: found \"43N\"",
        ),
        ("1,a,43,-7,500,inf", "line 2, column co2_ppm: found \"inf\""),
        (
            "nan,a,43,-7,500,450",
            "line 2, column time_s: found \"nan\"",
        ),
        (
            "1e300,a,43,-7,500,450",
            "line 2, column time_s: found \"1e300\"",
        ),
    ] {
        let text = message(&format!("{HEADER}\n{rows}\n"));
        assert!(
            text.contains(column) && text.contains("expected"),
            "{rows}: {text}"
        );
    }
}

// Numbers that cannot be are the checks' to say: a code for none is no reason to refuse a whole log.
#[test]
fn numbers_that_cannot_be_are_read() {
    let columns = "wind_speed_m_s,pressure_hpa,relative_humidity_pct,temperature_c,sd_ppm";
    let text = format!("{HEADER},{columns}\n1,a,93,-187,500000,450,-1,0,-9999,288.15,0\n");
    let row = one(&text).unwrap().rows[0];
    assert_eq!(
        (row.lat_deg, row.lon_deg, row.alt_amsl_m),
        (93.0, -187.0, 5e5)
    );
    assert_eq!(row.wind_speed_m_s, Some(-1.0));
    assert_eq!(row.relative_humidity_pct, Some(-9999.0));
    assert_eq!(row.temperature_c, Some(288.15));
    assert_eq!((row.pressure_hpa, row.sd_ppm), (Some(0.0), Some(0.0)));
}

#[test]
fn lines_of_another_length_are_refused() {
    let text = message(&format!("{HEADER}\n1,a,43,-7,500,450\n2,a,43,-7,500\n"));
    assert!(
        text.contains("a.csv: line 3: 5 cells; expected 6 cells"),
        "{text}"
    );
}

#[test]
fn times_out_of_order_or_repeated_are_refused() {
    let text = message(&format!(
        "{HEADER}\n2,a,43,-7,500,450\n1,b,43,-7,500,450\n1,a,43,-7,500,450\n"
    ));
    assert!(
        text.contains("a.csv: line 4, column time_s: platform a is at 1 s after it was at 2 s")
    );
    let text = message(&format!("{HEADER}\n2,a,43,-7,500,450\n2,a,43,-7,500,451\n"));
    assert!(
        text.contains("line 3") && text.contains("first in a.csv, line 2"),
        "{text}"
    );
}

#[test]
fn means_over_a_time_and_a_line_are_read() {
    let text = format!(
        "{HEADER},averaging_s,lat2_deg,lon2_deg,alt2_amsl_m\n1,a,43,-7,500,450,300,43.01,-7.01,520\n\
         2,b,43,-7,500,451,,,,\n"
    );
    let read = one(&text).unwrap();
    assert!(read.notices.is_empty() && read.extra.is_empty(), "{read:?}");
    let [mean, point] = [read.rows[0], read.rows[1]];
    assert_eq!(mean.averaging_s, Some(300.0));
    let end = LineEnd {
        lat_deg: 43.01,
        lon_deg: -7.01,
        alt_amsl_m: 520.0,
    };
    assert_eq!(mean.line_end, Some(end));
    assert_eq!((point.averaging_s, point.line_end), (None, None));

    let half = message(&format!(
        "{HEADER},lat2_deg,lon2_deg\n1,a,43,-7,500,450,43,-7\n"
    ));
    assert!(half.contains("column alt2_amsl_m: missing"), "{half}");
    let cell = message(&text.replace("-7.01,520", ",520"));
    assert!(
        cell.contains("line 2, column lon2_deg") && cell.contains("together"),
        "{cell}"
    );
    for name in ["ch4_ppm_m", "CH4 (ppm·m)", "co2_ppb_m"] {
        let density = message(&format!("{HEADER},{name}\n1,a,43,-7,500,450,90\n"));
        assert!(
            density.contains("divide by the line's length in m"),
            "{density}"
        );
    }
}

fn observation() -> impl Strategy<Value = ObservationRow> {
    let some = |low: f64, high: f64| proptest::option::of(low..high);
    let place = (0..3_usize, -90.0..90.0, -180.0..180.0, -400.0..9000.0);
    let more = (some(0.0, 90.0), some(0.0, 360.0), some(-40.0, 40.0));
    let line = proptest::option::of((-90.0..90.0, -180.0..180.0, -400.0..9000.0));
    let mean = (some(0.0, 3600.0), line);
    let last = (some(0.0, 100.0), some(300.0, 1100.0), some(0.1, 9.0), mean);
    (place, 1.0..2000.0_f64, more, last).prop_map(|(place, co2_ppm, more, last)| ObservationRow {
        time_s: 0.0,
        platform: place.0,
        lat_deg: place.1,
        lon_deg: place.2,
        alt_amsl_m: place.3,
        co2_ppm: Some(co2_ppm),
        wind_speed_m_s: more.0,
        wind_from_deg: more.1,
        temperature_c: more.2,
        relative_humidity_pct: last.0,
        pressure_hpa: last.1,
        sd_ppm: last.2,
        averaging_s: last.3.0,
        line_end: last.3.1.map(|(lat_deg, lon_deg, alt_amsl_m)| LineEnd {
            lat_deg,
            lon_deg,
            alt_amsl_m,
        }),
        spread_s: 0.0,
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_back(rows in proptest::collection::vec(observation(), 1..40)) {
        let mut rows = rows;
        for (i, row) in rows.iter_mut().enumerate() {
            row.time_s = i as f64 * 0.1;
        }
        let platforms = vec!["a".to_owned(), "b \"q\"".to_owned(), "c,d".to_owned()];
        let written = Observations { rows, platforms, ..Observations::default() };
        let read = parse(&[("x", &written.to_csv())], Gas::Co2).unwrap();
        prop_assert_eq!(read.rows.len(), written.rows.len());
        for (r, w) in read.rows.iter().zip(&written.rows) {
            prop_assert_eq!(&read.platforms[r.platform], &written.platforms[w.platform]);
            prop_assert_eq!(ObservationRow { platform: w.platform, ..*r }, *w);
        }
    }

    #[test]
    fn no_text_makes_it_panic(text in ".{0,200}", rows in "[0-9,.a\n-]{0,200}") {
        let _ = parse(&[("x", &text)], Gas::Co2);
        let _ = parse(&[("x", &format!("{HEADER}\n{rows}"))], Gas::Co2);
    }
}
