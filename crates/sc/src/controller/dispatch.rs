//! The order of each vehicle in a phase, decided once a second.

use air::geo::{Enu, wrap_signed_deg};
use csea::{Position, Sampler, SearchStrategy};
use protocol::message::Phase;
use protocol::{Outbox, SimTime};

use super::SquadronController;
use crate::fleet::{CIRCLE_M, MARGIN_M, REACHED_M};
use crate::passes::{self, Crossing, Pass};
use crate::separation::Corridor;
use crate::tasks::VehicleTask;

/// A vehicle is at its height when it is this near to it, m.
pub(super) const AT_HEIGHT_M: f64 = 12.0;
/// Longest wait for the height at the beginning of a pass, s.
const WAIT_FOR_HEIGHT_S: f64 = 75.0;
/// Seconds that a pass may be refused because others are in the way before the next pass is tried.
const REFUSALS: usize = 60;
/// Coming passes of an order that are kept free.
const RESERVED_PASSES: usize = 3;
/// Draws of a promising point before a vehicle keeps its last one.
const DRAWS: usize = 12;
/// Turns and climbs that a strategy reckons with: of a small flying wing at a bank of 30°.
pub(super) const TURN_RADIUS_M: f64 = 60.0;
pub(super) const CLIMB_M_S: f64 = 2.5;
/// A vehicle that is in the way of passes leaves by one of these distances, m, in one of so many directions.
const LEAVE_M: [f64; 4] = [300.0, 600.0, 1000.0, 1500.0];
const LEAVE_DIRECTIONS: u8 = 12;
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
            if self.fleet.vehicles[index].real && self.flies_passes() {
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

    /// Whether real vehicles fly passes now: not before it is known where, nor in a search that has read nothing.
    fn flies_passes(&self) -> bool {
        let mut team = self.fleet.vehicles.iter();
        team.any(|v| v.real && v.is_commandable())
            && !matches!(self.phase, Phase::TakeOff | Phase::Home)
            && self.is_located()
            && (self.phase != Phase::Search || self.has_read_plume())
    }

    /// Keeps the passes that are flown now and next free of those who fly none: the search goes elsewhere.
    fn reserve_passes(&mut self) {
        let under_way = self.tasks.each.iter().filter_map(|task| match task {
            VehicleTask::Approaching(pass, _) | VehicleTask::OnPass(pass) => {
                Some((pass.from, pass.to))
            }
            _ => None,
        });
        let mut ends: Vec<(Position, Position)> = under_way.collect();
        if let Some(estimate) = self.estimate().filter(|_| self.flies_passes()) {
            let source = estimate.source;
            let coming = (0..RESERVED_PASSES)
                .filter_map(|k| passes::in_order(self.phase, self.tasks.next_pass + k))
                .filter_map(|crossing| self.plan_pass(crossing, source));
            ends.extend(coming.map(|pass| (pass.from, pass.to)));
            if passes::in_order(self.phase, self.tasks.next_pass).is_none() {
                let [low, high] =
                    passes::nearest().map(|crossing| self.plan_pass(crossing, source));
                ends.extend(low.zip(high).map(|(low, high)| (low.from, high.to)));
            }
        }
        let corridor = |(from, to)| Corridor::straight(from, to, CIRCLE_M);
        self.fleet.passes = ends.into_iter().map(corridor).collect();
    }

    /// A pass planned on the estimate of now, begun at the end that is nearer to `here`.
    pub(super) fn plan_pass(&self, crossing: Crossing, here: Enu) -> Option<Pass> {
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
                if now.since_s(since) > WAIT_FOR_HEIGHT_S || self.is_level_in_time(index, &pass) {
                    self.cross(index, pass, out);
                }
            }
            VehicleTask::OnPass(pass) if self.has_crossed(index, &pass) => {
                self.tasks.passes_flown += 1;
                self.tasks.each[index] = VehicleTask::Idle;
                self.next_pass(index, now, out);
            }
            VehicleTask::Idle | VehicleTask::Searching => self.next_pass(index, now, out),
            _ => {}
        }
    }

    /// Whether a vehicle is at the end of its pass, or of the plume.
    fn has_crossed(&self, index: usize, pass: &Pass) -> bool {
        let vehicle = &self.fleet.vehicles[index];
        let has_left = |here: Enu| {
            let estimate = self.estimate();
            estimate.is_some_and(|e| passes::has_left_plume(pass, &e, &self.base, self.range, here))
        };
        vehicle.has_arrived() || vehicle.track.is_some_and(|t| has_left(t.position.at))
    }

    /// Whether a vehicle at the beginning of a pass comes to its height before the plume.
    fn is_level_in_time(&self, index: usize, pass: &Pass) -> bool {
        let Some(track) = self.fleet.vehicles[index].track else {
            return false;
        };
        let bearing_deg = track.position.at.bearing_deg(pass.to.at);
        let turn_deg = wrap_signed_deg(bearing_deg - track.course_deg).abs();
        let turn_m = turn_deg.to_radians() * TURN_RADIUS_M;
        let climb_m = CLIMB_M_S * (turn_m + pass.lead_m) / self.fleet.airspeed_m_s;
        (track.position.height_m - pass.from.height_m).abs() <= AT_HEIGHT_M + climb_m
    }

    fn cross(&mut self, index: usize, pass: Pass, out: &mut Outbox) -> bool {
        let is_sent = self.fleet.send(index, pass.to, "pass", out);
        if is_sent {
            self.tasks.each[index] = VehicleTask::OnPass(pass);
        }
        is_sent
    }

    /// Sends a vehicle to the next pass, planned on the estimate of now: that whose turn it is, or the free one that
    /// tells most.
    fn next_pass(&mut self, index: usize, now: SimTime, out: &mut Outbox) {
        let Some(track) = self.fleet.vehicles[index]
            .track
            .filter(|_| self.model.is_some())
        else {
            return;
        };
        let Some(crossing) = passes::in_order(self.phase, self.tasks.next_pass) else {
            let mut passes = self.informative_passes(index, now).into_iter();
            passes.any(|pass| self.begin_pass(index, pass, out));
            return;
        };
        match self.plan_pass(crossing, track.position.at) {
            // Each shows something of its own: with others in the way, it waits its turn.
            Some(pass) if self.begin_pass(index, pass, out) => self.tasks.next_pass += 1,
            Some(_) if self.tasks.refused < REFUSALS => self.tasks.refused += 1,
            _ => {
                self.tasks.next_pass += 1;
                self.tasks.refused = 0;
            }
        }
    }

    /// Sends a vehicle to the beginning of a pass, or across where it is there already.
    fn begin_pass(&mut self, index: usize, pass: Pass, out: &mut Outbox) -> bool {
        let track = self.fleet.vehicles[index].track;
        let near = track.is_some_and(|t| t.position.at.distance_m(pass.from.at) <= REACHED_M);
        if near && self.is_level_in_time(index, &pass) && self.cross(index, pass, out) {
            return true;
        }
        let is_sent = self.fleet.send(index, pass.from, "to the next pass", out);
        if is_sent {
            self.tasks.each[index] = VehicleTask::Approaching(pass, None);
        }
        is_sent
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
            let is_sent = (0..DRAWS).any(|_| {
                let order = strategy.direct(&sampler, cone_deg, &mut self.rng);
                let again = refused.replace(order) == Some(order);
                !again && self.send_near(index, order, out)
            });
            if !is_sent && !self.fleet.vehicles[index].real {
                self.leave_passes(index, out);
            }
        }
    }

    /// Sends a simulated vehicle that circles in the way of passes, or is on its way to do so, beside them.
    fn leave_passes(&mut self, index: usize, out: &mut Outbox) {
        let v = &self.fleet.vehicles[index];
        let Some(track) = v.track else { return };
        let end = v.order.map_or(track.position, |order| order.to);
        if self.fleet.is_clear_of_passes(index, end) {
            return;
        }
        let places = LEAVE_M.into_iter().flat_map(|far_m| {
            let directions =
                (0..LEAVE_DIRECTIONS).map(|k| f64::from(k) * 360.0 / f64::from(LEAVE_DIRECTIONS));
            directions.map(move |deg| track.position.at.displaced(deg, far_m))
        });
        for at in places {
            let to = Position {
                at,
                height_m: track.position.height_m,
            };
            if self.send_near(index, to, out) {
                return;
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
        let clamped_m = |step: f64| {
            let wanted_m = to.height_m + step * step_m;
            self.fleet.airspace.clamp_at_m(to.at, wanted_m)
        };
        let mut heights = HEIGHT_STEPS.map(clamped_m).to_vec();
        // Also who is in the way of passes already finds its next place elsewhere.
        heights.retain(|&height_m| {
            let end = Position { height_m, ..to };
            self.fleet.vehicles[index].real || self.fleet.is_clear_of_passes(index, end)
        });
        let purpose = "promising point";
        self.fleet
            .send_at_free_height(index, to.at, &heights, purpose, out)
    }
}
