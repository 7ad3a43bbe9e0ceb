//! Logs as instruments and programs write them: their headers as in manuals and public logs, rows by hand.

use crate::common::import;

/// A place for instruments that have none.
const PLACE: &str = "[log.column.lat_deg]\nvalue = 43.5\n[log.column.lon_deg]\nvalue = -7.5\n\
    [log.column.alt_amsl_m]\nvalue = 340\n";

/// What a log gives with `map`, and that its preset is `preset`.
fn read(log: &str, map: &str, preset: &str) -> String {
    let (csv, report) = import(&[("a.csv", log.as_bytes())], &format!("[[log]]\n{map}")).unwrap();
    let notices = report.notices.join("\n");
    assert!(notices.contains(&format!("(preset {preset})")), "{notices}");
    let again = import(&[("a.csv", log.as_bytes())], &report.map.to_toml(&[])).unwrap();
    assert_eq!(csv, again.0);
    csv
}

fn row(csv: &str, row: usize) -> &str {
    csv.lines().nth(row).unwrap()
}

#[test]
fn airdata_with_a_gas_column() {
    let log = "time(millisecond),datetime(utc),latitude,longitude,height_above_takeoff(feet),\
        height_above_ground_at_drone_location(feet),ground_elevation_at_drone_location(feet),\
        altitude_above_seaLevel(feet),height_sonar(feet),speed(mph),satellites,battery_temperature(f),altitude(feet),CO2 (ppm)\n\
        0,2024-05-01 10:00:00,43.44,-7.86,100,98,1015,1115.5,0,3.1,17,85.1,100,421\n\
        200,2024-05-01 10:00:00,43.44,-7.86,100,98,1015,1115.5,0,3.1,17,85.1,100,422\n\
        400,2024-05-01 10:00:01,43.44,-7.86,100,98,1015,1115.5,0,3.1,17,85.1,100,423\n";
    let csv = read(log, "", "airdata");
    // 1115.5 ft
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm"
    );
    assert_eq!(row(&csv, 1), "1714557600,a,43.44,-7.86,340.0044,421");
    assert_eq!(row(&csv, 3), "1714557601,a,43.44,-7.86,340.0044,423");
}

#[test]
fn a_dji_record_with_american_dates() {
    let log = "CUSTOM.date [local],CUSTOM.updateTime [local],OSD.flyTime [s],OSD.latitude,OSD.longitude,OSD.height [ft],OSD.altitude [ft],SO2 [ppb]\n\
        5/13/2024,1:02:03.4 PM,1.5,43.44,-7.86,100,1115.5,12\n";
    let csv = read(log, "zone = \"+02:00\"\n", "dji");
    // date -u -d '2024-05-13T13:02:03+02:00' +%s = 1715598123
    assert_eq!(row(&csv, 1), "1715598123.4,a,43.44,-7.86,340.0044,12");
}

/// The same record converted on a computer in German: points in dates, commas in numbers, other columns.
#[test]
fn a_dji_record_in_another_language() {
    let log = "sep=;\nCUSTOM.date [local];CUSTOM.updateTime [local];OSD.flyTime;OSD.latitude;OSD.longitude;OSD.height [m];OSD.altitude [m];OSD.vpsHeight [m];APP.tip;CO2 [ppm]\n\
        05.06.2024;13:02:03,40;0m 1,5s;43,4417123;-7,8631123;30,1;340,25;;Home point;421,5\n\
        05.06.2024;13:02:03,50;0m 1,6s;43,4417223;-7,8631223;30,2;340,35;;;422,5\n";
    let csv = read(log, "zone = \"+02:00\"\n", "dji");
    // date -u -d '2024-06-05T13:02:03+02:00' +%s = 1717585323
    assert_eq!(
        row(&csv, 1),
        "1717585323.4,a,43.4417123,-7.8631123,340.25,421.5"
    );
    let slashes = log.replace("05.06.2024", "5/6/2024");
    let unknown = import(
        &[("a.csv", slashes.as_bytes())],
        "[[log]]\nzone = \"UTC\"\n",
    );
    let error = unknown.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("--date-order dmy or mdy"), "{error}");
}

