//! Garbage, foreign senders and other wire versions on the bus are told of and do no harm; those who
//! have the password all meet, however they start, and nobody else gets in.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use net::realtime::{self, MissionClock};
use net::{Net, NetError, NetOptions, OneRun};
use protocol::joining::{Introduction, MissionIdentity};
use protocol::key::Name;
use protocol::message::{
    Ambient, Control, ControlWish, EventMessage, PathKind, Setpoint, Severity,
};
use protocol::seal::{MissionKey, SealFault, Sealer};
use protocol::{
    Agent, AgentId, Envelope, Event, Interest, Message, Outbox, ProtocolError, SimTime, Topic,
    WIRE_VERSION,
};
use std::net::TcpListener;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;

fn free_endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    format!("tcp/127.0.0.1:{port}")
}

/// A peer that is none of ours, connected to `endpoint`.
async fn stranger(endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("scouting/multicast/enabled", "false".to_owned()),
        ("connect/endpoints", format!("[\"{endpoint}\"]")),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

/// By then what is to happen between processes has, on a busy machine.
const WITHIN: Duration = Duration::from_secs(40);

/// Waits until something is so.
async fn until(what: &str, is: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is() {
        assert!(begun.elapsed() < WITHIN, "not within {WITHIN:?}: {what}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

fn key() -> MissionKey {
    MissionKey::new([7; 32])
}

fn listening(endpoint: &str) -> NetOptions {
    NetOptions {
        listen: vec![endpoint.to_owned()],
        ..NetOptions::default()
    }
}

/// Joins the bus of the mission of all these tests.
async fn bus(options: &NetOptions) -> Net {
    Net::open(Name::new("m").unwrap(), key(), options)
        .await
        .unwrap()
}

/// Says `bytes` on `key` as somebody who holds the mission's key.
async fn put_sealed(session: &zenoh::Session, sealer: &mut Sealer, key: &str, bytes: Vec<u8>) {
    let seal = sealer.seal(0, key, &bytes);
    session.put(key, bytes).attachment(seal).await.unwrap();
}

async fn next(net: &mut Net) -> net::Received {
    tokio::time::timeout(Duration::from_secs(20), net.receive())
        .await
        .unwrap()
        .unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn garbage_on_a_key_is_an_error_and_what_follows_is_heard() {
    let endpoint = free_endpoint();
    let mut net = bus(&listening(&endpoint)).await;
    let mut sealer = Sealer::new(key(), 1);
    net.subscribe(&[Interest::Everything]).await.unwrap();
    let stranger = stranger(&endpoint).await;
    let event = |text: &str| Envelope {
        sender: AgentId::sc(),
        sequence: 1,
        time: SimTime::ZERO,
        message: Message::Event(EventMessage {
            severity: Severity::Info,
            code: "test".to_owned(),
            text: text.to_owned(),
        }),
    };
    let mut newer = event("from the future").to_bytes();
    newer[0] += 1;
    let event_key = "plumage/m/sc/main/event";
    tokio::time::sleep(Duration::from_millis(500)).await;
    let garbage = [&[WIRE_VERSION], &b"garbage"[..]].concat();
    put_sealed(&stranger, &mut sealer, event_key, garbage).await;
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::Garbage { .. })
    ));
    put_sealed(&stranger, &mut sealer, event_key, newer).await;
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::WireVersion { theirs, ours: WIRE_VERSION }) if theirs == WIRE_VERSION + 1
    ));
    let forged = event("forged").to_bytes();
    put_sealed(&stranger, &mut sealer, "plumage/m/ws/main/event", forged).await;
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::ForeignSender { .. })
    ));
    put_sealed(&stranger, &mut sealer, "plumage/m/no/such/key", vec![1]).await;
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::UnknownKey(_))
    ));
    let binary = event("binary").to_bytes();
    put_sealed(&stranger, &mut sealer, event_key, binary).await;
    assert_eq!(next(&mut net).await.unwrap().1, event("binary"));
    let json = event("json").to_json().into_bytes();
    let seal = sealer.seal(0, event_key, &json);
    stranger
        .put(event_key, json)
        .encoding(zenoh::bytes::Encoding::APPLICATION_JSON)
        .attachment(seal)
        .await
        .unwrap();
    assert_eq!(next(&mut net).await.unwrap().1, event("json"));
    // As a script puts a string that knows of no encodings.
    let text = event("text").to_json().into_bytes();
    put_sealed(&stranger, &mut sealer, event_key, text).await;
    assert_eq!(next(&mut net).await.unwrap().1, event("text"));
    // A wind that would leave a vehicle without a finite number, by who holds the key.
    let ambient = Envelope {
        sender: AgentId::ws(),
        message: Message::Ambient(Ambient {
            wind_ned_m_s: [0.0, 1e300, 0.0],
            gust_ned_m_s: [0.0; 3],
            temperature_k: 288.0,
            pressure_pa: 92_000.0,
            co2_ppm: 449.0,
            ground_amsl_m: 340.0,
        }),
        ..event("")
    };
    let ambient_key = "plumage/m/ws/main/ambient/1";
    put_sealed(&stranger, &mut sealer, ambient_key, ambient.to_bytes()).await;
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::Implausible {
            field: "wind_ned_m_s",
            ..
        })
    ));
    assert_eq!(net.refused(), 5);
    stranger.close().await.unwrap();
    net.close().await;
}

