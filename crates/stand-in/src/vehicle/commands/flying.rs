//! Commands that lead the vehicle: to a place, an altitude, a speed, a course.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use crate::mission_run::{Place, altitude_amsl_m};
use crate::parameters::{MIN_GROUNDSPEED, WP_LOITER_RAD};
use crate::vehicle::StandIn;
use air::geo::Enu;
use mav_bridge::arduplane::{AUTO, GUIDED};
use mav_bridge::dialect::{
    COMMAND_INT_DATA, HOME_POSITION_DATA, MavCmd, MavFrame, MavResult, MavSeverity,
};
use mav_bridge::wire::MessageData as _;
use protocol::SimTime;

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_DENIED as DENIED, MAV_RESULT_FAILED as FAILED,
    MAV_RESULT_UNSUPPORTED as UNSUPPORTED,
};

/// SPEED_TYPE of MAVLink.
const AIRSPEED: f32 = 0.0;
const GROUND_SPEED: f32 = 1.0;

impl StandIn {
    /// Altitude of `z` in a frame of MAVLink at a place; none for a frame without altitude.
    fn altitude_at_m(&self, frame: MavFrame, z_m: f32, at: Enu) -> Option<f64> {
        let ground = || self.reality.ground_at_amsl_m(at);
        altitude_amsl_m(frame as u8, z_m, self.flight.home(), ground).filter(|alt| alt.is_finite())
    }

    /// Altitude of `z` in a frame of MAVLink where the vehicle is.
    pub(in crate::vehicle) fn altitude_here_m(&self, frame: MavFrame, z_m: f32) -> Option<f64> {
        self.altitude_at_m(frame, z_m, self.flight.here().at)
    }

    /// A place on Earth other than the null island, with its altitude.
    fn place(&self, m: &COMMAND_INT_DATA) -> Option<Place> {
        let on_earth = m.x.abs() <= 900_000_000 && i64::from(m.y).abs() <= 1_800_000_000;
        if !on_earth || (m.x, m.y) == (0, 0) {
            return None;
        }
        let at = crate::fence::local((m.x, m.y), &self.reality.frame);
        let alt_amsl_m = self.altitude_at_m(m.frame, m.z, at)?;
        Some(Place { at, alt_amsl_m })
    }

    /// Has GUIDED circle a place; radius 0 is the usual one.
    pub(in crate::vehicle) fn fly_around(&mut self, at: Enu, radius_m: f64, clockwise: bool) {
        let usual_m = self.speaker.parameters.get(WP_LOITER_RAD).abs();
        let radius_m = if radius_m > 0.0 { radius_m } else { usual_m };
        self.flight.set_orbit(at, radius_m, clockwise);
    }

