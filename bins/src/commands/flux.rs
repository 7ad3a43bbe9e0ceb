//! `plumage flux`: the emission rate that measured observations show.

use crate::{Failure, measured, mission_files};
use plume::Gas;
use record::files;
use std::path::PathBuf;
use study::flux::{Method, SourceFlux};
use tasks::flux::Input;

/// Arguments of `plumage flux`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage flux car.csv --scenario site.toml --out out/flux")]
pub struct FluxArguments {
    /// Observations (CSV or MCAP recordings)
    #[arg(required = true)]
    pub observations: Vec<PathBuf>,
    /// Mapping file (TOML) to read logs of other formats, as from `plumage import`
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub map: Option<PathBuf>,
    /// Scenario with site, weather and source (TOML)
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub scenario: PathBuf,
    /// Gas to use from the observations: co2, ch4, n2o and so on, or one of the scenario's [[gas]] [default:
    /// that of the first source]
    #[arg(long, value_name = "GAS", help_heading = "Input")]
    pub gas: Option<Gas>,
    /// Method: point (one sensor at rest with a wind log), curtain (passes at several heights), or auto (every method
    /// whose conditions are met)
    #[arg(
        long,
        value_name = "METHOD",
        default_value = "auto",
        help_heading = "Input"
    )]
    pub method: MethodChoice,
    /// Folder for flux.json
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    pub out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    pub force: bool,
}

/// Values of `--method`.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub enum MethodChoice {
    /// Every method whose conditions are met
    Auto,
    /// Mass balance of passes at several heights
    Curtain,
    /// One sensor at rest with a wind log
    Point,
}

impl MethodChoice {
    fn methods(self) -> Vec<Method> {
        match self {
            Self::Auto => Method::ALL.to_vec(),
            Self::Curtain => vec![Method::Curtain],
            Self::Point => vec![Method::Point],
        }
    }
}

/// Estimates the rate and writes `flux.json`.
///
/// # Errors
/// Wrong input, observations that meet no method's conditions, or outputs that cannot be written.
pub fn flux(arguments: &FluxArguments) -> Result<(), Failure> {
    let setup = mission_files::load(&arguments.scenario)?;
    let setup = mission_files::for_gas(setup, arguments.gas)?;
    let mut observations = measured::load_by(
        &arguments.observations,
        setup.scenario.gas(),
        arguments.map.as_deref(),
    )?;
    let files = &arguments.observations;
    let setup = measured::weather_over(setup, &mut observations, files)?;
    measured::fill_wind(&mut observations, &setup).map_err(Failure::input)?;
    measured::tell(&observations.notices);
    let inputs: Vec<Input> = arguments
        .observations
        .iter()
        .map(|file| {
            let bytes = std::fs::read(file).map_err(Failure::input)?;
            Ok(Input {
                file: file.display().to_string(),
                bytes,
            })
        })
        .collect::<Result<_, Failure>>()?;
    let methods = arguments.method.methods();
    let report =
        tasks::flux::of(&setup, &observations, &methods, &inputs).map_err(mission_files::option)?;
    let refusals = report.fluxes.refused.iter();
    let refusals: Vec<String> = refusals
        .map(|r| format!("{:?}: {}", r.method, r.reason).to_lowercase())
        .collect();
    if report.fluxes.estimates.is_empty() {
        return Err(Failure::usage(format!(
            "no method applies to these observations: {}",
            refusals.join("; ")
        )));
    }
    files::prepare_folder(&arguments.out, arguments.force).map_err(Failure::input)?;
    files::write_whole(&arguments.out.join("flux.json"), report.json.as_bytes())?;
    for flux in &report.fluxes.estimates {
        println!("{}", line(flux));
    }
    println!("Outputs in {}: flux.json", arguments.out.display());
    Ok(())
}

/// One estimate for the terminal.
fn line(flux: &SourceFlux) -> String {
    let gas = flux.gas.formula();
    let method = format!("{:?}", flux.method).to_lowercase();
    let notes = flux.notes.iter().map(|note| format!("; {note}"));
    let notes: String = notes.collect();
    match (flux.kg_s, flux.upper_limit_kg_s) {
        (Some(rate), _) => {
            let (unit, factor) = unit_of(rate.value);
            format!(
                "{} emits {} {unit} of {gas} (95 % interval {} to {}) by {method}{notes}",
                flux.name,
                figures(rate.value * factor),
                figures(rate.low95 * factor),
                figures(rate.high95 * factor),
            )
        }
        (None, limit) => {
            let limit = limit.unwrap_or(f64::NAN);
            let (unit, factor) = unit_of(limit);
            format!(
                "{} emits less than {} {unit} of {gas} (95 %) by {method}{notes}",
                flux.name,
                figures(limit * factor)
            )
        }
    }
}

/// The unit in which a rate in kg/s reads best, and its number in 1 kg/s.
fn unit_of(kg_s: f64) -> (&'static str, f64) {
    if kg_s < 0.1 {
        ("g/s", 1e3)
    } else {
        ("kg/s", 1.0)
    }
}

/// Three significant figures.
fn figures(value: f64) -> String {
    let digits = 2 - value.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
    format!("{value:.*}", digits.max(0) as usize)
}
