//! Whether the vehicle flies the airspeed that the bridge commanded last. Another ground station may have commanded another
//! one, and no message of an autopilot states the speed that it is to fly.

use super::{Bridge, BridgeOutput};
use crate::authority::BridgePhase;
use crate::command_queue::VehicleCommand;
use crate::event::event;
use protocol::SimTime;
use protocol::message::Severity;

/// Airspeeds that differ by less are the same command, m/s.
const SAME_M_S: f32 = 0.05;
/// Airspeeds in the mean that differ by more are another command, m/s: twice what moderate gusts do (MIL-F-8785C).
const OTHER_M_S: f64 = 2.0;
/// Time over which the airspeed is averaged, s.
const MEAN_S: f64 = 5.0;
/// Climb or descent, m/s, beyond which an autopilot may give up the airspeed for the height.
const LEVEL_M_S: f32 = 1.5;
/// Time after a command in which the vehicle may still change its airspeed, s.
const SETTLES_S: f64 = 15.0;
/// Time for which the airspeed has to be another one, s.
const LASTS_S: f64 = 8.0;

/// The commanded airspeed, and the one that is flown; both equivalent.
#[derive(Debug, Clone, Default)]
pub(super) struct CommandedSpeed {
    sent: Option<(f32, SimTime)>,
    /// Mean of what is flown, m/s, and the time of its last value.
    flown: Option<(f64, SimTime)>,
    other_since: Option<SimTime>,
    /// The team knows that it flies another speed.
    told: bool,
}

impl CommandedSpeed {
    /// Forgets the command: the next setpoint sends it anew.
    pub(super) fn forget(&mut self) {
        (self.sent, self.other_since) = (None, None);
    }

    /// Whether `speed_m_s` has to be sent; it then counts as sent.
    pub(super) fn sends(&mut self, speed_m_s: f32, now: SimTime) -> bool {
        let same = |(sent, _): (f32, SimTime)| (sent - speed_m_s).abs() <= SAME_M_S;
        if self.sent.is_some_and(same) {
            return false;
        }
        (self.sent, self.other_since) = (Some((speed_m_s, now)), None);
        true
    }

    /// Receives the airspeed at `at`; returns the commanded one where another is flown for some time.
    fn look(&mut self, airspeed_m_s: f64, climb_m_s: f32, at: SimTime) -> Option<f32> {
        let (mut mean_m_s, last) = self.flown.unwrap_or((airspeed_m_s, at));
        let weight = (at.since_s(last) / MEAN_S).clamp(0.0, 1.0);
        mean_m_s += weight * (airspeed_m_s - mean_m_s);
        self.flown = Some((mean_m_s, at));
        let (sent_m_s, sent_at) = self.sent?;
        let is_other = (mean_m_s - f64::from(sent_m_s)).abs() > OTHER_M_S;
        if !is_other {
            self.told = false;
        }
        if !is_other || climb_m_s.abs() > LEVEL_M_S || at.since_s(sent_at) < SETTLES_S {
            self.other_since = None;
            return None;
        }
        let since = *self.other_since.get_or_insert(at);
        if at.since_s(since) < LASTS_S {
            return None;
        }
        (self.sent, self.other_since) = (Some((sent_m_s, at)), None);
        Some(sent_m_s)
    }
}

impl Bridge {
    /// Sends the airspeed again to a vehicle that flies another one. A multirotor is commanded a speed over ground, and stops.
    pub(super) fn check_airspeed(&mut self, now: SimTime, out: &mut BridgeOutput) {
        if self.authority.phase() != BridgePhase::Guided {
            return self.speed.forget();
        }
        if self.config.profile.commands.ground_speed {
            return;
        }
        let Some((at, hud)) = &self.telemetry.hud else {
            return;
        };
        if self.speed.flown.is_some_and(|(_, last)| last >= *at) {
            return;
        }
        let (airspeed_m_s, climb_m_s) = (f64::from(hud.airspeed), hud.climb);
        let Some(commanded_m_s) = self.speed.look(airspeed_m_s, climb_m_s, *at) else {
            return;
        };
        self.commands.push(VehicleCommand::Speed {
            equivalent_airspeed_m_s: commanded_m_s,
        });
        if !std::mem::replace(&mut self.speed.told, true) {
            let text = format!(
                "the vehicle flies {:.1} m/s instead of {commanded_m_s:.1} m/s (equivalent airspeed); the bridge sends \
                 its speed again. Another ground station may have changed it",
                self.speed.flown.map_or(airspeed_m_s, |(mean, _)| mean)
            );
            out.events
                .push(event(Severity::Warning, "other-airspeed", text));
        }
        self.speed.sent = Some((commanded_m_s, now));
    }
}
