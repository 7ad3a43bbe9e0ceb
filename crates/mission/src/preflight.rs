//! The check before take-off: what of a mission cannot be flown, and what is doubtful, in words
//! with numbers. It looks at what the team believes; what a stand-in's reality is like, nobody on
//! the ground knows.

use crate::setup::{NEAR_HOME_M, highest_near_home_m};
use crate::{MissionError, Setup};
use air::geo::{Enu, Geodetic, Position};
use fdm::Airframe;
use fdm::dynamics::Dynamics;
use plume::DispersionModel;
use sc::SquadronController;
use sc::controller::LEAST_OVER_GROUND_M_S;
use sc::fleet::{MARGIN_M, ORBIT_M};
use scenario::Scenario;
use scenario::airspace::Airspace;
use scenario::bounds::Bounds;
use scenario::tables::VehicleTable;
use scenario::uncertain::Uncertain;
use scenario::world::WorldError;

/// A wind above this part of the airspeed is doubtful: gusts of the tenth part of it, three times
/// their standard deviation (MIL-F-8785C), then reach the airspeed less the least speed over ground.
const DOUBTFUL_WIND: f64 = 0.6;
/// Time between two looks at a wind series, s.
const WIND_STEP_S: f64 = 10.0;
/// Share of the battery at which the Guardian takes a vehicle home (`va`).
const BATTERY_LOW: f64 = 0.2;
/// Shortest flight that is one: up to a layer and down again, s.
const LEAST_FLIGHT_S: f64 = 300.0;
/// A vehicle this far from its home is in the fence or breaks it (`va`), m.
const HOME_M: f64 = 500.0;
/// Two vehicles on the ground are apart by this, m: each may touch down half of it off its home,
/// where the approach is given up (`fdm`).
const HOMES_APART_M: f64 = 30.0;
/// The same of multirotors, which land within 1.5 m of their home (`fdm`), m.
const HOVERING_HOMES_APART_M: f64 = 6.0;
/// Heights of SRTM are right to this in nine of ten cases, m (Farr et al. 2007, the mission's goal).
const TERRAIN_M: f64 = 16.0;
/// Ground near a home may be this much higher, m: half the height of the circle beside an approach (`fdm`).
const SLOPE_M: f64 = 20.0;
/// Height over the ground that the Guardian keeps (`va`), m.
const OVER_GROUND_M: f64 = 100.0;
/// Step of looking at the ground and at the room inside the fence, m: SRTM has a post every 90 m.
const GRID_M: f64 = 100.0;
/// A fence is looked at by no more than this many steps a side.
const GRID_STEPS: usize = 200;

/// Farthest source from the fence, m: the curves of the plume's spread were fitted up to 10 km (Briggs 1973), and five
/// times that far no plume is left. A source beyond has a digit or a sign too many.
const FARTHEST_SOURCE_M: f64 = 50_000.0;

/// A plume is out of reach where the ceiling lies so many standard deviations of the axis' height below it. It cannot be
/// read where the ceiling lies so many below it of that height and of the plume's own where it leaves the fence.
const OUT_OF_REACH_SD: f64 = 4.0;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The mission must not start.
    Refused,
    /// Allowed if the operator agrees.
    Warned,
}

/// Something that was found before take-off.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// How bad it is.
    pub verdict: Verdict,
    /// What it is about, such as `wind`.
    pub about: &'static str,
    /// What, where, and what would be right.
    pub words: String,
}

fn refused(about: &'static str, words: String) -> Finding {
    let verdict = Verdict::Refused;
    Finding {
        verdict,
        about,
        words,
    }
}

fn warned(about: &'static str, words: String) -> Finding {
    let verdict = Verdict::Warned;
    Finding {
        verdict,
        about,
        words,
    }
}

