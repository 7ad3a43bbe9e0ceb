//! Several hosts by one command and one option: the keys that it writes carry a mission, and let nobody say what is not
//! his to say; without keys, and without a token for the page, programs refuse to open themselves to others.

use crate::program::{Ends, SCENARIO, folder, plumage, refused, text};
use net::realtime::MissionClock;
use net::{Net, NetOptions, TlsFiles};
use programs::host_keys;
use protocol::joining::{Introduction, MissionIdentity};
use protocol::key::Name;
use protocol::message::{Message, PathKind, Setpoint, Severity};
use protocol::{AgentId, Envelope, Interest, ProtocolError, SimTime, Topic};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tasks::mission_key;

fn free_endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tls/{}", port.local_addr().unwrap())
}

fn new_keys(out: &Path, hosts: &[&str]) -> Output {
    let mut arguments = vec![
        "keys",
        "new",
        "--mission",
        "as-pontes-steady",
        "--out",
        text(out),
    ];
    arguments.extend(hosts.iter().flat_map(|host| ["--host", host]));
    plumage(&arguments)
}

/// The team in lockstep over TLS, each of two hosts with its own folder of keys: the digest is that of one process.
fn one_command_and_one_option_fly_a_mission_with_keys() {
    let folder = folder("keys-mission");
    let out = folder.join("keys");
    let made = new_keys(&out, &["ground=127.0.0.1=sc,ws,watch", "air=127.0.0.1=va"]);
    assert!(made.status.success(), "{made:?}");
    refused(&new_keys(&out, &["air=127.0.0.1"]), 2, &["exists already"]);
    let endpoint = free_endpoint();
    let mission = ["--scenario", SCENARIO, "--duration", "5"];
    let start = |program: &str, host: &str, arguments: &[&str]| {
        let keys = out.join(host);
        let mut command = Command::new(program);
        command
            .args(mission)
            .args(["--keys", text(&keys)])
            .args(arguments);
        let started = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        Ends(started.unwrap())
    };
    let join = [
        "--lockstep",
        "--connect",
        &endpoint,
        "--listen",
        "tls/127.0.0.1:0",
    ];
    let _sc = start(
        env!("CARGO_BIN_EXE_sc"),
        "ground",
        &["--lockstep", "--listen", &endpoint],
    );
    let _ws = start(env!("CARGO_BIN_EXE_ws"), "ground", &join);
    let vehicles = [&join[..], &["--vehicles", "1,2,3,4,5,6"]].concat();
    let _va = start(env!("CARGO_BIN_EXE_va"), "air", &vehicles);
    let conduct = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .arg("conduct")
        .args(mission)
        .args(["--keys", text(&out.join("ground"))])
        .args(&join[1..])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&conduct.stdout).into_owned();
    assert!(conduct.status.success(), "{conduct:?}");
    let digest = said.trim().strip_prefix("digest ").unwrap();
    let alone = folder.join("alone");
    let run = plumage(&[
        "run",
        SCENARIO,
        "--duration",
        "5",
        "--no-serve",
        "--out",
        text(&alone),
    ]);
    assert!(run.status.success(), "{run:?}");
    let summary = std::fs::read_to_string(alone.join("summary.json")).unwrap();
    assert!(summary.contains(digest), "another digest than {digest}");
}

fn introduction(agent: &str) -> Introduction {
    Introduction {
        agents: vec![agent.to_owned()],
        mission: MissionIdentity {
            scenario_sha256: "0".repeat(64),
            seed: 1,
            tick_ns: 20_000_000,
            site_deg: [43.4417, -7.8631],
        },
    }
}

/// A host that holds the mission's key and may fly vehicle 6 is not heard as anybody else: neither on other agents' keys,
/// which access control denies it, nor in its own bundles.
fn a_host_says_only_what_is_its_own() {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let runtime = runtime.unwrap();
    runtime.block_on(a_host_is_heard_as_itself_alone("keys-roles", false));
    runtime.block_on(a_host_is_heard_as_itself_alone("keys-roles-bundled", true));
}

