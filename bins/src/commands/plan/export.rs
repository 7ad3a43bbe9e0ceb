//! `plumage plan --export`: a plan for an aircraft that Plumage does not command.

use super::PlanArguments;
use crate::{Failure, mission_files};
use anyhow::Context as _;
use mission::flight_plan::{self, check};
use record::files;
use record::flight_plan::{FlightPlan, Format, Heights};
use scenario::pattern::Pattern;
use serde_json::Value;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Datum of heights on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum HeightChoice {
    /// Above the take-off point
    Takeoff,
    /// Above mean sea level
    Amsl,
}

/// Speed where no scenario states one, m/s: slow enough for sensors with a time constant of some seconds, and within the
/// range of every aircraft that stops.
const SPEED_M_S: f64 = 5.0;
/// Height above take-off of the lowest place where no scenario states the ground, m: above trees and most buildings.
const LOWEST_ABOVE_GROUND_M: f64 = 30.0;

/// Writes the plan.
///
/// # Errors
/// Wrong input, an ending that names no format, or a flight outside the fence.
pub(super) fn export(arguments: &PlanArguments, to: &Path) -> Result<(), Failure> {
    let ending = to.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let format = Format::of_ending(ending).ok_or_else(|| {
        Failure::usage(format!(
            "--export {}: expected a file that ends in .plan (QGroundControl), .waypoints (ArduPilot), .kml, .csv or .kmz \
             (DJI Pilot 2)",
            to.display()
        ))
    })?;
    if to.exists() && !arguments.force {
        return Err(Failure::usage(format!(
            "--export {}: the file exists; --force replaces it",
            to.display()
        )));
    }
    let heights = match arguments.heights {
        Some(HeightChoice::Takeoff) => Heights::TakeOff,
        Some(HeightChoice::Amsl) => Heights::Amsl,
        None => format.usual_heights(),
    };
    let plan = plan(arguments)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let made_ms = now.map_or(0, |d| d.as_millis() as u64);
    let bytes = plan
        .encode(format, heights, made_ms)
        .map_err(Failure::input)?;
    files::write_whole(to, &bytes)?;
    println!(
        "{}: {} places, {:.1} km at {:.1} m/s, at least {:.0} min; heights above {}",
        to.display(),
        plan.points.len(),
        plan.length_m() / 1e3,
        plan.speed_m_s,
        plan.least_s() / 60.0,
        match (format, heights) {
            (Format::Csv, _) => "take-off and mean sea level",
            (Format::Kml, _) | (_, Heights::Amsl) => "mean sea level",
            (_, Heights::TakeOff) => "take-off",
        }
    );
    Ok(())
}

/// The flight that is asked for, inside the scenario's fence where there is one.
fn plan(arguments: &PlanArguments) -> Result<FlightPlan, Failure> {
    let setup = arguments.scenario.as_deref().map(mission_files::load);
    let setup = setup.transpose()?;
    let plan = match (&arguments.next_flight, &setup) {
        (Some(file), setup) => {
            let places = next_flight(file)?;
            match setup {
                Some(setup) => flight_plan::of_places(setup, &places).map_err(Failure::input)?,
                None => {
                    let lowest = places.iter().map(|p| p.2).fold(f64::INFINITY, f64::min);
                    let ground_amsl_m = lowest - LOWEST_ABOVE_GROUND_M;
                    eprintln!(
                        "note: without a scenario there is no fence to check against, and the plan takes the ground to be \
                         {ground_amsl_m:.0} m AMSL, {LOWEST_ABOVE_GROUND_M:.0} m below its lowest place"
                    );
                    flight_plan::without_scenario("next flight", &places, ground_amsl_m, SPEED_M_S)
                        .ok_or_else(|| Failure::usage("the next flight has no places"))?
                }
            }
        }
        (None, Some(setup)) => {
            let stated = &setup.scenario.search.pattern;
            let patterns = match (&arguments.pattern[..], &stated[..]) {
                ([], []) => vec![Pattern::Curtain],
                ([], stated) => stated.to_vec(),
                (asked, _) => asked.to_vec(),
            };
            flight_plan::of_patterns(setup, &patterns).map_err(Failure::input)?
        }
        (None, None) => {
            return Err(Failure::usage(
                "plan: expected a scenario, or --next-flight GAP_JSON",
            ));
        }
    };
    if let Some(setup) = &setup {
        let outside = check(setup, &plan).map_err(Failure::input)?;
        if !outside.is_empty() {
            return Err(Failure::usage(format!(
                "the flight breaks the scenario's fence: {}",
                outside.join("; ")
            )));
        }
    }
    Ok(plan)
}

fn next_flight(file: &Path) -> Result<Vec<(f64, f64, f64)>, Failure> {
    let text = std::fs::read_to_string(file)
        .with_context(|| format!("--next-flight {}: cannot be read", file.display()))
        .map_err(Failure::Input)?;
    let read: Value = serde_json::from_str(&text)
        .with_context(|| format!("--next-flight {}: expected a gap.json", file.display()))
        .map_err(Failure::Input)?;
    let waypoints = read["next_flight"]["waypoints"].as_array();
    let waypoints = waypoints.filter(|places| !places.is_empty());
    let places = waypoints.ok_or_else(|| {
        Failure::usage(format!(
            "--next-flight {}: expected a gap.json with next_flight.waypoints; this analysis proposes no flight",
            file.display()
        ))
    })?;
    let place = |p: &Value| {
        let number = |key: &str| p[key].as_f64();
        Some((
            number("lat_deg")?,
            number("lon_deg")?,
            number("alt_amsl_m")?,
        ))
    };
    places.iter().map(place).collect::<Option<_>>().ok_or_else(|| {
        Failure::usage(format!(
            "--next-flight {}: expected lat_deg, lon_deg and alt_amsl_m of each of next_flight.waypoints",
            file.display()
        ))
    })
}
