//! The order of each vehicle in a phase, decided once a second.

use air::geo::Enu;
use csea::{Position, Sampler, SearchStrategy};
use protocol::message::Phase;
use protocol::{Outbox, SimTime};

use super::SquadronController;
use crate::fleet::{CIRCLE_M, MARGIN_M};
use crate::passes::{self, Crossing};
use crate::separation::Corridor;
use crate::tasks::VehicleTask;

/// A vehicle is at its height when it is this near to it, m.
pub(super) const AT_HEIGHT_M: f64 = 12.0;
/// Longest wait for the height at the beginning of a pass, s.
const WAIT_FOR_HEIGHT_S: f64 = 75.0;
/// Seconds that a pass may be refused because others are in the way before the next pass is tried.
const REFUSALS: usize = 60;
/// Coming passes that are kept free.
const RESERVED_PASSES: usize = 3;
/// Draws of a promising point before a vehicle keeps its last one.
const DRAWS: usize = 12;
/// Turns and climbs that a strategy reckons with: of a small flying wing at a bank of 30°.
const TURN_RADIUS_M: f64 = 60.0;
const CLIMB_M_S: f64 = 2.5;
/// Heights tried above and below a promising point, in steps of the vertical separation.
const HEIGHT_STEPS: [f64; 7] = [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0];

impl SquadronController {
    /// Gives every vehicle that has nothing to do, or has done it, its next order.
    pub(super) fn direct(&mut self, now: SimTime, out: &mut Outbox) {
        self.reserve_climbs(now);
        self.launch(now, out);
        self.reserve_passes();
        self.reserve_ways_down();
        for index in 0..self.fleet.vehicles.len() {
            self.update_climb(index);
            let on_pattern = self.tasks.each[index] == VehicleTask::OnPattern;
            if on_pattern || !self.fleet.vehicles[index].is_commandable() {
                continue;
            }
            if self.tasks.each[index] == VehicleTask::Returning {
                self.bring_home(index, out);
                continue;
            }
            let busy =
                self.makes_room(index, out) || matches!(self.phase, Phase::TakeOff | Phase::Home);
            if busy {
                continue;
            }
            if self.fleet.vehicles[index].real && !self.passes().is_empty() {
                self.fly_passes(index, now, out);
            } else {
                self.search_on(index);
            }
        }
        self.land_in_turn(now, out);
    }

    /// Lets a vehicle search that has no pass to fly.
    fn search_on(&mut self, index: usize) {
        use VehicleTask::{Approaching, Idle, OnPass};
        let task = &mut self.tasks.each[index];
        if matches!(task, Idle | Approaching(..) | OnPass(_)) {
            *task = VehicleTask::Searching;
        }
    }

