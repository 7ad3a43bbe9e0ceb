//! The emission rate of one source from one sensor at rest with a wind logged beside it.
//!
//! While the wind swings, the plume sweeps across the sensor. The mean of excess times wind speed in each direction
//! sector is the plume's crosswind profile at the sensor's distance. Its integral across the wind, divided by the
//! plume's vertical density at the sensor's height, is the rate (point-source method of US EPA OTM 33A; Brantley et al.
//! 2014, doi 10.1021/es503070q):
//!
//! > rate = (ppm to kg/m³) ∫ mean(excess · speed) dy / D(z)
//!
//! The profile is a Gaussian of unknown area, width and direction. Its posterior is computed on a grid, so the result is
//! the same on every machine and needs no start value; the emission that the scenario states plays no part.

use crate::{Interval, Share, StudyError, Term};
use air::geo::{Enu, Geodetic, wrap_signed_deg};
use plume::sigma::{sigma_y_m, sigma_z_m};
use plume::stability::Stability;
use plume::{DispersionSpec, Place};
use scenario::Scenario;
use scenario::observations::{Observations, checks};
use scenario::uncertain::Uncertain;
use std::collections::BTreeSet;

/// Width of a direction sector, degrees, as in OTM 33A.
const SECTOR_DEG: f64 = 10.0;
/// Sectors to both sides of the direction of the source, degrees: a plume that is farther off is another's.
const REACH_DEG: f64 = 60.0;
/// Fewest readings of a sector, as in OTM 33A.
const LEAST_READINGS: usize = 5;
/// Fewest sectors: a Gaussian has an area, a width and a direction.
const LEAST_SECTORS: usize = 3;
/// The lowest part of the readings is clean air, as in OTM 33A.
const CLEAN_PART: f64 = 0.05;
/// Its edges as they may be chosen otherwise. Of normal noise they, and the part itself, lie so many standard deviations
/// below the mean.
const CLEAN_EDGES: [f64; 2] = [0.02, 0.10];
const CLEAN_EDGES_BELOW_SD: [f64; 2] = [2.054, 1.282];
const CLEAN_PART_BELOW_SD: f64 = 1.645;
/// Readings within this time meet the same eddies, s: near the ground their time scale is tens of seconds.
const EDDY_S: f64 = 60.0;
/// Standard deviation of one eddy's mean of a sector, as a part of its long-term mean: crossings of a plume within a
/// hundred metres differ by a factor of two.
const EDDY_SCATTER: f64 = 1.0;
/// Standard deviation of a sector's mean about a Gaussian profile, as a part of it: what no time averages out.
const PROFILE_SCATTER: f64 = 0.4;
/// The same as a part of the highest sector: large eddies carry gas far aside, where a Gaussian has none.
const PROFILE_FLOOR: f64 = 0.1;
/// Standard deviation of the direction from source to sensor in the wind vane's frame, degrees: an anemometer set up by
/// compass.
const DIRECTION_SD_DEG: f64 = 10.0;
/// Standard deviation of the wind's crosswind speed that meanders at any stability, m/s (Hanna 1983, J. Climate Appl.
/// Meteor. 22:1424).
const MEANDER_M_S: f64 = 0.5;
/// Standard deviation of ln width of the profile beforehand.
const WIDTH_LN_SD: f64 = 0.5;
/// Standard deviation of ln σz of one class about Briggs' curve (Hanna, Briggs & Hosker 1982: about 25 % in ideal
/// conditions).
const CURVE_LN_SD: f64 = 0.25;
/// Standard deviation of ln wind speed: a calibrated anemometer, carried from its height to the plume's.
const SPEED_LN_SD: f64 = 0.05;
/// Standard deviation of ln gain of the sensor, where the scenario states none.
const GAIN_LN_SD: f64 = 0.02;
/// Half of the grid of ln area about its moment estimate, and its number of steps.
const AREA_REACH_LN: f64 = 3.0;
const AREA_STEPS: usize = 301;
/// Grids of normal quantities reach so many standard deviations.
const GRID_SD: f64 = 2.5;
const GRID_STEPS: usize = 21;
/// The plume is met where the highest sector exceeds the lowest by this many standard deviations of the sensor's noise.
const MET_SD: f64 = 5.0;
/// A sensor is at rest within this distance of its mean place, m: position errors of a GNSS receiver.
const AT_REST_M: f64 = 5.0;

