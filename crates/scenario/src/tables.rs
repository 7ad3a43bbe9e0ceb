//! The tables of a scenario.
//!
//! Every table says what serde `expecting` of it, or the name of its type would stand in messages.

use plume::schedule::Between;
use plume::sigma::Setting;
use plume::stability::Stability;
use plume::{AreaSpec, Gas, Outline, Unit, UnsteadySpec};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A whole scenario. Every key but those of `[site]` and the first `[[source]]` may be left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name, seed, length.
    #[serde(default)]
    pub mission: MissionTable,
    /// Where it is.
    pub site: SiteTable,
    /// The air.
    #[serde(default)]
    pub weather: WeatherTable,
    /// Gases that the table of [`Gas`] does not have.
    #[serde(default, rename = "gas", skip_serializing_if = "Vec::is_empty")]
    pub gases: Vec<GasDefinition>,
    /// What emits; at least one.
    #[serde(rename = "source")]
    pub sources: Vec<SourceTable>,
    /// How the plume spreads beyond its stability class.
    #[serde(default)]
    pub plume: PlumeTable,
    /// The air without the sources.
    #[serde(default)]
    pub background: BackgroundTable,
    /// The gas sensors of the vehicles; [`Scenario::sensor`] is that of its gas.
    #[serde(default)]
    pub sensor: SensorTables,
    /// Extensions of world, sensor or aircraft.
    #[serde(default, rename = "mechanism", skip_serializing_if = "Vec::is_empty")]
    pub mechanisms: Vec<MechanismTable>,
    /// One-sigma priors by dotted key.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub uncertain: BTreeMap<String, f64>,
    /// The team; five simulated and one stand-in where left out.
    #[serde(default = "default_team", rename = "vehicle")]
    pub vehicles: Vec<VehicleTable>,
    /// Where vehicles may fly.
    #[serde(default)]
    pub fence: FenceTable,
    /// How the team searches.
    #[serde(default)]
    pub search: SearchTable,
    /// The reality gap in flight.
    #[serde(default)]
    pub gap: GapTable,
    /// What of the mission is recorded.
    #[serde(default, skip_serializing_if = "is_default")]
    pub record: RecordTable,
    /// The stand-ins' own world: the same tables, only the keys that differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reality: Option<toml::Table>,
}

/// `[mission]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct MissionTable {
    /// Name, part of every key on the bus: letters, digits, `-` and `_`.
    pub name: String,
    /// Seed of every random number of the run.
    pub seed: u64,
    /// Length of the mission, s of simulated time.
    pub duration_s: f64,
    /// When it begins, UTC (`2026-11-27T12:30:00Z`): the date of recordings and exports, which changes nothing of
    /// the mission itself; none where that is not said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Length of a tick, s.
    pub tick_s: f64,
    /// The team goes home before its time is up once the peak is confirmed and the half width of its 95 % interval is
    /// this part of its excess, and what [`MissionTable::flux_within`] asks holds too; none for a mission that asks
    /// nothing of the peak.
    pub peak_within: Option<f64>,
    /// The same for the flux, the first answer of `summary.json`. With neither the mission takes the time it has.
    pub flux_within: Option<f64>,
}

impl Default for MissionTable {
    fn default() -> Self {
        Self {
            name: "mission".to_owned(),
            seed: 1,
            duration_s: 1800.0,
            start: None,
            tick_s: 0.02,
            peak_within: None,
            flux_within: None,
        }
    }
}

impl MissionTable {
    /// When it begins, ns since 1970, where that is said.
    pub fn start_unix_ns(&self) -> Option<i64> {
        let unix_s = formats::calendar::iso_8601(self.start.as_deref()?)?;
        (unix_s >= 0.0).then_some(unix_s as i64 * 1_000_000_000)
    }
}

/// `[site]`: origin of the local east-north-up plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct SiteTable {
    /// Latitude of the origin, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude of the origin, degrees (WGS84).
    pub lon_deg: f64,
    /// Height of the ground at the origin, m above mean sea level.
    pub ground_amsl_m: f64,
    /// SRTM tile (`N43W008.hgt`) or ESRI ASCII grid (`.asc`) for the ground elsewhere; flat where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<String>,
}

