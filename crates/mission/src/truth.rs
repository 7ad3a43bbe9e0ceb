//! What is known of the stand-ins' reality: its numbers, and the highest concentration that the
//! team may reach in it. The team never sees this; the summary holds its result against it.

use crate::{MissionError, Setup};
use air::geo::{Enu, Position};
use air::wind::towards_deg;
use plume::{DispersionModel, MechanismId, Place};
use protocol::message::{Estimate, Model};
use record::campaign::MapError;
use record::summary::{ModelNumbers, PlaceOfPeak, TruePeak};
use scenario::Scenario;
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::peak::{highest, highest_of};
use scenario::tables::VehicleKind;
use std::sync::Arc;

/// Whether a vehicle of the team stands in for a real one, so that there is a reality.
pub fn has_stand_in(scenario: &Scenario) -> bool {
    scenario
        .vehicles
        .iter()
        .any(|v| v.kind == VehicleKind::StandIn)
}

/// The numbers of the model that `scenario` describes, with its priors as standard deviations.
///
/// # Errors
/// A scenario that describes no world.
pub fn numbers(scenario: &Scenario) -> Result<ModelNumbers, MissionError> {
    let calibrator = ws::Calibrator::new(scenario, &[], None)?;
    let c = calibrator.calibrated();
    Ok(ModelNumbers {
        background_ppm: c.background_ppm,
        effective_height_agl_m: c.effective_height_agl_m,
        axis_deg: c.axis_deg,
        c_max_ppm: c.c_max_ppm,
        c_max_distance_m: Estimate {
            value: c.c_max_distance_m,
            sd: 0.0,
        },
        sigma_y_scale: c.sigma_y_scale,
        sigma_z_scale: c.sigma_z_scale,
    })
}

/// The numbers of the reality of `scenario`, at the distance at which the scenario states c_MAX.
/// They are what they are: their standard deviations are zero.
///
/// # Errors
/// A reality that describes no world.
pub(crate) fn reality_numbers(scenario: &Scenario) -> Result<ModelNumbers, MissionError> {
    let mut spec = scenario.in_reality().dispersion_spec()?;
    let distance_m = scenario.dispersion_spec()?.sources[0]
        .strength
        .c_max_distance_m();
    let source = &spec.sources[0];
    let axis_deg = towards_deg(spec.wind.from_deg());
    let height_m = source.effective_height_agl_m;
    let exactly = |value: f64| Estimate { value, sd: 0.0 };
    let (background, y, z) = (spec.background_ppm, spec.sigma_y_scale, spec.sigma_z_scale);
    // c_MAX is the first source's own.
    spec.sources.truncate(1);
    spec.mechanisms
        .retain(|m| m.id() != MechanismId::SecondSource);
    let model = DispersionModel::new(spec).map_err(scenario::world::WorldError::from)?;
    Ok(ModelNumbers {
        background_ppm: exactly(background),
        effective_height_agl_m: exactly(height_m),
        axis_deg: exactly(axis_deg),
        c_max_ppm: exactly(model.axis_excess_ppm(distance_m)),
        c_max_distance_m: exactly(distance_m),
        sigma_y_scale: exactly(y),
        sigma_z_scale: exactly(z),
    })
}

/// The maximum of the reality's mean field where set-points may go, at any time: where the wind of a series
/// has carried the plume by then, and with the mechanisms of the time.
///
/// # Errors
/// A reality that describes no world, or a fence with nowhere to fly.
pub fn true_peak(setup: &Setup) -> Result<TruePeak, MissionError> {
    let model = setup.scenario.in_reality().dispersion_model()?;
    let airspace = airspace(setup)?;
    let series = setup.reality_wind_series.clone();
    Ok(TruePeak(Arc::new(move |time_s| {
        let highest = match &series {
            None => highest_of(&model, &airspace, SETPOINT_MARGIN_M, time_s),
            Some(series) => {
                let puffs = model.puffs(series, 0.0, None, time_s);
                let axes = model.puff_centres(&puffs);
                let ppm = |p: &Place| model.ppm_among(&puffs, p);
                highest(&ppm, &axes, &airspace, SETPOINT_MARGIN_M)
            }
        }?;
        let at = airspace.frame().to_geodetic(highest.position.at);
        Some(PlaceOfPeak {
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            alt_amsl_m: highest.position.height_m,
            co2_ppm: highest.co2_ppm,
        })
    })))
}

/// The airspace of a mission, over its ground.
fn airspace(setup: &Setup) -> Result<Airspace, MissionError> {
    Ok(Airspace::of(&setup.scenario)?.over(&setup.terrain))
}

/// Whether the reality's mean field is the same at all times.
pub(crate) fn is_steady(setup: &Setup) -> bool {
    let reality = setup.scenario.in_reality();
    let emits_alike = reality.sources.iter().all(|s| s.emission_table.is_none());
    setup.reality_wind_series.is_none() && reality.mechanisms.is_empty() && emits_alike
}

/// Points on a side of the grid on which maps are compared, and its levels.
const MAP_POINTS: usize = 40;
const MAP_LEVELS: usize = 12;