/// Rows of a log as DatCon writes it (datfile.net, *V3 .CSV column format*): 5 a second here, 30 to 200 there. The first
/// second is before the GPS has a fix.
fn datcon(header: &str, first: &str) -> String {
    let mut log = format!("{header},CO2 (ppm),Attribute|Value\n");
    for k in 0..15 {
        let gps = match k {
            0..5 => first.replace("TIME", "").replace("LAT", "0.0"),
            _ => first
                .replace("TIME", &format!("2024-05-01T10:00:0{}Z", (k - 5) / 5))
                .replace("LAT", &format!("43.4400{k:02}")),
        };
        log += &format!(
            "{},{:.1},{gps},{},\n",
            1000 * k,
            12.0 + 0.2 * f64::from(k),
            420 + k
        );
    }
    log
}

/// The clock of the GPS is empty until its first fix; its whole seconds hold several rows.
#[test]
fn a_dji_log_of_datcon() {
    let log = datcon(
        "Clock:Tick#,Clock:offsetTime,IMU_ATTI(0):Longitude,IMU_ATTI(0):Latitude,IMU_ATTI(0):temperature,\
         IMU_ATTI(0):roll,GPS:Long,GPS:Lat,GPS:Date,GPS:Time,GPS:dateTimeStamp,GPS:heightMSL,General:relativeHeight",
        "-7.86,LAT,65.0,1.5,-7.86,LAT,20240501,100000,TIME,391.5,51.2",
    );
    let csv = read(&log, "", "datcon");
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm"
    );
    // date -u -d 2024-05-01T10:00:00Z +%s = 1714557600
    assert_eq!(row(&csv, 1), "1714557600,a,43.440005,-7.86,391.5,425");
    assert_eq!(row(&csv, 2), "1714557600.2,a,43.440006,-7.86,391.5,426");
    assert_eq!(row(&csv, 10), "1714557601.8,a,43.440014,-7.86,391.5,434");
    assert_eq!(csv.lines().count(), 11);
}

/// As version 3 with units, and without the time stamp, as CsvView writes it: date and time are numbers, and 09:31:07 is
/// 93107. Without the height above the sea the one above take-off needs that of take-off.
#[test]
fn a_dji_log_of_csvview() {
    let header = "Tick#,offsetTime,GPS(0):Long[degrees],GPS(0):Lat[degrees],GPS(0):Date,GPS(0):Time,General:relativeHeight";
    let log = format!("{header},CO2 (ppm)\n100,1.5,-7.86,43.44,20240501,93107,51.25,421\n");
    let csv = read(&log, "base_amsl_m = 340\n", "datcon");
    // date -u -d 2024-05-01T09:31:07Z +%s = 1714555867
    assert_eq!(row(&csv, 1), "1714555867,a,43.44,-7.86,391.25,421");
    let without = import(&[("a.csv", log.as_bytes())], "");
    let error = without.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("--base-amsl-m"), "{error}");
}

/// A DJI log without gas is the track of a gas log; its clock counts from power-up until the GPS has a time.
#[test]
fn a_dji_log_is_the_track_of_a_gas_log() {
    let log = datcon(
        "Clock:Tick#,Clock:offsetTime,IMU_ATTI(0):roll,IMU_ATTI(0):pitch,GPS(0):Long,GPS(0):Lat,GPS(0):dateTimeStamp,GPS(0):heightMSL",
        "1.5,2.5,-7.86,LAT,TIME,391.5",
    );
    let track: String = log
        .lines()
        .map(|l| {
            let cells: Vec<&str> = l.split(',').collect();
            cells[..cells.len() - 2].join(",") + "\n"
        })
        .collect();
    let gas = "time,CH4 (ppm)\n2024-05-01T10:00:00.5Z,2.1\n2024-05-01T10:00:01.5Z,2.3\n";
    let logs = [
        ("gas.csv", gas.as_bytes()),
        ("FLY124.csv", track.as_bytes()),
    ];
    let (csv, _) = import(&logs, "").unwrap();
    assert_eq!(row(&csv, 1), "1714557600.5,gas,43.4400075,-7.86,391.5,2.1");
    let unset: String = track.lines().take(6).map(|l| format!("{l}\n")).collect();
    let error = import(
        &[
            ("gas.csv", gas.as_bytes()),
            ("FLY124.csv", unset.as_bytes()),
        ],
        "",
    )
    .unwrap_err();
    assert!(
        error
            .to_string()
            .contains("the time is empty in all 5 rows"),
        "{error}"
    );
}

