//! The vehicles: where they are, where they are sent, and that every order is safe.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};

use air::geo::{Enu, Geodetic};
use csea::Position;
use protocol::key::Name;
use protocol::message::{Assignment, PathKind, Setpoint, State};
use protocol::{Message, Outbox, SimTime, Topic};
use scenario::world::OFF_HEIGHT_M;

use crate::occupancy::{Column, Occupancy, Occupied};
use crate::route_graph::RouteGraph;
use crate::separation::{Corridor, Separation};
use scenario::airspace::Airspace;
pub use scenario::airspace::SETPOINT_MARGIN_M as MARGIN_M;

/// Radius of the orbit at a setpoint, m: 18 m/s in 10 m/s of wind at 45° of bank takes 80 m.
pub const ORBIT_M: f64 = 80.0;
/// Radius within which a vehicle that turns or circles is kept apart from the others, m: simulated
/// vehicles circle at the loiter radius of `fdm`, and gusts carry them off it.
pub(crate) const CIRCLE_M: f64 = 105.0;
/// The same for a vehicle behind a MAVLink link, m: an ArduPlane asked for an orbit of [`ORBIT_M`] flew up to 114 m
/// from its centre in 8 m/s of wind with turbulence.
pub(crate) const LINKED_CIRCLE_M: f64 = 120.0;
/// A setpoint counts as reached at this distance, m: before the orbit around it begins.
pub(crate) const REACHED_M: f64 = ORBIT_M + 40.0;
/// A vehicle of which nothing has been received for this long is not counted on, s.
const SILENT_S: f64 = 10.0;

/// The last known position and course of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleTrack {
    /// Where it is; height above mean sea level.
    pub position: Position,
    /// Direction in which it moves over ground, degrees; that of its nose when it hardly moves.
    pub course_deg: f64,
    /// In the air.
    pub airborne: bool,
    /// When that was.
    pub time: SimTime,
}

/// The last order of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// The path.
    pub path: PathKind,
    /// The point.
    pub to: Position,
    /// Why, in a word or two.
    pub purpose: &'static str,
}

/// One vehicle of the team.
#[derive(Debug, Clone)]
pub struct TeamVehicle {
    /// Its name on the bus.
    pub name: Name,
    /// Behind MAVLink, a stand-in or a real aircraft.
    pub real: bool,
    /// Radius within which it circles, m.
    pub circle_m: f64,
    /// Where it takes off and lands, at the ground.
    pub home: Position,
    /// Height of its own above home, that no other vehicle shares, m above mean sea level.
    pub layer_amsl_m: f64,
    /// Where it was last.
    pub track: Option<VehicleTrack>,
    /// Whether it follows setpoints: not while a pilot or the Guardian flies it.
    pub follows_setpoints: bool,
    /// Since when it does not, or from the mission's start where it never did.
    pub(crate) not_ready_since: SimTime,
    /// Whether it keeps out of the climbs and the coming passes of real vehicles: not on its way home.
    pub(crate) gives_way: bool,
    /// Its last order.
    pub order: Option<Order>,
    /// Centre of the circle beside its approach, while it lands.
    approach: Option<Enu>,
    /// The parts of legs that follow, around what stands in the way.
    route: VecDeque<Position>,
    /// How many of them belong to this leg, to the next, and so on: over terrain a leg has several.
    parts: VecDeque<usize>,
    silent: bool,
}

impl TeamVehicle {
    /// A vehicle of which nothing has been received yet.
    pub fn new(name: Name, real: bool, home: Position, layer_amsl_m: f64) -> Self {
        Self {
            name,
            real,
            circle_m: CIRCLE_M,
            home,
            layer_amsl_m,
            track: None,
            follows_setpoints: true,
            not_ready_since: SimTime::ZERO,
            gives_way: false,
            order: None,
            approach: None,
            route: VecDeque::new(),
            parts: VecDeque::new(),
            silent: false,
        }
    }

