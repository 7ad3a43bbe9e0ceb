//! What a scenario must hold, checked once, with the line of what is wrong.

use crate::tables::{
    AutopilotKind, FenceTable, MissionTable, OuterLoopKind, Scenario, SensorTable, SensorTables,
    SourceShape, SourceTable, VehicleKind, VehicleTable, WeatherTable,
};
use crate::{ScenarioError, line_and_column, uncertain};
use air::geo::Geodetic;
use plume::{Gas, Unit};
use std::collections::BTreeSet;
use toml::de::{DeTable, DeValue};

/// A refusal before its place in the text is known: dotted key, value, what would be right.
pub(crate) struct Refusal {
    key: String,
    found: String,
    expected: String,
}

impl Refusal {
    pub(crate) fn new(
        key: impl Into<String>,
        found: impl ToString,
        expected: impl Into<String>,
    ) -> Self {
        Self {
            key: key.into(),
            found: found.to_string(),
            expected: expected.into(),
        }
    }
}

/// Farthest source from the site, m, that the plume model accepts.
const FARTHEST_FROM_SITE_M: f64 = 1e6;

type Checked = Result<(), Refusal>;

/// Checks fields of a table, each against the range from its least to its greatest value in a unit.
macro_rules! ranges {
    ($table:ident in $key:expr; $($field:ident $low:literal to $high:literal $unit:literal,)+) => {
        $(
            let key = format!("{}.{}", $key, stringify!($field));
            in_range(key, $table.$field, ($low, $high), $unit)?;
        )+
    };
}

impl Scenario {
    /// Reads and checks the scenario in `text`, which came from `file`.
    ///
    /// # Errors
    /// Anything that is not a scenario, with line, column and what was expected.
    pub fn parse(file: &str, text: &str) -> Result<Self, ScenarioError> {
        let mut scenario: Self = toml::from_str(text).map_err(|e| syntax(file, text, &e))?;
        let world = scenario.define_gases().and_then(|()| scenario.check());
        let world = world.and_then(|()| {
            // The reality is checked as the whole scenario that it makes: its keys may be right by
            // themselves and wrong beside those that the scenario keeps.
            scenario.reality_scenario()?.check()
        });
        world.map_err(|refusal| place(file, text, refusal))?;
        scenario.write_out_gases();
        Ok(scenario)
    }

    /// The scenario with every default written out, as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    pub(crate) fn check(&self) -> Checked {
        mission(&self.mission)?;
        let site = &self.site;
        ranges!(site in "site";
            lat_deg -89.0 to 89.0 "degrees",
            lon_deg -180.0 to 180.0 "degrees",
            ground_amsl_m -500.0 to 9000.0 "m",
        );
        weather(&self.weather)?;
        if self.sources.is_empty() {
            return Err(Refusal::new("source", "none", "at least one [[source]]"));
        }
        for (k, source) in self.sources.iter().enumerate() {
            check_source(k, source)?;
            near_site(k, source, self)?;
        }
        positive("plume.sigma_y_scale", self.plume.sigma_y_scale)?;
        positive("plume.sigma_z_scale", self.plume.sigma_z_scale)?;
        background(self)?;
        sensors(&self.sensor)?;
        self.check_gases()?;
        uncertain::check(self)?;
        vehicles(&self.vehicles)?;
        fence(&self.fence)?;
        if self.fence.follows_terrain && self.site.terrain.is_none() {
            return Err(Refusal::new(
                "fence.follows_terrain",
                "true without site.terrain",
                "site.terrain, a file with the heights of the ground",
            ));
        }
        in_range(
            "record.state_hz",
            self.record.state_hz,
            (0.001, 1000.0),
            "Hz",
        )?;
        self.check_search()?;
        self.check_world()
    }

    fn check_search(&self) -> Checked {
        let search = &self.search;
        if !(4..=10_000).contains(&search.population) {
            return Err(Refusal::new(
                "search.population",
                search.population,
                "4 to 10000",
            ));
        }
        ranges!(search in "search";
            differential_weight 0.0 to 2.0 "",
            crossover 0.0 to 1.0 "",
            cone_deg 1.0 to 180.0 "degrees",
            step_s 0.1 to 3600.0 "s",
            airspeed_m_s 1.0 to 60.0 "m/s",
        );
        Ok(())
    }
}

