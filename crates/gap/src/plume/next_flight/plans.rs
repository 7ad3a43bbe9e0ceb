//! The flights that are tried: crossings, climbs, and legs along the plume and beside it, as
//! corners that are passed at a steady speed and as the rows that an aircraft would log.

use ::plume::effects::Ambient;
use ::plume::field::{Place, World};
use ::plume::track::Row;
use air::geo::Enu;
use air::isa::{Atmosphere, ZERO_CELSIUS_K};

use crate::plume::fit::Context;
use crate::verdict::Waypoint;

/// Airspeed of the proposed flight over ground, m/s.
const SPEED_M_S: f64 = 18.0;
/// Lowest height of a proposed leg, m above ground.
const LOWEST_M: f64 = 30.0;
/// How many seconds of flight a plume's standard deviation across must take for its mean to be
/// what is met: nearer to the source a crossing meets single puffs, which no law of the mean tells
/// from a sensor that is slow or late.
const RESOLVED_S: f64 = 2.5;
/// Distances downwind at which the plume is crossed, m.
const STATIONS_M: [f64; 6] = [350.0, 700.0, 1400.0, 2800.0, 5000.0, 8000.0];

/// Steepest climb and descent of a proposed leg, m/s.
const CLIMB_M_S: f64 = 3.0;
/// How far crossings and climbs reach from the axis, in standard deviations of the plume.
const ACROSS: f64 = 2.5;
const UP: f64 = 1.2;

/// A round of legs, flown over and over: corners in plume axes (along and across the wind in m
/// from the source, height above ground in m), and what it is.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub words: String,
    round: Vec<[f64; 3]>,
}

/// Who flies, from when, and how long.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flier {
    pub platform: usize,
    pub start_s: f64,
    pub length_s: f64,
}

/// Crossings at several distances and heights, climbs through the plume and beside it, and legs
/// along it.
pub(super) fn plans(ctx: &Context<'_>, world: &World) -> Vec<Plan> {
    let axis_m = ctx.setup.base.sources[0].effective_height_agl_m;
    let mut out = Vec::new();
    for x in STATIONS_M.into_iter().filter(|x| is_resolved(world, *x)) {
        out.extend(at_station(world, axis_m, x));
    }
    let on_axis = |x: f64| [x, 0.0, axis_m];
    out.push(Plan {
        words: "legs along the plume's axis from 300 m to 4 km".to_string(),
        round: vec![on_axis(300.0), on_axis(4000.0)],
    });
    // As long as the climb takes.
    let (low_m, high_m) = (LOWEST_M, 500.0);
    let length_m = (high_m - low_m) * SPEED_M_S / CLIMB_M_S;
    let beside_m = 4.0 * world.sigmas_m(length_m).0 + 100.0;
    out.push(Plan {
        words: "climbs and descents beside the plume, from 30 m to 500 m above ground".to_string(),
        round: vec![[0.0, beside_m, low_m], [length_m, beside_m, high_m]],
    });
    out.push(Plan {
        words: "a wide round outside and through the plume".to_string(),
        round: vec![
            [-800.0, -1500.0, axis_m],
            [-800.0, 1500.0, axis_m],
            [2500.0, 1500.0, axis_m],
            [2500.0, -1500.0, axis_m],
        ],
    });
    out
}

fn is_resolved(world: &World, x_m: f64) -> bool {
    x_m > 0.0 && world.sigmas_m(x_m).0 > RESOLVED_S * SPEED_M_S
}

/// What can be flown at `x` downwind: crossings there and farther on, and climbs on the axis.
fn at_station(world: &World, axis_m: f64, x: f64) -> Vec<Plan> {
    let sigma_z_m = world.sigmas_m(x).1;
    let high_m = axis_m + UP * sigma_z_m;
    let low_m = (axis_m - UP * sigma_z_m).max(LOWEST_M);
    // Each place (distance, height) is crossed, then the next.
    let crossings = |places: &[(f64, f64)]| {
        let across = |&(x, z): &(f64, f64)| {
            let half_m = ACROSS * world.sigmas_m(x).0;
            [[x, -half_m, z], [x, half_m, z]]
        };
        places.iter().flat_map(across).collect()
    };
    let mut out = vec![
        Plan {
            words: format!("crosswind legs at {x:.0} m downwind, at the axis height"),
            round: crossings(&[(x, axis_m)]),
        },
        Plan {
            words: format!("crosswind legs at {x:.0} m downwind, below, at and above the axis"),
            round: crossings(&[(x, low_m), (x, axis_m), (x, high_m)]),
        },
    ];
    for far in STATIONS_M.into_iter().filter(|far| *far > 1.5 * x) {
        out.push(Plan {
            words: format!("crosswind legs at {x:.0} m and {far:.0} m downwind in turn"),
            round: crossings(&[(x, axis_m), (far, axis_m)]),
        });
    }
    let half_m = 0.5 * (high_m - low_m) * SPEED_M_S / CLIMB_M_S;
    if is_resolved(world, x - half_m) {
        out.push(Plan {
            words: format!("climbs and descents along the axis about {x:.0} m downwind"),
            round: vec![[x - half_m, 0.0, low_m], [x + half_m, 0.0, high_m]],
        });
    }
    out
}

