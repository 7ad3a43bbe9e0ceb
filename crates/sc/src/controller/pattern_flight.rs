//! Multirotors that fly patterns in place of a search: up, along the places of their patterns, home and down.

use std::collections::VecDeque;

use csea::Position;
use protocol::message::{PathKind, Phase};
use protocol::{Outbox, SimTime};
use scenario::Scenario;
use scenario::pattern::Pattern;
use scenario::tables::VehicleKind;

use super::SquadronController;
use crate::fleet::Order;
use crate::patterns::{PATTERN_MARGIN_M, PatternSite, Waypoint, way_to};
use crate::route_graph::RouteGraph;
use crate::separation::{Corridor, Separation};
use crate::tasks::VehicleTask;

/// A place counts as reached at this distance, m; …
const REACHED_M: f64 = 3.0;
/// … one where nobody stops, this long before it, s: decisions are made once a second.
const AHEAD_S: f64 = 1.5;
/// Least time between two take-offs, s.
const BETWEEN_TAKE_OFFS_S: f64 = 8.0;
/// Decisions for which a place that is not free is waited for before it is left out.
const LONGEST_WAIT: u32 = 60;
/// Slowest descent that is counted on, m/s, and what a way home takes beyond flight and descent, s.
const DESCENT_M_S: f64 = 0.9;
const RESERVE_S: f64 = 60.0;
/// Purposes of orders.
const TO_PATTERN: &str = "to the pattern";
const HOME: &str = "home";

/// What a vehicle does.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Parked,
    Rising,
    Flying,
    Returning,
    Landing,
    Down,
}

/// One vehicle's way through its patterns.
#[derive(Debug, Clone)]
struct Way {
    stage: Stage,
    /// Places that follow.
    places: VecDeque<(Waypoint, &'static str)>,
    /// Lane of its patterns.
    lane: usize,
    /// Number of the pattern that follows.
    next: usize,
    waited: u32,
}

/// The vehicles that fly patterns.
#[derive(Debug, Clone)]
pub(super) struct PatternFlight {
    patterns: Vec<Pattern>,
    separation: Separation,
    routes: RouteGraph,
    /// None for a vehicle that searches.
    each: Vec<Option<Way>>,
    last_take_off: Option<SimTime>,
}

impl PatternFlight {
    /// For the vehicles that can stop; none where the scenario names no pattern or nobody can.
    pub fn of(
        scenario: &Scenario,
        hovers: &[bool],
        airspace: &scenario::airspace::Airspace,
    ) -> Option<Self> {
        let patterns = scenario.search.pattern.clone();
        if patterns.is_empty() || !hovers.contains(&true) {
            return None;
        }
        // Real vehicles fly the nearest lanes, and begin with the first pattern.
        let mut order: Vec<usize> = (0..hovers.len()).filter(|&k| hovers[k]).collect();
        order.sort_by_key(|&k| scenario.vehicles[k].kind == VehicleKind::Simulated);
        let each = (0..hovers.len()).map(|k| {
            let lane = order.iter().position(|&other| other == k)?;
            Some(Way {
                stage: Stage::Parked,
                places: VecDeque::new(),
                lane,
                // Each begins with another pattern.
                next: lane,
                waited: 0,
            })
        });
        Some(Self {
            each: each.collect(),
            patterns,
            separation: Separation {
                distance_m: scenario.fence.separation_m,
                height_m: scenario.fence.separation_height_m,
            },
            routes: RouteGraph::of(airspace, PATTERN_MARGIN_M),
            last_take_off: None,
        })
    }

    /// Whether all vehicles of the team fly patterns.
    pub fn is_all(&self) -> bool {
        self.each.iter().all(Option::is_some)
    }

    fn is_over(&self) -> bool {
        let done = |way: &Way| matches!(way.stage, Stage::Returning | Stage::Landing | Stage::Down);
        self.each.iter().flatten().all(done)
    }
}

impl SquadronController {
    /// The next order of each vehicle that flies a pattern.
    pub(super) fn fly_patterns(&mut self, now: SimTime, out: &mut Outbox) {
        let Some(mut flight) = self.pattern.take() else {
            return;
        };
        let order = self.launch_order((0..flight.each.len()).collect());
        for index in order {
            if let Some(way) = flight.each[index].take() {
                let way = self.fly_pattern(index, way, &mut flight, now, out);
                flight.each[index] = Some(way);
            }
        }
        if flight.is_all() {
            if self.phase == Phase::TakeOff
                && flight
                    .each
                    .iter()
                    .flatten()
                    .any(|w| w.stage == Stage::Flying)
            {
                self.enter_phase(Phase::Search, now, out);
            } else if flight.is_over() && self.phase != Phase::Home {
                self.enter_phase(Phase::Home, now, out);
            }
        }
        self.pattern = Some(flight);
    }