fn mission(mission: &MissionTable) -> Checked {
    identifier("mission.name", &mission.name)?;
    ranges!(mission in "mission";
        duration_s 1.0 to 1e6 "s",
        tick_s 0.001 to 0.1 "s",
        peak_within 0.01 to 1.0 "a fraction of the peak's excess",
        flux_within 0.01 to 1.0 "a fraction of the flux",
    );
    if let Some(start) = &mission.start
        && mission.start_unix_ns().is_none()
    {
        return Err(Refusal::new(
            "mission.start",
            start,
            "a time in UTC, such as \"2026-11-27T12:30:00Z\", from 1970 on",
        ));
    }
    Ok(())
}

fn weather(weather: &WeatherTable) -> Checked {
    ranges!(weather in "weather";
        wind_speed_m_s 0.0 to 60.0 "m/s",
        wind_height_agl_m 0.1 to 5000.0 "m",
        wind_exponent 0.0 to 1.0 "",
        temperature_c -60.0 to 60.0 "degrees Celsius",
        pressure_hpa 300.0 to 1100.0 "hPa",
        mixing_height_m 10.0 to 10_000.0 "m above ground",
        turbulence_intensity 0.0 to 1.0 "",
        meander_share 0.0 to 0.95 "",
        lagrangian_time_s 1.0 to 3600.0 "s",
        fluctuation_intensity 0.0 to 3.0 "",
        fluctuation_time_s 0.1 to 600.0 "s",
    );
    direction("weather.wind_from_deg", weather.wind_from_deg)
}

/// Every key names a gas and a unit, and every gas once.
fn background(scenario: &Scenario) -> Checked {
    let background = &scenario.background;
    for (name, &value) in &background.0 {
        let key = format!("background.{name}");
        let Some((gas, unit)) = scenario.gas_of_column(name) else {
            let known = Gas::ALL.map(|gas| gas.column(Unit::Ppm)).join(", ");
            return Err(Refusal::new(
                key,
                value,
                format!("one of the keys {known}, or one of them in _ppb"),
            ));
        };
        let high = unit.of_ppm(1e5);
        within(
            key.clone(),
            value,
            0.0,
            high,
            &format!("{}, 0 to {high}", unit.as_str()),
        )?;
        if unit == Unit::Ppb && background.0.contains_key(gas.column(Unit::Ppm)) {
            let other = gas.column(Unit::Ppm);
            return Err(Refusal::new(
                key,
                value,
                format!("this key or {other}, not both"),
            ));
        }
    }
    Ok(())
}

fn sensors(sensors: &SensorTables) -> Checked {
    let mut seen = BTreeSet::new();
    for (k, sensor) in sensors.0.iter().enumerate() {
        let [one] = &sensors.0[..] else {
            if !seen.insert(sensor.gas) {
                let found = sensor.gas.map_or("no gas", Gas::as_str);
                return Err(Refusal::new(
                    format!("sensor.{k}"),
                    found,
                    "a gas that no other [[sensor]] measures",
                ));
            }
            check_sensor(&format!("sensor.{k}"), sensor)?;
            continue;
        };
        check_sensor("sensor", one)?;
    }
    Ok(())
}

fn check_sensor(table: &str, sensor: &SensorTable) -> Checked {
    let key = |name: &str| format!("{table}.{name}");
    not_negative(&key("time_constant_s"), sensor.time_constant_s)?;
    not_negative(
        &key("noise_sd_ppm"),
        sensor.noise_sd_ppm.unwrap_or_default(),
    )?;
    not_negative(&key("slow_sd_ppm"), sensor.slow_sd_ppm.unwrap_or_default())?;
    positive(&key("slow_time_s"), sensor.slow_time_s.unwrap_or(1.0))?;
    for (name, factor) in [
        (
            "noise_sd_ppm_known_within",
            sensor.noise_sd_ppm_known_within,
        ),
        ("slow_sd_ppm_known_within", sensor.slow_sd_ppm_known_within),
        ("slow_time_s_known_within", sensor.slow_time_s_known_within),
    ] {
        in_range(
            key(name),
            factor.unwrap_or(1.0),
            (1.0, 100.0),
            "as a factor",
        )?;
    }
    not_negative(&key("resolution_ppm"), sensor.resolution_ppm)?;
    positive(&key("gain"), sensor.gain)?;
    ranges!(sensor in table;
        gain_sd 0.0 to 1.0 "",
        offset_ppm -1e4 to 1e4 "ppm",
        drift_ppm_per_h -1e4 to 1e4 "ppm/h",
    );
    Ok(())
}