/// Everything that speaks against taking off.
///
/// # Errors
/// A scenario that describes no world.
pub fn check(setup: &Setup) -> Result<Vec<Finding>, MissionError> {
    let airspace = Airspace::of(&setup.scenario)?.over(&setup.terrain);
    let mut found = Vec::new();
    for (name, aircraft) in &setup.aircraft {
        found.extend(endurance(setup, name, aircraft)?);
    }
    found.extend(wind(setup)?);
    found.extend(homes(setup, &airspace)?);
    found.extend(starts_in_flight(setup, &airspace)?);
    found.extend(sources(&setup.scenario, &airspace)?);
    found.extend(ground(setup, &airspace)?);
    found.extend(pressure(&setup.scenario)?);
    found.extend(room(&setup.scenario, &airspace));
    found.extend(time(&setup.scenario)?);
    Ok(found)
}

/// Least height of a plume, as a part of its stack's. Downwash behind the tip lowers a plume by at most three diameters (Briggs
/// 1973, ATDL-79), and a stack is ten diameters high or more.
const LEAST_OF_STACK: f64 = 0.7;

/// Whether the sources are near the fence, and their plumes between their stacks and its ceiling.
fn sources(scenario: &Scenario, airspace: &Airspace) -> Result<Vec<Finding>, MissionError> {
    let mut found = Vec::new();
    let world = DispersionModel::new(scenario.dispersion_spec()?).map_err(WorldError::from)?;
    let height_sd_m = scenario.corrected_sd(Uncertain::EffectiveHeight);
    let ceiling_m = airspace.height_band_amsl_m().1 - scenario.site.ground_amsl_m;
    for source in &scenario.sources {
        let at = airspace
            .frame()
            .to_enu(Geodetic::new(source.lat_deg, source.lon_deg));
        let outside_m = -air::area::clearance_m(airspace.polygon(), at);
        let axis_m = source.axis_height_agl_m();
        let height_sd_m = height_sd_m.unwrap_or(0.0);
        let corners = airspace
            .polygon()
            .iter()
            .map(|corner| corner.distance_m(at));
        let plume_m = world.sigmas_m(corners.fold(0.0, f64::max)).1;
        let above_m = (axis_m - ceiling_m) / OUT_OF_REACH_SD;
        if outside_m <= FARTHEST_SOURCE_M && above_m > height_sd_m {
            let words = format!(
                "the plume of {} is {axis_m:.0} m above ground, and vehicles fly up to {ceiling_m:.0} m. Check digits and \
                 unit of source.effective_height_m and the ceiling of the fence",
                source.name
            );
            let is_unreadable = above_m > height_sd_m.hypot(plume_m);
            let verdict = if is_unreadable { refused } else { warned };
            found.push(verdict("source", words));
        }
        if axis_m < LEAST_OF_STACK * source.stack_height_m {
            let words = format!(
                "the plume of {} is {axis_m:.0} m above ground, and its stack {:.0} m high. Check digits and unit of \
                 source.effective_height_m, which counts from the ground and includes the stack",
                source.name, source.stack_height_m
            );
            found.push(refused("source", words));
        }
        if outside_m <= FARTHEST_SOURCE_M {
            continue;
        }
        let words = format!(
            "the source {} at {}, {} is {:.0} km from the fence; expected at most {:.0} km, since no plume reaches farther. \
             Check the digits and signs of source.lat_deg, source.lon_deg, site and fence.polygon",
            source.name,
            source.lat_deg,
            source.lon_deg,
            outside_m / 1e3,
            FARTHEST_SOURCE_M / 1e3
        );
        found.push(refused("source", words));
    }
    Ok(found)
}

/// Air pressure at sea level that has been measured on Earth, hPa: 870 in a typhoon of 1979, 1084 in Siberia in 1968 (World
/// Meteorological Organization, archive of extremes), and some for the way from the ground to sea level.
const SEA_LEVEL_HPA: [f64; 2] = [850.0, 1100.0];

/// Whether the air pressure fits the height of the ground.
fn pressure(scenario: &Scenario) -> Result<Option<Finding>, MissionError> {
    let ground_m = scenario.site.ground_amsl_m;
    let sea_level_hpa = scenario.atmosphere()?.at(0.0).pressure_pa / 100.0;
    let [low, high] = SEA_LEVEL_HPA;
    if (low..=high).contains(&sea_level_hpa) {
        return Ok(None);
    }
    Ok(Some(refused(
        "pressure",
        format!(
            "weather.pressure_hpa at site.ground_amsl_m = {ground_m} would be {sea_level_hpa:.0} hPa at sea level; expected \
             {low:.0} to {high:.0}. Check the digits of both"
        ),
    )))
}

