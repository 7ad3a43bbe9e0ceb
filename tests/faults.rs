//! What breaks in a mission of processes, broken on purpose: agents that die or stop, disks that fill up, processes
//! that are cut off or started again. What needs a network or a file system of its own is ignored, with the reason,
//! where those may not be made.

use crate::team::{Team, folder, outputs_are_whole};
use libtest_mimic::{Completion, Failed};
use protocol::Topic;
use protocol::message::{ControlLevel, Message};
use std::io::Read as _;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SCENARIO: &str = "../scenarios/as-pontes-steady.toml";
/// By then all others have ended once somebody of a lockstep mission has gone.
const ENDS_WITHIN: Duration = Duration::from_secs(10);
/// Exit code of a mission in lockstep in which somebody was missing, by the README.
const SOMEBODY_MISSING: i32 = 3;

/// A port of this host that nobody has.
fn free_port() -> u16 {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    free.local_addr().unwrap().port()
}

/// A mission on this host.
fn here(name: &str, common: &[&str]) -> Team {
    Team::meeting_at(name, format!("tcp/127.0.0.1:{}", free_port()), common)
}

/// Starts its agents, with vehicles 1 and 2 in processes of their own.
fn start_agents(team: &mut Team) {
    team.start("sc/main", env!("CARGO_BIN_EXE_sc"), &[]);
    team.start("ws/main", env!("CARGO_BIN_EXE_ws"), &[]);
    let vehicle = env!("CARGO_BIN_EXE_va");
    team.start("va/1", vehicle, &["--vehicles", "1"]);
    team.start("va/2", vehicle, &["--vehicles", "2"]);
    team.start("va/3", vehicle, &["--vehicles", "3,4,5,6"]);
}

/// Starts its recorder: the folder of the outputs.
fn start_recorder(team: &mut Team) -> PathBuf {
    let out = team.folder.join("out");
    let recorder = env!("CARGO_BIN_EXE_recorder");
    team.start("clock/recorder", recorder, &["--out", text(&out)]);
    out
}

/// A mission in lockstep in which something happens to `victim` (by `signal`) while it flies: all others end in time,
/// with words that name it, and the outputs hold what was flown.
fn lockstep_ends(name: &str, victim: &'static str, signal: &str) -> Result<(), Failed> {
    let mut team = here(
        name,
        &["--scenario", SCENARIO, "--duration", "2000", "--lockstep"],
    );
    start_agents(&mut team);
    let out = start_recorder(&mut team);
    let conducted = team.folder.join("conducted");
    team.start(
        "clock/main",
        env!("CARGO_BIN_EXE_plumage"),
        &[
            "conduct",
            "--with-recorder",
            "--out",
            conducted.to_str().unwrap(),
        ],
    );
    let flies = |team: &Team| {
        let conductor = team
            .processes
            .iter()
            .find(|p| p.name == "clock/main")
            .unwrap();
        conductor
            .figure("plumage_messages_heard_total")
            .unwrap_or(0.0)
            > 2000.0
    };
    team.wait("the mission flies", Duration::from_secs(30), flies)?;
    team.of(victim).signal(signal);
    let until = Instant::now() + ENDS_WITHIN;
    let names = match victim {
        "clock/main" => "the conductor",
        // One process, four vehicles: those are named that have not finished the tick, the last among them.
        "va/3" => "va/",
        victim => victim,
    };
    for process in team.processes.iter_mut().filter(|p| p.name != victim) {
        let status = process.ends_before(until)?;
        let said = process.said();
        if status.code() != Some(SOMEBODY_MISSING)
            || !said.contains(&format!("stopped responding: {names}"))
        {
            return Err(format!("{} ended with {status}, and said: {said}", process.name).into());
        }
    }
    let folders: &[&Path] = match victim {
        "clock/main" => &[&out],
        "clock/recorder" => &[&conducted],
        _ => &[&out, &conducted],
    };
    for folder in folders {
        outputs_are_whole(folder)?;
    }
    // Both hold the same, tick by tick, up to the last one that all finished.
    if let [out, conducted] = folders {
        let digest = |folder: &Path| {
            let text = std::fs::read_to_string(folder.join("summary.json")).unwrap();
            let at = text.find("\"digest\"").unwrap();
            text[at..at + 80].to_owned()
        };
        assert_eq!(digest(out), digest(conducted));
    }
    Ok(())
}

