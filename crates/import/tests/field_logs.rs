//! Logs of the field: components of wind, metres, a column for each sensor, several gases, wet and dry columns.

use crate::common::{import, refused, text};

/// The columns of a CSV by their names, as numbers.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let at = lines.next().unwrap().split(',').position(|c| c == name);
    let at = at.unwrap_or_else(|| panic!("no {name} in {csv}"));
    lines
        .map(|l| l.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN))
        .collect()
}

fn close(a: &[f64], b: &[f64], within: f64) {
    let is_close = |(a, b): (&f64, &f64)| (a - b).abs() <= within;
    assert!(
        a.len() == b.len() && a.iter().zip(b).all(is_close),
        "{a:?} {b:?}"
    );
}

#[test]
fn components_of_the_earth_become_a_wind() {
    // 3 m/s towards east and 4 towards north is 5 m/s towards 36.87 degrees, from 216.87; 10 knots are 5.144 m/s.
    let log = "time_s,lat,lon,alt_amsl_m,co2_ppm,U,V\n0,43,-7,340,421,3,4\n1,43,-7,340,421,0,-2\n2,43,-7,340,421,,1\n";
    let map = "[[log]]\n[log.wind]\neast = \"U\"\nnorth = \"V\"\n";
    let (csv, report) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    close(&column(&csv, "wind_speed_m_s")[..2], &[5.0, 2.0], 1e-4);
    close(&column(&csv, "wind_from_deg")[..2], &[216.870, 0.0], 1e-3);
    assert!(column(&csv, "wind_from_deg")[2].is_nan());
    assert!(
        report
            .notices
            .join("\n")
            .contains("\"U\" towards east and \"V\" towards north")
    );
    // Positive where the wind comes from, and in knots.
    let map = "[[log]]\n[log.wind]\neast = \"-U\"\nnorth = \"-V\"\nunit = \"knots\"\n";
    let (csv, report) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    close(
        &column(&csv, "wind_speed_m_s")[..1],
        &[5.0 * 0.514_444],
        1e-3,
    );
    close(&column(&csv, "wind_from_deg")[..1], &[36.870], 1e-3);
    // The mapping file that the import writes does the same.
    let again = import(&[("a.csv", log.as_bytes())], &report.map.to_toml(&[])).unwrap();
    assert_eq!(again.0, csv);
    let (_, unstated) = text(log);
    assert!(
        unstated
            .notices
            .join("\n")
            .contains("look like components of the wind")
    );
}

#[test]
fn components_of_a_platform_are_turned_by_its_heading_and_gain_its_velocity() {
    // It flies east (yaw 90) at 10 m/s in a wind of 5 m/s towards north: the air passes it with 10 m/s from the front,
    // so -10 forward, and with 5 m/s towards its left, so -5 to the right.
    let log = "time_s,lat,lon,alt_amsl_m,co2_ppm,X,Y,Heading,VE,VN\n\
        0,43,-7,340,421,-10,-5,90,10,0\n1,43,-7,340,421,-6,-8,0,8,11\n";
    let map = "[[log]]\n[log.wind]\nforward = \"X\"\nright = \"Y\"\nyaw = \"Heading\"\nvel_east = \"VE\"\n\
        vel_north = \"VN\"\n";
    let (csv, _) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    // In the second it heads north: -6 + 11 towards north, -8 + 8 towards east.
    close(&column(&csv, "wind_speed_m_s"), &[5.0, 5.0], 1e-9);
    close(&column(&csv, "wind_from_deg"), &[180.0, 180.0], 1e-9);
    for (map, words) in [
        (
            "forward = \"X\"\nright = \"Y\"\n",
            "the components of the wind are not clear",
        ),
        ("east = \"X\"\n", "east, north: one of two"),
        ("east = \"X\"\nnorth = \"Z\"\n", "no column is called \"Z\""),
        ("east = \"X\"\nup = \"Z\"\n", "unknown field"),
    ] {
        let why = refused(log, &format!("[[log]]\n[log.wind]\n{map}"));
        assert!(why.contains(words), "{why}");
    }
}

