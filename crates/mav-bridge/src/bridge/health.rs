//! Health of the vehicle and its links.

use super::Bridge;
use super::checklist::Verdict;
use protocol::SimTime;
use protocol::message::{Finding, Health};

/// MAVLink's values for an unknown voltage and an unknown number of satellites.
const UNKNOWN_MV: u16 = u16::MAX;
const UNKNOWN_SATELLITES: u8 = u8::MAX;

impl Bridge {
    /// How the vehicle and the link to it are.
    pub fn health(&self, now: SimTime) -> Health {
        let told = &self.checklist.told;
        let heartbeat = self.telemetry.heartbeat.as_ref().map(|(_, h)| h);
        let address = self.identity.address();
        let link = self.statistics();
        let status = told.status.as_ref();
        Health {
            system_id: address.map(|(system, _)| system),
            component_id: address.map(|(_, component)| component),
            autopilot: self.config.profile.name.to_owned(),
            flight_mode: heartbeat.map(|h| self.config.profile.modes.name(h.custom_mode)),
            armed: heartbeat.map(|_| self.telemetry.armed()),
            battery_percent: told.batteries.lowest_for_flight().map(|b| b.left_pct),
            battery_v: status
                .map(|s| s.voltage_battery)
                .filter(|mv| *mv != UNKNOWN_MV)
                .map(|mv| f64::from(mv) / 1000.0),
            satellites: told
                .gps
                .as_ref()
                .map(|gps| gps.satellites_visible)
                .filter(|seen| *seen != UNKNOWN_SATELLITES),
            silent_s: self.heartbeat_at.map(|at| now.since_s(at)),
            frames: link.frames,
            lost_frames: link.lost_frames,
            unreadable_frames: link.unreadable_frames + link.bad_frames,
            refused_frames: link.refused_frames,
            checked: self.checklist.is_kept().then_some(self.checklist.is_done()),
            findings: self.findings(),
        }
    }

    /// Points of a complete checklist that are not met.
    fn findings(&self) -> Vec<Finding> {
        if !self.checklist.is_done() {
            return Vec::new();
        }
        let points = self.checklist.points(&self.parameters).into_iter();
        let wrong = points.filter(|p| p.verdict != Verdict::Right);
        wrong
            .map(|p| Finding {
                about: p.about.to_owned(),
                refused: p.verdict == Verdict::Refused,
                says: p.words,
            })
            .collect()
    }
}