/// The rate, or an upper limit, and what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct PointFlux {
    /// The rate, kg/s; none where the plume was not met.
    pub kg_s: Option<Interval>,
    /// What the rate is below at 95 %, kg/s, where the plume was not met.
    pub upper_limit_kg_s: Option<f64>,
    /// Shares of the variance of ln rate, largest first; empty for an upper limit.
    pub budget: Vec<Share>,
    /// Distance from source to sensor, m.
    pub distance_m: f64,
    /// Direction from which the plume came, degrees in the frame of the wind vane.
    pub from_deg: f64,
    /// Mean wind speed at the sensor, m/s.
    pub speed_m_s: f64,
    /// Medians with the next less and the next more stable class, kg/s; none beyond A and F, and for an upper limit.
    pub one_class_off_kg_s: [Option<f64>; 2],
    /// The crosswind profile.
    pub sectors: Vec<Sector>,
    /// What a reader should know beside the number.
    pub notes: Vec<String>,
}

/// Readings in one wind direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sector {
    /// Its middle, degrees clockwise from the direction that leads from the source to the sensor.
    pub off_deg: f64,
    /// Mean of excess times wind speed, ppm m/s.
    pub mean_ppm_m_s: f64,
    /// Standard deviation of that mean by the sensor's noise, ppm m/s.
    pub noise_ppm_m_s: f64,
    /// Number of readings.
    pub readings: usize,
    /// Number of eddies that the readings met.
    pub eddies: usize,
}

/// A reading with its wind.
struct Reading {
    time_s: f64,
    ppm: f64,
    speed_m_s: f64,
    /// Wind direction off the direction that leads from the source to the sensor, degrees.
    off_deg: f64,
}

/// Where the sensor stands in the plume.
struct Geometry<'a> {
    spec: &'a DispersionSpec,
    distance_m: f64,
    height_agl_m: f64,
    source_height_sd_m: f64,
    sigma_z_ln_sd: f64,
}

/// Estimates the rate of the first source of `scenario` from `observations` of one platform at rest.
///
/// # Errors
/// [`StudyError::Refused`] where the observations do not meet the method's conditions; a scenario that describes no
/// world.
pub fn estimate(scenario: &Scenario, observations: &Observations) -> Result<PointFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let checked = checks::check(observations, &spec, &frame).observations;
    let [source] = spec.sources.as_slice() else {
        let refusal = format!("{} sources; expected one", spec.sources.len());
        return Err(StudyError::Refused(refusal));
    };
    let rows = rows_with_wind(&checked)?;
    let place_of = |row: &scenario::observations::ObservationRow| {
        let at = Geodetic {
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
        };
        Place::from_geodetic(&frame, at, row.alt_amsl_m)
    };
    let places: Vec<Place> = rows.iter().map(|(row, _)| place_of(row)).collect();
    let sensor = at_rest(&places)?;
    let to_sensor = Enu {
        east_m: sensor.east_m,
        north_m: sensor.north_m,
    };
    let distance_m = source.place.distance_m(to_sensor);
    let bearing_deg = source.place.bearing_deg(to_sensor);
    let readings: Vec<Reading> = rows
        .iter()
        .map(|(row, wind)| Reading {
            time_s: row.time_s,
            ppm: wind.ppm,
            speed_m_s: wind.speed_m_s,
            off_deg: wrap_signed_deg(wind.from_deg + 180.0 - bearing_deg),
        })
        .collect();
    let geometry = Geometry {
        spec: &spec,
        distance_m,
        height_agl_m: sensor.height_agl_m,
        source_height_sd_m: scenario.prior_sd(Uncertain::EffectiveHeight).unwrap_or(0.0),
        sigma_z_ln_sd: scenario.prior_sd(Uncertain::SigmaZScale).map_or_else(
            || sigma_z_ln_sd(&spec, distance_m),
            |sd| sd / spec.sigma_z_scale,
        ),
    };
    flux(&geometry, &readings, bearing_deg)
}