/// Where the world's wind comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WindFollows {
    /// The scenario's own wind, constant or its series.
    Scenario,
    /// What real vehicles report.
    Reported,
}

/// `[weather]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct WeatherTable {
    /// Wind speed at `wind_height_agl_m`, m/s.
    pub wind_speed_m_s: f64,
    /// Height of the wind speed above ground, m.
    pub wind_height_agl_m: f64,
    /// Direction from which the wind blows, degrees.
    pub wind_from_deg: f64,
    /// Exponent of the power law of wind with height.
    pub wind_exponent: f64,
    /// Pasquill stability class.
    pub stability: Stability,
    /// Rural or urban spread.
    pub setting: Setting,
    /// Air temperature at the ground, °C.
    pub temperature_c: f64,
    /// Static pressure at the ground, hPa; the standard atmosphere's where left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pressure_hpa: Option<f64>,
    /// Height of the mixing lid above ground, m; no lid where left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mixing_height_m: Option<f64>,
    /// Strength of the gusts: standard deviation of the vertical gust over the wind at 20 ft,
    /// 0.1 is that of MIL-F-8785C.
    pub turbulence_intensity: f64,
    /// File of reported weather over time ([`crate::weather`]).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<String>,
    /// Whether the world's wind is the scenario's or what real vehicles report.
    pub follow: WindFollows,
    /// Whether the plume is the mean one, or moves and fluctuates as air does.
    pub air: AirKind,
    /// Part of the plume's variance that is meander, where it has most; of unsteady air.
    pub meander_share: f64,
    /// Lagrangian time scale of the horizontal eddies, s; of unsteady air.
    pub lagrangian_time_s: f64,
    /// Standard deviation of the concentration in the plume over its mean; of unsteady air.
    pub fluctuation_intensity: f64,
    /// Time over which the concentration fluctuates in air that passes by, s; of unsteady air.
    pub fluctuation_time_s: f64,
}

/// What the air does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AirKind {
    /// The plume is the mean one of the wind.
    Steady,
    /// The wind meanders, carries the plume as puffs, and concentrations fluctuate in it.
    Unsteady,
}

impl Default for WeatherTable {
    fn default() -> Self {
        Self {
            wind_speed_m_s: 5.0,
            wind_height_agl_m: 10.0,
            wind_from_deg: 270.0,
            wind_exponent: 0.15,
            stability: Stability::D,
            setting: Setting::Rural,
            temperature_c: 15.0,
            pressure_hpa: None,
            mixing_height_m: None,
            turbulence_intensity: 0.1,
            series: None,
            follow: WindFollows::Scenario,
            air: AirKind::Steady,
            meander_share: UnsteadySpec::default().meander_share,
            lagrangian_time_s: UnsteadySpec::default().lagrangian_time_s,
            fluctuation_intensity: UnsteadySpec::default().fluctuation_intensity,
            fluctuation_time_s: UnsteadySpec::default().fluctuation_time_s,
        }
    }
}

/// What emits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SourceShape {
    /// A stack.
    #[default]
    Point,
    /// Ground of some length and width.
    Area,
}

impl SourceShape {
    fn is_point(&self) -> bool {
        *self == Self::Point
    }
}

