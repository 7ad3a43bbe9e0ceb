//! The flights that are tried: crossings, climbs, and legs along the plume and beside it, as
//! corners that are passed at a steady speed and as the rows that an aircraft would log. They lie
//! about the plume as it was found, in the wind as it was logged.

use ::plume::effects::{HOUR_S, SensorAir};
use ::plume::field::{DispersionModel, Place, Transport};
use ::plume::mechanism::MechanismId;
use ::plume::track::Row;
use air::area::{distance_to_segment_m, is_inside};
use air::geo::Enu;
use air::isa::{Atmosphere, ZERO_CELSIUS_K};

use crate::plume::fit::Context;
use crate::plume::model::Model;
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

/// Where the plume lies and what carries it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlumeAxis {
    towards_deg: f64,
    height_agl_m: f64,
    /// The wind as it is logged, or the scenario's, at the axis.
    pub wind: Transport,
}

impl PlumeAxis {
    /// As `model` has it at `time_s` if the wind stays what it was in the mean.
    pub fn of(ctx: &Context<'_>, model: &Model, time_s: f64) -> Self {
        let wind = ctx.data.mean_transport(&vec![1.0; ctx.data.len()]);
        let sum = |id: MechanismId| {
            let own = model.parts.iter().filter(|p| p.id == id);
            own.map(|p| p.values[0]).sum::<f64>()
        };
        let turned_deg = sum(MechanismId::WindDirectionOffset)
            + sum(MechanismId::WindDirectionDrift) * time_s / HOUR_S;
        let stated_m = ctx.setup.base.sources[0].effective_height_agl_m;
        let height_agl_m = stated_m + sum(MechanismId::EffectiveHeightOffset);
        Self {
            towards_deg: wind.east.atan2(wind.north).to_degrees() + turned_deg,
            height_agl_m: height_agl_m.max(LOWEST_M),
            wind,
        }
    }
}

/// Crossings at several distances and heights, climbs through the plume and beside it, and legs
/// along it.
pub(super) fn plans(axis: PlumeAxis, world: &DispersionModel) -> Vec<Plan> {
    let axis_m = axis.height_agl_m;
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

fn is_resolved(world: &DispersionModel, x_m: f64) -> bool {
    x_m > 0.0 && world.sigmas_m(x_m).0 > RESOLVED_S * SPEED_M_S
}

/// What can be flown at `x` downwind: crossings there and farther on, and climbs on the axis.
fn at_station(world: &DispersionModel, axis_m: f64, x: f64) -> Vec<Plan> {
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
fn place(ctx: &Context<'_>, axis: PlumeAxis, point: [f64; 3]) -> Place {
    let source = ctx.setup.base.sources[0].place;
    let towards = axis.towards_deg;
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
pub(super) fn waypoints(
    ctx: &Context<'_>,
    axis: PlumeAxis,
    plan: &Plan,
    flier: Flier,
) -> Vec<Waypoint> {
    timed(plan, flier)
        .into_iter()
        .map(|(time_s, point)| {
            let p = place(ctx, axis, point);
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

/// What of the scenario's airspace the plan does not keep to, in words; nothing where it does.
pub(super) fn outside(ctx: &Context<'_>, axis: PlumeAxis, plan: &Plan) -> Option<String> {
    let fence = &ctx.setup.airspace;
    let corners: Vec<Place> = plan.round.iter().map(|p| place(ctx, axis, *p)).collect();
    let level = |p: &Place| Enu {
        east_m: p.east_m,
        north_m: p.north_m,
    };
    let legs = || corners.iter().zip(corners.iter().cycle().skip(1));
    let stack_near = |(a, b): (&Place, &Place)| {
        let near = |s: &Enu| distance_to_segment_m(*s, level(a), level(b)) < fence.keep_out_m;
        fence.stacks.iter().any(near)
    };
    let any = |of: &dyn Fn(&Place) -> bool| corners.iter().any(of);
    let mut wrong = Vec::new();
    if any(&|p| p.height_agl_m < fence.floor_agl_m) {
        wrong.push(format!("its floor of {:.0} m", fence.floor_agl_m));
    }
    if any(&|p| p.height_agl_m > fence.ceiling_agl_m) {
        wrong.push(format!("its ceiling of {:.0} m", fence.ceiling_agl_m));
    }
    if any(&|p| !is_inside(&fence.polygon, level(p))) {
        wrong.push("its polygon".to_string());
    }
    if legs().any(stack_near) {
        wrong.push(format!("{:.0} m around the stack", fence.keep_out_m));
    }
    (!wrong.is_empty()).then(|| wrong.join(", "))
}

/// The plan as rows of one platform, one a second.
pub(super) fn rows(ctx: &Context<'_>, axis: PlumeAxis, plan: &Plan, flier: Flier) -> Vec<Row> {
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
        let place = place(ctx, axis, point);
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
    known: SensorAir,
    ground_amsl_m: f64,
    column: Option<Atmosphere>,
}

impl AirColumn {
    fn new(ctx: &Context<'_>) -> Self {
        let middle = ctx.data.len() / 2;
        let track = &ctx.data.track;
        let known = track
            .air()
            .get(middle)
            .copied()
            .unwrap_or(SensorAir::UNKNOWN);
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

    fn at(&self, height_agl_m: f64) -> SensorAir {
        let Some(column) = &self.column else {
            return self.known;
        };
        let air = column.at(self.ground_amsl_m + height_agl_m);
        SensorAir {
            temperature_c: air.temperature_k - ZERO_CELSIUS_K,
            pressure_hpa: air.pressure_pa / 100.0,
            ..self.known
        }
    }
}