    /// The passes that real vehicles fly now: none before it is known where, nor in a search that has read nothing.
    fn passes(&self) -> &'static [Crossing] {
        let crossings = passes::of(self.phase);
        let mut team = self.fleet.vehicles.iter();
        let flown = team.any(|v| v.real && v.is_commandable())
            && self.is_located()
            && (self.phase != Phase::Search || self.has_read_plume());
        if flown { crossings } else { &[] }
    }

    /// Keeps the passes that are flown now and next free of those who fly none.
    fn reserve_passes(&mut self) {
        let crossings = self.passes();
        let coming = RESERVED_PASSES.min(crossings.len());
        let under_way = self.tasks.each.iter().filter_map(|task| match task {
            VehicleTask::Approaching(pass, _) | VehicleTask::OnPass(pass) => Some(*pass),
            _ => None,
        });
        let next = (0..coming).filter_map(|k| {
            let crossing = crossings[(self.tasks.next_pass + k) % crossings.len()];
            self.plan_pass(crossing, self.estimate()?.source)
        });
        let corridor = |pass: passes::Pass| Corridor::straight(pass.from, pass.to, CIRCLE_M);
        self.fleet.passes = under_way.chain(next).map(corridor).collect();
    }

    /// A pass planned on the estimate of now, begun at the end that is nearer to `here`.
    fn plan_pass(&self, crossing: Crossing, here: Enu) -> Option<passes::Pass> {
        let (estimate, airspace) = (self.estimate()?, &self.fleet.airspace);
        let range = self.range;
        passes::plan(
            crossing, &estimate, &self.base, airspace, range, MARGIN_M, here,
        )
    }

    fn fly_passes(&mut self, index: usize, now: SimTime, out: &mut Outbox) {
        match self.tasks.each[index] {
            VehicleTask::Approaching(pass, waiting) if self.fleet.vehicles[index].has_arrived() => {
                let since = waiting.unwrap_or(now);
                self.tasks.each[index] = VehicleTask::Approaching(pass, Some(since));
                let height_m = self.fleet.vehicles[index]
                    .track
                    .map(|s| s.position.height_m);
                let off_m = height_m.map_or(0.0, |h| (h - pass.from.height_m).abs());
                let at_height = off_m <= AT_HEIGHT_M || now.since_s(since) > WAIT_FOR_HEIGHT_S;
                if at_height && self.fleet.send(index, pass.to, "pass", out) {
                    self.tasks.each[index] = VehicleTask::OnPass(pass);
                }
            }
            VehicleTask::OnPass(_) if self.fleet.vehicles[index].has_arrived() => {
                self.tasks.passes_flown += 1;
                self.tasks.each[index] = VehicleTask::Idle;
                self.next_pass(index, out);
            }
            VehicleTask::Idle | VehicleTask::Searching => self.next_pass(index, out),
            _ => {}
        }
    }

    /// Plans the next pass on the estimate of now, and sends the vehicle to its beginning.
    fn next_pass(&mut self, index: usize, out: &mut Outbox) {
        let Some(track) = self.fleet.vehicles[index]
            .track
            .filter(|_| self.model.is_some())
        else {
            return;
        };
        let crossings = self.passes();
        let Some(crossing) = crossings.get(self.tasks.next_pass % crossings.len().max(1)) else {
            return;
        };
        match self.plan_pass(*crossing, track.position.at) {
            // Each shows something of its own: with others in the way, it waits its turn.
            Some(pass) if self.fleet.send(index, pass.from, "to the next pass", out) => {
                self.tasks.next_pass += 1;
                self.tasks.each[index] = VehicleTask::Approaching(pass, None);
            }
            Some(_) if self.tasks.refused < REFUSALS => self.tasks.refused += 1,
            _ => {
                self.tasks.next_pass += 1;
                self.tasks.refused = 0;
            }
        }
    }

    /// Each searching vehicle flies where the strategy directs it, if it may be sent there.
    pub(super) fn follow(&mut self, strategy: &mut dyn SearchStrategy, out: &mut Outbox) {
        let cone_deg = self.search.cone_deg;
        for index in 0..self.fleet.vehicles.len() {
            let Some(sampler) = self.searching(index) else {
                continue;
            };
            // A place whose way is taken by another vehicle is chosen again; after a few times the old order stands,
            // which is safe.
            let mut refused = None;
            for _ in 0..DRAWS {
                let order = strategy.direct(&sampler, cone_deg, &mut self.rng);
                if refused != Some(order) && self.send_near(index, order, out) {
                    break;
                }
                refused = Some(order);
            }
        }
    }

    /// A vehicle that searches, as it flies now.
    fn searching(&self, index: usize) -> Option<Sampler> {
        let v = &self.fleet.vehicles[index];
        let searches = self.tasks.each[index] == VehicleTask::Searching && v.is_commandable();
        let track = v.track.filter(|_| searches)?;
        Some(Sampler {
            id: index,
            position: track.position,
            heading_deg: track.course_deg,
            speed_m_s: self.search.airspeed_m_s,
            turn_radius_m: TURN_RADIUS_M,
            climb_m_s: CLIMB_M_S,
        })
    }

    /// Sends a vehicle to a place, or above or below it.
    fn send_near(&mut self, index: usize, to: Position, out: &mut Outbox) -> bool {
        let step_m = self.fleet.separation.height_m;
        let heights = HEIGHT_STEPS.map(|step| {
            let wanted_m = to.height_m + step * step_m;
            self.fleet.airspace.clamp_at_m(to.at, wanted_m)
        });
        let purpose = "promising point";
        self.fleet
            .send_at_free_height(index, to.at, &heights, purpose, out)
    }
}
