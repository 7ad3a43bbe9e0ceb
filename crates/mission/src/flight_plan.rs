//! A flight plan for an aircraft that Plumage does not command: patterns, or the flight that a gap analysis asks for, with
//! the scenario's fence, and checked against it.

use crate::{MissionError, Setup};
use air::geo::{Geodetic, Position};
use record::flight_plan::{FlightPlan, PlanPoint};
use sc::patterns::{PATTERN_MARGIN_M, whole_flight};
use scenario::airspace::Airspace;
use scenario::pattern::Pattern;

/// Lowest height above take-off at which a flight begins, m.
const LEAST_TAKE_OFF_M: f64 = 15.0;

/// The flight of a scenario's first vehicle along `patterns`.
///
/// # Errors
/// A scenario without vehicles or world, or whose airspace leaves no room for the patterns.
pub fn of_patterns(setup: &Setup, patterns: &[Pattern]) -> Result<FlightPlan, MissionError> {
    let scenario = &setup.scenario;
    let mut plan = empty(setup)?;
    let frame = setup.frame()?;
    let (lat_deg, lon_deg, ground_m) = plan.home;
    let above_home = Position {
        at: frame.to_enu(Geodetic::new(lat_deg, lon_deg)),
        height_m: ground_m + plan.take_off_height_m,
    };
    for (place, purpose) in whole_flight(scenario, above_home, patterns)? {
        let at = frame.to_geodetic(place.position.at);
        plan.points.push(PlanPoint {
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            alt_amsl_m: place.position.height_m,
            stops: place.stops,
            purpose: purpose.to_owned(),
        });
    }
    if plan.points.is_empty() {
        let names: Vec<&str> = patterns.iter().map(|p| p.name()).collect();
        return Err(MissionError::Request(format!(
            "the fence leaves no room for the pattern {} with {PATTERN_MARGIN_M:.0} m of clearance; expected a larger \
             fence or a smaller fence.keep_out_radius_m",
            names.join(", ")
        )));
    }
    Ok(plan)
}

/// A flight through given places: latitude and longitude, degrees, and height above mean sea level, m.
///
/// # Errors
/// As [`of_patterns`].
pub fn of_places(setup: &Setup, places: &[(f64, f64, f64)]) -> Result<FlightPlan, MissionError> {
    let mut plan = empty(setup)?;
    plan.points = points(places);
    Ok(plan)
}

/// The same without a scenario: it takes off below its first place, from ground `ground_amsl_m` high.
pub fn without_scenario(
    name: &str,
    places: &[(f64, f64, f64)],
    ground_amsl_m: f64,
    speed_m_s: f64,
) -> Option<FlightPlan> {
    let (lat_deg, lon_deg, alt_amsl_m) = *places.first()?;
    Some(FlightPlan {
        name: name.to_owned(),
        home: (lat_deg, lon_deg, ground_amsl_m),
        take_off_height_m: (alt_amsl_m - ground_amsl_m).max(LEAST_TAKE_OFF_M),
        points: points(places),
        speed_m_s,
        multirotor: true,
        fence: Vec::new(),
        ceiling_amsl_m: None,
    })
}

fn points(places: &[(f64, f64, f64)]) -> Vec<PlanPoint> {
    let point = |&(lat_deg, lon_deg, alt_amsl_m): &(f64, f64, f64)| PlanPoint {
        lat_deg,
        lon_deg,
        alt_amsl_m,
        stops: false,
        purpose: "next flight".to_owned(),
    };
    places.iter().map(point).collect()
}

/// What of a plan, from its home and back, is outside the scenario's fence or height band, or inside a keep-out: one
/// sentence each.
///
/// # Errors
/// A scenario that describes no airspace.
pub fn check(setup: &Setup, plan: &FlightPlan) -> Result<Vec<String>, MissionError> {
    let airspace = Airspace::of(&setup.scenario)?.over(&setup.terrain);
    let frame = setup.frame()?;
    let mut found = Vec::new();
    let home = frame.to_enu(Geodetic::new(plan.home.0, plan.home.1));
    let mut before = home;
    for (k, point) in plan.points.iter().enumerate() {
        let at = frame.to_enu(Geodetic::new(point.lat_deg, point.lon_deg));
        let number = k + 1;
        let clearance_m = airspace.clearance_m(at);
        let (floor_m, ceiling_m) = airspace.heights_at_amsl_m(at);
        if clearance_m < 0.0 {
            found.push(format!(
                "place {number} is {:.0} m outside the fence or inside a keep-out",
                -clearance_m
            ));
        } else if !airspace.leg_is_clear(before, at, 0.0) {
            found.push(format!(
                "the way to place {number} leaves the fence or enters a keep-out"
            ));
        }
        // Half a metre is rounding.
        if !(floor_m - 0.5..=ceiling_m + 0.5).contains(&point.alt_amsl_m) {
            found.push(format!(
                "place {number} is at {:.0} m AMSL; expected {floor_m:.0} to {ceiling_m:.0} m",
                point.alt_amsl_m
            ));
        }
        before = at;
    }
    if found.is_empty() && !airspace.leg_is_clear(before, home, 0.0) {
        found.push("the way home leaves the fence or enters a keep-out".to_owned());
    }
    Ok(found)
}

/// The plan of the first vehicle, without places.
fn empty(setup: &Setup) -> Result<FlightPlan, MissionError> {
    let scenario = &setup.scenario;
    let home = scenario.home(0)?;
    let ground_amsl_m = setup.ground_at_home_m(0)?;
    let airframe = setup.aircraft_of(0)?;
    let speeds = airframe.speeds();
    let frame = setup.frame()?;
    let (_, ceiling_m) = Airspace::of(scenario)?
        .over(&setup.terrain)
        .height_band_amsl_m();
    let floor_m = scenario.site.ground_amsl_m + scenario.fence.floor_agl_m - ground_amsl_m;
    Ok(FlightPlan {
        name: scenario.mission.name.clone(),
        home: (home.lat_deg, home.lon_deg, ground_amsl_m),
        take_off_height_m: floor_m.max(LEAST_TAKE_OFF_M),
        points: Vec::new(),
        speed_m_s: scenario
            .search
            .airspeed_m_s
            .clamp(speeds.min_m_s, speeds.max_m_s),
        multirotor: airframe.hovers(),
        fence: scenario
            .fence_polygon()?
            .into_iter()
            .map(|corner| {
                let at = frame.to_geodetic(corner);
                (at.lat_deg, at.lon_deg)
            })
            .collect(),
        ceiling_amsl_m: Some(ceiling_m),
    })
}