/// `[[source]]`: either `emission_kg_s`, or `c_max_ppm` with `c_max_distance_m`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct SourceTable {
    /// Name.
    #[serde(default = "default_source_name")]
    pub name: String,
    /// Gas.
    #[serde(default = "default_gas")]
    pub gas: Gas,
    /// A stack or an area.
    #[serde(default, skip_serializing_if = "SourceShape::is_point")]
    pub shape: SourceShape,
    /// Latitude of the stack, or of the middle of the area, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude of the same, degrees (WGS84).
    pub lon_deg: f64,
    /// Outline of an area; a rectangle where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outline: Option<Outline>,
    /// Length of an area along `axis_deg`, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// Width of an area, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_m: Option<f64>,
    /// Direction of an area's length, degrees from north, clockwise; 0 where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_deg: Option<f64>,
    /// Height of the stack above ground, m.
    #[serde(default)]
    pub stack_height_m: f64,
    /// Height of the plume's axis above ground, m; the stack's where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effective_height_m: Option<f64>,
    /// Standard deviation of its position along each horizontal direction, m; for `flux`.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub position_sd_m: f64,
    /// Emission of the gas, kg/s; where it changes, in the mean of its table's time, which it scales.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission_kg_s: Option<f64>,
    /// File of the emission over time: `time_s`, `emission_kg_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission_series: Option<String>,
    /// The same in place: rows of time since the mission's start, s, and emission, kg/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission_table: Option<Vec<[f64; 2]>>,
    /// What holds between two rows; steps where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission_between: Option<Between>,
    /// Concentration above background on the axis at `c_max_distance_m`, ppm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub c_max_ppm: Option<f64>,
    /// Distance downwind at which `c_max_ppm` holds, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub c_max_distance_m: Option<f64>,
}

impl SourceTable {
    /// Height of the plume's axis above ground, m.
    pub fn axis_height_agl_m(&self) -> f64 {
        self.effective_height_m.unwrap_or(self.stack_height_m)
    }

    /// The ground that emits; none for a stack.
    pub fn area(&self) -> Option<AreaSpec> {
        (self.shape == SourceShape::Area).then(|| AreaSpec {
            outline: self.outline.unwrap_or_default(),
            length_m: self.length_m.unwrap_or_default(),
            width_m: self.width_m.unwrap_or_default(),
            axis_deg: self.axis_deg.unwrap_or_default(),
        })
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn default_source_name() -> String {
    "stack".to_owned()
}

fn default_gas() -> Gas {
    Gas::Co2
}

/// `[plume]`: how the plume spreads beyond its stability class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct PlumeTable {
    /// Factor on the class's lateral spread.
    pub sigma_y_scale: f64,
    /// Factor on the class's vertical spread.
    pub sigma_z_scale: f64,
    /// Whether the ground reflects the plume.
    pub ground_reflection: bool,
}

impl Default for PlumeTable {
    fn default() -> Self {
        Self {
            sigma_y_scale: 1.0,
            sigma_z_scale: 1.0,
            ground_reflection: false,
        }
    }
}

/// `[[gas]]`: a gas that the table of [`Gas`] does not have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct GasDefinition {
    /// Its name, as sources, sensors and columns have it.
    pub name: String,
    /// Molar mass, g/mol.
    pub molar_mass_g_mol: f64,
}

impl GasDefinition {
    /// The gas; none where the name cannot be one, or is in the table.
    pub fn gas(&self) -> Option<Gas> {
        Gas::other(&self.name, self.molar_mass_g_mol * 1e-3)
    }
}

/// `[background]`: the air without the sources, `<gas>_ppm` or `<gas>_ppb` of each gas.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct BackgroundTable(pub BTreeMap<String, f64>);

impl BackgroundTable {
    /// Mole fraction of a gas, ppm; its usual one where none is given.
    pub fn ppm(&self, gas: Gas) -> f64 {
        self.given_ppm(gas)
            .unwrap_or_else(|| usual_background_ppm(gas))
    }

    fn given_ppm(&self, gas: Gas) -> Option<f64> {
        let given = |unit: Unit| Some(unit.to_ppm(*self.0.get(gas.column(unit))?));
        Unit::ALL.into_iter().find_map(given)
    }

    /// Sets the mole fraction of a gas, ppm, whatever unit it was given in.
    pub fn set_ppm(&mut self, gas: Gas, ppm: f64) {
        self.0.remove(gas.column(Unit::Ppb));
        self.0.insert(gas.column(Unit::Ppm).to_owned(), ppm);
    }

    /// Writes out what is not given of a gas.
    pub(crate) fn write_out(&mut self, gas: Gas) {
        if self.given_ppm(gas).is_none() {
            self.set_ppm(gas, usual_background_ppm(gas));
        }
    }
}

