//! What the sources emit: by the corrected model, by the balance of mass of passes, and by both.

use super::Calibrator;
use air::wind::WindVector;
use plume::curtain::Sample;
use plume::{DispersionModel, DispersionSpec, MechanismId, SourceSpec};
use protocol::message::{Estimate, Flux, FluxMethod};
use study::Interval;
use study::combine::{AGREEMENT_P, agreement_p, of_one_record};
use study::pass_rate::{PassPlume, SourcePlume, Weighing, rate_by_passes};

impl Calibrator {
    /// What the sources emit, kg/s, if the wind at the scenario's reference height is `wind_m_s`: first what stands for the
    /// answer. Where corrected model and balance of mass agree that is their mean, with the interval of the narrower one,
    /// since both read the same eddies; else, of one source, the balance, which needs no model of the plume's strength.
    pub fn fluxes(&self, wind_m_s: Estimate) -> Vec<Flux> {
        let flux = |method, source, kg_s| Flux {
            source,
            method,
            kg_s,
        };
        let inferred = self.flux(wind_m_s);
        let inferred = inferred
            .into_iter()
            .map(|(source, kg_s)| flux(FluxMethod::Inference, source, kg_s));
        let Some((source, balance)) = self.balance(wind_m_s) else {
            return inferred.collect();
        };
        let weighed = flux(FluxMethod::MassBalance, source.clone(), estimate(balance));
        let all = self.inferred_in_all(wind_m_s);
        let agrees = |all: &Interval| agreement_p(*all, balance).is_some_and(|p| p >= AGREEMENT_P);
        match all
            .filter(agrees)
            .and_then(|all| of_one_record(&[all, balance]))
        {
            Some(both) => {
                let combined = flux(FluxMethod::Combined, source, estimate(both));
                let rest = inferred.chain([weighed]);
                [combined].into_iter().chain(rest).collect()
            }
            // What single sources share of what passes carry, the balance takes from the model.
            None if inferred.len() > 1 => inferred.chain([weighed]).collect(),
            None => [weighed].into_iter().chain(inferred).collect(),
        }
    }

    /// What each source of the sensor's gas emits, kg/s, by name: readings tell the ratio of emission to wind.
    pub fn flux(&self, wind_m_s: Estimate) -> Vec<(String, Estimate)> {
        let (at, covariance) = &self.in_the_mean;
        self.unknowns.flux(&self.base, at, covariance, wind_m_s)
    }

    /// What they emit together.
    fn inferred_in_all(&self, wind_m_s: Estimate) -> Option<Interval> {
        let (at, covariance) = &self.in_the_mean;
        let all = self
            .unknowns
            .flux_in_all(&self.base, at, covariance, wind_m_s);
        let is_known = all.value > 0.0 && all.sd.is_finite();
        is_known.then(|| Interval::of_mean(all.value, all.sd))
    }

    /// What all sources emit together, kg/s, by the passes that were flown, above the background of the corrected model;
    /// none where too few cross the plume. Their height begins where the corrected plume has it: passes are laid about that.
    fn balance(&self, wind_m_s: Estimate) -> Option<(String, Interval)> {
        let base = &self.base;
        let (samples, background_sd_ppm) = self.excess_samples()?;
        let reference = base.wind.turned(self.turn_deg());
        let faster = wind_m_s.value / reference.reference_speed_m_s();
        let wind = |height_agl_m: f64| {
            let speed = faster * reference.speed_at_m_s(height_agl_m);
            WindVector::from_speed_and_direction(speed, reference.from_deg())
        };
        let model = DispersionModel::new(base.clone()).ok()?;
        let plume = PassPlume {
            sources: &self.source_plumes()?,
            axis_sd_m: self.prior_sd_of(MechanismId::EffectiveHeightOffset)?,
            sigma_z_m: &|distance_m| model.sigmas_m(distance_m).1,
            sigma_z_ln_sd: self.prior_sd_of(MechanismId::SigmaZScale)?,
            reflects: base.ground_reflection,
        };
        let weighing = Weighing {
            noise_sd_ppm: noise_sd_ppm(base),
            background_sd_ppm,
            wind_ln_sd: wind_m_s.sd / wind_m_s.value,
        };
        let kg_s = rate_by_passes(&samples, &study::site(base), plume, &wind, weighing)?;
        let names = self.unknowns.source_names(base, &self.in_the_mean.0);
        Some((names.join(Flux::AND), kg_s))
    }

