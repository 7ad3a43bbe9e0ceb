//! The vehicle: what it does when time passes and frames come in.

mod commands;
mod fencing;
mod missions;
mod receiving;
mod telemetry;

use crate::config::StandInConfig;
use crate::error::StandInError;
use crate::fence::{Breach, Fence};
use crate::firmware::Firmware;
use crate::flight::{FlightController, Orders};
use crate::home_position::HomePosition;
use crate::item_list::ItemList;
use crate::reality::Reality;
use crate::speaker::Speaker;
use crate::streams::default_streams;
use fdm::FlightState;
use fdm::autopilot::Sticks;
use mav_bridge::dialect::MavMissionType;
use mav_bridge::signing::Signing;
use protocol::{Pauses, SimTime};
use rand::rngs::ChaCha8Rng;

/// The vehicle.
#[derive(Debug)]
pub struct StandIn {
    speaker: Speaker,
    firmware: &'static Firmware,
    /// Where it was switched on, which is the origin of its filter.
    origin: HomePosition,
    /// Mission, fence and rally points on board.
    lists: [ItemList; 3],
    fence: Fence,
    breach: Option<Breach>,
    rng: ChaCha8Rng,
    reality: Reality,
    flight: FlightController,
    /// The mission item that it last told as the current one.
    told_item: u16,
    last: Option<SimTime>,
    gas_sampled_at: Option<SimTime>,
    gcs_heartbeat_at: Option<SimTime>,
    /// An aircraft's autopilot never pauses; the host of this one may.
    pauses: Pauses,
    failsafe: bool,
    armed_s: f64,
}

impl StandIn {
    /// A stand-in on the ground at home, disarmed, in MANUAL.
    ///
    /// # Errors
    /// [`StandInError::Aircraft`].
    pub fn new(config: StandInConfig, mut rng: ChaCha8Rng) -> Result<Self, StandInError> {
        let home = HomePosition::of(&config);
        let firmware = Firmware::of(config.aircraft.hovers());
        let flight = FlightController::new(&config.aircraft, home, &mut rng)?;
        let mission = if config.has_landing_sequence {
            missions::landing_at(config.home)
        } else {
            Vec::new()
        };
        Ok(Self {
            reality: Reality::of(&config),
            flight,
            firmware,
            speaker: Speaker::new(
                config.system_id,
                config.parameters,
                default_streams(),
                firmware,
                config.signing.map(Signing::new),
            ),
            origin: home,
            lists: [
                ItemList::new(MavMissionType::MAV_MISSION_TYPE_MISSION, mission),
                ItemList::new(MavMissionType::MAV_MISSION_TYPE_FENCE, Vec::new()),
                ItemList::new(MavMissionType::MAV_MISSION_TYPE_RALLY, Vec::new()),
            ],
            fence: Fence::default(),
            breach: None,
            rng,
            told_item: 0,
            last: None,
            gas_sampled_at: None,
            gcs_heartbeat_at: None,
            pauses: Pauses::default(),
            failsafe: false,
            armed_s: 0.0,
        })
    }

    /// Lets time pass to `now` and answers `frames_in` (whole frames, pieces of a stream or
    /// garbage) with the frames it sends. To be called every tick of the mission; time that goes
    /// backwards stands still.
    pub fn step(&mut self, now: SimTime, frames_in: &[Vec<u8>]) -> Vec<Vec<u8>> {
        self.receive(frames_in, now);
        self.remind_uploads(now);
        self.check_gcs_failsafe(now);
        self.check_fence(now);
        let dt_s = self.last.map_or(0.0, |last| now.since_s(last));
        if dt_s > 0.0 {
            self.flight.advance(
                dt_s,
                now.s(),
                &mut self.reality,
                &Orders::new(&self.speaker.parameters, &self.lists),
                &mut self.rng,
            );
            if self.flight.armed() {
                self.armed_s += dt_s;
            }
        }
        self.tell_mission(now);
        self.last = Some(self.last.map_or(now, |last| last.max(now)));
        self.send_due(now);
        self.speaker.take_frames()
    }

    /// Its safety pilot flips the mode switch to `custom_mode` and holds the sticks so; false if
    /// there is no such mode. Not over MAVLink: a pilot has a radio of his own.
    pub fn pilot(&mut self, custom_mode: u32, sticks: Sticks) -> bool {
        self.flight.set_sticks(sticks);
        let mode = self.firmware.inside(custom_mode);
        mode.is_some_and(|mode| self.flight.set_mode(mode, &self.speaker.parameters))
    }

    /// Its safety pilot arms or disarms the motor.
    pub fn arm_by_hand(&mut self, armed: bool) {
        self.flight.set_armed(armed);
    }

    /// Whether its motor may run.
    pub fn is_armed(&self) -> bool {
        self.flight.armed()
    }

    /// Its MAVLink system.
    pub fn system_id(&self) -> u8 {
        self.speaker.system_id
    }

    /// The flight mode it is in, as in its heartbeat.
    pub fn custom_mode(&self) -> u32 {
        self.firmware.on_wire(self.flight.mode())
    }

    /// What it really does. For those who judge a mission afterwards, not for the team.
    pub fn truth(&self) -> FlightState {
        self.flight.state()
    }
}
