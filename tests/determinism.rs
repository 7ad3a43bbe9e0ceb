//! The same scenario and seed give the same digest in one process, in eight, and from a file.

use mission::{Run, Setup};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};

const SCENARIO: &str = "../scenarios/as-pontes.toml";
/// Long enough for take-off, setpoints, readings and corrections of the model.
const DURATION_S: f64 = 40.0;

fn setup(seed: u64) -> Setup {
    let text = std::fs::read_to_string(SCENARIO).unwrap();
    let read = |_: &str| -> Result<Vec<u8>, String> { Err("no such file".to_owned()) };
    let mut setup = Setup::load(SCENARIO, &text, &read).unwrap();
    setup.scenario.mission.seed = seed;
    setup.scenario.mission.duration_s = DURATION_S;
    setup
}

fn in_one_process(seed: u64) -> String {
    let mut run = Run::new(&setup(seed)).unwrap();
    while !run.ended() {
        run.step();
    }
    run.digest()
}

/// Ends the agents with the test, also with a failing one.
struct Team(Vec<Child>);

impl Drop for Team {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// One process for each list of vehicles, and one each for the others.
fn in_processes(seed: u64, vehicles: &[&str]) -> String {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let common = [
        "--scenario",
        SCENARIO,
        "--lockstep",
        "--duration",
        "40",
        "--seed",
    ];
    let start = |program: &str, more: &[&str]| {
        Command::new(program)
            .args(common)
            .arg(seed.to_string())
            .args(more)
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    };
    let mut team = Team(vec![
        start(env!("CARGO_BIN_EXE_sc"), &["--listen", &endpoint]),
        start(env!("CARGO_BIN_EXE_ws"), &["--connect", &endpoint]),
    ]);
    for ids in vehicles {
        team.0.push(start(
            env!("CARGO_BIN_EXE_va"),
            &["--connect", &endpoint, "--vehicles", ids],
        ));
    }
    let conductor = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .arg("conduct")
        .args(common)
        .arg(seed.to_string())
        .args(["--connect", &endpoint])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&conductor.stdout).into_owned();
    let told = String::from_utf8_lossy(&conductor.stderr).into_owned();
    assert!(conductor.status.success(), "{text}{told}");
    text.trim()
        .strip_prefix("digest ")
        .unwrap_or_else(|| panic!("{text}{told}"))
        .to_owned()
}

const EIGHT: [&str; 6] = ["1", "2", "3", "4", "5", "6"];

fn one_process_twice_and_eight_say_the_same() {
    let alone = in_one_process(7);
    assert_eq!(in_one_process(7), alone);
    assert_eq!(in_processes(7, &EIGHT), alone);
}

fn one_process_may_host_many_vehicles() {
    assert_eq!(in_processes(7, &["6,2", "1,3,4,5"]), in_one_process(7));
}

fn processes_say_the_same_again_and_however_they_share_the_vehicles() {
    let alone = in_one_process(7);
    for _ in 0..2 {
        assert_eq!(in_processes(7, &EIGHT), alone);
    }
    assert_eq!(in_processes(7, &["1,2,3,4,5,6"]), alone);
}

fn another_seed_says_something_else() {
    assert_ne!(in_one_process(7), in_one_process(8));
}

crate::runner::tests! {
    Cores {
        one_process_twice_and_eight_say_the_same,
        one_process_may_host_many_vehicles,
        #[ignore = "second tier: more of the same"]
        processes_say_the_same_again_and_however_they_share_the_vehicles,
        another_seed_says_something_else,
    }
}
