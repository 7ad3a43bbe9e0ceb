//! The unknowns of a calibration, their priors, and the model that their values make.

use air::geo::wrap_deg;
use air::wind::{WindProfile, towards_deg};
use gap::plume::{HELD, Setup, Unknown, at_coordinates, priors_about};
use infer::Prior;
use nalgebra::{DMatrix, DVector};
use plume::{DispersionModel, DispersionSpec, Mechanism, MechanismId, Strength};
use protocol::message::Estimate;

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

/// The unknowns, in the coordinates of the catalogue of mechanisms.
#[derive(Debug, Clone)]
pub(crate) struct Unknowns {
    list: Vec<Unknown>,
    platforms: Vec<String>,
    /// What of the list is held because zeros of single sensors hold what is known of it.
    held: Vec<MechanismId>,
    /// Sources that readings showed beside the scenario's; their parameters come after the list.
    added_sources: Vec<Mechanism>,
}

impl Unknowns {
    /// Those of a setup.
    pub fn new(setup: &Setup, platforms: &[String]) -> Self {
        let mut unknowns = Self {
            list: Vec::new(),
            platforms: platforms.to_vec(),
            held: Vec::new(),
            added_sources: Vec::new(),
        };
        unknowns.set(setup);
        unknowns
    }

    /// Takes those of a setup that holds what readings say before any fit.
    pub fn set(&mut self, setup: &Setup) {
        self.list = setup.unknowns();
        let held = self.list.iter().map(|u| u.id);
        self.held = held.filter(|id| setup.is_held(*id)).collect();
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

    /// Unknowns that no key of a scenario holds, as mechanisms at these values, in the order in which they act: of
    /// single sensors, and the meander.
    pub fn beside_keys(&self, at: &DVector<f64>) -> Vec<Mechanism> {
        let own = self.list.iter().zip(at.iter());
        own.filter_map(|(unknown, x)| {
            let value = unknown.id.spec().parameters[0].from_coordinate(*x);
            match unknown.platform {
                Some(platform) => Some(self.of_sensor(unknown, value, platform)),
                None => (unknown.id == MechanismId::Meander)
                    .then(|| Mechanism::from_values(unknown.id, &[value])),
            }
        })
        .collect()
    }

    fn of_sensor(&self, unknown: &Unknown, value: f64, platform: usize) -> Mechanism {
        let setting = unknown.setting.unwrap_or(f64::NAN);
        Mechanism::from_values(unknown.id, &[value, setting])
            .for_platforms(&self.platforms[platform..=platform])
    }

    /// One more platform, that is not compared with a reference.
    pub fn add_platform(&mut self, name: &str) {
        self.platforms.push(name.to_owned());
    }

    /// Number of unknowns beside those of added sources.
    pub fn stated(&self) -> usize {
        self.list.len()
    }

    pub fn priors(&self) -> impl Iterator<Item = Prior> {
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
}

/// Values of the unknowns about a base, with their covariance.
#[derive(Clone, Copy)]
pub(crate) struct Corrected<'a> {
    pub unknowns: &'a Unknowns,
    pub base: &'a DispersionSpec,
    pub at: &'a DVector<f64>,
    pub covariance: &'a DMatrix<f64>,
}

impl Corrected<'_> {
    /// Value and standard deviation of a mechanism's parameter; of a log-normal one the median and, to first
    /// order, the standard deviation.
    pub fn parameter(&self, id: MechanismId, platform: Option<usize>) -> Option<Estimate> {
        let k = self.unknowns.index(id, platform)?;
        let spec = &id.spec().parameters[0];
        let value = spec.from_coordinate(self.at[k]);
        let is_held = platform.is_none() && self.unknowns.held.contains(&id);
        let widened = if is_held { 1.0 / HELD } else { 1.0 };
        Some(Estimate {
            value,
            sd: widened * spec.sd_of(value, self.covariance[(k, k)].sqrt()),
        })
    }

    /// The model at these values.
    fn model(&self) -> Option<DispersionModel> {
        DispersionModel::new(self.unknowns.folded(self.base, self.at)).ok()
    }

    /// Names of the sources of the sensor's gas.
    pub fn source_names(&self) -> Vec<String> {
        let emissions = self.model().map_or_else(Vec::new, |m| m.emissions_kg_s());
        emissions.into_iter().map(|(name, _)| name).collect()
    }

