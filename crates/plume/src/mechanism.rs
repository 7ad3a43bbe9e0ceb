//! Mechanisms: the named extensions of a model and of a sensor, with their parameters, units,
//! neutral values, physical priors and sign conventions.
//!
//! A model is a base plus a list of mechanisms. Two of the same kind add up (offsets add,
//! factors multiply). What is known of each, and what it does, stands in the file of its family.

mod background;
mod entry;
mod sensor;
mod source;
mod spread;
mod wind;

pub(crate) use entry::Action;
pub use entry::{Coordinate, Family, MechanismSpec, ParameterSpec, Steps};

use crate::effects::{DispersionEffects, SensorEffects};
use crate::{PlumeError, in_range};

macro_rules! mechanisms {
    ($($(#[$doc:meta])* $name:ident = $entry:path,)*) => {
        /// A mechanism of the plume, source, background or sensor families.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum MechanismId { $($(#[$doc])* $name,)* }

        impl MechanismId {
            /// All ids in the catalogue's order.
            pub const ALL: &'static [MechanismId] = &[$(MechanismId::$name,)*];
        }

        /// What is known of each, in the order of the ids.
        static CATALOGUE: &[MechanismSpec] = &[$($entry,)*];
    };
}

mechanisms! {
    /// Transport direction differs from the logged one by a constant.
    WindDirectionOffset = wind::DIRECTION_OFFSET,
    /// Transport direction departs from the logged one steadily in time.
    WindDirectionDrift = wind::DIRECTION_DRIFT,
    /// Wind speed differs by a factor.
    WindSpeedScale = wind::SPEED_SCALE,
    /// Transport direction turns with height.
    WindVeerWithHeight = wind::VEER_WITH_HEIGHT,
    /// Slow swinging of the plume widens its mean.
    Meander = wind::MEANDER,
    /// Another stability class.
    StabilityClass = spread::STABILITY_CLASS,
    /// σy by a factor.
    SigmaYScale = spread::SIGMA_Y_SCALE,
    /// σz by a factor.
    SigmaZScale = spread::SIGMA_Z_SCALE,
    /// σz by a power of distance.
    SigmaZGrowth = spread::SIGMA_Z_GROWTH,
    /// Another effective height.
    EffectiveHeightOffset = spread::EFFECTIVE_HEIGHT_OFFSET,
    /// The ground sends the plume back.
    GroundReflection = spread::GROUND_REFLECTION,
    /// A lid above the plume sends it back.
    MixingLid = spread::MIXING_LID,
    /// Emission by a factor.
    EmissionScale = source::EMISSION_SCALE,
    /// Emission changes steadily in time.
    EmissionTrend = source::EMISSION_TREND,
    /// A source that the scenario does not have.
    SecondSource = source::SECOND_SOURCE,
    /// The source stands elsewhere.
    SourcePositionOffset = source::SOURCE_POSITION_OFFSET,
    /// The gas decays at a constant rate.
    FirstOrderDecay = source::FIRST_ORDER_DECAY,
    /// The gas is lost at the ground.
    DryDeposition = source::DRY_DEPOSITION,
    /// A building's wake spreads the plume at its start.
    BuildingDownwash = source::BUILDING_DOWNWASH,
    /// Another background.
    BackgroundOffset = background::OFFSET,
    /// The background changes steadily in time.
    BackgroundDrift = background::DRIFT,
    /// The background changes steadily over the map.
    BackgroundGradient = background::GRADIENT,
    /// The sensor answers with a first-order lag.
    SensorLag = sensor::LAG,
    /// The sensor's slope is wrong.
    SensorGain = sensor::GAIN,
    /// The sensor reads a constant too much.
    SensorOffset = sensor::OFFSET,
    /// The sensor's zero wanders steadily in time.
    SensorDrift = sensor::DRIFT,
    /// The sensor reads no more than a limit.
    SensorSaturation = sensor::SATURATION,
    /// The reading depends on relative humidity.
    CrossSensitivityHumidity = sensor::CROSS_SENSITIVITY_HUMIDITY,
    /// The reading depends on temperature.
    CrossSensitivityTemperature = sensor::CROSS_SENSITIVITY_TEMPERATURE,
    /// The reading depends on pressure.
    CrossSensitivityPressure = sensor::CROSS_SENSITIVITY_PRESSURE,
    /// The gas log's clock is off.
    ClockOffset = sensor::CLOCK_OFFSET,
    /// The logged position is off.
    PositionOffset = sensor::POSITION_OFFSET,
    /// The logged height is off.
    AltitudeOffset = sensor::ALTITUDE_OFFSET,
}

impl MechanismId {
    /// The id in files, such as "sensor-lag".
    pub fn as_str(self) -> &'static str {
        self.spec().name
    }

    /// The id of a name such as "sensor-lag".
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|id| id.as_str() == name.trim())
    }

    /// Its entry in the catalogue.
    pub fn spec(self) -> &'static MechanismSpec {
        &CATALOGUE[self as usize]
    }
}

