//! The plans that are tried: crossings, climbs, and legs along the plume and beside it. They lie about
//! the plume as it was found.

use ::plume::field::DispersionModel;

use super::super::data::Airspace;
use super::axis::PlumeAxis;
use super::flown::{CLIMB_M_S, SPEED_M_S};

/// Lowest and highest height of a proposed leg, m above ground.
const LOWEST_M: f64 = 30.0;
const HIGHEST_M: f64 = 500.0;
/// How many seconds of flight a plume's standard deviation across must take for its mean to be
/// what is met: nearer to the source a crossing meets single puffs, which no law of the mean tells
/// from a sensor that is slow or late.
const RESOLVED_S: f64 = 2.5;
/// Distances downwind at which the plume is crossed, m.
const STATIONS_M: [f64; 6] = [350.0, 700.0, 1400.0, 2800.0, 5000.0, 8000.0];
/// Two distances are crossed in turn where one is farther by this factor: less tells little of how a
/// plume grows.
const FARTHER: f64 = 1.5;
/// How far crossings and climbs reach from the axis, in standard deviations of the plume.
const ACROSS: f64 = 2.5;
const UP: f64 = 1.2;
/// Ends of the legs along the axis, m downwind.
const ALONG_M: [f64; 2] = [300.0, 4000.0];
/// A wide round: this far upwind, downwind and to both sides, m.
const WIDE_M: [f64; 3] = [800.0, 2500.0, 1500.0];

/// A round of legs, flown over and over: corners in plume axes (along and across the wind in m
/// from the source, height above ground in m), and what it is.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub words: String,
    pub round: Vec<[f64; 3]>,
}

/// What plans are made for.
struct About<'a> {
    world: &'a DispersionModel,
    low_m: f64,
    high_m: f64,
    axis_m: f64,
}

/// Crossings at several distances and heights, climbs through the plume and beside it, and legs
/// along it, at heights that the airspace allows.
pub(super) fn plans(axis: PlumeAxis, world: &DispersionModel, airspace: &Airspace) -> Vec<Plan> {
    let low_m = LOWEST_M.max(airspace.floor_agl_m);
    let high_m = airspace.ceiling_agl_m.max(low_m);
    let about = About {
        world,
        low_m,
        high_m,
        axis_m: axis.height_agl_m.clamp(low_m, high_m),
    };
    let stations = STATIONS_M.into_iter().filter(|x| about.is_resolved(*x));
    let mut out: Vec<Plan> = stations.flat_map(|x| about.at_station(x)).collect();
    out.extend([about.along(), about.beside(), about.around()]);
    out
}

