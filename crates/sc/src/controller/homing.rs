//! When each vehicle must turn home, the way there, and the landings, neighbours one after the
//! other.
//!
//! A landing goes by a circle beside its approach, downwind of home. Those whose circles and
//! approaches are apart land at the same time, others one after the other; planned from the
//! mission's end backwards, that says when each is to begin, and so when it is called home.

use air::geo::{Enu, wrap_signed_deg};
use protocol::{Outbox, SimTime};

use super::SquadronController;
use super::approaches::{ApproachGeometry, Approaches};
use super::take_off::BETWEEN_TAKE_OFFS_S;
use crate::fleet::{CIRCLE_M, Fleet, MARGIN_M, Order, TeamVehicle};
use crate::tasks::VehicleTask;

/// Where the circle beside the approach is, m downwind of home and to the left of the approach: that
/// of the landing in `fdm` with its default gains (an approach of 4 degrees from 40 m, two loiter
/// radii before it, and one to the side).
const APPROACH_CIRCLE_M: (f64, f64) = (772.0, 100.0);
/// A vehicle that takes off may come this far from its home before it circles above it, m
/// (measured: 190 in 7 m/s of wind).
const TAKE_OFF_M: f64 = 210.0;
/// Height of that circle above home; at which a vehicle counts as come down to it; and below which
/// it has left it for good, m.
const CIRCLE_HEIGHT_M: (f64, f64, f64) = (40.0, 48.0, 33.0);
/// Longest time from coming down to the circle until a vehicle has left it, s: a turn in it and
/// the level part of the final (measured: 47 to 62).
const IN_CIRCLE_S: f64 = 65.0;
/// From there to the ground, s (measured: 42 to 50).
const FINAL_S: f64 = 55.0;
/// A vehicle that leaves its circle above home for the one beside its approach may turn out of it by
/// this, m: the width of one turn.
const TURN_OUT_M: f64 = CIRCLE_M;
/// A vehicle this far from the middle of the circle on a course within this of the approach's has left
/// it for its final, m and degrees …
const ON_FINAL: (f64, f64) = (150.0, 45.0);
/// … and from there is out of the way of the next within this, s (against 7 m/s of wind).
const FINAL_CLEAR_S: f64 = 20.0;
/// Slowest and fastest descent of a vehicle that is on its way down, m/s (measured: 2.0 to 2.3).
const SINK_M_S: (f64, f64) = (2.0, 2.4);
/// A vehicle comes down above its home to this far above the lowest level before it lands, m: a
/// landing from higher up would keep its neighbours from theirs all the while.
const LAND_FROM_M: f64 = 60.0;
/// How long a vehicle that goes round again keeps the next from landing, s.
const ROUND_AGAIN_S: f64 = 90.0;
/// Most vehicles that a landing may have to wait for, unless more are in its way: the reserves below were measured for
/// teams of up to so many, in a row in which each is in the way of 16 others. Those of a longer row do not wait for more.
const MEASURED_TEAM: usize = 30;
/// Time kept in reserve for that, s, and for each vehicle that a landing may have to wait for: in a large team each waits
/// for many.
const RESERVE_S: (f64, f64) = (60.0, 7.0);
/// Time that the way home may take longer than planned, s, and for each vehicle that may be in the
/// way (measured: teams of 6 lose up to 80 s, of 30 up to 220 s).
const DETOUR_S: (f64, f64) = (45.0, 4.0);
/// Factor on the time between two landings in each other's way, and what each vehicle of the team adds
/// to it: the more there are, the higher up the next one still is when its turn comes (measured: teams
/// of 6 need up to 1.2 of what one after the other from the lowest level would, of 27 up to 1.5).
const BETWEEN: (f64, f64) = (1.15, 0.015);
/// Factor on the time of the way home: for turns, and around what stands in the way.
const DETOUR: f64 = 1.25;
/// Speed over ground against the wind that is counted on, and that a vehicle is to have at least, m/s.
pub const LEAST_OVER_GROUND_M_S: f64 = 3.0;
/// Shortest work worth a take-off, s.
const LEAST_WORK_S: f64 = 60.0;
/// Climb that is counted on, m/s.
const CLIMB_M_S: f64 = 2.0;
/// A mission that is too short for one vehicle to come down again goes home no earlier than this
/// part of it.
const HOME_FROM: f64 = 0.55;
/// Purpose of an order that brings a vehicle above its home.
const HOME: &str = "home";
/// Purpose of an order that brings it to another height first.
const BY_STAGES: &str = "home in stages";

