//! A scenario with all the files it names, read and checked.

use crate::MissionError;
use air::geo::{Enu, Geodetic, LocalFrame};
use air::isa::Atmosphere;
use air::terrain::Terrain;
use air::wind::WindSeries;
use fdm::Airframe;
use mav_bridge::ardupilot::{MAV_GCS_SYSID, SYSID_MYGCS};
use plume::stability::Stability;
use sc::SquadronController;
use scenario::Scenario;
use scenario::airspace::Airspace;
use scenario::tables::{BUILT_IN_AIRCRAFT, OuterLoopKind, VehicleKind, VehicleTable};
use scenario::weather::{ObservedTimes, WeatherReports};
use stand_in::{StandInConfig, TeamVehicle};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The aircraft that every installation has.
const BUILT_IN: &str = include_str!("../../../aircraft/x8.toml");

/// Ground within this distance of a home is looked at, m: the circle above home and the climb to it.
pub(crate) const NEAR_HOME_M: f64 = 500.0;

/// Reads a file named by the scenario: its bytes, or what went wrong in words.
pub type ReadFile<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;

/// Everything that a mission needs to start.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The scenario, checked.
    pub scenario: Scenario,
    /// Aircraft by the name under which vehicles ask for them.
    pub aircraft: BTreeMap<String, Airframe>,
    /// Measured wind, where the scenario names a series.
    pub wind_series: Option<WindSeries>,
    /// Stability classes of that series with the times from which they hold, s; missions fly in the scenario's.
    pub classes: Vec<(f64, Stability)>,
    /// The same of the stand-ins' reality: its own, or the scenario's.
    pub reality_wind_series: Option<WindSeries>,
    /// The ground.
    pub terrain: Terrain,
    /// What the scenario's files hold, by the names that it gives them; but for keys, which are nobody else's.
    pub files: Arc<BTreeMap<String, Vec<u8>>>,
    /// Keys shared with real vehicles, by the vehicle's id.
    pub signing_keys: BTreeMap<String, SigningKey>,
}

/// A key shared with a vehicle; it does not show itself.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningKey(pub [u8; 32]);

impl std::fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("SigningKey(..)")
    }
}

impl SigningKey {
    /// Reads 64 hexadecimal digits; white space around them does not matter.
    ///
    /// # Errors
    /// What else it is, in words that do not give it away.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let digits: Option<Vec<u32>> = text.trim().chars().map(|c| c.to_digit(16)).collect();
        let bytes: Option<Vec<u8>> = digits.filter(|d| d.len() == 64).map(|digits| {
            let byte = |pair: &[u32]| (pair[0] * 16 + pair[1]) as u8;
            digits.chunks_exact(2).map(byte).collect()
        });
        bytes
            .and_then(|b| b.try_into().ok())
            .map(Self)
            .ok_or_else(|| "expected a key of 32 bytes as 64 hexadecimal digits".to_owned())
    }
}

