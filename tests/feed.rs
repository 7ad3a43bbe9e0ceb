//! Observations that are fed into a mission while it flies correct its model, are recorded, and are said
//! again by a replay; on a bus they come as from any real vehicle.

use crate::program::Ends;
use mission::Setup;
use net::{Net, NetOptions};
use protocol::key::Name;
use protocol::message::{Message, VehicleKind};
use protocol::{AgentId, Interest, Topic};
use serde_json::Value;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tasks::mission_key;

/// What the team believes, with one vehicle of its own, and what the readings are made of.
const BELIEVED: [f64; 3] = [110.0, 450.0, 330.0];
const TRUE: [f64; 3] = [118.0, 486.0, 410.0];
const STACK: (f64, f64) = (43.4417, -7.8631);
/// Metres a degree of latitude and longitude there, by the radii of curvature of the WGS84 ellipsoid.
const METRES_PER_DEGREE: (f64, f64) = (111_101.3, 80_954.5);

fn scenario(duration_s: f64) -> String {
    let [axis_deg, height_m, c_max_ppm] = BELIEVED;
    let from_deg = axis_deg + 180.0;
    format!(
        "[mission]\nname = \"fed\"\nduration_s = {duration_s:.1}\n[site]\nlat_deg = 43.4417\nlon_deg = -7.8631\n\
         ground_amsl_m = 340.0\n[weather]\nwind_speed_m_s = 7.0\nwind_height_agl_m = 486.0\nwind_from_deg = {from_deg:.1}\n\
         [[source]]\nlat_deg = 43.4417\nlon_deg = -7.8631\nstack_height_m = 356.0\neffective_height_m = {height_m:.1}\n\
         c_max_ppm = {c_max_ppm:.1}\nc_max_distance_m = 2400.0\n[background]\nco2_ppm = 449.0\n\
         [uncertain]\n\"weather.wind_from_deg\" = 12.0\n\"source.effective_height_m\" = 50.0\n\
         \"source.c_max_ppm\" = 120.0\n[[vehicle]]\nid = \"1\"\n"
    )
}

/// The mean plume of Briggs' rural class D (1973) at a place downwind, across and above ground, m.
fn ppm(x_m: f64, y_m: f64, z_m: f64) -> f64 {
    let sigma_y = |x: f64| 0.08 * x / (1.0 + 1e-4 * x).sqrt();
    let sigma_z = |x: f64| 0.06 * x / (1.0 + 1.5e-3 * x).sqrt();
    let [_, height_m, c_max_ppm] = TRUE;
    let axis = c_max_ppm * sigma_y(2400.0) * sigma_z(2400.0) / (sigma_y(x_m) * sigma_z(x_m));
    let off = (y_m / sigma_y(x_m)).powi(2) + ((z_m - height_m) / sigma_z(x_m)).powi(2);
    449.0 + axis * (-off / 2.0).exp()
}

/// Passes across the true plume at 18 m/s, a row a second, by a clock that began long ago.
fn observations() -> String {
    let mut csv = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm\n".to_owned();
    let (sin, cos) = TRUE[0].to_radians().sin_cos();
    let passes = [
        (1500.0, 486.0),
        (2400.0, 440.0),
        (1800.0, 520.0),
        (2000.0, 486.0),
    ];
    for (k, (x, z)) in passes.into_iter().enumerate() {
        for step in -40..=40 {
            let y = f64::from(step) * 18.0 * if k % 2 == 0 { 1.0 } else { -1.0 };
            let time_s = 1.7e6 + 100.0 * k as f64 + f64::from(step + 40);
            let (east, north) = (x * sin + y * cos, x * cos - y * sin);
            let lat = STACK.0 + north / METRES_PER_DEGREE.0;
            let lon = STACK.1 + east / METRES_PER_DEGREE.1;
            // White noise of 3 ppm, near enough: the sum of three uniform ones of a simple generator.
            let uniform = |n: f64| (n.sin() * 43_758.545_3).fract().abs() - 0.5;
            let noise = 6.0 * (1..=3).map(|n| uniform(time_s * f64::from(n))).sum::<f64>();
            let c = ppm(x, y, z) + noise;
            let place = format!("{lat:.7},{lon:.7},{:.1}", 340.0 + z);
            writeln!(csv, "{time_s:.1},drone,{place},{c:.2}").unwrap();
        }
    }
    csv
}

/// A folder with scenario and observations.
fn folder(name: &str, duration_s: f64) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("s.toml"), scenario(duration_s)).unwrap();
    std::fs::write(folder.join("obs.csv"), observations()).unwrap();
    folder
}

