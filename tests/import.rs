//! `plumage import` as its users meet it: outputs, exit codes, and what it says.

use crate::program::{SCENARIO, folder, plumage, refused, text};
use libtest_mimic::{Completion, Failed};
use std::path::{Path, PathBuf};
use std::process::Output;

/// A folder of measured data, or why the test is ignored.
fn data(name: &str) -> Result<PathBuf, Completion> {
    let Some(folder) = std::env::var_os("PLUMAGE_DATA") else {
        let reason = "needs PLUMAGE_DATA, the folder of measured data";
        return Err(Completion::ignored_with(reason));
    };
    let folder = Path::new(&folder).join(name);
    match folder.is_dir() {
        true => Ok(folder),
        false => Err(Completion::ignored_with(format!(
            "needs PLUMAGE_DATA/{name}"
        ))),
    }
}

/// The folder of data, or the end of an ignored test.
macro_rules! data_or_ignored {
    ($name:literal) => {
        match data($name) {
            Ok(folder) => folder,
            Err(ignored) => return Ok(ignored),
        }
    };
}

fn told(output: &Output) -> String {
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    told
}

/// The columns of a CSV by their names, as numbers.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let header = lines.next().unwrap();
    let at = header.split(',').position(|c| c == name);
    let at = at.unwrap_or_else(|| panic!("no {name} in {header}"));
    lines
        .map(|l| l.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN))
        .collect()
}

fn rows_that_run_back_are_sorted_into_the_output() {
    let dir = folder("import-run-back");
    let (log, out) = (dir.join("log.csv"), dir.join("obs.csv"));
    std::fs::write(
        &log,
        "time_s,lat,lon,alt_m_asl,co2_ppm\n0,43.44,-7.86,500,420\n2,43.44,-7.86,500,421\n1,43.44,-7.86,500,422\n",
    )
    .unwrap();
    let told = told(&plumage(&["import", text(&log), "--out", text(&out)]));
    assert!(
        told.contains("rows ran back in time and were sorted"),
        "{told}"
    );
    let csv = std::fs::read_to_string(&out).unwrap();
    assert_eq!(column(&csv, "co2_ppm"), [420.0, 422.0, 421.0]);
    let mut names: Vec<_> = std::fs::read_dir(&dir)
        .unwrap()
        .map(|f| f.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["log.csv", "obs.csv", "obs.csv.import.toml"]);
}

fn logs_whose_clock_is_set_back_are_imported() -> Result<Completion, Failed> {
    let cases = data_or_ignored!("cases/1-rows-run-back");
    let dir = folder("import-case-1");
    for (name, rows) in [("mini", 3), ("clock-set-back", 1500)] {
        let (log, out) = (
            cases.join(format!("{name}.csv")),
            dir.join(format!("{name}.csv")),
        );
        let told = told(&plumage(&["import", text(&log), "--out", text(&out)]));
        assert!(told.contains("were sorted"), "{told}");
        let times = column(&std::fs::read_to_string(&out).unwrap(), "time_s");
        assert!(
            times.len() == rows && times.is_sorted(),
            "{name}: {}",
            times.len()
        );
    }
    Ok(Completion::Completed)
}

/// Heights of the ground that are none in one file are none in the other, and no others are.
fn voids_of_a_grid_are_none_however_they_are_written() -> Result<Completion, Failed> {
    let cases = data_or_ignored!("cases/2-nodata-as-height");
    let site = air::geo::Geodetic::new(43.4417, -7.8631);
    let read = |name: &str| {
        let bytes = std::fs::read(cases.join(name)).unwrap();
        air::terrain::Terrain::read(name, &bytes, site, 340.0).unwrap()
    };
    let (stated, printed) = (read("nod_ok.asc"), read("nod_f32.asc"));
    let mut voids = 0;
    for k in 0..10_000 {
        let at = air::geo::Geodetic::new(
            43.30 + 0.0028 * f64::from(k % 100),
            -8.01 + 0.0028 * f64::from(k / 100),
        );
        let height = printed.known_amsl_m(at);
        assert_eq!(height, stated.known_amsl_m(at), "{at:?}");
        voids += usize::from(height.is_none());
    }
    assert!((10..5000).contains(&voids), "{voids}");
    Ok(Completion::Completed)
}