    /// The corrected parameters.
    pub fn calibrated(&self) -> Calibrated {
        use MechanismId as M;
        let base = self.base;
        let of = |id| self.parameter(id, None).unwrap_or(UNKNOWN);
        let turn = of(M::WindDirectionOffset);
        let (c_max, c_max_distance_m) = self.c_max();
        Calibrated {
            background_ppm: plus(base.background_ppm, of(M::BackgroundOffset)),
            effective_height_agl_m: plus(
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
    fn c_max(&self) -> (Estimate, f64) {
        let distance_m = self.base.sources[0].strength.c_max_distance_m();
        let value = |model: &DispersionModel| model.stated_c_max_ppm(distance_m);
        (self.of_model(&value), distance_m)
    }

    /// What each source of the sensor's gas emits if `wind_m_s` blows at the reference height.
    pub fn flux(&self, wind_m_s: Estimate) -> Vec<(String, Estimate)> {
        let of = |(k, name): (usize, String)| {
            let one = |model: &DispersionModel| model.emissions_kg_s()[k].1;
            let kg_s = in_wind(self.of_model(&per_m_s(one)), wind_m_s);
            let is_read = kg_s.value.is_finite() && kg_s.sd.is_finite();
            is_read.then_some((name, kg_s))
        };
        let names = self.source_names().into_iter().enumerate();
        names.filter_map(of).collect()
    }

    /// The same of all of them together.
    pub fn flux_in_all(&self, wind_m_s: Estimate) -> Estimate {
        let all = |model: &DispersionModel| model.emissions_kg_s().iter().map(|e| e.1).sum();
        in_wind(self.of_model(&per_m_s(all)), wind_m_s)
    }

    /// ln of the emission of all sources, kg/s, in the scenario's wind, and its derivatives by the unknowns.
    pub fn ln_flux(&self) -> Option<(f64, DVector<f64>)> {
        let all = |model: &DispersionModel| model.emissions_kg_s().iter().map(|e| e.1).sum();
        let ln_kg_s = |model: &DispersionModel| {
            (per_m_s(all)(model) * self.base.wind.reference_speed_m_s()).ln()
        };
        let (ln_kg_s, slope) = self.linearised(&ln_kg_s);
        let is_known = ln_kg_s.is_finite() && slope.iter().all(|s| s.is_finite());
        is_known.then_some((ln_kg_s, slope))
    }

    /// What `value` is of the model at these values, with the standard deviation that the unknowns'
    /// covariance gives it to first order (JCGM 100:2008, equation 13).
    fn of_model(&self, value: &dyn Fn(&DispersionModel) -> f64) -> Estimate {
        let (here, slope) = self.linearised(value);
        let variance = (slope.transpose() * self.covariance * &slope)[(0, 0)];
        Estimate {
            value: here,
            sd: variance.max(0.0).sqrt(),
        }
    }

    /// `value` of the model at these unknowns, and its derivatives, by differences over a part of each standard deviation.
    fn linearised(&self, value: &dyn Fn(&DispersionModel) -> f64) -> (f64, DVector<f64>) {
        // 0 for values that make no model.
        let value =
            |at: &DVector<f64>| Corrected { at, ..*self }.model().map_or(0.0, |m| value(&m));
        let here = value(self.at);
        let slope = DVector::from_fn(self.at.len(), |k, _| {
            let step = 0.01 * self.covariance[(k, k)].sqrt();
            if step == 0.0 {
                return 0.0;
            }
            let mut aside = self.at.clone();
            aside[k] += step;
            (value(&aside) - here) / step
        });
        (here, slope)
    }
}

/// Estimate of an unknown quantity.
pub(super) const UNKNOWN: Estimate = Estimate {
    value: f64::NAN,
    sd: f64::NAN,
};

/// `further` with `value` added.
pub(super) fn plus(value: f64, further: Estimate) -> Estimate {
    Estimate {
        value: value + further.value,
        ..further
    }
}

/// `value` times a factor.
pub(super) fn times(value: f64, factor: Estimate) -> Estimate {
    Estimate {
        value: value * factor.value,
        sd: value * factor.sd,
    }
}

/// An emission over the wind at the reference height, kg/s per m/s.
fn per_m_s(kg_s: impl Fn(&DispersionModel) -> f64) -> impl Fn(&DispersionModel) -> f64 {
    move |model| {
        let reference_m_s = model.spec().wind.reference_speed_m_s();
        kg_s(model) / reference_m_s.max(f64::MIN_POSITIVE)
    }
}

/// The product of independent factors, to first order.
fn in_wind(ratio: Estimate, wind_m_s: Estimate) -> Estimate {
    Estimate {
        value: ratio.value * wind_m_s.value,
        sd: (ratio.sd * wind_m_s.value).hypot(ratio.value * wind_m_s.sd),
    }
}

/// A wind that is faster by a factor; as it is where no such wind blows.
fn faster(wind: &WindProfile, factor: f64) -> WindProfile {
    let speed = wind.reference_speed_m_s() * factor;
    let height = wind.reference_height_agl_m();
    WindProfile::new(speed, height, wind.from_deg(), wind.exponent()).unwrap_or(*wind)
}
