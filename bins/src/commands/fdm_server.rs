//! `plumage fdm-server`: an autopilot that runs elsewhere flies Plumage's aircraft in Plumage's air.

use anyhow::Context as _;
use clap::Parser;
use fdm::{Airframe, FlightPhase};
use mav_bridge::dialect::NAMED_VALUE_FLOAT_DATA;
use mav_bridge::wire::FrameEncoder;
use mission::Setup;
use protocol::SimTime;
use stand_in::StandInConfig;
use stand_in::json_backend::{GasReading, JsonBackend, ServoPacket, Stepped};
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::time::Duration;

use crate::{Failure, mission_files, ranges};
use tasks::measured;

/// Where nothing is said of the world: still air at sea level, and no gas but the background.
const STILL_AIR: &str = r#"
[site]
lat_deg = 0.0
lon_deg = 0.0
ground_amsl_m = 0.0
[weather]
wind_speed_m_s = 0.0
turbulence_intensity = 0.0
air = "steady"
[[source]]
lat_deg = 0.0
lon_deg = 0.0
effective_height_m = 100.0
emission_kg_s = 0.0
"#;
/// MAVLink component of the gas sensor: MAV_COMP_ID_USER1, an onboard computer of the user's own.
const GAS_COMPONENT: u8 = 25;
/// An autopilot that says nothing for this long is said to be silent.
const SILENCE: Duration = Duration::from_secs(12);
/// Shortest time between two messages of what becomes of the aircraft, s: rotors that spin down lift it off again for
/// some hundredths of a second.
const SETTLES_S: f64 = 1.0;
/// Longest packet: that of 32 outputs has 72 bytes.
const PACKET_BYTES: usize = 512;

/// Serve the flight model to an external ArduPilot SITL
///
/// Speaks ArduPilot's JSON interface for simulators: start the SITL of ArduPlane, or of ArduCopter for a multirotor, with
/// --model JSON:HOST, where HOST is this machine. The server answers each packet of servo outputs with the resulting
/// motion. With a scenario the aircraft flies in its `[reality]`, with wind, gusts and gas; without one, in still air.
#[derive(Debug, Parser)]
#[command(after_help = "Example: plumage fdm-server scenarios/as-pontes.toml --ardupilot-json")]
pub struct FdmServerArguments {
    /// Scenario (TOML) [default: still air at sea level]
    scenario: Option<PathBuf>,
    /// Serve ArduPilot's JSON interface at this address (127.0.0.1:9002 if none is given)
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:9002")]
    ardupilot_json: Option<SocketAddr>,
    /// Id of the vehicle in the scenario [default: the last one]
    #[arg(long, value_name = "ID")]
    vehicle: Option<String>,
    /// Aircraft (TOML) [default: the vehicle's]
    #[arg(long, value_name = "FILE")]
    aircraft: Option<PathBuf>,
    /// Send gas readings to this address, as NAMED_VALUE_FLOAT over UDP
    #[arg(long, value_name = "HOST:PORT")]
    gas: Option<SocketAddr>,
    /// MAVLink system id of the gas sensor, that of the autopilot, 1 to 254
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        value_parser = clap::value_parser!(u8).range(1..=254)
    )]
    system_id: u8,
    /// Seed of gusts and sensor noise, 0 to 2^63 - 1 [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = ranges::seed)]
    seed: Option<u64>,
    /// Print the output parameters of ArduPlane or ArduCopter that match the aircraft, and exit
    #[arg(long)]
    print_parameters: bool,
}

/// Serves until it is interrupted.
///
/// # Errors
/// A scenario, aircraft or address that cannot be used.
pub fn fdm_server(arguments: &FdmServerArguments) -> Result<(), Failure> {
    let (config, seed) = config(arguments)?;
    if arguments.print_parameters {
        print_parameters(&config);
        return Ok(());
    }
    let Some(at) = arguments.ardupilot_json else {
        return Err(Failure::usage(
            "fdm-server: expected --ardupilot-json [HOST:PORT]",
        ));
    };
    let socket = UdpSocket::bind(at)
        .with_context(|| format!("--ardupilot-json {at}: cannot listen"))
        .map_err(Failure::Input)?;
    socket.set_read_timeout(Some(SILENCE))?;
    let gas = arguments
        .gas
        .map(|to| GasSender::open(to, arguments.system_id));
    println!(
        "serving {} over ArduPilot's JSON interface on {at}",
        config.aircraft.name()
    );
    println!(
        "  Start {} with --model JSON:{} --home {:.7},{:.7},{:.1},{:.0}",
        if config.aircraft.hovers() {
            "ArduCopter"
        } else {
            "ArduPlane"
        },
        at.ip(),
        config.home.lat_deg,
        config.home.lon_deg,
        config.home_amsl_m,
        config.launch_heading_deg
    );
    println!("  Print its output parameters with: plumage fdm-server … --print-parameters");
    let backend = JsonBackend::new(config, seed).map_err(Failure::input)?;
    let mut server = Server {
        socket,
        backend,
        gas: gas.transpose()?,
        autopilot: None,
        phase: FlightPhase::OnGround,
        told_s: f64::NEG_INFINITY,
    };
    loop {
        server.serve_one()?;
    }
}