/// What a row must hold.
struct Wind {
    ppm: f64,
    speed_m_s: f64,
    from_deg: f64,
}

type Row<'a> = (&'a scenario::observations::ObservationRow, Wind);

fn rows_with_wind(observations: &Observations) -> Result<Vec<Row<'_>>, StudyError> {
    if observations.platforms.len() != 1 {
        let refusal = format!("{} platforms; expected one", observations.platforms.len());
        return Err(StudyError::Refused(refusal));
    }
    let mut read = 0;
    let mut rows = Vec::new();
    for row in &observations.rows {
        let Some(ppm) = row.co2_ppm else { continue };
        read += 1;
        if let (Some(speed_m_s), Some(from_deg)) = (row.wind_speed_m_s, row.wind_from_deg) {
            let wind = Wind {
                ppm,
                speed_m_s,
                from_deg,
            };
            rows.push((row, wind));
        }
    }
    if 2 * rows.len() < read || rows.is_empty() {
        return Err(StudyError::Refused(format!(
            "{} of {read} readings have a wind; expected wind_speed_m_s and wind_from_deg beside the sensor",
            rows.len()
        )));
    }
    Ok(rows)
}

fn at_rest(places: &[Place]) -> Result<Place, StudyError> {
    let n = places.len() as f64;
    let mean = |of: fn(&Place) -> f64| places.iter().map(of).sum::<f64>() / n;
    let middle = Place {
        east_m: mean(|p| p.east_m),
        north_m: mean(|p| p.north_m),
        height_agl_m: mean(|p| p.height_agl_m),
    };
    let off_m = |p: &Place| {
        (p.east_m - middle.east_m)
            .hypot(p.north_m - middle.north_m)
            .hypot(p.height_agl_m - middle.height_agl_m)
    };
    let farthest_m = places.iter().map(off_m).fold(0.0, f64::max);
    if farthest_m > AT_REST_M {
        return Err(StudyError::Refused(format!(
            "the sensor moves by {farthest_m:.0} m; expected a sensor at rest within {AT_REST_M} m"
        )));
    }
    Ok(middle)
}

/// Standard deviation of ln σz: that of the curve, and a class that is known to half a class.
fn sigma_z_ln_sd(spec: &DispersionSpec, distance_m: f64) -> f64 {
    let ln = |class: Stability| sigma_z_m(distance_m, class, spec.setting).ln();
    let steps: Vec<f64> = neighbours(spec.stability)
        .into_iter()
        .flatten()
        .map(|class| (ln(class) - ln(spec.stability)).abs())
        .collect();
    CURVE_LN_SD.hypot(0.5 * steps.iter().sum::<f64>() / steps.len() as f64)
}

/// The next less and the next more stable class.
fn neighbours(class: Stability) -> [Option<Stability>; 2] {
    let at = |index: Option<usize>| index.and_then(|i| Stability::ALL.get(i).copied());
    [
        at(class.index().checked_sub(1)),
        at(Some(class.index() + 1)),
    ]
}

/// The value below which `part` of sorted values lie.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

/// What the lowest readings tell of clean air.
struct CleanAir {
    background_ppm: f64,
    background_sd_ppm: f64,
    noise_sd_ppm: f64,
}