    /// The parts that follow of this leg, or all of the next one where this has no more.
    fn coming_parts(&self) -> impl Iterator<Item = Position> {
        let count = self.parts.iter().copied().find(|&count| count > 0);
        self.route.iter().copied().take(count.unwrap_or(0))
    }

    /// Where it may be in the parts that follow of this leg.
    fn later_parts(&self) -> impl Iterator<Item = Corridor> {
        let count = self
            .parts
            .front()
            .copied()
            .filter(|_| self.is_commandable());
        let parts = self.route.iter().copied().take(count.unwrap_or(0));
        let starts = self.order.into_iter().map(|order| order.to);
        let starts = starts.chain(parts.clone());
        let circle_m = self.circle_m;
        starts
            .zip(parts)
            .map(move |(from, to)| Corridor::straight(from, to, circle_m))
    }

    /// Counts off the part that begins.
    fn begin_part(&mut self) {
        while self.parts.front() == Some(&0) {
            self.parts.pop_front();
        }
        if let Some(count) = self.parts.front_mut() {
            *count -= 1;
        }
    }

    /// Known, in the air and following setpoints.
    pub fn is_commandable(&self) -> bool {
        self.follows_setpoints && !self.silent && self.track.is_some_and(|s| s.airborne)
    }

    /// Whether it is at the end of the way it was sent.
    pub fn has_arrived(&self) -> bool {
        match (self.track, self.order) {
            (Some(track), Some(order)) => {
                self.route.is_empty() && track.position.at.distance_m(order.to.at) <= REACHED_M
            }
            _ => false,
        }
    }

    /// Height above its home, m; none while nothing has been received.
    pub(crate) fn above_home_m(&self) -> Option<f64> {
        Some(self.track?.position.height_m - self.home.height_m)
    }

    /// Where it may be: on the way to its setpoint and around it, or, landing, down to the ground.
    fn corridor(&self) -> Option<Corridor> {
        let track = self.track.filter(|s| s.airborne)?;
        let here = track.position;
        let Some(order) = self.order.filter(|_| self.follows_setpoints) else {
            return Some(Corridor::straight(here, here, self.circle_m));
        };
        Some(match (order.path, self.approach) {
            (PathKind::Land, Some(approach)) => self.landing(approach)?,
            (PathKind::Land, None) => Corridor::straight(here, order.to, self.circle_m),
            // Those who circle already turn no more.
            _ if self.is_at(order.to) => Corridor::straight(
                Position {
                    height_m: here.height_m,
                    ..order.to
                },
                order.to,
                self.circle_m,
            ),
            _ => Corridor::turning(here, track.course_deg, order.to, self.circle_m),
        })
    }

    /// Where it may be until the end of its leg, and the circle at the end of its way.
    fn occupied(&self) -> Occupied {
        let end = self.route.back().filter(|_| self.is_commandable());
        Occupied {
            corridors: self
                .corridor()
                .into_iter()
                .chain(self.later_parts())
                .collect(),
            end: end.map(|&end| Corridor::straight(end, end, self.circle_m)),
        }
    }

    /// Whether it circles at a corner of its way, since the next leg is not free.
    pub(crate) fn is_held_up(&self) -> bool {
        !self.route.is_empty() && self.order.is_some_and(|order| self.is_at(order.to))
    }

    /// Whether it is at the height of its order.
    pub(crate) fn is_level(&self) -> bool {
        let off_m = |order: Order| Some((self.track?.position.height_m - order.to.height_m).abs());
        self.order
            .and_then(off_m)
            .is_some_and(|off_m| off_m < OFF_HEIGHT_M)
    }

    /// Whether it circles at `to`.
    pub(crate) fn is_at(&self, to: Position) -> bool {
        self.track
            .is_some_and(|track| track.position.at.distance_m(to.at) <= self.circle_m)
    }

    /// Where it may be while it lands by the circle around `approach`: all the heights down to
    /// its home.
    pub(crate) fn landing(&self, approach: Enu) -> Option<Corridor> {
        let track = self.track?;
        let down = Position {
            at: approach,
            height_m: self.home.height_m,
        };
        Some(Corridor::turning(
            track.position,
            track.course_deg,
            down,
            self.circle_m,
        ))
    }
}