/// The approaches of a team against a wind that blows towards `downwind_deg`.
pub(super) fn approaches_of(fleet: &Fleet, downwind_deg: f64) -> Approaches {
    let geometry = ApproachGeometry {
        circle_m: APPROACH_CIRCLE_M,
        apart_m: fleet.separation.distance_m + 2.0 * CIRCLE_M + TURN_OUT_M,
    };
    let homes = fleet.vehicles.iter().map(|v| v.home.at).collect();
    Approaches::new(homes, geometry, downwind_deg)
}

/// How many vehicles are in the air.
#[derive(Debug, Clone, Copy)]
struct Up {
    all: usize,
    real: usize,
}

impl SquadronController {
    /// When the last vehicle at work must turn home, s.
    pub(super) fn home_time_s(&self) -> f64 {
        let at_work = self.calls_s().into_iter().filter(|c| self.works(c.0));
        at_work.fold(f64::NEG_INFINITY, |last_s, (_, call_s)| last_s.max(call_s))
    }

    /// Whether all that have risen were called home.
    pub(super) fn all_come_home(&self) -> bool {
        let home = |t: &VehicleTask| matches!(t, VehicleTask::Returning | VehicleTask::Landing(..));
        let tasks = &self.tasks.each;
        let rest = |t: &VehicleTask| home(t) || *t == VehicleTask::Parked;
        tasks.iter().any(home) && tasks.iter().all(rest)
    }

    /// Calls home those for whom it is time, or whom the operator calls.
    pub(super) fn recall(&mut self, now: SimTime) {
        for (index, call_s) in self.calls_s() {
            if (now.s() >= call_s || self.tasks.called[index]) && self.works(index) {
                self.tasks.each[index] = VehicleTask::Returning;
            }
        }
    }

    /// Calls all home that are in the air.
    pub(super) fn recall_all(&mut self) {
        for index in 0..self.fleet.vehicles.len() {
            if self.works(index) {
                self.tasks.each[index] = VehicleTask::Returning;
            }
        }
    }

    /// In the air, and neither climbing nor called home.
    fn works(&self, index: usize) -> bool {
        !matches!(
            self.tasks.each[index],
            VehicleTask::Parked
                | VehicleTask::TakingOff(_)
                | VehicleTask::OnPattern
                | VehicleTask::Returning
                | VehicleTask::Landing(..)
        )
    }

    /// Whether a vehicle that takes off now has time to work before it must turn home, with all
    /// others still landing in time. In a mission too short for anybody, all fly.
    pub(super) fn has_time_for(&self, next: usize, now: SimTime) -> bool {
        let climb_s = |v: &TeamVehicle| {
            let low_m = v.track.map_or(v.home.height_m, |s| s.position.height_m);
            (v.layer_amsl_m - low_m).max(0.0) / CLIMB_M_S
        };
        let team: Vec<usize> = (0..self.fleet.vehicles.len())
            .filter(|&k| k == next || self.is_up(k))
            .collect();
        let up = self.up();
        self.is_too_short()
            || self
                .landing_starts_s(&team)
                .into_iter()
                .all(|(index, start_s)| {
                    let v = &self.fleet.vehicles[index];
                    let begun = matches!(
                        self.tasks.each[index],
                        VehicleTask::Returning | VehicleTask::Landing(..)
                    );
                    let work_s = if index == next { LEAST_WORK_S } else { 0.0 };
                    let least_s = climb_s(v) + work_s + self.way_home_s(index, up);
                    begun && start_s >= now.s() || start_s >= now.s() + least_s
                })
    }