    pub(super) fn reposition(&mut self, m: &COMMAND_INT_DATA) -> MavResult {
        let Some(place) = self.place(m) else {
            return DENIED;
        };
        // ArduPlane refuses home's own height; what lies lower is refused here, too.
        let lowest_m = self.reality.ground_at_amsl_m(place.at);
        let fenced_off = self.fence_is_on() && !self.fence.allows(place.at, &self.reality.frame);
        if place.alt_amsl_m <= lowest_m || fenced_off || self.is_height_of_home(m) {
            return DENIED;
        }
        // MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        if m.param2 as u8 & 1 != 0 {
            self.change_mode(GUIDED);
        }
        if self.flight.mode() != GUIDED {
            return FAILED;
        }
        let clockwise = m.param4.is_nan() || m.param4 == 0.0;
        self.fly_around(place.at, f64::from(m.param3), clockwise);
        self.flight.set_altitude(place.alt_amsl_m);
        ACCEPTED
    }

    fn is_height_of_home(&self, m: &COMMAND_INT_DATA) -> bool {
        let relative = matches!(
            m.frame,
            MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        );
        relative && m.z == 0.0
    }

    /// The altitude in param1 and its frame in param2.
    pub(super) fn change_altitude(&mut self, z_m: f32, frame: f32) -> MavResult {
        let frames = [
            MavFrame::MAV_FRAME_GLOBAL,
            MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
            MavFrame::MAV_FRAME_GLOBAL_INT,
            MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT,
            MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
        ];
        let frame = frames.into_iter().find(|&f| f as u8 as f32 == frame);
        match frame.and_then(|frame| self.altitude_here_m(frame, z_m)) {
            Some(alt_amsl_m) => {
                self.flight.set_altitude(alt_amsl_m);
                ACCEPTED
            }
            None => DENIED,
        }
    }

    /// ArduPlane takes airspeed as equivalent airspeed, and a ground speed as the least one.
    pub(super) fn change_speed(&mut self, kind: f32, speed_m_s: f32, now: SimTime) -> MavResult {
        if ![GUIDED, AUTO].contains(&self.flight.mode()) {
            return FAILED;
        }
        if self.flight.hovers() {
            // ArduCopter takes either as a speed over ground, and says nothing of it.
            let level = kind == AIRSPEED || kind == GROUND_SPEED;
            return if level && self.set_airspeed(speed_m_s) {
                ACCEPTED
            } else {
                DENIED
            };
        }
        let info = MavSeverity::MAV_SEVERITY_INFO;
        if kind == AIRSPEED && self.set_airspeed(speed_m_s) {
            self.send_text(info, &format!("Set airspeed {speed_m_s:.0} m/s"), now);
            return ACCEPTED;
        }
        if kind == GROUND_SPEED && self.speaker.parameters.set(MIN_GROUNDSPEED, speed_m_s) {
            self.send_text(info, &format!("Set groundspeed {speed_m_s:.0}"), now);
            return ACCEPTED;
        }
        FAILED
    }

    fn set_airspeed(&mut self, eas_m_s: f32) -> bool {
        let eas_over_tas = self.reality.eas_over_tas();
        self.flight
            .set_airspeed(f64::from(eas_m_s), eas_over_tas, &self.speaker.parameters)
    }

    /// The commands that GUIDED has of its own.
    pub(super) fn guide(&mut self, m: &COMMAND_INT_DATA) -> MavResult {
        if self.flight.mode() != GUIDED {
            return FAILED;
        }
        match m.command {
            MavCmd::MAV_CMD_GUIDED_CHANGE_SPEED if m.param1 != AIRSPEED => DENIED,
            MavCmd::MAV_CMD_GUIDED_CHANGE_SPEED if self.set_airspeed(m.param2) => ACCEPTED,
            MavCmd::MAV_CMD_GUIDED_CHANGE_SPEED => FAILED,
            MavCmd::MAV_CMD_GUIDED_CHANGE_ALTITUDE if m.z == 0.0 || m.z == -1.0 => DENIED,
            MavCmd::MAV_CMD_GUIDED_CHANGE_ALTITUDE => {
                self.change_altitude(m.z, f32::from(m.frame as u8))
            }
            MavCmd::MAV_CMD_GUIDED_CHANGE_HEADING => self.turn_to(m.param1, m.param2),
            _ => UNSUPPORTED,
        }
    }

    /// `kind` 0 is a course over ground, 1 a heading.
    fn turn_to(&mut self, kind: f32, deg: f32) -> MavResult {
        if !(0.0..360.0).contains(&deg) || ![0.0, 1.0].contains(&kind) {
            return DENIED;
        }
        self.flight.set_direction(f64::from(deg), kind == 0.0);
        ACCEPTED
    }

    pub(super) fn change_home(&mut self, m: &COMMAND_INT_DATA, now: SimTime) -> MavResult {
        let here = m.param1 == 1.0 || (m.x, m.y) == (0, 0);
        let place = if here {
            Some(self.flight.here())
        } else {
            self.place(m)
        };
        let Some(place) = place else {
            return DENIED;
        };
        self.flight.set_home(place);
        let info = MavSeverity::MAV_SEVERITY_INFO;
        self.send_text(info, "Home set", now);
        self.speaker.request_once(HOME_POSITION_DATA::ID, 0)
    }

    /// Sticks moved by a ground station, each from -1 to 1 or throttle from 0 to 1; none leaves one
    /// as it is. They fly in the modes that are flown by hand.
    pub(in crate::vehicle) fn move_sticks(
        &mut self,
        roll: Option<f64>,
        pitch: Option<f64>,
        throttle: Option<f64>,
    ) {
        let mut sticks = self.flight.sticks();
        sticks.roll = roll.unwrap_or(sticks.roll);
        sticks.pitch = pitch.unwrap_or(sticks.pitch);
        sticks.throttle = throttle.unwrap_or(sticks.throttle);
        self.flight.set_sticks(sticks);
    }
}
