//! The unknowns of a calibration, their priors, and the model that their values make.

use air::geo::wrap_deg;
use air::wind::towards_deg;
use nalgebra::{DMatrix, DVector};
use plume::{DispersionModel, DispersionSpec, Mechanism, MechanismId, Strength};
use protocol::message::Estimate;
use scenario::Scenario;
use scenario::uncertain::Uncertain;

/// An unknown of the calibration, in the unit in which its prior is normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CalibrationParameter {
    /// Background, ppm.
    Background,
    /// Effective height of the first source, m above ground.
    Height,
    /// Turn of the wind against the scenario's, degrees clockwise.
    Direction,
    /// Natural logarithm of the factor on the first source's strength.
    LnStrength,
    /// Natural logarithm of the σy scale.
    LnSigmaY,
    /// Natural logarithm of the σz scale.
    LnSigmaZ,
    /// Time constant of the sensors, s.
    TimeConstant,
    /// Offset of the sensor of the platform at this index, ppm.
    Offset(usize),
    /// Natural logarithm of the gain of the sensor of the platform at this index.
    LnGain(usize),
}

/// What a calibration found.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// Background CO2, ppm.
    pub background_ppm: Estimate,
    /// Height of the first source's axis, m above ground.
    pub effective_height_agl_m: Estimate,
    /// Direction towards which the axis runs, degrees.
    pub axis_deg: Estimate,
    /// Concentration above background on the axis at `c_max_distance_m`, ppm.
    pub c_max_ppm: Estimate,
    /// Distance at which `c_max_ppm` holds, m.
    pub c_max_distance_m: f64,
    /// Scale of σy.
    pub sigma_y_scale: Estimate,
    /// Scale of σz.
    pub sigma_z_scale: Estimate,
    /// Time constant of the sensors, s.
    pub time_constant_s: Estimate,
    /// Factor on the strength that the scenario gives the first source.
    pub strength_factor: Estimate,
}

// Prior standard deviations where the scenario marks nothing: how far a preliminary flight's
// estimates of these are usually off.
const DEFAULT_SD_HEIGHT_M: f64 = 40.0;
const DEFAULT_SD_DIRECTION_DEG: f64 = 10.0;
const DEFAULT_SD_LN_STRENGTH: f64 = 0.4;
const DEFAULT_SD_LN_SIGMA: f64 = 0.3;
const DEFAULT_SD_BACKGROUND_PPM: f64 = 5.0;
const DEFAULT_SD_TIME_CONSTANT_S: f64 = 0.5;
const DEFAULT_SD_OFFSET_PPM: f64 = 10.0;
const DEFAULT_SD_LN_GAIN: f64 = 0.1;
/// A prior wider than this is flat for all that readings can say.
const WIDEST_SD: f64 = 1e4;

#[derive(Debug, Clone)]
pub(crate) struct Unknowns {
    list: Vec<(CalibrationParameter, f64, f64)>,
    platforms: Vec<String>,
}

impl Unknowns {
    pub fn new(
        scenario: &Scenario,
        base: &DispersionSpec,
        platforms: &[String],
        reference: Option<&str>,
    ) -> Self {
        let sd =
            |key: Uncertain, default: f64| scenario.prior_sd(key).unwrap_or(default).min(WIDEST_SD);
        let source = &base.sources[0];
        let sd_ln_strength = match source.strength {
            Strength::CMax { excess_ppm, .. } => scenario
                .prior_sd(Uncertain::CMax)
                .map(|sd| sd / excess_ppm.max(1e-9)),
            Strength::EmissionKgS(q) => scenario
                .prior_sd(Uncertain::Emission)
                .map(|sd| sd / q.max(1e-9)),
        };
        let ln_scale = |key: Uncertain, scale: f64| {
            scenario
                .prior_sd(key)
                .map_or(DEFAULT_SD_LN_SIGMA, |sd| (sd / scale).min(3.0))
        };
        use CalibrationParameter as P;
        let mut list = vec![
            (
                P::Background,
                base.background_ppm,
                sd(Uncertain::Background, DEFAULT_SD_BACKGROUND_PPM),
            ),
            (
                P::Height,
                source.effective_height_agl_m,
                sd(Uncertain::EffectiveHeight, DEFAULT_SD_HEIGHT_M),
            ),
            (
                P::Direction,
                0.0,
                sd(Uncertain::WindFrom, DEFAULT_SD_DIRECTION_DEG),
            ),
            (
                P::LnStrength,
                0.0,
                sd_ln_strength.unwrap_or(DEFAULT_SD_LN_STRENGTH).min(3.0),
            ),
            (
                P::LnSigmaY,
                base.sigma_y_scale.ln(),
                ln_scale(Uncertain::SigmaYScale, base.sigma_y_scale),
            ),
            (
                P::LnSigmaZ,
                base.sigma_z_scale.ln(),
                ln_scale(Uncertain::SigmaZScale, base.sigma_z_scale),
            ),
            (
                P::TimeConstant,
                base.sensor.time_constant_s,
                sd(Uncertain::SensorTimeConstant, DEFAULT_SD_TIME_CONSTANT_S),
            ),
        ];
        if let Some(reference) = reference {
            for (k, _) in platforms
                .iter()
                .enumerate()
                .filter(|(_, p)| *p != reference)
            {
                list.push((
                    P::Offset(k),
                    0.0,
                    sd(Uncertain::SensorOffset, DEFAULT_SD_OFFSET_PPM),
                ));
                list.push((
                    P::LnGain(k),
                    0.0,
                    sd(Uncertain::SensorGain, DEFAULT_SD_LN_GAIN),
                ));
            }
        }
        Self {
            list,
            platforms: platforms.to_vec(),
        }
    }

    pub fn len(&self) -> usize {
        self.list.len()
    }