impl CleanAir {
    /// `stated_sd_ppm` is the noise of the sensor.
    fn of(readings: &[Reading], stated_sd_ppm: f64) -> Self {
        let mut sorted: Vec<f64> = readings.iter().map(|r| r.ppm).collect();
        sorted.sort_by(f64::total_cmp);
        let [low, high] = CLEAN_EDGES.map(|part| quantile(&sorted, part));
        // The edges of normal noise; where a plume reaches into the clean part it is wider, and the sensor's own counts.
        let edges_sd_ppm = (high - low) / (CLEAN_EDGES_BELOW_SD[0] - CLEAN_EDGES_BELOW_SD[1]);
        let below_ppm = CLEAN_PART_BELOW_SD * edges_sd_ppm.min(stated_sd_ppm);
        Self {
            background_ppm: quantile(&sorted, CLEAN_PART) + below_ppm,
            background_sd_ppm: 0.5 * (high - low),
            noise_sd_ppm: edges_sd_ppm.max(stated_sd_ppm),
        }
    }
}

/// The sectors that hold enough readings.
fn sectors(readings: &[Reading], clean: &CleanAir) -> Vec<Sector> {
    let count = (2.0 * REACH_DEG / SECTOR_DEG).round() as usize;
    let mut out = Vec::new();
    for k in 0..count {
        let low_deg = -REACH_DEG + k as f64 * SECTOR_DEG;
        let within: Vec<&Reading> = readings
            .iter()
            .filter(|r| (low_deg..low_deg + SECTOR_DEG).contains(&r.off_deg))
            .collect();
        if within.len() < LEAST_READINGS {
            continue;
        }
        let n = within.len() as f64;
        let eddies: BTreeSet<i64> = within
            .iter()
            .map(|r| (r.time_s / EDDY_S).floor() as i64)
            .collect();
        let sum = |of: &dyn Fn(&Reading) -> f64| within.iter().map(|r| of(r)).sum::<f64>();
        out.push(Sector {
            off_deg: low_deg + 0.5 * SECTOR_DEG,
            mean_ppm_m_s: sum(&|r| (r.ppm - clean.background_ppm) * r.speed_m_s) / n,
            noise_ppm_m_s: clean.noise_sd_ppm * sum(&|r| r.speed_m_s) / n / n.sqrt(),
            readings: within.len(),
            eddies: eddies.len(),
        });
    }
    out
}

fn flux(
    geometry: &Geometry,
    readings: &[Reading],
    bearing_deg: f64,
) -> Result<PointFlux, StudyError> {
    let clean = CleanAir::of(readings, geometry.spec.sensor.noise_sd_ppm);
    let sectors = sectors(readings, &clean);
    if sectors.len() < LEAST_SECTORS {
        return Err(StudyError::Refused(format!(
            "the wind blew from {} sectors of {SECTOR_DEG} degrees within {REACH_DEG} degrees of the source; expected {LEAST_SECTORS} with {LEAST_READINGS} readings each",
            sectors.len()
        )));
    }
    let speed_m_s = readings.iter().map(|r| r.speed_m_s).sum::<f64>() / readings.len() as f64;
    let is_met = stands_out(&sectors);
    let mut out = PointFlux {
        kg_s: None,
        upper_limit_kg_s: None,
        budget: Vec::new(),
        distance_m: geometry.distance_m,
        from_deg: air::geo::wrap_deg(bearing_deg + 180.0),
        speed_m_s,
        one_class_off_kg_s: [None; 2],
        notes: Vec::new(),
        sectors,
    };
    if !is_met {
        out.upper_limit_kg_s = Some(upper_limit_kg_s(geometry, &out.sectors, speed_m_s));
        out.notes.push("the plume was not met".into());
        return Ok(out);
    }
    let profile = Profile::of(geometry, &out.sectors, speed_m_s);
    let background = clean.background_sd_ppm * background_lever(&out.sectors, readings);
    let dispersion = geometry.vertical();
    let terms = [
        (Term::WindSpeed, SPEED_LN_SD.powi(2)),
        (Term::Sensor, GAIN_LN_SD.powi(2)),
        (Term::Background, background.powi(2)),
        (Term::WindDirection, profile.direction_variance),
        (Term::Turbulence, profile.turbulence_variance),
        (
            Term::Dispersion,
            profile.width_variance + dispersion.sigma_z_variance,
        ),
        (Term::Height, dispersion.height_variance),
    ];
    let scale = geometry.kg_m3_per_ppm();
    let extra_sd = (SPEED_LN_SD.powi(2) + GAIN_LN_SD.powi(2) + background.powi(2)).sqrt();
    let rates = weighted_rates(&profile, &dispersion.ln_density, scale, extra_sd);
    let interval = interval(&rates);
    for (slot, class) in out
        .one_class_off_kg_s
        .iter_mut()
        .zip(neighbours(geometry.spec.stability))
    {
        *slot = class.map(|class| {
            let ratio = |class| geometry.density_1_m(class, 0.0, 0.0);
            interval.value * ratio(geometry.spec.stability) / ratio(class)
        });
    }
    out.from_deg = air::geo::wrap_deg(bearing_deg + 180.0 + profile.direction_deg);
    out.notes = notes(&out.sectors);
    out.kg_s = Some(interval);
    out.budget = budget(&terms);
    Ok(out)
}