/// A stranger without the key says what moves a vehicle, in both encodings, and repeats what was said with it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_does_not_hold_the_key_says_nothing() {
    let endpoint = free_endpoint();
    let mut net = bus(&listening(&endpoint)).await;
    net.subscribe(&[Interest::Everything]).await.unwrap();
    let stranger = stranger(&endpoint).await;
    tokio::time::sleep(Duration::from_millis(500)).await;
    let vehicle = Name::new("1").unwrap();
    let said = |sender: AgentId, sequence, message| Envelope {
        sender,
        sequence,
        time: SimTime::ZERO,
        message,
    };
    let setpoint = Message::Setpoint(Setpoint {
        path: PathKind::GoTo,
        lat_deg: 43.52,
        lon_deg: -7.86,
        alt_amsl_m: 2500.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 80.0,
    });
    let control = Message::Control(Control {
        wish: ControlWish::TakeOver,
        sticks: None,
    });
    let mission = Name::new("m").unwrap();
    let mut guessed = Sealer::new(MissionKey::new([8; 32]), 1);
    let mut refused = 0;
    for k in 1..=25 {
        for (topic, sender, message) in [
            (Topic::Setpoint(vehicle.clone()), AgentId::sc(), &setpoint),
            (
                Topic::Control(vehicle.clone()),
                AgentId::operator(),
                &control,
            ),
        ] {
            let (topic_key, envelope) = (topic.key(&mission), said(sender, k, message.clone()));
            let json = envelope.to_json().into_bytes();
            for bytes in [json, envelope.to_bytes()] {
                // One in two without a seal, the others with one by a guessed key.
                if k % 2 == 0 {
                    stranger.put(&topic_key, bytes).await.unwrap();
                } else {
                    put_sealed(&stranger, &mut guessed, &topic_key, bytes).await;
                }
                let fault = if k % 2 == 0 {
                    SealFault::Missing
                } else {
                    SealFault::Wrong
                };
                let got = next(&mut net).await;
                assert!(
                    matches!(&got, Err(ProtocolError::Seal { fault: f, .. }) if *f == fault),
                    "{got:?}"
                );
                refused += 1;
            }
        }
    }
    assert_eq!((refused, net.refused()), (100, 100));
    // The same setpoint by who holds the key is heard, once.
    let mut sealer = Sealer::new(key(), 1);
    let topic_key = Topic::Setpoint(vehicle).key(&mission);
    let bytes = said(AgentId::sc(), 1, setpoint).to_bytes();
    let seal = sealer.seal(0, &topic_key, &bytes);
    for _ in 0..2 {
        let put = stranger.put(&topic_key, bytes.clone());
        put.attachment(seal.clone()).await.unwrap();
    }
    assert!(next(&mut net).await.is_ok());
    assert!(matches!(
        next(&mut net).await,
        Err(ProtocolError::Seal {
            fault: SealFault::Replayed,
            ..
        })
    ));
}

