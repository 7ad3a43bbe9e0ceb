//! What each vehicle does in each phase, decided once a second.

use air::geo::Enu;
use csea::{Position, PromisingPoint, choose_within_cone};
use protocol::message::Phase;
use protocol::{Outbox, SimTime};

use crate::controller::SquadronController;
use crate::fleet::{Fleet, MARGIN_M, Vehicle};
use crate::passes::{self, Belief, CHARACTERISE, PRELIMINARY, Pass, PassKind};

/// A vehicle is at its height when it is this near to it, m.
const AT_HEIGHT_M: f64 = 12.0;
/// A vehicle is at its layer when it is this near to it, m: layers are close to each other.
const AT_LAYER_M: f64 = 3.0;
/// Longest wait for the height at the beginning of a pass, s.
const WAIT_FOR_HEIGHT_S: f64 = 75.0;
/// Least time between two take-offs, s: the next climbs below the one before.
const BETWEEN_TAKE_OFFS_S: f64 = 8.0;
/// A vehicle that has not left the ground this long after its order does not hold up the next, s.
const STUCK_S: f64 = 60.0;
/// Take-off is over for those who are still on the ground after this, s.
const LONGEST_TAKE_OFF_S: f64 = 240.0;
/// The preliminary flight ends at this part of the mission at the latest.
const PRELIMINARY_UNTIL: f64 = 0.45;
/// Passes of a preliminary flight, at least and at most.
const PRELIMINARY_PASSES: (usize, usize) = (5, 18);
/// Seconds that a pass may be refused because others are in the way before the next kind is tried.
const REFUSALS: usize = 60;
/// Part of the mission kept for characterisation.
const CHARACTERISE_PART: f64 = 0.15;
/// A mission goes home no earlier than this part of it.
const HOME_FROM: f64 = 0.55;
/// Time between the orders of two landings at least, s.
const BETWEEN_LANDINGS_S: f64 = 25.0;
/// Time of a landing without its descent from the vehicle's layer, s: to the circle beside the
/// approach and the last turn in it, and the final.
const LANDING_S: (f64, f64) = (30.0, 55.0);
/// Height of that circle above home, and below which a vehicle has left it, m.
const CIRCLE_M: (f64, f64) = (40.0, 33.0);
/// Fastest descent of a vehicle that lands, m/s.
const SINK_M_S: f64 = 3.0;
/// How long a vehicle that goes round again keeps the next from landing, s.
const ROUND_AGAIN_S: f64 = 90.0;
/// Time kept in reserve for that, and for those who come home by stages, s.
const RESERVE_S: f64 = 60.0;
/// A vehicle that lands may come this far from its home on its approach, m.
const APPROACH_M: f64 = 1200.0;
/// Vertical speed that a vehicle is counted on to have, m/s.
const CLIMB_M_S: f64 = 2.0;
/// Draws of a promising point before a vehicle keeps its last one.
const DRAWS: usize = 12;
/// Heights tried above and below a promising point, in steps of the vertical separation.
const HEIGHT_STEPS: [f64; 7] = [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0];

/// Purpose of a leg towards home that ends elsewhere.
const BY_STAGES: &str = "home by stages";
/// Places at which a vehicle may go down to its layer on its way home: this far from where it
/// is, m …
const STAGES_M: [f64; 4] = [0.0, 300.0, 600.0, 1000.0];
/// … and this much off the direction of home, degrees.
const STAGE_BEARINGS_DEG: [f64; 8] = [0.0, 40.0, -40.0, 80.0, -80.0, 120.0, -120.0, 180.0];

/// What a vehicle is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Task {
    /// On the ground, not yet told to rise.
    Parked,
    /// Rising since.
    Rising(SimTime),
    /// In the air without anything to do.
    Free,
    /// On the way to the beginning of a pass; there since, waiting for its height.
    Approaching(Pass, Option<SimTime>),
    /// Flying a pass.
    Passing(Pass),
    /// Waiting out of the way.
    Holding,
    /// Following the search.
    Searching,
    /// On the way to above home.
    Returning,
    /// Told to land.
    Landing(SimTime),
}

