//! How a mission is flown in mode AUTO: one item to navigate by after the other, and what is to be
//! done on the way, as ArduPlane does it.

mod leg;
mod sequence;
mod surroundings;

pub(crate) use surroundings::{Place, Surroundings, altitude_amsl_m};

use crate::item_list::Item;
use air::geo::Enu;
use fdm::autopilot::Path;
use leg::{ALTITUDE_BAND_M, Leg};
use mav_bridge::arduplane::RTL;
use mav_bridge::dialect::{MavCmd, MavSeverity, MissionState};
use sequence::Sequence;

/// Altitude asked for above that at which a take-off is over, m: it is to be passed, not neared.
const PASS_BY_M: f64 = 5.0;

/// What a mission does beside flying a path.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum MissionEvent {
    /// The item of this number is done.
    Reached(u16),
    /// Something to be told.
    Text(MavSeverity, String),
    /// Another mode is entered.
    Mode(u32),
    /// DO_CHANGE_SPEED: kind of speed, and the speed, m/s.
    Speed(f32, f32),
    /// DO_FENCE_ENABLE.
    Fence(bool),
    /// DO_SET_HOME: to here, or to a place.
    Home(Option<Place>),
}

/// How far a mission has been flown.
#[derive(Debug, Clone)]
pub(crate) struct MissionRun {
    state: MissionState,
    sequence: Sequence,
    leg: Option<Leg>,
    /// The waypoint flown to last, from which the next leg leads in a straight line.
    came_from: Option<Enu>,
    events: Vec<MissionEvent>,
}

impl MissionRun {
    pub(crate) fn new() -> Self {
        Self {
            state: MissionState::MISSION_STATE_NOT_STARTED,
            sequence: Sequence::default(),
            leg: None,
            came_from: None,
            events: Vec::new(),
        }
    }

    /// Number of the item that is flown, or that it goes on with; 0 before.
    pub(crate) fn current(&self) -> u16 {
        u16::try_from(self.sequence.current).unwrap_or(u16::MAX)
    }

    pub(crate) fn state(&self, items: &[Item]) -> MissionState {
        if items.len() < 2 {
            MissionState::MISSION_STATE_NO_MISSION
        } else {
            self.state
        }
    }

    pub(crate) fn is_running(&self) -> bool {
        self.state == MissionState::MISSION_STATE_ACTIVE
    }

    /// Where it flies to; none before its first item.
    pub(crate) fn target(&self) -> Option<Place> {
        self.leg.as_ref().map(|leg| leg.to)
    }

    /// Distance from the straight line of the leg, m, positive to its right.
    pub(crate) fn across_m(&self, at: Enu) -> f64 {
        self.leg.as_ref().map_or(0.0, |leg| leg.across_m(at))
    }

    /// Whether it is on its way down to a landing.
    pub(crate) fn is_landing(&self, items: &[Item]) -> bool {
        let item = items.get(self.sequence.current);
        self.is_running() && item.is_some_and(|i| i.command == MavCmd::MAV_CMD_NAV_LAND)
    }

    /// What happened since the last call.
    pub(crate) fn take_events(&mut self) -> Vec<MissionEvent> {
        std::mem::take(&mut self.events)
    }

    /// Starts it, or goes on with the item at which it was left.
    pub(crate) fn start_or_resume(&mut self) {
        if self.state == MissionState::MISSION_STATE_COMPLETE {
            self.reset();
        }
        self.state = MissionState::MISSION_STATE_ACTIVE;
        self.begin_here();
    }

    /// The leg begins anew from where the vehicle is.
    fn begin_here(&mut self) {
        self.leg = None;
        self.came_from = None;
    }

    /// Stops it where it is, to be resumed.
    pub(crate) fn stop(&mut self) {
        if self.is_running() {
            self.state = MissionState::MISSION_STATE_NOT_STARTED;
        }
    }

    /// To its beginning, with no jump counted.
    pub(crate) fn reset(&mut self) {
        self.sequence = Sequence::default();
        self.begin_here();
    }

    /// Goes on with another item; false if there is none of that number.
    pub(crate) fn set_current(&mut self, index: usize, items: &[Item]) -> bool {
        if index >= items.len() || items.len() < 2 {
            return false;
        }
        if index == 0 || self.state == MissionState::MISSION_STATE_COMPLETE {
            self.reset();
        }
        self.sequence.go_to(index.max(1), items);
        if self.state == MissionState::MISSION_STATE_COMPLETE {
            self.state = MissionState::MISSION_STATE_NOT_STARTED;
        }
        self.begin_here();
        true
    }

    /// Flies on: the path of this moment, with altitude above mean sea level, m. None once the
    /// mission is over or where none is.
    pub(crate) fn fly(&mut self, around: &Surroundings) -> Option<(Path, f64)> {
        // Items that are done at once follow each other; a mission of such items alone ends.
        for _ in 0..=around.items.len() {
            if !self.is_running() || !self.begin(around) {
                break;
            }
            self.act(around);
            if !self.is_done(around) {
                return self.steer(around);
            }
            self.events
                .push(MissionEvent::Reached(self.sequence.current as u16));
            self.advance(around);
        }
        self.is_running().then(|| self.steer(around)).flatten()
    }

    /// Takes up the item that is next; false if there is none left, or the mode is left.
    fn begin(&mut self, around: &Surroundings) -> bool {
        if self.leg.is_some() {
            return true;
        }
        if self.sequence.current == 0 && !self.sequence.advance(around.items) {
            self.complete();
            return false;
        }
        let Some(item) = around.items.get(self.sequence.current) else {
            self.complete();
            return false;
        };
        if item.command == MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH {
            self.events.push(MissionEvent::Mode(RTL));
            self.stop();
            return false;
        }
        let next = self.sequence.after(around.items);
        self.leg = Some(Leg::new(item, next, self.came_from, around));
        true
    }