#[test]
fn metres_become_latitude_and_longitude() {
    // pyproj: UTM 29 N, 592000 E, 4810500 N is 43.441750430, -7.863107011.
    let log = "time_s,Easting,Northing,alt_amsl_m,co2_ppm\n0,592000,4810500,340,421\n";
    let map =
        "[[log]]\n[log.position]\neast = \"Easting\"\nnorth = \"Northing\"\nutm_zone = \"29N\"\n";
    let (csv, _) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    close(&column(&csv, "lat_deg"), &[43.441_750_430], 2e-9);
    close(&column(&csv, "lon_deg"), &[-7.863_107_011], 2e-9);
    // 100 m north on WGS84 at 43.4 degrees: a minute of latitude is 1851.4 m.
    let log = "time_s,x,y,alt_amsl_m,co2_ppm\n0,0,100,340,421\n";
    let map = "[[log]]\n[log.position]\neast = \"x\"\nnorth = \"y\"\norigin_lat_deg = 43.4\norigin_lon_deg = -7.8\n";
    let (csv, _) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    close(
        &column(&csv, "lat_deg"),
        &[43.4 + 100.0 / 1851.4 / 60.0],
        1e-6,
    );
    let why = refused(log, "");
    assert!(why.contains("[log.position]"), "{why}");
    let why = refused(
        log,
        "[[log]]\n[log.position]\neast = \"x\"\nnorth = \"y\"\nutm_zone = \"29\"\n",
    );
    assert!(why.contains("such as 29N"), "{why}");
}

#[test]
fn a_column_for_each_sensor_becomes_a_platform_for_each() {
    let log = "time_s,CH4 north,CH4 south,ws,wd\n0,1.9,2.5,3,270\n60,1.95,,3,280\n";
    let map = "[[log]]\n[log.column.ch4_ppm]\nunit = \"ppm\"\n[log.column.alt_amsl_m]\nvalue = 342\n\
        [[log.sensor]]\nplatform = \"north\"\nlat_deg = 43.5\nlon_deg = -7.5\nfrom = { ch4_ppm = \"CH4 north\" }\n\
        [[log.sensor]]\nplatform = \"south\"\nlat_deg = 43.4\nlon_deg = -7.6\nfrom = { ch4_ppm = \"CH4 south\" }\n";
    let (csv, report) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    assert_eq!(
        csv,
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,wind_speed_m_s,wind_from_deg\n\
         0,north,43.5,-7.5,342,1.9,3,270\n0,south,43.4,-7.6,342,2.5,3,270\n\
         60,north,43.5,-7.5,342,1.95,3,280\n60,south,43.4,-7.6,342,,3,280\n"
    );
    assert_eq!(report.platforms, ["north", "south"]);
    let again = import(&[("a.csv", log.as_bytes())], &report.map.to_toml(&[])).unwrap();
    assert_eq!(again.0, csv);
}

#[test]
fn several_gases_come_out_beside_each_other_whatever_they_are_called() {
    let log = "time_s,lat,lon,alt_amsl_m,CH4 (ppm),C2H2 (ppb),N2O (ppb),C2H6_ppb,HCl (ppb),PFC\n\
        0,43,-7,340,1.95,2.5,335,1.2,0.4,7\n";
    let map = "[[log]]\n[log.column.pfc_ppb]\nfrom = \"PFC\"\nunit = \"ppt\"\n";
    let (csv, report) = import(&[("a.csv", log.as_bytes())], map).unwrap();
    assert_eq!(
        csv,
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,n2o_ppb,c2h6_ppb,c2h2_ppb,hcl_ppb,pfc_ppb\n\
         0,a,43,-7,340,1.95,335,1.2,2.5,0.4,0.007\n"
    );
    assert!(report.map.to_toml(&[]).contains("[log.column.pfc_ppb]"));
    let why = refused(
        log,
        "[[log]]\n[log.column.pfc_ppb]\nfrom = \"PFC\"\nunit = \"ug/m3\"\n",
    );
    assert!(why.contains("molar mass of pfc is unknown"), "{why}");
}