/// Mole fraction in air far from sources, ppm. CO2, CH4, N2O and SF6: about the global means of NOAA's Global
/// Monitoring Laboratory for 2024 (422 ppm, 1.93 ppm, 338 ppb, 11.8 ppt). The others: of the size that rural air has
/// (Seinfeld and Pandis 2016, chapter 2; H2: Novelli et al. 1999, doi 10.1029/1999JD900788). Of a gas that is not in the
/// table nothing is known: none.
fn usual_background_ppm(gas: Gas) -> f64 {
    match gas {
        Gas::Co2 => 420.0,
        Gas::Ch4 => 1.93,
        Gas::Co => 0.12,
        Gas::So2 | Gas::No2 | Gas::Nh3 => 1e-3,
        Gas::H2s | Gas::Hcl | Gas::C2h2 => 1e-4,
        Gas::Sf6 => 1.2e-5,
        Gas::N2o => 0.338,
        Gas::C2h6 => 1.5e-3,
        Gas::H2 => 0.53,
        Gas::Other(_) => 0.0,
    }
}

/// `[sensor]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct SensorTable {
    /// The gas that it reads; every gas that no other reads where left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gas: Option<Gas>,
    /// Time constant of the first-order lag, s.
    pub time_constant_s: f64,
    /// Standard deviation of white noise on a reading, ppm; as usual for its gas where left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_sd_ppm: Option<f64>,
    /// Factor within which that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_sd_ppm_known_within: Option<f64>,
    /// Standard deviation of the slow wander of the zero, ppm; not known, and not simulated, where left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_sd_ppm: Option<f64>,
    /// Factor within which that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_sd_ppm_known_within: Option<f64>,
    /// Time over which the zero forgets where it was, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_time_s: Option<f64>,
    /// Factor within which that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_time_s_known_within: Option<f64>,
    /// Added to every reading, ppm.
    pub offset_ppm: f64,
    /// Factor on the true value.
    pub gain: f64,
    /// Standard deviation of the gain after calibration.
    pub gain_sd: f64,
    /// Change of the offset with time, ppm/h.
    pub drift_ppm_per_h: f64,
    /// Step of the reading, ppm; 0 for none.
    pub resolution_ppm: f64,
}

impl Default for SensorTable {
    fn default() -> Self {
        Self {
            gas: None,
            time_constant_s: 0.0,
            noise_sd_ppm: None,
            noise_sd_ppm_known_within: None,
            slow_sd_ppm: None,
            slow_sd_ppm_known_within: None,
            slow_time_s: None,
            slow_time_s_known_within: None,
            offset_ppm: 0.0,
            gain: 1.0,
            gain_sd: USUAL_GAIN_SD,
            drift_ppm_per_h: 0.0,
            resolution_ppm: 0.0,
        }
    }
}

impl SensorTable {
    /// Standard deviation of white noise on a reading of `gas`, ppm.
    pub fn noise_sd_ppm(&self, gas: Gas) -> f64 {
        self.noise_sd_ppm.unwrap_or_else(|| usual_noise_sd_ppm(gas))
    }
}

/// Standard deviation of the gain of a sensor that was calibrated with two gases: certified mixtures are stated to 1 or 2 %.
const USUAL_GAIN_SD: f64 = 0.02;

/// Time over which the zero of a sensor forgets where it was, s, where a scenario states the size of its wander alone.
pub const USUAL_SLOW_TIME_S: f64 = 100.0;

/// White noise of a sensor that small aircraft carry, ppm. CO2: infrared, 3 ppm (Reuter et al. 2021, doi
/// 10.5194/amt-14-153-2021). CH4: laser at 1 Hz, 1 ppb (Dooley et al. 2024, doi 10.5194/amt-17-5091-2024), and
/// as much again for what the aircraft does to it. SF6: fast analyser of tracer trials, 10 ppt (Benner and Lamb
/// 1985, doi 10.1175/1520-0426(1985)002<0582:AFRCAF>2.0.CO;2). N2O, C2H6, C2H2 and HCl: lasers of the same kind as for
/// CH4. The others: electrochemical cells, some ppb (Mead et al. 2013, doi 10.1016/j.atmosenv.2012.11.060).
fn usual_noise_sd_ppm(gas: Gas) -> f64 {
    match gas {
        Gas::Co2 => 3.0,
        Gas::Ch4 | Gas::N2o | Gas::C2h6 | Gas::C2h2 | Gas::Hcl => 2e-3,
        Gas::Co | Gas::So2 | Gas::No2 | Gas::Nh3 | Gas::H2s | Gas::H2 | Gas::Other(_) => 5e-3,
        Gas::Sf6 => 1e-5,
    }
}