fn program(path: &str, arguments: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(path);
    command.args(arguments).current_dir(folder);
    command
}

fn plumage(arguments: &[&str], folder: &Path) -> Output {
    program(env!("CARGO_BIN_EXE_plumage"), arguments, folder)
        .output()
        .unwrap()
}

fn a_mission_is_corrected_by_what_is_fed_in_and_flies_again_the_same() {
    let folder = folder("fed_run", 700.0);
    let run = [
        "run",
        "s.toml",
        "--no-serve",
        "--feed",
        "obs.csv",
        "--out",
        "out",
    ];
    let flown = plumage(&run, &folder);
    assert!(flown.status.success(), "{flown:?}");
    let told = String::from_utf8_lossy(&flown.stderr).into_owned();
    assert!(
        told.contains("feeding 324 readings of drone: the first at 0 s, the last at 380 s"),
        "{told}"
    );
    let summary: Value =
        serde_json::from_slice(&std::fs::read(folder.join("out/summary.json")).unwrap()).unwrap();
    let after = &summary["model"]["after"];
    for (k, name) in ["axis_deg", "effective_height_agl_m", "c_max_ppm"]
        .iter()
        .enumerate()
    {
        let estimate = |what: &str| after[name][what].as_f64().unwrap();
        let (off, was_off) = (estimate("value") - TRUE[k], BELIEVED[k] - TRUE[k]);
        assert!(
            off.abs() < was_off.abs() / 10.0,
            "{name}: {off} of {was_off}"
        );
        assert!(
            off.abs() < 4.0 * estimate("sd").max(0.01),
            "{name}: {off}, {after}"
        );
    }
    let vehicle = |id: &str| {
        let all = summary["vehicles"].as_array().unwrap();
        all.iter().find(|v| v["id"] == id).unwrap().clone()
    };
    assert_eq!(
        (&vehicle("drone")["outcome"], &vehicle("drone")["kind"]),
        (&"fed".into(), &"real".into())
    );
    assert_eq!(vehicle("1")["outcome"], "landed");
    let again = plumage(&["replay", "out/mission.mcap", "--verify"], &folder);
    assert!(again.status.success(), "{again:?}");
}

fn what_cannot_be_fed_in_is_refused() {
    let folder = folder("fed_refused", 60.0);
    let refused = |arguments: &[&str], words: &str| {
        let output = plumage(
            &[&["run", "s.toml", "--no-serve", "--out", "out"], arguments].concat(),
            &folder,
        );
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains(words), "{told}");
        assert!(!folder.join("out").exists());
    };
    refused(
        &["--feed", "obs.csv", "--feed-id", "1"],
        "vehicle 1 belongs to the team (1)",
    );
    refused(&["--feed", "-"], "expected --speed real");
    refused(
        &["--feed", "none.csv"],
        "none.csv: cannot read the observations",
    );
    refused(
        &["--feed", "obs.csv", "--feed-start", "soon"],
        "expected 0 to 1000000 s since the mission's start",
    );
    std::fs::write(folder.join("obs.csv"), "time_s,platform\n0,drone\n").unwrap();
    refused(&["--feed", "obs.csv"], "column lat_deg: missing");
}

