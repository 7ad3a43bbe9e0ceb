//! A vehicle that nobody needs hardware for: it behaves like an ArduPlane over MAVLink 2, flies
//! with Plumage's flight dynamics, and does so in a *reality* of its own (wind with gusts, plume,
//! sensor) of which the team learns only what its frames say.
//!
//! Pure: no clock, file, socket, environment or global random number. The time is an argument
//! (`time_boot_ms` counts from the mission's start), the random numbers come from the generator
//! it is made with; the same seed and the same frames in give the same frames out, bit for bit.
//!
//! What it does as ArduPlane does: modes MANUAL, FBWA and their like (flown by sticks), LOITER,
//! CIRCLE, TAKEOFF, GUIDED, RTL, and AUTO for its landing sequence at home; commands and their
//! answers (DO_SET_MODE, NAV_RETURN_TO_LAUNCH, NAV_LOITER_UNLIM, COMPONENT_ARM_DISARM,
//! DO_REPOSITION, DO_CHANGE_SPEED, DO_LAND_START, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL and their
//! older forms; every other one is answered with UNSUPPORTED); parameters by name; the failsafe on
//! loss of the ground station. What it does not: missions (none is on board, none is taken),
//! calibration, terrain following, quadplanes.

mod commands;
mod estimate;
mod flying;
mod listening;
mod parameters;
mod reality;
mod talking;

pub use fdm::autopilot::Sticks;
pub use parameters::Parameters;

use air::geo::{Geodetic, LocalFrame};
use air::isa::Atmosphere;
use air::terrain::Terrain;
use air::wind::WindSeries;
use fdm::{Aircraft, FlightState};
use flying::{Flight, Place};
use mav_bridge::signing::{Signing, SigningConfig};
use mav_bridge::wire::{FrameDecoder, FrameEncoder, LinkStatistics};
use plume::DispersionModel;
use protocol::SimTime;
use rand::rngs::ChaCha8Rng;
use reality::Reality;
use scenario::Scenario;
use talking::Stream;

/// Component id of an autopilot.
const AUTOPILOT: u8 = 1;

/// Why a stand-in cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum StandInError {
    /// The scenario has no vehicle at this place.
    #[error("the scenario has no vehicle number {0}")]
    NoVehicle(usize),
    /// The scenario's reality makes no world.
    #[error("the stand-in's reality: {0}")]
    Reality(String),
    /// The aircraft cannot stand on its launcher at home.
    #[error("the stand-in's aircraft: {0}")]
    Aircraft(#[from] fdm::FdmError),
}

/// Everything a stand-in is made from.
#[derive(Debug, Clone)]
pub struct StandInConfig {
    /// MAVLink system id, 1 to 254.
    pub system_id: u8,
    /// Name of the platform, for mechanisms that apply to one only.
    pub platform: String,
    /// The airframe.
    pub aircraft: Aircraft,
    /// Its reality: wind, air, plume, sensor.
    pub world: DispersionModel,
    /// The site's local frame.
    pub frame: LocalFrame,
    /// Take-off and landing point.
    pub home: Geodetic,
    /// Ground there, m above mean sea level.
    pub home_amsl_m: f64,
    /// Heading of the launch, degrees; into the wind by default.
    pub launch_heading_deg: f64,
    /// Vertical gust over wind at 20 ft, 1 sigma; 0.1 is that of MIL-F-8785C.
    pub turbulence_intensity: f64,
    /// The ground of its reality.
    pub terrain: Terrain,
    /// Wind over time at the profile's height; none: the world's own, constant.
    pub wind_series: Option<WindSeries>,
    /// Settings as ArduPlane's.
    pub parameters: Parameters,
    /// Whether a landing sequence at home is on board.
    pub has_landing_sequence: bool,
    /// Key shared with the ground station; unsigned frames are then refused.
    pub signing: Option<SigningConfig>,
}

impl StandInConfig {
    /// The stand-in for the vehicle at `index` of the scenario's team, in the scenario's
    /// `[reality]`, whose mechanisms of flight change the aircraft. A wind series must be read
    /// and set by the caller.
    ///
    /// # Errors
    /// No such vehicle, or a reality outside the models' validity.
    pub fn from_scenario(
        scenario: &Scenario,
        index: usize,
        aircraft: Aircraft,
    ) -> Result<Self, StandInError> {
        let vehicle = scenario
            .vehicles
            .get(index)
            .ok_or(StandInError::NoVehicle(index))?;
        let refuse = |e: scenario::world::WorldError| StandInError::Reality(e.to_string());
        // The aircraft stands where the team believes its home to be.
        let home = scenario.home(index).map_err(refuse)?;
        let reality = scenario.in_reality();
        let aircraft = reality
            .extend_aircraft(&vehicle.id, &aircraft)
            .map_err(refuse)?;
        let world = reality.world().map_err(refuse)?;
        let home_amsl_m = reality.site.ground_amsl_m;
        let home_air = world.spec().atmosphere.at(home_amsl_m);
        let sea_level = Atmosphere::standard().at(0.0).density_kg_m3();
        let eas_over_tas = (home_air.density_kg_m3() / sea_level).sqrt();
        let limits = aircraft.limits;
        Ok(Self {
            system_id: u8::try_from(index + 1).unwrap_or(1),
            platform: vehicle.id.clone(),
            frame: reality.frame().map_err(refuse)?,
            home,
            home_amsl_m,
            launch_heading_deg: reality.weather.wind_from_deg,
            turbulence_intensity: reality.weather.turbulence_intensity,
            terrain: Terrain::Flat(home_amsl_m),
            wind_series: None,
            parameters: Parameters::new(
                limits.airspeed_min_m_s * eas_over_tas,
                limits.airspeed_max_m_s * eas_over_tas,
                aircraft.control.loiter_radius_m,
            ),
            has_landing_sequence: true,
            signing: None,
            aircraft,
            world,
        })
    }