/// What is flown in which reality, and by which seed.
fn config(arguments: &FdmServerArguments) -> Result<(StandInConfig, u64), Failure> {
    let setup = match &arguments.scenario {
        Some(file) => mission_files::load(file)?,
        None => {
            let none = |file: &str| Err(format!("{file}: the built-in scenario has no files"));
            Setup::load("still air", STILL_AIR, &none).map_err(Failure::input)?
        }
    };
    let index = match &arguments.vehicle {
        Some(id) => setup.index_of(id).map_err(Failure::input)?,
        None => setup.scenario.vehicles.len().saturating_sub(1),
    };
    let config = match &arguments.aircraft {
        None => setup.stand_in_config(index),
        Some(file) => {
            let airframe = measured::airframe(file).map_err(Failure::input)?;
            setup.stand_in_config_of(index, airframe)
        }
    };
    let seed = arguments.seed.unwrap_or(setup.scenario.mission.seed);
    Ok((config.map_err(Failure::input)?, seed))
}

fn print_parameters(config: &StandInConfig) {
    let parameters = match &config.aircraft {
        Airframe::FixedWing(aircraft) => {
            let servos = aircraft.servos.unwrap_or_default();
            servos.ardupilot_parameters(aircraft.surfaces.layout)
        }
        Airframe::Multirotor(aircraft) => aircraft.motors.ardupilot_parameters(),
    };
    for (name, value) in parameters {
        println!("{name} {value}");
    }
    if let Airframe::Multirotor(aircraft) = &config.aircraft {
        for (name, value) in aircraft.ardupilot_drag() {
            println!("{name} {value:.4}");
        }
    }
}

/// The autopilot's counterpart on the network.
struct Server {
    socket: UdpSocket,
    backend: JsonBackend,
    gas: Option<GasSender>,
    autopilot: Option<SocketAddr>,
    phase: FlightPhase,
    /// Time of the last message of the phase, s.
    told_s: f64,
}

impl Server {
    /// Waits for a packet and answers it.
    fn serve_one(&mut self) -> Result<(), Failure> {
        let mut bytes = [0; PACKET_BYTES];
        let (length, from) = match self.socket.recv_from(&mut bytes) {
            Ok(received) => received,
            Err(e) if is_silence(&e) => {
                if let Some(silent) = self.autopilot.take() {
                    println!(
                        "{:8.1} s  the autopilot at {silent} stopped sending",
                        self.backend.time_s()
                    );
                }
                return Ok(());
            }
            // An answer that nobody took comes back as an error of the next call.
            Err(e) if e.kind() == std::io::ErrorKind::ConnectionRefused => return Ok(()),
            Err(e) => return Err(e.into()),
        };
        if self.autopilot.is_some_and(|known| known != from) {
            // One aircraft is flown by one autopilot.
            return Ok(());
        }
        let packet = ServoPacket::decode(&bytes[..length]);
        let stepped = packet.and_then(|packet| self.backend.step(&packet));
        match stepped {
            Ok(stepped) => self.tell(stepped, from),
            Err(why) => {
                if self.autopilot.is_none() {
                    eprintln!("{from}: {why}");
                }
                return Ok(());
            }
        }
        self.socket
            .send_to(self.backend.answer().as_bytes(), from)?;
        if let (Some(gas), Some(reading)) = (&mut self.gas, self.backend.take_gas()) {
            gas.send(self.backend.gas_formula(), reading);
        }
        Ok(())
    }

    /// Tells who flies, and what becomes of the aircraft.
    fn tell(&mut self, stepped: Stepped, from: SocketAddr) {
        let time_s = self.backend.time_s();
        if self.autopilot.replace(from).is_none() {
            println!("{time_s:8.1} s  the autopilot at {from} connected");
        }
        if stepped == Stepped::Anew {
            println!("{time_s:8.1} s  the autopilot restarted; the aircraft is back at home");
            self.phase = FlightPhase::OnGround;
            self.told_s = f64::NEG_INFINITY;
        }
        let state = self.backend.state();
        if state.phase == self.phase || time_s < self.told_s + SETTLES_S {
            return;
        }
        let hard = if state.flags.hard_landing {
            " hard"
        } else {
            ""
        };
        let words = match (self.phase, state.phase) {
            (FlightPhase::OnGround, _) => "launched".to_owned(),
            (_, FlightPhase::Flying) => "airborne".to_owned(),
            (FlightPhase::Flying, FlightPhase::Sliding) => {
                let [north, east, _] = state.vel_ned_m_s;
                format!("touched down{hard} at {:.1} m/s", north.hypot(east))
            }
            (FlightPhase::Flying, FlightPhase::OnGround) => format!("touched down{hard}"),
            (_, FlightPhase::OnGround) => "stopped".to_owned(),
            _ => return,
        };
        self.phase = state.phase;
        self.told_s = time_s;
        println!("{time_s:8.1} s  {words}");
    }
}

fn is_silence(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{TimedOut, WouldBlock};
    matches!(error.kind(), TimedOut | WouldBlock)
}

/// The gas sensor's own way to the ground.
struct GasSender {
    socket: UdpSocket,
    encoder: FrameEncoder,
}

impl GasSender {
    fn open(to: SocketAddr, system_id: u8) -> Result<Self, Failure> {
        let from = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(from).context("cannot open a socket for the gas sensor")?;
        socket.connect(to)?;
        Ok(Self {
            socket,
            encoder: FrameEncoder::new(system_id, GAS_COMPONENT),
        })
    }

    fn send(&mut self, formula: &str, reading: GasReading) {
        let message = NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: (reading.time_s.max(0.0) * 1e3) as u32,
            value: reading.ppm as f32,
            name: formula.into(),
        };
        let time = SimTime::from_s(reading.time_s);
        let frame = self.encoder.encode(&message, None, time);
        // A ground station that is not there yet is no failure of the flight.
        let _ = self.socket.send(&frame);
    }
}
