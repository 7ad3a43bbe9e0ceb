//! `plumage plan`: what a mission could find, before it is flown; and plans for aircraft that others command.

mod export;

use crate::flights::fly_all;
use crate::{Failure, mission_files, preflight, reports};
use formats::number::{significant, value_and_sd};
use mission::plan::{self, Detectable, Expected, Forecast};
use plume::Gas;
use record::files;
use scenario::pattern::Pattern;
use scenario::tables::AirKind;
use std::path::PathBuf;
use views::Document;

/// Air in the realities that are flown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Air {
    /// Mean plume
    Steady,
    /// Meandering plume with puffs
    Unsteady,
}

/// Arguments of `plumage plan`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  plumage plan scenarios/as-pontes-steady.toml --out out/plan
  plumage plan scenarios/stack-survey.toml --pattern curtain --export out/curtain.plan")]
pub struct PlanArguments {
    /// Scenario to plan (TOML); its `[reality]` is ignored
    #[arg(required_unless_present = "next_flight")]
    pub scenario: Option<PathBuf>,
    /// Write a flight plan for an aircraft that Plumage does not command, and fly no mission: .plan (QGroundControl),
    /// .waypoints (ArduPilot), .kml, .csv or .kmz (DJI Pilot 2)
    #[arg(long, value_name = "FILE", help_heading = "Export")]
    pub export: Option<PathBuf>,
    /// Pattern to export, or several separated by commas: curtain, profile, spiral, transects [default: search.pattern of
    /// the scenario, else curtain]
    #[arg(
        long,
        value_name = "PATTERN",
        value_delimiter = ',',
        requires = "export",
        conflicts_with = "next_flight",
        help_heading = "Export"
    )]
    pub pattern: Vec<Pattern>,
    /// Export the next flight that a gap analysis proposes (gap.json); with a scenario, check it against the fence
    #[arg(
        long,
        value_name = "GAP_JSON",
        requires = "export",
        help_heading = "Export"
    )]
    pub next_flight: Option<PathBuf>,
    /// Datum of the exported heights [default: that of the format]
    #[arg(long, value_enum, requires = "export", help_heading = "Export")]
    pub heights: Option<export::HeightChoice>,
    /// Number of realities to draw from `[uncertain]` and fly, 1 to 1000
    #[arg(
        long,
        value_name = "N",
        default_value_t = 6,
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
    pub flights: u64,
    /// Air in these realities [default: the scenario's]
    #[arg(long, value_enum)]
    pub air: Option<Air>,
    /// Gas that the sensors measure: co2, ch4, n2o and so on, or one that the scenario defines [default:
    /// that of the first source]
    #[arg(long, value_name = "GAS")]
    pub gas: Option<Gas>,
    /// Print plan.json, not text
    #[arg(long)]
    pub json: bool,
    /// Folder for plan.json and report.html [default: write none]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long)]
    pub force: bool,
}

/// Flies the scenario in realities that may be, and tells what to expect of it.
///
/// # Errors
/// Wrong input, or a mission that cannot be flown.
pub fn plan(arguments: &PlanArguments) -> Result<(), Failure> {
    if let Some(file) = &arguments.export {
        return export::export(arguments, file);
    }
    let Some(scenario) = &arguments.scenario else {
        return Err(Failure::usage("plan: expected a scenario"));
    };
    if let Some(folder) = &arguments.out {
        files::check_folder(folder, arguments.force).map_err(Failure::input)?;
    }
    let setup = mission_files::load(scenario)?;
    let mut setup = mission_files::for_gas(setup, arguments.gas)?;
    if let Some(air) = arguments.air {
        setup.scenario.weather.air = match air {
            Air::Steady => AirKind::Steady,
            Air::Unsteady => AirKind::Unsteady,
        };
    }
    preflight::check(&setup)?;
    let flights = fly_all(arguments.flights, |number| {
        plan::fly(&setup, number).map_err(Failure::input)
    })?;
    if flights.is_empty() {
        return Err(Failure::usage(
            "no mission was flown to its end (interrupted)",
        ));
    }
    let forecast = plan::forecast(&flights);
    let json = serde_json::to_string_pretty(&forecast)? + "\n";
    if let Some(folder) = &arguments.out {
        files::prepare_folder(folder, arguments.force).map_err(Failure::input)?;
        files::write_whole(&folder.join("plan.json"), json.as_bytes())?;
        let report = reports::html(&report(&setup.scenario.mission.name, &forecast));
        files::write_whole(&folder.join("report.html"), report.as_bytes())?;
    }
    if arguments.json {
        print!("{json}");
    } else {
        tell(&forecast);
    }
    Ok(())
}