async fn a_host_is_heard_as_itself_alone(name: &str, bundled: bool) {
    let out = folder(name);
    let made = new_keys(
        &out.join("k"),
        &["ground=127.0.0.1=sc", "air=127.0.0.1=va/6"],
    );
    assert!(made.status.success(), "{made:?}");
    let endpoint = free_endpoint();
    let open = |host: &str, listen: Option<&str>| {
        let folder = out.join("k").join(host);
        let ([root_ca, certificate, private_key], access, host) = host_keys::read(&folder).unwrap();
        let key = mission_key::find(
            &Name::new("m").unwrap(),
            Some(&folder.join(mission_key::FILE)),
            &[],
        );
        let options = NetOptions {
            listen: listen.into_iter().map(ToOwned::to_owned).collect(),
            connect: if listen.is_some() {
                Vec::new()
            } else {
                vec![endpoint.clone()]
            },
            tls: Some(TlsFiles {
                root_ca,
                certificate: Some(certificate),
                private_key: Some(private_key),
                mutual: true,
            }),
            access_control: Some(access),
            host: Some(host),
            ..NetOptions::default()
        };
        let mission = Name::new("as-pontes-steady").unwrap();
        async move { Net::open(mission, key.unwrap(), &options).await.unwrap() }
    };
    let mut ground = open("ground", Some(&endpoint)).await;
    let everything = [Interest::Everything];
    if bundled {
        ground.subscribe_bundled(&everything).await.unwrap();
    } else {
        ground.subscribe(&everything).await.unwrap();
    }
    let mut air = open("air", None).await;
    for (net, agent) in [(&mut ground, "sc/main"), (&mut air, "va/6")] {
        net.introduce(introduction(agent));
    }
    tokio::try_join!(MissionClock::keep(&ground), MissionClock::ask(&air)).unwrap();
    let _there = ground.announce(&AgentId::sc()).await.unwrap();
    air.wait_for(&[AgentId::sc()]).await;
    // It shows itself as its own vehicle and as another, which is not taken for there.
    let mut shown = Vec::new();
    for vehicle in ["1", "6"] {
        let id = AgentId::va(vehicle).unwrap();
        shown.push(air.announce(&id).await.unwrap());
    }
    ground.wait_for(&[AgentId::va("6").unwrap()]).await;
    tokio::time::sleep(Duration::from_secs(2)).await;
    assert!(!ground.peers().contains("va/1"), "{:?}", ground.peers());
    let event = |sender: AgentId| {
        let message = Message::event(Severity::Info, "test", "said");
        (Topic::Event(sender.clone()), sender, message)
    };
    let setpoint = Message::Setpoint(Setpoint {
        path: PathKind::GoTo,
        lat_deg: 43.45,
        lon_deg: -7.86,
        alt_amsl_m: 800.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 80.0,
    });
    let one = Name::new("1").unwrap();
    let said = [
        (Topic::Setpoint(one), AgentId::sc(), setpoint),
        event(AgentId::va("1").unwrap()),
        event(AgentId::va("6").unwrap()),
    ];
    for (topic, sender, message) in said {
        let envelope = Envelope {
            sender,
            sequence: 1,
            time: SimTime::ZERO,
            message,
        };
        air.publish(&topic, &envelope).await.unwrap();
    }
    let mut refused = 0;
    let topic = loop {
        let heard = tokio::time::timeout(Duration::from_secs(10), ground.receive()).await;
        match heard.unwrap().unwrap() {
            Ok((topic, _)) => break topic,
            Err(ProtocolError::ForeignHost { host, .. }) => assert_eq!(host, "air"),
            Err(other) => panic!("{other}"),
        }
        refused += 1;
    };
    assert_eq!(topic, Topic::Event(AgentId::va("6").unwrap()));
    assert_eq!(refused, if bundled { 2 } else { 0 });
    assert_eq!(ground.refused(), refused);
}

fn nothing_is_opened_to_others_without_a_key_or_a_token() {
    let folder = folder("keys-refused");
    let sc = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_sc"))
            .args(["--scenario", SCENARIO])
            .args(arguments)
            .env_remove("PLUMAGE_MISSION_KEY")
            .output()
            .unwrap()
    };
    let open = sc(&["--listen", "tcp/0.0.0.0:0"]);
    refused(&open, 2, &["tcp/0.0.0.0:0", "plumage keys new", "--keys"]);
    // A password alone lets the right ones listen, and everybody of them command.
    std::fs::write(folder.join("users"), "team:secret\n").unwrap();
    let users = folder.join("users");
    let with_password = ["--listen", "tcp/0.0.0.0:0", "--password-file", text(&users)];
    refused(&sc(&with_password), 2, &["plumage keys new"]);
    let none = folder.join("none");
    refused(&sc(&["--keys", text(&none)]), 2, &["plumage keys new"]);
    let made = new_keys(&folder.join("k"), &["here=127.0.0.1"]);
    assert!(made.status.success(), "{made:?}");
    let here = folder.join("k/here");
    let plain = ["--keys", text(&here), "--listen", "tcp/127.0.0.1:0"];
    refused(&sc(&plain), 2, &["tls/"]);
    let out = folder.join("out");
    let run = [
        "run",
        SCENARIO,
        "--duration",
        "5",
        "--out",
        text(&out),
        "--serve",
    ];
    let page = plumage(&[&run[..], &["0.0.0.0:0"]].concat());
    refused(&page, 2, &["0.0.0.0:0", "--page-token"]);
    assert!(!out.exists());
    let token = plumage(&[&run[..], &["127.0.0.1:0", "--page-token", "a b"]].concat());
    refused(&token, 2, &["letters, digits"]);
}

crate::runner::tests! {
    RealTime {
        a_host_says_only_what_is_its_own,
    }
    Cores {
        one_command_and_one_option_fly_a_mission_with_keys,
        nothing_is_opened_to_others_without_a_key_or_a_token,
    }
}