/// Whether there is time for all to rise, work and land; those that start in flight do not rise.
fn time(scenario: &Scenario) -> Result<Option<Finding>, MissionError> {
    if !scenario.search.pattern.is_empty() {
        return Ok(None);
    }
    let in_flight: Vec<bool> = scenario
        .vehicles
        .iter()
        .map(|v| v.airborne.is_some())
        .collect();
    let (fits, needed_s) = SquadronController::new(scenario)?.time_for_team(&in_flight);
    let (team, duration_s) = (scenario.vehicles.len(), scenario.mission.duration_s);
    let words = |what: &str| {
        format!(
            "mission.duration_s = {duration_s}: {what}; expected {needed_s:.0} s or more for all {team}"
        )
    };
    Ok(match fits {
        0 => Some(warned(
            "time",
            words(
                "too short for a vehicle to take off, work and land; the mission would end with vehicles in the \
                 air",
            ),
        )),
        fits if fits < team => Some(warned(
            "time",
            words(&format!(
                "leaves time for about {fits} vehicles to take off, work and land; others may stay on the ground"
            )),
        )),
        _ => None,
    })
}

/// Whether an aircraft can fly at the team's airspeed, and how long its battery lasts.
fn endurance(
    setup: &Setup,
    name: &str,
    aircraft: &Airframe,
) -> Result<Option<Finding>, MissionError> {
    let scenario = &setup.scenario;
    let (airspeed_m_s, speeds) = (scenario.search.airspeed_m_s, aircraft.speeds());
    let (slowest_m_s, fastest_m_s) = (speeds.min_m_s, speeds.max_m_s);
    // A multirotor flies no faster than it can, whatever the team's airspeed.
    let flies_slower = aircraft.hovers() && airspeed_m_s > fastest_m_s;
    if !flies_slower && !(slowest_m_s..=fastest_m_s).contains(&airspeed_m_s) {
        return Ok(Some(refused(
            "airspeed",
            format!(
                "search.airspeed_m_s = {airspeed_m_s} is outside the range of {name}; expected {slowest_m_s} to \
                 {fastest_m_s} m/s"
            ),
        )));
    }
    let ground_amsl_m = scenario.site.ground_amsl_m;
    let middle_amsl_m =
        ground_amsl_m + 0.5 * (scenario.fence.floor_agl_m + scenario.fence.ceiling_agl_m);
    let density_kg_m3 = scenario.atmosphere()?.at(middle_amsl_m).density_kg_m3();
    let power_w = match level_power_w(setup, aircraft, density_kg_m3)? {
        Ok(power_w) => power_w,
        Err(why) => return Ok(Some(refused("airspeed", format!("{name}: {why}")))),
    };
    let Some(battery) = aircraft.battery() else {
        return Ok(None);
    };
    let lasts_s = (1.0 - BATTERY_LOW) * battery.capacity_wh * 3600.0 / power_w;
    let words = |then: &str| {
        format!(
            "the battery of {name} ({:.0} Wh) lasts for {lasts_s:.0} s of level flight at \
             {airspeed_m_s} m/s ({power_w:.0} W) down to {:.0} %, at which the Guardian brings a \
             vehicle home; {then}",
            battery.capacity_wh,
            100.0 * BATTERY_LOW
        )
    };
    let duration_s = scenario.mission.duration_s;
    Ok(if lasts_s < LEAST_FLIGHT_S {
        let then = format!(
            "climb and descent alone take {LEAST_FLIGHT_S:.0} s; expected a larger battery"
        );
        Some(refused("battery", words(&then)))
    } else if lasts_s < duration_s {
        let then = format!(
            "expected a larger battery, or mission.duration_s of at most {lasts_s:.0}, not {duration_s}"
        );
        Some(warned("battery", words(&then)))
    } else {
        None
    })
}