/// The vehicle whose way is compared with those of the others.
#[derive(Clone, Copy)]
struct Mover<'a> {
    index: usize,
    /// What alone may be in its way, if that is known.
    near: Option<&'a NearWay>,
}

/// What may be in the way of a vehicle, at any height.
struct NearWay {
    vehicles: Vec<usize>,
    /// Places in [`Fleet::ways_down`].
    ways_down: Vec<usize>,
}

impl Mover<'_> {
    fn among_all(index: usize) -> Self {
        Self { index, near: None }
    }
}

/// All vehicles with the rules they fly by.
#[derive(Debug, Clone)]
pub struct Fleet {
    /// Fence, height band and keep-outs.
    pub airspace: Airspace,
    /// Routes around what stands in the way.
    pub routes: RouteGraph,
    /// What vehicles keep between them.
    pub separation: Separation,
    /// Airspeed of the team, m/s.
    pub airspeed_m_s: f64,
    /// The vehicles in the scenario's order.
    pub vehicles: Vec<TeamVehicle>,
    /// Whether any of them is real: every reading asks.
    pub(crate) has_real: bool,
    /// Their places by name.
    pub(crate) places: BTreeMap<Name, usize>,
    /// Passes that real vehicles fly now and next: those who fly none keep clear of them.
    pub(crate) passes: Vec<Corridor>,
    /// Ways down of those who wait for their landing, with whose they are: who does not wait keeps
    /// clear.
    pub(crate) ways_down: Vec<(usize, Corridor)>,
    /// Climbs of real vehicles that are ready on the ground: simulated ones keep clear.
    pub(crate) climbs: Vec<Corridor>,
    /// Real aircraft that are not of the team, as last heard: nobody sends them anywhere, and all keep
    /// clear of them.
    pub(crate) others: BTreeMap<Name, VehicleTrack>,
    /// What all vehicles occupy, while a decision is made: no track changes meanwhile.
    pub(crate) occupancy: Option<Occupancy>,
}

impl Fleet {
    /// The vehicle of that name.
    pub fn index_of(&self, name: &Name) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Another aircraft is in the place of one: what that was to do is void.
    pub(crate) fn swap(&mut self, index: usize, real: bool) {
        let vehicle = &mut self.vehicles[index];
        vehicle.real = real;
        vehicle.circle_m = if real { LINKED_CIRCLE_M } else { CIRCLE_M };
        vehicle.order = None;
        vehicle.approach = None;
        vehicle.route.clear();
        vehicle.parts.clear();
        self.has_real = self.vehicles.iter().any(|v| v.real);
    }

    /// Takes in a vehicle's state; one that is not finite is passed over.
    pub fn observe(&mut self, index: usize, state: &State, time: SimTime) {
        if let Some(track) = self.track(state, time) {
            self.vehicles[index].track = Some(track);
        }
    }

    /// Takes in the state of a real aircraft that is not of the team; says whether it was not known.
    pub(crate) fn observe_other(&mut self, name: &Name, state: &State, time: SimTime) -> bool {
        let track = self.track(state, time);
        track.is_some_and(|track| self.others.insert(name.clone(), track).is_none())
    }

    /// Those of the others that have fallen silent: nobody knows where they are, and so they keep nobody
    /// from anything any more.
    pub(crate) fn others_gone(&mut self, now: SimTime) -> Vec<Name> {
        let silent = |track: &VehicleTrack| now.since_s(track.time) > SILENT_S;
        let gone = self.others.iter().filter(|(_, track)| silent(track));
        let gone: Vec<Name> = gone.map(|(name, _)| name.clone()).collect();
        self.others.retain(|_, track| !silent(track));
        gone
    }

