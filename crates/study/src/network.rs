//! The emission rate of one source from several sensors at rest.
//!
//! Each sensor shows the plume's crosswind profile at its distance as in [`crate::point`]. Rate, direction of the wind
//! against the vane, width, σz and height are common to all sensors; beside them, each sensor differs by a factor of its
//! own, since a Gaussian plume predicts no single place better. The posterior of the rate is computed on a grid.

use crate::clean_air::{Excess, of_network};
use crate::grid::{Summed, around, mean, normal_grid, variance};
use crate::point::upper_limit_kg_s;
use crate::position;
use crate::profile::{DIRECTION_SD_DEG, PROFILE_FLOOR, Shape, moment};
use crate::sectors::{
    EDDY_S, REACH_DEG, Sector, background_lever, highest, peaks_at_edge, sectors, stands_out,
};
use crate::stations::{Reading, Sight, Station, stations};
use crate::vertical::Vertical;
use crate::{LOGGED_SPEED_LN_SD, PlumeFlux, StudyError, Term};
use plume::DispersionSpec;
use scenario::Scenario;
use scenario::observations::{Observations, checks};
use std::collections::BTreeMap;

/// Fewest readings of a sector: networks report means over a minute or more.
const LEAST_READINGS: usize = 3;
/// Standard deviation of ln of what one sensor reads against the plume that fits all: a geometric variance of 1.3, where
/// a model that is called good has 1.6 or less (Chang & Hanna 2004, Meteor. Atmos. Phys. 87:167).
const STATION_LN_SD: f64 = 0.5;
/// The wind that is logged brings the gas if it does so within this time, s: it turns later. To sensors farther away, a wind
/// of its mean speed or more brings it.
const TRAVEL_S: f64 = EDDY_S;
/// The grid of rates is centred for this vertical density at least, 1/m: a plume that is thinner at the strongest sensor
/// has a wrong σz.
const LEAST_DENSITY_1_M: f64 = 0.01;
/// Steps of the grids of normal quantities.
const GRID_STEPS: usize = 13;
/// Grids of ln area of a sensor and of ln rate, each about a moment estimate: reach below and above, and steps.
const AREA_REACH_LN: [f64; 2] = [9.0, 7.0];
const AREA_STEP_LN: f64 = 0.1;
const RATE_REACH_LN: f64 = 5.0;
const RATE_STEPS: usize = 201;

/// Estimates the rate of the source of `scenario` from `observations` of several platforms at rest.
///
/// # Errors
/// [`StudyError::Refused`] where the observations do not meet the method's conditions; a scenario that describes no
/// world.
pub fn estimate(scenario: &Scenario, observations: &Observations) -> Result<PlumeFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let checked = checks::check(observations, &spec, &frame).observations;
    let stations = stations(&spec, &frame, &checked)?;
    if stations.len() < 2 {
        let refusal = format!("{} platforms read; expected two or more", stations.len());
        return Err(StudyError::Refused(refusal));
    }
    let excesses = of_network(&stations, spec.sensor.noise_sd_ppm);
    let views: Vec<View<'_>> = stations
        .iter()
        .zip(excesses)
        .filter_map(|(station, excess)| View::new(station, excess))
        .collect();
    if views.is_empty() {
        return Err(StudyError::Refused(format!(
            "the wind never blew within {REACH_DEG} degrees of the direction from the source to a sensor for {LEAST_READINGS} readings"
        )));
    }
    Ok(flux(&Vertical::new(scenario, &spec), &stations, &views))
}

/// What a station shows of the plume.
struct View<'a> {
    station: &'a Station,
    excess: Excess,
    sectors: Vec<Sector>,
}

impl<'a> View<'a> {
    /// None of a station to which the wind never blew.
    fn new(station: &'a Station, mut excess: Excess) -> Option<Self> {
        excess.readings = carried(station, excess.readings);
        let sectors = sectors(&excess, LEAST_READINGS);
        (!sectors.is_empty()).then_some(Self {
            station,
            excess,
            sectors,
        })
    }
}

/// Readings in a wind that brings gas from the source as it is logged: not in a calm, in which it drifts about.
fn carried(station: &Station, readings: Vec<Reading>) -> Vec<Reading> {
    let mut by_eddy: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
    for r in &readings {
        let slot = by_eddy.entry(r.eddy()).or_default();
        *slot = (slot.0 + r.speed_m_s, slot.1 + 1.0);
    }
    let enough_m_s = (station.distance_m / TRAVEL_S).min(station.mean_speed_m_s());
    readings
        .into_iter()
        .filter(|r| {
            let (sum, n) = by_eddy[&r.eddy()];
            sum / n >= enough_m_s
        })
        .collect()
}