fn notes(sectors: &[Sector]) -> Vec<String> {
    let mut out = Vec::new();
    let highest = sectors
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.mean_ppm_m_s.total_cmp(&b.1.mean_ppm_m_s));
    if let Some((k, _)) = highest
        && (k == 0 || k + 1 == sectors.len())
    {
        out.push("the highest sector is at the edge of the wind directions: part of the plume was not seen".into());
    }
    out
}

fn budget(terms: &[(Term, f64)]) -> Vec<Share> {
    let all: f64 = terms.iter().map(|t| t.1).sum();
    let mut shares: Vec<Share> = terms
        .iter()
        .filter(|(_, variance)| *variance > 0.0)
        .map(|&(term, variance)| Share {
            term,
            share: variance / all,
        })
        .collect();
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    shares
}

/// By how much of itself the area of the profile changes with the background, 1/ppm.
fn background_lever(sectors: &[Sector], readings: &[Reading]) -> f64 {
    let area: f64 = sectors.iter().map(|s| s.mean_ppm_m_s).sum();
    let in_plume: Vec<&Sector> = sectors
        .iter()
        .filter(|s| s.mean_ppm_m_s > PROFILE_FLOOR * highest(sectors))
        .collect();
    let speed = readings.iter().map(|r| r.speed_m_s).sum::<f64>() / readings.len() as f64;
    if area > 0.0 {
        in_plume.len() as f64 * speed / area
    } else {
        0.0
    }
}

/// Whether the readings depend on the direction of the wind by more than noise.
fn stands_out(sectors: &[Sector]) -> bool {
    let by_mean = |a: &&Sector, b: &&Sector| a.mean_ppm_m_s.total_cmp(&b.mean_ppm_m_s);
    let (lowest, highest) = (
        sectors.iter().min_by(by_mean),
        sectors.iter().max_by(by_mean),
    );
    let (Some(low), Some(high)) = (lowest, highest) else {
        return false;
    };
    let noise = low.noise_ppm_m_s.hypot(high.noise_ppm_m_s);
    high.mean_ppm_m_s > 0.0 && high.mean_ppm_m_s - low.mean_ppm_m_s > MET_SD * noise
}

fn highest(sectors: &[Sector]) -> f64 {
    sectors.iter().map(|s| s.mean_ppm_m_s).fold(0.0, f64::max)
}

/// The plume's vertical density at the sensor, over what is not known of it.
struct Vertical {
    /// ln density, 1/m, with its weight.
    ln_density: Vec<(f64, f64)>,
    sigma_z_variance: f64,
    height_variance: f64,
}