impl Setup {
    /// Reads and checks the scenario `text` of `file` and all files it names.
    ///
    /// # Errors
    /// What is wrong in which file, and what was expected.
    pub fn load(file: &str, text: &str, read: ReadFile<'_>) -> Result<Self, MissionError> {
        let mut scenario = Scenario::parse(file, text)?;
        let files = RefCell::new(BTreeMap::new());
        let read_key = read;
        let read: ReadFile<'_> = &|name| {
            let bytes = read(name)?;
            files.borrow_mut().insert(name.to_owned(), bytes.clone());
            Ok(bytes)
        };
        let text_of = |name: &str| {
            read(name).and_then(|bytes| String::from_utf8(bytes).map_err(|e| e.to_string()))
        };
        scenario
            .read_emission_series(&text_of)
            .map_err(|refused| MissionError::File {
                file: refused.file,
                why: refused.why,
                named_by: format!("{} of {file}", refused.key),
            })?;
        let mut aircraft = BTreeMap::new();
        for vehicle in &scenario.vehicles {
            let name = &vehicle.aircraft;
            if !aircraft.contains_key(name) {
                let named_by = format!("vehicle {} of {file}", vehicle.id);
                aircraft.insert(name.clone(), load_aircraft(name, &named_by, read)?);
            }
        }
        let refuse = |name: &str, key: &str, why: String| MissionError::File {
            file: name.to_owned(),
            why,
            named_by: format!("{key} of {file}"),
        };
        let weather = |of: &Scenario, name: &String, key: &str| {
            let whole = read(name).and_then(|bytes| weather_of(of, bytes));
            whole.map_err(|why| refuse(name, key, why))
        };
        let named = scenario.weather.series.clone();
        let mut reality = scenario.in_reality();
        let own = named
            .as_ref()
            .map(|name| weather(&scenario, name, "weather.series"));
        let mut classes = Vec::new();
        let wind_series = own
            .transpose()?
            .map(|(series, (temperature_c, pressure_hpa), own)| {
                classes = own;
                let stated = &mut scenario.weather;
                stated.temperature_c = temperature_c.unwrap_or(stated.temperature_c);
                stated.pressure_hpa = pressure_hpa.or(stated.pressure_hpa);
                series
            });
        let reality_wind_series = match reality.weather.series.take() {
            own if own == named => wind_series.clone(),
            None => None,
            Some(name) => Some(weather(&reality, &name, "reality.weather.series")?.0),
        };
        // Beyond the tile, and in its voids, the ground is that of the site's origin.
        let ground = scenario.site.ground_amsl_m;
        let site = Geodetic::new(scenario.site.lat_deg, scenario.site.lon_deg);
        let terrain = match &scenario.site.terrain {
            None => Terrain::Flat(ground),
            Some(name) => read(name)
                .and_then(|bytes| {
                    Terrain::read(name, &bytes, site, ground).map_err(|e| e.to_string())
                })
                .map_err(|why| refuse(name, "site.terrain", why))?,
        };
        if scenario.fence.follows_terrain {
            follow(&mut scenario, &terrain)?;
        }
        let mut signing_keys = BTreeMap::new();
        for vehicle in &scenario.vehicles {
            let Some(name) = &vehicle.signing_key else {
                continue;
            };
            let key = read_key(name)
                .and_then(|bytes| SigningKey::from_text(&String::from_utf8_lossy(&bytes)))
                .map_err(|why| refuse(name, &format!("vehicle {}", vehicle.id), why))?;
            signing_keys.insert(vehicle.id.clone(), key);
        }
        Ok(Self {
            files: Arc::new(files.into_inner()),
            signing_keys,
            scenario,
            aircraft,
            wind_series,
            classes,
            reality_wind_series,
            terrain,
        })
    }

    /// The same with the weather of `weather.series` at the times of observations from `from_s` to `to_s`, and a notice
    /// where they reach beyond it. Their times count from 1970, or else from `mission.start`.
    ///
    /// # Errors
    /// A wind that changes, at times that cannot be compared with those of the observations, or that share none with
    /// them.
    pub fn at_times(
        mut self,
        from_s: f64,
        to_s: f64,
    ) -> Result<(Self, Option<String>), MissionError> {
        let name = self.scenario.weather.series.as_ref();
        let Some((name, bytes)) = name.and_then(|n| self.files.get_key_value(n)) else {
            return Ok((self, None));
        };
        let start_ns = self.scenario.mission.start_unix_ns();
        let times = ObservedTimes {
            span_s: (from_s, to_s),
            start_unix_s: start_ns.map(|ns| ns as f64 * 1e-9),
        };
        let text = String::from_utf8_lossy(bytes);
        let read = || {
            let profile = self.scenario.wind_profile().map_err(|e| e.to_string())?;
            let read = WeatherReports::at_times(&text, &profile, times);
            let Some((reports, notice)) = read.map_err(|e| e.to_string())? else {
                return Ok(None);
            };
            let series = reports.series(&profile, None).map_err(|e| e.to_string())?;
            Ok(Some((series, reports.classes(None), notice)))
        };
        let read = read().map_err(|why: String| MissionError::File {
            file: name.clone(),
            why,
            named_by: "weather.series".to_owned(),
        })?;
        let Some((series, classes, notice)) = read else {
            return Ok((self, None));
        };
        self.wind_series = Some(series);
        self.classes = classes;
        Ok((self, notice))
    }

    /// Makes exactly `count` of the team's vehicles stand-ins, the last ones, and the others
    /// simulated.
    ///
    /// # Errors
    /// More stand-ins than vehicles.
    pub fn with_stand_ins(mut self, count: usize) -> Result<Self, MissionError> {
        let team = self.scenario.vehicles.len();
        if count > team {
            return Err(MissionError::Request(format!(
                "{count} stand-ins in a team of {team}; expected 0 to {team}"
            )));
        }
        for (k, vehicle) in self.scenario.vehicles.iter_mut().enumerate() {
            vehicle.kind = if k + count >= team {
                VehicleKind::StandIn
            } else {
                VehicleKind::Simulated
            };
            vehicle.forget_link();
            match vehicle.kind {
                VehicleKind::Simulated => vehicle.outer_loop = OuterLoopKind::default(),
                VehicleKind::StandIn | VehicleKind::Mavlink => vehicle.airborne = None,
            }
        }
        Ok(self)
    }

    /// The same with a real aircraft on `link` as the vehicle at `index` of the team.
    #[must_use]
    pub fn with_real(mut self, index: usize, link: String) -> Self {
        if let Some(vehicle) = self.scenario.vehicles.get_mut(index) {
            vehicle.kind = VehicleKind::Mavlink;
            vehicle.link = vec![link];
            vehicle.airborne = None;
        }
        self
    }

    /// The aircraft of the vehicle at `index` of the team.
    ///
    /// # Errors
    /// No such vehicle.
    pub(crate) fn aircraft_of(&self, index: usize) -> Result<&Airframe, MissionError> {
        self.scenario
            .vehicles
            .get(index)
            .and_then(|v| self.aircraft.get(&v.aircraft))
            .ok_or_else(|| {
                MissionError::Request(format!("the scenario has no vehicle number {index}"))
            })
    }

    /// The squadron controller of the mission.
    ///
    /// # Errors
    /// A scenario that it refuses.
    pub(crate) fn controller(&self) -> Result<SquadronController, MissionError> {
        let vehicles = self.scenario.vehicles.iter();
        let hovers =
            |v: &VehicleTable| self.aircraft.get(&v.aircraft).is_some_and(Airframe::hovers);
        let hovers: Vec<bool> = vehicles.map(hovers).collect();
        let controller = SquadronController::new(&self.scenario)?;
        Ok(controller
            .flown_by(&self.scenario, &hovers)
            .over(&self.terrain)?)
    }

    /// What the stand-in for the vehicle at `index` of the team flies as, and in.
    ///
    /// # Errors
    /// There is no such vehicle, or a scenario or aircraft that the stand-in refuses.
    pub fn stand_in_config(&self, index: usize) -> Result<StandInConfig, MissionError> {
        self.stand_in_config_of(index, self.aircraft_of(index)?.clone())
    }

    /// The same with an aircraft of the caller's in place of that vehicle's.
    ///
    /// # Errors
    /// As [`Self::stand_in_config`].
    pub fn stand_in_config_of(
        &self,
        index: usize,
        aircraft: Airframe,
    ) -> Result<StandInConfig, MissionError> {
        let mut config = StandInConfig::from_scenario(&self.scenario, index, aircraft)?;
        let vehicle = &self.scenario.vehicles[index];
        config.system_id = vehicle.system_id.unwrap_or(config.system_id);
        if let Some(station) = vehicle.gcs_system_id {
            // It has the one or the other, as the ArduPlane that it emulates.
            for name in [MAV_GCS_SYSID, SYSID_MYGCS] {
                config.parameters.set(name, f32::from(station));
            }
        }
        Ok(StandInConfig {
            wind_series: self.reality_wind_series.clone(),
            ..config.over(self.terrain.clone())
        })
    }

    /// The vehicle at `index` of the team as ground stations see it.
    ///
    /// # Errors
    /// There is no such vehicle, or more than MAVLink has system ids for.
    pub fn team_vehicle(&self, index: usize) -> Result<TeamVehicle, MissionError> {
        let aircraft = self.aircraft_of(index)?;
        let home_amsl_m = self.ground_at_home_m(index)?;
        TeamVehicle::new(&self.scenario, index, aircraft, home_amsl_m).ok_or_else(|| {
            MissionError::Request(format!(
                "vehicle number {}: MAVLink has system ids for at most 254 vehicles",
                index + 1
            ))
        })
    }

    /// Id of the vehicle at `index` of the team.
    ///
    /// # Errors
    /// No such vehicle.
    pub(crate) fn name_of(&self, index: usize) -> Result<&str, MissionError> {
        let vehicle = self.scenario.vehicles.get(index);
        vehicle.map(|v| v.id.as_str()).ok_or_else(|| {
            MissionError::Request(format!("the scenario has no vehicle number {index}"))
        })
    }

    /// Index in the team of the vehicle called `id`.
    ///
    /// # Errors
    /// No such vehicle.
    pub fn index_of(&self, id: &str) -> Result<usize, MissionError> {
        let ids: Vec<&str> = self
            .scenario
            .vehicles
            .iter()
            .map(|v| v.id.as_str())
            .collect();
        ids.iter().position(|known| *known == id).ok_or_else(|| {
            MissionError::Request(format!(
                "vehicle '{id}' is not in the scenario; expected one of {}",
                ids.join(", ")
            ))
        })
    }

    /// The site's frame.
    ///
    /// # Errors
    /// A site outside the frame's validity.
    pub fn frame(&self) -> Result<LocalFrame, MissionError> {
        Ok(self.scenario.frame()?)
    }

    /// Height of the ground at the home of the vehicle at `index`, m above mean sea level.
    ///
    /// # Errors
    /// A site outside the frame's validity.
    pub(crate) fn ground_at_home_m(&self, index: usize) -> Result<f64, MissionError> {
        Ok(self.terrain.ground_amsl_m(self.scenario.home(index)?))
    }

    /// Length of a tick, ns.
    pub fn tick_ns(&self) -> i64 {
        protocol::SimTime::from_s(self.scenario.mission.tick_s).ns()
    }

    /// Number of ticks of the whole mission.
    pub fn ticks(&self) -> u64 {
        (self.scenario.mission.duration_s / self.scenario.mission.tick_s).round() as u64
    }
}

