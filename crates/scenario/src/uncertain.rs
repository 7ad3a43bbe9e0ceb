//! Priors of the parameters that a scenario marks as uncertain.

use crate::check::{Refusal, within};
use std::collections::BTreeMap;

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
    /// `background.co2_ppm`
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

    /// The dotted key in `[uncertain]`.
    pub fn key(self) -> &'static str {
        match self {
            Self::WindSpeed => "weather.wind_speed_m_s",
            Self::WindFrom => "weather.wind_from_deg",
            Self::EffectiveHeight => "source.effective_height_m",
            Self::Emission => "source.emission_kg_s",
            Self::CMax => "source.c_max_ppm",
            Self::Background => "background.co2_ppm",
            Self::SigmaYScale => "plume.sigma_y_scale",
            Self::SigmaZScale => "plume.sigma_z_scale",
            Self::SensorTimeConstant => "sensor.time_constant_s",
            Self::SensorOffset => "sensor.offset_ppm",
            Self::SensorGain => "sensor.gain",
        }
    }
}

impl crate::Scenario {
    /// The prior standard deviation of `parameter`, if the scenario marks it uncertain.
    pub fn prior_sd(&self, parameter: Uncertain) -> Option<f64> {
        self.uncertain.get(parameter.key()).copied()
    }
}

pub(crate) fn check(uncertain: &BTreeMap<String, f64>) -> Result<(), Refusal> {
    for (key, &sd) in uncertain {
        if !Uncertain::ALL.iter().any(|u| u.key() == key) {
            let known: Vec<&str> = Uncertain::ALL.iter().map(|u| u.key()).collect();
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
