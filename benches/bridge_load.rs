//! Many vehicles behind one `mav-bridge` process: how long a frame takes from the wire to the bus, and how much
//! of a core the process needs, beside the reader of the crate `mavlink` on the same frames.
//!
//! ```sh
//! cargo bench -p bins --bench bridge_load -- --vehicles 100 --seconds 30
//! cargo bench -p bins --bench bridge_load -- --links each
//! ```
//!
//! Every vehicle sends GLOBAL_POSITION_INT, ATTITUDE, VFR_HUD, WIND and NAMED_VALUE_FLOAT `CO2` fifty times a second,
//! EXTENDED_SYS_STATE and SYS_STATUS twice, HEARTBEAT once, each in a datagram of its own, the vehicles one after
//! another as a router hands them on (`--links one`) or on a link each. All that the process says is heard over
//! Zenoh, as a recorder hears it: the raw frames too. The time is taken just before a frame is sent and when its
//! message has come out of the subscription.
#![allow(missing_docs, clippy::expect_used, clippy::unwrap_used)]

use clap::{Parser, ValueEnum};
use mav_bridge::arduplane::GUIDED;
use mav_bridge::dialect::*;
use mav_bridge::wire::{FrameDecoder, FrameEncoder, MessageData};
use mavlink::{MavlinkReader, MavlinkVersion};
use net::realtime::MissionClock;
use net::{Net, NetOptions};
use protocol::key::Name;
use protocol::{Interest, Message, SimTime, Topic};
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tasks::mission_key;

/// Frames of each fast message a second and vehicle.
const RATE_HZ: u64 = 50;
/// Time given to the process before the measurement, s: connections, and what is asked of each vehicle at first.
const WARM_UP_S: u64 = 6;
/// Latitude of the first position, 1e-7 degrees; the k-th is k further north.
const FIRST_LAT: i32 = 434_300_000;

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Sharing {
    /// All on one link, as behind a router.
    One,
    /// A link each.
    Each,
}

#[derive(Debug, Parser)]
struct Options {
    #[arg(long, default_value_t = 100)]
    vehicles: usize,
    #[arg(long, default_value_t = 20)]
    seconds: u64,
    #[arg(long, value_enum, default_value = "one")]
    links: Sharing,
    /// Receive each message on its own key, as a program without bundles does
    #[arg(long)]
    own_keys: bool,
    /// Another build of mav-bridge
    #[arg(long, default_value = env!("CARGO_BIN_EXE_mav-bridge"))]
    bridge: PathBuf,
    /// What `cargo bench` passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// A process that ends with the measurement.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// When the frames of one vehicle were sent, ns since the start, by their number; 0 where not yet.
type Sent = Arc<Vec<Vec<AtomicU64>>>;

fn free_udp() -> SocketAddr {
    UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
}

/// The steady reference mission with vehicles on `ports`.
fn scenario(ports: &[SocketAddr], duration_s: u64) -> String {
    let text = include_str!("../scenarios/as-pontes-steady.toml");
    let (before, _) = text.split_once("[[vehicle]]").unwrap();
    let before = before.replace(
        "duration_s = 2100.0",
        &format!("duration_s = {duration_s}.0"),
    );
    let vehicle = |(k, port): (usize, &SocketAddr)| {
        let (row, column) = (k / 10, k % 10);
        let (lat, lon) = (
            43.4300 - 0.0006 * row as f64,
            -7.8420 + 0.0008 * column as f64,
        );
        let id = k + 1;
        format!(
            "[[vehicle]]\nid = \"{id}\"\nkind = \"mavlink\"\nlink = \"udpin:{port}\"\nsystem_id = {id}\n\
             home = {{ lat_deg = {lat:.4}, lon_deg = {lon:.4} }}\n"
        )
    };
    let vehicles: String = ports.iter().enumerate().map(vehicle).collect();
    before.to_owned() + &vehicles
}

/// One vehicle's side of its link.
struct Vehicle {
    encoder: FrameEncoder,
    socket: Arc<UdpSocket>,
}

impl Vehicle {
    fn frame<D: MessageData>(&mut self, message: &D) -> Vec<u8> {
        self.encoder.encode(message, None, SimTime::ZERO)
    }