impl Geometry<'_> {
    /// Vertical density of the plume at the sensor's height, 1/m, with σz and the source's height off by so many
    /// standard deviations.
    fn density_1_m(&self, class: Stability, sigma_z_off: f64, height_off: f64) -> f64 {
        let sigma_z_m = sigma_z_m(self.distance_m, class, self.spec.setting)
            * self.spec.sigma_z_scale
            * (self.sigma_z_ln_sd * sigma_z_off).exp();
        let source_m =
            self.spec.sources[0].effective_height_agl_m + self.source_height_sd_m * height_off;
        let bell = |off_m: f64| (-0.5 * (off_m / sigma_z_m).powi(2)).exp();
        let image = if self.spec.ground_reflection {
            bell(self.height_agl_m + source_m)
        } else {
            0.0
        };
        (bell(self.height_agl_m - source_m) + image) / (std::f64::consts::TAU.sqrt() * sigma_z_m)
    }

    fn vertical(&self) -> Vertical {
        let class = self.spec.stability;
        let heights = if self.source_height_sd_m > 0.0 {
            normal_grid()
        } else {
            vec![(0.0, 1.0)]
        };
        let mut ln_density = Vec::new();
        for (sigma_z_off, by_sigma_z) in normal_grid() {
            for &(height_off, by_height) in &heights {
                let density = self.density_1_m(class, sigma_z_off, height_off);
                ln_density.push((density.ln(), by_sigma_z * by_height));
            }
        }
        let variance_of = |at: &dyn Fn(f64) -> f64| {
            let values: Vec<(f64, f64)> =
                normal_grid().into_iter().map(|(z, w)| (at(z), w)).collect();
            variance(&values)
        };
        Vertical {
            ln_density,
            sigma_z_variance: variance_of(&|z| self.density_1_m(class, z, 0.0).ln()),
            height_variance: if self.source_height_sd_m > 0.0 {
                variance_of(&|z| self.density_1_m(class, 0.0, z).ln())
            } else {
                0.0
            },
        }
    }

    fn kg_m3_per_ppm(&self) -> f64 {
        let alt_amsl_m = self.spec.ground_amsl_m + self.height_agl_m;
        let air = self.spec.atmosphere.at(alt_amsl_m);
        self.spec.sources[0].gas.kg_m3(1.0, air)
    }

    /// Width of the crosswind profile beforehand, radians of wind direction.
    fn width_rad(&self, speed_m_s: f64) -> f64 {
        let spread = sigma_y_m(self.distance_m, self.spec.stability, self.spec.setting)
            * self.spec.sigma_y_scale
            / self.distance_m;
        spread.hypot(MEANDER_M_S / speed_m_s.max(MEANDER_M_S))
    }
}

/// Values of a standard normal quantity with their weights, which sum to one.
fn normal_grid() -> Vec<(f64, f64)> {
    let at = |k: usize| GRID_SD * (2.0 * k as f64 / (GRID_STEPS - 1) as f64 - 1.0);
    let all: f64 = (0..GRID_STEPS).map(|k| (-0.5 * at(k).powi(2)).exp()).sum();
    (0..GRID_STEPS)
        .map(|k| (at(k), (-0.5 * at(k).powi(2)).exp() / all))
        .collect()
}

fn variance(values: &[(f64, f64)]) -> f64 {
    let all: f64 = values.iter().map(|v| v.1).sum();
    let mean = values.iter().map(|(x, w)| x * w).sum::<f64>() / all;
    values
        .iter()
        .map(|(x, w)| w * (x - mean).powi(2))
        .sum::<f64>()
        / all
}

/// The posterior of ln area of the crosswind profile, ppm m²/s.
struct Profile {
    /// ln area with its weight.
    ln_area: Vec<(f64, f64)>,
    direction_deg: f64,
    direction_variance: f64,
    width_variance: f64,
    turbulence_variance: f64,
}