#[test]
fn dry_air_goes_before_moist_air_where_it_reads() {
    let rows = |dry: &str| {
        format!(
            "time_s,lat,lon,alt_amsl_m,[CH4]_ppm,[CH4]d_ppm\n0,43,-7,340,1.90,{dry}\n1,43,-7,340,1.91,{dry}\n"
        )
    };
    let first = |log: &str| column(&text(log).0, "ch4_ppm")[0];
    assert_eq!(first(&rows("1.95")), 1.95);
    // Off, or not there: the moist one reads.
    assert_eq!((first(&rows("0")), first(&rows(""))), (1.90, 1.90));
    // The preset of Picarro names the dry columns first as well.
    let picarro = |dry: &str| {
        format!(
            "EPOCH_TIME,ALARM_STATUS,INST_STATUS,CavityPressure,GPS_ABS_LAT,GPS_ABS_LONG,alt_amsl_m,CH4,CH4_dry\n\
             1714557600.25,0,963,140,43.5,-7.5,340,1.90,{dry}\n"
        )
    };
    assert_eq!(first(&picarro("1.95")), 1.95);
    assert_eq!(first(&picarro("0.0")), 1.90);
}

#[test]
fn knots_are_converted_where_the_header_says_so_and_questioned_where_the_numbers_do() {
    let log = |header: &str, speed: &dyn Fn(usize) -> String| {
        let rows: Vec<String> = (0..20)
            .map(|k| format!("{k},43,-7,340,421,{},270\n", speed(k)))
            .collect();
        format!(
            "time_s,lat,lon,alt_amsl_m,co2_ppm,{header},wind_dir\n{}",
            rows.concat()
        )
    };
    let whole = |k: usize| (k % 7 + 3).to_string();
    for header in ["Wind Speed (kt)", "wind_speed_knots", "WS [kn]"] {
        let (csv, _) = text(&log(header, &whole));
        assert!(
            (column(&csv, "wind_speed_m_s")[0] - 3.0 * 1852.0 / 3600.0).abs() < 1e-4,
            "{csv}"
        );
    }
    let notices = |log: &str| text(log).1.notices.join("\n");
    assert!(notices(&log("wind_speed", &whole)).contains("whole numbers"));
    assert!(notices(&log("wind_speed", &|k| format!("{}.5", k + 20))).contains("gale"));
    let usual = notices(&log("wind_speed", &|k| format!("{}.5", k % 7)));
    assert!(!usual.contains("knots"), "{usual}");
}