fn check_source(k: usize, source: &SourceTable) -> Checked {
    let key = |name: &str| format!("source.{k}.{name}");
    let table = format!("source.{k}");
    ranges!(source in table;
        lat_deg -89.0 to 89.0 "degrees",
        lon_deg -180.0 to 180.0 "degrees",
        stack_height_m 0.0 to 1000.0 "m above ground",
        position_sd_m 0.0 to 1e4 "m",
    );
    let height_m = source.axis_height_agl_m();
    in_range(
        key("effective_height_m"),
        height_m,
        (0.0, 5000.0),
        "m above ground",
    )?;
    check_area(k, source)?;
    check_schedule(k, source)?;
    match (
        source.emission_kg_s,
        source.c_max_ppm,
        source.c_max_distance_m,
    ) {
        (Some(q), None, None) => in_range(key("emission_kg_s"), q, (0.0, 1e6), "kg/s"),
        (None, None, None) if changes(source) => Ok(()),
        (None, Some(c), Some(d)) if !changes(source) => {
            in_range(key("c_max_ppm"), c, (0.0, 1e6), "ppm above background")?;
            in_range(key("c_max_distance_m"), d, (1.0, 1e5), "m")
        }
        (q, c, d) => {
            let named = [
                (q, "emission_kg_s"),
                (c, "c_max_ppm"),
                (d, "c_max_distance_m"),
            ];
            let series = changes(source).then_some("emission_series or emission_table");
            let stated = named.iter().filter(|n| n.0.is_some()).map(|n| n.1);
            let found: Vec<&str> = stated.chain(series).collect();
            let found = if found.is_empty() {
                "no strength".to_owned()
            } else {
                found.join(" with ")
            };
            Err(Refusal::new(
                format!("source.{k}"),
                found,
                "either emission_kg_s or emission_series, or c_max_ppm with c_max_distance_m",
            ))
        }
    }
}

/// Whether a source is near enough to the site for the local plane.
fn near_site(k: usize, source: &SourceTable, scenario: &Scenario) -> Checked {
    let site = &scenario.site;
    // A site without a frame is refused elsewhere.
    let Ok(frame) = scenario.frame() else {
        return Ok(());
    };
    let at = frame.to_enu(Geodetic::new(source.lat_deg, source.lon_deg));
    let (east_m, north_m) = (at.east_m.abs(), at.north_m.abs());
    if east_m.max(north_m) <= FARTHEST_FROM_SITE_M {
        return Ok(());
    }
    let (key, found) = if east_m > north_m {
        ("lon_deg", source.lon_deg)
    } else {
        ("lat_deg", source.lat_deg)
    };
    Err(Refusal::new(
        format!("source.{k}.{key}"),
        found,
        format!(
            "a source at most {:.0} km from the site at {}, {}; check signs and order of latitude and longitude",
            FARTHEST_FROM_SITE_M / 1e3,
            site.lat_deg,
            site.lon_deg
        ),
    ))
}

/// Whether a source's emission changes over time.
fn changes(source: &SourceTable) -> bool {
    source.emission_series.is_some() || source.emission_table.is_some()
}

/// One table of what a source emits over time, which is a schedule.
fn check_schedule(k: usize, source: &SourceTable) -> Checked {
    if source.emission_series.is_some() && source.emission_table.is_some() {
        return Err(Refusal::new(
            format!("source.{k}"),
            "emission_series with emission_table",
            "one of them",
        ));
    }
    if source.emission_between.is_some() && !changes(source) {
        return Err(Refusal::new(
            format!("source.{k}.emission_between"),
            "a source whose emission does not change",
            "emission_series or emission_table with this key",
        ));
    }
    source.schedule().map(|_| ()).map_err(|e| {
        Refusal::new(
            format!("source.{k}.emission_table"),
            e.to_string(),
            "rows of increasing time, s, and emission, kg/s, 0 or more",
        )
    })
}