/// The tasks of all vehicles and the progress of the passes.
#[derive(Debug)]
pub(crate) struct Tasks {
    each: Vec<Task>,
    next_pass: usize,
    passes_flown: usize,
    /// Times in a row that nobody could be sent to the next pass.
    refused: usize,
}

impl Tasks {
    pub(crate) fn new(vehicles: &[Vehicle]) -> Self {
        Self {
            each: vec![Task::Parked; vehicles.len()],
            next_pass: 0,
            passes_flown: 0,
            refused: 0,
        }
    }

    /// Frees those whose work the new phase ends.
    pub(crate) fn start_phase(&mut self, phase: Phase, fleet: &Fleet) {
        self.next_pass = 0;
        self.passes_flown = 0;
        self.refused = 0;
        for (task, vehicle) in self.each.iter_mut().zip(&fleet.vehicles) {
            let in_work = !matches!(task, Task::Parked | Task::Rising(_) | Task::Landing(_));
            let changes = phase != Phase::Characterise || vehicle.real;
            if in_work && changes {
                *task = Task::Free;
            }
        }
    }
}

impl SquadronController {
    /// The phase that is due, if it is another.
    pub(crate) fn next_phase(&self, now: SimTime) -> Option<Phase> {
        let flying = |v: &Vehicle| v.can_be_sent();
        let real = self
            .fleet
            .vehicles
            .iter()
            .filter(|v| v.real && flying(v))
            .count();
        let up = self
            .tasks
            .each
            .iter()
            .any(|t| !matches!(t, Task::Parked | Task::Rising(_)));
        let home_s = self.home_time_s();
        if self.phase < Phase::Home && up && now.s() >= home_s {
            return Some(Phase::Home);
        }
        match self.phase {
            Phase::TakeOff => self.after_take_off(now, real),
            Phase::Preliminary => {
                let (least, most) = PRELIMINARY_PASSES;
                let flown = self.tasks.passes_flown;
                let sharp = flown >= least && self.belief().is_some_and(|b| b.is_sharp());
                let late = now.s() >= PRELIMINARY_UNTIL * self.duration_s;
                (sharp || late || flown >= most || real == 0).then_some(Phase::Search)
            }
            Phase::Search => {
                let due = now.s() >= home_s - CHARACTERISE_PART * self.duration_s;
                (due && real > 0 && self.model.is_some()).then_some(Phase::Characterise)
            }
            Phase::Characterise | Phase::Home => None,
        }
    }

