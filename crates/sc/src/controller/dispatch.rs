//! The order of each vehicle in a phase, decided once a second.

use csea::{Position, PromisingPoint, choose_within_cone};
use protocol::message::Phase;
use protocol::{Outbox, SimTime};

use super::SquadronController;
use crate::fleet::MARGIN_M;
use crate::passes::{self, CHARACTERISE, PRELIMINARY, PassKind};
use crate::tasks::VehicleTask;

/// A vehicle is at its height when it is this near to it, m.
const AT_HEIGHT_M: f64 = 12.0;
/// Longest wait for the height at the beginning of a pass, s.
const WAIT_FOR_HEIGHT_S: f64 = 75.0;
/// Least time between two take-offs, s: the next climbs below the one before.
const BETWEEN_TAKE_OFFS_S: f64 = 8.0;
/// A vehicle that has not left the ground this long after its order does not hold up the next, s.
const STUCK_S: f64 = 60.0;
/// Seconds that a pass may be refused because others are in the way before the next kind is tried.
const REFUSALS: usize = 60;
/// Draws of a promising point before a vehicle keeps its last one.
const DRAWS: usize = 12;
/// Heights tried above and below a promising point, in steps of the vertical separation.
const HEIGHT_STEPS: [f64; 7] = [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0];

impl SquadronController {
    /// Gives every vehicle that has nothing to do, or has done it, its next order.
    pub(super) fn direct(&mut self, now: SimTime, out: &mut Outbox) {
        self.launch(now, out);
        for index in 0..self.fleet.vehicles.len() {
            self.update_climb(index);
            if !self.fleet.vehicles[index].is_commandable() {
                continue;
            }
            match self.phase {
                Phase::TakeOff => {}
                Phase::Preliminary | Phase::Characterise if self.fleet.vehicles[index].real => {
                    self.fly_passes(index, now, out);
                }
                Phase::Preliminary => self.hold(index, out),
                Phase::Search | Phase::Characterise => {
                    if self.tasks.each[index] == VehicleTask::Idle {
                        self.tasks.each[index] = VehicleTask::Searching;
                    }
                }
                Phase::Home => self.bring_home(index, out),
            }
        }
        if self.phase == Phase::Home {
            self.land_in_turn(now, out);
        }
    }

    /// Lets the vehicles rise one after the other, real ones and higher layers first.
    fn launch(&mut self, now: SimTime, out: &mut Outbox) {
        if self.phase == Phase::Home {
            return;
        }
        let vehicles = &self.fleet.vehicles;
        let step_m = self.fleet.separation.height_m;
        let busy = (0..vehicles.len()).any(|index| {
            let VehicleTask::TakingOff(since) = self.tasks.each[index] else {
                return false;
            };
            let climbed_m = vehicles[index].track.map_or(0.0, |s| {
                if s.airborne {
                    s.position.height_m - vehicles[index].home.height_m
                } else {
                    0.0
                }
            });
            let waited_s = now.since_s(since);
            waited_s < BETWEEN_TAKE_OFFS_S || (climbed_m < step_m + 15.0 && waited_s < STUCK_S)
        });
        let ready = |index: &usize| {
            let v = &vehicles[*index];
            let parked = self.tasks.each[*index] == VehicleTask::Parked && v.follows_setpoints;
            // In a low band several share a layer: the next rises when the last has left it.
            let up = v.track.is_some_and(|s| s.airborne);
            parked && v.track.is_some() && (up || self.fleet.is_layer_free(*index))
        };
        let key = |index: &usize| (!vehicles[*index].real, *index);
        let Some(next) = (0..vehicles.len()).filter(ready).min_by_key(key) else {
            return;
        };
        if vehicles[next].track.is_some_and(|s| s.airborne) {
            self.tasks.each[next] = VehicleTask::Idle;
        } else if !busy {
            self.tasks.each[next] = VehicleTask::TakingOff(now);
            self.fleet.take_off(next, out);
        }
    }

    fn update_climb(&mut self, index: usize) {
        let v = &self.fleet.vehicles[index];
        let high = v
            .track
            .is_some_and(|s| s.airborne && s.position.height_m > v.layer_amsl_m - AT_HEIGHT_M);
        if matches!(self.tasks.each[index], VehicleTask::TakingOff(_)) && high {
            self.tasks.each[index] = VehicleTask::Idle;
        }
    }

    /// Sends a vehicle out of the way, abeam of the axis, each at its own layer.
    fn hold(&mut self, index: usize, out: &mut Outbox) {
        if self.tasks.each[index] != VehicleTask::Idle {
            return;
        }
        let Some(estimate) = self.estimate() else {
            return;
        };
        // Alternately left and right of the axis, so that the holding places do not crowd.
        let side = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        let beyond_m = 150.0 + 200.0 * (index / 2) as f64;
        let wanted = estimate.source.displaced(
            estimate.axis_deg + side * 75.0,
            self.range.near_m + beyond_m,
        );
        let at = self.fleet.airspace.nearest_allowed(wanted, MARGIN_M);
        let height_m = self.fleet.vehicles[index].layer_amsl_m;
        if let Some(at) = at
            && self
                .fleet
                .send(index, Position { at, height_m }, "hold", out)
        {
            self.tasks.each[index] = VehicleTask::Holding;
        }
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
            VehicleTask::Idle | VehicleTask::Holding | VehicleTask::Searching => {
                self.next_pass(index, out)
            }
            _ => {}
        }
    }

    /// Plans the next pass on the estimate of now, and sends the vehicle to its beginning.
    fn next_pass(&mut self, index: usize, out: &mut Outbox) {
        let (Some(estimate), Some(track)) = (self.estimate(), self.fleet.vehicles[index].track)
        else {
            return;
        };
        let kinds: &[PassKind] = if self.phase == Phase::Preliminary {
            &PRELIMINARY
        } else {
            &CHARACTERISE
        };
        let kind = kinds[self.tasks.next_pass % kinds.len()];
        let airspace = &self.fleet.airspace;
        let here = track.position.at;
        let pass = passes::plan(
            kind, &estimate, &self.base, airspace, self.range, MARGIN_M, here,
        );
        match pass {
            // Each kind shows something of its own: with others in the way, it waits its turn.
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

    /// Each searching vehicle takes a promising point ahead of it to which it may be sent.
    pub(super) fn follow(&mut self, points: &[PromisingPoint], out: &mut Outbox) {
        let step_m = self.fleet.separation.height_m;
        for index in 0..self.fleet.vehicles.len() {
            let v = &self.fleet.vehicles[index];
            let (Some(track), VehicleTask::Searching) = (v.track, self.tasks.each[index]) else {
                continue;
            };
            if !v.is_commandable() {
                continue;
            }
            // A point whose way is taken by another vehicle is drawn again; after a few draws the
            // old order stands, which is safe.
            for _ in 0..DRAWS {
                let cone_deg = self.search.cone_deg;
                let here = track.position;
                let drawn =
                    choose_within_cone(points, here, track.course_deg, cone_deg, &mut self.rng);
                let Some(drawn) = drawn else { break };
                let heights = HEIGHT_STEPS.map(|step| {
                    let wanted_m = drawn.position.height_m + step * step_m;
                    self.fleet.airspace.clamp_height_m(wanted_m)
                });
                let at = drawn.position.at;
                let purpose = "promising point";
                if self
                    .fleet
                    .send_at_free_height(index, at, &heights, purpose, out)
                {
                    break;
                }
            }
        }
    }
}
