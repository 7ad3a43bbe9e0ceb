//! `plumage calibrate`: the scenario corrected by measured observations, off-line.

use crate::measured::ObservationInput;
use crate::progress::Waiting;
use crate::{Failure, measured, mission_files};
use record::files;
use scenario::Scenario;
use scenario::tables::SensorTable;
use scenario::uncertain::Uncertain;
use std::path::PathBuf;

/// Arguments of `plumage calibrate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage calibrate obs.csv --scenario scenarios/as-pontes.toml --out out/calibrated"
)]
pub struct CalibrateArguments {
    /// Observations and their scenario
    #[command(flatten)]
    pub input: ObservationInput,
    /// Platform whose sensor is the reference for the others
    #[arg(long, value_name = "PLATFORM", help_heading = "Input")]
    pub reference: Option<String>,
    /// Also write the noise of the sensor into scenario.toml, with how well it is now known
    #[arg(long, help_heading = "Outputs")]
    pub learn_noise: bool,
    /// Folder for scenario.toml and calibration.json
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    pub out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    pub force: bool,
}

/// Corrects the scenario and writes it with its new uncertainties.
///
/// # Errors
/// Wrong input, or outputs that cannot be written.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<(), Failure> {
    let (setup, mut observations) = arguments.input.load()?;
    measured::fill_wind(&mut observations, &setup).map_err(Failure::input)?;
    measured::tell(&observations.notices);
    let reference = arguments.reference.as_deref();
    let waiting = Waiting::new("calibrating the scenario");
    let mut calibration =
        tasks::calibration::of(&setup, &observations, reference).map_err(mission_files::option)?;
    drop(waiting);
    if arguments.learn_noise {
        let learned = calibration.offline.learn_noise();
        learned.map_err(|e| mission_files::option(e.into()))?;
    }
    let offline = &calibration.offline;
    files::prepare_folder(&arguments.out, arguments.force).map_err(Failure::input)?;
    let write =
        |name: &str, text: &str| files::write_whole(&arguments.out.join(name), text.as_bytes());
    write("scenario.toml", &offline.scenario.to_toml())?;
    write("calibration.json", &calibration.json)?;
    let (gas, peak) = (setup.scenario.gas(), &calibration.peak);
    measured::tell_flaws(&offline.data_quality);
    println!(
        "{} readings of {} platforms",
        offline.calibrator.taken(),
        observations.platforms.len()
    );
    tell_changes(&setup.scenario, &offline.scenario);
    if arguments.learn_noise {
        tell_noise(offline.scenario.sensor());
    }
    for (k, platform) in observations.platforms.iter().enumerate() {
        if let Some(zero) = offline.calibrator.zero_ppm(k) {
            let label = format!("zero_ppm of {platform}");
            println!("{label:32} {:.4} ± {:.4}", zero.value, zero.sd);
        }
    }
    if let Some(peak) = peak {
        let digits = gas.digits() + if peak.sd_ppm < 10.0 { 2 } else { 0 };
        println!(
            "{:32} {:.digits$} ± {:.digits$} ppm {} at {:.5}, {:.5}, {:.0} m AMSL (highest within the fence)",
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

/// What was learned of a sensor's noise.
fn tell_noise(sensor: &SensorTable) {
    for (key, value, within) in [
        (
            "noise_sd_ppm",
            sensor.noise_sd_ppm,
            sensor.noise_sd_ppm_known_within,
        ),
        (
            "slow_sd_ppm",
            sensor.slow_sd_ppm,
            sensor.slow_sd_ppm_known_within,
        ),
        (
            "slow_time_s",
            sensor.slow_time_s,
            sensor.slow_time_s_known_within,
        ),
    ] {
        if let (Some(value), Some(within)) = (value, within) {
            let label = format!("sensor.{key}");
            println!(
                "{label:32} {} within a factor of {within:.2}",
                figure(value)
            );
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
