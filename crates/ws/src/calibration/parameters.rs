//! The unknowns of a calibration, their priors, and the model that their values make.

use air::geo::wrap_deg;
use air::wind::{WindProfile, towards_deg};
use gap::plume::{HELD, LEVELS, Setup, Unknown, at_coordinates, priors_about};
use infer::Prior;
use nalgebra::{DMatrix, DVector};
use plume::{DispersionModel, DispersionSpec, Mechanism, MechanismId, Strength};
use protocol::message::Estimate;
use scenario::uncertain::usual;

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
    /// Factor on the strength that the scenario gives its sources.
    pub strength_factor: Estimate,
}

/// The noise, and the background, of the sensor for which the concentrations below are meant, ppm; of another gas
/// or sensor they are as many times as large, by that of the two which makes them larger.
const NOISE_PPM: f64 = 3.0;
const BACKGROUND_PPM: f64 = 450.0;

/// What is always unknown, with the standard deviation that it has where the scenario marks nothing: how
/// far a preliminary flight's estimates are usually off.
const DEFAULTS: [(MechanismId, f64); 7] = [
    (MechanismId::BackgroundOffset, 5.0),
    (MechanismId::EffectiveHeightOffset, usual::HEIGHT_SD_M),
    (MechanismId::WindDirectionOffset, usual::AXIS_SD_DEG),
    (MechanismId::EmissionScale, usual::LN_STRENGTH_SD),
    (MechanismId::SigmaYScale, usual::LN_SPREAD_SD),
    (MechanismId::SigmaZScale, usual::LN_SPREAD_SD),
    (MechanismId::SensorLag, 0.5),
];
/// The same of a sensor that is held against a reference.
const SENSOR_DEFAULTS: [(MechanismId, f64); 2] = [
    (MechanismId::SensorOffset, 10.0),
    (MechanismId::SensorGain, 0.1),
];

/// The unknowns, in the coordinates of the catalogue of mechanisms.
#[derive(Debug, Clone)]
pub(crate) struct Unknowns {
    list: Vec<Unknown>,
    platforms: Vec<String>,
    /// What the sizes of concentrations above are multiplied by.
    scale: f64,
    /// Whether zeros of single sensors hold what is known of the levels of all.
    levels_held: bool,
    /// Sources that readings showed beside the scenario's; their parameters come after the list.
    added_sources: Vec<Mechanism>,
}

impl Unknowns {
    pub fn new(
        setup: &Setup,
        base: &DispersionSpec,
        platforms: &[String],
        reference: Option<&str>,
    ) -> Self {
        let marked = setup.unknowns();
        let [noise, background] = [
            base.sensor.noise_sd_ppm / NOISE_PPM,
            base.background_ppm / BACKGROUND_PPM,
        ];
        let scale = noise.max(background);
        // Clean air and a perfect sensor say nothing of the size.
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let scaled = |id: MechanismId, sd: f64| {
            let is_ppm = id
                .spec()
                .parameters
                .iter()
                .any(|p| p.unit == "ppm" && p.default.is_none());
            if is_ppm { scale * sd } else { sd }
        };
        let of = |(id, sd): (MechanismId, f64), platform: Option<usize>| {
            let own = marked.iter().find(|u| u.id == id);
            let mean = match id {
                MechanismId::SensorLag => base.sensor.time_constant_s,
                _ => 0.0,
            };
            Unknown {
                platform,
                ..own.copied().unwrap_or(Unknown {
                    id,
                    platform,
                    setting: None,
                    prior: Prior {
                        mean,
                        sd: scaled(id, sd),
                    },
                })
            }
        };
        let mut list: Vec<Unknown> = DEFAULTS.into_iter().map(|d| of(d, None)).collect();
        let others = |k: &usize| reference.is_some_and(|r| platforms[*k] != r);
        for k in (0..platforms.len()).filter(others) {
            list.extend(SENSOR_DEFAULTS.map(|d| of(d, Some(k))));
        }
        for unknown in &marked {
            if list.iter().all(|u| u.id != unknown.id) {
                list.push(*unknown);
            }
        }
        Self {
            list,
            platforms: platforms.to_vec(),
            scale,
            levels_held: false,
            added_sources: Vec::new(),
        }
    }