/// A flight record whose times are in UTC, and one of an older converter, with a full stamp in one column.
#[test]
fn dji_records_with_other_clocks() {
    let utc = "CUSTOM.date [UTC],CUSTOM.updateTime [UTC],OSD.flyTime [s],OSD.latitude,OSD.longitude,OSD.altitude [m],CO2 [ppm]\n\
        2024-05-01,10:00:00.1,1.5,43.44,-7.86,340,421\n";
    assert_eq!(
        row(&read(utc, "", "dji"), 1),
        "1714557600.1,a,43.44,-7.86,340,421"
    );
    let stamp = "CUSTOM.updateTime,OSD.flyTime [s],OSD.latitude,OSD.longitude,OSD.altitude [m],CO2 [ppm]\n\
        2024/05/01 12:00:00.100,1.5,43.44,-7.86,340,421\n";
    let csv = read(stamp, "zone = \"+02:00\"\n", "dji");
    assert_eq!(row(&csv, 1), "1714557600.1,a,43.44,-7.86,340,421");
}

#[test]
fn sniffer4d_in_its_makers_language() {
    let log = "#Created by: Sniffer4DMapper 2.2.06.29\n项目名称 :x\n采样点时间,相对高度 m,经度,纬度,温度 ℃,湿度 %,气压 Pa,SO2 μg/m3,CO mg/m3\n\
        2024-05-01 10:00:00,60,-7.86,43.44,12.5,55,97500,26.6,1.25\n";
    let csv = read(log, "base_amsl_m = 340\nzone = \"UTC\"\n", "sniffer4d");
    // EU directive 2008/50/EC at 293 K and 101.3 kPa: 1 ppb of SO2 is 2.66 ug/m3, 1 ppm of CO is 1.16 mg/m3 (28.01 g/mol).
    assert!(
        row(&csv, 0).ends_with("so2_ppb,co_ppm,temperature_c,relative_humidity_pct,pressure_hpa"),
        "{csv}"
    );
    let cells: Vec<&str> = row(&csv, 1).split(',').collect();
    assert_eq!(cells[..5], ["1714557600", "a", "43.44", "-7.86", "400"]);
    let number = |k: usize| cells[k].parse::<f64>().unwrap();
    assert!(
        (number(5) - 10.0).abs() < 0.03 && (number(6) - 1.073).abs() < 0.005,
        "{csv}"
    );
    assert_eq!(cells[7..], ["12.5", "55", "975"]);
}

#[test]
fn a_picarro_log_parted_by_blanks() {
    let log = "DATE                      TIME                      FRAC_DAYS_SINCE_JAN1      EPOCH_TIME                ALARM_STATUS              INST_STATUS               CavityPressure            CavityTemp                CH4                       CH4_dry                   CO2_dry                   H2O                       GPS_ABS_LAT               GPS_ABS_LONG\n\
        2024-05-01                10:00:00.250              121.41                    1714557600.250            0                         963                       140.0                     45.0                      1.9400000000E+00          1.9500000000E+00          4.2100000000E+02          1.2                       43.44                     -7.86\n";
    let csv = read(log, "[log.column.alt_amsl_m]\nvalue = 340\n", "picarro");
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,ch4_ppm"
    );
    assert_eq!(row(&csv, 1), "1714557600.25,a,43.44,-7.86,340,421,1.95");
}