    /// Where a vehicle is by its state; none by one that is not finite.
    fn track(&self, state: &State, time: SimTime) -> Option<VehicleTrack> {
        let [north, east, _] = state.vel_ned_m_s;
        let at = self
            .airspace
            .frame()
            .to_enu(Geodetic::new(state.lat_deg, state.lon_deg));
        let position = Position {
            at,
            height_m: state.alt_amsl_m,
        };
        let numbers = [
            at.east_m,
            at.north_m,
            state.alt_amsl_m,
            north,
            east,
            state.heading_deg,
        ];
        if numbers.iter().any(|n| !n.is_finite()) {
            return None;
        }
        // Hardly moving, the course over ground is noise; the nose is not.
        let course_deg = if north.hypot(east) > 3.0 {
            Enu::default().bearing_deg(Enu::new(east, north))
        } else {
            state.heading_deg
        };
        Some(VehicleTrack {
            position,
            course_deg,
            airborne: state.airborne,
            time,
        })
    }

    /// Vehicles that have just fallen silent (`true`) or are received again (`false`).
    pub fn silences(&mut self, now: SimTime) -> Vec<(usize, bool)> {
        let mut changed = Vec::new();
        for (index, v) in self.vehicles.iter_mut().enumerate() {
            let Some(track) = v.track else { continue };
            let silent = now.since_s(track.time) > SILENT_S;
            if silent != v.silent {
                v.silent = silent;
                changed.push((index, silent));
            }
        }
        changed
    }

    /// Sends a vehicle to `target`, around whatever stands in the way, if the target and the way
    /// are inside the airspace and its first leg is apart from all other vehicles. Says whether
    /// it was sent; otherwise its last order stands.
    pub fn send(
        &mut self,
        index: usize,
        target: Position,
        purpose: &'static str,
        out: &mut Outbox,
    ) -> bool {
        self.send_at_free_height(index, target.at, &[target.height_m], purpose, out)
    }

    /// As [`Fleet::send`], at the first of `heights_amsl_m` that is free.
    pub fn send_at_free_height(
        &mut self,
        index: usize,
        at: Enu,
        heights_amsl_m: &[f64],
        purpose: &'static str,
        out: &mut Outbox,
    ) -> bool {
        let Some(track) = self.vehicles[index].track else {
            return false;
        };
        let Some(way) = self.routes.route(&self.airspace, track.position.at, at) else {
            return false;
        };
        let near = self.near_way(index, track.position.at, &way);
        let mover = Mover {
            index,
            near: near.as_ref(),
        };
        // The first leg is checked against the others, and where it ends up against where they end
        // up: later legs are checked when they are flown, for by then all have moved.
        let free = heights_amsl_m.iter().find_map(|&height_m| {
            let end = Position { at, height_m };
            if !self.airspace.contains(end, MARGIN_M) {
                return None;
            }
            let legs = self.airspace.way(track.position, &way, height_m);
            let is_free = self.is_leg_apart(mover, &legs[0]) && self.is_end_free(mover, end);
            is_free.then_some(legs)
        });
        let Some(legs) = free else {
            return false;
        };
        let parts = legs.iter().map(Vec::len).collect();
        let mut way: VecDeque<Position> = legs.into_iter().flatten().collect();
        let Some(to) = way.pop_front() else {
            return false;
        };
        self.vehicles[index].route = way;
        self.vehicles[index].parts = parts;
        self.vehicles[index].begin_part();
        let path = PathKind::GoTo;
        self.order(index, Order { path, to, purpose }, out);
        true
    }

    /// The first of `heights_amsl_m` at which a vehicle could go to `to` if it were at that height already.
    pub(crate) fn free_level(&self, index: usize, to: Enu, heights_amsl_m: &[f64]) -> Option<f64> {
        let track = self.vehicles[index].track?;
        let here = track.position.at;
        let way = self.routes.route(&self.airspace, here, to)?;
        let near = self.near_way(index, here, &way);
        let mover = Mover {
            index,
            near: near.as_ref(),
        };
        let is_free = |height_m: f64| {
            let at_height = |at: Enu| Position { at, height_m };
            let leg = Corridor::turning(
                at_height(here),
                track.course_deg,
                at_height(way[0]),
                self.vehicles[index].circle_m,
            );
            self.is_kept_free(mover, &leg) && self.is_end_free(mover, at_height(to))
        };
        heights_amsl_m.iter().copied().find(|&h| is_free(h))
    }

