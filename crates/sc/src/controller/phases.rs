//! When the mission goes on to its next phase: as soon as the belief allows it, and when time asks for it.

use protocol::SimTime;
use protocol::message::{Flux, Peak, PeakStatus, Phase};

use super::{HALF_WIDTH_95_SD, SquadronController};
use crate::fleet::TeamVehicle;
use crate::tasks::VehicleTask;

/// Take-off is over for those who are still on the ground after this, s.
const LONGEST_TAKE_OFF_S: f64 = 240.0;
/// The preliminary flight ends at this part of the mission at the latest.
const PRELIMINARY_UNTIL: f64 = 0.3;
/// Passes at different heights and distances before a plume is held to be located, at the least: with fewer its two
/// spreads and its height stand for each other.
const LOCATING_PASSES: usize = 5;
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
        let done = self.all_come_home() || all_called || self.knows_enough();
        if self.phase != Phase::Home && done {
            return Some(Phase::Home);
        }
        let due = |part: f64| now.s() >= self.home_time_s() - part * self.duration_s;
        match self.phase {
            Phase::TakeOff => self.after_take_off(now, real),
            Phase::Preliminary => {
                let late = now.s() >= PRELIMINARY_UNTIL * self.duration_s;
                (self.has_read_plume() || late || real == 0).then_some(Phase::Search)
            }
            Phase::Search => {
                let located = self.tasks.passes_flown >= LOCATING_PASSES && self.is_well_located();
                let passes = real > 0 && self.model.is_some();
                (passes && (located || due(CHARACTERISE_FROM))).then_some(Phase::Characterise)
            }
            Phase::Characterise => due(FLUX_FROM).then_some(Phase::Flux),
            Phase::Flux | Phase::Home => None,
        }
    }

    /// Whether the plume is known well enough for passes about its axis.
    fn is_well_located(&self) -> bool {
        let near_m = self.range.near_m;
        self.estimate()
            .is_some_and(|e| e.is_located(&self.base, near_m))
    }

    /// Whether all that the scenario asks for is known: the peak is confirmed, and it and what the sources emit have
    /// 95 % intervals as narrow as asked. Never where the scenario asks for nothing.
    fn knows_enough(&self) -> bool {
        let Some(model) = &self.model else {
            return false;
        };
        let confirmed = model.peak.filter(|p| p.status == PeakStatus::Confirmed);
        let background_ppm = model.background_ppm.value;
        let is_peak_known = |within: f64| {
            let excess =
                |p: &Peak| HALF_WIDTH_95_SD * p.sd_ppm <= within * (p.co2_ppm - background_ppm);
            confirmed.is_some_and(|p| excess(&p))
        };
        // The first stands for the answer; by the model alone there is one of each source.
        let method = model.flux.first().map(|f| f.method);
        let stands = |f: &&Flux| Some(f.method) == method;
        let is_known = |f: &Flux, within| HALF_WIDTH_95_SD * f.kg_s.sd <= within * f.kg_s.value;
        let is_flux_known = |within: f64| {
            let mut fluxes = model.flux.iter().filter(stands);
            method.is_some() && fluxes.all(|f| is_known(f, within))
        };
        let (peak, flux) = self.asked_within;
        let asks = peak.is_some() || flux.is_some();
        let known = peak.is_none_or(is_peak_known) && flux.is_none_or(is_flux_known);
        asks && confirmed.is_some() && known
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