    /// How many of the team, in the order in which they rise, have time to take off one after the
    /// other, work and land by the mission's end; and how long a mission would have to be for all, s.
    /// As far as can be told before the start; `in_flight` are those of the team that start in flight.
    pub fn time_for_team(&self, in_flight: &[bool]) -> (usize, f64) {
        let rises = |index: usize| !in_flight.get(index).copied().unwrap_or_default();
        let order = self.launch_order((0..self.fleet.vehicles.len()).collect());
        let missing_s = |count: usize| {
            let starts = self.landing_starts_s(&order[..count]);
            let each = starts.into_iter().map(|(index, start_s)| {
                let v = &self.fleet.vehicles[index];
                let climb_m = v.layer_amsl_m - v.home.height_m;
                let climb_s = if rises(index) {
                    climb_m / CLIMB_M_S
                } else {
                    0.0
                };
                let way_s = self.detour_s(index, count);
                climb_s + LEAST_WORK_S + way_s - start_s
            });
            let rising = order[..count].iter().filter(|&&index| rises(index)).count();
            let rises_s = BETWEEN_TAKE_OFFS_S * rising as f64;
            rises_s + each.fold(f64::NEG_INFINITY, f64::max)
        };
        let fits = (1..=order.len()).take_while(|&count| missing_s(count) <= 0.0);
        (fits.count(), self.duration_s + missing_s(order.len()))
    }

    fn is_up(&self, index: usize) -> bool {
        let climbs = matches!(self.tasks.each[index], VehicleTask::TakingOff(_));
        climbs || self.fleet.vehicles[index].is_commandable()
    }

    /// Whether the mission ends before one vehicle alone could rise, work and come down.
    fn is_too_short(&self) -> bool {
        let vehicles = self.fleet.vehicles.iter().enumerate();
        let mut least_s = vehicles.map(|(index, v)| {
            let climb_s = (v.layer_amsl_m - v.home.height_m) / CLIMB_M_S;
            let down_s = self.duration_s - self.last_landing_start_s(index, 1);
            climb_s + LEAST_WORK_S + down_s + DETOUR_S.0
        });
        least_s.all(|least_s| least_s > self.duration_s)
    }

    /// When each vehicle in the air must turn home to be down in time, s.
    fn calls_s(&self) -> Vec<(usize, f64)> {
        let team: Vec<usize> = (0..self.fleet.vehicles.len())
            .filter(|&k| self.is_up(k))
            .collect();
        let earliest_s = if self.is_too_short() {
            HOME_FROM * self.duration_s
        } else {
            0.0
        };
        let up = self.up();
        let starts = self.landing_starts_s(&team).into_iter();
        starts
            .map(|(index, start_s)| {
                let way_s = self.way_home_s(index, up);
                (index, (start_s - way_s).max(earliest_s))
            })
            .collect()
    }

    /// When each of `team` is to begin its landing at the latest, s: planned backwards from the
    /// mission's end, real vehicles last, since they measure, and then the highest layer; those that are in each other's
    /// way one after the other.
    fn landing_starts_s(&self, team: &[usize]) -> Vec<(usize, f64)> {
        let mut order = team.to_vec();
        let vehicles = &self.fleet.vehicles;
        order.sort_by(|&a, &b| {
            let (a, b) = (&vehicles[a], &vehicles[b]);
            let real_last = b.real.cmp(&a.real);
            real_last.then(b.layer_amsl_m.total_cmp(&a.layer_amsl_m))
        });
        let mut planned: Vec<Option<f64>> = vec![None; vehicles.len()];
        let mut starts: Vec<(usize, f64)> = Vec::with_capacity(team.len());
        for index in order {
            let low_m = self.lowest_wait_m(index);
            let in_turn = self.in_turn(index, team.len());
            let factor = BETWEEN.0 + BETWEEN.1 * in_turn as f64;
            let between_s = factor * (circle_left_s(low_m) - self.circle_reached_s(low_m));
            let later = self.approaches.neighbours(index).filter_map(|k| planned[k]);
            let last_s = self.last_landing_start_s(index, team.len());
            let start_s = later.fold(last_s, |s, other_s| s.min(other_s - between_s));
            planned[index] = Some(start_s);
            starts.push((index, start_s));
        }
        starts
    }