    /// The frames of the k-th fiftieth of a second.
    fn frames(&mut self, k: u64) -> Vec<Vec<u8>> {
        let time_boot_ms = (k * 1000 / RATE_HZ) as u32;
        let mut frames = vec![
            self.frame(&GLOBAL_POSITION_INT_DATA {
                time_boot_ms,
                lat: FIRST_LAT + k as i32,
                lon: -78_400_000,
                alt: 700_000,
                relative_alt: 360_000,
                ..GLOBAL_POSITION_INT_DATA::default()
            }),
            self.frame(&ATTITUDE_DATA {
                time_boot_ms,
                roll: 0.1,
                pitch: 0.02,
                yaw: 1.0,
                ..ATTITUDE_DATA::default()
            }),
            self.frame(&VFR_HUD_DATA {
                airspeed: 17.0,
                groundspeed: 20.0,
                alt: 700.0,
                throttle: 40,
                ..VFR_HUD_DATA::default()
            }),
            self.frame(&WIND_DATA {
                direction: 240.0,
                speed: 7.0,
                ..WIND_DATA::default()
            }),
            self.frame(&NAMED_VALUE_FLOAT_DATA {
                time_boot_ms,
                value: 450.0 + (k % 50) as f32,
                name: "CO2".into(),
            }),
        ];
        if k.is_multiple_of(RATE_HZ / 2) {
            let landed_state = MavLandedState::MAV_LANDED_STATE_IN_AIR;
            frames.push(self.frame(&EXTENDED_SYS_STATE_DATA {
                landed_state,
                ..EXTENDED_SYS_STATE_DATA::default()
            }));
            frames.push(self.frame(&SYS_STATUS_DATA {
                battery_remaining: 80,
                ..SYS_STATUS_DATA::default()
            }));
        }
        if k.is_multiple_of(RATE_HZ) {
            frames.push(self.frame(&HEARTBEAT_DATA {
                custom_mode: GUIDED,
                mavtype: MavType::MAV_TYPE_FIXED_WING,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
                    | MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            }));
        }
        frames
    }
}

/// Sends all vehicles' telemetry in its time; the number of frames.
fn send(ports: &[SocketAddr], count: u64, start: Instant, sent: &Sent) -> u64 {
    let mut sockets: Vec<(SocketAddr, Arc<UdpSocket>)> = Vec::new();
    let mut vehicles: Vec<Vehicle> = Vec::new();
    for (k, port) in ports.iter().enumerate() {
        let known = sockets
            .iter()
            .find(|(p, _)| p == port)
            .map(|(_, s)| s.clone());
        let socket = known.unwrap_or_else(|| {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.connect(port).unwrap();
            socket.set_nonblocking(true).unwrap();
            sockets.push((*port, Arc::new(socket)));
            sockets[sockets.len() - 1].1.clone()
        });
        vehicles.push(Vehicle {
            encoder: FrameEncoder::new(k as u8 + 1, 1),
            socket,
        });
    }
    let each = Duration::from_nanos(1_000_000_000 / RATE_HZ / vehicles.len() as u64);
    let mut frames = 0;
    let mut answers = [0; 512];
    for k in 0..count {
        for (v, vehicle) in vehicles.iter_mut().enumerate() {
            let due = start + Duration::from_nanos(k * 1_000_000_000 / RATE_HZ) + each * v as u32;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            let telemetry = vehicle.frames(k);
            sent[v][k as usize].store(start.elapsed().as_nanos() as u64, Ordering::Release);
            for frame in telemetry {
                frames += u64::from(vehicle.socket.send(&frame).is_ok());
            }
            // What the bridge asks for is taken and not answered.
            while vehicle.socket.recv(&mut answers).is_ok() {}
        }
    }
    frames
}

/// Latencies of one kind of message, ms.
#[derive(Default)]
struct Latencies(Vec<f64>);

impl Latencies {
    fn take(&mut self, sent: &Sent, vehicle: usize, k: i64, at: Duration, from_k: u64) {
        let known = usize::try_from(k)
            .ok()
            .and_then(|k| sent.get(vehicle)?.get(k));
        let sent_ns = known.map_or(0, |s| s.load(Ordering::Acquire));
        if sent_ns > 0 && k as u64 >= from_k {
            self.0.push(at.as_secs_f64() * 1e3 - sent_ns as f64 / 1e6);
        }
    }