fn introduction(agents: &[&str], seed: u64) -> Introduction {
    Introduction {
        agents: agents.iter().map(ToString::to_string).collect(),
        mission: MissionIdentity {
            scenario_sha256: "0".repeat(64),
            seed,
            tick_ns: 20_000_000,
            site_deg: [43.4417, -7.8631],
        },
    }
}

/// Opens the bus as `agents` of a mission with `seed`.
async fn opened(options: &NetOptions, agents: &[&str], seed: u64) -> Net {
    let mut net = bus(options).await;
    net.introduce(introduction(agents, seed));
    net
}

/// A run begins when the first agent of the team joins it.
async fn begun(keeper: &Net, first: &Net) -> (MissionClock, MissionClock) {
    let both = async { tokio::try_join!(MissionClock::keep(keeper), MissionClock::ask(first)) };
    tokio::time::timeout(WITHIN, both).await.unwrap().unwrap()
}

/// Another mission's `va`, a second of the same and a second keeper of the time are told why they are not let in;
/// a clock that somebody spoofs tells nobody the time.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_does_not_belong_is_refused_in_words_and_only_the_keeper_tells_time() {
    let endpoint = free_endpoint();
    let listens = NetOptions {
        listen: vec![endpoint.clone()],
        ..NetOptions::default()
    };
    let connects = NetOptions {
        connect: vec![endpoint.clone()],
        ..NetOptions::default()
    };
    let sc = opened(&listens, &["sc/main"], 1).await;
    let _sc_is_there = sc.announce(&AgentId::sc()).await.unwrap();
    let spoofer = stranger(&endpoint).await;
    let answer = r#"{"now_ns": 9000000000000, "run": 1, "stream": 1, "number": 1}"#;
    let clock_key = "plumage/m/clock/main/now";
    spoofer
        .declare_queryable(clock_key)
        .callback(move |query| {
            let _ = zenoh::Wait::wait(query.reply(clock_key, answer).attachment([0; 32]));
        })
        .background()
        .await
        .unwrap();
    let first = opened(&connects, &["va/2"], 1).await;
    first.wait_for(&[AgentId::sc()]).await;
    // The spoofer alone has not told it the time; that it waits is shown by a little of its patience.
    let asked = tokio::time::timeout(Duration::from_secs(2), MissionClock::ask(&first)).await;
    assert!(asked.is_err(), "a spoofed clock was believed");
    let (_, clock) = begun(&sc, &first).await;
    assert!(clock.now() < SimTime::from_s(60.0), "{:?}", clock.now());
    let _first_is_there = first.announce(&AgentId::va("2").unwrap()).await.unwrap();

    let words = |refused: Result<_, NetError>| match refused {
        Err(NetError::Refused(words)) => words,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("let in"),
    };
    let otherwise = opened(&connects, &["va/3"], 2).await;
    let said = words(MissionClock::ask(&otherwise).await.map(drop));
    assert!(said.contains("seed 2 instead of 1"), "{said}");
    let again = opened(&connects, &["va/2"], 1).await;
    again.wait_for(&[AgentId::va("2").unwrap()]).await;
    let said = words(MissionClock::ask(&again).await.map(drop));
    assert!(said.contains("va/2 is on the bus already"), "{said}");
    let second = opened(&connects, &["sc/main"], 1).await;
    let said = words(MissionClock::keep(&second).await.map(drop));
    assert!(said.contains("sc/main is on the bus already"), "{said}");
    // Who belongs is let in beside all this, and its own place is not taken.
    let third = opened(&connects, &["va/3"], 1).await;
    MissionClock::ask(&third).await.unwrap();
}

fn connecting(endpoints: &[&str]) -> NetOptions {
    NetOptions {
        connect: endpoints.iter().map(ToString::to_string).collect(),
        ..NetOptions::default()
    }
}