/// A pressure that there is, where only a temperature is reported, hPa.
const SOME_PRESSURE_HPA: f64 = 1000.0;

/// Wind over time by a text of reported weather, and temperature, °C, and pressure at the ground, hPa, at the
/// mission's start where they are reported, and stability classes. The text is taken as made for the mission's start.
type Weather = (
    WindSeries,
    (Option<f64>, Option<f64>),
    Vec<(f64, Stability)>,
);

fn weather_of(scenario: &Scenario, bytes: Vec<u8>) -> Result<Weather, String> {
    let text = String::from_utf8(bytes).map_err(|e| e.to_string())?;
    let profile = scenario.wind_profile().map_err(|e| e.to_string())?;
    let height_agl_m = profile.reference_height_agl_m();
    let reports = WeatherReports::parse(&text, height_agl_m, None).map_err(|e| e.to_string())?;
    let frame = scenario.frame().map_err(|e| e.to_string())?;
    reports.check_place(&frame).map_err(|e| e.to_string())?;
    let series = reports.series(&profile, None).map_err(|e| e.to_string())?;
    let ground_amsl_m = scenario.site.ground_amsl_m;
    let air = reports.air_at_start(ground_amsl_m, None);
    let (temperature_c, pressure_hpa) = air;
    // What is no air is refused here rather than later as the scenario's own.
    let known = temperature_c.unwrap_or(scenario.weather.temperature_c);
    Atmosphere::through(
        ground_amsl_m,
        known,
        pressure_hpa.unwrap_or(SOME_PRESSURE_HPA),
    )
    .map_err(|e| e.to_string())?;
    Ok((series, air, reports.classes(None)))
}

