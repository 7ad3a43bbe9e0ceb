//! `plumage calibrate`: the scenario corrected by measured observations, off-line.

use crate::progress::Waiting;
use crate::{Failure, measured, mission_files};
use plume::{Gas, MechanismId};
use protocol::message::Peak;
use record::files;
use record::summary::with_gas;
use scenario::Scenario;
use scenario::airspace::Airspace;
use scenario::uncertain::Uncertain;
use serde_json::json;
use std::path::PathBuf;
use ws::calibration::offline;
use ws::calibration::offline::OfflineCalibration;

/// Arguments of `plumage calibrate`.
#[derive(Debug, clap::Args)]
pub struct CalibrateArguments {
    /// Observations (CSV, or MCAP recordings)
    #[arg(required = true)]
    pub observations: Vec<PathBuf>,
    /// Mapping file by which logs of other kinds are read (plumage import)
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Scenario to correct (TOML)
    #[arg(long, value_name = "FILE")]
    pub scenario: PathBuf,
    /// Gas that is read: that of the first source if not given
    #[arg(long, value_name = "GAS")]
    pub gas: Option<Gas>,
    /// Platform whose sensor the others are held against
    #[arg(long, value_name = "PLATFORM")]
    pub reference: Option<String>,
    /// Folder for scenario.toml and calibration.json
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a folder that holds something, replacing earlier outputs
    #[arg(long)]
    pub force: bool,
}

/// Corrects the scenario and writes it with its new uncertainties.
///
/// # Errors
/// Wrong input, or outputs that cannot be written.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<(), Failure> {
    let setup = mission_files::load(&arguments.scenario)?;
    let setup = mission_files::for_gas(setup, arguments.gas)?;
    let observations = measured::load_by(
        &arguments.observations,
        setup.scenario.gas(),
        arguments.map.as_deref(),
    )?;
    measured::tell(&observations.notices);
    let reference = arguments.reference.as_deref();
    if let Some(reference) = reference
        && !observations.platforms.iter().any(|p| p == reference)
    {
        let known = observations.platforms.join(", ");
        return Err(Failure::usage(format!(
            "--reference {reference}: expected one of {known}"
        )));
    }
    let waiting = Waiting::new("correcting the scenario");
    let offline = offline::calibrate_in(&setup.scenario, &setup.classes, &observations, reference)
        .map_err(Failure::input)?;
    drop(waiting);
    files::prepare_folder(&arguments.out, arguments.force).map_err(Failure::input)?;
    let write =
        |name: &str, text: &str| files::write_whole(&arguments.out.join(name), text.as_bytes());
    write("scenario.toml", &offline.scenario.to_toml())?;
    let mut document = document(&offline, &observations.platforms, reference);
    let peak = peak(&setup.scenario, &offline);
    document["peak"] = json!(peak);
    let gas = setup.scenario.gas();
    document["gas"] = json!(gas);
    write(
        "calibration.json",
        &with_gas(&format!("{:#}\n", document), gas),
    )?;
    measured::tell_flaws(&offline.data_quality);
    println!(
        "{} readings of {} platforms",
        offline.calibrator.taken(),
        observations.platforms.len()
    );
    tell_changes(&setup.scenario, &offline.scenario);
    for (k, platform) in observations.platforms.iter().enumerate() {
        if let Some(zero) = offline.calibrator.zero_ppm(k) {
            let label = format!("zero_ppm of {platform}");
            println!("{label:32} {:.4} ± {:.4}", zero.value, zero.sd);
        }
    }
    if let Some(peak) = &peak {
        let digits = gas.digits() + if peak.sd_ppm < 10.0 { 2 } else { 0 };
        println!(
            "{:32} {:.digits$} ± {:.digits$} ppm {} at {:.5}, {:.5}, {:.0} m AMSL, where vehicles may fly",
            "peak",
            peak.co2_ppm,
            peak.sd_ppm,
            gas.formula(),
            peak.lat_deg,
            peak.lon_deg,
            peak.alt_amsl_m
        );
    }
    println!(
        "Outputs in {}: scenario.toml, calibration.json",
        arguments.out.display()
    );
    Ok(())
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

/// The highest concentration where set-points may go, as it was when the plume was last met; none where the
/// fence leaves no such place.
fn peak(scenario: &Scenario, offline: &OfflineCalibration) -> Option<Peak> {
    let airspace = Airspace::of(scenario).ok()?;
    offline.calibrator.peak(&airspace)
}

/// The uncertain values before and after.
fn tell_changes(before: &Scenario, after: &Scenario) {
    for key in Uncertain::ALL {
        if let (Some(was), Some(is)) = (before.value(key), after.value(key)) {
            let sd = after
                .prior_sd(key)
                .map_or(String::new(), |sd| format!(" ± {}", figure(sd)));
            let (was, is) = (figure(was), figure(is));
            println!("{:32} {was:>10} -> {is:>10}{sd}", key.key(after.gas()));
        }
    }
}

/// Three decimals, or as many figures of what is smaller.
fn figure(value: f64) -> String {
    if value == 0.0 || value.abs() >= 0.1 {
        format!("{value:.3}")
    } else {
        format!("{value:.3e}")
    }
}