/// Another user of this host, without the key, shows himself as vehicles and answers the roll with what he heard: he is
/// taken for none, a dead vehicle is missed since it was heard last, and is let in when it is started again.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn presence_cannot_be_forged() {
    let endpoint = free_endpoint();
    let sc = opened(&listening(&endpoint), &["sc/main"], 1).await;
    let va = opened(&connecting(&[&endpoint]), &["va/1"], 1).await;
    begun(&sc, &va).await;
    let _sc_is_there = sc.announce(&AgentId::sc()).await.unwrap();
    let va_is_there = va.announce(&AgentId::va("1").unwrap()).await.unwrap();
    until("va/1 is there", || sc.peers().contains("va/1")).await;
    let stranger = stranger(&endpoint).await;
    let mut tokens = Vec::new();
    for vehicle in ["1", "2"] {
        let alive = format!("plumage/m/va/{vehicle}/alive");
        tokens.push(stranger.liveliness().declare_token(alive).await.unwrap());
        let answers = format!("plumage/m/va/{vehicle}/call");
        let (session, on) = (stranger.clone(), answers.clone());
        stranger
            .declare_queryable(answers)
            .callback(move |query| {
                // What is true of another, answered to the same question.
                let (session, on) = (session.clone(), on.clone());
                std::thread::spawn(move || {
                    let question = query.payload().unwrap().to_bytes().to_vec();
                    let asked = session.get("plumage/m/sc/main/call").payload(question);
                    let Ok(replies) = zenoh::Wait::wait(asked) else {
                        return;
                    };
                    while let Ok(reply) = replies.recv() {
                        let Ok(sample) = reply.result() else { continue };
                        let code = sample.attachment().unwrap().to_bytes().to_vec();
                        let reply = query.reply(&on, sample.payload().to_bytes().to_vec());
                        let _ = zenoh::Wait::wait(reply.attachment(code));
                    }
                });
            })
            .background()
            .await
            .unwrap();
    }
    tokio::time::sleep(Duration::from_secs(3)).await;
    assert!(
        sc.peers().contains("va/1") && !sc.peers().contains("va/2"),
        "{:?}",
        sc.peers()
    );
    let died = Instant::now();
    drop(va_is_there);
    va.close().await;
    until("va/1 is missed", || !sc.peers().contains("va/1")).await;
    let presence = sc.presence();
    let gone = presence.gone();
    let [(id, since)] = &gone[..] else {
        panic!("{gone:?}")
    };
    let off = died.max(*since) - died.min(*since);
    assert!(
        id == "va/1" && off < Duration::from_secs(2),
        "{id}: off by {off:?}"
    );
    let again = opened(&connecting(&[&endpoint]), &["va/1"], 1).await;
    let asked = tokio::time::timeout(WITHIN, MissionClock::ask(&again)).await;
    asked.unwrap().unwrap();
    let _again_is_there = again.announce(&AgentId::va("1").unwrap()).await.unwrap();
    until("va/1 is there again", || sc.peers().contains("va/1")).await;
}

/// The network of a host comes up: what connects to `from` reaches `to` from now on.
async fn comes_up(from: &str, to: &str) {
    let address = |endpoint: &str| endpoint.trim_start_matches("tcp/").to_owned();
    let (from, to) = (address(from), address(to));
    let listener = tokio::net::TcpListener::bind(from).await.unwrap();
    tokio::spawn(async move {
        while let Ok((mut near, _)) = listener.accept().await {
            let to = to.clone();
            tokio::spawn(async move {
                let mut far = tokio::net::TcpStream::connect(to).await.unwrap();
                let _ = tokio::io::copy_bidirectional(&mut near, &mut far).await;
            });
        }
    });
}

