//! When the mission goes on to its next phase.

use protocol::SimTime;
use protocol::message::Phase;

use super::SquadronController;
use crate::fleet::TeamVehicle;
use crate::tasks::VehicleTask;

/// Take-off is over for those who are still on the ground after this, s.
const LONGEST_TAKE_OFF_S: f64 = 240.0;
/// The preliminary flight ends at this part of the mission at the latest.
const PRELIMINARY_UNTIL: f64 = 0.3;
/// Passes of a preliminary flight, at least and at most.
const PRELIMINARY_PASSES: (usize, usize) = (5, 18);
/// Parts of the mission before the way home at which characterisation and the curtain of the flux begin.
const CHARACTERISE_FROM: f64 = 0.25;
const FLUX_FROM: f64 = 0.16;

impl SquadronController {
    /// The phase that is due, if it is another.
    pub(super) fn next_phase(&self, now: SimTime) -> Option<Phase> {
        let flying = |v: &TeamVehicle| v.is_commandable();
        let real = self
            .fleet
            .vehicles
            .iter()
            .filter(|v| v.real && flying(v))
            .count();
        let all_called = self.tasks.called.iter().all(|&called| called);
        if self.phase != Phase::Home && (self.all_come_home() || all_called) {
            return Some(Phase::Home);
        }
        let due = |part: f64| now.s() >= self.home_time_s() - part * self.duration_s;
        match self.phase {
            Phase::TakeOff => self.after_take_off(now, real),
            Phase::Preliminary => {
                let (least, most) = PRELIMINARY_PASSES;
                let flown = self.tasks.passes_flown;
                // Enough passes, and an estimate that is good enough for the search's sector: more
                // would take time from the search.
                let sharp = flown >= least && self.estimate().is_some_and(|b| b.is_precise());
                let late = now.s() >= PRELIMINARY_UNTIL * self.duration_s;
                (sharp || late || flown >= most || real == 0).then_some(Phase::Search)
            }
            Phase::Search => (due(CHARACTERISE_FROM) && real > 0 && self.model.is_some())
                .then_some(Phase::Characterise),
            Phase::Characterise => due(FLUX_FROM).then_some(Phase::Flux),
            Phase::Flux | Phase::Home => None,
        }
    }

    fn after_take_off(&self, now: SimTime, real: usize) -> Option<Phase> {
        let risen = |index: usize| {
            !matches!(
                self.tasks.each[index],
                VehicleTask::Parked | VehicleTask::TakingOff(_)
            )
        };
        let all = |want_real: bool| {
            let of_kind = |(_, v): &(usize, &TeamVehicle)| v.real || !want_real;
            let mut those = self.fleet.vehicles.iter().enumerate().filter(of_kind);
            those.all(|(index, _)| risen(index))
        };
        let late = now.s() > LONGEST_TAKE_OFF_S;
        let any = (0..self.fleet.vehicles.len()).any(risen);
        if real > 0 && any && (all(true) || late) {
            Some(Phase::Preliminary)
        } else if any && (all(false) || late) {
            Some(Phase::Search)
        } else {
            None
        }
    }
}
