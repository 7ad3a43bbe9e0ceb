//! `plumage import` as its users meet it: outputs, exit codes, and what it says.

use crate::program::{SCENARIO, folder, plumage, refused, text};

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
    }
}