/// What only an area has, and what it cannot have.
fn check_area(k: usize, source: &SourceTable) -> Checked {
    let sides = [(source.length_m, "length_m"), (source.width_m, "width_m")];
    if source.shape == SourceShape::Point {
        let more = [
            (source.outline.is_some(), "outline"),
            (source.axis_deg.is_some(), "axis_deg"),
        ];
        let given = sides.map(|(side, name)| (side.is_some(), name));
        return match given
            .into_iter()
            .chain(more)
            .find(|(is_there, _)| *is_there)
        {
            Some((_, name)) => Err(Refusal::new(
                format!("source.{k}.{name}"),
                "a source without shape = \"area\"",
                "shape = \"area\" with this key",
            )),
            None => Ok(()),
        };
    }
    for (side, name) in sides {
        let expected = "m, 0.1 to 20000, with sides that differ by less than a factor of 100";
        let other_m = sides.iter().filter_map(|s| s.0).fold(0.0, f64::max);
        let low_m = (other_m / 100.0).max(0.1);
        let key = format!("source.{k}.{name}");
        let Some(side) = side else {
            return Err(Refusal::new(key, "nothing", expected));
        };
        within(key, side, low_m, 20_000.0, expected)?;
    }
    let axis_deg = source.axis_deg.unwrap_or_default();
    direction(&format!("source.{k}.axis_deg"), axis_deg)?;
    if source.emission_kg_s.is_none() && !changes(source) {
        return Err(Refusal::new(
            format!("source.{k}"),
            "an area without emission_kg_s",
            "emission_kg_s of the whole area; c_max_ppm states a stack's strength",
        ));
    }
    Ok(())
}

fn vehicles(vehicles: &[VehicleTable]) -> Checked {
    let mut seen = BTreeSet::new();
    if vehicles.is_empty() {
        return Err(Refusal::new("vehicle", "none", "at least one [[vehicle]]"));
    }
    for (k, vehicle) in vehicles.iter().enumerate() {
        let id = &vehicle.id;
        identifier(&format!("vehicle.{k}.id"), id)?;
        if !seen.insert(id) {
            return Err(Refusal::new(
                format!("vehicle.{k}.id"),
                id,
                "an id that no other vehicle has",
            ));
        }
        equipment(k, vehicle)?;
    }
    for (k, vehicle) in vehicles.iter().enumerate() {
        sharing(k, vehicle, &vehicles[..k])?;
    }
    Ok(())
}

/// Whether a vehicle is told apart from those `before` it on the same link.
fn sharing(k: usize, vehicle: &VehicleTable, before: &[VehicleTable]) -> Checked {
    let shares = |other: &&VehicleTable| other.link.iter().any(|link| vehicle.link.contains(link));
    for other in before.iter().filter(shares) {
        let named = vehicle.system_id.is_some() && other.system_id.is_some();
        if !named || vehicle.system_id == other.system_id {
            return Err(Refusal::new(
                format!("vehicle.{k}.system_id"),
                vehicle
                    .system_id
                    .map_or_else(|| "none".to_owned(), |id| id.to_string()),
                format!(
                    "a different system_id for each of the vehicles {} and {}, which share a link",
                    other.id, vehicle.id
                ),
            ));
        }
    }
    Ok(())
}

/// Whether its MAVLink ids are some that there are, and its own.
fn mavlink_ids(k: usize, vehicle: &VehicleTable) -> Checked {
    for (key, id) in [
        ("system_id", vehicle.system_id),
        ("component_id", vehicle.component_id),
        ("gcs_system_id", vehicle.gcs_system_id),
    ] {
        if id == Some(0) {
            return Err(Refusal::new(format!("vehicle.{k}.{key}"), "0", "1 to 255"));
        }
    }
    let own = vehicle.gcs_system_id.unwrap_or(255);
    if vehicle.system_id == Some(own) {
        return Err(Refusal::new(
            format!("vehicle.{k}.system_id"),
            own.to_string(),
            "a value other than the ground station's (gcs_system_id, by default 255)",
        ));
    }
    Ok(())
}

