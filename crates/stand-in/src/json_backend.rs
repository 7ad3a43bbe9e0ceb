//! Flight dynamics for an autopilot that runs elsewhere: ArduPilot's JSON interface for simulators.
//!
//! An ArduPlane or ArduCopter of the user's own, started with `--model JSON:HOST`, sends the pulses of its servos or
//! motors and waits for the motion that comes of them; a [`JsonBackend`] flies the scenario's aircraft in the scenario's reality between
//! the two. Source of the format: ArduPilot, `libraries/SITL/examples/JSON/readme.md` (2025).

use crate::config::StandInConfig;
use crate::error::StandInError;
use crate::home_position::HomePosition;
use crate::reality::Reality;
use fdm::aircraft::Servos;
use fdm::multirotor::{MotorOutputs, MultirotorSim};
use fdm::{AirAround, Airframe, FdmError, FlightPhase, FlightSim, FlightState};
use rand::SeedableRng as _;
use rand::rngs::ChaCha8Rng;

/// First two bytes of a packet with 16 and with 32 outputs.
const MAGIC: [(u16, usize); 2] = [(18458, 16), (29569, 32)];
/// Bytes before the pulses: magic, rate and count.
const HEADER_BYTES: usize = 8;
/// Rates that are flown, Hz: below, the loops of an autopilot have no hold on the aircraft, and above nothing is gained.
const RATES_HZ: (u16, u16) = (20, 4000);
/// Part of full throttle from which an aircraft on the ground is launched: an autopilot that takes off asks for more,
/// one that is only armed for none.
const LAUNCH_THROTTLE: f64 = 0.5;
/// Period of what changes slowly, wind and air, s.
const SLOW_S: f64 = 0.1;
/// Time between two readings of the gas sensor, s.
const GAS_S: f64 = 0.1;

/// What an autopilot sends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServoPacket {
    /// Steps that the simulator is to make in a second.
    pub rate_hz: u16,
    /// Counts up from packet to packet, and starts again with the autopilot.
    pub count: u32,
    /// Pulses of the outputs, µs.
    pub pulses_us: Vec<u16>,
}

impl ServoPacket {
    /// Reads a datagram.
    ///
    /// # Errors
    /// [`StandInError::ServoPacket`] for one that is none.
    pub fn decode(bytes: &[u8]) -> Result<Self, StandInError> {
        let word = |at: usize| Some(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
        let refuse = |problem: String| StandInError::ServoPacket(problem);
        let magic = word(0).ok_or_else(|| refuse(format!("{} bytes", bytes.len())))?;
        let (_, outputs) = MAGIC
            .into_iter()
            .find(|(known, _)| *known == magic)
            .ok_or_else(|| refuse(format!("its first number is {magic}")))?;
        let all = (word(2), word(4), word(6));
        let pulses: Option<Vec<u16>> = (0..outputs).map(|k| word(HEADER_BYTES + 2 * k)).collect();
        match (all, pulses) {
            ((Some(rate_hz), Some(low), Some(high)), Some(pulses_us)) => Ok(Self {
                rate_hz,
                count: u32::from(high) << 16 | u32::from(low),
                pulses_us,
            }),
            _ => Err(refuse(format!(
                "{} bytes of the {} that {outputs} outputs need",
                bytes.len(),
                HEADER_BYTES + 2 * outputs
            ))),
        }
    }
}

/// A reading of the gas sensor on board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GasReading {
    /// Time since the start, s.
    pub time_s: f64,
    /// Mole fraction, ppm.
    pub ppm: f64,
}

/// What came of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepped {
    /// The aircraft flew on.
    On,
    /// The packet was one that had been answered before.
    Again,
    /// The autopilot has started anew, and the aircraft stands at home again.
    Anew,
}

/// An aircraft in its reality, flown by an autopilot elsewhere.
#[derive(Debug)]
pub struct JsonBackend {
    config: StandInConfig,
    seed: u64,
    flight: Flight,
    last_count: Option<u32>,
}

/// One flight, from the autopilot's start on.
#[derive(Debug)]
struct Flight {
    reality: Reality,
    craft: Craft,
    rng: ChaCha8Rng,
    home: HomePosition,
    time_s: f64,
    slow_s: f64,
    gas_at_s: f64,
    gas: Option<GasReading>,
}

/// The aircraft without an autopilot, and how it reads the pulses of one.
#[derive(Debug)]
enum Craft {
    FixedWing(Box<FlightSim>, Servos),
    Multirotor(Box<MultirotorSim>, MotorOutputs),
}

impl Craft {
    fn on_ground(airframe: &Airframe, home: &HomePosition) -> Result<Self, FdmError> {
        let (north_m, east_m) = (home.at.north_m, home.at.east_m);
        let (ground_amsl_m, heading_deg) = (home.ground_amsl_m, home.heading_deg);
        Ok(match airframe {
            Airframe::FixedWing(aircraft) => {
                let sim =
                    FlightSim::on_ground(aircraft, north_m, east_m, ground_amsl_m, heading_deg)?;
                Self::FixedWing(Box::new(sim), aircraft.servos.unwrap_or_default())
            }
            Airframe::Multirotor(aircraft) => {
                let sim = MultirotorSim::on_ground(
                    aircraft,
                    north_m,
                    east_m,
                    ground_amsl_m,
                    heading_deg,
                )?;
                Self::Multirotor(Box::new(sim), aircraft.motors)
            }
        })
    }

    fn state(&self) -> FlightState {
        match self {
            Self::FixedWing(sim, _) => sim.state(),
            Self::Multirotor(sim, _) => sim.state(),
        }
    }