    /// The same stand-in over `terrain`, on which it then stands at home.
    #[must_use]
    pub fn over(self, terrain: Terrain) -> Self {
        Self {
            home_amsl_m: terrain.ground_amsl_m(self.home),
            terrain,
            ..self
        }
    }
}

/// The vehicle.
#[derive(Debug)]
pub struct StandIn {
    system_id: u8,
    parameters: Parameters,
    has_landing_sequence: bool,
    rng: ChaCha8Rng,
    reality: Reality,
    flight: Flight,
    decoder: FrameDecoder,
    encoder: FrameEncoder,
    signing: Option<Signing>,
    streams: Vec<Stream>,
    /// Messages asked for once.
    asked: Vec<u32>,
    out: Vec<Vec<u8>>,
    last: Option<SimTime>,
    smelt_at: Option<SimTime>,
    ground_heard_at: Option<SimTime>,
    failsafe: bool,
    armed_s: f64,
}

impl StandIn {
    /// A stand-in on the ground at home, disarmed, in MANUAL.
    ///
    /// # Errors
    /// [`StandInError::Aircraft`].
    pub fn new(config: StandInConfig, mut rng: ChaCha8Rng) -> Result<Self, StandInError> {
        let home = Place {
            at: config.frame.to_enu(config.home),
            ground_amsl_m: config.home_amsl_m,
            heading_deg: config.launch_heading_deg,
        };
        let flight = Flight::new(&config.aircraft, home, &mut rng)?;
        Ok(Self {
            reality: Reality::new(
                config.world,
                config.frame,
                config.terrain,
                config.wind_series,
                config.turbulence_intensity,
                &config.platform,
            ),
            flight,
            decoder: FrameDecoder::new(),
            encoder: FrameEncoder::new(config.system_id, AUTOPILOT),
            signing: config.signing.map(Signing::new),
            system_id: config.system_id,
            parameters: config.parameters,
            has_landing_sequence: config.has_landing_sequence,
            rng,
            streams: talking::default_streams(),
            asked: Vec::new(),
            out: Vec::new(),
            last: None,
            smelt_at: None,
            ground_heard_at: None,
            failsafe: false,
            armed_s: 0.0,
        })
    }

    /// Lets time pass to `now` and answers `frames_in` (whole frames, pieces of a stream or
    /// garbage) with the frames it sends. To be called every tick of the mission; time that goes
    /// backwards stands still.
    pub fn step(&mut self, now: SimTime, frames_in: &[Vec<u8>]) -> Vec<Vec<u8>> {
        self.listen(frames_in, now);
        self.guard(now);
        let dt_s = self.last.map_or(0.0, |last| now.since_s(last));
        if dt_s > 0.0 {
            self.flight.fly(
                dt_s,
                now.s(),
                &mut self.reality,
                &self.parameters,
                &mut self.rng,
            );
            if self.flight.armed() {
                self.armed_s += dt_s;
            }
        }
        self.last = Some(self.last.map_or(now, |last| last.max(now)));
        self.talk(now);
        std::mem::take(&mut self.out)
    }

    /// Its safety pilot flips the mode switch to `custom_mode` and holds the sticks so; false if
    /// there is no such mode. Not over MAVLink: a pilot has a radio of his own.
    pub fn pilot(&mut self, custom_mode: u32, sticks: Sticks) -> bool {
        self.flight.set_sticks(sticks);
        self.flight.enter(custom_mode, &self.parameters)
    }

    /// Its safety pilot arms or disarms the motor.
    pub fn arm_by_hand(&mut self, armed: bool) {
        self.flight.set_armed(armed);
    }

    /// Whether its motor may run.
    pub fn is_armed(&self) -> bool {
        self.flight.armed()
    }

    /// The flight mode it is in, as its heartbeat says.
    pub fn custom_mode(&self) -> u32 {
        self.flight.mode()
    }

    /// What it really does. For those who judge a mission afterwards, not for the team.
    pub fn truth(&self) -> FlightState {
        self.flight.state()
    }

    /// What came over its link.
    pub fn link_statistics(&self) -> LinkStatistics {
        self.decoder.statistics()
    }
}
