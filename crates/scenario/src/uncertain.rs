//! Priors of the parameters that a scenario marks as uncertain.

use crate::Scenario;
use crate::check::{Refusal, within};
use plume::{Gas, Unit};

/// A parameter of the base model that may be marked uncertain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Uncertain {
    /// `weather.wind_speed_m_s`
    WindSpeed,
    /// `weather.wind_from_deg`
    WindFrom,
    /// `source.effective_height_m`
    EffectiveHeight,
    /// `source.emission_kg_s`
    Emission,
    /// `source.c_max_ppm`
    CMax,
    /// `background.<gas>_ppm` of the scenario's gas
    Background,
    /// `plume.sigma_y_scale`
    SigmaYScale,
    /// `plume.sigma_z_scale`
    SigmaZScale,
    /// `sensor.time_constant_s`
    SensorTimeConstant,
    /// `sensor.offset_ppm`
    SensorOffset,
    /// `sensor.gain`
    SensorGain,
}

impl Uncertain {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::WindSpeed,
        Self::WindFrom,
        Self::EffectiveHeight,
        Self::Emission,
        Self::CMax,
        Self::Background,
        Self::SigmaYScale,
        Self::SigmaZScale,
        Self::SensorTimeConstant,
        Self::SensorOffset,
        Self::SensorGain,
    ];

    /// The dotted key in `[uncertain]` of a scenario of `gas`.
    pub fn key(self, gas: Gas) -> String {
        let key = match self {
            Self::WindSpeed => "weather.wind_speed_m_s",
            Self::WindFrom => "weather.wind_from_deg",
            Self::EffectiveHeight => "source.effective_height_m",
            Self::Emission => "source.emission_kg_s",
            Self::CMax => "source.c_max_ppm",
            Self::Background => return format!("{BACKGROUND}{}", gas.column(Unit::Ppm)),
            Self::SigmaYScale => "plume.sigma_y_scale",
            Self::SigmaZScale => "plume.sigma_z_scale",
            Self::SensorTimeConstant => "sensor.time_constant_s",
            Self::SensorOffset => "sensor.offset_ppm",
            Self::SensorGain => "sensor.gain",
        };
        key.to_owned()
    }
}

/// Standard deviations of what a scenario does not mark: how far a preliminary flight's estimates are usually off.
pub mod usual {
    /// Direction of the plume's axis, degrees.
    pub const AXIS_SD_DEG: f64 = 10.0;
    /// ln of the strength.
    pub const LN_STRENGTH_SD: f64 = 0.4;
    /// ln of σy and of σz.
    pub const LN_SPREAD_SD: f64 = 0.3;
    /// Time constant of a sensor, s.
    pub const TIME_CONSTANT_SD_S: f64 = 0.5;
    /// Gain of a sensor that is compared with a reference.
    pub const GAIN_SD: f64 = 0.1;
    /// Height of a plume that rises from a stack, m: plume-rise formulas differ by a few tens of metres.
    const RISEN_HEIGHT_SD_M: f64 = 40.0;
    /// The same as a part of the height: a source near the ground is known better.
    const HEIGHT_PART: f64 = 0.3;
    /// Least standard deviation of a height, m: a source at the ground has an extent.
    const LEAST_HEIGHT_SD_M: f64 = 0.5;
    /// Background and zero of a CO2 sensor, ppm, and the noise and background that it has.
    const BACKGROUND_SD_PPM: f64 = 5.0;
    const OFFSET_SD_PPM: f64 = 10.0;
    const NOISE_PPM: f64 = 3.0;
    const BACKGROUND_PPM: f64 = 450.0;

    /// Effective height of a source at `height_agl_m`, m.
    pub fn height_sd_m(height_agl_m: f64) -> f64 {
        (HEIGHT_PART * height_agl_m).clamp(LEAST_HEIGHT_SD_M, RISEN_HEIGHT_SD_M)
    }

    /// The background, ppm, in proportion to that of CO2.
    pub fn background_sd_ppm(noise_sd_ppm: f64, background_ppm: f64) -> f64 {
        BACKGROUND_SD_PPM * scale(noise_sd_ppm, background_ppm)
    }

    /// The offset of a sensor that is compared with a reference, ppm, in proportion to that of CO2.
    pub fn offset_sd_ppm(noise_sd_ppm: f64, background_ppm: f64) -> f64 {
        OFFSET_SD_PPM * scale(noise_sd_ppm, background_ppm)
    }

    /// The noise or the background over that of CO2, whichever is larger. Clean air and a perfect sensor have no size.
    fn scale(noise_sd_ppm: f64, background_ppm: f64) -> f64 {
        let scale = (noise_sd_ppm / NOISE_PPM).max(background_ppm / BACKGROUND_PPM);
        if scale > 0.0 { scale } else { 1.0 }
    }
}

impl crate::Scenario {
    /// The prior standard deviation of `parameter`, if the scenario marks it uncertain.
    pub fn prior_sd(&self, parameter: Uncertain) -> Option<f64> {
        let key = parameter.key(self.gas());
        let stated = self.uncertain.get(&key).copied();
        stated.or_else(|| {
            let ppb = self.uncertain.get(&in_ppb(&key)?)?;
            Some(Unit::Ppb.to_ppm(*ppb))
        })
    }