/// Writes into the fence what of it counts from one height for all, where it follows the terrain.
fn follow(scenario: &mut Scenario, terrain: &Terrain) -> Result<(), MissionError> {
    let frame = scenario.frame()?;
    let mut highest_m = f64::NEG_INFINITY;
    for index in 0..scenario.vehicles.len() {
        let home = frame.to_enu(scenario.home(index)?);
        highest_m = highest_m.max(highest_near_home_m(terrain, &frame, home));
    }
    let (_, top_amsl_m) = Airspace::of(scenario)?.over(terrain).height_band_amsl_m();
    scenario.fence.home_ground_amsl_m.get_or_insert(highest_m);
    scenario.fence.top_amsl_m.get_or_insert(top_amsl_m);
    Ok(())
}

/// Highest ground within [`NEAR_HOME_M`] of a home, m above mean sea level.
pub(crate) fn highest_near_home_m(terrain: &Terrain, frame: &LocalFrame, home: Enu) -> f64 {
    let around = (0..8).map(|k| home.displaced(45.0 * f64::from(k), NEAR_HOME_M));
    std::iter::once(home)
        .chain(around)
        .map(|at| terrain.ground_amsl_m(frame.to_geodetic(at)))
        .fold(f64::NEG_INFINITY, f64::max)
}