    /// When a vehicle of a team of `team` in the air is to begin its landing at the latest if nobody is in its way, s.
    fn last_landing_start_s(&self, index: usize, team: usize) -> f64 {
        let low_m = self.lowest_wait_m(index);
        let reserve_s = RESERVE_S.0 + RESERVE_S.1 * self.in_turn(index, team) as f64;
        self.duration_s - reserve_s - circle_left_s(low_m) - FINAL_S
    }

    /// How many of a team of `team` in the air a landing may have to wait for, one after the other.
    fn in_turn(&self, index: usize, team: usize) -> usize {
        let near = 1 + self.approaches.neighbours(index).count();
        team.min(near.max(MEASURED_TEAM))
    }

    /// What `others` that come home as well may cost a vehicle, s.
    fn detour_s(&self, index: usize, others: usize) -> f64 {
        DETOUR_S.0 + DETOUR_S.1 * self.in_turn(index, others) as f64
    }

    /// Lowest height above its home at which a vehicle waits for its landing, m.
    fn lowest_wait_m(&self, index: usize) -> f64 {
        let home_m = self.fleet.vehicles[index].home.height_m;
        self.levels_amsl_m[0] - home_m
    }

    /// Time that a vehicle needs to above its home and down to where it waits while others are `up`, s.
    fn way_home_s(&self, index: usize, up: Up) -> f64 {
        let vehicle = &self.fleet.vehicles[index];
        // Real ones find only real ones in their way.
        let detour_s = self.detour_s(index, if vehicle.real { up.real } else { up.all });
        let Some(track) = vehicle.track.filter(|s| s.airborne) else {
            return detour_s;
        };
        let here = track.position;
        let distance_m = here.at.distance_m(vehicle.home.at);
        let wind = self.base.wind.at(here.height_m - self.base.ground_amsl_m);
        let (sin, cos) = here.at.bearing_deg(vehicle.home.at).to_radians().sin_cos();
        let along = wind.east_m_s * sin + wind.north_m_s * cos;
        let across = wind.east_m_s * cos - wind.north_m_s * sin;
        let airspeed = self.fleet.airspeed_m_s;
        // The wind triangle: what is left of the airspeed after holding against the crosswind, plus
        // the wind along the way.
        let over_ground = (airspeed.powi(2) - across.powi(2)).max(1.0).sqrt() + along;
        let level_s = DETOUR * distance_m / over_ground.max(LEAST_OVER_GROUND_M_S);
        let down_s = (here.height_m - self.levels_amsl_m[0]).max(0.0) / SINK_M_S.0;
        // Who comes home alone, after all others, goes down on its way; one of several may find lower ways taken.
        let flown_s = if vehicle.real && up.real <= 1 {
            level_s.max(down_s)
        } else {
            level_s + down_s
        };
        flown_s + detour_s
    }

    /// How many are in the air.
    fn up(&self) -> Up {
        let vehicles = self.fleet.vehicles.iter().enumerate();
        let up = vehicles.filter(|(k, _)| self.is_up(*k));
        up.fold(Up { all: 0, real: 0 }, |up, (_, v)| Up {
            all: up.all + 1,
            real: up.real + usize::from(v.real),
        })
    }

    /// Centre of the circle beside a vehicle's approach, as far as the wind is known.
    fn approach_of(&self, index: usize) -> Enu {
        self.approaches.circle(index)
    }

    /// Whether the landings of two vehicles are in each other's way.
    fn share_approach(&self, a: usize, b: usize) -> bool {
        self.approaches.meet(a, b)
    }