/// `[sensor]`, or one `[[sensor]]` a gas.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorTables(pub Vec<SensorTable>);

impl Default for SensorTables {
    fn default() -> Self {
        Self(vec![SensorTable::default()])
    }
}

impl SensorTables {
    /// Place of the sensor that reads `gas`: its own, else the one that names no gas.
    pub(crate) fn index(&self, gas: Gas) -> Option<usize> {
        let of = |wanted: Option<Gas>| self.0.iter().position(|s| s.gas == wanted);
        of(Some(gas)).or_else(|| of(None))
    }
}

/// The first sensor, which parsing and [`Scenario::of_gas`] make that of the gas that is read.
impl std::ops::Deref for SensorTables {
    type Target = SensorTable;

    fn deref(&self) -> &SensorTable {
        &self.0[0]
    }
}

impl Serialize for SensorTables {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [one] if one.gas.is_none() => one.serialize(serializer),
            several => several.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for SensorTables {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMore;
        impl<'de> serde::de::Visitor<'de> for OneOrMore {
            type Value = SensorTables;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a table, or a list of tables")
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(
                self,
                map: A,
            ) -> Result<SensorTables, A::Error> {
                let one =
                    SensorTable::deserialize(serde::de::value::MapAccessDeserializer::new(map));
                Ok(SensorTables(vec![one?]))
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(
                self,
                list: A,
            ) -> Result<SensorTables, A::Error> {
                Vec::deserialize(serde::de::value::SeqAccessDeserializer::new(list))
                    .map(SensorTables)
            }
        }
        deserializer.deserialize_any(OneOrMore)
    }
}

/// `[[mechanism]]`: an extension by its id and parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(expecting = "a table")]
pub struct MechanismTable {
    /// Id of the catalogue.
    pub id: String,
    /// Platforms or vehicles to which it applies; all where left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub platforms: Vec<String>,
    /// Parameters by name.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, toml::Value>,
}

/// What a vehicle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VehicleKind {
    /// Flown by Plumage's flight dynamics in the world simulator's world.
    Simulated,
    /// Stands in for a real one: own flight model, own reality, nothing but MAVLink.
    StandIn,
    /// A real aircraft or another simulator behind a MAVLink link.
    Mavlink,
}

/// Which autopilot a `mavlink` vehicle has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AutopilotKind {
    /// ArduPilot's ArduPlane.
    #[default]
    Ardupilot,
    /// PX4 as a fixed wing.
    Px4,
}

/// Whose outer loop flies a real vehicle, from set-points to bank, pitch and throttle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OuterLoopKind {
    /// Its own autopilot's: it is sent places.
    #[default]
    Vehicle,
    /// The one that simulated vehicles have: it is sent attitudes and thrust.
    Plumage,
}

