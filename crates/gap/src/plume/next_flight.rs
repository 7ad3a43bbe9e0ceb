//! The next flight: where to fly so that the rivals of an ambiguous answer come apart.
//!
//! Candidate tracks are predicted under both rivals, each with its parameters as fitted. The
//! separation of a track is the whitened distance of the two predictions, less what the second
//! rival can take back by moving its parameters within what the data so far allow:
//! ½ dᵀ(K + J C Jᵀ)⁻¹ d, with K the noise, J the rival's derivatives and C their posterior.

use std::ops::AddAssign;

use ::plume::effects::Ambient;
use ::plume::field::{Place, World};
use ::plume::track::{Row, Track};
use air::geo::Enu;
use air::isa::{Atmosphere, ZERO_CELSIUS_K};
use nalgebra::DVector;

use super::accepted::law_power;
use super::data::Data;
use super::fit::{Context, Fitted};
use super::linear::{self, dot, posterior, scores};
use super::model::{Model, Prediction};
use super::naming::Named;
use super::noise::{Loading, Whitener};
use super::nuisance::Nuisance;
use crate::verdict::{NextFlight, Waypoint};

/// Airspeed of the proposed flight over ground, m/s.
const SPEED_M_S: f64 = 18.0;
/// Length of the proposed flight, s.
const LENGTH_S: f64 = 1200.0;
/// Lowest height of a proposed leg, m above ground.
const LOWEST_M: f64 = 30.0;
/// Separation at which two rivals come apart, nats: at even odds before, 95 % after.
const APART_NATS: f64 = 2.95;
/// Separation below which a flight would not as much as shift the odds, nats.
pub(crate) const LEAST_NATS: f64 = 1.0;
/// How many seconds of flight a plume's standard deviation across must take to be resolved.
const RESOLVED_S: f64 = 1.5;
/// Separation beyond which more is worth nothing, nats.
const ENOUGH_NATS: f64 = 12.0;

/// A track in plume axes: (along, across in m, height m) corners, and what it is.
struct Plan {
    words: String,
    corners: Vec<[f64; 3]>,
}

/// The flight that separates the most probable member of the first ambiguous cause from as many
/// of the others as one flight can. Where none of the flights tried would, it is the one that
/// comes nearest to it, and its nats say so.
pub(crate) fn propose(ctx: &Context<'_>, named: &Named) -> Option<NextFlight> {
    let cause = named.accepted.iter().find(|a| a.set.len() > 1)?;
    let world = named
        .last
        .model
        .world(&ctx.setup.base, ctx.data.track.platforms())?;
    let rivals: Vec<Fitted> = cause
        .others
        .iter()
        .map(|(_, _, model)| fitted_rival(ctx, &named.last, model))
        .collect();
    let flier = Flier {
        platform: cause.platform.unwrap_or(0),
        start_s: ctx.data.span_s().1 + 60.0,
    };
    let worth = |nats: &[f64]| nats.iter().map(|n| n.min(ENOUGH_NATS)).sum::<f64>();
    let mut best: Option<(Plan, Vec<f64>)> = None;
    for plan in plans(ctx, &world) {
        let flown = Flown::new(ctx, &named.last, &plan, &world, flier);
        let from = |other: &Fitted| {
            let nats = flown.as_ref().and_then(|f| f.separation(ctx, other));
            nats.unwrap_or(0.0)
        };
        // The more the effect itself shows, the less a difference of laws will count.
        let shown = cause.evidence.delta_log_score + from(&named.base);
        let pairs = rivals.iter().zip(&cause.others);
        let nats: Vec<f64> = pairs
            .map(|(r, (id, _, _))| law_power(cause.id, Some(*id), shown) * from(r))
            .collect();
        if best.as_ref().is_none_or(|b| worth(&nats) > worth(&b.1)) {
            best = Some((plan, nats));
        }
    }
    let (plan, nats) = best?;
    let apart: Vec<usize> = (0..nats.len()).filter(|k| nats[*k] > APART_NATS).collect();
    let most = (0..nats.len()).max_by(|a, b| nats[*a].total_cmp(&nats[*b]))?;
    let shown = if apart.is_empty() { vec![most] } else { apart };
    let names = shown.iter().filter_map(|k| cause.others.get(*k));
    let mut separates = vec![cause.id.as_str().to_string()];
    separates.extend(names.map(|(id, _, _)| id.as_str().to_string()));
    Some(NextFlight {
        separates,
        platform: cause
            .platform
            .map(|p| ctx.data.track.platforms()[p].clone()),
        description: plan.words.clone(),
        waypoints: waypoints(ctx, &plan, flier.start_s),
        expected_nats: shown.iter().map(|k| nats[*k]).fold(f64::INFINITY, f64::min),
    })
}

