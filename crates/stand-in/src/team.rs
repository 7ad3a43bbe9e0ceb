//! A vehicle of the team as any ground station sees it: an ArduPlane or ArduCopter of its own, whatever flies it.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use crate::firmware::Firmware;
use crate::flight::{Guidance, is_manual};
use crate::home_position::HomePosition;
use crate::item_list::Item;
use crate::mission_run::{Place, altitude_amsl_m};
use crate::parameters::AutopilotParameters;
use crate::report::{Report, boot_ms};
use crate::speaker::Speaker;
use crate::streams::team_streams;
use air::geo::{Enu, Geodetic, LocalFrame, wrap_signed_deg};
use air::isa::Atmosphere;
use fdm::FlightState;
use fdm::autopilot::Sensed;
use mav_bridge::arducopter;
use mav_bridge::arduplane::{AUTO, FBWA, GUIDED, LOITER, MANUAL, RTL};
use mav_bridge::dialect::{
    COMMAND_INT_DATA, MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_CURRENT_DATA, MavCmd,
    MavMessage, MavMissionResult, MavMissionType, MavResult, MavSeverity, NAMED_VALUE_FLOAT_DATA,
};
use mav_bridge::wire::{MessageData as _, RawFrame};
use plume::Gas;
use protocol::SimTime;
use protocol::message::{
    Control, ControlLevel, ControlWish, Destination, Mode, Model, Peak, PeakStatus, Reading, State,
    Sticks, VehicleKind,
};
use scenario::Scenario;
use scenario::bounds::Bounds;

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_DENIED as DENIED, MAV_RESULT_FAILED as FAILED,
    MAV_RESULT_UNSUPPORTED as UNSUPPORTED,
};

/// Modes that a ground station may choose: by hand, back to the squadron controller, home.
const MODES: [(u32, &str); 5] = [
    (MANUAL, "Manual"),
    (FBWA, "FBWA"),
    (AUTO, "Auto"),
    (RTL, "RTL"),
    (GUIDED, "Guided"),
];
/// Name of the direction towards which the plume's axis runs, degrees.
const PLUME_AXIS: &str = "PLUMEAXIS";
/// Concentrations from here on are told without decimals, ppm.
const WHOLE_PPM: f64 = 100.0;

/// A fixed wing of the team is shown as an ArduPlane.
static PLANE: Firmware = Firmware::plane(&MODES);
/// A multirotor of the team is shown as an ArduCopter.
static COPTER: Firmware = Firmware::copter(
    &[
        (arducopter::STABILIZE, "Stabilize"),
        (arducopter::ALT_HOLD, "AltHold"),
        (arducopter::AUTO, "Auto"),
        (arducopter::RTL, "RTL"),
        (arducopter::GUIDED, "Guided"),
    ],
    &[
        (arducopter::STABILIZE, MANUAL),
        (arducopter::ALT_HOLD, FBWA),
        (arducopter::AUTO, AUTO),
        (arducopter::RTL, RTL),
        (arducopter::GUIDED, GUIDED),
        // Shown to ground stations, which cannot select it.
        (arducopter::LOITER, LOITER),
    ],
);

/// What a ground station wants of a vehicle of the team.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TeamWish {
    /// Who shall fly it.
    Control(Control),
    /// Where it shall fly, once it has been taken over.
    SendTo(Destination),
}

/// Sticks let go: level flight at a little more than half power.
const CENTRED: Sticks = Sticks {
    roll: 0.0,
    pitch: 0.0,
    throttle: 0.55,
};