    fn fly_pattern(
        &mut self,
        index: usize,
        mut way: Way,
        flight: &mut PatternFlight,
        now: SimTime,
        out: &mut Outbox,
    ) -> Way {
        self.tasks.each[index] = VehicleTask::OnPattern;
        let v = &self.fleet.vehicles[index];
        let Some(track) = v.track.filter(|_| v.follows_setpoints) else {
            return way;
        };
        let (home, layer_amsl_m) = (v.home, v.layer_amsl_m);
        let above_home = Position {
            at: home.at,
            height_m: layer_amsl_m,
        };
        let left_s =
            self.duration_s - now.s() - self.pattern_way_home_s(track.position, above_home);
        let called = self.tasks.called[index] || left_s <= 0.0;
        match way.stage {
            Stage::Parked => {
                let free = flight
                    .last_take_off
                    .is_none_or(|at| now.since_s(at) >= BETWEEN_TAKE_OFFS_S);
                // A vehicle that is found in the air goes on from there.
                if track.airborne {
                    way.stage = Stage::Flying;
                } else if free && !called {
                    flight.last_take_off = Some(now);
                    way.stage = Stage::Rising;
                    let order = Order {
                        path: PathKind::TakeOff,
                        to: above_home,
                        purpose: "take off",
                    };
                    self.fleet.order(index, order, out);
                }
            }
            Stage::Rising if track.airborne => {
                if track.position.height_m > layer_amsl_m - REACHED_M {
                    way.stage = Stage::Flying;
                }
            }
            Stage::Flying if called => {
                way.stage = Stage::Returning;
                way.places = self.places_to(flight, track.position, above_home, HOME);
                way.waited = 0;
                self.next_place(index, &mut way, flight, out);
            }
            Stage::Flying => {
                if way.places.is_empty() {
                    self.next_pattern(&mut way, flight, track.position);
                }
                if self.has_reached(index) {
                    self.next_place(index, &mut way, flight, out);
                }
            }
            Stage::Returning => {
                if !self.has_reached(index) {
                } else if way.places.is_empty() {
                    way.stage = Stage::Landing;
                    let order = Order {
                        path: PathKind::Land,
                        to: home,
                        purpose: "land",
                    };
                    self.fleet.order(index, order, out);
                } else {
                    self.next_place(index, &mut way, flight, out);
                }
            }
            Stage::Landing if !track.airborne => way.stage = Stage::Down,
            Stage::Rising | Stage::Landing | Stage::Down => {}
        }
        way
    }

    /// Whether a vehicle is at the place of its order, or about to be where nobody stops.
    fn has_reached(&self, index: usize) -> bool {
        let v = &self.fleet.vehicles[index];
        let (Some(track), Some(order)) = (v.track, v.order) else {
            return true;
        };
        if order.path == PathKind::TakeOff {
            return true;
        }
        let passes = order.purpose == Pattern::Spiral.name();
        let reach_m = if passes {
            REACHED_M + AHEAD_S * self.fleet.airspeed_m_s
        } else {
            REACHED_M
        };
        let off_m = (track.position.height_m - order.to.height_m).abs();
        track.position.at.distance_m(order.to.at) <= reach_m && off_m <= REACHED_M
    }

    /// Lays out the next pattern.
    fn next_pattern(&self, way: &mut Way, flight: &PatternFlight, here: Position) {
        let pattern = flight.patterns[way.next % flight.patterns.len()];
        way.next += 1;
        // By what the scenario supposes, for all vehicles alike: lanes about another axis would cross those of before.
        let site = PatternSite::of(&self.base, &self.fleet.airspace);
        // Lanes of vehicles that fly at once lie apart by the separation and some room.
        let lane_m = flight.separation.distance_m + PATTERN_MARGIN_M;
        let places = site.waypoints(pattern, way.lane, lane_m);
        let Some(first) = places.first() else {
            return;
        };
        way.places = self.places_to(flight, here, first.position, TO_PATTERN);
        way.places
            .extend(places.into_iter().map(|place| (place, pattern.name())));
    }

    /// The way to a place, level at the vehicle's height around what stands in the way, then up or down.
    fn places_to(
        &self,
        flight: &PatternFlight,
        here: Position,
        to: Position,
        purpose: &'static str,
    ) -> VecDeque<(Waypoint, &'static str)> {
        let way = way_to(&self.fleet.airspace, &flight.routes, here, to);
        way.into_iter()
            .map(|position| (Waypoint::stop(position), purpose))
            .collect()
    }

    /// Sends a vehicle to its next place, if the way there is free of the others.
    fn next_place(
        &mut self,
        index: usize,
        way: &mut Way,
        flight: &PatternFlight,
        out: &mut Outbox,
    ) {
        let Some(&(place, purpose)) = way.places.front() else {
            return;
        };
        if self.is_straight_way_free(index, place.position, flight)
            || purpose == HOME && way.waited > LONGEST_WAIT
        {
            way.places.pop_front();
            way.waited = 0;
            let order = Order {
                path: PathKind::GoTo,
                to: place.position,
                purpose,
            };
            self.fleet.order(index, order, out);
            return;
        }
        way.waited += 1;
        if way.waited > LONGEST_WAIT && purpose != HOME {
            way.waited = 0;
            way.places.pop_front();
        }
    }

    fn is_straight_way_free(&self, index: usize, to: Position, flight: &PatternFlight) -> bool {
        let Some(track) = self.fleet.vehicles[index].track else {
            return false;
        };
        let own = Corridor::straight(track.position, to, 0.0);
        let others = self.fleet.vehicles.iter().enumerate();
        let mut corridors = others.filter_map(|(other, v)| {
            let there = v.track.filter(|t| other != index && t.airborne)?;
            let to = v.order.map_or(there.position, |order| order.to);
            let circle_m = if flight.each.get(other).is_some_and(Option::is_some) {
                0.0
            } else {
                v.circle_m
            };
            Some(Corridor::straight(there.position, to, circle_m))
        });
        corridors.all(|other| flight.separation.apart(&own, &other))
    }

    /// Time from a place to the ground at home, s.
    fn pattern_way_home_s(&self, here: Position, above_home: Position) -> f64 {
        let level_s = here.at.distance_m(above_home.at) / self.fleet.airspeed_m_s;
        let ground_m = self.base.ground_amsl_m;
        let down_s = (here.height_m.max(above_home.height_m) - ground_m) / DESCENT_M_S;
        1.3 * level_s + down_s + RESERVE_S
    }
}