/// A squadron controller that is started again, and hears nobody for longer than it looks, takes up the run that it meets.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_keeper_with_a_late_network_takes_up_the_run_of_its_team() {
    let (endpoint, late) = (free_endpoint(), free_endpoint());
    let first = opened(&listening(&endpoint), &["sc/main"], 1).await;
    let va = opened(&connecting(&[&endpoint, &late]), &["va/1"], 1).await;
    let (_, clock) = begun(&first, &va).await;
    let _va_is_there = va.announce(&AgentId::va("1").unwrap()).await.unwrap();
    first.close().await;
    let hidden = free_endpoint();
    let again = opened(&listening(&hidden), &["sc/main"], 1).await;
    let mut keeps = MissionClock::keep(&again);
    let kept = tokio::time::timeout(Duration::from_secs(5), &mut keeps).await;
    assert!(kept.is_err(), "it began a run that nobody is in");
    // It has offered a run by now.
    comes_up(&late, &hidden).await;
    let kept = tokio::time::timeout(WITHIN, keeps).await;
    let off_s = kept.unwrap().unwrap().now().since_s(clock.now());
    assert!(off_s.abs() < 0.5, "off by {off_s} s");
    let _again_is_there = again.announce(&AgentId::sc()).await.unwrap();
    until("sc is there", || va.peers().contains("sc/main")).await;
    assert!(va.presence().is_one_run(&["sc/main".to_owned()]));
}

/// Two runs of a mission that have members each, and meet: all of the younger have to end, and none of the older.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn of_two_runs_with_members_the_younger_ends() {
    let (older, younger, way) = (free_endpoint(), free_endpoint(), free_endpoint());
    let mut teams = Vec::new();
    for (endpoint, also, vehicle) in [(&older, &older, "1"), (&younger, &way, "2")] {
        let sc = opened(&listening(endpoint), &["sc/main"], 1).await;
        let id = AgentId::va(vehicle).unwrap();
        let va = opened(&connecting(&[endpoint, also]), &[&id.to_string()], 1).await;
        begun(&sc, &va).await;
        let there = [
            sc.announce(&AgentId::sc()).await.unwrap(),
            va.announce(&id).await.unwrap(),
        ];
        teams.push((
            OneRun::new(sc.presence()),
            OneRun::new(va.presence()),
            sc,
            va,
            there,
        ));
    }
    comes_up(&way, &older).await;
    let begun = Instant::now();
    let (mut sc, mut va) = (Ok(()), Ok(()));
    while sc.is_ok() || va.is_ok() {
        assert!(begun.elapsed() < WITHIN, "{sc:?}, {va:?}");
        tokio::time::sleep(Duration::from_millis(200)).await;
        let (of_sc, of_va, ..) = &mut teams[0];
        assert_eq!((of_sc.check(), of_va.check()), (Ok(()), Ok(())));
        let (of_sc, of_va, ..) = &mut teams[1];
        sc = sc.and(of_sc.check());
        va = va.and(of_va.check());
    }
    let names = |ended: Result<(), NetError>| match ended {
        Err(NetError::OtherRun { members, .. }) => members,
        other => panic!("{other:?}"),
    };
    for members in [names(sc), names(va)] {
        assert!(
            members.contains("va/1") && !members.contains("va/2"),
            "{members}"
        );
    }
}

/// An agent that has something computed for six seconds, and says each second that it is there.
struct Thinker {
    id: AgentId,
    computed: bool,
    next: SimTime,
}

impl Agent for Thinker {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        Vec::new()
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        if let Event::Computed(result) = event {
            self.computed = result.take::<&str>() == Some("done");
            return out.event(&self.id, Severity::Info, "computed", "");
        }
        if self.next == SimTime::ZERO {
            out.compute(|| {
                std::thread::sleep(Duration::from_secs(6));
                "done"
            });
        }
        if now >= self.next {
            self.next = now.later(1_000_000_000);
            out.event(&self.id, Severity::Info, "here", "");
        }
    }
}

