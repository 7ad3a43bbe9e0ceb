//! Values of a scenario that the readings of a mission contradict: slips of a digit, a unit or a sign.
//!
//! A correction starts from the scenario's priors, so a value that is far off may bend all others instead of moving. A
//! mission therefore also compares the scenario with what its readings show without any plume model.

use crate::Scenario;
use crate::uncertain::{Uncertain, usual};
use air::geo::{wrap_deg, wrap_signed_deg};
use air::wind::WindVector;
use formats::number::plus_minus;
use plume::MechanismId;
use serde::Serialize;

/// A posterior that is further from its prior than this, in standard deviations of the prior, contradicts it: by chance one
/// of 16,000 is.
const CONTRADICTS_SD: f64 = 4.0;
/// Readings on which the comparison without a model rests at least: a minute at 1 Hz.
const LEAST_READINGS: u64 = 60;
/// Part of the readings that has to lie above the stated background: the rest may be faults of the sensor.
const NEARLY_ALL: f64 = 0.99;
/// Part of the readings that has to lie below the stated background. Air is cleaner than the background nowhere, and a sensor
/// that fails for a while reads less than half of a mission's readings wrongly.
const MOST: f64 = 0.5;
/// One standard deviation of the wind where vehicles fly about that at the plume's height, degrees and ln of the speed: what
/// veering and the law of the wind with height are off over some 100 m.
const ALOFT_SD_DEG: f64 = 10.0;
const LN_ALOFT_SD: f64 = 0.3;

/// A value with one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Known {
    /// The value.
    pub value: f64,
    /// One standard deviation.
    pub sd: f64,
}

/// A value of the scenario that readings contradict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// Its dotted key.
    pub key: String,
    /// As the scenario has it.
    pub prior: Known,
    /// As readings show it.
    pub posterior: Known,
    /// Both in a sentence.
    pub says: String,
}

/// The model's numbers after a correction, each with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrected {
    /// Background, ppm.
    pub background_ppm: Known,
    /// Height of the first source's axis above ground, m.
    pub effective_height_agl_m: Known,
    /// Direction towards which the axis runs, degrees.
    pub axis_deg: Known,
    /// Strength of the first source in units of the scenario's.
    pub strength: Known,
    /// Scale of σy.
    pub sigma_y_scale: Known,
    /// Scale of σz.
    pub sigma_z_scale: Known,
}

/// What a mission has shown so far, to be compared with its scenario.
#[derive(Debug, Clone)]
pub struct Evidence {
    scenario: Scenario,
    readings: u64,
    above: u64,
    below: u64,
    /// Lowest reading above the stated background and highest below it, ppm.
    lowest_ppm: f64,
    highest_ppm: f64,
    winds: u64,
    wind_sum: WindVector,
    corrected: Option<Corrected>,
    named: Vec<(MechanismId, f64)>,
}

impl Corrected {
    /// From values with their standard deviations in the order of the fields, of which the fourth is c_MAX; `stated_c_max_ppm`
    /// is that of the scenario.
    pub fn new(values: [(f64, f64); 6], stated_c_max_ppm: f64) -> Self {
        let known = values.map(|(value, sd)| Known { value, sd });
        let [
            background_ppm,
            effective_height_agl_m,
            axis_deg,
            c_max,
            sigma_y_scale,
            sigma_z_scale,
        ] = known;
        let strength = Known {
            value: c_max.value / stated_c_max_ppm,
            sd: c_max.sd / stated_c_max_ppm,
        };
        Self {
            background_ppm,
            effective_height_agl_m,
            axis_deg,
            strength,
            sigma_y_scale,
            sigma_z_scale,
        }
    }
}