/// `[[vehicle]]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct VehicleTable {
    /// Name, part of its keys on the bus.
    pub id: String,
    /// File of the aircraft, relative to the scenario's.
    #[serde(default = "default_aircraft")]
    pub aircraft: String,
    /// What it is.
    #[serde(default = "default_kind")]
    pub kind: VehicleKind,
    /// Take-off and landing point; beside the others upwind of the site where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home: Option<HomeTable>,
    /// Where a simulated vehicle starts in flight; at its home on the ground where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub airborne: Option<AirborneTable>,
    /// MAVLink address of a `mavlink` vehicle, such as `udpin:0.0.0.0:14550`, or several, over each of which it
    /// is heard.
    #[serde(
        default,
        deserialize_with = "one_or_more",
        serialize_with = "one_or_several",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub link: Vec<String>,
    /// MAVLink system of a `mavlink` vehicle; the one that is heard where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system_id: Option<u8>,
    /// MAVLink component of its autopilot; 1 where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub component_id: Option<u8>,
    /// MAVLink system of the ground station that commands it; 255 where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gcs_system_id: Option<u8>,
    /// The autopilot of a `mavlink` vehicle that is commanded; any other is watched.
    #[serde(default, skip_serializing_if = "is_default")]
    pub autopilot: AutopilotKind,
    /// Whose outer loop flies a vehicle that is not simulated.
    #[serde(default, skip_serializing_if = "is_default")]
    pub outer_loop: OuterLoopKind,
    /// What the readings of a `mavlink` vehicle are called; by the gas' formula where left out.
    #[serde(
        default,
        deserialize_with = "one_or_more",
        serialize_with = "one_or_several",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub gas: Vec<GasTable>,
    /// Whether the bridge may arm the motor of a `mavlink` vehicle; else a person does.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub may_arm: bool,
    /// File with the key shared with a `mavlink` vehicle, 64 hexadecimal digits; frames are then
    /// signed, and unsigned ones refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signing_key: Option<String>,
    /// `HOST:PORT` of a FlightGear that shows this vehicle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flightgear: Option<String>,
}

impl VehicleTable {
    /// Takes away what only a `mavlink` vehicle has.
    pub fn forget_link(&mut self) {
        self.link.clear();
        self.gas.clear();
        (self.system_id, self.component_id, self.gcs_system_id) = (None, None, None);
        self.autopilot = AutopilotKind::default();
        (self.may_arm, self.signing_key) = (false, None);
    }
}

/// `[vehicle.gas]`, or one `[[vehicle.gas]]` a named value: a reading is `scale` times the value, and `offset`
/// more, in ppm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct GasTable {
    /// Name of the NAMED_VALUE_FLOAT.
    pub name: String,
    /// The gas that it tells of; the one that is read where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gas: Option<Gas>,
    /// ppm for 1 of its unit.
    #[serde(default = "one")]
    pub scale: f64,
    /// Added after that, ppm.
    #[serde(default)]
    pub offset: f64,
    /// By which clock it has its time.
    #[serde(default)]
    pub time: GasTime,
    /// MAVLink component that sends it; any of the vehicle's where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub component_id: Option<u8>,
}

/// By which clock a reading has its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GasTime {
    /// That of the vehicle.
    #[default]
    Vehicle,
    /// None that counts: it was read when it comes.
    Arrival,
}

fn one() -> f64 {
    1.0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// One value, or a list of them.
fn one_or_more<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: Deserialize<'de>,
{
    struct OneOrMore<T>(std::marker::PhantomData<T>);
    impl<'de, T: Deserialize<'de>> serde::de::Visitor<'de> for OneOrMore<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("one, or a list of them")
        }

        fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Vec<T>, E> {
            let one = T::deserialize(serde::de::value::StrDeserializer::new(text));
            Ok(vec![one?])
        }

        fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Vec<T>, A::Error> {
            let one = T::deserialize(serde::de::value::MapAccessDeserializer::new(map));
            Ok(vec![one?])
        }

        fn visit_seq<A: serde::de::SeqAccess<'de>>(self, list: A) -> Result<Vec<T>, A::Error> {
            Vec::deserialize(serde::de::value::SeqAccessDeserializer::new(list))
        }
    }
    deserializer.deserialize_any(OneOrMore(std::marker::PhantomData))
}

/// One value without a list around it.
fn one_or_several<S: serde::Serializer, T: Serialize>(
    values: &[T],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match values {
        [one] => one.serialize(serializer),
        several => several.serialize(serializer),
    }
}

fn default_aircraft() -> String {
    BUILT_IN_AIRCRAFT.to_owned()
}

/// The aircraft of a vehicle that names none.
pub const BUILT_IN_AIRCRAFT: &str = "aircraft/x8.toml";

fn default_kind() -> VehicleKind {
    VehicleKind::Simulated
}

