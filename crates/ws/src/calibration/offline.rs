//! Calibration from files: measured observations of one or several platforms correct a scenario.

use super::{Calibrated, Calibrator};
use crate::WsError;
use air::geo::{Geodetic, wrap_deg};
use air::wind::WindVector;
use plume::stability::Stability;
use plume::{MechanismId, Place};
use protocol::message::Estimate;
use scenario::Scenario;
use scenario::airspace::SETPOINT_MARGIN_M;
use scenario::observations::{DataQuality, ObservationRow, Observations, checks};
use scenario::uncertain::Uncertain;

/// Logged winds are averaged over one of these times on both sides, s, whichever makes the readings
/// likeliest: a log is noisy, but the wind it shows may also really change.
const WIND_AVERAGED_S: [f64; 7] = [0.0, 4.0, 12.0, 30.0, 120.0, 600.0, f64::INFINITY];

/// A calibration from files.
#[derive(Debug, Clone)]
pub struct OfflineCalibration {
    /// The scenario with corrected values; their standard deviations are its new priors.
    pub scenario: Scenario,
    /// What was found.
    pub calibrated: Calibrated,
    /// The calibrator, to ask for further parameters.
    pub calibrator: Calibrator,
    /// What was wrong with the raw observations and was left out.
    pub data_quality: Vec<DataQuality>,
}

/// Corrects `scenario` by what the checks of raw data leave of `observations`. With a `reference`
/// platform, the other platforms' sensors get an offset and a gain against it.
///
/// # Errors
/// A scenario that describes no world, or observations of which nothing is left.
pub fn calibrate(
    scenario: &Scenario,
    observations: &Observations,
    reference: Option<&str>,
) -> Result<OfflineCalibration, WsError> {
    calibrate_in(scenario, &[], observations, reference)
}

/// The same in air of these stability classes, each from its time on, s; in the scenario's where there are none.
///
/// # Errors
/// As of [`calibrate`].
pub fn calibrate_in(
    scenario: &Scenario,
    classes: &[(f64, Stability)],
    observations: &Observations,
    reference: Option<&str>,
) -> Result<OfflineCalibration, WsError> {
    let checked = checks::check(
        observations,
        &scenario.dispersion_spec()?,
        &scenario.frame()?,
    );
    if checked.observations.readings() == 0 {
        return Err(nothing_left(observations, &checked.flaws));
    }
    let (observations, zero_s) = checked.observations.counted_from_near_zero()?;
    let observations = observations.as_ref();
    let stated = scenario;
    let scenario = &stated.counted_from(zero_s);
    let classes: Vec<_> = classes.iter().map(|(t, c)| (t - zero_s, *c)).collect();
    let mut best: Option<Calibrator> = None;
    // When a sensor is in clean air tells the wind as it was logged.
    let as_logged = read(
        scenario,
        observations,
        reference,
        &averaged_winds(observations, 0.0),
    )?;
    let own = as_logged.own_zeros()?;
    for averaged_s in WIND_AVERAGED_S {
        let winds = averaged_winds(observations, averaged_s);
        let nothing_logged = winds.iter().all(Option::is_none);
        let mut calibrator = read(scenario, observations, reference, &winds)?;
        calibrator.give_own_zeros(own.clone(), reference);
        calibrator.set_classes(classes.clone());
        calibrator.glance()?;
        if best.as_ref().is_none_or(|b| calibrator.cost() < b.cost()) {
            best = Some(calibrator);
        }
        if nothing_logged {
            break;
        }
    }
    let mut calibrator = match best {
        Some(best) => best,
        None => Calibrator::new(scenario, &observations.platforms, reference)?,
    };
    calibrator.conclude(scenario.fence.keep_out_radius_m + SETPOINT_MARGIN_M)?;
    if let Some(from_deg) = logged_from_deg(observations) {
        calibrator.set_wind_from(from_deg);
    }
    let calibrated = calibrator.calibrated();
    let corrected = corrected(stated, &calibrator, &calibrated, observations);
    Ok(OfflineCalibration {
        scenario: corrected,
        calibrated,
        calibrator,
        data_quality: checked.flaws,
    })
}

