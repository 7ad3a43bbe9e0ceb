//! The team's own outer loop flies the vehicle: bank, pitch and throttle instead of places.

use super::{Bridge, BridgeOutput};
use crate::authority::BridgePhase;
use crate::dialect::{AttitudeTargetTypemask, SET_ATTITUDE_TARGET_DATA};
use crate::event::event;
use protocol::SimTime;
use protocol::message::{Setpoint, Severity};

/// Rate at which position, attitude and airspeed are asked for where they steer it, 1/s: twice the least at which
/// attitudes have to follow each other.
pub(super) const STEERING_HZ: f64 = 20.0;
/// A vehicle that has had no attitude for this long is told of, s; ArduPlane goes on by itself after 3 s
/// (`mode_guided.cpp`), PX4 after COM_OF_LOSS_T.
const PAUSE_S: f64 = 0.5;
/// How long attitudes are sent to a vehicle that wants them before it takes the mode in which they count, s: more than
/// the second that PX4 asks for.
const BEFORE_S: f64 = 1.5;

/// Command of the outer loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeTarget {
    /// Roll angle, rad.
    pub roll_rad: f64,
    /// Pitch angle, rad.
    pub pitch_rad: f64,
    /// Yaw angle, rad: where its nose points; only a frame for the two others.
    pub yaw_rad: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
}

/// State of the attitude stream.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stream {
    /// Since when it has not paused.
    since: Option<SimTime>,
    last: Option<SimTime>,
    told: bool,
}

impl Bridge {
    /// The setpoint that the team's outer loop is to fly the vehicle to now; none while it flies by itself, somebody
    /// else flies it, or no setpoint was given.
    pub fn steers_to(&self) -> Option<&Setpoint> {
        let guided = self.authority.phase() == BridgePhase::Guided;
        self.target
            .as_ref()
            .filter(|_| guided && self.takes_attitudes())
    }

    /// Whether the team's outer loop flies the vehicle, or attitudes have to be there before it may.
    pub fn takes_attitudes(&self) -> bool {
        let phase = match self.authority.phase() {
            BridgePhase::Guided => true,
            // A climb is not steered, but the stream has to be there before the mode.
            BridgePhase::TakeOff => self.streams_first() && self.has_climbed(),
            BridgePhase::HandingBack => self.streams_first(),
            _ => false,
        };
        phase
            && self.config.attitude_targets
            && !self.config.dry_run
            && self.authority.link_up()
            && self.identity.is_certain()
            && self.checklist.is_done()
    }

    fn streams_first(&self) -> bool {
        self.config.attitude_targets && self.config.profile.modes.attitudes_first
    }

    /// Passes on what the outer loop asks for; nothing is sent unless [`Bridge::takes_attitudes`], nor of numbers that
    /// are none. To be called as often as the vehicle tells of itself, ten times a second or more.
    pub fn attitude(&mut self, target: &AttitudeTarget, now: SimTime, out: &mut BridgeOutput) {
        let AttitudeTarget {
            roll_rad,
            pitch_rad,
            yaw_rad,
            throttle,
        } = *target;
        let sound = [roll_rad, pitch_rad, yaw_rad, throttle]
            .iter()
            .all(|v| v.is_finite());
        let Some((system, component)) = self.identity.address() else {
            return;
        };
        if !sound || !self.takes_attitudes() {
            return;
        }
        let paused = self.stream.last.is_none_or(|at| now.since_s(at) > PAUSE_S);
        if paused {
            self.stream.since = Some(now);
        }
        (self.stream.last, self.stream.told) = (Some(now), false);
        let message = SET_ATTITUDE_TARGET_DATA {
            time_boot_ms: self.boot_ms,
            q: quaternion(roll_rad, pitch_rad, yaw_rad),
            thrust: throttle.clamp(0.0, 1.0) as f32,
            target_system: system,
            target_component: component,
            type_mask: AttitudeTargetTypemask::from_bits_truncate(
                self.config.profile.commands.attitude_mask,
            ),
            ..SET_ATTITUDE_TARGET_DATA::default()
        };
        self.send(&message, now, out);
    }

    /// Whether the mode in which attitudes count may be asked for: they were sent for long enough, where the vehicle
    /// wants that.
    pub(super) fn attitudes_are_there(&self, now: SimTime) -> bool {
        let lasts = |at: SimTime| now.since_s(at) <= PAUSE_S;
        let there = |since: SimTime| now.since_s(since) >= BEFORE_S;
        !self.streams_first()
            || (self.stream.last.is_some_and(lasts) && self.stream.since.is_some_and(there))
    }

    /// Reports when the outer loop has no telemetry.
    pub(super) fn check_attitudes(&mut self, now: SimTime, out: &mut BridgeOutput) {
        if self.steers_to().is_none() {
            self.stream.told = false;
            return;
        }
        let Some(last) = self.stream.last else {
            return;
        };
        if now.since_s(last) > PAUSE_S && !std::mem::replace(&mut self.stream.told, true) {
            let text = "the outer loop receives no state of the vehicle and sends no attitude targets; the \
                        vehicle continues by itself";
            out.events
                .push(event(Severity::Warning, "attitude-paused", text));
        }
    }
}

/// Rotation from north, east, down to the body: w, x, y, z (yaw, pitch, roll in that order).
fn quaternion(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> [f32; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) = (
        (0.5 * roll_rad).sin_cos(),
        (0.5 * pitch_rad).sin_cos(),
        (0.5 * yaw_rad).sin_cos(),
    );
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
    .map(|part| part as f32)
}