/// Most parameters of one mechanism.
const MAX_PARAMETERS: usize = 4;

/// A mechanism with its parameters, and the platforms it applies to.
#[derive(Debug, Clone, PartialEq)]
pub struct Mechanism {
    id: MechanismId,
    values: [f64; MAX_PARAMETERS],
    platforms: Vec<String>,
}

impl Mechanism {
    /// A mechanism of every platform, from an id and parameters by name.
    ///
    /// # Errors
    /// An unknown id, an unknown, missing or out-of-range parameter.
    pub fn new(id: &str, parameters: &[(&str, f64)]) -> Result<Self, PlumeError> {
        let id = MechanismId::from_name(id).ok_or_else(|| PlumeError::UnknownMechanism {
            id: id.to_string(),
            known: join(MechanismId::ALL.iter().map(|known| known.as_str())),
        })?;
        let spec = id.spec();
        let mut values = [f64::NAN; MAX_PARAMETERS];
        for &(name, value) in parameters {
            let position = spec.parameters.iter().position(|p| p.name == name);
            let Some(position) = position else {
                return Err(PlumeError::UnknownParameter {
                    id: id.as_str(),
                    name: name.to_string(),
                    known: join(spec.parameters.iter().map(|p| p.name)),
                });
            };
            let p = &spec.parameters[position];
            let what = format!("{}.{}, {}", id.as_str(), name, p.unit);
            values[position] = in_range(&what, value, p.low, p.high)?;
        }
        for (value, p) in values.iter_mut().zip(spec.parameters) {
            if value.is_nan() {
                *value = p.default.ok_or(PlumeError::MissingParameter {
                    id: id.as_str(),
                    name: p.name,
                    unit: p.unit,
                })?;
            }
        }
        Ok(Self {
            id,
            values,
            platforms: Vec::new(),
        })
    }

    /// A mechanism from its parameters in the catalogue's order, each brought into its range;
    /// values left out at the end take their default or neutral value. For fits.
    pub fn from_values(id: MechanismId, values: &[f64]) -> Self {
        let mut kept = [f64::NAN; MAX_PARAMETERS];
        for (i, p) in id.spec().parameters.iter().enumerate() {
            let value = values.get(i).copied().filter(|v| !v.is_nan());
            let value = value.or(p.default).unwrap_or(p.neutral);
            kept[i] = value.clamp(p.low, p.high);
        }
        Self {
            id,
            values: kept,
            platforms: Vec::new(),
        }
    }

    /// The same for these platforms only (by id); only sensors differ between platforms.
    #[must_use]
    pub fn for_platforms(mut self, platforms: &[String]) -> Self {
        if self.id.spec().family == Family::Sensor {
            self.platforms = platforms.to_vec();
        }
        self
    }

    /// Its id.
    pub fn id(&self) -> MechanismId {
        self.id
    }

    /// Parameters in the catalogue's order.
    pub fn values(&self) -> &[f64] {
        &self.values[..self.id.spec().parameters.len()]
    }

    /// A parameter by name.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let position = self
            .id
            .spec()
            .parameters
            .iter()
            .position(|p| p.name == name)?;
        Some(self.values[position])
    }

    /// Name and value of every parameter.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.id
            .spec()
            .parameters
            .iter()
            .map(|p| p.name)
            .zip(self.values.iter().copied())
    }

    /// The platforms it applies to; empty means all.
    pub fn platforms(&self) -> &[String] {
        &self.platforms
    }

    /// Whether it acts on the sensor of `platform`.
    pub fn applies_to(&self, platform: &str) -> bool {
        self.platforms.is_empty() || self.platforms.iter().any(|p| p == platform)
    }
}

