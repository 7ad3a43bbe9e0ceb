//! Calibration from files: measured observations of one or several platforms correct a scenario.

use super::parameters::{UNKNOWN, plus, times};
use super::{Calibrated, Calibrator};
use crate::WsError;
use air::geo::wrap_deg;
use plume::MechanismId;
use plume::stability::Stability;
use protocol::message::{Estimate, Peak};
use scenario::Scenario;
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::observations::{DataQuality, Observations, checks};
use scenario::uncertain::Uncertain;
use study::Interval;
use study::flux::Method;

/// A calibration from files.
#[derive(Debug, Clone)]
pub struct OfflineCalibration {
    /// The scenario with corrected values; their standard deviations are its new priors.
    pub scenario: Scenario,
    /// What was found.
    pub calibrated: Calibrated,
    /// The calibrator, to ask for further parameters.
    pub calibrator: Calibrator,
    /// The rate of the source, kg/s, where sensors that all stand still tell it and the scenario states an emission.
    pub rate_at_rest: Option<Interval>,
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
    let classes = classes.iter().map(|(t, c)| (t - zero_s, *c)).collect();
    let mut calibrator = Calibrator::new(scenario, &observations.platforms, reference)?;
    calibrator.set_classes(classes);
    for row in &observations.rows {
        calibrator.observe_row(row);
    }
    calibrator.finish();
    calibrator.conclude(scenario.fence.keep_out_radius_m + SETPOINT_MARGIN_M)?;
    calibrator.blow_as_logged();
    let mut calibrated = calibrator.calibrated();
    // A strength that is stated otherwise is the fit's.
    let stated_kg_s = stated.value(Uncertain::Emission);
    let rate_at_rest = stated_kg_s.and_then(|_| rate_at_rest(scenario, observations));
    if let Some((rate, stated_kg_s)) = rate_at_rest.zip(stated_kg_s) {
        let factor = scaled(rate, rate.value / stated_kg_s);
        let ratio = factor.value / calibrated.strength_factor.value;
        calibrated.c_max_ppm = scaled(rate, ratio * calibrated.c_max_ppm.value);
        calibrated.strength_factor = factor;
    }
    let corrected = corrected(stated, &calibrator, &calibrated);
    Ok(OfflineCalibration {
        scenario: corrected,
        calibrated,
        calibrator,
        rate_at_rest,
        data_quality: checked.flaws,
    })
}

/// The rate that sensors which all stand still show by the sectors of the wind ([`study::point`], [`study::network`]), as
/// `plumage flux` states it; none of others. The fit of the whole model, which has to know for each moment whether the
/// plume was there, tells the rate worse, and everything else.
fn rate_at_rest(scenario: &Scenario, observations: &Observations) -> Option<Interval> {
    let methods = [Method::Point, Method::Network];
    let fluxes = study::flux::estimate(scenario, observations, &methods).ok()?;
    fluxes.conclude()?.headline.kg_s
}

/// A quantity that is known as well as a rate.
fn scaled(rate: Interval, value: f64) -> Estimate {
    Estimate {
        value,
        sd: value * rate.sd / rate.value,
    }
}

impl OfflineCalibration {
    /// The highest concentration where set-points may go, as it was when the plume was last met; none where the fence
    /// leaves no such place.
    pub fn peak(&self, airspace: &Airspace) -> Option<Peak> {
        let (fitted, _) = self.calibrator.peak(airspace)?;
        let Some(rate) = self.rate_at_rest else {
            return Some(fitted);
        };
        let background = self.calibrated.background_ppm;
        let ratio = self.calibrated.strength_factor.value
            / self.calibrator.calibrated().strength_factor.value;
        let excess = scaled(rate, ratio * (fitted.co2_ppm - background.value).max(0.0));
        Some(Peak {
            co2_ppm: background.value + excess.value,
            sd_ppm: excess.sd.hypot(background.sd),
            ..fitted
        })
    }

    /// Lets the scenario's sensor have the noise that these readings showed, as what is known of it with the next.
    ///
    /// # Errors
    /// A base that the plume model refuses.
    pub fn learn_noise(&mut self) -> Result<(), WsError> {
        let Some(learned) = self.calibrator.learned_noise()? else {
            return Ok(());
        };
        let [white_within, slow_within, slow_time_within, ..] = learned.ln_sd.map(f64::exp);
        let mut corrected = self.scenario.clone();
        let sensor = corrected.sensor_mut();
        sensor.noise_sd_ppm = Some(learned.noise.white);
        sensor.noise_sd_ppm_known_within = Some(white_within);
        sensor.slow_sd_ppm = Some(learned.noise.slow);
        sensor.slow_sd_ppm_known_within = Some(slow_within);
        sensor.slow_time_s = Some(learned.noise.slow_s);
        sensor.slow_time_s_known_within = Some(slow_time_within);
        self.scenario = corrected.with_reality_of(&self.scenario);
        Ok(())
    }
}

fn nothing_left(observations: &Observations, flaws: &[DataQuality]) -> WsError {
    let of = |flaw: &DataQuality| format!("{}: {}", flaw.platform, flaw.message);
    WsError::NothingLeft {
        readings: observations.readings(),
        flaws: flaws.iter().map(of).collect::<Vec<_>>().join("; "),
    }
}

fn corrected(scenario: &Scenario, calibrator: &Calibrator, found: &Calibrated) -> Scenario {
    let mut corrected = scenario.clone();
    // The turn is against the wind that was logged; without a log, against the scenario's.
    let logged = calibrator.logged_from_deg();
    let from_deg = logged.unwrap_or(scenario.weather.wind_from_deg);
    let turned = wrap_deg(from_deg + calibrator.turn_deg());
    let strength = |value: Option<f64>| times(value.unwrap_or_default(), found.strength_factor);
    let source = &scenario.sources[0];
    // What only a scenario that marks it uncertain has among its unknowns.
    let own = |id, of: fn(f64, Estimate) -> Estimate, value: f64| {
        let found = calibrator.parameter(id, None);
        found.map_or(UNKNOWN, |found| of(value, found))
    };
    let axis = Estimate {
        value: turned,
        ..found.axis_deg
    };
    let (sensor, speed_m_s) = (scenario.sensor(), scenario.weather.wind_speed_m_s);
    let offset = own(MechanismId::SensorOffset, plus, sensor.offset_ppm);
    for (key, Estimate { value, sd }) in [
        (Uncertain::WindFrom, axis),
        (Uncertain::EffectiveHeight, found.effective_height_agl_m),
        (Uncertain::Emission, strength(source.mean_emission_kg_s())),
        (Uncertain::CMax, strength(source.c_max_ppm)),
        (Uncertain::Background, found.background_ppm),
        (Uncertain::SigmaYScale, found.sigma_y_scale),
        (Uncertain::SigmaZScale, found.sigma_z_scale),
        (Uncertain::SensorTimeConstant, found.time_constant_s),
        (
            Uncertain::WindSpeed,
            own(MechanismId::WindSpeedScale, times, speed_m_s),
        ),
        (Uncertain::SensorOffset, offset),
        (
            Uncertain::SensorGain,
            own(MechanismId::SensorGain, times, sensor.gain),
        ),
    ] {
        if scenario.value(key).is_some() && value.is_finite() {
            corrected.set_with_sd(key, value, sd);
        }
    }
    corrected.extend(&calibrator.beside_keys());
    corrected.with_reality_of(scenario)
}