#[test]
fn an_index_without_a_name_and_tabs_of_a_logger_are_read() {
    let index = ",time_s,lat,lon,alt_amsl_m,co2_ppm\n0,5,43,-7,340,421\n1,6,43,-7,340,422\n";
    let (csv, _) = text(index);
    assert!(
        csv.ends_with("5,a,43,-7,340,421\n6,a,43,-7,340,422\n"),
        "{csv}"
    );
    // Campbell Scientific, LoggerNet manual, TOA5; with tabs, as spreadsheets save it.
    let toa5 = "\"TOA5\"\t\"mast\"\t\"CR1000\"\t\"1031\"\t\"CR1000.Std.00.60\"\t\"CPU:Test.CR1\"\t\"4062\"\t\"Test\"\n\
        \"TIMESTAMP\"\t\"RECORD\"\t\"CH4_Avg\"\t\"WS_ms_S_WVT\"\t\"WindDir_D1_WVT\"\t\"AirTC_Avg\"\n\
        \"TS\"\t\"RN\"\t\"ppm\"\t\"meters/second\"\t\"Deg\"\t\"Deg C\"\n\"\"\t\"\"\t\"Avg\"\t\"WVc\"\t\"WVc\"\t\"Avg\"\n\
        \"2024-05-01 10:00:00\"\t0\t1.95\t3.5\t270\t12.5\n\"2024-05-01 10:01:00\"\t1\t1.96\t\"NAN\"\t270\t12.5\n";
    let map = "[[log]]\nzone = \"UTC\"\n[log.column.lat_deg]\nvalue = 43\n[log.column.lon_deg]\nvalue = -7\n\
        [log.column.alt_amsl_m]\nvalue = 340\n";
    for log in [toa5.to_owned(), toa5.replace('\t', ",")] {
        let (csv, report) = import(&[("mast.dat", log.as_bytes())], map).unwrap();
        let notices = report.notices.join("\n");
        assert!(notices.contains("preset toa5"), "{notices}");
        assert!(
            csv.contains("1714557600,mast,43,-7,340,1.95,3.5,270,12.5\n1714557660,mast,43,-7,340,1.96,,270,12.5\n"),
            "{csv}{notices}"
        );
    }
}

// The header and rows of an Aeris MIRA Pico, as the instrument exports them without a receiver.
#[test]
fn the_export_of_an_aeris_is_read() {
    let log = "Time Stamp,Inlet Number,T (degC),CH4 (ppm),H2O (ppm),C2H6 (ppb),R,C2/C1,Battery Charge (V),Power Input (mV),\
        Current (mA),SOC (%),Latitude,Longitude\n\
        06/26/2024 13:45:40.236,0,35.6211,6.51798,23199.8,13.3024,0,-1,12401,14745,585,82,No Data,No Data\n\
        06/26/2024 13:45:41.260,0,35.6217,6.51985,23201.4,13.3887,0,-1,12389,14740,581,82,No Data,No Data\n";
    assert!(refused(log, "").contains("--set lat_deg=VALUE"));
    let map = "[[log]]\n[log.column.lat_deg]\nvalue = 43\n[log.column.lon_deg]\nvalue = -7\n\
        [log.column.alt_amsl_m]\nvalue = 340\n";
    let (csv, _) = import(&[("pico.txt", log.as_bytes())], map).unwrap();
    assert!(
        csv.starts_with("time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,c2h6_ppb\n1719409540.236,pico,43,-7,340,6.51798,13.3024\n"),
        "{csv}"
    );
}

/// Made by openpyxl: a sheet of one line, then one of three rows with dates.
const SHEETS: &[u8] = include_bytes!("data/log.xlsx");

/// Made by odfpy (tests/oracle/spreadsheet.py): the same with date and time of day in columns of their own.
#[cfg(feature = "spreadsheets")]
const OPEN_DOCUMENT: &[u8] = include_bytes!("data/log.ods");

#[test]
#[cfg(not(feature = "spreadsheets"))]
fn a_spreadsheet_is_refused_with_the_feature_that_reads_it() {
    let why = import(&[("log.xlsx", SHEETS)], "").unwrap_err().to_string();
    assert!(
        why.contains("--features spreadsheets") && why.contains("as CSV"),
        "{why}"
    );
}

#[test]
#[cfg(feature = "spreadsheets")]
fn a_spreadsheet_is_read_as_its_text() {
    let in_utc = "[[log]]\nzone = \"UTC\"\n";
    for (name, sheets, map) in [("log.xlsx", SHEETS, ""), ("log.ods", OPEN_DOCUMENT, in_utc)] {
        let (csv, _) = import(&[(name, sheets)], map).unwrap();
        assert_eq!(
            csv,
            "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm\n1714557600,log,43.5,-7.5,340,1.95\n\
             1714557601,log,43.5,-7.5,340,1.96\n1714557602,log,43.5,-7.5,340,1.97\n",
            "{name}"
        );
    }
}