    /// Other sources beside the scenario's.
    pub fn set_added_sources(&mut self, sources: Vec<Mechanism>) {
        self.added_sources = sources;
    }

    /// Sources beside the scenario's, about which their parameters are unknown.
    pub fn added_sources(&self) -> &[Mechanism] {
        &self.added_sources
    }

    /// The same at these values of the unknowns.
    pub fn added_sources_at(&self, at: &DVector<f64>) -> Vec<Mechanism> {
        let mut rest = &at.as_slice()[self.list.len()..];
        let of = |source: &Mechanism| {
            let (own, after) = rest.split_at(priors_about(source).len());
            rest = after;
            at_coordinates(source, own)
        };
        self.added_sources.iter().map(of).collect()
    }

    /// Zeros and gains of the sensors of a network, in place of what else is unknown of these sensors; a
    /// `reference` has none.
    pub fn set_own(&mut self, mut own: Vec<Unknown>, reference: Option<&str>) {
        let reference = self
            .platforms
            .iter()
            .position(|p| Some(p.as_str()) == reference);
        let is_zero = |u: &&mut Unknown| u.id == MechanismId::SensorOffset;
        if let Some(k) = reference {
            // The reference's zero is the background's.
            let of_reference =
                |u: &&Unknown| u.id == MechanismId::SensorOffset && u.platform == Some(k);
            let zero = own.iter().find(of_reference).map(|u| u.prior);
            let background = self.index(MechanismId::BackgroundOffset, None);
            if let (Some(zero), Some(background)) = (zero, background) {
                self.list[background].prior = zero;
                own.iter_mut()
                    .filter(is_zero)
                    .for_each(|u| u.prior.mean -= zero.mean);
            }
            own.retain(|u| u.platform != Some(k));
        } else if !own.is_empty() {
            self.levels_held = true;
            let held = |u: &&mut Unknown| u.platform.is_none() && LEVELS.contains(&u.id);
            self.list
                .iter_mut()
                .filter(held)
                .for_each(|u| u.prior.sd *= HELD);
        }
        self.list
            .retain(|u| u.platform.is_none() || own.iter().all(|o| o.platform != u.platform));
        self.list.extend(own);
    }

    /// Standard deviation of what a sensor's readings may be off all along beforehand, ppm: background and zero.
    pub fn level_sd(&self) -> f64 {
        let background = self.index(MechanismId::BackgroundOffset, None);
        let background_sd = background.map_or(0.0, |k| self.list[k].prior.sd);
        background_sd.hypot(self.scale * SENSOR_DEFAULTS[0].1)
    }

    /// What is unknown of single sensors, as mechanisms at these values, in the order in which they act.
    pub fn of_sensors(&self, at: &DVector<f64>) -> Vec<Mechanism> {
        let own = self.list.iter().zip(at.iter());
        own.filter_map(|(unknown, x)| {
            let platform = unknown.platform?;
            let value = unknown.id.spec().parameters[0].from_coordinate(*x);
            Some(self.of_sensor(unknown, value, platform))
        })
        .collect()
    }

    fn of_sensor(&self, unknown: &Unknown, value: f64, platform: usize) -> Mechanism {
        let setting = unknown.setting.unwrap_or(f64::NAN);
        Mechanism::from_values(unknown.id, &[value, setting])
            .for_platforms(&self.platforms[platform..=platform])
    }

    /// One more platform, that is not held against a reference.
    pub fn add_platform(&mut self, name: &str) {
        self.platforms.push(name.to_owned());
    }

    /// As a forward model wants them.
    pub fn list(&self) -> &[Unknown] {
        &self.list
    }

    fn priors(&self) -> impl Iterator<Item = Prior> {
        let added = self.added_sources.iter().flat_map(priors_about);
        self.list.iter().map(|u| u.prior).chain(added)
    }

    pub fn prior_mean(&self) -> DVector<f64> {
        DVector::from_vec(self.priors().map(|p| p.mean).collect())
    }