/// A standard deviation with its two digits.
fn two_digits(sd: f64) -> String {
    value_and_sd(0.0, sd)[1].clone()
}

/// A least emission in words.
fn kg_s(least: Option<f64>) -> String {
    least.map_or("none".to_owned(), |least| {
        format!("{} kg/s or more", significant(least))
    })
}

/// How the missions' peaks end.
fn endings(f: &Forecast) -> String {
    let status: Vec<String> = f
        .status
        .iter()
        .map(|(word, n)| format!("{word} in {n}"))
        .collect();
    let off = f
        .peak_off_m
        .map_or(String::new(), |m| format!("; median error {m:.0} m"));
    format!("Peak: {}{off}.", status.join(", "))
}

/// When something is known, and when all are down.
fn times(f: &Forecast) -> String {
    let known = f
        .known_s
        .map_or("never".to_owned(), |s| format!("after {s:.0} s"));
    format!(
        "The median mission first confirms or supports the peak {known}; its last vehicle lands after {:.0} s. \
         All vehicles landed in {} of {} missions.",
        f.down_s, f.all_landed, f.missions
    )
}

/// The report of a plan.
fn report(mission: &str, f: &Forecast) -> Document {
    let mut page = Document::new("Plumage plan", mission);
    page.lead(&[
        format!(
            "{} missions were simulated in realities drawn from what the scenario states as uncertain.",
            f.missions
        ),
        format!(
            "An emission of {} is detected with a probability of {:.0} %.",
            kg_s(f.least_kg_s),
            100.0 * f.chance
        ),
        format!("{} {}", endings(f), times(f)),
    ]);
    page.section("Detection");
    let band = |band: &Detectable| {
        let to = band
            .to_m
            .map_or("on".to_owned(), |to| format!("to {to:.0}"));
        vec![
            format!("{:.0} {to}", band.from_m),
            format!("{:.0} to {:.0}", band.heights_agl_m.0, band.heights_agl_m.1),
            format!("{:.0}", band.readings),
            band.least_kg_s.map_or("none".to_owned(), significant),
        ]
    };
    page.table(
        "Least emission that readings at a distance from the source detect.",
        &[
            "distance, m",
            "height AGL, m",
            "readings",
            "least emission, kg/s",
        ],
        &f.detectable.iter().map(band).collect::<Vec<_>>(),
    );
    page.section("Expected uncertainty");
    let row = |e: &Expected| {
        vec![
            e.name.clone(),
            two_digits(e.sd),
            two_digits(e.error),
            e.unit.clone(),
        ]
    };
    page.table(
        "Median of the stated standard deviation, and the error that missions had, as a standard deviation. An error far \
         above what is stated: rely on the error.",
        &["number", "stated ±", "error ±", "unit"],
        &f.expected.iter().map(row).collect::<Vec<_>>(),
    );
    page
}

fn tell(forecast: &Forecast) {
    let f = forecast;
    println!(
        "Predicted from {} missions in realities drawn from [uncertain]:",
        f.missions
    );
    println!(
        "An emission of {} is detected with a probability of {:.0} %.",
        kg_s(f.least_kg_s),
        100.0 * f.chance
    );
    for band in &f.detectable {
        let to = band
            .to_m
            .map_or("on".to_owned(), |to| format!("to {to:.0}"));
        println!(
            "  from readings {:.0} m {to} from the source, {:.0} to {:.0} m above ground: {}",
            band.from_m,
            band.heights_agl_m.0,
            band.heights_agl_m.1,
            kg_s(band.least_kg_s)
        );
    }
    println!("{}", endings(f));
    println!(
        "Expected uncertainty: median of the stated standard deviation, and the error that missions had:"
    );
    for e in &f.expected {
        println!(
            "  {:18} ± {:>6} {:4} error {:>6} {}",
            e.name,
            two_digits(e.sd),
            e.unit,
            two_digits(e.error),
            e.unit
        );
    }
    println!("{}", times(f));
}