/// A vehicle of the team, simulated or real, as an ArduPlane or ArduCopter on a link.
///
/// It receives the vehicle's messages from the bus, and returns the requests of ground stations as the controls that the page
/// and `plumage control` send too. While the squadron controller flies the vehicle, it is in GUIDED. Under a pilot it is in
/// FBWA (ArduCopter: ALT_HOLD), or in LOITER once the pilot has sent it to a position; under the Guardian in RTL.
#[derive(Debug)]
pub struct TeamVehicle {
    speaker: Speaker,
    firmware: &'static Firmware,
    frame: LocalFrame,
    home: HomePosition,
    /// Where it goes, as it looks at each place itself.
    bounds: Bounds,
    atmosphere: Atmosphere,
    cruise_m_s: f64,
    gas: Gas,
    state: Option<State>,
    reading: Option<Reading>,
    /// Direction towards which the plume's axis runs, degrees, by the team's model.
    axis_deg: Option<f64>,
    /// The team's conclusion on the peak, where it has one.
    peak: Option<Peak>,
    /// The conclusion that ground stations know.
    told: Option<PeakStatus>,
    level: ControlLevel,
    sticks: Sticks,
    wishes: Vec<TeamWish>,
    /// It was sent somewhere when it was taken over.
    sent: bool,
}

impl TeamVehicle {
    /// The vehicle at `index` of the scenario's team, whose number, counted from 1, is its system id;
    /// `home_amsl_m` is the ground at its home. None where there is no such vehicle, or no system id
    /// left for it.
    pub fn new(
        scenario: &Scenario,
        index: usize,
        aircraft: &fdm::Airframe,
        home_amsl_m: f64,
    ) -> Option<Self> {
        let system_id = u8::try_from(index + 1).ok().filter(|&id| id < 255)?;
        let frame = scenario.frame().ok()?;
        let atmosphere = scenario.atmosphere().ok()?;
        let speeds = aircraft.speeds();
        let eas_over_tas = atmosphere.at(home_amsl_m).eas_over_tas();
        let parameters = if aircraft.hovers() {
            AutopilotParameters::of_multirotor()
        } else {
            AutopilotParameters::new(
                speeds.min_m_s * eas_over_tas,
                speeds.max_m_s * eas_over_tas,
                aircraft.loiter_radius_m(),
            )
        };
        let firmware = if aircraft.hovers() { &COPTER } else { &PLANE };
        Some(Self {
            speaker: Speaker::new(system_id, parameters, team_streams(), firmware, None),
            firmware,
            home: HomePosition {
                at: frame.to_enu(scenario.home(index).ok()?),
                ground_amsl_m: home_amsl_m,
                heading_deg: 0.0,
            },
            bounds: Bounds::of(scenario, index).ok()?,
            frame,
            atmosphere,
            cruise_m_s: speeds.cruise_m_s,
            gas: scenario.gas(),
            state: None,
            reading: None,
            axis_deg: None,
            peak: None,
            told: None,
            level: ControlLevel::Automatic,
            sticks: CENTRED,
            wishes: Vec::new(),
            sent: false,
        })
    }

    /// The bus says where it is.
    pub fn state(&mut self, state: &State) {
        self.state = Some(state.clone());
    }

    /// The bus says what it reads.
    pub fn reading(&mut self, reading: &Reading) {
        self.reading = Some(reading.clone());
    }

    /// Takes over the plume's model, as `ws` publishes it.
    pub fn model(&mut self, model: &Model) {
        self.axis_deg = Some(model.axis_deg.value);
        self.peak = model.peak;
    }

    /// The bus says who flies it.
    pub fn mode(&mut self, mode: &Mode) {
        self.level = mode.level;
    }

    /// What ground stations want of it since the last call.
    pub fn take_wishes(&mut self) -> Vec<TeamWish> {
        std::mem::take(&mut self.wishes)
    }

    /// Answers `frames_in`, of which others may be meant, with the frames that it sends; nothing
    /// before its first state is known.
    pub fn step(&mut self, now: SimTime, frames_in: &[Vec<u8>]) -> Vec<Vec<u8>> {
        for frame in self.speaker.hear(frames_in, now) {
            if let Some(message) = frame.message() {
                self.handle(&frame, &message, now);
            } else if let Some((target, command)) = frame.command_number()
                && self.speaker.is_addressed(target)
            {
                self.speaker.acknowledge(command, UNSUPPORTED, now);
            }
        }
        if let Some(state) = self.state.clone() {
            let due = self.speaker.due(now);
            if !due.is_empty() {
                self.tell(&due, &state, now);
            }
            self.tell_conclusion(now);
        }
        self.speaker.take_frames()
    }