/// A mission in lockstep whose conductor dies before the team is complete: nobody waits for ever.
fn lockstep_ends_when_the_conductor_dies_before_the_team_is_complete() -> Result<(), Failed> {
    let mut team = here(
        "incomplete",
        &["--scenario", SCENARIO, "--duration", "60", "--lockstep"],
    );
    team.start("sc/main", env!("CARGO_BIN_EXE_sc"), &[]);
    team.start("ws/main", env!("CARGO_BIN_EXE_ws"), &[]);
    team.start("va/1", env!("CARGO_BIN_EXE_va"), &["--vehicles", "1"]);
    start_recorder(&mut team);
    team.start("clock/main", env!("CARGO_BIN_EXE_plumage"), &["conduct"]);
    team.wait("all meet", Duration::from_secs(40), Team::all_meet)?;
    team.of("clock/main").signal("-KILL");
    let until = Instant::now() + ENDS_WITHIN;
    for process in team.processes.iter_mut().filter(|p| p.name != "clock/main") {
        let status = process.ends_before(until)?;
        let said = process.said();
        if status.code() != Some(SOMEBODY_MISSING)
            || !said.contains("stopped responding: the conductor")
        {
            return Err(format!("{} ended with {status}, and said: {said}", process.name).into());
        }
    }
    Ok(())
}

/// The others of a mission in real time are told to terminate: its squadron controller ends as well.
fn a_squadron_controller_ends_with_all_others() -> Result<(), Failed> {
    let mut team = here("others", &["--scenario", SCENARIO, "--duration", "600"]);
    start_agents(&mut team);
    team.wait("all meet", Duration::from_secs(40), Team::all_meet)?;
    for process in team.processes.iter().filter(|p| p.name != "sc/main") {
        process.signal("-TERM");
    }
    let until = Instant::now() + ENDS_WITHIN;
    for process in &mut team.processes {
        let status = process.ends_before(until)?;
        assert!(
            status.success(),
            "{}: {status}: {}",
            process.name,
            process.said()
        );
    }
    let said = team.of("sc/main").said();
    assert!(
        said.contains("all other members of the team have ended"),
        "{said}"
    );
    Ok(())
}

/// The recorder of a mission in real time that is asked to terminate, as systemd and docker do.
fn a_recorder_that_is_told_to_terminate_leaves_all_outputs() -> Result<(), Failed> {
    let mut team = here("terminate", &["--scenario", SCENARIO, "--duration", "600"]);
    start_agents(&mut team);
    let out = start_recorder(&mut team);
    let flies = |team: &Team| {
        let recorder = team
            .processes
            .iter()
            .find(|p| p.name == "clock/recorder")
            .unwrap();
        recorder
            .figure("plumage_messages_heard_total")
            .unwrap_or(0.0)
            > 500.0
    };
    team.wait("the mission is recorded", Duration::from_secs(30), flies)?;
    let recorder = team.of("clock/recorder");
    recorder.signal("-TERM");
    let status = recorder.ends_before(Instant::now() + Duration::from_secs(5))?;
    let said = recorder.said();
    assert!(
        status.success() && said.contains("asked to terminate"),
        "{status}: {said}"
    );
    outputs_are_whole(&out)
}

