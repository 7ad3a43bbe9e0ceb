//! The order in which the vehicles rise: real ones as soon as they are ready, simulated ones after them and out of
//! their way. A simulated vehicle can wait in the air or on the ground at no risk; a real one has a battery, and people
//! who stand beside it.

use air::geo::Enu;
use protocol::message::Phase;
use protocol::{Outbox, SimTime};

use super::SquadronController;
use super::dispatch::AT_HEIGHT_M;
use crate::tasks::VehicleTask;

/// Least time between two take-offs, s: the next climbs below the one before.
pub(super) const BETWEEN_TAKE_OFFS_S: f64 = 8.0;
/// A neighbour takes off when the one before is this far above the separation in height, m.
const CLEAR_OF_NEXT_M: f64 = 15.0;
/// A vehicle that has not left the ground this long after its order does not hold up the next, s.
const STUCK_S: f64 = 60.0;
/// How long simulated vehicles wait on the ground for a real neighbour that is not ready, s: its link, its
/// identification and its checklist take some 10 s, and a person who answers for a doubt some more.
const READY_WITHIN_S: f64 = 60.0;
/// Directions from the home of a real vehicle that are tried to make room for its climb.
const DIRECTIONS: u8 = 16;
/// A vehicle that makes room comes no nearer to the climb than it must, and this farther off, m: gusts.
const BESIDE_M: f64 = 20.0;
/// Purpose of an order that clears the climb of a real vehicle.
const MAKE_ROOM: &str = "make room";

impl SquadronController {
    /// Lets the vehicles rise, neighbours one after the other, real ones and higher layers first.
    pub(super) fn launch(&mut self, now: SimTime, out: &mut Outbox) {
        if self.phase == Phase::Home {
            return;
        }
        let team = (0..self.fleet.vehicles.len()).filter(|&index| self.may_be_ordered_up(index));
        for next in self.launch_order(team.collect()) {
            if self.fleet.vehicles[next].track.is_some_and(|s| s.airborne) {
                self.tasks.each[next] = VehicleTask::Idle;
            } else if self.may_take_off(next, now) {
                self.tasks.each[next] = VehicleTask::TakingOff(now);
                self.fleet.take_off(next, out);
            }
        }
    }

    /// Parked, ready and not called home.
    fn may_be_ordered_up(&self, index: usize) -> bool {
        let v = &self.fleet.vehicles[index];
        let parked = self.tasks.each[index] == VehicleTask::Parked;
        parked && v.follows_setpoints && !self.tasks.called[index] && v.track.is_some()
    }

    /// Real vehicles first, then the highest layers.
    pub(super) fn launch_order(&self, mut team: Vec<usize>) -> Vec<usize> {
        let vehicles = &self.fleet.vehicles;
        team.sort_by(|&a, &b| {
            let layer = |k: usize| vehicles[k].layer_amsl_m;
            let real_first = vehicles[b].real.cmp(&vehicles[a].real);
            real_first.then(layer(b).total_cmp(&layer(a)))
        });
        team
    }

    /// Whether no neighbour goes first or is still near the ground, the climb is free, and there is time to come
    /// down again.
    fn may_take_off(&self, next: usize, now: SimTime) -> bool {
        let climbs = |other: usize| matches!(self.tasks.each[other], VehicleTask::TakingOff(_));
        let in_the_way = (0..self.fleet.vehicles.len()).any(|other| {
            self.are_neighbours(next, other)
                && (self.comes_down(other)
                    || self.has_just_left(other, now)
                    || self.goes_before(other, next, now))
        });
        !in_the_way && self.fleet.is_climb_free(next, climbs) && self.has_time_for(next, now)
    }

    /// Those who come down have their turn for good.
    fn comes_down(&self, index: usize) -> bool {
        matches!(
            self.tasks.each[index],
            VehicleTask::Returning | VehicleTask::Landing(..)
        )
    }

    /// Whether a simulated vehicle waits on the ground for a real one, which is ready or may be so soon.
    fn goes_before(&self, real: usize, simulated: usize, now: SimTime) -> bool {
        let v = &self.fleet.vehicles[real];
        let parked = self.tasks.each[real] == VehicleTask::Parked && !self.tasks.called[real];
        if !v.real || self.fleet.vehicles[simulated].real || !parked {
            return false;
        }
        if self.may_be_ordered_up(real) {
            self.has_time_for(real, now)
        } else {
            now.since_s(v.not_ready_since) < READY_WITHIN_S
        }
    }

