//! When the team must turn home, the way there, and the landings one after the other.

use protocol::{Outbox, SimTime};

use super::SquadronController;
use crate::fleet::{MARGIN_M, TeamVehicle};
use crate::tasks::VehicleTask;

/// A vehicle is at its layer when it is this near to it, m: layers are close to each other.
const AT_LAYER_M: f64 = 3.0;
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
/// Purpose of a leg towards home that ends elsewhere.
const BY_STAGES: &str = "home by stages";
/// Places at which a vehicle may go down to its layer on its way home: this far from where it
/// is, m …
const STAGES_M: [f64; 4] = [0.0, 300.0, 600.0, 1000.0];
/// … and this much off the direction of home, degrees.
const STAGE_BEARINGS_DEG: [f64; 8] = [0.0, 40.0, -40.0, 80.0, -80.0, 120.0, -120.0, 180.0];

impl SquadronController {
    /// When the team must turn home to be down at the mission's end, s.
    pub(super) fn home_time_s(&self) -> f64 {
        let flying = self.fleet.vehicles.iter().filter(|v| v.is_commandable());
        // The whole team turns home together, when the farthest must.
        let slowest_s = flying.map(|v| self.way_home_s(v)).fold(0.0, f64::max);
        (self.duration_s - slowest_s - self.landing_s()).max(HOME_FROM * self.duration_s)
    }

    /// Time that a vehicle needs to above its home, s.
    fn way_home_s(&self, vehicle: &TeamVehicle) -> f64 {
        let Some(track) = vehicle.track else {
            return 0.0;
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
        let level_s = 1.15 * distance_m / over_ground.max(3.0);
        // Some go down to their layer first and home then, where others are in the way.
        level_s + 0.6 * (here.height_m - vehicle.layer_amsl_m).abs() / CLIMB_M_S
    }

    /// Time that the team needs from above home to the ground, s: in turn from the lowest layer.
    fn landing_s(&self) -> f64 {
        let mut team: Vec<&TeamVehicle> = self.fleet.vehicles.iter().collect();
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
    fn circle_left_s(&self, vehicle: &TeamVehicle) -> f64 {
        LANDING_S.0 + (vehicle.layer_amsl_m - vehicle.home.height_m).max(0.0) / CLIMB_M_S
    }

    /// Time after its order to land before which a vehicle is well above that circle, s.
    fn circle_reached_s(&self, vehicle: &TeamVehicle) -> f64 {
        let above_m = vehicle.layer_amsl_m - vehicle.home.height_m - CIRCLE_M.0;
        (above_m - self.fleet.separation.height_m).max(0.0) / SINK_M_S
    }

    /// Brings a vehicle above its home at its own layer: straight, or, where others are in the
    /// way, down to its layer at a free place first. Once all are at layers of their own, all
    /// ways home are free.
    pub(super) fn bring_home(&mut self, index: usize, out: &mut Outbox) {
        let v = &self.fleet.vehicles[index];
        let (Some(track), VehicleTask::Idle) = (v.track, self.tasks.each[index]) else {
            return;
        };
        let (layer_m, home) = (v.layer_amsl_m, v.home.at);
        let off_layer = (track.position.height_m - layer_m).abs() > AT_LAYER_M;
        let by_stages = v.order.is_some_and(|o| o.purpose == BY_STAGES);
        let Some(at) = self.fleet.airspace.nearest_allowed(home, MARGIN_M) else {
            return;
        };
        if self
            .fleet
            .send_at_free_height(index, at, &[layer_m], "home", out)
        {
            self.tasks.each[index] = VehicleTask::Returning;
            return;
        }
        if by_stages && off_layer {
            return;
        }
        let here = track.position.at;
        // Near places first, and at each distance those towards home: the detour stays short.
        let homeward_deg = here.bearing_deg(home);
        let aside = |distance_m: f64| {
            STAGE_BEARINGS_DEG.map(|off_deg| here.displaced(homeward_deg + off_deg, distance_m))
        };
        let places = STAGES_M.into_iter().flat_map(aside).collect::<Vec<_>>();
        for place in places {
            if self
                .fleet
                .send_at_free_height(index, place, &[layer_m], BY_STAGES, out)
            {
                return;
            }
        }
    }

    /// Whether nobody flies at a lower layer near the home of a vehicle, but those who land.
    fn way_down_is_free(&self, index: usize) -> bool {
        let own = &self.fleet.vehicles[index];
        let in_the_way = |(other, v): (usize, &TeamVehicle)| {
            let near = v
                .track
                .is_some_and(|s| s.airborne && s.position.at.distance_m(own.home.at) < APPROACH_M);
            let landing = matches!(self.tasks.each[other], VehicleTask::Landing(_));
            near && !landing && v.layer_amsl_m < own.layer_amsl_m
        };
        !self.fleet.vehicles.iter().enumerate().any(in_the_way)
    }

    /// Those above home land one after the other, the lowest layer first.
    pub(super) fn land_in_turn(&mut self, now: SimTime, out: &mut Outbox) {
        let step_m = self.fleet.separation.height_m;
        let there = |index: &usize| {
            let v = &self.fleet.vehicles[*index];
            let low = v
                .track
                .is_some_and(|s| (s.position.height_m - v.layer_amsl_m).abs() < step_m);
            let returned = self.tasks.each[*index] == VehicleTask::Returning && v.has_arrived();
            returned && low && v.is_commandable() && self.way_down_is_free(*index)
        };
        let layer = |index: &usize| self.fleet.vehicles[*index].layer_amsl_m;
        let lowest = (0..self.fleet.vehicles.len())
            .filter(there)
            .min_by(|a, b| layer(a).total_cmp(&layer(b)));
        let Some(next) = lowest else { return };
        let busy = self.tasks.each.iter().enumerate().any(|(index, task)| {
            let vehicle = &self.fleet.vehicles[next];
            matches!(*task, VehicleTask::Landing(since) if self.holds_the_circle(index, since, vehicle, now))
        });
        if !busy {
            self.tasks.each[next] = VehicleTask::Landing(now);
            self.fleet.land(next, out);
        }
    }

    /// Whether a vehicle that was ordered to land at `since` may still be in the circle when `next`,
    /// ordered now, could reach it.
    fn holds_the_circle(
        &self,
        index: usize,
        since: SimTime,
        next: &TeamVehicle,
        now: SimTime,
    ) -> bool {
        let vehicle = &self.fleet.vehicles[index];
        let high = vehicle.track.is_some_and(|s| {
            s.airborne && s.position.height_m > vehicle.home.height_m + CIRCLE_M.1
        });
        let (waited_s, left_s) = (now.since_s(since), self.circle_left_s(vehicle));
        // Two may be in the descent at once as long as the second cannot reach the circle before
        // the first has left it.
        let meets = if waited_s <= left_s {
            waited_s + self.circle_reached_s(next) < left_s
        } else {
            // It should have left: it goes round again.
            waited_s < left_s + ROUND_AGAIN_S
        };
        waited_s < BETWEEN_LANDINGS_S || (high && meets)
    }
}