/// Electrical power of level flight, W, or why there is none: of a fixed wing at the team's airspeed, of a multirotor at its
/// speed over ground against the wind at the ceiling.
fn level_power_w(
    setup: &Setup,
    aircraft: &Airframe,
    density_kg_m3: f64,
) -> Result<Result<f64, String>, MissionError> {
    let speed_m_s = setup.scenario.search.airspeed_m_s;
    Ok(match aircraft {
        Airframe::FixedWing(aircraft) => {
            let trim = fdm::trim::level(&Dynamics::new(aircraft), speed_m_s, density_kg_m3);
            trim.map_err(|e| e.to_string()).map(|trim| {
                aircraft.battery.map_or(0.0, |battery| {
                    battery.power_w(
                        &aircraft.propulsion,
                        speed_m_s,
                        trim.throttle,
                        density_kg_m3,
                    )
                })
            })
        }
        Airframe::Multirotor(aircraft) => {
            let over_ground_m_s = speed_m_s.min(aircraft.limits.speed_max_m_s);
            let airspeed_m_s = over_ground_m_s + strongest_wind_m_s(setup)?.1;
            let most_m_s = aircraft.limits.airspeed_max_m_s;
            let power_w = aircraft
                .level_power_w(airspeed_m_s, density_kg_m3)
                .filter(|_| airspeed_m_s <= most_m_s);
            match (power_w, aircraft.battery) {
                (_, None) if airspeed_m_s <= most_m_s => Ok(0.0),
                (Some(power_w), _) => Ok(power_w),
                _ => Err(format!(
                    "speed and wind together are {airspeed_m_s:.1} m/s; expected at most {most_m_s} m/s"
                )),
            }
        }
    })
}

/// The strongest wind of a mission at the fence's floor and at its ceiling, m/s.
pub(crate) fn strongest_wind_m_s(setup: &Setup) -> Result<(f64, f64), MissionError> {
    let scenario = &setup.scenario;
    let profile = scenario.wind_profile()?;
    let steps = (scenario.mission.duration_s / WIND_STEP_S) as usize;
    let reference_m_s = setup.wind_series.as_ref().map_or_else(
        || profile.reference_speed_m_s(),
        |series| {
            let at = |k: usize| series.at(k as f64 * WIND_STEP_S).speed_m_s();
            (0..=steps).map(at).fold(0.0, f64::max)
        },
    );
    let at_height_m_s = |agl_m: f64| {
        let calm = profile.reference_speed_m_s() == 0.0;
        let ratio = if calm {
            1.0
        } else {
            profile.speed_at_m_s(agl_m) / profile.reference_speed_m_s()
        };
        reference_m_s * ratio
    };
    let fence = &scenario.fence;
    Ok((
        at_height_m_s(fence.floor_agl_m),
        at_height_m_s(fence.ceiling_agl_m),
    ))
}

/// Whether the team makes way against the wind.
fn wind(setup: &Setup) -> Result<Option<Finding>, MissionError> {
    let scenario = &setup.scenario;
    let (low_m, high_m) = (scenario.fence.floor_agl_m, scenario.fence.ceiling_agl_m);
    let (low_m_s, high_m_s) = strongest_wind_m_s(setup)?;
    // A fixed wing flies at the team's airspeed, a multirotor at any up to its highest.
    let airspeed = |airframe: &Airframe| match airframe {
        Airframe::FixedWing(_) => scenario.search.airspeed_m_s,
        Airframe::Multirotor(multirotor) => multirotor.limits.airspeed_max_m_s,
    };
    let airspeeds = setup.aircraft.values().map(airspeed);
    let airspeed_m_s = airspeeds
        .reduce(f64::min)
        .unwrap_or(scenario.search.airspeed_m_s);
    let words = |speed_m_s: f64, agl_m: f64, then: String| {
        format!(
            "up to {speed_m_s:.1} m/s at {agl_m:.0} m above ground, where the team flies at an airspeed of \
             {airspeed_m_s} m/s: {then}"
        )
    };
    let most_m_s = airspeed_m_s - LEAST_OVER_GROUND_M_S;
    Ok(if low_m_s > most_m_s {
        let then =
            format!("no vehicle could return against it; expected at most {most_m_s:.1} m/s");
        Some(refused("wind", words(low_m_s, low_m, then)))
    } else if high_m_s > DOUBTFUL_WIND * airspeed_m_s {
        let left_m_s = airspeed_m_s - high_m_s;
        let then = format!(
            "only {left_m_s:.1} m/s of ground speed remain against it, less in gusts; expected at most {:.1} m/s",
            DOUBTFUL_WIND * airspeed_m_s
        );
        Some(warned("wind", words(high_m_s, high_m, then)))
    } else {
        None
    })
}