fn nothing_left(observations: &Observations, flaws: &[DataQuality]) -> WsError {
    let of = |flaw: &DataQuality| format!("{}: {}", flaw.platform, flaw.message);
    WsError::NothingLeft {
        readings: observations.readings(),
        flaws: flaws.iter().map(of).collect::<Vec<_>>().join("; "),
    }
}

/// A calibrator that has read all rows, each of which has its wind of `winds`.
fn read(
    scenario: &Scenario,
    observations: &Observations,
    reference: Option<&str>,
    winds: &[Option<WindVector>],
) -> Result<Calibrator, WsError> {
    let frame = scenario.frame()?;
    let mut calibrator = Calibrator::new(scenario, &observations.platforms, reference)?;
    for (row, wind) in observations.rows.iter().zip(winds) {
        let Some(ppm) = row.co2_ppm else { continue };
        let at = Geodetic {
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
        };
        let place = Place::from_geodetic(&frame, at, row.alt_amsl_m);
        let wind = wind.map(|w| (w.speed_m_s(), w.from_deg()));
        let span = row.span(&frame);
        calibrator.observe_mean(row.platform, row.time_s, (place, span), wind, ppm);
    }
    calibrator.finish();
    Ok(calibrator)
}

fn corrected(
    scenario: &Scenario,
    calibrator: &Calibrator,
    found: &Calibrated,
    observations: &Observations,
) -> Scenario {
    let mut corrected = scenario.clone();
    // The turn is against the wind that was logged; without a log, against the scenario's.
    let from_deg = logged_from_deg(observations).unwrap_or(scenario.weather.wind_from_deg);
    let turned = wrap_deg(from_deg + calibrator.turn_deg());
    let factor = found.strength_factor;
    let strength = |value: Option<f64>| value.unwrap_or_default() * factor.value;
    let strength_sd = |value: Option<f64>| value.unwrap_or_default() * factor.sd;
    let source = &scenario.sources[0];
    // What only a scenario that marks it uncertain has among its unknowns.
    let own = |id, of: fn(f64, f64) -> f64, value: f64| {
        let none = Estimate {
            value: f64::NAN,
            sd: f64::NAN,
        };
        calibrator.parameter(id, None).map_or(none, |e| Estimate {
            value: of(value, e.value),
            sd: if matches!(id, MechanismId::SensorOffset) {
                e.sd
            } else {
                value * e.sd
            },
        })
    };
    let speed = own(
        MechanismId::WindSpeedScale,
        std::ops::Mul::mul,
        scenario.weather.wind_speed_m_s,
    );
    let offset = own(
        MechanismId::SensorOffset,
        std::ops::Add::add,
        scenario.sensor().offset_ppm,
    );
    let gain = own(
        MechanismId::SensorGain,
        std::ops::Mul::mul,
        scenario.sensor().gain,
    );
    for (key, value, sd) in [
        (Uncertain::WindFrom, turned, found.axis_deg.sd),
        (
            Uncertain::EffectiveHeight,
            found.effective_height_agl_m.value,
            found.effective_height_agl_m.sd,
        ),
        (
            Uncertain::Emission,
            strength(source.mean_emission_kg_s()),
            strength_sd(source.mean_emission_kg_s()),
        ),
        (
            Uncertain::CMax,
            strength(source.c_max_ppm),
            strength_sd(source.c_max_ppm),
        ),
        (
            Uncertain::Background,
            found.background_ppm.value,
            found.background_ppm.sd,
        ),
        (
            Uncertain::SigmaYScale,
            found.sigma_y_scale.value,
            found.sigma_y_scale.sd,
        ),
        (
            Uncertain::SigmaZScale,
            found.sigma_z_scale.value,
            found.sigma_z_scale.sd,
        ),
        (
            Uncertain::SensorTimeConstant,
            found.time_constant_s.value,
            found.time_constant_s.sd,
        ),
        (Uncertain::WindSpeed, speed.value, speed.sd),
        (Uncertain::SensorOffset, offset.value, offset.sd),
        (Uncertain::SensorGain, gain.value, gain.sd),
    ] {
        if scenario.value(key).is_some() && value.is_finite() {
            corrected.set_with_sd(key, value, sd);
        }
    }
    corrected.extend(&calibrator.of_sensors());
    corrected
}

