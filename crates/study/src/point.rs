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

use crate::clean_air::Excess;
use crate::grid::{Summed, around, mean, normal_grid, variance};
use crate::position;
use crate::profile::{DIRECTION_SD_DEG, PROFILE_FLOOR, Shape, moment};
use crate::sectors::{
    REACH_DEG, SECTOR_DEG, Sector, background_lever, dips, highest, peaks_at_edge, sectors,
    stands_out,
};
use crate::stations::{Station, stations};
use crate::vertical::Vertical;
use crate::{LOGGED_SPEED_LN_SD, PlumeFlux, StudyError, Term};
use plume::DispersionSpec;
use scenario::Scenario;
use scenario::observations::{Observations, checks};

/// Fewest readings of a sector, as in OTM 33A.
const LEAST_READINGS: usize = 5;
/// Fewest sectors: a Gaussian has an area, a width and a direction.
const LEAST_SECTORS: usize = 3;
/// Half of the grid of ln area about its moment estimate, and its number of steps.
const AREA_REACH_LN: f64 = 3.0;
const AREA_STEPS: usize = 301;
/// Steps of the grids of other quantities.
const GRID_STEPS: usize = 21;

/// Estimates the rate of the source of `scenario` from `observations` of one platform at rest.
///
/// # Errors
/// [`StudyError::Refused`] where the observations do not meet the method's conditions; a scenario that describes no
/// world.
pub fn estimate(scenario: &Scenario, observations: &Observations) -> Result<PlumeFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let checked = checks::check(observations, &spec, &frame).observations;
    let stations = stations(&spec, &frame, &checked)?;
    let [station] = stations.as_slice() else {
        let refusal = format!("{} platforms read; expected one", stations.len());
        return Err(StudyError::Refused(refusal));
    };
    let excess = Excess::above_lowest(&station.readings, spec.sensor.noise_sd_ppm);
    let sectors = sectors(&excess, LEAST_READINGS);
    if sectors.len() < LEAST_SECTORS {
        return Err(StudyError::Refused(format!(
            "the wind blew from {} sectors of {SECTOR_DEG} degrees within {REACH_DEG} degrees of the source; expected {LEAST_SECTORS} with {LEAST_READINGS} readings each",
            sectors.len()
        )));
    }
    if dips(&sectors, DIRECTION_SD_DEG) {
        return Err(StudyError::Refused(
            "the readings are lowest while the wind blows from the source to the sensor; expected an excess there"
                .into(),
        ));
    }
    Ok(flux(
        &Vertical::new(scenario, &spec),
        station,
        &excess,
        &sectors,
    ))
}

fn flux(
    vertical: &Vertical<'_>,
    station: &Station,
    excess: &Excess,
    sectors: &[Sector],
) -> PlumeFlux {
    let speed_m_s = station.mean_speed_m_s();
    let mut out = PlumeFlux {
        distance_m: station.distance_m,
        from_deg: air::geo::wrap_deg(station.bearing_deg + 180.0),
        speed_m_s,
        ..PlumeFlux::default()
    };
    if !stands_out(sectors) {
        out.upper_limit_kg_s = Some(upper_limit_kg_s(vertical, station, sectors));
        out.notes.push("the plume was not met".into());
        return out;
    }
    let place = (station, [0.0; 2]);
    let profile = Profile::of(vertical.spec, place, sectors);
    let rates = ln_rates(vertical, place, &profile);
    let background = excess.background_sd_ppm * background_lever(sectors, speed_m_s, PROFILE_FLOOR);
    let position = position::variance(vertical.position_sd_m, station.distance_m, &|displaced| {
        let place = (station, displaced);
        let profile = Profile::of(vertical.spec, place, sectors);
        mean(&ln_rates(vertical, place, &profile))
    });
    let [sigma_z_variance, height_variance] = vertical.variances(station.at(), GRID_STEPS);
    let beside = [
        (Term::WindSpeed, LOGGED_SPEED_LN_SD.powi(2)),
        (Term::Sensor, vertical.gain_ln_sd.powi(2)),
        (Term::Background, background.powi(2)),
        (Term::SourcePosition, position),
    ];
    let inside = [
        (Term::WindDirection, profile.direction_variance),
        (Term::Turbulence, profile.turbulence_variance),
        (Term::Dispersion, profile.width_variance + sigma_z_variance),
        (Term::Height, height_variance),
    ];
    let rate = out.state(rates, &inside, &beside);
    out.one_class_off_kg_s = vertical.one_class_off(station.at(), rate.value);
    out.from_deg = air::geo::wrap_deg(out.from_deg + profile.direction_deg);
    out.from_sd_deg = Some(profile.direction_sd_deg);
    if peaks_at_edge(sectors) {
        out.notes.push(
            "the highest sector is at the edge of the wind directions: part of the plume was not seen".into(),
        );
    }
    out
}