    /// Those that may be in the way of a vehicle on the first leg of a way and at its end, at any height.
    fn near_way(&self, index: usize, here: Enu, way: &[Enu]) -> Option<NearWay> {
        let occupancy = self.occupancy.as_ref()?;
        let (first, end) = (*way.first()?, *way.last()?);
        // A turn at the start reaches two radii to the side, a circle at the end one.
        let margin_m = 2.0 * self.vehicles[index].circle_m;
        let column = Column::around(&[here, first, end], margin_m, &self.separation);
        let mut ways_down = self.ways_down_kept_free(index);
        ways_down.retain(|&k| column.holds(&self.ways_down[k].1));
        Some(NearWay {
            vehicles: occupancy.within(&column),
            ways_down,
        })
    }

    /// Places in `ways_down` of those that a vehicle keeps free.
    fn ways_down_kept_free(&self, index: usize) -> Vec<usize> {
        // Those who wait go down below each other.
        if self.ways_down.iter().any(|(other, _)| *other == index) {
            Vec::new()
        } else {
            (0..self.ways_down.len()).collect()
        }
    }

    /// Whether the leg from where a vehicle is to `to` is apart from all others.
    pub fn is_apart(&self, index: usize, to: Position) -> bool {
        self.is_leg_apart(Mover::among_all(index), &[to])
    }

    /// Whether all parts of a leg are apart from all others.
    fn is_leg_apart(&self, mover: Mover<'_>, leg: &[Position]) -> bool {
        let v = &self.vehicles[mover.index];
        let (Some(track), Some(&to)) = (v.track, leg.first()) else {
            return false;
        };
        let first = Corridor::turning(track.position, track.course_deg, to, v.circle_m);
        let mut later = leg
            .windows(2)
            .map(|ends| Corridor::straight(ends[0], ends[1], v.circle_m));
        self.is_kept_free(mover, &first) && later.all(|part| self.is_kept_free(mover, &part))
    }

    /// Whether a corridor of the vehicle at `index` is apart from all others and from what is kept
    /// free.
    fn is_kept_free(&self, mover: Mover<'_>, own: &Corridor) -> bool {
        let index = mover.index;
        let ways_down = match mover.near {
            Some(near) => Cow::Borrowed(&near.ways_down),
            None => Cow::Owned(self.ways_down_kept_free(index)),
        };
        let ways_down = ways_down.iter().map(|&k| &self.ways_down[k].1);
        let v = &self.vehicles[index];
        let passes = self.passes.iter().filter(|_| v.gives_way);
        let climbs = self.climbs.iter().filter(|_| v.gives_way);
        // Who is in the way already may leave.
        let here = v
            .track
            .map(|s| Corridor::straight(s.position, s.position, 0.0));
        let outside =
            |kept: &&Corridor| here.is_some_and(|here| self.separation.apart(&here, kept));
        let mut kept_free = ways_down.chain(passes).chain(climbs).filter(outside);
        kept_free.all(|kept| self.separation.apart(own, kept)) && self.is_free(mover, own, |_| true)
    }

    /// Whether the place of a vehicle's circle is free, and no other vehicle is on its way there.
    fn is_end_free(&self, mover: Mover<'_>, end: Position) -> bool {
        let index = mover.index;
        let circle = Corridor::straight(end, end, self.vehicles[index].circle_m);
        let is_apart = |other: usize, occupied: &Occupied| {
            let mut ends = occupied.corridors.iter().chain(&occupied.end);
            other == index || ends.all(|other| self.separation.apart(&circle, other))
        };
        self.climb_entered(index, end).is_none()
            && self.all_near(mover, &circle, is_apart)
            && self.is_clear_of_others(index, &circle)
    }