/// Whether homes are where vehicles may fly, and apart.
fn homes(setup: &Setup, airspace: &Airspace) -> Result<Vec<Finding>, MissionError> {
    let scenario = &setup.scenario;
    let mut found = Vec::new();
    let mut before: Vec<(&VehicleTable, Enu)> = Vec::new();
    for (index, vehicle) in scenario.vehicles.iter().enumerate() {
        let home = airspace.frame().to_enu(scenario.home(index)?);
        let id = &vehicle.id;
        let inside_m = air::area::clearance_m(airspace.polygon(), home);
        if inside_m < -HOME_M {
            found.push(refused(
                "home",
                format!(
                    "the home of vehicle {id} is {:.0} m outside the fence, so that it would breach the fence on \
                     its way; expected a home inside, or at most {HOME_M:.0} m outside",
                    -inside_m
                ),
            ));
        } else if inside_m < 0.0 {
            found.push(warned(
                "home",
                format!(
                    "the home of vehicle {id} is {:.0} m outside the fence; it takes off and lands there",
                    -inside_m
                ),
            ));
        }
        let nearest_m = airspace
            .stacks()
            .iter()
            .map(|s| s.distance_m(home))
            .fold(f64::INFINITY, f64::min);
        if nearest_m < airspace.keep_out_m() {
            found.push(refused(
                "home",
                format!(
                    "the home of vehicle {id} is {nearest_m:.0} m from a stack, inside the keep-out; expected at \
                     least {:.0} m, or a smaller fence.keep_out_radius_m",
                    airspace.keep_out_m()
                ),
            ));
        }
        let aircraft = setup.aircraft_of(index)?;
        // Of a large team most are far: nothing is written for those.
        let near_m = HOMES_APART_M.max(aircraft.width_m());
        let near = |(_, there): &&(_, Enu)| there.distance_m(home) < near_m;
        for (other, there) in before.iter().filter(near) {
            let apart_m = there.distance_m(home);
            let expected_m = if aircraft.hovers() {
                HOVERING_HOMES_APART_M
            } else {
                HOMES_APART_M
            };
            let words = format!(
                "the homes of vehicles {} and {id} are {apart_m:.0} m apart; expected at least \
                 {expected_m:.0} m, so that no vehicle lands on another",
                other.id
            );
            if apart_m < aircraft.width_m() {
                found.push(refused("home", words));
            } else if apart_m < expected_m {
                found.push(warned("home", words));
            }
        }
        before.push((vehicle, home));
    }
    Ok(found)
}

/// Whether vehicles that start in flight are where they may fly, and apart.
fn starts_in_flight(setup: &Setup, airspace: &Airspace) -> Result<Vec<Finding>, MissionError> {
    let scenario = &setup.scenario;
    let mut found = Vec::new();
    let mut starts: Vec<(&str, Position)> = Vec::new();
    for (index, vehicle) in scenario.vehicles.iter().enumerate() {
        let (Some(start), id) = (vehicle.airborne, &vehicle.id) else {
            continue;
        };
        let place = Geodetic::new(start.lat_deg, start.lon_deg);
        let at = airspace.frame().to_enu(place);
        let ground_m = setup.terrain.ground_amsl_m(place);
        let keep_out_m = airspace.keep_out_m();
        let in_keep_out = |stack: &Enu| stack.distance_m(at) < keep_out_m;
        let why = if let Some(why) = Bounds::of(scenario, index)?.refuses(place, start.alt_amsl_m) {
            Some(why)
        } else if airspace.stacks().iter().any(in_keep_out) {
            Some(format!(
                "it is within {keep_out_m:.0} m of a stack, inside the keep-out"
            ))
        } else {
            (start.alt_amsl_m <= ground_m)
                .then(|| format!("the ground there is at {ground_m:.0} m AMSL"))
        };
        found.extend(why.map(|why| {
            let words = format!(
                "vehicle {id} cannot start in flight at {}, {}: {why}; expected vehicle.airborne inside the fence, \
                 between floor and ceiling",
                start.lat_deg, start.lon_deg
            );
            refused("airborne", words)
        }));
        let position = Position {
            at,
            height_m: start.alt_amsl_m,
        };
        starts.push((id, position));
    }
    found.extend(closest_starts(scenario, &starts));
    Ok(found)
}