    /// The plumes of the scenario's sources at their corrected heights, with the shares of the corrected model. One that was
    /// found beside them counts as the first.
    fn source_plumes(&self) -> Option<Vec<SourcePlume>> {
        let spec = self.corrected_spec();
        let model = DispersionModel::new(spec.clone()).ok()?;
        let emissions = model.emissions_kg_s();
        let all: f64 = emissions.iter().map(|e| e.1).sum();
        let own = |name: &str| emissions.iter().find(|e| e.0 == name).map_or(0.0, |e| e.1);
        let downwind = spec.wind.at(spec.wind.reference_height_agl_m());
        let first = spec.sources[0].place;
        let plume = |source: &SourceSpec| {
            let (east_m, north_m) = (
                source.place.east_m - first.east_m,
                source.place.north_m - first.north_m,
            );
            let along = east_m * downwind.east_m_s + north_m * downwind.north_m_s;
            SourcePlume {
                share: own(&source.name) / all,
                axis_agl_m: source.effective_height_agl_m,
                downwind_m: along / downwind.speed_m_s(),
            }
        };
        let mut plumes: Vec<SourcePlume> = spec.sources.iter().map(plume).collect();
        plumes[0].share += 1.0 - plumes.iter().map(|p| p.share).sum::<f64>();
        plumes.iter().all(|p| p.share.is_finite()).then_some(plumes)
    }

    fn prior_sd_of(&self, id: MechanismId) -> Option<f64> {
        let k = self.unknowns.index(id, None)?;
        Some(self.unknowns.prior_sd()[k])
    }

    /// The readings above what each sensor reads in clean air, and one standard deviation of that. Vehicles turn where the
    /// plume ends, so that passes do not show it themselves.
    fn excess_samples(&self) -> Option<(Vec<Sample>, f64)> {
        let model = DispersionModel::new(self.latest_spec()).ok()?;
        let background = self.calibrated().background_ppm;
        let clean = |platform: usize| {
            self.zero_ppm(platform).unwrap_or(Estimate {
                value: background.value + self.base.sensor.offset_ppm,
                ..background
            })
        };
        let zeros: Vec<Estimate> = (0..self.observations.platforms.len()).map(clean).collect();
        let sd_ppm = zeros.iter().fold(0.0, |sd, zero| zero.sd.max(sd));
        let excess = |sample: Sample| {
            let offset_ppm = zeros[sample.platform].value - background.value;
            let clean_ppm = model.background_ppm(&sample.place, sample.time_s) + offset_ppm;
            Sample {
                ppm: sample.ppm - clean_ppm,
                ..sample
            }
        };
        let samples = study::samples(&self.setup.frame, &self.observations);
        Some((samples.into_iter().map(excess).collect(), sd_ppm))
    }
}

/// White noise of a reading with what rounding adds, ppm: that of a resolution r is uniform, r/√12.
fn noise_sd_ppm(base: &DispersionSpec) -> f64 {
    base.sensor
        .noise_sd_ppm
        .hypot(base.sensor.resolution_ppm / 12.0_f64.sqrt())
}

/// Median and standard deviation, of which [`Interval::of_mean`] makes the interval again.
fn estimate(of: Interval) -> Estimate {
    Estimate {
        value: of.value,
        sd: of.value * of.relative_sd(),
    }
}