    /// Whether two vehicles are in each other's way where they take off.
    pub(super) fn are_neighbours(&self, a: usize, b: usize) -> bool {
        let home = |k: usize| self.fleet.vehicles[k].home.at;
        let apart_m = self.fleet.separation.distance_m + 2.0 * TAKE_OFF_M;
        a != b && home(a).distance_m(home(b)) < apart_m
    }

    /// Time before which a vehicle at a height above home, ordered to land, is well above the circle,
    /// s.
    fn circle_reached_s(&self, above_home_m: f64) -> f64 {
        let above_m = above_home_m - CIRCLE_HEIGHT_M.0 - self.fleet.separation.height_m;
        above_m.max(0.0) / SINK_M_S.1
    }

    /// Brings a vehicle above its home, as near to its own height as it is free to come: those who wait
    /// are lower. There it goes lower and lower, as those below it land.
    pub(super) fn bring_home(&mut self, index: usize, out: &mut Outbox) {
        let v = &self.fleet.vehicles[index];
        let (Some(track), Some(at)) = (
            v.track,
            self.fleet.airspace.nearest_allowed(v.home.at, MARGIN_M),
        ) else {
            return;
        };
        let here_m = track.position.height_m;
        let mut heights = self.levels_amsl_m.clone();
        let waits = self.waits_above_home(index);
        let is_under_way = v.order.is_some_and(|o| o.purpose == HOME) && !v.is_held_up();
        match v.order {
            // Real vehicles go down on their way as soon as it is free.
            Some(order) if waits || is_under_way && v.real => {
                let lower_m = order.to.height_m - self.fleet.separation.height_m;
                heights.retain(|&h| h < lower_m);
            }
            _ if is_under_way => return,
            _ => {
                heights.push(self.fleet.airspace.clamp_at_m(at, here_m));
                // As far as it is free; the others keep clear below those who wait.
                let rank = |h: &f64| match v.real {
                    true if *h <= here_m => *h,
                    _ => here_m + (h - here_m).abs(),
                };
                heights.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
            }
        }
        let sent = self
            .fleet
            .send_at_free_height(index, at, &heights, HOME, out);
        if !sent && !waits && !is_under_way {
            self.change_height(index, at, &heights, out);
        }
    }

    /// Lets a vehicle whose way home is free at none of the heights between climb or go down where it
    /// is, to the first of `heights_amsl_m` at which the way is free.
    fn change_height(&mut self, index: usize, home: Enu, heights_amsl_m: &[f64], out: &mut Outbox) {
        let v = &self.fleet.vehicles[index];
        let under_way = v.order.is_some_and(|o| o.purpose == BY_STAGES) && !v.is_level();
        let Some(track) = v.track.filter(|_| !under_way) else {
            return;
        };
        let here = match v.order {
            Some(order) if v.is_at(order.to) => order.to.at,
            _ => track.position.at,
        };
        if let Some(height_m) = self.fleet.free_level(index, home, heights_amsl_m) {
            self.fleet
                .send_at_free_height(index, here, &[height_m], BY_STAGES, out);
        }
    }

    /// Keeps the ways down of those above home free.
    pub(super) fn reserve_ways_down(&mut self) {
        let way = |index: usize| {
            let v = &self.fleet.vehicles[index];
            Some((index, v.landing(self.approach_of(index))?))
        };
        self.fleet.ways_down = self.wait_above_home().into_iter().filter_map(way).collect();
    }

    /// Those above home that wait for their landing, the lowest first.
    fn wait_above_home(&self) -> Vec<usize> {
        let height_m = |index: usize| {
            let track = self.fleet.vehicles[index].track;
            track.map_or(f64::INFINITY, |s| s.position.height_m)
        };
        let mut waiting: Vec<usize> = (0..self.fleet.vehicles.len())
            .filter(|&index| self.waits_above_home(index))
            .collect();
        waiting.sort_by(|&a, &b| height_m(a).total_cmp(&height_m(b)));
        waiting
    }