/// Who flies the proposed flight, and from when.
#[derive(Debug, Clone, Copy)]
struct Flier {
    platform: usize,
    start_s: f64,
}

fn fitted_rival(ctx: &Context<'_>, last: &Fitted, model: &Model) -> Fitted {
    let prediction = ctx.predict(model);
    let (loading, metric) = (last.loading.clone(), last.metric.clone());
    ctx.conclude(model.clone(), prediction, last.noise, loading, metric, None)
}

/// Crossings at several distances and heights, climbs through the plume, and legs along it.
fn plans(ctx: &Context<'_>, world: &World) -> Vec<Plan> {
    let axis = ctx.setup.base.sources[0].effective_height_agl_m;
    let mut out = Vec::new();
    let crossings = |stations: &[(f64, f64)]| {
        // Each station (distance, height) is crossed both ways, then the next.
        let mut corners = Vec::new();
        for _ in 0..24 {
            for &(x, z) in stations {
                let half = 2.5 * world.sigmas_m(x).0;
                corners.push([x, -half, z]);
                corners.push([x, half, z]);
            }
        }
        corners
    };
    let resolved = |x: &f64| world.sigmas_m(*x).0 > RESOLVED_S * SPEED_M_S;
    for x in [350.0, 700.0, 1400.0, 2800.0, 5000.0]
        .into_iter()
        .filter(resolved)
    {
        let sigma = world.sigmas_m(x).1;
        let high = axis + 1.2 * sigma;
        let low = (axis - 1.2 * sigma).max(LOWEST_M);
        out.push(Plan {
            words: format!("crosswind legs at {x:.0} m downwind, at the axis height"),
            corners: crossings(&[(x, axis.max(LOWEST_M))]),
        });
        out.push(Plan {
            words: format!("crosswind legs at {x:.0} m downwind, below, at and above the axis"),
            corners: crossings(&[(x, low), (x, axis.max(LOWEST_M)), (x, high)]),
        });
        for far in [1400.0, 2800.0, 5000.0] {
            if far > 1.5 * x {
                out.push(Plan {
                    words: format!("crosswind legs at {x:.0} m and {far:.0} m downwind in turn"),
                    corners: crossings(&[(x, axis.max(LOWEST_M)), (far, axis.max(LOWEST_M))]),
                });
            }
        }
        let climb = [[x, 0.0, low], [x, 0.0, high]];
        out.push(Plan {
            words: format!("climbs and descents on the axis at {x:.0} m downwind"),
            corners: (0..90).flat_map(|_| climb).collect(),
        });
    }
    let along = [
        [300.0, 0.0, axis.max(LOWEST_M)],
        [4000.0, 0.0, axis.max(LOWEST_M)],
    ];
    out.push(Plan {
        words: "legs along the plume's axis from 300 m to 4 km".to_string(),
        corners: (0..12).flat_map(|_| along).collect(),
    });
    let away = [
        [-800.0, -1500.0, axis],
        [-800.0, 1500.0, axis],
        [2500.0, 1500.0, axis],
        [2500.0, -1500.0, axis],
    ];
    let beside = |z: f64| [600.0, 4.0 * world.sigmas_m(600.0).0 + 100.0, z];
    out.push(Plan {
        words: "climbs and descents beside the plume, from 30 m to 500 m above ground".to_string(),
        corners: (0..40)
            .flat_map(|_| [beside(LOWEST_M), beside(500.0)])
            .collect(),
    });
    out.push(Plan {
        words: "a wide round outside and through the plume".to_string(),
        corners: (0..8).flat_map(|_| away).collect(),
    });
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
fn timed(plan: &Plan, start_s: f64) -> Vec<(f64, [f64; 3])> {
    let mut out: Vec<(f64, [f64; 3])> = Vec::new();
    for corner in &plan.corners {
        let time = match out.last() {
            None => start_s,
            Some((t, last)) => {
                let away: f64 = (0..3).map(|k| (corner[k] - last[k]).powi(2)).sum();
                t + away.sqrt().max(1.0) / SPEED_M_S
            }
        };
        out.push((time, *corner));
        if time > start_s + LENGTH_S {
            break;
        }
    }
    out
}

fn waypoints(ctx: &Context<'_>, plan: &Plan, start_s: f64) -> Vec<Waypoint> {
    timed(plan, start_s)
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
fn rows(ctx: &Context<'_>, plan: &Plan, flier: Flier) -> Vec<Row> {
    let corners = timed(plan, flier.start_s);
    let mut leg = 0;
    let mut out = Vec::new();
    let column = AirColumn::new(ctx);
    let mut t = flier.start_s;
    while t <= flier.start_s + LENGTH_S && leg + 1 < corners.len() {
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

/// A flight that is yet to be flown, as the first rival predicts it.
struct Flown<'a> {
    first: &'a Fitted,
    /// Places and air, and readings of nothing.
    data: Data,
    prediction: Prediction,
    loading: Vec<Loading>,
    whitener: Whitener,
}

impl<'a> Flown<'a> {
    fn new(
        ctx: &Context<'_>,
        first: &'a Fitted,
        plan: &Plan,
        world: &World,
        flier: Flier,
    ) -> Option<Self> {
        let rows = rows(ctx, plan, flier);
        let n = rows.len();
        let data = Data {
            track: Track::new(world, ctx.data.track.platforms(), &rows).ok()?,
            reading_ppm: vec![0.0; n],
            used: vec![true; n],
            sd_ppm: vec![f64::NAN; n],
            wind: vec![None; n],
            notices: Vec::new(),
            ceiling_ppm: Vec::new(),
            on_board_wind: ctx.data.on_board_wind,
        };
        let there = there(ctx, &data);
        let prediction = there.predict(&first.model);
        let loading = there.loading(&first.model, &prediction);
        let whitener = Whitener::new(&there.rows(&loading), &first.noise, &vec![0.0; n]);
        Some(Self {
            first,
            data,
            prediction,
            loading,
            whitener,
        })
    }

    /// Nats by which the flight separates the second rival from the first.
    fn separation(&self, ctx: &Context<'_>, second: &Fitted) -> Option<f64> {
        let there = there(ctx, &self.data);
        let b = there.predict(&second.model);
        let readings = self.prediction.reading.iter().zip(&b.reading);
        let mut apart: Vec<f64> = readings.map(|(x, y)| x - y).collect();
        let mut columns = there.derivatives(&second.model, &b.reading);
        let d = columns.len();
        // The flight has swings and small departures of its own.
        let noise = &self.first.noise;
        let nuisance = Nuisance::new(&there, &second.model, &b, &self.loading, noise);
        columns.extend(nuisance.raw);
        let mut all: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        all.push(&mut apart);
        self.whitener.whiten(&mut all);
        // What the second rival knows of its parameters already enters as a prior.
        let known = second
            .posterior
            .covariance
            .view((0, 0), (d, d))
            .into_owned()
            .try_inverse()?;
        let mut gram = linear::gram(&columns);
        gram.view_mut((0, 0), (d, d)).add_assign(&known);
        let score = scores(&columns, &apart);
        let own = |k: usize| nuisance.sd[k - d].powi(-2);
        let precision = DVector::from_fn(columns.len(), |k, _| if k < d { 0.0 } else { own(k) });
        let taken = posterior(&gram, &score, &DVector::zeros(columns.len()), &precision)?;
        let regained = 0.5 * score.dot(&taken.mean);
        Some(0.5 * dot(&apart, &apart) - regained)
    }
}

fn there<'a>(ctx: &Context<'a>, data: &'a Data) -> Context<'a> {
    Context {
        setup: ctx.setup,
        data,
        threads: 1,
    }
}
