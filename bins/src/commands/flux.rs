//! `plumage flux`: the emission rate that measured observations show.

use crate::progress::Waiting;
use crate::{Failure, measured, mission_files, reports};
use mission::Setup;
use plume::Gas;
use record::files;
use scenario::observations::{Observations, checks};
use std::path::{Path, PathBuf};
use study::flux::Method;
use tasks::flux::{FluxReport, Input, Sheet, Tracer};
use views::Document;
use views::flux_report::{self, FluxPage};

/// Arguments of `plumage flux`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Example: plumage flux car.csv --scenario site.toml --out out/flux"
)]
pub struct FluxArguments {
    #[command(subcommand)]
    command: Option<FluxCommand>,
    #[command(flatten)]
    estimate: Option<EstimateArguments>,
}

/// What else `plumage flux` does.
#[derive(Debug, clap::Subcommand)]
enum FluxCommand {
    /// Combine the rates of several visits into the mean of a site
    Combine(CombineArguments),
}

/// Arguments of `plumage flux combine`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage flux combine may/flux.json june/flux.json --out out/site")]
struct CombineArguments {
    /// Files flux.json of the visits
    #[arg(required = true)]
    visits: Vec<PathBuf>,
    /// Folder for flux.json and report.html
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    force: bool,
}

/// Arguments of an estimate.
#[derive(Debug, clap::Args)]
struct EstimateArguments {
    /// Observations (CSV or MCAP recordings)
    #[arg(required = true)]
    observations: Vec<PathBuf>,
    /// Mapping file (TOML) to read logs of other formats, as from `plumage import`
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    map: Option<PathBuf>,
    /// Scenario with site, weather and source (TOML)
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    scenario: PathBuf,
    /// Gas to use from the observations: co2, ch4, n2o and so on, or one that the scenario defines [default:
    /// that of the first source]
    #[arg(long, value_name = "GAS", help_heading = "Input")]
    gas: Option<Gas>,
    /// How to estimate the rate
    #[arg(
        long,
        value_name = "METHOD",
        default_value = "auto",
        help_heading = "Method"
    )]
    method: MethodChoice,
    /// Gas that is released beside the source at a known rate, kg/s, and read beside the other: the ratio of both gives
    /// another estimate
    #[arg(long, value_name = "NAME=KG_S", help_heading = "Method", value_parser = tracer_of)]
    tracer: Option<(Gas, f64)>,
    /// Sheet (TOML) with names and numbers that the report states
    #[arg(long, value_name = "FILE", help_heading = "Report")]
    sheet: Option<PathBuf>,
    /// Folder for flux.json and report.html
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    force: bool,
}

/// Values of `--method`.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum MethodChoice {
    /// Every method whose conditions are met, combined if they agree
    Auto,
    /// Mass balance of passes at three heights or more
    Curtain,
    /// One sensor at rest with a wind log
    Point,
    /// Several sensors at rest with a wind log
    Network,
    /// Passes across the plume by its σz, or the fit of the whole model
    Inversion,
}

impl MethodChoice {
    fn methods(self) -> Vec<Method> {
        match self {
            Self::Auto => Method::ALL.to_vec(),
            Self::Curtain => vec![Method::Curtain],
            Self::Point => vec![Method::Point],
            Self::Network => vec![Method::Network],
            Self::Inversion => vec![Method::Inversion],
        }
    }
}

fn tracer_of(text: &str) -> Result<(Gas, f64), String> {
    let expected = "expected a gas and its rate in kg/s, such as C2H2=0.8e-3";
    let (name, rate) = text.split_once('=').ok_or(expected)?;
    let gas = Gas::from_name(name).ok_or_else(|| format!("{name}: {expected}"))?;
    let kg_s: f64 = rate.trim().parse().map_err(|_| expected)?;
    if kg_s > 0.0 && kg_s.is_finite() {
        Ok((gas, kg_s))
    } else {
        Err(expected.to_owned())
    }
}

/// Estimates the rate and writes `flux.json` and `report.html`, or combines visits.
///
/// # Errors
/// Wrong input, observations that meet no method's conditions, or outputs that cannot be written.
pub fn flux(arguments: &FluxArguments) -> Result<(), Failure> {
    match (&arguments.command, &arguments.estimate) {
        (Some(FluxCommand::Combine(combined)), _) => combine(combined),
        (None, Some(estimated)) => estimate(estimated),
        (None, None) => Err(Failure::usage("expected observations and --scenario")),
    }
}