fn default_team() -> Vec<VehicleTable> {
    (1..=6)
        .map(|k| VehicleTable {
            id: k.to_string(),
            aircraft: default_aircraft(),
            kind: if k == 6 {
                VehicleKind::StandIn
            } else {
                VehicleKind::Simulated
            },
            home: None,
            airborne: None,
            link: Vec::new(),
            system_id: None,
            component_id: None,
            gcs_system_id: None,
            autopilot: AutopilotKind::default(),
            outer_loop: OuterLoopKind::default(),
            gas: Vec::new(),
            may_arm: false,
            signing_key: None,
            flightgear: None,
        })
        .collect()
}

/// A start in level flight at the team's airspeed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct AirborneTable {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Height, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Direction of the nose, degrees clockwise from north.
    pub heading_deg: f64,
}

/// A take-off and landing point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct HomeTable {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
}

/// `[fence]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct FenceTable {
    /// Corners as `[lat_deg, lon_deg]`; a square of ±5 km around the site where empty.
    pub polygon: Vec<[f64; 2]>,
    /// Lowest height of a setpoint above ground, m: the site's, or that below it.
    pub floor_agl_m: f64,
    /// Highest height of a setpoint above ground, m.
    pub ceiling_agl_m: f64,
    /// Whether floor and ceiling follow the terrain.
    pub follows_terrain: bool,
    /// Ground from which the heights count at which vehicles wait above home, m above mean sea level; where left
    /// out that of the site, or of terrain that is followed the highest near a home.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub home_ground_amsl_m: Option<f64>,
    /// Height above which the fence ends everywhere, m above mean sea level; where left out the ceiling over the
    /// site's ground, or over the highest terrain that is followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top_amsl_m: Option<f64>,
    /// Radius around every stack that no leg may enter, m.
    pub keep_out_radius_m: f64,
    /// Vehicles keep this distance from each other, m, or else …
    pub separation_m: f64,
    /// … this difference in height, m.
    pub separation_height_m: f64,
}

impl Default for FenceTable {
    fn default() -> Self {
        Self {
            polygon: Vec::new(),
            floor_agl_m: 120.0,
            ceiling_agl_m: 900.0,
            follows_terrain: false,
            home_ground_amsl_m: None,
            top_amsl_m: None,
            keep_out_radius_m: 500.0,
            separation_m: 150.0,
            separation_height_m: 30.0,
        }
    }
}

/// `[search]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct SearchTable {
    /// Name of the strategy.
    pub strategy: String,
    /// Promising points in a population.
    pub population: usize,
    /// Differential weight F.
    pub differential_weight: f64,
    /// Crossover rate CR.
    pub crossover: f64,
    /// A vehicle takes a promising point within this angle of its heading, degrees.
    pub cone_deg: f64,
    /// Time between two populations, s.
    pub step_s: f64,
    /// Airspeed of the team, of multirotors their speed over ground, m/s.
    pub airspeed_m_s: f64,
    /// What multirotors fly instead of a search, one after the other and again; none: they search.
    #[serde(
        deserialize_with = "crate::pattern::one_or_several",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub pattern: Vec<crate::pattern::Pattern>,
}

impl Default for SearchTable {
    fn default() -> Self {
        Self {
            strategy: "cs-ea".to_owned(),
            population: 100,
            differential_weight: 0.9,
            crossover: 0.1,
            cone_deg: 45.0,
            step_s: 10.0,
            airspeed_m_s: 18.0,
            pattern: Vec::new(),
        }
    }
}

/// `[record]`
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct RecordTable {
    /// Rate at which states, readings and ambients of each simulated vehicle are recorded, Hz; all of them where left
    /// out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state_hz: Option<f64>,
}

/// `[gap]`: the reality gap in flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table")]
pub struct GapTable {
    /// Whether the squadron controller holds the model against real readings during the mission.
    pub live: bool,
    /// Whether the world simulator takes up what is found.
    pub adopt: bool,
}

impl Default for GapTable {
    fn default() -> Self {
        Self {
            live: true,
            adopt: false,
        }
    }
}