    /// Whether a vehicle that takes off is not yet well above the ground.
    fn has_just_left(&self, index: usize, now: SimTime) -> bool {
        let VehicleTask::TakingOff(since) = self.tasks.each[index] else {
            return false;
        };
        let v = &self.fleet.vehicles[index];
        let airborne = v.track.is_some_and(|s| s.airborne);
        let climbed_m = v.above_home_m().filter(|_| airborne).unwrap_or(0.0);
        let waited_s = now.since_s(since);
        let low = climbed_m < self.clear_of_next_m();
        waited_s < BETWEEN_TAKE_OFFS_S || (low && waited_s < STUCK_S)
    }

    pub(super) fn update_climb(&mut self, index: usize) {
        let v = &self.fleet.vehicles[index];
        let high = v
            .track
            .is_some_and(|s| s.airborne && s.position.height_m > v.layer_amsl_m - AT_HEIGHT_M);
        if matches!(self.tasks.each[index], VehicleTask::TakingOff(_)) && high {
            self.tasks.each[index] = VehicleTask::Idle;
        }
    }

    /// Keeps the climbs of real vehicles that are ready on the ground free of simulated ones, but for those that come
    /// down: they cannot wait.
    pub(super) fn reserve_climbs(&mut self, now: SimTime) {
        let rises = |index: usize| {
            let v = &self.fleet.vehicles[index];
            let on_ground = v.track.is_some_and(|s| !s.airborne);
            let ordered = matches!(self.tasks.each[index], VehicleTask::TakingOff(_));
            let waits = || self.may_be_ordered_up(index) && self.has_time_for(index, now);
            v.real && on_ground && self.phase != Phase::Home && (ordered || waits())
        };
        let rising = (0..self.fleet.vehicles.len()).filter(|&index| rises(index));
        self.fleet.climbs = rising
            .filter_map(|index| self.fleet.climb_of(index))
            .collect();
        for index in 0..self.fleet.vehicles.len() {
            let gives_way = !self.fleet.vehicles[index].real && !self.comes_down(index);
            self.fleet.vehicles[index].gives_way = gives_way;
        }
    }

    /// Sends a vehicle that circles in the climb of a real one, or is on its way to do so, beside it; whether it is
    /// sent, or is in the way and waits for its way out.
    pub(super) fn makes_room(&mut self, index: usize, out: &mut Outbox) -> bool {
        let v = &self.fleet.vehicles[index];
        let climbing = matches!(self.tasks.each[index], VehicleTask::TakingOff(_));
        let is_low = v.above_home_m().is_none_or(|m| m < self.clear_of_next_m());
        let (Some(track), false) = (v.track, climbing && is_low) else {
            return false;
        };
        let end = v.order.map_or(track.position, |order| order.to);
        let Some(climb) = self.fleet.climb_entered(index, end) else {
            return false;
        };
        let beside_m = self.fleet.separation.distance_m + climb.orbit_m + v.circle_m + BESIDE_M;
        let (centre, here) = (climb.to.at, track.position);
        let mut places: Vec<Enu> = (0..DIRECTIONS)
            .map(|k| f64::from(k) * 360.0 / f64::from(DIRECTIONS))
            .map(|deg| centre.displaced(deg, beside_m))
            .collect();
        places.sort_by(|a, b| {
            let off_m = |at: &Enu| at.distance_m(here.at);
            off_m(a).total_cmp(&off_m(b))
        });
        // At its own height it crosses nobody who climbs above or below it.
        let heights = [here.height_m, end.height_m];
        let is_sent = places.into_iter().any(|at| {
            let heights = heights.map(|m| self.fleet.airspace.clamp_at_m(at, m));
            self.fleet
                .send_at_free_height(index, at, &heights, MAKE_ROOM, out)
        });
        if is_sent && climbing {
            self.tasks.each[index] = VehicleTask::Idle;
        }
        true
    }

    /// Height above home at which a vehicle that takes off is out of the way of the next, m.
    fn clear_of_next_m(&self) -> f64 {
        self.fleet.separation.height_m + CLEAR_OF_NEXT_M
    }
}