/// What an agent computes does not keep it from the bus: vehicles would count that as its silence.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn whoever_computes_is_heard_meanwhile() {
    let endpoint = free_endpoint();
    let mut sc = opened(&listening(&endpoint), &["sc/main"], 1).await;
    let mut va = opened(&connecting(&[&endpoint]), &["va/1"], 1).await;
    let (clock, _) = begun(&sc, &va).await;
    va.subscribe(&[Interest::Everything]).await.unwrap();
    let _va_is_there = va.announce(&AgentId::va("1").unwrap()).await.unwrap();
    until("va/1 is there", || sc.peers().contains("va/1")).await;
    let mut thinkers = [Thinker {
        id: AgentId::sc(),
        computed: false,
        next: SimTime::ZERO,
    }];
    let until = clock.now().later(9_000_000_000);
    let mut around = (
        |due, _: &mut [Thinker]| due >= until,
        |_, _: &mut Thinker| {},
    );
    realtime::run(&mut sc, &mut thinkers, clock, 20_000_000, &mut around)
        .await
        .unwrap();
    assert!(thinkers[0].computed);
    let said = std::iter::from_fn(|| va.try_receive()).map(Result::unwrap);
    let times: Vec<SimTime> = said.map(|(_, envelope)| envelope.time).collect();
    let silences = times.windows(2).map(|w| w[1].since_s(w[0]));
    let longest_s = silences.fold(0.0, f64::max);
    assert!(times.len() >= 9 && longest_s < 3.0, "{times:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_port_that_is_taken_is_refused() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let opened = Net::open(Name::new("m").unwrap(), key(), &listening(&endpoint)).await;
    assert!(opened.is_err());
}

/// Joins as vehicle `k` and waits until it sees all of `team`; it is there as long as what comes back.
async fn meet(
    options: NetOptions,
    k: u8,
    team: Vec<AgentId>,
) -> (Net, zenoh::liveliness::LivelinessToken) {
    let net = bus(&options).await;
    let vehicle = AgentId::va(&k.to_string()).unwrap();
    let token = net.announce(&vehicle).await.unwrap();
    net.wait_for(&team).await;
    (net, token)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn all_with_the_password_meet_when_they_start_at_once_and_nobody_else() {
    all_with_the_password_meet(1).await;
}

/// Whether two of ten open connections to each other at the same moment, and would be left with none
/// (eclipse-zenoh/zenoh#2577), is chance, one time in three on a busy machine and in five on an idle
/// one.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "second tier: a rate, ten start at once twenty times"]
async fn they_meet_however_they_start() {
    all_with_the_password_meet(20).await;
}

/// Ten start at once, `starts` times; then one comes with a wrong password.
async fn all_with_the_password_meet(starts: usize) {
    let users = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("users-{starts}"));
    std::fs::write(&users, "team:secret\n").unwrap();
    let with = |endpoint: &str, password: &str| NetOptions {
        connect: vec![endpoint.to_owned()],
        user_password: Some(("team".to_owned(), password.to_owned())),
        password_file: Some(users.to_str().unwrap().to_owned()),
        ..NetOptions::default()
    };
    let team: Vec<AgentId> = (1..=10)
        .map(|k| AgentId::va(&k.to_string()).unwrap())
        .collect();
    let (mut there, mut endpoint) = (Vec::new(), String::new());
    for start in 1..=starts {
        for (net, _) in there {
            Net::close(net).await;
        }
        endpoint = free_endpoint();
        let first = NetOptions {
            listen: vec![endpoint.clone()],
            connect: Vec::new(),
            ..with(&endpoint, "secret")
        };
        let mut all = JoinSet::new();
        all.spawn(meet(first, 1, team.clone()));
        for k in 2..=10 {
            all.spawn(meet(with(&endpoint, "secret"), k, team.clone()));
        }
        let all = tokio::time::timeout(Duration::from_secs(20), all.join_all()).await;
        there = all.unwrap_or_else(|_| panic!("not all met at start {start}"));
        assert_eq!(there.len(), 10);
    }
    // The last ten are still there, so that a stranger who is let in sees them.
    let stranger = meet(with(&endpoint, "guessed"), 11, team[..1].to_vec());
    let stranger = tokio::time::timeout(Duration::from_secs(3), stranger).await;
    assert!(stranger.is_err(), "a wrong password was let in");
}