    fn after_take_off(&self, now: SimTime, real: usize) -> Option<Phase> {
        let risen =
            |index: usize| !matches!(self.tasks.each[index], Task::Parked | Task::Rising(_));
        let all = |want_real: bool| {
            let of_kind = |(_, v): &(usize, &Vehicle)| v.real || !want_real;
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

    /// When the team must turn home to be down at the mission's end, s.
    fn home_time_s(&self) -> f64 {
        let flying = self.fleet.vehicles.iter().filter(|v| v.can_be_sent());
        let slowest_s = flying.map(|v| self.way_home_s(v)).fold(0.0, f64::max);
        (self.duration_s - slowest_s - self.landing_s()).max(HOME_FROM * self.duration_s)
    }

    /// Time that the team needs from above home to the ground, s: in turn from the lowest layer.
    fn landing_s(&self) -> f64 {
        let mut team: Vec<&Vehicle> = self.fleet.vehicles.iter().collect();
        team.sort_by(|a, b| a.layer_amsl_m.total_cmp(&b.layer_amsl_m));
        let (mut order_s, mut down_s) = (0.0, 0.0_f64);
        for (k, vehicle) in team.iter().enumerate() {
            if k > 0 {
                let free_s = self.circle_left_s(team[k - 1]) - self.circle_reached_s(vehicle);
                order_s += free_s.max(BETWEEN_LANDINGS_S);
            }
            down_s = down_s.max(order_s + self.circle_left_s(vehicle) + LANDING_S.1);
        }
        down_s + RESERVE_S
    }

    /// Time after its order to land at which a vehicle has left the circle beside the approach at
    /// the latest, s.
    fn circle_left_s(&self, vehicle: &Vehicle) -> f64 {
        LANDING_S.0 + (vehicle.layer_amsl_m - vehicle.home.height_m).max(0.0) / CLIMB_M_S
    }

    /// Time after its order to land before which a vehicle is well above that circle, s.
    fn circle_reached_s(&self, vehicle: &Vehicle) -> f64 {
        let above_m = vehicle.layer_amsl_m - vehicle.home.height_m - CIRCLE_M.0;
        (above_m - self.fleet.separation.height_m).max(0.0) / SINK_M_S
    }

    /// Whether a vehicle that was told to land at `since` may still be in the circle when `next`,
    /// told now, could reach it.
    fn holds_the_circle(&self, index: usize, since: SimTime, next: &Vehicle, now: SimTime) -> bool {
        let vehicle = &self.fleet.vehicles[index];
        let high = vehicle.seen.is_some_and(|s| {
            s.airborne && s.position.height_m > vehicle.home.height_m + CIRCLE_M.1
        });
        let (waited_s, left_s) = (now.since_s(since), self.circle_left_s(vehicle));
        let meets = if waited_s <= left_s {
            waited_s + self.circle_reached_s(next) < left_s
        } else {
            // It should have left: it goes round again.
            waited_s < left_s + ROUND_AGAIN_S
        };
        waited_s < BETWEEN_LANDINGS_S || (high && meets)
    }

    /// Time that a vehicle needs to above its home, s.
    fn way_home_s(&self, vehicle: &Vehicle) -> f64 {
        let Some(seen) = vehicle.seen else { return 0.0 };
        let here = seen.position;
        let distance_m = here.at.distance_m(vehicle.home.at);
        let wind = self.base.wind.at(here.height_m - self.base.ground_amsl_m);
        let (sin, cos) = here.at.bearing_deg(vehicle.home.at).to_radians().sin_cos();
        let along = wind.east_m_s * sin + wind.north_m_s * cos;
        let across = wind.east_m_s * cos - wind.north_m_s * sin;
        let airspeed = self.fleet.airspeed_m_s;
        let over_ground = (airspeed.powi(2) - across.powi(2)).max(1.0).sqrt() + along;
        let level_s = 1.15 * distance_m / over_ground.max(3.0);
        // Some go down to their layer first and home then, where others are in the way.
        level_s + 0.6 * (here.height_m - vehicle.layer_amsl_m).abs() / CLIMB_M_S
    }

    /// Gives every vehicle that has nothing to do, or has done it, its next order.
    pub(crate) fn direct(&mut self, now: SimTime, out: &mut Outbox) {
        self.launch(now, out);
        for index in 0..self.fleet.vehicles.len() {
            self.track_rise(index);
            if !self.fleet.vehicles[index].can_be_sent() {
                continue;
            }
            match self.phase {
                Phase::TakeOff => {}
                Phase::Preliminary | Phase::Characterise if self.fleet.vehicles[index].real => {
                    self.fly_passes(index, now, out);
                }
                Phase::Preliminary => self.hold(index, out),
                Phase::Search | Phase::Characterise => {
                    if self.tasks.each[index] == Task::Free {
                        self.tasks.each[index] = Task::Searching;
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
            let Task::Rising(since) = self.tasks.each[index] else {
                return false;
            };
            let climbed_m = vehicles[index].seen.map_or(0.0, |s| {
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
            let parked = self.tasks.each[*index] == Task::Parked && v.obeys;
            // In a low band several share a layer: the next rises when the last has left it.
            let up = v.seen.is_some_and(|s| s.airborne);
            parked && v.seen.is_some() && (up || self.fleet.is_layer_free(*index))
        };
        let key = |index: &usize| (!vehicles[*index].real, *index);
        let Some(next) = (0..vehicles.len()).filter(ready).min_by_key(key) else {
            return;
        };
        if vehicles[next].seen.is_some_and(|s| s.airborne) {
            self.tasks.each[next] = Task::Free;
        } else if !busy {
            self.tasks.each[next] = Task::Rising(now);
            self.fleet.take_off(next, out);
        }
    }

    fn track_rise(&mut self, index: usize) {
        let v = &self.fleet.vehicles[index];
        let high = v
            .seen
            .is_some_and(|s| s.airborne && s.position.height_m > v.layer_amsl_m - AT_HEIGHT_M);
        if matches!(self.tasks.each[index], Task::Rising(_)) && high {
            self.tasks.each[index] = Task::Free;
        }
    }

    /// Sends a vehicle out of the way, abeam of the axis, each at its own layer.
    fn hold(&mut self, index: usize, out: &mut Outbox) {
        if self.tasks.each[index] != Task::Free {
            return;
        }
        let Some(belief) = self.belief() else { return };
        let side = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        let beyond_m = 150.0 + 200.0 * (index / 2) as f64;
        let wanted = belief
            .source
            .displaced(belief.axis_deg + side * 75.0, self.range.near_m + beyond_m);
        let at = self.fleet.airspace.nearest_allowed(wanted, MARGIN_M);
        let height_m = self.fleet.vehicles[index].layer_amsl_m;
        if let Some(at) = at
            && self.fleet.go(index, Position { at, height_m }, "hold", out)
        {
            self.tasks.each[index] = Task::Holding;
        }
    }

    fn fly_passes(&mut self, index: usize, now: SimTime, out: &mut Outbox) {
        match self.tasks.each[index] {
            Task::Approaching(pass, waiting) if self.fleet.vehicles[index].has_arrived() => {
                let since = waiting.unwrap_or(now);
                self.tasks.each[index] = Task::Approaching(pass, Some(since));
                let height_m = self.fleet.vehicles[index].seen.map(|s| s.position.height_m);
                let off_m = height_m.map_or(0.0, |h| (h - pass.from.height_m).abs());
                let at_height = off_m <= AT_HEIGHT_M || now.since_s(since) > WAIT_FOR_HEIGHT_S;
                if at_height && self.fleet.go(index, pass.to, "pass", out) {
                    self.tasks.each[index] = Task::Passing(pass);
                }
            }
            Task::Passing(_) if self.fleet.vehicles[index].has_arrived() => {
                self.tasks.passes_flown += 1;
                self.tasks.each[index] = Task::Free;
                self.next_pass(index, out);
            }
            Task::Free | Task::Holding | Task::Searching => self.next_pass(index, out),
            _ => {}
        }
    }

    /// Plans the next pass on what is believed now, and sends the vehicle to its beginning.
    fn next_pass(&mut self, index: usize, out: &mut Outbox) {
        let (Some(belief), Some(seen)) = (self.belief(), self.fleet.vehicles[index].seen) else {
            return;
        };
        let kinds: &[PassKind] = if self.phase == Phase::Preliminary {
            &PRELIMINARY
        } else {
            &CHARACTERISE
        };
        let kind = kinds[self.tasks.next_pass % kinds.len()];
        let airspace = &self.fleet.airspace;
        let here = seen.position.at;
        let pass = passes::plan(
            kind, &belief, &self.base, airspace, self.range, MARGIN_M, here,
        );
        match pass {
            // Each kind shows something of its own: with others in the way, it waits its turn.
            Some(pass) if self.fleet.go(index, pass.from, "to the next pass", out) => {
                self.tasks.next_pass += 1;
                self.tasks.each[index] = Task::Approaching(pass, None);
            }
            Some(_) if self.tasks.refused < REFUSALS => self.tasks.refused += 1,
            _ => {
                self.tasks.next_pass += 1;
                self.tasks.refused = 0;
            }
        }
    }

    /// Each searching vehicle takes a promising point ahead of it to which it may be sent.
    pub(crate) fn follow(&mut self, points: &[PromisingPoint], out: &mut Outbox) {
        let step_m = self.fleet.separation.height_m;
        for index in 0..self.fleet.vehicles.len() {
            let v = &self.fleet.vehicles[index];
            let (Some(seen), Task::Searching) = (v.seen, self.tasks.each[index]) else {
                continue;
            };
            if !v.can_be_sent() {
                continue;
            }
            for _ in 0..DRAWS {
                let cone_deg = self.search.cone_deg;
                let here = seen.position;
                let drawn =
                    choose_within_cone(points, here, seen.course_deg, cone_deg, &mut self.rng);
                let Some(drawn) = drawn else { break };
                let heights = HEIGHT_STEPS.map(|step| {
                    let wanted_m = drawn.position.height_m + step * step_m;
                    self.fleet.airspace.clamp_height_m(wanted_m)
                });
                let at = drawn.position.at;
                let purpose = "promising point";
                if self.fleet.go_at_one_of(index, at, &heights, purpose, out) {
                    break;
                }
            }
        }
    }

    /// Brings a vehicle above its home at its own layer: straight, or, where others are in the
    /// way, down to its layer at a free place first. Once all are at layers of their own, all
    /// ways home are free.
    fn bring_home(&mut self, index: usize, out: &mut Outbox) {
        let v = &self.fleet.vehicles[index];
        let (Some(seen), Task::Free) = (v.seen, self.tasks.each[index]) else {
            return;
        };
        let (layer_m, home) = (v.layer_amsl_m, v.home.at);
        let off_layer = (seen.position.height_m - layer_m).abs() > AT_LAYER_M;
        let by_stages = v.order.is_some_and(|o| o.purpose == BY_STAGES);
        let Some(at) = self.fleet.airspace.nearest_allowed(home, MARGIN_M) else {
            return;
        };
        if self.fleet.go_at_one_of(index, at, &[layer_m], "home", out) {
            self.tasks.each[index] = Task::Returning;
            return;
        }
        if by_stages && off_layer {
            return;
        }
        let here = seen.position.at;
        let homeward_deg = here.bearing_deg(home);
        let aside = |distance_m: f64| {
            STAGE_BEARINGS_DEG.map(|off_deg| here.displaced(homeward_deg + off_deg, distance_m))
        };
        let places = STAGES_M.into_iter().flat_map(aside).collect::<Vec<_>>();
        for place in places {
            if self
                .fleet
                .go_at_one_of(index, place, &[layer_m], BY_STAGES, out)
            {
                return;
            }
        }
    }

    /// Whether nobody flies at a lower layer near the home of a vehicle, but those who land.
    fn way_down_is_free(&self, index: usize) -> bool {
        let own = &self.fleet.vehicles[index];
        let in_the_way = |(other, v): (usize, &Vehicle)| {
            let near = v
                .seen
                .is_some_and(|s| s.airborne && s.position.at.distance_m(own.home.at) < APPROACH_M);
            let landing = matches!(self.tasks.each[other], Task::Landing(_));
            near && !landing && v.layer_amsl_m < own.layer_amsl_m
        };
        !self.fleet.vehicles.iter().enumerate().any(in_the_way)
    }

    /// Those above home land one after the other, the lowest layer first.
    fn land_in_turn(&mut self, now: SimTime, out: &mut Outbox) {
        let step_m = self.fleet.separation.height_m;
        let there = |index: &usize| {
            let v = &self.fleet.vehicles[*index];
            let low = v
                .seen
                .is_some_and(|s| (s.position.height_m - v.layer_amsl_m).abs() < step_m);
            let returned = self.tasks.each[*index] == Task::Returning && v.has_arrived();
            returned && low && v.can_be_sent() && self.way_down_is_free(*index)
        };
        let layer = |index: &usize| self.fleet.vehicles[*index].layer_amsl_m;
        let lowest = (0..self.fleet.vehicles.len())
            .filter(there)
            .min_by(|a, b| layer(a).total_cmp(&layer(b)));
        let Some(next) = lowest else { return };
        let busy = self.tasks.each.iter().enumerate().any(|(index, task)| {
            let vehicle = &self.fleet.vehicles[next];
            matches!(*task, Task::Landing(since) if self.holds_the_circle(index, since, vehicle, now))
        });
        if !busy {
            self.tasks.each[next] = Task::Landing(now);
            self.fleet.land(next, out);
        }
    }
}

impl Belief {
    /// What the scenario says before anything was measured.
    pub(crate) fn of_base(base: &plume::DispersionSpec) -> Self {
        let first = base.sources.first();
        Self {
            source: first.map_or(Enu::default(), |s| s.place),
            axis_deg: air::wind::towards_deg(base.wind.from_deg()),
            axis_sd_deg: 10.0,
            height_amsl_m: base.ground_amsl_m + first.map_or(0.0, |s| s.effective_height_agl_m),
            height_sd_m: 50.0,
            strength_sd: 1.0,
            sigma_factors: (base.sigma_y_scale, base.sigma_z_scale),
        }
    }
}