/// ln rate, kg/s, of a source that is displaced by so many metres east and north, with weights.
fn ln_rates(
    vertical: &Vertical<'_>,
    (station, displaced): (&Station, [f64; 2]),
    profile: &Profile,
) -> Vec<(f64, f64)> {
    let at = (
        station.seen_from(displaced).distance_m,
        station.height_agl_m,
    );
    let scale = vertical.kg_m3_per_ppm(station.height_agl_m).ln();
    let densities = vertical.ln_density(at, GRID_STEPS);
    let mut out = Vec::with_capacity(profile.ln_area.len() * densities.len());
    for (ln_area, by_area) in &profile.ln_area {
        for (ln_density, by_density) in &densities {
            out.push((ln_area + scale - ln_density, by_area * by_density));
        }
    }
    out
}

/// The posterior of ln area of the crosswind profile, ppm m²/s, of a source at one place.
struct Profile {
    /// ln area with its weight.
    ln_area: Vec<(f64, f64)>,
    direction_deg: f64,
    direction_sd_deg: f64,
    direction_variance: f64,
    width_variance: f64,
    turbulence_variance: f64,
}

impl Profile {
    fn of(
        spec: &DispersionSpec,
        (station, displaced): (&Station, [f64; 2]),
        sectors: &[Sector],
    ) -> Self {
        let place = (station.seen_from(displaced), station.mean_speed_m_s());
        let middle = moment(sectors, place.0.distance_m).ln();
        let grid = around(middle, AREA_REACH_LN, AREA_STEPS);
        let floor = PROFILE_FLOOR * highest(sectors);
        let mut cells = Vec::new();
        for (direction, by_direction) in normal_grid(GRID_STEPS) {
            for (width, by_width) in normal_grid(GRID_STEPS) {
                let shape = Shape::new(spec, place, [direction, width]);
                let beforehand = (by_direction * by_width).ln();
                let of_area = |ln_area: &f64| shape.ln_likelihood(sectors, ln_area.exp(), floor);
                let row: Vec<f64> = grid.iter().map(|a| beforehand + of_area(a)).collect();
                cells.push(([direction, width], row));
            }
        }
        let summed = Summed::of(&grid, &cells);
        let directions = summed.unknown(0, DIRECTION_SD_DEG);
        let [direction_variance, width_variance] = summed.explained;
        Self {
            turbulence_variance: summed.rest_variance(),
            ln_area: summed.values,
            direction_deg: mean(&directions),
            direction_sd_deg: variance(&directions).sqrt(),
            direction_variance,
            width_variance,
        }
    }
}

/// The rate whose plume the sectors would have shown at 95 %: two standard deviations of their weighted mean.
pub(crate) fn upper_limit_kg_s(
    vertical: &Vertical<'_>,
    station: &Station,
    sectors: &[Sector],
) -> f64 {
    let shape = Shape::expected(vertical.spec, station.distance_m, station.mean_speed_m_s());
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
    area * vertical.kg_m3_per_ppm(station.height_agl_m) / vertical.least_density_1_m(station.at())
}