/// Place in the local frame of a point in plume axes.
fn place(ctx: &Context<'_>, point: [f64; 3]) -> Place {
    let source = ctx.setup.base.sources[0].place;
    let towards = ctx.setup.base.wind.from_deg() + 180.0;
    let at = Enu {
        east_m: source.east_m,
        north_m: source.north_m,
    }
    .displaced(towards, point[0])
    .displaced(towards + 90.0, point[1]);
    Place {
        east_m: at.east_m,
        north_m: at.north_m,
        height_agl_m: point[2].max(LOWEST_M),
    }
}

/// Times at which the corners are passed, until the flight's length.
fn timed(plan: &Plan, flier: Flier) -> Vec<(f64, [f64; 3])> {
    let mut out: Vec<(f64, [f64; 3])> = Vec::new();
    for corner in plan.round.iter().cycle() {
        let time_s = match out.last() {
            None => flier.start_s,
            Some((t, last)) => {
                let way = [0, 1, 2].map(|k| corner[k] - last[k]);
                let level_m = way[0].hypot(way[1]);
                t + (level_m / SPEED_M_S).max(way[2].abs() / CLIMB_M_S).max(1.0)
            }
        };
        out.push((time_s, *corner));
        if time_s > flier.start_s + flier.length_s {
            break;
        }
    }
    out
}

/// Where to fly, for an autopilot.
pub(super) fn waypoints(ctx: &Context<'_>, plan: &Plan, flier: Flier) -> Vec<Waypoint> {
    timed(plan, flier)
        .into_iter()
        .map(|(time_s, point)| {
            let p = place(ctx, point);
            let at = ctx.setup.frame.to_geodetic(Enu {
                east_m: p.east_m,
                north_m: p.north_m,
            });
            Waypoint {
                time_s,
                lat_deg: at.lat_deg,
                lon_deg: at.lon_deg,
                alt_amsl_m: ctx.setup.base.ground_amsl_m + p.height_agl_m,
            }
        })
        .collect()
}

/// The plan as rows of one platform, one a second.
pub(super) fn rows(ctx: &Context<'_>, plan: &Plan, flier: Flier) -> Vec<Row> {
    let corners = timed(plan, flier);
    let mut leg = 0;
    let mut out = Vec::new();
    let column = AirColumn::new(ctx);
    let mut t = flier.start_s;
    while t <= flier.start_s + flier.length_s && leg + 1 < corners.len() {
        let ((t0, a), (t1, b)) = (corners[leg], corners[leg + 1]);
        if t > t1 {
            leg += 1;
            continue;
        }
        let part = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
        let point = [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
        let place = place(ctx, point);
        out.push(Row {
            platform: flier.platform,
            time_s: t,
            place,
            wind: None,
            air: column.at(place.height_agl_m),
        });
        t += 1.0;
    }
    out
}

/// The air that a flight will meet: that of a row in the middle, with the standard lapse rate.
struct AirColumn {
    known: Ambient,
    ground_amsl_m: f64,
    column: Option<Atmosphere>,
}

impl AirColumn {
    fn new(ctx: &Context<'_>) -> Self {
        let middle = ctx.data.len() / 2;
        let track = &ctx.data.track;
        let known = track.air().get(middle).copied().unwrap_or(Ambient::UNKNOWN);
        let ground_amsl_m = ctx.setup.base.ground_amsl_m;
        let height_amsl_m = ground_amsl_m + track.place(middle).height_agl_m;
        let column =
            Atmosphere::through(height_amsl_m, known.temperature_c, known.pressure_hpa).ok();
        Self {
            known,
            ground_amsl_m,
            column,
        }
    }

    fn at(&self, height_agl_m: f64) -> Ambient {
        let Some(column) = &self.column else {
            return self.known;
        };
        let air = column.at(self.ground_amsl_m + height_agl_m);
        Ambient {
            temperature_c: air.temperature_k - ZERO_CELSIUS_K,
            pressure_hpa: air.pressure_pa / 100.0,
            ..self.known
        }
    }
}