    /// Tells the team's conclusion on the peak when it becomes another one.
    fn tell_conclusion(&mut self, now: SimTime) {
        let Some(peak) = self.peak else { return };
        let word = match peak.status {
            PeakStatus::Confirmed => "confirmed",
            PeakStatus::Supported => "supported",
            PeakStatus::Doubtful if self.told.is_some() => "doubtful",
            // Before the first reading of a plume there is no conclusion.
            PeakStatus::Doubtful | PeakStatus::NotFound => return,
        };
        if self.told.replace(peak.status) == Some(peak.status) {
            return;
        }
        let digits = if peak.co2_ppm >= WHOLE_PPM { 0 } else { 2 };
        let gas = self.gas.formula();
        let text = format!(
            "{gas} peak {:.digits$} +- {:.digits$} ppm: {word}",
            peak.co2_ppm, peak.sd_ppm
        );
        self.speaker
            .send_text(MavSeverity::MAV_SEVERITY_NOTICE, &text, now);
    }

    /// Tells a number by its name.
    fn tell_value(&mut self, name: &str, value: f64, at: SimTime, now: SimTime) {
        let value = NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: boot_ms(at.s()),
            value: value as f32,
            name: name.into(),
        };
        self.speaker.send(&value, now);
    }

    fn tell(&mut self, due: &[(u32, u32)], state: &State, now: SimTime) {
        let report = self.report(state, now);
        for &(message_id, which) in due {
            if message_id != NAMED_VALUE_FLOAT_DATA::ID {
                self.speaker.tell(message_id, which, &report);
                continue;
            }
            if let Some(reading) = &self.reading {
                let (ppm, read_at) = (reading.co2_ppm, reading.read_at(now));
                self.tell_value(self.gas.formula(), ppm, read_at, now);
            }
            if let Some(axis_deg) = self.axis_deg {
                self.tell_value(PLUME_AXIS, axis_deg, now, now);
            }
        }
    }

    /// The mode that ground stations see, as ArduPlane's number.
    fn custom_mode(&self) -> u32 {
        match self.level {
            ControlLevel::Automatic => GUIDED,
            ControlLevel::Pilot if self.sent => LOITER,
            ControlLevel::Pilot => FBWA,
            ControlLevel::Guardian => RTL,
        }
    }

    fn report(&self, state: &State, now: SimTime) -> Report {
        let air = self.atmosphere.at(state.alt_amsl_m);
        let at = self
            .frame
            .to_enu(Geodetic::new(state.lat_deg, state.lon_deg));
        let flight = flight_state(state, at);
        let wind_m_s = self.reading.as_ref().and_then(|reading| {
            let speed_m_s = reading.wind_speed_m_s?;
            let (sin, cos) = reading.wind_from_deg?.to_radians().sin_cos();
            Some([-speed_m_s * cos, -speed_m_s * sin])
        });
        Report {
            now,
            system_id: self.speaker.system_id,
            frame: self.frame,
            mode: self.custom_mode(),
            firmware: self.firmware,
            armed: state.airborne || state.throttle > 0.0,
            flying: state.airborne,
            landing: false,
            failsafe: self.level == ControlLevel::Guardian,
            sensed: Sensed::perfect(&flight, air.density_kg_m3()),
            state: flight,
            reported: (at, state.alt_amsl_m),
            here: Place {
                at,
                alt_amsl_m: state.alt_amsl_m,
            },
            home: self.home,
            origin: self.home,
            wind_m_s,
            eas_over_tas: self.atmosphere.at(state.alt_amsl_m).eas_over_tas(),
            air,
            sticks: fdm::autopilot::Sticks {
                roll: self.sticks.roll,
                pitch: self.sticks.pitch,
                throttle: self.sticks.throttle,
            },
            guidance: Guidance {
                bank_rad: state.roll_deg.to_radians(),
                pitch_rad: state.pitch_deg.to_radians(),
                target: None,
                across_m: 0.0,
                airspeed_m_s: self.cruise_m_s,
            },
            // Not said on the bus.
            charge: (u16::MAX, -1),
            fence_present: false,
            fence_on: false,
            fence_breached: false,
            fence_status: None,
            mission_current: MISSION_CURRENT_DATA::default(),
        }
    }

    fn handle(&mut self, frame: &RawFrame, message: &MavMessage, now: SimTime) {
        match message {
            MavMessage::COMMAND_LONG(m) if self.speaker.is_addressed(m.target_system) => {
                // A place in whole numbers is exact; one in floats is not.
                if m.command == MavCmd::MAV_CMD_DO_REPOSITION {
                    return self.speaker.acknowledge(m.command as u16, UNSUPPORTED, now);
                }
                let whole = COMMAND_INT_DATA {
                    param1: m.param1,
                    param2: m.param2,
                    param3: m.param3,
                    param4: m.param4,
                    command: m.command,
                    ..COMMAND_INT_DATA::default()
                };
                self.command(&whole, now);
            }
            MavMessage::COMMAND_INT(m) if self.speaker.is_addressed(m.target_system) => {
                self.command(m, now);
            }
            MavMessage::SET_MODE(m) if self.speaker.is_addressed(m.target_system) => {
                // Obeyed without an answer, as by ArduPlane 4.8.
                self.choose_mode(m.custom_mode, now);
            }
            // Sticks are for one vehicle, never for all.
            MavMessage::MANUAL_CONTROL(m) if m.target == self.speaker.system_id => {
                let share = |v: i16| f64::from(v) / 1000.0;
                self.fly_by(Sticks {
                    roll: share(m.y),
                    pitch: -share(m.x),
                    throttle: share(m.z),
                });
            }
            message => {
                if !self.speaker.answer(frame, message, now) {
                    self.refuse_missions(frame, message, now);
                }
            }
        }
    }

    fn command(&mut self, m: &COMMAND_INT_DATA, now: SimTime) {
        let result = match m.command {
            MavCmd::MAV_CMD_DO_SET_MODE if m.param1 as u8 & 1 == 0 => DENIED,
            MavCmd::MAV_CMD_DO_SET_MODE => self.choose_mode(m.param2 as u32, now),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => self.change_mode(RTL, now),
            MavCmd::MAV_CMD_DO_REPOSITION => self.reposition(m, now),
            // Its speed and its motor are the squadron controller's.
            MavCmd::MAV_CMD_DO_CHANGE_SPEED
            | MavCmd::MAV_CMD_COMPONENT_ARM_DISARM
            | MavCmd::MAV_CMD_MISSION_START
            | MavCmd::MAV_CMD_DO_LAND_START => {
                let by_hand = self.firmware.mode_name(FBWA);
                let text = format!("Squadron controller flies: take over by {by_hand}");
                self.warn(&text, now);
                FAILED
            }
            _ => self.speaker.obey(m, now).unwrap_or(UNSUPPORTED),
        };
        self.speaker.acknowledge(m.command as u16, result, now);
    }

    fn warn(&mut self, text: &str, now: SimTime) {
        let warning = MavSeverity::MAV_SEVERITY_WARNING;
        self.speaker.send_text(warning, text, now);
    }

    /// Whether nobody but its own pilot takes it over; said, if so.
    fn is_out_of_reach(&mut self, now: SimTime) -> bool {
        let is_real = self.state.as_ref().map(|s| s.kind) == Some(VehicleKind::Real);
        if is_real {
            self.warn("Real vehicle: take over by its own remote control", now);
        }
        is_real
    }

    /// Takes it over and sends it to a place on Earth above its home, where it then circles.
    fn reposition(&mut self, m: &COMMAND_INT_DATA, now: SimTime) -> MavResult {
        let on_earth = m.x.abs() <= 900_000_000 && i64::from(m.y).abs() <= 1_800_000_000;
        let ground_amsl_m = self.home.ground_amsl_m;
        let alt_amsl_m = altitude_amsl_m(m.frame as u8, m.z, self.home, || ground_amsl_m);
        let Some(alt_amsl_m) = alt_amsl_m.filter(|alt_m| *alt_m > ground_amsl_m) else {
            return DENIED;
        };
        if !on_earth || (m.x, m.y) == (0, 0) {
            return DENIED;
        }
        if self.is_out_of_reach(now) {
            return FAILED;
        }
        let to = Geodetic::new(f64::from(m.x) / 1e7, f64::from(m.y) / 1e7);
        if let Some(why) = self.bounds.refuses(to, alt_amsl_m) {
            self.warn(&format!("Rejected: {why}"), now);
            return DENIED;
        }
        if self.level != ControlLevel::Pilot {
            self.wish(ControlWish::TakeOver);
        }
        self.sent = true;
        self.wishes.push(TeamWish::SendTo(Destination {
            lat_deg: to.lat_deg,
            lon_deg: to.lon_deg,
            alt_amsl_m,
        }));
        ACCEPTED
    }

    fn wish(&mut self, wish: ControlWish) {
        self.sticks = CENTRED;
        self.sent = false;
        self.wishes
            .push(TeamWish::Control(Control { wish, sticks: None }));
    }

    /// Changes to the mode with this number on the link.
    fn choose_mode(&mut self, on_wire: u32, now: SimTime) -> MavResult {
        match self.firmware.inside(on_wire) {
            Some(mode) => self.change_mode(mode, now),
            None => FAILED,
        }
    }

    /// A mode of the sticks takes it over, RTL calls it home, GUIDED or AUTO gives it back.
    fn change_mode(&mut self, mode: u32, now: SimTime) -> MavResult {
        let wish = match mode {
            GUIDED | AUTO => ControlWish::HandBack,
            RTL => ControlWish::Home,
            mode if is_manual(mode) && self.is_out_of_reach(now) => return FAILED,
            mode if is_manual(mode) => ControlWish::TakeOver,
            _ => return FAILED,
        };
        self.wish(wish);
        ACCEPTED
    }

    /// Sticks fly it once it has been taken over.
    fn fly_by(&mut self, sticks: Sticks) {
        if self.level == ControlLevel::Pilot {
            self.sticks = sticks;
            self.sent = false;
            self.wishes.push(TeamWish::Control(Control {
                wish: ControlWish::TakeOver,
                sticks: Some(sticks),
            }));
        }
    }

    /// There are no missions, fences and rally points, and none are taken.
    fn refuse_missions(&mut self, frame: &RawFrame, message: &MavMessage, now: SimTime) {
        let (target_system, target_component) = (frame.system_id(), frame.component_id());
        let here = |target: u8| self.speaker.is_addressed(target);
        let (kind, asked) = match message {
            MavMessage::MISSION_REQUEST_LIST(m) if here(m.target_system) => (m.mission_type, true),
            MavMessage::MISSION_COUNT(m) if here(m.target_system) => (m.mission_type, false),
            MavMessage::MISSION_CLEAR_ALL(m) if here(m.target_system) => (m.mission_type, false),
            MavMessage::MISSION_ITEM_INT(m) if here(m.target_system) => {
                let item: &Item = m;
                (item.mission_type, false)
            }
            _ => return,
        };
        if asked {
            let none = MISSION_COUNT_DATA {
                target_system,
                target_component,
                mission_type: kind,
                ..MISSION_COUNT_DATA::default()
            };
            return self.speaker.send(&none, now);
        }
        let kind: MavMissionType = kind;
        let ack = MISSION_ACK_DATA {
            target_system,
            target_component,
            mavtype: MavMissionResult::MAV_MISSION_DENIED,
            mission_type: kind,
            ..MISSION_ACK_DATA::default()
        };
        self.speaker.send(&ack, now);
    }
}

/// As much of a flight as the bus tells.
fn flight_state(state: &State, at: Enu) -> FlightState {
    let heading_deg = wrap_signed_deg(state.heading_deg);
    FlightState::seen(
        [at.north_m, at.east_m, state.alt_amsl_m],
        state.vel_ned_m_s,
        [state.roll_deg, state.pitch_deg, heading_deg].map(f64::to_radians),
        state.airspeed_m_s,
        state.throttle,
        state.airborne,
    )
}