fn over_the_bus_a_file_and_a_stream_reach_the_model() {
    const S: f64 = 60.0;
    let folder = folder("fed_bus", S);
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let spawn = |path: &str, arguments: &[&str]| {
        let mut command = program(path, arguments, &folder);
        Ends(
            command
                .stdin(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .unwrap(),
        )
    };
    let bus = ["--scenario", "s.toml", "--connect", &endpoint];
    let _sc = spawn(
        env!("CARGO_BIN_EXE_sc"),
        &["--scenario", "s.toml", "--listen", &endpoint],
    );
    let _ws = spawn(env!("CARGO_BIN_EXE_ws"), &bus);
    let feed = |more: &[&str]| {
        spawn(
            env!("CARGO_BIN_EXE_plumage"),
            &[&["feed"], more, &bus].concat(),
        )
    };
    let _file = feed(&["obs.csv", "--speed", "max", "--id", "file"]);
    let mut stream = feed(&["-", "--id", "stream"]);
    let mut lines = stream.0.stdin.take().unwrap();
    let row = |k: i32| {
        format!(
            "{{\"time_s\": {k}, \"platform\": \"lab\", \"lat_deg\": 43.43, \"lon_deg\": -7.85, \
                 \"alt_amsl_m\": 800, \"co2_ppm\": {}}}\n",
            449 + k
        )
    };
    let setup = Setup::load("s.toml", &scenario(S), &|_| Err("no such file".to_owned())).unwrap();
    let heard = async {
        let options = NetOptions {
            connect: vec![endpoint.clone()],
            ..NetOptions::default()
        };
        let name = Name::new(&setup.scenario.mission.name).unwrap();
        let key = mission_key::find(&name, None, &[]).unwrap();
        let mut net = Net::open(name, key, &options).await.unwrap();
        net.subscribe(&[Interest::Everything]).await.unwrap();
        net.wait_for(&[AgentId::va("stream").unwrap()]).await;
        tokio::time::sleep(Duration::from_secs(1)).await;
        for k in 0..3 {
            lines.write_all(row(k).as_bytes()).unwrap();
            lines.flush().unwrap();
            tokio::time::sleep(Duration::from_millis(300)).await;
        }
        drop(lines);
        let (mut streamed, mut observations) = (0, 0);
        while streamed < 3 || observations < 300 {
            let (topic, envelope) = net.receive().await.unwrap().unwrap();
            match (topic, envelope.message) {
                (Topic::Reading(id), Message::Reading(r)) if id.as_str() == "stream" => {
                    assert_eq!(r.kind, VehicleKind::Real);
                    streamed += 1;
                }
                (_, Message::Model(model)) => observations = observations.max(model.observations),
                _ => {}
            }
        }
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        tokio::time::timeout(Duration::from_secs(40), heard)
            .await
            .unwrap()
    });
}

fn weather_that_changes_in_flight_is_flown_in_and_replayed() {
    let folder = folder("weather_run", 9.0);
    let with = |wind: &str| scenario(9.0).replace("[weather]", &format!("[weather]\n{wind}"));
    std::fs::write(folder.join("s.toml"), with("series = \"weather.txt\"")).unwrap();
    let metar = |wind: &str| {
        let now = Command::new("date")
            .args(["-u", "+%d%H%MZ"])
            .output()
            .unwrap();
        let now = String::from_utf8(now.stdout).unwrap();
        format!("METAR LEST {} {wind} 9999 18/09 Q1013\n", now.trim())
    };
    std::fs::write(folder.join("weather.txt"), metar("24010KT")).unwrap();
    let run = [
        "run",
        "s.toml",
        "--no-serve",
        "--speed",
        "real",
        "--out",
        "out",
    ];
    let mut flying = program(env!("CARGO_BIN_EXE_plumage"), &run, &folder);
    let flying = flying
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(3));
    // Half written, and then whole.
    std::fs::write(folder.join("weather.txt"), "METAR LEST").unwrap();
    std::thread::sleep(Duration::from_millis(100));
    std::fs::write(folder.join("weather.txt"), metar("06020KT")).unwrap();
    let flown = flying.wait_with_output().unwrap();
    assert!(flown.status.success(), "{flown:?}");
    let recording = record::read_mcap(&folder.join("out/mission.mcap")).unwrap();
    let said = recording
        .in_order()
        .unwrap()
        .filter_map(|said| match said.unwrap().1.message {
            Message::Weather(weather) => Some(weather.wind),
            _ => None,
        });
    let said: Vec<_> = said.collect();
    // Once at the start, once when the file had changed; 20 kt at 10 m from 60° are, by a power law of 0.15 and
    // at 486 m, 10.289 × 48.6^0.15 = 18.42 m/s towards 240°.
    assert_eq!(said.len(), 2, "{said:?}");
    let [north, east] = said[1].last().unwrap().wind_ne_m_s;
    assert!((north.hypot(east) - 18.42).abs() < 0.01, "{said:?}");
    assert!((north + 18.42 * 0.5).abs() < 0.01 && east < 0.0);
    let resolved = std::fs::read_to_string(folder.join("out/scenario.toml")).unwrap();
    assert!(resolved.contains("temperature_c = 18.0"), "{resolved}");
    let again = plumage(&["replay", "out/mission.mcap", "--verify"], &folder);
    assert!(again.status.success(), "{again:?}");
}

crate::runner::tests! {
    RealTime {
        over_the_bus_a_file_and_a_stream_reach_the_model,
        weather_that_changes_in_flight_is_flown_in_and_replayed,
    }
    Cores {
        a_mission_is_corrected_by_what_is_fed_in_and_flies_again_the_same,
        what_cannot_be_fed_in_is_refused,
    }
}