/// The first two vehicles that start closer than the team keeps apart.
fn closest_starts(scenario: &Scenario, starts: &[(&str, Position)]) -> Option<Finding> {
    let fence = &scenario.fence;
    let is_close = |a: &Position, b: &Position| {
        (a.height_m - b.height_m).abs() < fence.separation_height_m
            && a.at.distance_m(b.at) < fence.separation_m
    };
    starts.iter().enumerate().find_map(|(k, (id, here))| {
        let (other, there) = starts[..k].iter().find(|(_, there)| is_close(here, there))?;
        let words = format!(
            "vehicles {other} and {id} start in flight {:.0} m apart and {:.0} m in height; expected at least \
             fence.separation_m = {} or fence.separation_height_m = {}",
            here.at.distance_m(there.at),
            (here.height_m - there.height_m).abs(),
            fence.separation_m,
            fence.separation_height_m
        );
        Some(warned("airborne", words))
    })
}

/// Whether the terrain is what the scenario says, and whether layers and floor are above it.
fn ground(setup: &Setup, airspace: &Airspace) -> Result<Vec<Finding>, MissionError> {
    let scenario = &setup.scenario;
    let Some(tile) = &scenario.site.terrain else {
        return Ok(Vec::new());
    };
    let mut found = Vec::new();
    let site = airspace.frame().origin();
    let stated_m = scenario.site.ground_amsl_m;
    match setup.terrain.known_amsl_m(site) {
        None => found.push(warned(
            "terrain",
            format!("{tile} has no height at the site; site.ground_amsl_m = {stated_m} m is used"),
        )),
        Some(ground_m) if (ground_m - stated_m).abs() > TERRAIN_M => found.push(warned(
            "terrain",
            format!(
                "site.ground_amsl_m = {stated_m}, but {tile} has {ground_m:.0} m there; expected a difference of \
                 at most {TERRAIN_M:.0} m, since fence, layers and plume count from site.ground_amsl_m"
            ),
        )),
        Some(_) => {}
    }
    found.extend(layers(setup, airspace)?);
    let places = || grid(airspace).filter(|&at| air::area::is_inside(airspace.polygon(), at));
    let heights = places().map(|at| setup.terrain.known_amsl_m(airspace.frame().to_geodetic(at)));
    let unknown = heights.clone().filter(Option::is_none).count();
    if unknown > 0 {
        let share = 100.0 * unknown as f64 / places().count() as f64;
        found.push(warned(
            "terrain",
            format!(
                "{tile} has no height for {share:.0} % of the fence, where site.ground_amsl_m = {stated_m} m is \
                 used; expected a fence inside the tile"
            ),
        ));
    }
    let highest = places()
        .zip(heights)
        .filter_map(|(at, height_m)| Some((at, height_m?)))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let (floor_amsl_m, _) = airspace.height_band_amsl_m();
    if let Some((at, height_m)) = highest
        && height_m > floor_amsl_m
        && !scenario.fence.follows_terrain
    {
        let Geodetic { lat_deg, lon_deg } = airspace.frame().to_geodetic(at);
        found.push(warned(
            "terrain",
            format!(
                "the ground rises to {height_m:.0} m at {lat_deg:.4}, {lon_deg:.4} inside the fence, above the \
                 lowest setpoints at {floor_amsl_m:.0} m; expected fence.floor_agl_m = {:.0}, or a fence without \
                 that place",
                (height_m - stated_m + OVER_GROUND_M).ceil()
            ),
        ));
    }
    Ok(found)
}