#[test]
fn a_licor_7810_with_its_rows_of_units() {
    let log = "Model:\tLI-7810\nSN:\tTG10-01000\nSoftware Version:\t2.0.0\nTimestamp:\t2024-05-01 12:00:00\nTimezone:\tEurope/Madrid\n\
        DATAH\tSECONDS\tNANOSECONDS\tNDX\tDIAG\tREMARK\tDATE\tTIME\tH2O\tCO2\tCH4\tCAVITY_P\tCAVITY_T\n\
        DATAU\tsecs\tnsecs\tindex\tNA\tNA\tdate\ttime\tppm\tppm\tppb\tkPa\tdegC\n\
        DATA\t1714557600\t500000000\t1\t0\t\t2024-05-01\t12:00:00\t9000\t421.5\t1950.25\t39.9\t55\n";
    let csv = read(log, PLACE, "licor-7810");
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,ch4_ppb"
    );
    assert_eq!(row(&csv, 1), "1714557600.5,a,43.5,-7.5,340,421.5,1950.25");
}

#[test]
fn a_licor_850() {
    let log = "System_Date_(Y-M-D)\tSystem_Time_(h:m:s)\tCO2_(µmol⁄mol)\tH2O_(mmol⁄mol)\tH2O_(°C)\tCell_Temperature_(°C)\tCell_Pressure_(kPa)\tCO2_Absorption\n\
        2024-05-01\t10:00:00\t421.5\t9.1\t5.5\t51.2\t97.5\t0.1\n";
    let csv = read(log, &format!("zone = \"UTC\"\n{PLACE}"), "licor-850");
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm"
    );
    assert_eq!(row(&csv, 1), "1714557600,a,43.5,-7.5,340,421.5");
}

#[test]
fn an_aeris_log_with_its_own_place() {
    let log = "Time Stamp,Inlet Number,P (mbars),T (degC),CH4 (ppm),H2O (ppm),C2H6 (ppb),R,C2/C1,Battery Charge (V),Power Input (mV),Current (mA),SOC (%),Latitude,Longitude\n\
        05/01/2024 10:00:00.250,1,200,35,1.95,9000,1.5,0.99,0.001,16,0,0,99,43.44,-7.86\n";
    let csv = read(log, "[log.column.alt_amsl_m]\nvalue = 340\n", "aeris");
    assert_eq!(row(&csv, 1), "1714557600.25,a,43.44,-7.86,340,1.95,1.5");
}

#[test]
fn a_buoys_wind_joined_with_a_gas_log() {
    let buoy = "#YY  MM DD hh mm WDIR WSPD GST  WVHT   DPD   APD MWD   PRES  ATMP  WTMP  DEWP  VIS PTDY  TIDE\n\
        #yr  mo dy hr mn degT m/s  m/s     m   sec   sec degT   hPa  degC  degC  degC  nmi  hPa    ft\n\
        2024 05 01 10 00 270  5.0  6.0    MM    MM    MM  MM 1013.0  12.0  14.0    MM   MM   MM    MM\n\
        2024 05 01 10 10 290  7.0  8.0    MM    MM    MM  MM 1013.0  12.0  14.0    MM   MM   MM    MM\n\
        2024 05 01 10 20 999 99.0  8.0    MM    MM    MM  MM 1013.0  12.0  14.0    MM   MM   MM    MM\n";
    let gas = "time,lat,lon,alt_amsl_m,ch4_ppb\n2024-05-01T10:05:00Z,43,-7,5,1950\n2024-05-01T10:20:00Z,43,-7,5,1951\n";
    let (csv, report) = import(
        &[("gas.csv", gas.as_bytes()), ("buoy.txt", buoy.as_bytes())],
        "",
    )
    .unwrap();
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppb,wind_speed_m_s,wind_from_deg,temperature_c,pressure_hpa"
    );
    assert_eq!(row(&csv, 1), "1714557900,gas,43,-7,5,1950,6,280,12,1013");
    assert_eq!(row(&csv, 2), "1714558800,gas,43,-7,5,1951,,,12,1013");
    assert!(report.notices.join("\n").contains("(preset ndbc)"));
}