    pub fn prior_mean(&self) -> DVector<f64> {
        DVector::from_iterator(self.len(), self.list.iter().map(|u| u.1))
    }

    pub fn prior_sd(&self) -> DVector<f64> {
        DVector::from_iterator(self.len(), self.list.iter().map(|u| u.2))
    }

    pub fn index(&self, parameter: CalibrationParameter) -> Option<usize> {
        self.list.iter().position(|u| u.0 == parameter)
    }

    pub fn value(&self, parameter: CalibrationParameter, at: &DVector<f64>) -> Option<f64> {
        self.index(parameter).map(|k| at[k])
    }

    /// The model at these values, with the turn of the wind as a mechanism, so that it acts on
    /// whatever wind the rows of a track carry.
    pub fn spec(&self, base: &DispersionSpec, at: &[f64]) -> DispersionSpec {
        let mut spec = base.clone();
        for (k, (parameter, _, _)) in self.list.iter().enumerate() {
            let value = at[k];
            match *parameter {
                CalibrationParameter::Background => spec.background_ppm = value.max(0.0),
                CalibrationParameter::Height => {
                    spec.sources[0].effective_height_agl_m = value.max(1.0)
                }
                CalibrationParameter::Direction => {
                    spec.mechanisms.push(Mechanism::from_values(
                        MechanismId::WindDirectionOffset,
                        &[value],
                    ));
                }
                CalibrationParameter::LnStrength => {
                    scale_strength(&mut spec.sources[0].strength, value.exp())
                }
                CalibrationParameter::LnSigmaY => spec.sigma_y_scale = value.exp(),
                CalibrationParameter::LnSigmaZ => spec.sigma_z_scale = value.exp(),
                CalibrationParameter::TimeConstant => spec.sensor.time_constant_s = value.max(0.0),
                CalibrationParameter::Offset(p) => spec.mechanisms.push(
                    Mechanism::from_values(MechanismId::SensorOffset, &[value])
                        .for_platforms(&self.platforms[p..=p]),
                ),
                CalibrationParameter::LnGain(p) => spec.mechanisms.push(
                    Mechanism::from_values(MechanismId::SensorGain, &[value.exp()])
                        .for_platforms(&self.platforms[p..=p]),
                ),
            }
        }
        spec
    }

    /// The model at these values, with the wind itself turned.
    pub fn turned(&self, base: &DispersionSpec, at: &DVector<f64>) -> DispersionSpec {
        let turn_deg = self
            .value(CalibrationParameter::Direction, at)
            .unwrap_or(0.0);
        let mut still = at.clone();
        if let Some(k) = self.index(CalibrationParameter::Direction) {
            still[k] = 0.0;
        }
        let mut spec = self.spec(base, still.as_slice());
        // The mechanism of no turn, added by `spec`, says nothing.
        spec.mechanisms
            .retain(|m| m.id() != MechanismId::WindDirectionOffset || m.values()[0] != 0.0);
        spec.wind = spec.wind.turned(turn_deg);
        spec
    }

    pub fn calibrated(
        &self,
        base: &DispersionSpec,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> Calibrated {
        let linear = |parameter| {
            let k = self.index(parameter);
            k.map_or(
                Estimate {
                    value: f64::NAN,
                    sd: f64::NAN,
                },
                |k| Estimate {
                    value: at[k],
                    sd: covariance[(k, k)].sqrt(),
                },
            )
        };
        // Of a log-normal quantity the median and, to first order, the standard deviation.
        let log = |parameter| {
            let e = linear(parameter);
            Estimate {
                value: e.value.exp(),
                sd: e.value.exp() * e.sd,
            }
        };
        let turn = linear(CalibrationParameter::Direction);
        let (c_max, c_max_distance_m) = self.c_max(base, at, covariance);
        Calibrated {
            background_ppm: linear(CalibrationParameter::Background),
            effective_height_agl_m: linear(CalibrationParameter::Height),
            axis_deg: Estimate {
                value: wrap_deg(towards_deg(base.wind.from_deg()) + turn.value),
                sd: turn.sd,
            },
            c_max_ppm: c_max,
            c_max_distance_m,
            sigma_y_scale: log(CalibrationParameter::LnSigmaY),
            sigma_z_scale: log(CalibrationParameter::LnSigmaZ),
            time_constant_s: linear(CalibrationParameter::TimeConstant),
            strength_factor: log(CalibrationParameter::LnStrength),
        }
    }

    /// c_MAX at its distance: the model's own concentration on the axis there, with the standard
    /// deviation that the unknowns' covariance gives it to first order (JCGM 100:2008, equation 13).
    fn c_max(
        &self,
        base: &DispersionSpec,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> (Estimate, f64) {
        let distance_m = base.sources[0].strength.c_max_distance_m();
        // 0 for values that make no model.
        let value = |at: &DVector<f64>| {
            DispersionModel::new(self.turned(base, at))
                .map_or(0.0, |model| model.axis_excess_ppm(distance_m))
        };
        let here = value(at);
        let slope = DVector::from_fn(self.len(), |k, _| {
            let step = 0.01 * covariance[(k, k)].sqrt();
            if step == 0.0 {
                return 0.0;
            }
            let mut aside = at.clone();
            aside[k] += step;
            (value(&aside) - here) / step
        });
        let variance = (slope.transpose() * covariance * &slope)[(0, 0)];
        (
            Estimate {
                value: here,
                sd: variance.max(0.0).sqrt(),
            },
            distance_m,
        )
    }
}

fn scale_strength(strength: &mut Strength, factor: f64) {
    match strength {
        Strength::EmissionKgS(q) => *q *= factor,
        Strength::CMax { excess_ppm, .. } => *excess_ppm *= factor,
    }
}