impl Profile {
    fn of(geometry: &Geometry, sectors: &[Sector], speed_m_s: f64) -> Self {
        let width_rad = geometry.width_rad(speed_m_s);
        let moment: f64 = sectors
            .iter()
            .map(|s| s.mean_ppm_m_s.max(0.0) * SECTOR_DEG.to_radians() * geometry.distance_m)
            .sum();
        let grid: Vec<f64> = (0..AREA_STEPS)
            .map(|k| {
                let part = 2.0 * k as f64 / (AREA_STEPS - 1) as f64 - 1.0;
                moment.ln() + AREA_REACH_LN * part
            })
            .collect();
        let floor = PROFILE_FLOOR * highest(sectors);
        let mut ln = Vec::new();
        for (direction, by_direction) in normal_grid() {
            for (width, by_width) in normal_grid() {
                let shape = Shape {
                    direction_rad: (DIRECTION_SD_DEG * direction).to_radians(),
                    width_rad: (width_rad * (WIDTH_LN_SD * width).exp())
                        .hypot(SECTOR_DEG.to_radians() / 12f64.sqrt()),
                    distance_m: geometry.distance_m,
                };
                let beforehand = (by_direction * by_width).ln();
                let of_area = |ln_area: &f64| shape.ln_likelihood(sectors, ln_area.exp(), floor);
                let row: Vec<f64> = grid.iter().map(|a| beforehand + of_area(a)).collect();
                ln.push((direction, width, row));
            }
        }
        Self::summed(&grid, &ln)
    }

    /// Sums over direction and width, and parts the variance of ln area.
    fn summed(grid: &[f64], ln: &[(f64, f64, Vec<f64>)]) -> Self {
        let top = ln
            .iter()
            .flat_map(|(_, _, row)| row)
            .fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let mut ln_area: Vec<(f64, f64)> = grid.iter().map(|a| (*a, 0.0)).collect();
        let (mut by_direction, mut by_width) = (Vec::new(), Vec::new());
        let mut mean_direction = 0.0;
        let mut all = 0.0;
        for (direction, width, row) in ln {
            let (mut weight, mut sum) = (0.0, 0.0);
            for (slot, l) in ln_area.iter_mut().zip(row) {
                let w = (l - top).exp();
                slot.1 += w;
                weight += w;
                sum += w * slot.0;
            }
            if weight > 0.0 {
                by_direction.push((*direction, sum, weight));
                by_width.push((*width, sum, weight));
                mean_direction += weight * direction;
                all += weight;
            }
        }
        let whole = variance(&ln_area);
        let direction_variance = explained(&by_direction);
        let width_variance = explained(&by_width);
        Self {
            ln_area,
            direction_deg: DIRECTION_SD_DEG * mean_direction / all,
            direction_variance,
            width_variance,
            turbulence_variance: (whole - direction_variance - width_variance).max(0.0),
        }
    }
}

/// Variance of the means of groups of (group, sum, weight).
fn explained(parts: &[(f64, f64, f64)]) -> f64 {
    let mut groups: Vec<(f64, f64, f64)> = Vec::new();
    for &(key, sum, weight) in parts {
        match groups.iter_mut().find(|g| g.0 == key) {
            Some(group) => (group.1, group.2) = (group.1 + sum, group.2 + weight),
            None => groups.push((key, sum, weight)),
        }
    }
    let means: Vec<(f64, f64)> = groups.iter().map(|g| (g.1 / g.2, g.2)).collect();
    variance(&means)
}

/// A Gaussian crosswind profile.
struct Shape {
    direction_rad: f64,
    width_rad: f64,
    distance_m: f64,
}

impl Shape {
    /// Expected mean of a sector for an area of 1 ppm m²/s, 1/m.
    fn at(&self, sector: &Sector) -> f64 {
        let off = (sector.off_deg.to_radians() - self.direction_rad) / self.width_rad;
        (-0.5 * off * off).exp() / (std::f64::consts::TAU.sqrt() * self.width_rad * self.distance_m)
    }