/// Whether each vehicle's layer is above the ground around its home.
fn layers(setup: &Setup, airspace: &Airspace) -> Result<Vec<Finding>, MissionError> {
    let scenario = &setup.scenario;
    let mut found = Vec::new();
    for (index, layer_amsl_m) in scenario.layers_amsl_m().into_iter().enumerate() {
        let home = airspace.frame().to_enu(scenario.home(index)?);
        let highest_m = highest_near_home_m(&setup.terrain, airspace.frame(), home);
        let above_m = layer_amsl_m - highest_m;
        let home_m = setup.ground_at_home_m(index)?;
        if highest_m - home_m > SLOPE_M {
            found.push(warned(
                "home",
                format!(
                    "the ground within {NEAR_HOME_M:.0} m of the home of vehicle {} rises to {highest_m:.0} m, \
                     {:.0} m above it; expected at most {SLOPE_M:.0} m, since a landing may find no approach",
                    scenario.vehicles[index].id,
                    highest_m - home_m
                ),
            ));
        }
        let words = format!(
            "vehicle {} waits at {layer_amsl_m:.0} m above home, {above_m:.0} m over the highest ground within \
             {NEAR_HOME_M:.0} m ({highest_m:.0} m); expected {OVER_GROUND_M:.0} m over it: choose another home, \
             or fence.floor_agl_m = {:.0}",
            scenario.vehicles[index].id,
            (scenario.fence.floor_agl_m + OVER_GROUND_M - above_m).ceil()
        );
        if above_m <= 0.0 {
            found.push(refused("layer", words));
        } else if above_m < OVER_GROUND_M {
            found.push(warned("layer", words));
        }
    }
    Ok(found)
}

/// Whether fence and keep-out leave room for all to wait at once, each in its own circle.
fn room(scenario: &Scenario, airspace: &Airspace) -> Option<Finding> {
    let team = scenario.vehicles.len();
    let levels = scenario.levels_amsl_m().len();
    let side_m = 2.0 * ORBIT_M + scenario.fence.separation_m;
    let step_m = grid_step_m(airspace);
    let free = grid(airspace).filter(|&at| airspace.clearance_m(at) >= MARGIN_M);
    let area_m2 = free.count() as f64 * step_m * step_m;
    let places = (area_m2 / (side_m * side_m)).max(1.0) as usize * levels;
    let words = format!(
        "fence and keep-out leave {:.2} km2, and the height band {levels} levels: room for {places} circles of \
         {side_m:.0} m for {team} vehicles",
        area_m2 / 1e6
    );
    if places < team {
        let words = format!("{words}; expected a larger fence, a higher ceiling or fewer vehicles");
        Some(refused("room", words))
    } else if places < 2 * team {
        Some(warned(
            "room",
            format!("{words}; they will wait for each other"),
        ))
    } else {
        None
    }
}

/// Step of the grid over the fence, m.
fn grid_step_m(airspace: &Airspace) -> f64 {
    let (low, high) = airspace.bounds();
    let widest_m = (high.at.east_m - low.at.east_m).max(high.at.north_m - low.at.north_m);
    GRID_M.max(widest_m / GRID_STEPS as f64)
}

/// Places over the box around the fence.
fn grid(airspace: &Airspace) -> impl Iterator<Item = Enu> + Clone {
    let (low, high) = airspace.bounds();
    let step_m = grid_step_m(airspace);
    let count = |from_m: f64, to_m: f64| ((to_m - from_m) / step_m) as usize;
    let (columns, rows) = (
        count(low.at.east_m, high.at.east_m),
        count(low.at.north_m, high.at.north_m),
    );
    let place = move |row: usize, column: usize| {
        Enu::new(
            low.at.east_m + step_m * (0.5 + column as f64),
            low.at.north_m + step_m * (0.5 + row as f64),
        )
    };
    (0..=rows).flat_map(move |row| (0..=columns).map(move |column| place(row, column)))
}