#[test]
fn a_campbell_table_with_its_three_rows_of_header() {
    let log = "\"TOA5\",\"mast\",\"CR1000X\",\"1234\",\"CR1000X.Std.05\",\"CPU:m.CR1X\",\"123\",\"Table1\"\n\
        \"TIMESTAMP\",\"RECORD\",\"CO2_Avg\",\"WS_ms_Avg\",\"WindDir\",\"AirTC_Avg\",\"RH\",\"BP_mbar_Avg\"\n\
        \"TS\",\"RN\",\"ppm\",\"meters/second\",\"Deg\",\"Deg C\",\"%\",\"mbar\"\n\
        \"\",\"\",\"Avg\",\"Avg\",\"Smp\",\"Avg\",\"Smp\",\"Avg\"\n\
        \"2024-05-01 10:00:00\",1,421.5,5.5,270,12.5,55,975.5\n\"2024-05-01 10:05:00\",2,\"NAN\",5.5,270,12.5,55,975.5\n";
    let csv = read(log, &format!("zone = \"UTC\"\n{PLACE}"), "toa5");
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,wind_speed_m_s,wind_from_deg,temperature_c,\
         relative_humidity_pct,pressure_hpa"
    );
    assert_eq!(
        row(&csv, 1),
        "1714557600,a,43.5,-7.5,340,421.5,5.5,270,12.5,55,975.5"
    );
    assert_eq!(
        row(&csv, 2),
        "1714557900,a,43.5,-7.5,340,,5.5,270,12.5,55,975.5"
    );
}

#[test]
fn a_forced_preset_and_one_that_there_is_not() {
    let log = "Time Stamp,CH4 (ppm),Latitude,Longitude,alt_amsl_m\n05/01/2024 10:00:00,1.95,43.44,-7.86,340\n";
    let csv = read(log, "preset = \"aeris\"\n", "aeris");
    assert_eq!(row(&csv, 1), "1714557600,a,43.44,-7.86,340,1.95");
    let error = import(&[("a.csv", log.as_bytes())], "[[log]]\npreset = \"x\"\n")
        .unwrap_err()
        .to_string();
    assert!(error.contains("expected one of airdata"), "{error}");
}

#[test]
fn trajectories_of_several_platforms_are_not_taken_for_one() {
    use formats::netcdf::{Values, Variable, file};
    let variable = |name: &str, over, attributes, values| Variable {
        name: name.to_owned(),
        over: vec![over],
        attributes,
        values,
    };
    let rows = |counts: [i32; 2]| {
        let time = vec![("units", "seconds since 2024-05-01 10:00:00".into())];
        let named = |name: &'static str| vec![("standard_name", name.into())];
        let numbers = |first: f64| Values::Double((0..4).map(|k| first + f64::from(k)).collect());
        let height = vec![("standard_name", "altitude".into()), ("units", "m".into())];
        let gas = "mole_fraction_of_methane_in_air";
        let gas = vec![("standard_name", gas.into()), ("units", "1e-6".into())];
        let sizes = vec![("sample_dimension", "obs".into())];
        let variables = [
            variable("row_size", 0, sizes, Values::Int(counts.to_vec())),
            variable("time", 1, time, numbers(0.0)),
            variable("lat", 1, named("latitude"), numbers(43.0)),
            variable("lon", 1, named("longitude"), numbers(-7.0)),
            variable("alt", 1, height, numbers(700.0)),
            variable("ch4", 1, gas, numbers(2.0)),
        ];
        file(&[("trajectory", 2), ("obs", 4)], &[], &variables)
    };
    let (csv, _) = import(&[("t.nc", &rows([4, 0]))], "").unwrap();
    assert_eq!(row(&csv, 4), "1714557603,t,46,-4,703,5");
    let refused = import(&[("t.nc", &rows([2, 2]))], "")
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("2 platforms"), "{refused}");
}