    fn tell(&mut self, what: &str, expected: u64) {
        self.0.sort_by(f64::total_cmp);
        let at = |share: f64| {
            self.0
                .get((share * (self.0.len().max(1) - 1) as f64) as usize)
                .copied()
                .unwrap_or(f64::NAN)
        };
        println!(
            "{what:<34} {:>8} of {expected:>8}   median {:6.2}  p99 {:6.2}  p99.9 {:6.2}  most {:6.2} ms",
            self.0.len(),
            at(0.5),
            at(0.99),
            at(0.999),
            at(1.0)
        );
    }
}

/// Processor time of a process so far, s; none where /proc does not tell.
fn processor_s(pid: u32) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name in brackets may hold spaces; user and system time are the 12th and 13th field after it.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

/// What the crate's own reader, and this one, need for the frames alone, µs a frame.
fn parsers(vehicles: usize) {
    let port = free_udp();
    let socket = Arc::new(UdpSocket::bind("127.0.0.1:0").unwrap());
    socket.connect(port).unwrap();
    let mut stream = Vec::new();
    let mut count = 0;
    for v in 0..vehicles {
        let mut vehicle = Vehicle {
            encoder: FrameEncoder::new(v as u8 + 1, 1),
            socket: socket.clone(),
        };
        for k in 0..RATE_HZ {
            let frames = vehicle.frames(k);
            count += frames.len();
            stream.extend(frames.concat());
        }
    }
    let least = |work: &dyn Fn() -> usize| {
        let times = (0..20).map(|_| {
            let from = Instant::now();
            assert_eq!(work(), count);
            from.elapsed().as_secs_f64()
        });
        times.fold(f64::INFINITY, f64::min) / count as f64 * 1e6
    };
    let peer = least(&|| {
        let mut reader = MavlinkReader::new(stream.as_slice());
        std::iter::from_fn(|| reader.read_message::<MavMessage>(MavlinkVersion::V2).ok()).count()
    });
    let own = least(&|| {
        let mut decoder = FrameDecoder::new();
        stream
            .chunks(1000)
            .map(|piece| {
                decoder.push(piece);
                std::iter::from_fn(|| decoder.next_frame(SimTime::ZERO))
                    .filter(|f| f.message().is_some())
                    .count()
            })
            .sum()
    });
    println!("frames read: {peer:.3} µs each by the reader of the crate mavlink, {own:.3} µs here");
}

#[tokio::main]
async fn main() {
    let options = Options::parse();
    let shared = free_udp();
    let ports: Vec<SocketAddr> = (0..options.vehicles)
        .map(|_| {
            if options.links == Sharing::One {
                shared
            } else {
                free_udp()
            }
        })
        .collect();
    let (from_k, count) = (WARM_UP_S * RATE_HZ, (WARM_UP_S + options.seconds) * RATE_HZ);
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = directory.join("bridge_load.toml");
    let text = scenario(&ports, 3600);
    std::fs::write(&file, &text).unwrap();
    let bus = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let endpoint = format!("tcp/{bus}");
    let name = Name::new("as-pontes-steady").unwrap();
    let key = mission_key::find(&name, None, &[]).unwrap();
    let mut net = Net::open(
        name,
        key,
        &NetOptions {
            listen: vec![endpoint.clone()],
            ..NetOptions::default()
        },
    )
    .await
    .unwrap();
    let everything = [Interest::Everything];
    if options.own_keys {
        net.subscribe(&everything).await.unwrap();
    } else {
        net.subscribe_bundled(&everything).await.unwrap();
    }
    let ids: Vec<String> = (1..=options.vehicles).map(|id| id.to_string()).collect();
    let errors = std::fs::File::create(directory.join("bridge_load.log")).unwrap();
    let bridge = Ends(
        Command::new(&options.bridge)
            .arg("--scenario")
            .arg(&file)
            .args(["--connect", &endpoint, "--vehicle", &ids.join(",")])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(errors)
            .spawn()
            .unwrap(),
    );
    // The run begins when the bridge joins it.
    let _clock = MissionClock::keep(&net).await.unwrap();
    let agents: Vec<protocol::AgentId> = ids
        .iter()
        .map(|id| protocol::AgentId::va(id).unwrap())
        .collect();
    tokio::time::timeout(Duration::from_secs(30), net.wait_for(&agents))
        .await
        .expect("see bridge_load.log");

    let sent: Sent = Arc::new(
        (0..options.vehicles)
            .map(|_| (0..count).map(|_| AtomicU64::new(0)).collect())
            .collect(),
    );
    let start = Instant::now();
    let sender = {
        let (sent, ports) = (sent.clone(), ports.clone());
        std::thread::spawn(move || send(&ports, count, start, &sent))
    };
    let (mut raw, mut states, mut readings) = (
        Latencies::default(),
        Latencies::default(),
        Latencies::default(),
    );
    let mut all: u64 = 0;
    let pid = bridge.0.id();
    let (mut before, end) = (
        None,
        start + Duration::from_secs(WARM_UP_S + options.seconds) + Duration::from_secs(1),
    );
    let mut after = None;
    let index = |name: &Name| name.as_str().parse::<usize>().map_or(usize::MAX, |n| n - 1);
    while Instant::now() < end {
        let since = start.elapsed();
        if before.is_none() && since.as_secs() >= WARM_UP_S {
            before = processor_s(pid).map(|s| (s, since));
        }
        if after.is_none() && since.as_secs() >= WARM_UP_S + options.seconds {
            after = processor_s(pid).map(|s| (s, since));
        }
        let Some(received) = net.try_receive() else {
            tokio::time::sleep(Duration::from_micros(500)).await;
            continue;
        };
        let at = start.elapsed();
        let (topic, envelope) = received.unwrap();
        all += u64::from(since.as_secs() >= WARM_UP_S);
        match (&topic, &envelope.message) {
            (Topic::State(name), Message::State(s)) => states.take(
                &sent,
                index(name),
                (s.lat_deg * 1e7).round() as i64 - i64::from(FIRST_LAT),
                at,
                from_k,
            ),
            (Topic::Reading(name), Message::Reading(r)) => readings.take(
                &sent,
                index(name),
                (r.lat_deg * 1e7).round() as i64 - i64::from(FIRST_LAT),
                at,
                from_k,
            ),
            (Topic::MavlinkRx(name), Message::Mavlink(frame)) => {
                let timed = [
                    GLOBAL_POSITION_INT_DATA::ID,
                    ATTITUDE_DATA::ID,
                    NAMED_VALUE_FLOAT_DATA::ID,
                ];
                let id = u32::from_le_bytes([frame.bytes[7], frame.bytes[8], frame.bytes[9], 0]);
                if timed.contains(&id) {
                    let ms = u32::from_le_bytes([
                        frame.bytes[10],
                        frame.bytes[11],
                        frame.bytes[12],
                        frame.bytes[13],
                    ]);
                    raw.take(
                        &sent,
                        index(name),
                        i64::from(ms) * RATE_HZ as i64 / 1000,
                        at,
                        from_k,
                    );
                }
            }
            _ => {}
        }
    }
    let frames = sender.join().unwrap();
    let each = options.vehicles as u64 * options.seconds * RATE_HZ;
    println!(
        "{} vehicles, {:?} link, {} s: {frames} frames sent in all, {:.0} a second",
        options.vehicles,
        options.links,
        options.seconds,
        frames as f64 / (WARM_UP_S + options.seconds) as f64
    );
    raw.tell("raw frames with a time of their own", 3 * each);
    states.tell("states", each);
    readings.tell("readings", each);
    if let (Some((a, from)), Some((b, to))) = (before, after) {
        println!(
            "processor time {:.2} of a core; {:.0} messages a second heard",
            (b - a) / (to - from).as_secs_f64(),
            all as f64 / options.seconds as f64
        );
    }
    parsers(options.vehicles);
}