/// What a vehicle has beside its id.
fn equipment(k: usize, vehicle: &VehicleTable) -> Checked {
    if vehicle.kind == VehicleKind::Mavlink && vehicle.link.is_empty() {
        return Err(Refusal::new(
            format!("vehicle.{k}"),
            "a mavlink vehicle without link",
            "link = \"udpin:0.0.0.0:14550\" or the like",
        ));
    }
    let keys = [
        ("may_arm", vehicle.may_arm),
        ("signing_key", vehicle.signing_key.is_some()),
        ("system_id", vehicle.system_id.is_some()),
        ("component_id", vehicle.component_id.is_some()),
        ("gcs_system_id", vehicle.gcs_system_id.is_some()),
        ("autopilot", vehicle.autopilot != AutopilotKind::default()),
        ("gas", !vehicle.gas.is_empty()),
    ];
    let bridged = keys.iter().find(|(_, given)| *given);
    if let Some((key, _)) = bridged.filter(|_| vehicle.kind != VehicleKind::Mavlink) {
        return Err(Refusal::new(
            format!("vehicle.{k}"),
            *key,
            "kind = \"mavlink\" with this key",
        ));
    }
    if vehicle.kind == VehicleKind::Simulated && vehicle.outer_loop != OuterLoopKind::default() {
        return Err(Refusal::new(
            format!("vehicle.{k}"),
            "outer_loop of a simulated vehicle",
            "kind = \"mavlink\" or \"stand-in\"; a simulated vehicle always uses that loop",
        ));
    }
    mavlink_ids(k, vehicle)?;
    for gas in &vehicle.gas {
        let fits = (1..=10).contains(&gas.name.len()) && gas.name.is_ascii();
        if !fits {
            return Err(Refusal::new(
                format!("vehicle.{k}.gas.name"),
                &gas.name,
                "1 to 10 letters, as in a NAMED_VALUE_FLOAT",
            ));
        }
        let numbers = gas.scale.is_finite() && gas.scale != 0.0 && gas.offset.is_finite();
        if !numbers {
            return Err(Refusal::new(
                format!("vehicle.{k}.gas.scale"),
                format!("{}, offset {}", gas.scale, gas.offset),
                "a scale in ppm per unit, not 0, and an offset in ppm",
            ));
        }
    }
    if let Some(address) = &vehicle.flightgear {
        host_and_port(&format!("vehicle.{k}.flightgear"), address)?;
    }
    if let Some(home) = vehicle.home {
        let table = format!("vehicle.{k}.home");
        ranges!(home in table;
            lat_deg -89.0 to 89.0 "degrees",
            lon_deg -180.0 to 180.0 "degrees",
        );
    }
    start_in_flight(k, vehicle)
}

/// Where a vehicle starts in flight, if it does.
fn start_in_flight(k: usize, vehicle: &VehicleTable) -> Checked {
    let Some(airborne) = vehicle.airborne else {
        return Ok(());
    };
    if vehicle.kind != VehicleKind::Simulated {
        return Err(Refusal::new(
            format!("vehicle.{k}.airborne"),
            "a start in flight of a vehicle that is not simulated",
            "kind = \"simulated\" with this key",
        ));
    }
    let table = format!("vehicle.{k}.airborne");
    ranges!(airborne in table;
        lat_deg -89.0 to 89.0 "degrees",
        lon_deg -180.0 to 180.0 "degrees",
        alt_amsl_m -500.0 to 20_000.0 "m above mean sea level",
    );
    direction(&format!("{table}.heading_deg"), airborne.heading_deg)
}

fn host_and_port(key: &str, address: &str) -> Checked {
    let fits = address.rsplit_once(':').is_some_and(|(host, port)| {
        !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0)
    });
    if fits {
        Ok(())
    } else {
        Err(Refusal::new(
            key,
            address,
            "HOST:PORT such as \"127.0.0.1:5500\"",
        ))
    }
}

fn fence(fence: &FenceTable) -> Checked {
    if matches!(fence.polygon.len(), 1 | 2) {
        return Err(Refusal::new(
            "fence.polygon",
            fence.polygon.len(),
            "three corners or more, or none",
        ));
    }
    for (k, [lat, lon]) in fence.polygon.iter().enumerate() {
        let key = format!("fence.polygon.{k}");
        within(&key, *lat, -89.0, 89.0, "[lat_deg, lon_deg]")?;
        within(&key, *lon, -180.0, 180.0, "[lat_deg, lon_deg]")?;
    }
    ranges!(fence in "fence";
        floor_agl_m 0.0 to 5000.0 "m above ground",
        home_ground_amsl_m -500.0 to 20_000.0 "m above mean sea level",
        top_amsl_m -500.0 to 20_000.0 "m above mean sea level",
    );
    within(
        "fence.ceiling_agl_m",
        fence.ceiling_agl_m,
        fence.floor_agl_m + 50.0,
        10_000.0,
        "m above ground, at least 50 m above the floor, to 10000",
    )?;
    not_negative("fence.keep_out_radius_m", fence.keep_out_radius_m)?;
    not_negative("fence.separation_m", fence.separation_m)?;
    not_negative("fence.separation_height_m", fence.separation_height_m)
}