// tests/oracle/netcdf_trajectory.py
#[test]
fn netcdf_by_the_cf_conventions() {
    let files: [&[u8]; 2] = [
        include_bytes!("data/trajectory.nc"),
        include_bytes!("data/trajectory-5.nc"),
    ];
    for bytes in files {
        let (csv, report) = import(&[("t.nc", bytes)], "").unwrap();
        assert_eq!(
            row(&csv, 0),
            "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,temperature_c,pressure_hpa"
        );
        // The value of minute 1.5 is filled: no row without a reading.
        assert_eq!(csv.lines().count(), 20);
        assert_eq!(row(&csv, 1), "1714557600,t,43.44,-7.86,700,1.9,10,930.25");
        assert_eq!(
            row(&csv, 4),
            "1714557720,t,43.4404,-7.86,704,1.904,10.4,930.25"
        );
        let notices = report.notices.join("\n");
        assert!(
            notices.contains("20 times in minutes since 2024-05-01"),
            "{notices}"
        );
    }
}

// tests/oracle/ros2_recording.py
#[test]
fn a_recording_of_ros_2() {
    let log = include_bytes!("data/ros2-recording");
    let error = import(&[("r.mcap", log)], "").unwrap_err().to_string();
    assert!(
        error.contains("above the WGS84 ellipsoid") && error.contains("--undulation-m"),
        "{error}"
    );
    let (csv, report) = import(&[("r.mcap", log)], "[[log]]\nundulation_m = 54.5\n").unwrap();
    assert_eq!(
        row(&csv, 0),
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,pressure_hpa"
    );
    // Readings are half a second behind fixes.
    assert_eq!(
        row(&csv, 1),
        "1714557600.5,r,43.44005,-7.86,700.5,421,930.25"
    );
    assert_eq!(csv.lines().count(), 11);
    assert!(
        report
            .notices
            .join("\n")
            .contains("a recording of ROS 2, 30 messages")
    );
}

#[test]
fn damaged_files_make_nothing_panic() {
    let files: [&[u8]; 3] = [
        include_bytes!("data/trajectory.nc"),
        include_bytes!("data/trajectory-5.nc"),
        include_bytes!("data/ros2-recording"),
    ];
    for whole in files {
        for k in 0..400 {
            let mut bytes = whole.to_vec();
            let at = k * 7 % bytes.len();
            bytes[at] ^= 0xA5;
            bytes.truncate(whole.len() - k % 300);
            let _ = import(&[("a", &bytes)], "");
        }
    }
}

#[test]
fn a_hobo_logger_with_its_zone_in_the_header() {
    let log = "\"Plot Title: mast\"\n\"#\",\"Date Time, GMT+01:00\",\"Wind Speed, m/s (LGR S/N: 1)\",\"CO2, ppm (LGR S/N: 1)\"\n\
        1,05/13/24 02:00:00 PM,3.2,421\n";
    let (csv, _) = import(&[("a.csv", log.as_bytes())], &format!("[[log]]\n{PLACE}")).unwrap();
    // date -u -d '2024-05-13T14:00:00+01:00' +%s = 1715605200
    assert_eq!(row(&csv, 1), "1715605200,a,43.5,-7.5,340,421,3.2");
}

#[test]
fn a_german_spreadsheet_that_says_its_delimiter() {
    let log = "sep=;\nDatum;Uhrzeit;Breitengrad;L\u{e4}ngengrad;H\u{f6}he \u{fc}ber NN [m];CO2 [ppm]\n01.05.2024;10:00:00;43,1;-7,1;340;421\n";
    let (csv, _) = import(&[("a.csv", log.as_bytes())], "").unwrap();
    assert_eq!(row(&csv, 1), "1714557600,a,43.1,-7.1,340,421");
}

#[test]
fn a_gas_in_volts_is_refused() {
    let log = "time_s,CO2 (mV),lat,lon,alt_amsl_m\n0,421,43,-7,340\n";
    let error = import(&[("a.csv", log.as_bytes())], "")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("\"CO2 (mV)\": the unit of co2 is unknown"),
        "{error}"
    );
}