    fn set_ground_amsl_m(&mut self, ground_amsl_m: f64) {
        match self {
            Self::FixedWing(sim, _) => sim.set_ground_amsl_m(ground_amsl_m),
            Self::Multirotor(sim, _) => sim.set_ground_amsl_m(ground_amsl_m),
        }
    }

    fn step(&mut self, dt_s: f64, around: &AirAround, pulses_us: &[u16]) {
        match self {
            Self::FixedWing(sim, servos) => {
                let mut command = servos.command(pulses_us, &sim.aircraft().surfaces);
                let on_ground = sim.state().phase == FlightPhase::OnGround;
                command.launch = on_ground && command.throttle >= LAUNCH_THROTTLE;
                sim.step(dt_s, around, &command);
            }
            Self::Multirotor(sim, motors) => {
                sim.step_rotors(dt_s, around, &motors.speeds(pulses_us));
            }
        }
    }
}

impl JsonBackend {
    /// The aircraft on the ground at home; the same `seed` has the same gusts and the same noise of the sensor.
    ///
    /// # Errors
    /// [`StandInError::Aircraft`].
    pub fn new(config: StandInConfig, seed: u64) -> Result<Self, StandInError> {
        Ok(Self {
            flight: Flight::new(&config, seed)?,
            config,
            seed,
            last_count: None,
        })
    }

    /// Flies one step as the packet asks for.
    ///
    /// # Errors
    /// [`StandInError::ServoPacket`] for a rate that cannot be flown; nothing has moved then.
    pub fn step(&mut self, packet: &ServoPacket) -> Result<Stepped, StandInError> {
        let (low, high) = RATES_HZ;
        if !(low..=high).contains(&packet.rate_hz) {
            return Err(StandInError::ServoPacket(format!(
                "a rate of {} Hz, expected {low} to {high} (SIM_RATE_HZ)",
                packet.rate_hz
            )));
        }
        let last = self.last_count.replace(packet.count);
        let stepped = match last {
            Some(last) if last == packet.count => return Ok(Stepped::Again),
            Some(last) if packet.count < last => Stepped::Anew,
            _ => Stepped::On,
        };
        if stepped == Stepped::Anew {
            self.flight = Flight::new(&self.config, self.seed)?;
        }
        self.flight.step(packet);
        Ok(stepped)
    }

    /// Time since the autopilot's start, s.
    pub fn time_s(&self) -> f64 {
        self.flight.time_s
    }

    /// What the aircraft does.
    pub fn state(&self) -> FlightState {
        self.flight.craft.state()
    }

    /// The latest reading of its gas sensor, once.
    pub fn take_gas(&mut self) -> Option<GasReading> {
        self.flight.gas.take()
    }

    /// The chemical formula of the gas that it reads.
    pub fn gas_formula(&self) -> &'static str {
        self.flight.reality.gas().formula()
    }

    /// The answer to the latest packet: a line of JSON with motion, attitude, wind and airspeed.
    pub fn answer(&self) -> String {
        let (s, home) = (self.state(), self.flight.home);
        let north_m = s.north_m - home.at.north_m;
        let east_m = s.east_m - home.at.east_m;
        let down_m = home.ground_amsl_m - s.alt_amsl_m;
        let [w, x, y, z] = s.attitude;
        format!(
            concat!(
                "\n{{\"timestamp\":{:.6},\"imu\":{{\"gyro\":{:?},\"accel_body\":{:?}}},",
                "\"position\":{:?},\"quaternion\":{:?},\"velocity\":{:?},",
                "\"velocity_wind\":{:?},\"airspeed\":{:?}}}\n"
            ),
            self.flight.time_s,
            s.rate_rad_s,
            s.specific_force_m_s2,
            [north_m, east_m, down_m],
            [w, x, y, z],
            s.vel_ned_m_s,
            self.flight.reality.around().wind_ned_m_s,
            s.airspeed_m_s
        )
    }
}

impl Flight {
    fn new(config: &StandInConfig, seed: u64) -> Result<Self, StandInError> {
        let home = HomePosition::of(config);
        Ok(Self {
            craft: Craft::on_ground(&config.aircraft, &home)?,
            reality: Reality::of(config),
            rng: ChaCha8Rng::seed_from_u64(seed),
            home,
            time_s: 0.0,
            slow_s: SLOW_S,
            gas_at_s: 0.0,
            gas: None,
        })
    }

    fn step(&mut self, packet: &ServoPacket) {
        let dt_s = 1.0 / f64::from(packet.rate_hz);
        let state = self.craft.state();
        self.slow_s += dt_s;
        if self.slow_s >= SLOW_S {
            self.reality.update_mean_air(&state, self.time_s);
            self.craft
                .set_ground_amsl_m(self.reality.ground_amsl_m(&state));
            self.slow_s = 0.0;
        }
        let around = self
            .reality
            .step_gusts(dt_s, state.airspeed_m_s, &mut self.rng);
        self.craft.step(dt_s, &around, &packet.pulses_us);
        self.time_s += dt_s;
        self.sense_gas();
    }

    fn sense_gas(&mut self) {
        let since_s = self.time_s - self.gas_at_s;
        if since_s >= GAS_S {
            let state = self.craft.state();
            let ppm = self
                .reality
                .read_gas(&state, self.time_s, since_s, &mut self.rng);
            let (_, time_s) = self.reality.logged(&plume::Place::default(), self.time_s);
            self.gas_at_s = self.time_s;
            self.gas = Some(GasReading { time_s, ppm });
        }
    }
}