/// How far a corrected `model` is from the reality's mean field of its time `time_s` inside the fence: on a grid of
/// the box of the airspace, where vehicles may be. None where there is nothing of the plume.
///
/// # Errors
/// A scenario or a reality that describes no world.
pub(crate) fn map_error(
    setup: &Setup,
    model: &Model,
    time_s: f64,
) -> Result<Option<MapError>, MissionError> {
    let base = setup.scenario.dispersion_spec()?;
    let reality = setup.scenario.in_reality().dispersion_model()?;
    let airspace = airspace(setup)?;
    let Some(corrected) = ws::model::corrected(&base, model) else {
        return Ok(None);
    };
    let series = &setup.reality_wind_series;
    let puffs = series.as_ref().map(|s| reality.puffs(s, 0.0, None, time_s));
    let truth = |place: &Place| match &puffs {
        Some(puffs) => reality.ppm_among(puffs, place),
        None => reality.mean_ppm(place, time_s),
    };
    let (mut count, mut off, mut plume) = (0.0, 0.0, 0.0);
    for position in map_points(&airspace) {
        let place = Place {
            east_m: position.at.east_m,
            north_m: position.at.north_m,
            height_agl_m: position.height_m - airspace.frame().ground_amsl_m,
        };
        let there = truth(&place);
        count += 1.0;
        off += (corrected.mean_ppm(&place, time_s) - there).powi(2);
        plume += (there - reality.background_ppm(&place, time_s)).powi(2);
    }
    let rms = |sum: f64| f64::sqrt(sum / count);
    let error = MapError {
        rmse_ppm: rms(off),
        plume_rms_ppm: rms(plume),
    };
    Ok((error.rmse_ppm.is_finite() && error.plume_rms_ppm > 0.0).then_some(error))
}

fn map_points(airspace: &Airspace) -> impl Iterator<Item = Position> {
    let (low, high) = airspace.bounds();
    let along = |low: f64, high: f64, k: usize, of: usize| {
        low + (high - low) * (k as f64 + 0.5) / of as f64
    };
    let points = (0..MAP_POINTS * MAP_POINTS * MAP_LEVELS).map(move |k| {
        let (level, k) = (k / (MAP_POINTS * MAP_POINTS), k % (MAP_POINTS * MAP_POINTS));
        let (row, column) = (k / MAP_POINTS, k % MAP_POINTS);
        Position {
            at: Enu::new(
                along(low.at.east_m, high.at.east_m, column, MAP_POINTS),
                along(low.at.north_m, high.at.north_m, row, MAP_POINTS),
            ),
            height_m: along(low.height_m, high.height_m, level, MAP_LEVELS),
        }
    });
    points.filter(|position| airspace.contains(*position, 0.0))
}

/// What the sources of the reality emit in its own wind, kg/s, by name.
///
/// # Errors
/// A reality that describes no world.
pub(crate) fn true_flux(scenario: &Scenario) -> Result<Vec<(String, f64)>, MissionError> {
    Ok(scenario.in_reality().dispersion_model()?.emissions_kg_s())
}

#[cfg(test)]
mod tests {
    use super::*;
    use air::geo::Geodetic;

    fn peak(text: &str, time_s: f64) -> (Enu, PlaceOfPeak) {
        let nothing = |_: &str| Err("no such file".to_owned());
        let setup = Setup::load("s.toml", text, &nothing).unwrap();
        let peak = true_peak(&setup).unwrap().0(time_s).unwrap();
        let frame = setup.frame().unwrap();
        let at = Geodetic::new(peak.lat_deg, peak.lon_deg);
        (frame.to_enu(at), peak)
    }

    #[test]
    fn the_peak_of_as_pontes_lies_on_the_axis_where_set_points_may_go() {
        // On the axis c = c_MAX σy σz(2400)/σy σz(1120): with Briggs D that factor is 3.3191
        // (python: s=lambda x:.08*x/(1+1e-4*x)**.5*.06*x/(1+1.5e-3*x)**.5; s(2400)/s(1120)),
        // so 446 + 500 × 3.3191 = 2105.5 ppm at 1120 m towards 72°, 540 m above ground.
        let (at, peak) = peak(include_str!("../../../scenarios/as-pontes.toml"), 0.0);
        assert!(
            (Enu::default().distance_m(at) - 1120.0).abs() < 1.0,
            "{at:?}"
        );
        assert!(
            (Enu::default().bearing_deg(at) - 72.0).abs() < 0.1,
            "{at:?}"
        );
        assert!((peak.alt_amsl_m - 880.0).abs() < 0.5, "{peak:?}");
        assert!((peak.co2_ppm - 2105.5).abs() < 1.0, "{peak:?}");
    }

    #[test]
    fn a_thin_plume_is_not_missed_and_the_mechanisms_of_the_time_count() {
        // Class F at 620 m: σz is 8 m, less than a third of the grid's steps in height.
        // python: s=lambda x:.04*x/(1+1e-4*x)**.5*.016*x/(1+3e-4*x); 400*s(2400)/s(620)+400 = 4224.8
        let text = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n[weather]\nstability=\"F\"\n\
            [background]\nco2_ppm=400\n[fence]\nkeep_out_radius_m=500\n[[source]]\nlat_deg=43.4\nlon_deg=-7.8\n\
            effective_height_m=307\nc_max_ppm=400\nc_max_distance_m=2400\n[[reality.mechanism]]\n\
            id=\"wind-direction-drift\"\nrate_deg_per_h=60\n";
        for (time_s, bearing_deg) in [(0.0, 90.0), (1800.0, 120.0)] {
            let (at, peak) = peak(text, time_s);
            assert!(
                (Enu::default().bearing_deg(at) - bearing_deg).abs() < 0.1,
                "{at:?}"
            );
            assert!((peak.co2_ppm - 4224.8).abs() < 4.0, "{peak:?}");
        }
    }
}