pub(crate) fn within(
    key: impl Into<String>,
    value: f64,
    low: f64,
    high: f64,
    expected: &str,
) -> Checked {
    if value.is_finite() && value >= low && value <= high {
        Ok(())
    } else {
        Err(Refusal::new(key, value, expected))
    }
}

/// Checks a value, where there is one, against a range in a unit.
fn in_range(
    key: impl Into<String>,
    value: impl Into<Option<f64>>,
    (low, high): (f64, f64),
    unit: &str,
) -> Checked {
    let comma = if unit.is_empty() { "" } else { ", " };
    let expected = format!("{unit}{comma}{low} to {high}");
    let check = |value| within(key, value, low, high, &expected);
    value.into().map_or(Ok(()), check)
}

fn identifier(key: &str, name: &str) -> Checked {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
    if (1..=32).contains(&name.len()) && name.bytes().all(is_plain) {
        return Ok(());
    }
    let expected = "1 to 32 of letters, digits, '-' and '_'";
    Err(Refusal::new(key, name, expected))
}

fn direction(key: &str, value: f64) -> Checked {
    within(key, value, -360.0, 720.0, "degrees, 0 to 360")
}

fn positive(key: &str, value: f64) -> Checked {
    within(key, value, f64::MIN_POSITIVE, 1e6, "a positive number")
}

fn not_negative(key: &str, value: f64) -> Checked {
    within(key, value, 0.0, 1e9, "zero or more")
}

pub(crate) fn syntax(file: &str, text: &str, error: &toml::de::Error) -> ScenarioError {
    let (line, column) = line_and_column(text, error.span().map_or(0, |s| s.start));
    ScenarioError::Syntax {
        file: file.to_owned(),
        line,
        column,
        why: error.message().trim().replace('\n', "; "),
    }
}

pub(crate) fn place(file: &str, text: &str, refusal: Refusal) -> ScenarioError {
    let offset = offset_of(text, &refusal.key);
    let (line, column) = offset.map_or((0, 0), |at| line_and_column(text, at));
    ScenarioError::Value {
        file: file.to_owned(),
        line,
        column,
        key: refusal.key,
        found: refusal.found,
        expected: refusal.expected,
    }
}

/// Byte offset of the value at a dotted key (numbers are places in arrays), or of the nearest
/// table above it; a key is looked for under `[reality]` too when it is there.
fn offset_of(text: &str, key: &str) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let steps: Vec<&str> = if key.starts_with("uncertain.") {
        key.splitn(2, '.').collect()
    } else {
        key.split('.').collect()
    };
    let deepest = |table: &DeTable<'_>| walk(table, &steps);
    let own = deepest(document.get_ref());
    let below_reality = document
        .get_ref()
        .get("reality")
        .and_then(|r| r.get_ref().as_table())
        .and_then(deepest);
    match (own, below_reality) {
        (Some((_, depth)), Some((at, reality_depth))) if reality_depth >= depth => Some(at),
        (Some((at, _)), _) | (None, Some((at, _))) => Some(at),
        (None, None) => None,
    }
}

fn walk(table: &DeTable<'_>, steps: &[&str]) -> Option<(usize, usize)> {
    let (first, rest) = steps.split_first()?;
    let entry = table.get(*first)?;
    let mut here = (entry.span().start, 1);
    let mut value = entry.get_ref();
    for step in rest {
        let next = match value {
            DeValue::Table(t) => t.get(*step),
            DeValue::Array(a) => step.parse::<usize>().ok().and_then(|k| a.get(k)),
            _ => None,
        };
        let Some(next) = next else { break };
        here = (next.span().start, here.1 + 1);
        value = next.get_ref();
    }
    Some(here)
}