fn load_aircraft(name: &str, named_by: &str, read: ReadFile<'_>) -> Result<Airframe, MissionError> {
    let refuse = |why: String| MissionError::File {
        file: name.to_owned(),
        why,
        named_by: named_by.to_owned(),
    };
    let text = match read(name) {
        Ok(bytes) => String::from_utf8(bytes).map_err(|e| refuse(e.to_string()))?,
        // The default aircraft needs no file beside the scenario.
        Err(_) if name == BUILT_IN_AIRCRAFT => BUILT_IN.to_owned(),
        Err(why) => return Err(refuse(why)),
    };
    Airframe::from_toml(name, &text).map_err(|e| refuse(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n\
        [[source]]\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=300\n";

    fn nothing(_: &str) -> Result<Vec<u8>, String> {
        Err("no such file".to_owned())
    }

    #[test]
    fn the_default_aircraft_needs_no_file() {
        let setup = Setup::load("s.toml", LEAST, &nothing).unwrap();
        assert_eq!(setup.aircraft.len(), 1);
    }

    #[test]
    fn a_missing_aircraft_is_named_with_its_vehicle() {
        let text = format!("{LEAST}[[vehicle]]\nid=\"7\"\naircraft=\"glider.toml\"\n");
        let message = Setup::load("s.toml", &text, &nothing)
            .unwrap_err()
            .to_string();
        assert_eq!(
            message,
            "glider.toml: no such file (named by vehicle 7 of s.toml)"
        );
    }

    #[test]
    fn a_signing_key_is_read_or_refused_without_telling_it() {
        let text = format!(
            "{LEAST}[[vehicle]]\nid=\"7\"\nkind=\"mavlink\"\nlink=\"udpin:0.0.0.0:14550\"\n\
             signing_key=\"key\"\n"
        );
        let load = |key: &'static str| {
            Setup::load("s.toml", &text, &move |file| match file {
                "key" => Ok(key.into()),
                other => nothing(other),
            })
        };
        let good = load("00ff00000000000000000000000000000000000000000000000000000000000A\n");
        let key = good.unwrap().signing_keys["7"].clone();
        assert_eq!((key.0[1], key.0[31]), (255, 10));
        assert_eq!(format!("{key:?}"), "SigningKey(..)");
        let message = load("secret").unwrap_err().to_string();
        assert!(
            message.starts_with("key: expected a key of 32 bytes as 64"),
            "{message}"
        );
        assert!(!message.contains("secret"));
    }

    #[test]
    fn a_reality_may_have_a_wind_of_its_own() {
        let load = |weather: &str, reality: &str| {
            let text = format!("{LEAST}[weather]\n{weather}\n[reality.weather]\n{reality}\n");
            let read = |file: &str| match file {
                "west.csv" => Ok(b"time_s,wind_speed_m_s,wind_from_deg\n0,5,270\n".to_vec()),
                "south.csv" => Ok(b"time_s,wind_speed_m_s,wind_from_deg\n0,5,180\n".to_vec()),
                other => nothing(other),
            };
            let setup = Setup::load("s.toml", &text, &read).map_err(|e| e.to_string())?;
            let from = |series: Option<WindSeries>| {
                series.map(|s| s.at(10.0)).map(|w| w.from_deg().round())
            };
            Ok::<_, String>((from(setup.wind_series), from(setup.reality_wind_series)))
        };
        let (west, south) = ("series = \"west.csv\"", "series = \"south.csv\"");
        assert_eq!(load(west, ""), Ok((Some(270.0), Some(270.0))));
        assert_eq!(load(west, south), Ok((Some(270.0), Some(180.0))));
        assert_eq!(load("", south), Ok((None, Some(180.0))));
        assert_eq!(load(west, "wind_from_deg = 180.0"), Ok((Some(270.0), None)));
        let missing = load("", "series = \"none.csv\"").unwrap_err();
        assert!(missing.contains("reality.weather.series"), "{missing}");
    }

    #[test]
    fn a_wind_series_is_read_or_refused_by_line() {
        let text = format!("{LEAST}[weather]\nseries=\"w.csv\"\n");
        let load = |csv: &'static [u8]| {
            Setup::load("s.toml", &text, &|file| match file {
                "w.csv" => Ok(csv.to_vec()),
                other => nothing(other),
            })
        };
        let good = load(b"wind_from_deg,time_s,wind_speed_m_s\n270,0,5\n280,60,6\n");
        assert!(good.unwrap().wind_series.is_some());
        let bad = load(b"time_s,wind_speed_m_s,wind_from_deg\n0,5,270\n1,fast,270\n");
        let message = bad.unwrap_err().to_string();
        assert!(
            message.contains("line 3, column wind_speed_m_s: found \"fast\""),
            "{message}"
        );
        let short = load(b"time_s,wind_speed_m_s\n0,5\n");
        assert!(short.unwrap_err().to_string().contains("wind_from_deg"));
    }

    #[test]
    fn stand_ins_are_the_last_of_the_team() {
        let setup = Setup::load("s.toml", LEAST, &nothing).unwrap();
        for count in [0, 1, 3, 6] {
            let setup = setup.clone().with_stand_ins(count).unwrap();
            let real = setup
                .scenario
                .vehicles
                .iter()
                .filter(|v| v.kind == VehicleKind::StandIn);
            assert_eq!(real.count(), count);
        }
        assert!(setup.with_stand_ins(7).is_err());
    }
}
