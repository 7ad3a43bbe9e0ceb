//! A scenario corrected by readings.

use crate::TaskError;
use mission::Setup;
use plume::MechanismId;
use protocol::message::Peak;
use record::summary::with_gas;
use scenario::Scenario;
use scenario::airspace::Airspace;
use scenario::observations::Observations;
use serde_json::json;
use study::Interval;
use ws::calibration::offline::{self, OfflineCalibration};

/// A scenario corrected by readings.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The scenario, and what was found.
    pub offline: OfflineCalibration,
    /// The highest concentration where set-points may go, as it was when the plume was last met; none where the
    /// fence leaves no such place.
    pub peak: Option<Peak>,
    /// The rate of the source, kg/s, where readings tell it.
    pub emission: Option<Interval>,
    /// The text of `calibration.json`.
    pub json: String,
}

/// Corrects the scenario of `setup` by `observations`; with a `reference` platform the sensors of the others are held
/// against its own.
///
/// # Errors
/// A reference that is no platform, a scenario that describes no world, or observations of which nothing is left.
pub fn of(
    setup: &Setup,
    observations: &Observations,
    reference: Option<&str>,
) -> Result<Calibration, TaskError> {
    let platforms = &observations.platforms;
    if let Some(reference) = reference
        && !platforms.iter().any(|p| p == reference)
    {
        let known = platforms.join(", ");
        return Err(TaskError::Argument(format!(
            "reference {reference}: expected one of {known}"
        )));
    }
    let (scenario, classes) = (&setup.scenario, &setup.classes);
    let offline = offline::calibrate_in(scenario, classes, observations, reference)?;
    let (gas, peak) = (scenario.gas(), peak(scenario, &offline));
    let mut document = document(&offline, platforms, reference);
    document["peak"] = json!(peak);
    document["gas"] = json!(gas);
    let by_fit = || crate::flux::emission(setup, observations, &offline);
    let emission = offline.rate_at_rest.or_else(by_fit);
    document["emission"] = json!(emission.map(|kg_s| json!({"kg_s": kg_s})));
    Ok(Calibration {
        json: with_gas(&format!("{document:#}\n"), gas),
        offline,
        peak,
        emission,
    })
}

/// `calibration.json`: what was found of the plume and of every sensor.
fn document(
    offline: &OfflineCalibration,
    platforms: &[String],
    reference: Option<&str>,
) -> serde_json::Value {
    let found = &offline.calibrated;
    let sensors: Vec<serde_json::Value> = platforms
        .iter()
        .enumerate()
        .filter_map(|(k, platform)| {
            let of = |id| offline.calibrator.parameter(id, Some(k));
            Some(json!({
                "platform": platform,
                "offset_ppm": of(MechanismId::SensorOffset)?,
                "gain": of(MechanismId::SensorGain),
                "zero_ppm": offline.calibrator.zero_ppm(k),
            }))
        })
        .collect();
    json!({
        "schema": "plumage.calibration/1",
        "readings": offline.calibrator.taken(),
        "background_ppm": found.background_ppm,
        "effective_height_agl_m": found.effective_height_agl_m,
        "axis_deg": found.axis_deg,
        "c_max_ppm": found.c_max_ppm,
        "c_max_distance_m": found.c_max_distance_m,
        "sigma_y_scale": found.sigma_y_scale,
        "sigma_z_scale": found.sigma_z_scale,
        "sensor_time_constant_s": found.time_constant_s,
        "strength_factor": found.strength_factor,
        "reference": reference,
        "sensors": sensors,
        "data_quality": offline.data_quality,
    })
}

fn peak(scenario: &Scenario, offline: &OfflineCalibration) -> Option<Peak> {
    let airspace = Airspace::of(scenario).ok()?;
    offline.peak(&airspace)
}