fn weather_in_utc_is_compared_with_rows_in_utc() -> Result<Completion, Failed> {
    let cases = data_or_ignored!("cases/3-weather-in-utc");
    let dir = folder("import-case-3");
    let obs = dir.join("obs.csv");
    told(&plumage(&[
        "import",
        text(&cases.join("log.csv")),
        "--out",
        text(&obs),
    ]));
    let (utc, out) = (cases.join("s_utc.toml"), dir.join("gap"));
    told(&plumage(&[
        "gap",
        "plume",
        text(&obs),
        "--scenario",
        text(&utc),
        "--out",
        text(&out),
    ]));
    let gap = std::fs::read_to_string(out.join("gap.json")).unwrap();
    let gap: serde_json::Value = serde_json::from_str(&gap).unwrap();
    assert_eq!(gap["verdict"], "none", "{}", gap["summary"]);
    // Counted from a zero that nothing states, the two cannot be compared.
    let log = text(&cases.join("log.csv")).to_owned();
    let zero = dir.join("zero.csv");
    told(&plumage(&[
        "import",
        &log,
        "--zero",
        "2024-05-01T10:00:00Z",
        "--out",
        text(&zero),
    ]));
    let output = plumage(&[
        "gap",
        "plume",
        text(&zero),
        "--scenario",
        text(&utc),
        "--out",
        text(&dir.join("none")),
    ]);
    refused(&output, 2, &["w_utc.csv", "expected start in [mission]"]);
    Ok(Completion::Completed)
}

fn two_receivers_are_refused_and_one_that_is_stated_is_read() -> Result<Completion, Failed> {
    let cases = data_or_ignored!("cases/5-two-receivers");
    let dir = folder("import-case-5");
    let (log, map, out) = (
        cases.join("two.mcap"),
        dir.join("m.toml"),
        dir.join("obs.csv"),
    );
    let import = |more: &[&str]| {
        let stated = [
            "import",
            text(&log),
            "--undulation-m",
            "54",
            "--out",
            text(&out),
        ];
        plumage(&[&stated[..], more].concat())
    };
    refused(&import(&[]), 2, &["/base/fix, /uav/fix", "--map"]);
    std::fs::write(
        &map,
        "[[log]]\n[log.column.lat_deg]\nfrom = \"/uav/fix.latitude\"\n",
    )
    .unwrap();
    told(&import(&["--map", text(&map)]));
    let csv = std::fs::read_to_string(&out).unwrap();
    // The first reading lies a fifth of a second behind the fix that the case states as right.
    assert!(
        (column(&csv, "lat_deg")[0] - 43.449_169).abs() < 2e-6,
        "{csv}"
    );
    assert!((column(&csv, "lon_deg")[0] + 7.851_055).abs() < 2e-6);
    assert!((column(&csv, "alt_amsl_m")[0] - 600.0).abs() < 0.5);
    Ok(Completion::Completed)
}

fn a_code_for_a_missing_obukhov_length_is_none() -> Result<Completion, Failed> {
    let cases = data_or_ignored!("cases/6-obukhov-9999");
    let dir = folder("import-case-6");
    let emission = |scenario: &str| {
        let out = dir.join(scenario);
        let scenario = cases.join(format!("{scenario}.toml"));
        let obs = cases.join("obs.csv");
        told(&plumage(&[
            "calibrate",
            text(&obs),
            "--scenario",
            text(&scenario),
            "--out",
            text(&out),
        ]));
        std::fs::read_to_string(out.join("calibration.json")).unwrap()
    };
    assert_eq!(emission("so_obm9999"), emission("so_obempty"));
    Ok(Completion::Completed)
}

/// The mapping file of a drone whose anemometer turns and moves with it.
const BODY_FRAME: &str = "[[log]]
time = \"Timestamp\"
[log.wind]
right = \"Um\"
forward = \"Vm\"
yaw = \"Yaw\"
vel_east = \"Vx\"
vel_north = \"Vy\"
[log.column.alt_amsl_m]
from = \"Alt\"
datum = \"amsl\"
[log.column.temperature_c]
from = \"T\"
[log.column.c2h6_ppb]
from = \"C2H6\"
unit = \"ppb\"
";

