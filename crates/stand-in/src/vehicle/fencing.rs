//! The watch over the uploaded fence.

use super::StandIn;
use crate::fence::Breach;
use crate::parameters::{FENCE_ACTION, FENCE_ENABLE};
use mav_bridge::arduplane::RTL;
use mav_bridge::dialect::{FENCE_STATUS_DATA, FenceBreach, MavSeverity};
use protocol::SimTime;

impl StandIn {
    /// Whether the fence is watched.
    pub(super) fn fence_is_on(&self) -> bool {
        self.speaker.parameters.get(FENCE_ENABLE) != 0.0 && !self.fence.is_empty()
    }

    pub(super) fn is_outside_fence(&self) -> bool {
        self.breach.is_some_and(|breach| breach.outside)
    }

    /// Flies home from outside the fence, and says so.
    pub(super) fn check_fence(&mut self, now: SimTime) {
        let outside = self.fence_is_on()
            && self.flight.flying()
            && !self
                .fence
                .allows(self.flight.here().at, &self.reality.frame);
        let was_outside = self.is_outside_fence();
        if let Some(breach) = &mut self.breach {
            breach.outside = outside;
        }
        if !outside || was_outside {
            return;
        }
        self.breach = Some(Breach {
            since: now,
            count: self.breach.map_or(1, |b| b.count.saturating_add(1)),
            outside,
        });
        let notice = MavSeverity::MAV_SEVERITY_NOTICE;
        self.send_text(notice, "Polygon fence breached", now);
        if self.speaker.parameters.get(FENCE_ACTION) == 1.0 {
            self.flight.set_mode(RTL, &self.speaker.parameters);
        }
    }

    /// As ArduPlane, nothing is told of a fence that is not watched.
    pub(super) fn fence_status(&self) -> Option<FENCE_STATUS_DATA> {
        self.fence_is_on().then(|| FENCE_STATUS_DATA {
            breach_time: self
                .breach
                .map_or(0, |b| crate::report::boot_ms(b.since.s())),
            breach_count: self.breach.map_or(0, |b| b.count),
            breach_status: u8::from(self.is_outside_fence()),
            breach_type: if self.is_outside_fence() {
                FenceBreach::FENCE_BREACH_BOUNDARY
            } else {
                FenceBreach::FENCE_BREACH_NONE
            },
            ..FENCE_STATUS_DATA::default()
        })
    }
}