fn flux(vertical: &Vertical<'_>, stations: &[Station], views: &[View<'_>]) -> PlumeFlux {
    let n = stations.len() as f64;
    let speed_m_s = stations.iter().map(Station::mean_speed_m_s).sum::<f64>() / n;
    let mut out = PlumeFlux {
        distance_m: stations.iter().map(|s| s.distance_m).sum::<f64>() / n,
        from_deg: vertical.spec.wind.from_deg(),
        speed_m_s,
        ..PlumeFlux::default()
    };
    let met: Vec<&View<'_>> = views.iter().filter(|v| stands_out(&v.sectors)).collect();
    if met.is_empty() {
        let limits = views
            .iter()
            .map(|v| upper_limit_kg_s(vertical, v.station, &v.sectors));
        out.upper_limit_kg_s = Some(limits.fold(f64::INFINITY, f64::min));
        out.notes.push("the plume was not met".into());
        return out;
    }
    let at_place = |displaced: [f64; 2]| {
        let seen: Vec<(&View<'_>, Sight)> = views
            .iter()
            .map(|v| (v, v.station.seen_from(displaced)))
            .collect();
        Posterior::of(vertical, &seen, speed_m_s)
    };
    let posterior = at_place([0.0; 2]);
    let position = position::variance(vertical.position_sd_m, out.distance_m, &|displaced| {
        mean(&at_place(displaced).ln_rate)
    });
    let weight = |v: &&View<'_>| moment(&v.sectors, v.station.distance_m);
    let all: f64 = met.iter().map(weight).sum();
    let background = met
        .iter()
        .map(|v| {
            let lever = background_lever(&v.sectors, speed_m_s, PROFILE_FLOOR);
            v.excess.background_sd_ppm * lever * weight(v) / all
        })
        .sum::<f64>();
    // Stations share what none of them is worth alone.
    let station_variance = STATION_LN_SD.powi(2) / met.len() as f64;
    let rest = posterior.rest_variance;
    let beside = [
        (Term::WindSpeed, LOGGED_SPEED_LN_SD.powi(2)),
        (Term::Sensor, vertical.gain_ln_sd.powi(2)),
        (Term::Background, background.powi(2)),
        (Term::SourcePosition, position),
    ];
    let inside = [
        (Term::WindDirection, posterior.direction_variance),
        (Term::Dispersion, posterior.dispersion_variance),
        (Term::Height, posterior.height_variance),
        (Term::Representativeness, station_variance.min(rest)),
        (Term::Turbulence, (rest - station_variance).max(0.0)),
    ];
    let rate = out.state(posterior.ln_rate, &inside, &beside);
    out.from_deg = air::geo::wrap_deg(out.from_deg + posterior.direction_deg);
    out.from_sd_deg = Some(posterior.direction_sd_deg);
    let strongest = met.iter().max_by(|a, b| weight(a).total_cmp(&weight(b)));
    if let Some(strongest) = strongest {
        out.one_class_off_kg_s = vertical.one_class_off(strongest.station.at(), rate.value);
    }
    out.notes.push(format!(
        "the plume was met by {} of {} sensors: {}",
        met.len(),
        stations.len(),
        met.iter()
            .map(|v| format!("{} at {:.0} m", v.station.name, v.station.distance_m))
            .collect::<Vec<_>>()
            .join(", ")
    ));
    if met.iter().all(|v| peaks_at_edge(&v.sectors)) {
        out.notes.push(
            "the highest sector of every sensor is at the edge of its wind directions: the middle of the plume was not seen"
                .into(),
        );
    }
    out
}

/// ln likelihood of one station by direction, width and ln area.
struct ByArea {
    /// ln of the lowest area, ppm m²/s.
    lowest: f64,
    /// Direction by direction, in each width by width.
    ln: Vec<Vec<f64>>,
}

impl ByArea {
    fn of(
        spec: &DispersionSpec,
        (view, sight): (&View<'_>, Sight),
        middle: f64,
        speed_m_s: f64,
    ) -> Self {
        let lowest = middle - AREA_REACH_LN[0];
        let steps = ((AREA_REACH_LN[0] + AREA_REACH_LN[1]) / AREA_STEP_LN).round() as usize + 1;
        let floor = PROFILE_FLOOR * highest(&view.sectors);
        let mut ln = Vec::new();
        for (direction, _) in normal_grid(GRID_STEPS) {
            for (width, _) in normal_grid(GRID_STEPS) {
                let shape = Shape::new(spec, (sight, speed_m_s), [direction, width]);
                let at = |k: usize| (lowest + AREA_STEP_LN * k as f64).exp();
                let own = (0..steps)
                    .map(|k| shape.ln_quasi_likelihood(&view.sectors, at(k), floor))
                    .collect::<Vec<f64>>();
                ln.push(scattered(&own));
            }
        }
        Self { lowest, ln }
    }

    /// At a step of direction and width, and an ln area.
    fn at(&self, shape: usize, ln_area: f64) -> f64 {
        let row = &self.ln[shape];
        let steps = ((ln_area - self.lowest) / AREA_STEP_LN).clamp(0.0, (row.len() - 1) as f64);
        let below = (steps as usize).min(row.len() - 2);
        let part = steps - below as f64;
        row[below] * (1.0 - part) + row[below + 1] * part
    }
}

/// The ln likelihood of a station whose ln area scatters about what the plume has there.
fn scattered(ln: &[f64]) -> Vec<f64> {
    let top = ln.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let reach = (3.0 * STATION_LN_SD / AREA_STEP_LN) as isize;
    let bell = |k: isize| (-0.5 * (k as f64 * AREA_STEP_LN / STATION_LN_SD).powi(2)).exp();
    let all: f64 = (-reach..=reach).map(bell).sum();
    let last = ln.len() as isize - 1;
    let at = |k: isize| (ln[k.clamp(0, last) as usize] - top).exp();
    (0..=last)
        .map(|k| {
            let sum: f64 = (-reach..=reach).map(|off| bell(off) * at(k + off)).sum();
            top + (sum / all).max(f64::MIN_POSITIVE).ln()
        })
        .collect()
}

/// The posterior of ln rate, kg/s, of a source at one place.
struct Posterior {
    /// ln rate with its weight.
    ln_rate: Vec<(f64, f64)>,
    direction_deg: f64,
    direction_sd_deg: f64,
    direction_variance: f64,
    dispersion_variance: f64,
    height_variance: f64,
    /// What none of these explains.
    rest_variance: f64,
}

impl Posterior {
    /// That of a source from which the sensors are seen so.
    fn of(vertical: &Vertical<'_>, views: &[(&View<'_>, Sight)], speed_m_s: f64) -> Self {
        let middle = |v: &(&View<'_>, Sight)| moment(&v.0.sectors, v.1.distance_m);
        let strongest = views.iter().map(middle).fold(0.0, f64::max).ln();
        let by_area: Vec<ByArea> = views
            .iter()
            .map(|v| ByArea::of(vertical.spec, *v, strongest, speed_m_s))
            .collect();
        let per_ppm = |v: &View<'_>| vertical.kg_m3_per_ppm(v.station.height_agl_m);
        let density = |off: [f64; 2], (view, sight): &(&View<'_>, Sight)| {
            let at = (sight.distance_m, view.station.height_agl_m);
            let own = vertical.density_1_m(at, vertical.spec.stability, off);
            // The density falls below what numbers hold where σz is small.
            own.max(f64::MIN_POSITIVE).ln() - per_ppm(view).ln()
        };
        // About what the strongest station shows at the density of all.
        let best = views
            .iter()
            .max_by(|a, b| middle(a).total_cmp(&middle(b)))
            .map_or(0.0, |v| {
                density([0.0; 2], v).max((LEAST_DENSITY_1_M / per_ppm(v.0)).ln())
            });
        let rates = around(strongest - best, RATE_REACH_LN, RATE_STEPS);
        let shapes: Vec<(f64, f64, f64)> = normal_grid(GRID_STEPS)
            .into_iter()
            .flat_map(|(direction, by_direction)| {
                normal_grid(GRID_STEPS)
                    .into_iter()
                    .map(move |(width, by_width)| (direction, width, by_direction * by_width))
            })
            .collect();
        let mut cells = Vec::new();
        for (sigma_z, by_sigma_z) in normal_grid(GRID_STEPS) {
            for (height, by_height) in vertical.height_steps(GRID_STEPS) {
                let densities: Vec<f64> = views
                    .iter()
                    .map(|v| density([sigma_z, height], v))
                    .collect();
                for (k, &(direction, width, by_shape)) in shapes.iter().enumerate() {
                    let beforehand = (by_shape * by_sigma_z * by_height).ln();
                    let at = |rate: &f64| {
                        let of = |(own, density): (&ByArea, &f64)| own.at(k, rate + density);
                        beforehand + by_area.iter().zip(&densities).map(of).sum::<f64>()
                    };
                    let ln: Vec<f64> = rates.iter().map(at).collect();
                    cells.push(([direction, width, sigma_z, height], ln));
                }
            }
        }
        Self::summed(&rates, &cells)
    }

    fn summed(rates: &[f64], cells: &[([f64; 4], Vec<f64>)]) -> Self {
        let summed = Summed::of(rates, cells);
        let directions = summed.unknown(0, DIRECTION_SD_DEG);
        let [direction_variance, width, sigma_z, height_variance] = summed.explained;
        Self {
            rest_variance: summed.rest_variance(),
            ln_rate: summed.values,
            direction_deg: mean(&directions),
            direction_sd_deg: variance(&directions).sqrt(),
            direction_variance,
            dispersion_variance: width + sigma_z,
            height_variance,
        }
    }
}