    pub fn prior_sd(&self) -> DVector<f64> {
        DVector::from_vec(self.priors().map(|p| p.sd).collect())
    }

    pub fn index(&self, id: MechanismId, platform: Option<usize>) -> Option<usize> {
        let is = |u: &Unknown| u.id == id && u.platform == platform;
        self.list.iter().position(is)
    }

    /// Value and standard deviation of a mechanism's parameter; of a log-normal one the median and, to first
    /// order, the standard deviation.
    pub fn parameter(
        &self,
        (id, platform): (MechanismId, Option<usize>),
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> Option<Estimate> {
        let k = self.index(id, platform)?;
        let spec = &id.spec().parameters[0];
        let value = spec.from_coordinate(at[k]);
        let is_held = self.levels_held && platform.is_none() && LEVELS.contains(&id);
        let widened = if is_held { 1.0 / HELD } else { 1.0 };
        Some(Estimate {
            value,
            sd: widened * spec.sd_of(value, covariance[(k, k)].sqrt()),
        })
    }

    /// The model at these values, as a scenario has it: in its own numbers, and nothing as a mechanism but
    /// what single sensors have.
    pub fn folded(&self, base: &DispersionSpec, at: &DVector<f64>) -> DispersionSpec {
        use MechanismId as M;
        let mut spec = base.clone();
        let mut factor = 1.0;
        for (unknown, x) in self.list.iter().zip(at.iter()) {
            let v = unknown.id.spec().parameters[0].from_coordinate(*x);
            match (unknown.id, unknown.platform) {
                (M::BackgroundOffset, _) => {
                    spec.background_ppm = (spec.background_ppm + v).max(0.0);
                }
                (M::EffectiveHeightOffset, _) => {
                    for source in &mut spec.sources {
                        source.effective_height_agl_m =
                            (source.effective_height_agl_m + v).max(1.0);
                    }
                }
                (M::WindDirectionOffset, _) => spec.wind = spec.wind.turned(v),
                (M::WindSpeedScale, _) => spec.wind = faster(&spec.wind, v),
                (M::EmissionScale, _) => factor = v,
                (M::SigmaYScale, _) => spec.sigma_y_scale *= v,
                (M::SigmaZScale, _) => spec.sigma_z_scale *= v,
                (M::SensorLag, _) => spec.sensor.time_constant_s = v.max(0.0),
                (M::SensorOffset, None) => spec.sensor.offset_ppm += v,
                (M::SensorGain, None) => spec.sensor.gain *= v,
                (_, Some(p)) => spec.mechanisms.push(self.of_sensor(unknown, v, p)),
                (id, None) => spec.mechanisms.push(Mechanism::from_values(id, &[v])),
            }
        }
        spec.mechanisms.extend(self.added_sources_at(at));
        // A plume at another height is carried by the wind that the scenario has at its own: what is told of
        // an emission is its ratio to the wind.
        let speed = |of: &DispersionSpec, k: usize| {
            spec.wind.speed_at_m_s(of.sources[k].effective_height_agl_m)
        };
        let carried: Vec<f64> = (0..spec.sources.len())
            .map(|k| speed(&spec, k) / speed(base, k))
            .collect();
        for (source, carried) in spec.sources.iter_mut().zip(carried) {
            match &mut source.strength {
                Strength::EmissionKgS(q) if carried.is_finite() => *q *= factor * carried,
                Strength::EmissionKgS(q) => *q *= factor,
                Strength::CMax { excess_ppm, .. } => *excess_ppm *= factor,
            }
        }
        spec
    }

    pub fn calibrated(
        &self,
        base: &DispersionSpec,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> Calibrated {
        use MechanismId as M;
        let of = |id| {
            let none = Estimate {
                value: f64::NAN,
                sd: f64::NAN,
            };
            self.parameter((id, None), at, covariance).unwrap_or(none)
        };
        let from = |value: f64, by: Estimate| Estimate {
            value: value + by.value,
            ..by
        };
        let times = |value: f64, by: Estimate| Estimate {
            value: value * by.value,
            sd: value * by.sd,
        };
        let turn = of(M::WindDirectionOffset);
        let (c_max, c_max_distance_m) = self.c_max(base, at, covariance);
        Calibrated {
            background_ppm: from(base.background_ppm, of(M::BackgroundOffset)),
            effective_height_agl_m: from(
                base.sources[0].effective_height_agl_m,
                of(M::EffectiveHeightOffset),
            ),
            axis_deg: Estimate {
                value: wrap_deg(towards_deg(base.wind.from_deg()) + turn.value),
                sd: turn.sd,
            },
            c_max_ppm: c_max,
            c_max_distance_m,
            sigma_y_scale: times(base.sigma_y_scale, of(M::SigmaYScale)),
            sigma_z_scale: times(base.sigma_z_scale, of(M::SigmaZScale)),
            time_constant_s: of(M::SensorLag),
            strength_factor: of(M::EmissionScale),
        }
    }

    /// c_MAX that states the model's strength at its distance.
    fn c_max(
        &self,
        base: &DispersionSpec,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> (Estimate, f64) {
        let distance_m = base.sources[0].strength.c_max_distance_m();
        let value = |model: &DispersionModel| model.stated_c_max_ppm(distance_m);
        (self.of_model(base, at, covariance, &value), distance_m)
    }

    /// What each source of the sensor's gas emits if `wind_m_s` blows at the reference height.
    pub fn flux(
        &self,
        base: &DispersionSpec,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
        wind_m_s: Estimate,
    ) -> Vec<(String, Estimate)> {
        let of = |(k, name): (usize, String)| {
            let per_m_s = |model: &DispersionModel| {
                let reference_m_s = model.spec().wind.reference_speed_m_s();
                model.emissions_kg_s()[k].1 / reference_m_s.max(f64::MIN_POSITIVE)
            };
            let ratio = self.of_model(base, at, covariance, &per_m_s);
            let kg_s = Estimate {
                value: ratio.value * wind_m_s.value,
                // Of a product of independent factors, to first order.
                sd: (ratio.sd * wind_m_s.value).hypot(ratio.value * wind_m_s.sd),
            };
            let is_read = kg_s.value.is_finite() && kg_s.sd.is_finite();
            is_read.then_some((name, kg_s))
        };
        let names = self.source_names(base, at).into_iter().enumerate();
        names.filter_map(of).collect()
    }

    /// Names of the sources of the sensor's gas.
    pub fn source_names(&self, base: &DispersionSpec, at: &DVector<f64>) -> Vec<String> {
        let model = DispersionModel::new(self.folded(base, at));
        let emissions = model.map_or_else(|_| Vec::new(), |m| m.emissions_kg_s());
        emissions.into_iter().map(|(name, _)| name).collect()
    }

    /// What `value` is of the model at these values, with the standard deviation that the unknowns'
    /// covariance gives it to first order (JCGM 100:2008, equation 13).
    fn of_model(
        &self,
        base: &DispersionSpec,
        at: &DVector<f64>,
        covariance: &DMatrix<f64>,
        value: &dyn Fn(&DispersionModel) -> f64,
    ) -> Estimate {
        // 0 for values that make no model.
        let value = |at: &DVector<f64>| {
            DispersionModel::new(self.folded(base, at)).map_or(0.0, |model| value(&model))
        };
        let here = value(at);
        let slope = DVector::from_fn(at.len(), |k, _| {
            let step = 0.01 * covariance[(k, k)].sqrt();
            if step == 0.0 {
                return 0.0;
            }
            let mut aside = at.clone();
            aside[k] += step;
            (value(&aside) - here) / step
        });
        let variance = (slope.transpose() * covariance * &slope)[(0, 0)];
        Estimate {
            value: here,
            sd: variance.max(0.0).sqrt(),
        }
    }
}

/// A wind that is faster by a factor; as it is where no such wind blows.
fn faster(wind: &WindProfile, factor: f64) -> WindProfile {
    let speed = wind.reference_speed_m_s() * factor;
    let height = wind.reference_height_agl_m();
    WindProfile::new(speed, height, wind.from_deg(), wind.exponent()).unwrap_or(*wind)
}