/// The wind logged in a row, if it was.
fn logged(row: &ObservationRow) -> Option<WindVector> {
    Some(WindVector::from_speed_and_direction(
        row.wind_speed_m_s?,
        row.wind_from_deg?,
    ))
}

/// Direction from which the mean of the logged winds blows, degrees: what a turn that was found
/// against the log turns. None where no row has a wind.
fn logged_from_deg(observations: &Observations) -> Option<f64> {
    let winds = observations.rows.iter().filter_map(logged);
    let sum = winds.fold(None, |sum: Option<WindVector>, wind| {
        let (east, north) = sum.map_or((0.0, 0.0), |s| (s.east_m_s, s.north_m_s));
        Some(WindVector {
            east_m_s: east + wind.east_m_s,
            north_m_s: north + wind.north_m_s,
        })
    });
    sum.map(WindVector::from_deg)
}

/// Average of each row's logged wind over its platform's rows within `averaged_s` before and
/// after; none where nothing was logged.
fn averaged_winds(observations: &Observations, averaged_s: f64) -> Vec<Option<WindVector>> {
    let mut winds = vec![None; observations.rows.len()];
    for platform in 0..observations.platforms.len() {
        let rows: Vec<(usize, f64, Option<WindVector>)> = observations
            .rows
            .iter()
            .enumerate()
            .filter(|(_, row)| row.platform == platform)
            .map(|(k, row)| (k, row.time_s, logged(row)))
            .collect();
        // A moving average: each row enters and leaves the sums once.
        let (mut first, mut next) = (0, 0);
        let (mut east, mut north, mut count) = (0.0, 0.0, 0.0);
        for &(k, time_s, _) in &rows {
            while next < rows.len() && rows[next].1 <= time_s + averaged_s {
                if let Some(wind) = rows[next].2 {
                    (east, north, count) =
                        (east + wind.east_m_s, north + wind.north_m_s, count + 1.0);
                }
                next += 1;
            }
            while rows[first].1 < time_s - averaged_s {
                if let Some(wind) = rows[first].2 {
                    (east, north, count) =
                        (east - wind.east_m_s, north - wind.north_m_s, count - 1.0);
                }
                first += 1;
            }
            if count > 0.5 {
                winds[k] = Some(WindVector {
                    east_m_s: east / count,
                    north_m_s: north / count,
                });
            }
        }
    }
    winds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logged_direction_is_that_of_the_mean_vector() {
        let header =
            "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,wind_speed_m_s,wind_from_deg";
        let read = |winds: [&str; 2]| {
            let [a, b] = winds;
            let text = format!("{header}\n1,a,43.4,-7.8,700,450,{a}\n2,a,43.4,-7.8,700,451,{b}\n");
            logged_from_deg(
                &scenario::observations::parse(&[("a.csv", &text)], plume::Gas::Co2).unwrap(),
            )
        };
        // 6 m/s from 350° and 6 m/s from 20°: the mean blows from 5°, not from 185°.
        assert!((read(["6,350", "6,20"]).unwrap() - 5.0).abs() < 1e-9);
        // The stronger counts for more: atan2(10, 5) = 63.43°.
        assert!((read(["5,0", "10,90"]).unwrap() - 63.434_948_8).abs() < 1e-6);
        assert!((read([",", "4,120"]).unwrap() - 120.0).abs() < 1e-9);
        assert_eq!(read([",", ","]), None);
    }
}