    /// The same, and the usual standard deviation of what is always corrected and not marked: background, height,
    /// axis, strength, spread and time constant.
    pub fn corrected_sd(&self, parameter: Uncertain) -> Option<f64> {
        let usual = |value: f64| match parameter {
            Uncertain::WindFrom => Some(usual::AXIS_SD_DEG),
            Uncertain::EffectiveHeight => Some(usual::height_sd_m(value)),
            Uncertain::Emission | Uncertain::CMax => Some(usual::LN_STRENGTH_SD * value),
            Uncertain::Background => {
                let noise_sd_ppm = self.sensor().noise_sd_ppm(self.gas());
                Some(usual::background_sd_ppm(noise_sd_ppm, value))
            }
            Uncertain::SigmaYScale | Uncertain::SigmaZScale => Some(usual::LN_SPREAD_SD * value),
            Uncertain::SensorTimeConstant => Some(usual::TIME_CONSTANT_SD_S),
            Uncertain::WindSpeed | Uncertain::SensorOffset | Uncertain::SensorGain => None,
        };
        let usual = || usual(self.value(parameter)?);
        self.prior_sd(parameter).or_else(usual)
    }
}

/// The key of the same background in ppb; none of what is no background.
fn in_ppb(key: &str) -> Option<String> {
    let column = key.strip_prefix(BACKGROUND)?;
    Some(format!("{BACKGROUND}{}ppb", column.strip_suffix("ppm")?))
}

/// Before the name of a background's column.
const BACKGROUND: &str = "background.";

fn is_known(scenario: &Scenario, key: &str) -> bool {
    let background = || scenario.gas_of_column(key.strip_prefix(BACKGROUND)?);
    Uncertain::ALL.iter().any(|u| u.key(Gas::Co2) == key) || background().is_some()
}

pub(crate) fn check(scenario: &Scenario) -> Result<(), Refusal> {
    for (key, &sd) in &scenario.uncertain {
        if !is_known(scenario, key) {
            let known: Vec<String> = Uncertain::ALL.iter().map(|u| u.key(Gas::Co2)).collect();
            return Err(Refusal::new(
                format!("uncertain.{key}"),
                sd,
                format!("one of the keys {}", known.join(", ")),
            ));
        }
        within(
            format!("uncertain.{key}"),
            sd,
            f64::MIN_POSITIVE,
            f64::INFINITY,
            "a positive standard deviation",
        )?;
    }
    Ok(())
}

impl crate::Scenario {
    /// Sets the parameter to `value`, as the scenario's own key has it (degrees into 0 to 360,
    /// amounts not below zero); `source.` keys mean the first source. A strength of the other
    /// form than the source's is left alone.
    pub fn set(&mut self, parameter: Uncertain, value: f64) {
        // A fit's estimate may lie beyond what a scenario accepts: a normal posterior has no ends.
        let amount = value.max(0.0);
        let factor = value.max(f64::MIN_POSITIVE);
        let gas = self.gas();
        let source = &mut self.sources[0];
        match parameter {
            Uncertain::WindSpeed => self.weather.wind_speed_m_s = amount,
            Uncertain::WindFrom => self.weather.wind_from_deg = air::geo::wrap_deg(value),
            Uncertain::EffectiveHeight => source.effective_height_m = Some(amount),
            Uncertain::Emission if source.mean_emission_kg_s().is_some() => {
                source.emission_kg_s = Some(amount)
            }
            Uncertain::CMax if source.c_max_ppm.is_some() => source.c_max_ppm = Some(amount),
            Uncertain::Emission | Uncertain::CMax => {}
            Uncertain::Background => self.background.set_ppm(gas, amount),
            Uncertain::SigmaYScale => self.plume.sigma_y_scale = factor,
            Uncertain::SigmaZScale => self.plume.sigma_z_scale = factor,
            Uncertain::SensorTimeConstant => self.sensor_mut().time_constant_s = amount,
            Uncertain::SensorOffset => self.sensor_mut().offset_ppm = value,
            Uncertain::SensorGain => self.sensor_mut().gain = factor,
        }
    }

    /// Sets the parameter with its standard deviation as the new prior.
    pub fn set_with_sd(&mut self, parameter: Uncertain, value: f64, sd: f64) {
        self.set(parameter, value);
        if sd.is_finite() && sd > 0.0 {
            let key = parameter.key(self.gas());
            if let Some(ppb) = in_ppb(&key) {
                self.uncertain.remove(&ppb);
            }
            self.uncertain.insert(key, sd);
        }
    }

    /// Adds extensions of the plume model to the scenario.
    pub fn extend(&mut self, extension: &[plume::Mechanism]) {
        for mechanism in extension {
            self.mechanisms.push(crate::tables::MechanismTable {
                id: mechanism.id().as_str().to_owned(),
                platforms: mechanism.platforms().to_vec(),
                parameters: mechanism
                    .parameters()
                    .map(|(name, value)| (name.to_owned(), toml::Value::Float(value)))
                    .collect(),
            });
        }
    }
}

impl crate::Scenario {
    /// The scenario's value of the parameter; none for a strength of the other form than the
    /// first source's.
    pub fn value(&self, parameter: Uncertain) -> Option<f64> {
        let source = &self.sources[0];
        match parameter {
            Uncertain::WindSpeed => Some(self.weather.wind_speed_m_s),
            Uncertain::WindFrom => Some(self.weather.wind_from_deg),
            Uncertain::EffectiveHeight => Some(source.axis_height_agl_m()),
            Uncertain::Emission => source.mean_emission_kg_s(),
            Uncertain::CMax => source.c_max_ppm,
            Uncertain::Background => Some(self.background.ppm(self.gas())),
            Uncertain::SigmaYScale => Some(self.plume.sigma_y_scale),
            Uncertain::SigmaZScale => Some(self.plume.sigma_z_scale),
            Uncertain::SensorTimeConstant => Some(self.sensor().time_constant_s),
            Uncertain::SensorOffset => Some(self.sensor().offset_ppm),
            Uncertain::SensorGain => Some(self.sensor().gain),
        }
    }
}