    fn advance(&mut self, around: &Surroundings) {
        let item = around.items.get(self.sequence.current);
        let was_waypoint = item.is_some_and(|i| i.command == MavCmd::MAV_CMD_NAV_WAYPOINT);
        self.came_from = self
            .leg
            .take()
            .filter(|_| was_waypoint)
            .map(|leg| leg.to.at);
        if !self.sequence.advance(around.items) {
            self.complete();
        }
    }

    fn complete(&mut self) {
        self.state = MissionState::MISSION_STATE_COMPLETE;
        self.begin_here();
        let said = "Mission complete, changing mode to RTL".to_owned();
        let notice = MavSeverity::MAV_SEVERITY_NOTICE;
        self.events.push(MissionEvent::Text(notice, said));
        self.events.push(MissionEvent::Mode(RTL));
    }

    /// Does what is to be done on the way, up to a condition that does not hold yet.
    fn act(&mut self, around: &Surroundings) {
        while let Some(index) = self.sequence.to_do() {
            let Some(item) = around.items.get(index) else {
                return;
            };
            let due = match item.command {
                MavCmd::MAV_CMD_CONDITION_DELAY => {
                    self.sequence.waited_s(around.time_s) >= f64::from(item.param1)
                }
                MavCmd::MAV_CMD_CONDITION_DISTANCE => self.leg.as_ref().is_none_or(|leg| {
                    leg.to.at.distance_m(around.here().at) <= f64::from(item.param1)
                }),
                _ => true,
            };
            if !due {
                return;
            }
            self.events.extend(deed(item, around));
            self.events.push(MissionEvent::Reached(index as u16));
            self.sequence.done();
        }
    }

    fn is_done(&mut self, around: &Surroundings) -> bool {
        let index = self.sequence.current;
        let (Some(leg), Some(item)) = (&mut self.leg, around.items.get(index)) else {
            return true;
        };
        let said = match item.command {
            MavCmd::MAV_CMD_NAV_WAYPOINT => leg.waypoint(index, item, around),
            MavCmd::MAV_CMD_NAV_TAKEOFF => (around.sensed.alt_amsl_m > leg.to.alt_amsl_m)
                .then(|| "Takeoff complete".to_owned()),
            MavCmd::MAV_CMD_NAV_LOITER_TURNS => leg
                .has_turned(f64::from(item.param1), around)
                .then(|| "Loiter orbits complete".to_owned()),
            MavCmd::MAV_CMD_NAV_LOITER_TIME => leg
                .has_waited(f64::from(item.param1), around)
                .then(|| "Loiter time complete".to_owned()),
            MavCmd::MAV_CMD_NAV_LOITER_TO_ALT => leg
                .is_at_altitude(around)
                .then(|| "Loiter to alt complete".to_owned()),
            MavCmd::MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT => {
                let above_m = around.sensed.alt_amsl_m - leg.to.alt_amsl_m;
                let there = match item.param1 as u8 {
                    1 => above_m >= 0.0,
                    2 => above_m <= 0.0,
                    _ => above_m.abs() <= ALTITUDE_BAND_M,
                };
                return there;
            }
            MavCmd::MAV_CMD_NAV_LOITER_UNLIM | MavCmd::MAV_CMD_NAV_LAND => None,
            // Armed, a delay is none: something has to be flown.
            MavCmd::MAV_CMD_NAV_DELAY => return true,
            other => Some(format!("Skipping invalid cmd #{}", other as u32)),
        };
        let done = said.is_some();
        let info = MavSeverity::MAV_SEVERITY_INFO;
        self.events
            .extend(said.map(|text| MissionEvent::Text(info, text)));
        done
    }

    fn steer(&self, around: &Surroundings) -> Option<(Path, f64)> {
        let leg = self.leg.as_ref()?;
        let item = around.items.get(self.sequence.current)?;
        let alt_amsl_m = leg.to.alt_amsl_m;
        Some(match item.command {
            MavCmd::MAV_CMD_NAV_TAKEOFF => {
                let heading_deg = leg.began_course_deg;
                (Path::TakeOff { heading_deg }, alt_amsl_m + PASS_BY_M)
            }
            MavCmd::MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT => {
                let deg = leg.began_course_deg;
                (Path::Course { deg }, alt_amsl_m)
            }
            MavCmd::MAV_CMD_NAV_LAND => (leg.landing(), around.sensed.alt_amsl_m),
            MavCmd::MAV_CMD_NAV_WAYPOINT => (leg.straight(around), alt_amsl_m),
            _ => (leg.circle(), alt_amsl_m),
        })
    }
}

/// What an item that does not navigate does.
fn deed(item: &Item, around: &Surroundings) -> Option<MissionEvent> {
    match item.command {
        MavCmd::MAV_CMD_DO_CHANGE_SPEED => Some(MissionEvent::Speed(item.param1, item.param2)),
        MavCmd::MAV_CMD_DO_FENCE_ENABLE => Some(MissionEvent::Fence(item.param1 == 1.0)),
        MavCmd::MAV_CMD_DO_SET_HOME => {
            let here = item.param1 == 1.0 || (item.x, item.y) == (0, 0);
            Some(MissionEvent::Home((!here).then(|| around.place(item))))
        }
        // Landing start, camera, relay and the like: marks, or for hardware that is not here.
        _ => None,
    }
}
