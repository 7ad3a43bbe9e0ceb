//! Cause of the vehicle's own return home. Its heartbeat reports at most an active failsafe, and not a breach of its
//! fence; its texts, SYS_STATUS and FENCE_STATUS name the cause.

use crate::dialect::{MavSysStatusSensor, SYS_STATUS_DATA};
use crate::profile::Saying;
use protocol::SimTime;
use protocol::control_level::Danger;

/// How long after it was told a cause explains a change of mode, s: heartbeats come once a second, and one
/// or two may be lost.
const LASTS_S: f64 = 4.0;

/// The bit of SYS_STATUS for each cause.
const BITS: [(MavSysStatusSensor, Danger); 3] = [
    (MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE, Danger::Fence),
    (
        MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY,
        Danger::Battery,
    ),
    (
        MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER,
        Danger::Remote,
    ),
];

/// How long a vehicle may take to tell why it returns home, s: autopilots queue their texts behind telemetry.
pub(super) const CAUSE_WITHIN_S: f64 = 2.0;
/// A silence of this bridge so long may have set off the vehicle's failsafe for a lost ground station, s: the shortest time
/// that autopilots have for one is 1.5 s.
const SILENCE_S: f64 = 2.5;

/// Silences of this bridge itself, as when its process was stopped: of what the vehicle sends meanwhile much is lost, its
/// text on the failsafe too.
#[derive(Debug, Clone, Default)]
pub(super) struct OwnSilence {
    spoke: Option<SimTime>,
    ended: Option<SimTime>,
}

impl OwnSilence {
    /// The bridge sends its heartbeat.
    pub(super) fn speaks(&mut self, now: SimTime) {
        if self.is_silent(now) {
            self.ended = Some(now);
        }
        self.spoke = Some(now);
    }

    fn is_silent(&self, now: SimTime) -> bool {
        self.spoke.is_some_and(|at| now.since_s(at) > SILENCE_S)
    }

    /// Whether a mode that brings the vehicle home may come from such a silence.
    pub(super) fn explains(&self, now: SimTime) -> bool {
        self.is_silent(now) || self.ended.is_some_and(|at| now.since_s(at) <= LASTS_S)
    }
}

/// Reports of the vehicle on its failsafes.
#[derive(Debug, Clone, Default)]
pub(super) struct Causes {
    latest: Option<(SimTime, Danger)>,
    /// Of each of [`BITS`], whether it is enabled and unhealthy; none before the first SYS_STATUS.
    unhealthy: Option<[bool; 3]>,
    fence_broken: bool,
    /// Whether the fence on board is switched on by its SYS_STATUS; none while that has shown no fence.
    fence_is_on: Option<bool>,
}

impl Causes {
    /// Receives a text of the vehicle; `sayings` are the autopilot's words for causes.
    pub(super) fn text(&mut self, text: &str, sayings: &[Saying], now: SimTime) {
        let text = text.to_lowercase();
        let over = ["clear", "failsafe off"].iter().any(|w| text.contains(w));
        let Some(said) = sayings.iter().find(|saying| saying.is_in(&text)) else {
            return;
        };
        if said.danger == Danger::Fence {
            self.fence_broken = !over;
        }
        if !over {
            self.latest = Some((now, said.danger));
        }
    }

    /// Receives the health of its parts.
    pub(super) fn status(&mut self, status: &SYS_STATUS_DATA, now: SimTime) {
        let bad = BITS.map(|(bit, _)| {
            status.onboard_control_sensors_enabled.contains(bit)
                && !status.onboard_control_sensors_health.contains(bit)
        });
        let before = self.unhealthy.replace(bad);
        for (k, (_, danger)) in BITS.into_iter().enumerate() {
            // A part that was unhealthy from the start, such as a missing receiver, explains nothing.
            if bad[k] && before.is_some_and(|before| !before[k]) {
                self.latest = Some((now, danger));
            }
        }
        let fence = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
        let is_on = status.onboard_control_sensors_enabled.contains(fence);
        if is_on
            || status.onboard_control_sensors_present.contains(fence)
            || self.fence_is_on.is_some()
        {
            // A fence that is switched off is not broken, wherever the vehicle is.
            self.fence_is_on = Some(is_on);
            self.fence_broken = bad[0];
        }
    }

    /// Receives FENCE_STATUS.
    pub(super) fn fence(&mut self, broken: bool, now: SimTime) {
        let broken = broken && self.fence_is_on != Some(false);
        if broken && !self.fence_broken {
            self.latest = Some((now, Danger::Fence));
        }
        self.fence_broken = broken;
    }

    /// Whether it reports a breach of the fence on board.
    pub(super) fn fence_broken(&self) -> bool {
        self.fence_broken
    }

    /// The cause of a return home at `now`; `failsafe`: its heartbeat reports one.
    pub(super) fn at(&self, now: SimTime, failsafe: bool) -> Option<Danger> {
        let recent = self.latest.filter(|(at, _)| now.since_s(*at) <= LASTS_S);
        let unhealthy = || {
            let bad = self.unhealthy.filter(|_| failsafe)?;
            let found = BITS.into_iter().zip(bad).find(|(_, bad)| *bad);
            found.map(|((_, danger), _)| danger)
        };
        recent.map(|(_, danger)| danger).or_else(unhealthy)
    }
}