fn estimate(arguments: &EstimateArguments) -> Result<(), Failure> {
    let setup = mission_files::load(&arguments.scenario)?;
    let setup = mission_files::for_gas(setup, arguments.gas)?;
    let map = arguments.map.as_deref();
    let load = |gas| measured::load_by(&arguments.observations, gas, map);
    let prepared = |setup: mission::Setup, gas| {
        let mut observations = load(gas)?;
        let setup = measured::weather_over(setup, &mut observations, &arguments.observations)?;
        Ok::<_, Failure>((setup, observations))
    };
    // The tracer's readings are at the times of the gas's or tell so.
    let tracer = arguments
        .tracer
        .map(|(gas, kg_s)| {
            let (_, observations) = prepared(setup.clone(), gas)?;
            Ok::<_, Failure>(Tracer { observations, kg_s })
        })
        .transpose()?;
    let gas = setup.scenario.gas();
    let (setup, mut observations) = prepared(setup, gas)?;
    measured::fill_wind(&mut observations, &setup).map_err(Failure::input)?;
    measured::tell(&observations.notices);
    let sheet = match &arguments.sheet {
        Some(file) => {
            let text = measured::read(file, "sheet")?;
            Sheet::parse(&file.display().to_string(), &text).map_err(Failure::input)?
        }
        None => Sheet::default(),
    };
    let inputs: Vec<Input> = arguments
        .observations
        .iter()
        .map(|file| {
            let bytes = std::fs::read(file).map_err(Failure::input)?;
            Ok(Input::new(file.display().to_string(), &bytes))
        })
        .collect::<Result<_, Failure>>()?;
    let methods = arguments.method.methods();
    let waiting = Waiting::new("estimating the rate");
    let report = tasks::flux::of(&setup, &observations, &methods, tracer.as_ref(), inputs)
        .map_err(mission_files::option)?;
    drop(waiting);
    let Some(conclusion) = &report.conclusion else {
        let refusals: Vec<String> = report
            .refused
            .iter()
            .map(|r| format!("{}: {}", r.method.name(), r.reason))
            .collect();
        return Err(Failure::usage(format!(
            "no method applies to these observations: {}",
            refusals.join("; ")
        )));
    };
    let page = reports::html(&page(&setup, &observations, &report, &sheet)?);
    write(
        &arguments.out,
        arguments.force,
        &[("flux.json", &report.json), ("report.html", &page)],
    )?;
    let headline = &conclusion.headline;
    println!("{}", flux_report::sentence(headline));
    for note in &headline.notes {
        println!("  {note}");
    }
    for other in &conclusion.alternatives {
        println!("  {}", flux_report::sentence(other));
    }
    println!(
        "Outputs in {}: flux.json, report.html",
        arguments.out.display()
    );
    Ok(())
}

fn page(
    setup: &Setup,
    observations: &Observations,
    report: &FluxReport,
    sheet: &Sheet,
) -> Result<Document, Failure> {
    let spec = setup.scenario.dispersion_spec().map_err(Failure::input)?;
    let frame = setup.scenario.frame().map_err(Failure::input)?;
    let checked = checks::check(observations, &spec, &frame);
    let flaw = |flaw: &scenario::observations::DataQuality| {
        format!(
            "{}, {:.0} to {:.0} s: {}",
            flaw.platform, flaw.from_s, flaw.to_s, flaw.message
        )
    };
    let winds = checked
        .observations
        .rows
        .iter()
        .filter_map(|row| Some((row.wind_speed_m_s?, row.wind_from_deg?)));
    Ok(flux_report::page(&FluxPage {
        conclusion: report.conclusion.as_ref(),
        refused: &report.refused,
        fields: sheet
            .fields()
            .iter()
            .map(|(label, text)| ((*label).to_owned(), (*text).to_owned()))
            .collect(),
        inputs: report
            .inputs
            .iter()
            .map(|i| (i.file.clone(), i.sha256.clone(), i.rows))
            .collect(),
        left_out: checked.flaws.iter().map(flaw).collect(),
        winds: winds.collect(),
    }))
}

fn write(out: &Path, force: bool, outputs: &[(&str, &str)]) -> Result<(), Failure> {
    files::prepare_folder(out, force).map_err(Failure::input)?;
    for (name, text) in outputs {
        files::write_whole(&out.join(name), text.as_bytes())?;
    }
    Ok(())
}

fn combine(arguments: &CombineArguments) -> Result<(), Failure> {
    let visits: Vec<(String, String)> = arguments
        .visits
        .iter()
        .map(|file| {
            Ok((
                file.display().to_string(),
                measured::read(file, "flux.json")?,
            ))
        })
        .collect::<Result<_, Failure>>()?;
    let combined = tasks::flux::combine(&visits).map_err(Failure::input)?;
    let page = reports::html(&flux_report::combined(&combined.sources));
    write(
        &arguments.out,
        arguments.force,
        &[("flux.json", &combined.json), ("report.html", &page)],
    )?;
    for source in &combined.sources {
        println!("{}", flux_report::mean_sentence(source));
        for note in &source.notes {
            println!("  {note}");
        }
    }
    println!(
        "Outputs in {}: flux.json, report.html",
        arguments.out.display()
    );
    Ok(())
}