impl DispersionEffects {
    /// The joint effect of all mechanisms of dispersion in `list`; those of sensors are passed over.
    pub fn of(list: &[Mechanism]) -> Self {
        let mut sum = Self::none();
        for mechanism in list {
            if let Action::OnDispersion(add) = mechanism.id().spec().action {
                add(&mut sum, mechanism.values());
            }
        }
        sum
    }
}

impl SensorEffects {
    /// Adds the mechanisms of `list` that apply to `platform`; those of dispersion are passed
    /// over. Affine ones act one after the other, in the order of the list.
    pub(crate) fn with(mut self, list: &[Mechanism], platform: &str) -> Self {
        for mechanism in list.iter().filter(|m| m.applies_to(platform)) {
            if let Action::OnSensor(add) = mechanism.id().spec().action {
                add(&mut self, mechanism.values());
            }
        }
        self
    }
}

fn join<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_whole() {
        for id in MechanismId::ALL {
            let spec = id.spec();
            assert_eq!(MechanismId::from_name(spec.name), Some(*id));
            assert!(spec.parameters.len() <= MAX_PARAMETERS);
            let on_sensor = matches!(spec.action, Action::OnSensor(_));
            assert_eq!(on_sensor, spec.family == Family::Sensor, "{}", spec.name);
            for p in spec.parameters {
                assert!(
                    p.low < p.high && p.prior_sd > 0.0,
                    "{} {}",
                    id.as_str(),
                    p.name
                );
                assert!(p.prior_centre >= p.low && p.prior_centre <= p.high);
            }
        }
    }

    #[test]
    fn the_manual_has_the_same_table() {
        let manual = include_str!("../../../docs/mechanisms.md");
        for spec in CATALOGUE {
            let start = format!("| `{}` |", spec.name);
            let rows: Vec<&str> = manual.lines().filter(|l| l.starts_with(&start)).collect();
            let row = manual_row(spec);
            assert_eq!(
                rows,
                [&row],
                "docs/mechanisms.md should have one such row:\n{row}"
            );
        }
    }

    fn manual_row(spec: &MechanismSpec) -> String {
        let list = |f: &dyn Fn(&ParameterSpec) -> String| {
            spec.parameters.iter().map(f).collect::<Vec<_>>().join(", ")
        };
        format!(
            "| `{}` | {} | {} | {} | {} | {} |",
            spec.name,
            spec.family.as_str(),
            list(&|p| format!("`{}`", p.name)),
            list(&|p| p.unit.to_string()),
            list(&|p| match p.default {
                Some(default) => format!("default {default}"),
                None if p.neutral.is_infinite() => "none".to_string(),
                None => format!("{}", p.neutral),
            }),
            spec.sign,
        )
    }

    #[test]
    fn errors_name_what_would_be_right() {
        let error = |id, p: &[(&str, f64)]| Mechanism::new(id, p).unwrap_err().to_string();
        assert!(error("sensor-log", &[]).contains("sensor-lag"));
        assert!(error("sensor-lag", &[("tau", 2.0)]).contains("time_constant_s"));
        assert!(error("sensor-lag", &[]).contains("time_constant_s"));
        assert!(error("sensor-lag", &[("time_constant_s", -1.0)]).contains("0 to"));
        assert!(error("sensor-lag", &[("time_constant_s", f64::NAN)]).contains("NaN"));
    }

    #[test]
    fn defaults_and_scope() {
        let gain = Mechanism::new("sensor-gain", &[("factor", 1.1)]).unwrap();
        assert_eq!(gain.parameter("pivot_ppm"), Some(0.0));
        assert!(gain.applies_to("3"));
        let gain = gain.for_platforms(&["1".into()]);
        assert!(!gain.applies_to("3") && gain.applies_to("1"));
        let emission = Mechanism::new("emission-scale", &[("factor", 2.0)]).unwrap();
        assert!(emission.for_platforms(&["1".into()]).applies_to("3"));
    }

    proptest::proptest! {
        #[test]
        fn any_numbers_make_a_valid_mechanism(which in 0..MechanismId::ALL.len(), v in proptest::array::uniform4(
            proptest::num::f64::ANY)) {
            let m = Mechanism::from_values(MechanismId::ALL[which], &v);
            for (value, p) in m.values().iter().zip(m.id().spec().parameters) {
                proptest::prop_assert!(*value >= p.low && *value <= p.high);
            }
        }
    }
}