    /// Whether a vehicle was called home and circles there.
    fn waits_above_home(&self, index: usize) -> bool {
        let v = &self.fleet.vehicles[index];
        let returning = self.tasks.each[index] == VehicleTask::Returning;
        let there = |order: Order| {
            Some(order.to.at) == self.fleet.airspace.nearest_allowed(v.home.at, MARGIN_M)
        };
        returning && v.has_arrived() && v.is_commandable() && v.order.is_some_and(there)
    }

    /// Those above home land, the lowest first, each when its way down is free.
    pub(super) fn land_in_turn(&mut self, now: SimTime, out: &mut Outbox) {
        self.note_low(now);
        for next in self.wait_above_home() {
            if self.may_land(next, now) {
                self.tasks.each[next] = VehicleTask::Landing(now, None);
                let approach = self.approach_of(next);
                self.fleet.land(next, approach, out);
            }
        }
    }

    /// Notes who has come down to the circle beside its approach.
    fn note_low(&mut self, now: SimTime) {
        for (task, v) in self.tasks.each.iter_mut().zip(&self.fleet.vehicles) {
            if let VehicleTask::Landing(_, low @ None) = task
                && v.above_home_m().is_some_and(|h| h < CIRCLE_HEIGHT_M.1)
            {
                *low = Some(now);
            }
        }
    }

    /// Whether the way down is free, and vehicles that land before will have left the circle.
    fn may_land(&self, next: usize, now: SimTime) -> bool {
        let height_m = self.fleet.vehicles[next].above_home_m();
        if height_m.is_none_or(|h| h > self.lowest_wait_m(next) + LAND_FROM_M) {
            return false;
        }
        let lands = |other: usize| matches!(self.tasks.each[other], VehicleTask::Landing(..));
        let in_turn = (0..self.fleet.vehicles.len())
            .filter(|&other| lands(other) && self.share_approach(next, other))
            .all(|other| self.leaves_in_time(other, next, now));
        let approach = self.approach_of(next);
        let apart = |other: usize| !lands(other) || !self.share_approach(next, other);
        in_turn && self.fleet.is_way_down_free(next, approach, apart)
    }

    /// Whether a vehicle that is low has left the circle beside its approach towards home.
    fn is_on_final(&self, landing: usize) -> bool {
        let (circle, v) = (self.approach_of(landing), &self.fleet.vehicles[landing]);
        v.track.is_some_and(|s| {
            let home_deg = s.position.at.bearing_deg(v.home.at);
            let off_deg = wrap_signed_deg(home_deg - s.course_deg).abs();
            s.position.at.distance_m(circle) > ON_FINAL.0 && off_deg < ON_FINAL.1
        })
    }

    /// Whether a vehicle that lands has left the circle before `next`, ordered now, can reach it.
    fn leaves_in_time(&self, landing: usize, next: usize, now: SimTime) -> bool {
        let VehicleTask::Landing(since, low) = self.tasks.each[landing] else {
            return true;
        };
        let v = &self.fleet.vehicles[landing];
        let (Some(height_m), Some(next_m)) =
            (v.above_home_m(), self.fleet.vehicles[next].above_home_m())
        else {
            return true;
        };
        let airborne = v.track.is_some_and(|s| s.airborne);
        if !airborne || (low.is_some() && height_m < CIRCLE_HEIGHT_M.2) {
            return true;
        }
        let left_s = match low {
            None => circle_left_s(height_m),
            Some(_) if self.is_on_final(landing) => FINAL_CLEAR_S,
            Some(low) => IN_CIRCLE_S - now.since_s(low),
        };
        if left_s <= 0.0 {
            // It should have left: it goes round again.
            return now.since_s(since) > circle_left_s(next_m) + ROUND_AGAIN_S;
        }
        let above_m = next_m - height_m;
        above_m >= self.fleet.separation.height_m && self.circle_reached_s(next_m) >= left_s
    }
}

/// Time after its order to land at which a vehicle at a height above home has left the circle
/// beside its approach at the latest, s.
fn circle_left_s(above_home_m: f64) -> f64 {
    (above_home_m - CIRCLE_HEIGHT_M.1).max(0.0) / SINK_M_S.0 + IN_CIRCLE_S
}