fn the_wind_of_a_flying_anemometer_is_steady() -> Result<Completion, Failed> {
    let folder_of_log = data_or_ignored!("field/nmt-uas");
    let dir = folder("import-nmt");
    let (map, out) = (dir.join("m.toml"), dir.join("obs.csv"));
    std::fs::write(&map, BODY_FRAME).unwrap();
    let log = folder_of_log.join("level0.csv");
    told(&plumage(&[
        "import",
        text(&log),
        "--map",
        text(&map),
        "--out",
        text(&out),
    ]));
    let csv = std::fs::read_to_string(&out).unwrap();
    let from_deg = column(&csv, "wind_from_deg");
    assert_eq!(from_deg.len(), 7303);
    // Circular standard deviation (Mardia and Jupp 2000, eq. 2.3.11). Their own program gives 15 degrees.
    let n = from_deg.len() as f64;
    let mean = |f: fn(f64) -> f64| from_deg.iter().map(|d| f(d.to_radians())).sum::<f64>() / n;
    let sd_deg = (-2.0 * mean(f64::cos).hypot(mean(f64::sin)).ln())
        .sqrt()
        .to_degrees();
    assert!(sd_deg <= 18.0, "{sd_deg}");
    let gases = ["ch4_ppm", "c2h6_ppb"]
        .map(|gas| column(&csv, gas).iter().filter(|v| v.is_finite()).count());
    assert!(gases.iter().all(|n| *n > 1000), "{gases:?}");
    let raw = folder_of_log.join("Pico100048_240626_134540.txt");
    let place = [
        "--set",
        "lat_deg=32.7",
        "--set",
        "lon_deg=-103.1",
        "--set",
        "alt_amsl_m=1155",
    ];
    let aeris = dir.join("aeris.csv");
    told(&plumage(
        &[&["import", text(&raw), "--out", text(&aeris)][..], &place].concat(),
    ));
    let csv = std::fs::read_to_string(&aeris).unwrap();
    assert!(
        csv.starts_with("time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,c2h6_ppb\n"),
        "{csv}"
    );
    assert!(column(&csv, "c2h6_ppb").iter().all(|v| v.is_finite()));
    Ok(Completion::Completed)
}

fn a_log_is_imported_and_its_mapping_does_it_again() {
    let dir = folder("import");
    let (log, out, again) = (
        dir.join("log.csv"),
        dir.join("obs.csv"),
        dir.join("again.csv"),
    );
    let rows = "Date;Time;Latitude;Longitude;Altitude;CO2\n;;deg;deg;ft;ppm\n\
        01.05.2024;10:00:00;43,4417;-7,8631;1000;421,5\n01.05.2024;10:00:01;43,4418;-7,8631;1000;422\n";
    std::fs::write(&log, rows).unwrap();
    let imported = plumage(&["import", text(&log), "--out", text(&out)]);
    let told = String::from_utf8_lossy(&imported.stderr);
    assert!(imported.status.success(), "{told}");
    assert!(
        told.contains("assumed: \"Altitude\" states no datum and is read as above mean sea level"),
        "{told}"
    );
    let first = std::fs::read_to_string(&out).unwrap();
    // 1000 ft are 304.8 m.
    assert!(
        first.ends_with("1714557601,log,43.4418,-7.8631,304.8,422\n"),
        "{first}"
    );
    let mapping = dir.join("obs.csv.import.toml");
    let by_map = plumage(&[
        "import",
        text(&log),
        "--map",
        text(&mapping),
        "--out",
        text(&again),
    ]);
    assert!(by_map.status.success());
    assert_eq!(std::fs::read_to_string(&again).unwrap(), first);
    refused(
        &plumage(&["import", text(&log), "--out", text(&out)]),
        2,
        &["obs.csv", "--force"],
    );
    // Directly: the log is read, and then refused for what it says, which is too little.
    let direct = plumage(&[
        "calibrate",
        text(&log),
        "--map",
        text(&mapping),
        "--scenario",
        SCENARIO,
        "--out",
        text(&dir.join("c")),
    ]);
    assert!(
        direct.status.success(),
        "{}",
        String::from_utf8_lossy(&direct.stderr)
    );
    std::fs::write(&log, "a;b\n1;2\n").unwrap();
    let wrong = plumage(&["import", text(&log), "--out", text(&dir.join("no.csv"))]);
    refused(&wrong, 2, &["log.csv: no header found", "--map"]);
    assert!(!dir.join("no.csv").exists() && !dir.join("no.csv.import.toml").exists());
}

crate::runner::tests! {
    Cores {
        a_log_is_imported_and_its_mapping_does_it_again,
        rows_that_run_back_are_sorted_into_the_output,
        logs_whose_clock_is_set_back_are_imported,
        voids_of_a_grid_are_none_however_they_are_written,
        weather_in_utc_is_compared_with_rows_in_utc,
        two_receivers_are_refused_and_one_that_is_stated_is_read,
        a_code_for_a_missing_obukhov_length_is_none,
        the_wind_of_a_flying_anemometer_is_steady,
    }
}