    fn ln_likelihood(&self, sectors: &[Sector], area: f64, floor: f64) -> f64 {
        let of = |sector: &Sector| {
            let expected = area * self.at(sector);
            let eddies = EDDY_SCATTER.powi(2) / sector.eddies as f64;
            let variance = expected.powi(2) * (eddies + PROFILE_SCATTER.powi(2))
                + sector.noise_ppm_m_s.powi(2)
                + floor * floor;
            -0.5 * ((sector.mean_ppm_m_s - expected).powi(2) / variance + variance.ln())
        };
        sectors.iter().map(of).sum()
    }
}

/// ln rate with its weight; `extra_sd` is that of ln rate by what is the same for all readings.
fn weighted_rates(
    profile: &Profile,
    ln_density: &[(f64, f64)],
    kg_m3_per_ppm: f64,
    extra_sd: f64,
) -> Vec<(f64, f64)> {
    let mut out = Vec::with_capacity(profile.ln_area.len() * ln_density.len());
    for (ln_area, by_area) in &profile.ln_area {
        for (ln_density, by_density) in ln_density {
            out.push((
                ln_area + kg_m3_per_ppm.ln() - ln_density,
                by_area * by_density,
            ));
        }
    }
    widened(out, extra_sd)
}

/// The same about the mean, wider by an independent normal quantity.
fn widened(mut values: Vec<(f64, f64)>, extra_sd: f64) -> Vec<(f64, f64)> {
    let all: f64 = values.iter().map(|v| v.1).sum();
    let mean = values.iter().map(|(x, w)| x * w).sum::<f64>() / all;
    let own = variance(&values);
    let factor = (1.0 + extra_sd * extra_sd / own).sqrt();
    for value in &mut values {
        value.0 = mean + factor * (value.0 - mean);
    }
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    values
}

/// Quantiles of sorted ln values with weights.
fn interval(ln_rates: &[(f64, f64)]) -> Interval {
    let all: f64 = ln_rates.iter().map(|r| r.1).sum();
    let at = |part: f64| {
        let mut below = 0.0;
        for (ln, weight) in ln_rates {
            below += weight;
            if below >= part * all {
                return ln.exp();
            }
        }
        f64::NAN
    };
    // One standard deviation of a normal quantity to both sides.
    const ONE_SD: [f64; 2] = [0.158_655, 0.841_345];
    Interval {
        value: at(0.5),
        sd: 0.5 * (at(ONE_SD[1]) - at(ONE_SD[0])),
        low95: at(0.025),
        high95: at(0.975),
    }
}

/// The rate whose plume the sectors would have shown at 95 %: two standard deviations of their weighted mean.
fn upper_limit_kg_s(geometry: &Geometry, sectors: &[Sector], speed_m_s: f64) -> f64 {
    let shape = Shape {
        direction_rad: 0.0,
        width_rad: geometry.width_rad(speed_m_s),
        distance_m: geometry.distance_m,
    };
    let (mut weight, mut sum) = (0.0, 0.0);
    for sector in sectors {
        let expected = shape.at(sector);
        let noise = sector.noise_ppm_m_s.max(f64::MIN_POSITIVE);
        weight += (expected / noise).powi(2);
        sum += expected * sector.mean_ppm_m_s / noise.powi(2);
    }
    // One-sided 95 % of a normal quantity, and a vertical density two standard deviations lower than expected.
    const ONE_SIDED: f64 = 1.645;
    let area = (sum / weight).max(0.0) + ONE_SIDED / weight.sqrt();
    let densities = [-2.0, 0.0, 2.0].map(|z| geometry.density_1_m(geometry.spec.stability, z, 0.0));
    let least = densities.into_iter().fold(f64::INFINITY, f64::min);
    area * geometry.kg_m3_per_ppm() / least
}