    /// Whether a vehicle that circles at `end` is out of the way of all passes.
    pub(crate) fn is_clear_of_passes(&self, index: usize, end: Position) -> bool {
        let circle = Corridor::straight(end, end, self.vehicles[index].circle_m);
        self.passes
            .iter()
            .all(|pass| self.separation.apart(&circle, pass))
    }

    /// The first climb of a real vehicle that one which has to keep clear would be in while it circles at `end`.
    pub(crate) fn climb_entered(&self, index: usize, end: Position) -> Option<Corridor> {
        let v = &self.vehicles[index];
        let circle = Corridor::straight(end, end, v.circle_m);
        let mut climbs = self.climbs.iter().filter(|_| v.gives_way);
        climbs
            .find(|climb| !self.separation.apart(&circle, climb))
            .copied()
    }

    /// Where a vehicle climbs after its take-off: above its home, or as near to it as the airspace allows.
    pub(crate) fn climb_of(&self, index: usize) -> Option<Corridor> {
        let v = &self.vehicles[index];
        let at = self.airspace.nearest_allowed(v.home.at, MARGIN_M)?;
        let height_m = v.layer_amsl_m;
        Some(Corridor::straight(
            v.home,
            Position { at, height_m },
            v.circle_m,
        ))
    }

    /// Whether nobody is in the way of a vehicle that climbs from its home to its layer, but those
    /// who climb themselves (`climbs`): each of them to a layer above, in turn.
    pub(crate) fn is_climb_free(&self, index: usize, climbs: impl Fn(usize) -> bool) -> bool {
        let height_m = self.vehicles[index].layer_amsl_m;
        self.climb_of(index).is_some_and(|climb| {
            self.is_free(Mover::among_all(index), &climb, |other| {
                !climbs(other) || self.vehicles[other].layer_amsl_m <= height_m
            })
        })
    }

    /// Whether the way down from where a vehicle is, by the circle around `approach`, is free of all
    /// that `counts`.
    pub(crate) fn is_way_down_free(
        &self,
        index: usize,
        approach: Enu,
        counts: impl Fn(usize) -> bool,
    ) -> bool {
        let way = self.vehicles[index].landing(approach);
        way.is_some_and(|way| self.is_free(Mover::among_all(index), &way, counts))
    }

    /// Whether a corridor of the vehicle at `index` is apart from those of all others that
    /// `counts`.
    fn is_free(&self, mover: Mover<'_>, own: &Corridor, counts: impl Fn(usize) -> bool) -> bool {
        let index = mover.index;
        let is_apart = |other: usize, occupied: &Occupied| {
            let mut corridors = occupied.corridors.iter();
            other == index
                || !counts(other)
                || corridors.all(|other| self.separation.apart(own, other))
        };
        self.all_near(mover, own, is_apart) && self.is_clear_of_others(index, own)
    }

    /// Whether all vehicles that may be near a corridor pass a test.
    fn all_near(
        &self,
        mover: Mover<'_>,
        own: &Corridor,
        test: impl Fn(usize, &Occupied) -> bool,
    ) -> bool {
        match &self.occupancy {
            Some(occupancy) => {
                let among = mover.near.map(|near| near.vehicles.as_slice());
                occupancy.all_near(own, &self.separation, among, test)
            }
            None => {
                let mut all = self.vehicles.iter().enumerate();
                all.all(|(other, v)| test(other, &v.occupied()))
            }
        }
    }

    /// A decision begins: from now on no track changes, and orders come by [`Fleet::order`] alone.
    pub(crate) fn begin_decision(&mut self) {
        let occupied = self.vehicles.iter().map(TeamVehicle::occupied);
        self.occupancy = Some(Occupancy::new(occupied));
    }

    /// A decision ends.
    pub(crate) fn end_decision(&mut self) {
        self.occupancy = None;
    }

