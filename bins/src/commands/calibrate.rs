//! `plumage calibrate`: the scenario corrected by measured observations, off-line.

use crate::measured::ObservationInput;
use crate::progress::Waiting;
use crate::{Failure, measured, mission_files, reports};
use air::geo::wrap_signed_deg;
use formats::number::{plus_minus, significant};
use record::files;
use scenario::Scenario;
use scenario::observations::DataQuality;
use scenario::tables::SensorTable;
use scenario::uncertain::Uncertain;
use std::path::PathBuf;
use tasks::calibration::Calibration;
use views::Document;

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
    /// Folder for scenario.toml, calibration.json and report.html
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
    let report = report(&setup.scenario, &calibration, &observations.platforms);
    write("report.html", &reports::html(&report))?;
    let (gas, peak) = (setup.scenario.gas(), &calibration.peak);
    measured::tell_flaws(&offline.data_quality);
    println!(
        "{} readings of {} platforms",
        offline.calibrator.taken(),
        observations.platforms.len()
    );
    for change in Change::all(&setup.scenario, &offline.scenario) {
        println!(
            "{:32} {:>10} -> {}",
            change.key,
            significant(change.was),
            change.now()
        );
    }
    if arguments.learn_noise {
        tell_noise(offline.scenario.sensor());
    }
    for (k, platform) in observations.platforms.iter().enumerate() {
        if let Some(zero) = offline.calibrator.zero_ppm(k) {
            let label = format!("zero_ppm of {platform}");
            println!("{label:32} {}", plus_minus(zero.value, zero.sd));
        }
    }
    if let Some(peak) = peak {
        println!(
            "{:32} {} ppm {} at {:.5}, {:.5}, {:.0} m AMSL (highest within the fence)",
            "peak",
            plus_minus(peak.co2_ppm, peak.sd_ppm),
            gas.formula(),
            peak.lat_deg,
            peak.lon_deg,
            peak.alt_amsl_m
        );
    }
    println!(
        "Outputs in {}: scenario.toml, calibration.json, report.html",
        arguments.out.display()
    );
    Ok(())
}

/// An uncertain value before and after.
struct Change {
    value: Uncertain,
    key: String,
    was: f64,
    /// Its standard deviation before, where it is known.
    was_sd: Option<f64>,
    is: f64,
    sd: f64,
}

impl Change {
    fn all(before: &Scenario, after: &Scenario) -> Vec<Self> {
        let of = |key: &Uncertain| {
            Some(Self {
                value: *key,
                key: key.key(after.gas()),
                was: before.value(*key)?,
                was_sd: before.corrected_sd(*key),
                is: after.value(*key)?,
                sd: after.prior_sd(*key).unwrap_or(0.0),
            })
        };
        Uncertain::ALL.iter().filter_map(of).collect()
    }

    /// What it is now; of what no reading corrects the value alone.
    fn now(&self) -> String {
        match self.sd {
            0.0 => significant(self.is),
            sd => plus_minus(self.is, sd),
        }
    }

    /// What it is now, in standard deviations that it had before, with the interval of one standard deviation; angles the
    /// short way round.
    fn shift(&self) -> Option<[f64; 3]> {
        let was_sd = self.was_sd?;
        let off = match self.value {
            Uncertain::WindFrom => wrap_signed_deg(self.is - self.was),
            _ => self.is - self.was,
        };
        Some([off, off - self.sd, off + self.sd].map(|v| v / was_sd))
    }
}

/// The report of a calibration.
fn report(before: &Scenario, calibration: &Calibration, platforms: &[String]) -> Document {
    let offline = &calibration.offline;
    let changes = Change::all(before, &offline.scenario);
    let mut page = Document::new("Plumage calibration report", &before.mission.name);
    let shifted = |c: &&Change| c.shift().is_some_and(|[off, ..]| off.abs() > 2.0);
    let far: Vec<&str> = changes
        .iter()
        .filter(shifted)
        .map(|c| c.key.as_str())
        .collect();
    page.lead(&[
        format!(
            "{} readings of {} corrected the scenario.",
            offline.calibrator.taken(),
            match platforms {
                [one] => format!("platform {one}"),
                several => format!("the platforms {}", several.join(", ")),
            }
        ),
        match (&calibration.emission, &calibration.peak) {
            (Some(rate), _) => format!(
                "The source emits {} kg/s (95 % interval {} to {}).",
                plus_minus(rate.value, rate.sd),
                significant(rate.low95),
                significant(rate.high95)
            ),
            (None, Some(peak)) => format!(
                "The highest concentration within the fence is {} ppm {}.",
                plus_minus(peak.co2_ppm, peak.sd_ppm),
                before.gas().formula()
            ),
            (None, None) => "The corrected values are in the table below.".to_owned(),
        },
        match &far[..] {
            [] => "Every value is within two standard deviations of the scenario's.".to_owned(),
            far => format!(
                "More than two standard deviations from the scenario's value: {}. Check these before you rely on the rest.",
                far.join(", ")
            ),
        },
    ]);
    page.section("Corrected values");
    let row = |c: &Change| {
        let shift = c
            .shift()
            .map_or("–".to_owned(), |[off, ..]| format!("{off:+.1}"));
        let was = match c.was_sd {
            Some(sd) => plus_minus(c.was, sd),
            None => significant(c.was),
        };
        vec![c.key.clone(), was, c.now(), shift]
    };
    page.table(
        "Values of the scenario with one standard deviation, before and after; the last column counts in standard deviations \
         before. The new scenario.toml has those after.",
        &["key", "before", "after", "shift, sd"],
        &changes.iter().map(row).collect::<Vec<_>>(),
    );
    let shifts = changes
        .iter()
        .filter_map(|c| Some((c.key.clone(), c.shift()?)));
    page.intervals(
        "How far each value has moved, in standard deviations of the scenario; the line is one standard deviation after.",
        ("shift", "sd before"),
        &shifts.collect::<Vec<_>>(),
    );
    let zeros = platforms.iter().enumerate().filter_map(|(k, platform)| {
        let zero = offline.calibrator.zero_ppm(k)?;
        Some(vec![platform.clone(), plus_minus(zero.value, zero.sd)])
    });
    let zeros: Vec<Vec<String>> = zeros.collect();
    if !zeros.is_empty() {
        page.table(
            "What each sensor reads in clean air.",
            &["platform", "ppm"],
            &zeros,
        );
    }
    if !offline.data_quality.is_empty() {
        page.section("Left out");
        let flaw = |f: &DataQuality| {
            format!(
                "{}, {:.0} to {:.0} s: {}",
                f.platform, f.from_s, f.to_s, f.message
            )
        };
        page.list(&offline.data_quality.iter().map(flaw).collect::<Vec<_>>());
    }
    page
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
                significant(value)
            );
        }
    }
}