/// `plumage run` that is asked to terminate.
fn a_run_that_is_told_to_terminate_leaves_all_outputs() -> Result<(), Failed> {
    let out = folder("run-terminates").join("out");
    let mut run = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(["run", SCENARIO, "--no-serve", "--speed", "2", "--out"])
        .arg(&out)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while std::fs::metadata(out.join("mission.mcap")).map_or(0, |m| m.len()) < 50_000 {
        assert!(
            begun.elapsed() < Duration::from_secs(30),
            "nothing is recorded"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
    Command::new("kill")
        .args(["-TERM", &run.id().to_string()])
        .status()
        .unwrap();
    let mut said = String::new();
    run.stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    let status = run.wait().unwrap();
    assert!(
        status.success() && said.contains("asked to terminate"),
        "{status}: {said}"
    );
    outputs_are_whole(&out)
}

/// A disk that fills up under the recording of a run: it flies on, report, tracks and summary are written, and it says
/// why it failed.
fn a_run_on_a_disk_that_fills_up_leaves_all_that_fits() -> Result<Completion, Failed> {
    let out = folder("disk");
    let mount = "mount -t tmpfs -o size=14m none \"$1\"";
    let script = |then: &str| {
        let mut command = Command::new("unshare");
        command.args(["-m", "sh", "-c", &format!("{mount} && {then}"), "sh"]);
        command.arg(&out);
        command
    };
    let may = script("true").output();
    if !may.is_ok_and(|tried| tried.status.success()) {
        return Ok(Completion::ignored_with(
            "no file system of its own may be made here",
        ));
    }
    // The disk goes with its namespace: what is on it is looked at within.
    let then = "\"$2\" run \"$3\" --no-serve --duration 900 --out \"$1/out\"; code=$?; \
                cd \"$1/out\" && ls -la >&2 && wc -c summary.json report.html tracks.kml mission.mcap; exit $code";
    let ran = script(then)
        .args([env!("CARGO_BIN_EXE_plumage"), SCENARIO])
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, told) = (text(&ran.stdout), text(&ran.stderr));
    assert_eq!(ran.status.code(), Some(1), "{out}{told}");
    assert!(told.contains("No space left on device"), "{told}");
    assert!(told.contains("the recording stopped at"), "{told}");
    // The whole mission was flown, and what was found is said.
    assert!(out.contains("Flown: 15 min"), "{out}");
    for name in ["summary.json", "report.html", "tracks.kml", "mission.mcap"] {
        let line = out.lines().find(|line| line.trim_end().ends_with(name));
        let bytes = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
        assert!(bytes.unwrap_or(0) > 1000, "{name}: {out}");
    }
    Ok(Completion::Completed)
}

/// A disk on which not even the tracks have room: the last line lists the files that are there, and no others.
fn a_run_lists_the_outputs_that_a_full_disk_has() -> Result<Completion, Failed> {
    let out = folder("small-disk");
    let mut command = Command::new("unshare");
    let script = "mount -t tmpfs -o size=200k none \"$1\" || exit 77; \
                  \"$2\" run \"$3\" --no-serve --duration 60 --out \"$1/out\"; ls \"$1/out\" >&2";
    let ran = command
        .args(["-m", "sh", "-c", script, "sh"])
        .arg(&out)
        .args([env!("CARGO_BIN_EXE_plumage"), SCENARIO])
        .output();
    let Some(ran) = ran.ok().filter(|ran| ran.status.success()) else {
        return Ok(Completion::ignored_with(
            "no file system of its own may be made here",
        ));
    };
    let told = String::from_utf8_lossy(&ran.stdout).into_owned();
    let there = String::from_utf8_lossy(&ran.stderr).into_owned();
    let listed = told.lines().find(|line| line.starts_with("Outputs in "));
    let listed = listed.and_then(|line| line.rsplit_once(": ")).unwrap().1;
    for name in [
        "summary.json",
        "report.html",
        "tracks.kml",
        "mission.mcap",
        "scenario.toml",
    ] {
        let is_there = there.lines().any(|line| line == name);
        assert_eq!(
            listed.split(", ").any(|l| l == name),
            is_there,
            "{name}: {told}{there}"
        );
    }
    assert!(
        !listed.contains("report.html"),
        "the disk was not full: {told}"
    );
    Ok(Completion::Completed)
}

/// A process that was stopped for longer than Zenoh's lease, and others meanwhile: everybody meets again, and what was
/// said in between is marked in the record.
fn whoever_was_stopped_meets_all_again() -> Result<(), Failed> {
    let mut team = here("stopped", &["--scenario", SCENARIO, "--duration", "600"]);
    start_agents(&mut team);
    let out = start_recorder(&mut team);
    team.wait("all meet", Duration::from_secs(30), Team::all_meet)?;
    for victims in [
        &["va/2", "clock/recorder"][..],
        &["sc/main"],
        &["va/1", "va/2", "ws/main"],
    ] {
        for victim in victims {
            team.of(victim).signal("-STOP");
        }
        std::thread::sleep(Duration::from_secs(13));
        for victim in victims {
            team.of(victim).signal("-CONT");
        }
        let what = format!("all meet again after {victims:?} were stopped");
        team.wait(&what, Duration::from_secs(10), Team::all_meet)?;
    }
    let recorder = team.of("clock/recorder");
    recorder.signal("-INT");
    recorder.ends_before(Instant::now() + Duration::from_secs(5))?;
    outputs_are_whole(&out)?;
    let recording = record::read_mcap(&out.join("mission.mcap")).unwrap();
    let events: Vec<String> = recording
        .in_order()
        .unwrap()
        .filter_map(|said| match said.unwrap().1 {
            protocol::Envelope {
                sender,
                message: protocol::Message::Event(event),
                ..
            } if sender == protocol::AgentId::recorder() => Some(event.text),
            _ => None,
        })
        .collect();
    let marked = |of: &str| {
        events
            .iter()
            .any(|text| text.contains(&format!("messages of {of}, published from")))
    };
    assert!(
        marked("va/1") && marked("va/3") && marked("sc/main"),
        "{events:#?}"
    );
    assert!(
        events
            .iter()
            .any(|text| text.starts_with("ws/main is missing: no heartbeat since")),
        "{events:#?}"
    );
    Ok(())
}

/// A vehicle and the squadron controller that are started again in flight go on from where the others heard them last:
/// the vehicle stays in the air and with its pilot, and time goes on.
fn whoever_is_started_again_goes_on() -> Result<(), Failed> {
    let mut team = here("again", &["--scenario", SCENARIO, "--duration", "2100"]);
    start_agents(&mut team);
    let out = start_recorder(&mut team);
    team.wait("all meet", Duration::from_secs(30), Team::all_meet)?;
    // The second to take off, vehicle 1 is in the air 18 s after the mission's start.
    std::thread::sleep(Duration::from_secs(22));
    let endpoint = team.endpoint.clone();
    let taken = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .args(["control", "take-over", "--vehicles", "1"])
        .args(["--scenario", SCENARIO, "--connect", &endpoint])
        .stdout(Stdio::null())
        .status()
        .unwrap();
    assert!(taken.success());
    std::thread::sleep(Duration::from_secs(2));
    team.of("va/1").signal("-KILL");
    std::thread::sleep(Duration::from_secs(1));
    team.start("va/1", env!("CARGO_BIN_EXE_va"), &["--vehicles", "1"]);
    team.wait("va/1 is back", Duration::from_secs(10), Team::all_meet)?;
    team.of("sc/main").signal("-KILL");
    std::thread::sleep(Duration::from_secs(1));
    team.start("sc/main", env!("CARGO_BIN_EXE_sc"), &[]);
    team.wait("sc is back", Duration::from_secs(10), Team::all_meet)?;
    std::thread::sleep(Duration::from_secs(5));
    let said = [team.of("va/1").said(), team.of("sc/main").said()];
    assert!(
        said[0].contains("va/1 resumes from its last state"),
        "{}",
        said[0]
    );
    assert!(said[1].contains("sc/main resumes at"), "{}", said[1]);
    let recorder = team.of("clock/recorder");
    recorder.signal("-INT");
    recorder.ends_before(Instant::now() + Duration::from_secs(10))?;
    let recording = record::read_mcap(&out.join("mission.mcap")).unwrap();
    let (mut piloted, mut flew, mut planned_s) = (false, false, 0.0);
    for said in recording.in_order().unwrap() {
        let (topic, envelope) = said.unwrap();
        match (&topic, &envelope.message) {
            (Topic::Mode(name), Message::Mode(mode)) if name.as_str() == "1" => {
                assert!(!piloted || mode.level == ControlLevel::Pilot, "{mode:?}");
                piloted |= mode.level == ControlLevel::Pilot;
            }
            (Topic::State(name), Message::State(state)) if name.as_str() == "1" => {
                assert!(
                    !flew || state.airborne,
                    "on the ground at {} s",
                    envelope.time.s()
                );
                flew |= state.airborne;
            }
            (Topic::Plan, _) => {
                assert!(envelope.time.s() >= planned_s, "time goes back");
                planned_s = envelope.time.s();
            }
            _ => {}
        }
    }
    assert!(piloted && flew);
    // Until a second before the end: the plan of the one that was started again counts on.
    let end_s = recording
        .in_order()
        .unwrap()
        .last()
        .unwrap()
        .unwrap()
        .1
        .time
        .s();
    assert!(
        end_s - planned_s < 2.0,
        "the last plan is of {planned_s} s, the end {end_s} s"
    );
    Ok(())
}

/// Processes whose mission is over end well, whatever those do that they are connected to.
fn a_mission_that_is_over_ends_well_beside_one_that_is_stopped() -> Result<(), Failed> {
    let mut team = here("beside", &["--scenario", SCENARIO, "--duration", "20"]);
    start_agents(&mut team);
    start_recorder(&mut team);
    team.wait("all meet", Duration::from_secs(18), Team::all_meet)?;
    team.of("clock/recorder").signal("-STOP");
    let until = Instant::now() + Duration::from_secs(50);
    for process in team
        .processes
        .iter_mut()
        .filter(|p| p.name != "clock/recorder")
    {
        let status = process.ends_before(until)?;
        let said = process.said();
        assert!(
            status.success() && said.contains("has finished"),
            "{}: {status}: {said}",
            process.name
        );
    }
    Ok(())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn lockstep_ends_when_a_vehicle_dies() -> Result<(), Failed> {
    lockstep_ends("a_vehicle_dies", "va/2", "-KILL")
}

fn lockstep_ends_when_vehicles_stop() -> Result<(), Failed> {
    lockstep_ends("vehicles_stop", "va/3", "-STOP")
}

fn lockstep_ends_when_the_world_stops() -> Result<(), Failed> {
    lockstep_ends("the_world_stops", "ws/main", "-STOP")
}

fn lockstep_ends_when_the_recorder_dies() -> Result<(), Failed> {
    lockstep_ends("the_recorder_dies", "clock/recorder", "-KILL")
}

fn lockstep_ends_when_the_conductor_dies() -> Result<(), Failed> {
    lockstep_ends("the_conductor_dies", "clock/main", "-KILL")
}

fn lockstep_ends_when_the_conductor_stops() -> Result<(), Failed> {
    lockstep_ends("the_conductor_stops", "clock/main", "-STOP")
}

crate::runner::tests! {
    RealTime {
        whoever_was_stopped_meets_all_again,
        a_mission_that_is_over_ends_well_beside_one_that_is_stopped,
        whoever_is_started_again_goes_on,
        lockstep_ends_when_a_vehicle_dies,
        lockstep_ends_when_vehicles_stop,
        lockstep_ends_when_the_world_stops,
        lockstep_ends_when_the_recorder_dies,
        lockstep_ends_when_the_conductor_dies,
        lockstep_ends_when_the_conductor_stops,
        lockstep_ends_when_the_conductor_dies_before_the_team_is_complete,
        a_squadron_controller_ends_with_all_others,
        a_recorder_that_is_told_to_terminate_leaves_all_outputs,
        a_run_that_is_told_to_terminate_leaves_all_outputs,
    }
    Cores {
        a_run_on_a_disk_that_fills_up_leaves_all_that_fits,
        a_run_lists_the_outputs_that_a_full_disk_has,
    }
}