impl About<'_> {
    fn is_resolved(&self, x_m: f64) -> bool {
        x_m > 0.0 && self.world.sigmas_m(x_m).0 > RESOLVED_S * SPEED_M_S
    }

    /// Each place (distance, height) is crossed, then the next.
    fn crossings(&self, places: &[(f64, f64)]) -> Vec<[f64; 3]> {
        let across = |&(x, z): &(f64, f64)| {
            let half_m = ACROSS * self.world.sigmas_m(x).0;
            [[x, -half_m, z], [x, half_m, z]]
        };
        places.iter().flat_map(across).collect()
    }

    /// What can be flown at `x` downwind: crossings there and farther on, and climbs on the axis.
    fn at_station(&self, x: f64) -> Vec<Plan> {
        let axis_m = self.axis_m;
        let up_m = UP * self.world.sigmas_m(x).1;
        let (low_m, high_m) = (
            (axis_m - up_m).max(self.low_m),
            (axis_m + up_m).min(self.high_m),
        );
        let legs = format!("crosswind legs at {x:.0} m");
        let mut out = vec![
            Plan {
                words: format!("{legs} downwind, {axis_m:.0} m above ground"),
                round: self.crossings(&[(x, axis_m)]),
            },
            Plan {
                words: format!(
                    "{legs} downwind, {low_m:.0} m, {axis_m:.0} m and {high_m:.0} m above ground"
                ),
                round: self.crossings(&[(x, low_m), (x, axis_m), (x, high_m)]),
            },
        ];
        for far in STATIONS_M.into_iter().filter(|far| *far > FARTHER * x) {
            out.push(Plan {
                words: format!(
                    "{legs} and {far:.0} m downwind in turn, {axis_m:.0} m above ground"
                ),
                round: self.crossings(&[(x, axis_m), (far, axis_m)]),
            });
        }
        let half_m = 0.5 * (high_m - low_m) * SPEED_M_S / CLIMB_M_S;
        if self.is_resolved(x - half_m) {
            out.push(Plan {
                words: format!(
                    "climbs and descents along the axis about {x:.0} m downwind, from {low_m:.0} m to {high_m:.0} m above ground"
                ),
                round: vec![[x - half_m, 0.0, low_m], [x + half_m, 0.0, high_m]],
            });
        }
        out
    }

    fn along(&self) -> Plan {
        let [near, far] = ALONG_M;
        Plan {
            words: format!(
                "legs along the plume's axis from {near:.0} m to {far:.0} m, {:.0} m above ground",
                self.axis_m
            ),
            round: ALONG_M.map(|x| [x, 0.0, self.axis_m]).to_vec(),
        }
    }

    /// Climbs beside the plume, as long as a climb takes.
    fn beside(&self) -> Plan {
        let (low_m, high_m) = (self.low_m, self.high_m.min(HIGHEST_M));
        let length_m = (high_m - low_m).max(0.0) * SPEED_M_S / CLIMB_M_S;
        let beside_m = 4.0 * self.world.sigmas_m(length_m.max(1.0)).0 + 100.0;
        Plan {
            words: format!(
                "climbs and descents beside the plume, from {low_m:.0} m to {high_m:.0} m above ground"
            ),
            round: vec![[0.0, beside_m, low_m], [length_m, beside_m, high_m]],
        }
    }

    fn around(&self) -> Plan {
        let [up, down, side] = WIDE_M;
        let corners = [[-up, -side], [-up, side], [down, side], [down, -side]];
        Plan {
            words: "a wide circuit outside and through the plume".to_string(),
            round: corners.map(|[x, y]| [x, y, self.axis_m]).to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::plume::field::Transport;
    use scenario::Scenario;

    #[test]
    fn no_leg_is_below_the_floor_or_above_the_ceiling() {
        let text = r#"
            [site]
            lat_deg = 43.4417
            lon_deg = -7.8631
            ground_amsl_m = 340.0
            [weather]
            wind_speed_m_s = 7.0
            wind_height_agl_m = 300.0
            wind_from_deg = 250.0
            [[source]]
            lat_deg = 43.4417
            lon_deg = -7.8631
            stack_height_m = 200.0
            effective_height_m = 300.0
            emission_kg_s = 120.0
        "#;
        let scenario = Scenario::parse("test.toml", text).unwrap();
        let setup = crate::plume::Setup::new(&scenario).unwrap();
        let world = DispersionModel::new(setup.base.clone()).unwrap();
        let airspace = Airspace {
            floor_agl_m: 60.0,
            ceiling_agl_m: 120.0,
            ..setup.airspace
        };
        let axis = PlumeAxis {
            towards_deg: 70.0,
            height_agl_m: 300.0,
            wind: Transport {
                east: 1.0,
                north: 0.0,
                speed_m_s: 7.0,
            },
        };
        let all = plans(axis, &world, &airspace);
        let heights = || all.iter().flat_map(|p| &p.round).map(|c| c[2]);
        assert!(all.len() > 10 && heights().all(|h| (60.0..=120.0).contains(&h)));
        assert!(heights().any(|h| h == 60.0) && heights().any(|h| h == 120.0));
    }
}