    /// Whether a corridor of the vehicle at `index` is apart from the aircraft that are not of the team.
    /// These know of no plan and may come near by themselves: who is in their way already may leave.
    fn is_clear_of_others(&self, index: usize, own: &Corridor) -> bool {
        let here = self.vehicles[index].track;
        let here = here.map(|s| Corridor::straight(s.position, s.position, 0.0));
        let airborne = self.others.values().filter(|track| track.airborne);
        let mut circles = airborne.map(|s| Corridor::straight(s.position, s.position, CIRCLE_M));
        circles.all(|circle| {
            self.separation.apart(own, &circle)
                || here.is_some_and(|here| !self.separation.apart(&here, &circle))
        })
    }

    /// Gives the next leg of its way to a vehicle that has flown one.
    pub fn advance(&mut self, index: usize, out: &mut Outbox) {
        let v = &self.vehicles[index];
        let (Some(track), Some(order), Some(&next)) = (v.track, v.order, v.route.front()) else {
            return;
        };
        let here = track.position;
        let reached = here.at.distance_m(order.to.at) <= REACHED_M
            && self.airspace.is_high_enough(here.height_m, order.to);
        // Not yet free: it circles at the corner until it is.
        if !v.is_commandable() || !reached {
            return;
        }
        let leg: Vec<Position> = v.coming_parts().collect();
        if !self.is_leg_apart(Mover::among_all(index), &leg) {
            return;
        }
        self.vehicles[index].route.pop_front();
        self.vehicles[index].begin_part();
        self.order(index, Order { to: next, ..order }, out);
    }

    /// Sends a vehicle up to its layer above home, or as near to home as the airspace allows.
    pub fn take_off(&mut self, index: usize, out: &mut Outbox) {
        let v = &self.vehicles[index];
        let Some(at) = self.airspace.nearest_allowed(v.home.at, MARGIN_M) else {
            return;
        };
        let to = Position {
            at,
            height_m: v.layer_amsl_m,
        };
        let order = Order {
            path: PathKind::TakeOff,
            to,
            purpose: "take off",
        };
        self.order(index, order, out);
    }

    /// Sends a vehicle down to its home, by the circle around `approach`.
    pub(crate) fn land(&mut self, index: usize, approach: Enu, out: &mut Outbox) {
        self.vehicles[index].route.clear();
        self.vehicles[index].parts.clear();
        self.vehicles[index].approach = Some(approach);
        let order = Order {
            path: PathKind::Land,
            to: self.vehicles[index].home,
            purpose: "land",
        };
        self.order(index, order, out);
    }

    /// Says the last order of a vehicle again, as after a pilot has handed it back.
    pub fn repeat(&self, index: usize, out: &mut Outbox) {
        if let Some(order) = self.vehicles[index].order {
            self.publish(index, order, out);
        }
    }

    /// Gives a vehicle an order.
    pub(crate) fn order(&mut self, index: usize, order: Order, out: &mut Outbox) {
        self.vehicles[index].order = Some(order);
        if let Some(occupancy) = &mut self.occupancy {
            occupancy.update(index, self.vehicles[index].occupied());
        }
        self.publish(index, order, out);
    }

    fn publish(&self, index: usize, order: Order, out: &mut Outbox) {
        let Geodetic { lat_deg, lon_deg } = self.airspace.frame().to_geodetic(order.to.at);
        let setpoint = Setpoint {
            path: order.path,
            lat_deg,
            lon_deg,
            alt_amsl_m: order.to.height_m,
            airspeed_m_s: self.airspeed_m_s,
            orbit_radius_m: ORBIT_M,
        };
        let name = self.vehicles[index].name.clone();
        out.say(Topic::Setpoint(name), Message::Setpoint(setpoint));
    }

    /// Where all vehicles are sent.
    pub fn assignments(&self) -> Vec<Assignment> {
        let sent = self.vehicles.iter().filter_map(|v| Some((v, v.order?)));
        sent.map(|(v, order)| {
            let Geodetic { lat_deg, lon_deg } = self.airspace.frame().to_geodetic(order.to.at);
            Assignment {
                vehicle: v.name.to_string(),
                lat_deg,
                lon_deg,
                alt_amsl_m: order.to.height_m,
                purpose: order.purpose.to_owned(),
            }
        })
        .collect()
    }
}