impl Evidence {
    /// Nothing has been read yet.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            scenario: scenario.clone(),
            readings: 0,
            above: 0,
            below: 0,
            lowest_ppm: f64::INFINITY,
            highest_ppm: f64::NEG_INFINITY,
            winds: 0,
            wind_sum: WindVector {
                east_m_s: 0.0,
                north_m_s: 0.0,
            },
            corrected: None,
            named: Vec::new(),
        }
    }

    /// Takes a reading of a real vehicle, with the wind there, speed in m/s and the direction from which it blows in degrees.
    pub fn read(&mut self, ppm: f64, wind: Option<(f64, f64)>) {
        if ppm.is_finite() {
            let background = self.background();
            let within = CONTRADICTS_SD * background.sd;
            self.readings += 1;
            if ppm > background.value + within {
                self.above += 1;
                self.lowest_ppm = self.lowest_ppm.min(ppm);
            } else if ppm < background.value - within {
                self.below += 1;
                self.highest_ppm = self.highest_ppm.max(ppm);
            }
        }
        let is_known = |(speed, from): &(f64, f64)| speed.is_finite() && from.is_finite();
        if let Some((speed_m_s, from_deg)) = wind.filter(is_known) {
            let wind = WindVector::from_speed_and_direction(speed_m_s, from_deg);
            self.winds += 1;
            self.wind_sum.east_m_s += wind.east_m_s;
            self.wind_sum.north_m_s += wind.north_m_s;
        }
    }

    /// Takes the model as it was corrected last.
    pub fn correct(&mut self, corrected: Corrected) {
        self.corrected = Some(corrected);
    }

    /// Takes the mechanisms that readings have named and the model does not hold, by id and the value of their parameter.
    pub fn name<'a>(&mut self, mechanisms: impl Iterator<Item = (&'a str, f64)>) {
        self.named = mechanisms
            .filter_map(|(id, value)| Some((MechanismId::from_name(id)?, value)))
            .collect();
    }

    /// What the readings contradict, the strongest first.
    pub fn contradictions(&self) -> Vec<Contradiction> {
        let found = self.by_correction().into_iter().chain(self.by_names());
        let mut found: Vec<(f64, Uncertain, Known)> = found
            .chain(self.by_readings())
            .chain(self.by_wind())
            .filter_map(|(key, posterior)| Some((self.off_sd(key, posterior)?, key, posterior)))
            .filter(|(off, ..)| *off > CONTRADICTS_SD)
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut told: Vec<Uncertain> = Vec::new();
        found.retain(|(_, key, _)| {
            !told.contains(key) && {
                told.push(*key);
                true
            }
        });
        found
            .into_iter()
            .filter_map(|(_, key, posterior)| self.contradiction(key, posterior))
            .collect()
    }

    fn contradiction(&self, key: Uncertain, posterior: Known) -> Option<Contradiction> {
        let prior = self.prior(key)?;
        let key = key.key(self.scenario.gas());
        let says = format!(
            "the scenario contradicts the readings: {key} is {}, and they show {}",
            plus_minus(prior.value, prior.sd),
            plus_minus(posterior.value, posterior.sd)
        );
        Some(Contradiction {
            key,
            prior,
            posterior,
            says,
        })
    }

    fn by_correction(&self) -> Vec<(Uncertain, Known)> {
        let Some(c) = &self.corrected else {
            return Vec::new();
        };
        let from_deg = Known {
            value: wrap_deg(c.axis_deg.value + 180.0),
            ..c.axis_deg
        };
        let strength = self.scaled(self.strength_key(), c.strength);
        [
            (Uncertain::Background, Some(c.background_ppm)),
            (Uncertain::EffectiveHeight, Some(c.effective_height_agl_m)),
            (Uncertain::WindFrom, self.has_one_wind().then_some(from_deg)),
            (self.strength_key(), strength),
            (Uncertain::SigmaYScale, Some(c.sigma_y_scale)),
            (Uncertain::SigmaZScale, Some(c.sigma_z_scale)),
        ]
        .into_iter()
        .filter_map(|(key, known)| Some((key, known?)))
        .collect()
    }

    /// What a named mechanism makes of a value, known as well as the analysis that names it asks for.
    fn by_names(&self) -> Vec<(Uncertain, Known)> {
        use MechanismId as M;
        let of = |&(id, value): &(MechanismId, f64)| {
            let by = Known { value, sd: 0.0 };
            let more = |key| {
                Some((
                    key,
                    Known {
                        value: self.scenario.value(key)? + value,
                        sd: 0.0,
                    },
                ))
            };
            let times = |key| Some((key, self.scaled(key, by)?));
            match id {
                M::BackgroundOffset => more(Uncertain::Background),
                M::EffectiveHeightOffset => more(Uncertain::EffectiveHeight),
                M::WindDirectionOffset => more(Uncertain::WindFrom),
                M::EmissionScale => times(self.strength_key()),
                M::SigmaYScale => times(Uncertain::SigmaYScale),
                M::SigmaZScale => times(Uncertain::SigmaZScale),
                _ => None,
            }
        };
        self.named.iter().filter_map(of).collect()
    }

    /// The background that readings show by themselves, where it is not the stated one.
    fn by_readings(&self) -> Option<(Uncertain, Known)> {
        let part = |count: u64| count as f64 / self.readings as f64;
        let sd = self.noise_ppm();
        let value = match () {
            () if self.readings < LEAST_READINGS => None,
            () if part(self.above) > NEARLY_ALL => Some(self.lowest_ppm),
            () if part(self.below) > MOST => Some(self.highest_ppm),
            () => None,
        };
        value.map(|value| (Uncertain::Background, Known { value, sd }))
    }

    /// The mean of the reported winds.
    fn by_wind(&self) -> Vec<(Uncertain, Known)> {
        if self.winds < LEAST_READINGS || !self.has_one_wind() {
            return Vec::new();
        }
        let n = self.winds as f64;
        let mean = WindVector {
            east_m_s: self.wind_sum.east_m_s / n,
            north_m_s: self.wind_sum.north_m_s / n,
        };
        let (speed, from_deg) = (mean.speed_m_s(), mean.from_deg());
        vec![
            (
                Uncertain::WindFrom,
                Known {
                    value: from_deg,
                    sd: ALOFT_SD_DEG,
                },
            ),
            (
                Uncertain::WindSpeed,
                Known {
                    value: speed,
                    sd: LN_ALOFT_SD * speed,
                },
            ),
        ]
    }

    /// Whether the scenario states one wind for the whole mission.
    fn has_one_wind(&self) -> bool {
        let weather = &self.scenario.weather;
        weather.series.is_none() && weather.follow == crate::tables::WindFollows::Scenario
    }

    fn strength_key(&self) -> Uncertain {
        match self.scenario.value(Uncertain::CMax) {
            Some(_) => Uncertain::CMax,
            None => Uncertain::Emission,
        }
    }

    fn scaled(&self, key: Uncertain, by: Known) -> Option<Known> {
        let value = self.scenario.value(key)?;
        Some(Known {
            value: value * by.value,
            sd: value * by.sd,
        })
    }

    fn prior(&self, key: Uncertain) -> Option<Known> {
        let value = self.scenario.value(key)?;
        let usual = || (key == Uncertain::WindSpeed).then_some(usual::LN_SPREAD_SD * value);
        Some(Known {
            value,
            sd: self.scenario.corrected_sd(key).or_else(usual)?,
        })
    }

    /// Background with all that readings of clean air may differ by from it.
    fn background(&self) -> Known {
        let prior = self.prior(Uncertain::Background).unwrap_or(Known {
            value: f64::NAN,
            sd: f64::NAN,
        });
        let zero_sd = self
            .scenario
            .prior_sd(Uncertain::SensorOffset)
            .unwrap_or(0.0);
        Known {
            value: prior.value + self.scenario.sensor().offset_ppm,
            sd: prior.sd.hypot(zero_sd).hypot(self.noise_ppm()),
        }
    }

    fn noise_ppm(&self) -> f64 {
        self.scenario.sensor().noise_sd_ppm(self.scenario.gas())
    }

    /// How far a value is off its prior, in standard deviations of that and of what comparing adds; factors by their
    /// logarithms.
    fn off_sd(&self, key: Uncertain, posterior: Known) -> Option<f64> {
        let prior = self.prior(key)?;
        let off = match key {
            Uncertain::WindFrom => {
                wrap_signed_deg(posterior.value - prior.value) / prior.sd.hypot(posterior.sd)
            }
            Uncertain::WindSpeed
            | Uncertain::Emission
            | Uncertain::CMax
            | Uncertain::SigmaYScale
            | Uncertain::SigmaZScale => {
                let relative = (prior.sd / prior.value).hypot(posterior.sd / posterior.value);
                (posterior.value / prior.value).ln() / relative
            }
            _ => (posterior.value - prior.value) / prior.sd.hypot(posterior.sd),
        };
        Some(off.abs())
    }
}
