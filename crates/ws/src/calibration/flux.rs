//! Emission rates of the sources: by the fit to all readings, by the mass balance of passes, and by both.
//!
//! In unsteady air the fit of single readings hardly determines strength and vertical spread of the mean plume. The plume
//! integrals of passes at several heights do, with an axis that wanders up and down ([`study::pass_rate`]). There rate and
//! σz by the passes, with the scenario's prior of the strength, replace those of the fit. c_MAX, peak and rate of the
//! corrected model all follow from them.

use super::Calibrator;
use air::wind::WindVector;
use nalgebra::{DMatrix, DVector, Vector2};
use plume::curtain::Sample;
use plume::{DispersionModel, DispersionSpec, MechanismId, SourceSpec};
use protocol::message::{Estimate, Flux, FluxMethod};
use study::Interval;
use study::combine::{AGREEMENT_P, agreement_p, of_one_record};
use study::pass_rate::{PassPlume, PassRate, SourcePlume, Weighing, rate_by_passes};

/// A standard deviation of so many times that of the scenario leaves an unknown practically free.
const NOTHING_KNOWN: f64 = 100.0;

impl Calibrator {
    /// The emission rates, kg/s, if the wind at the scenario's reference height is `wind_m_s`. The first one is the answer.
    /// Where fit and mass balance agree, it is the rate of the corrected model if that includes the passes, else the mean of
    /// both methods, with the interval of the narrower one, since both sample the same eddies. Where they disagree, it is
    /// the mass balance of one source, which needs no model of the plume's strength, and the fit of several.
    pub fn fluxes(&self, wind_m_s: Estimate) -> Vec<Flux> {
        let flux = |method, source, kg_s| Flux {
            source,
            method,
            kg_s,
        };
        let by_fit = self.corrected(&self.by_fit).flux(wind_m_s);
        let inferred = by_fit
            .into_iter()
            .map(|(source, kg_s)| flux(FluxMethod::Inference, source, kg_s));
        let Some(passes) = &self.passes else {
            return inferred.collect();
        };
        let faster = wind_m_s.value / self.base.wind.reference_speed_m_s();
        let balance = passes.kg_s(faster, wind_m_s.sd / wind_m_s.value);
        let names = self.corrected(self.in_the_mean()).source_names();
        let names = names.join(Flux::AND);
        let weighed = flux(FluxMethod::MassBalance, names.clone(), estimate(balance));
        match self.combined(balance, wind_m_s) {
            Some(both) => {
                let combined = flux(FluxMethod::Combined, names, both);
                let rest = inferred.chain([weighed]);
                [combined].into_iter().chain(rest).collect()
            }
            // What single sources share of what passes carry, the balance takes from the model.
            None if inferred.len() > 1 => inferred.chain([weighed]).collect(),
            None => [weighed].into_iter().chain(inferred).collect(),
        }
    }

    /// The rate by passes and fit; none where they disagree.
    fn combined(&self, balance: Interval, wind_m_s: Estimate) -> Option<Estimate> {
        let fit = self.in_all(&self.by_fit, wind_m_s)?;
        let both = if !agree(fit, balance) {
            None
        } else if let Some(with_passes) = &self.with_passes {
            self.in_all(with_passes, wind_m_s)
        } else {
            of_one_record(&[fit, balance])
        };
        both.map(estimate)
    }

    /// The emission rate of each source of the sensor's gas by the corrected model, kg/s, with its name. Readings determine
    /// the ratio of emission to wind.
    pub fn flux(&self, wind_m_s: Estimate) -> Vec<(String, Estimate)> {
        self.corrected(self.in_the_mean()).flux(wind_m_s)
    }

    /// The rate of all sources together at these unknowns, kg/s.
    fn in_all(
        &self,
        unknowns: &(DVector<f64>, DMatrix<f64>),
        wind_m_s: Estimate,
    ) -> Option<Interval> {
        let all = self.corrected(unknowns).flux_in_all(wind_m_s);
        let is_known = all.value > 0.0 && all.sd.is_finite();
        is_known.then(|| Interval::of_mean(all.value, all.sd))
    }

    /// The unknowns with rate and vertical spread by the passes. None where the plume does not meander, and where fit and
    /// passes disagree on the rate of several sources.
    pub(super) fn including_passes(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        self.meander?;
        let passes = self.passes.as_ref()?;
        let [strength, spread] = [MechanismId::EmissionScale, MechanismId::SigmaZScale]
            .map(|id| self.unknowns.index(id, None));
        let (strength, spread) = (strength?, spread?);
        let wind_m_s = Estimate {
            value: self.base.wind.reference_speed_m_s(),
            sd: 0.0,
        };
        let fit = self.in_all(&self.by_fit, wind_m_s)?;
        let names = self.corrected(&self.by_fit).source_names();
        if names.len() > 1 && !agree(fit, passes.kg_s(1.0, 0.0)) {
            return None;
        }
        let mut unknowns = self.by_fit.clone();
        let (at, covariance) = (&mut unknowns.0, &mut unknowns.1);
        let prior = (self.unknowns.prior_mean(), self.unknowns.prior_sd());
        for (k, factor) in [(strength, 1.0), (spread, NOTHING_KNOWN)] {
            at[k] = prior.0[k];
            covariance.row_mut(k).fill(0.0);
            covariance.column_mut(k).fill(0.0);
            covariance[(k, k)] = (factor * prior.1[k]).powi(2);
        }
        let (ln_kg_s, slope) = self.corrected(&unknowns).ln_flux()?;
        let (mut at, mut covariance) = unknowns;
        let mut slopes = DMatrix::zeros(2, at.len());
        slopes.set_row(0, &slope.transpose());
        slopes[(1, spread)] = 1.0;
        // Both deviations of σz count from the scenario's.
        let off = Vector2::from(passes.mean) - Vector2::new(ln_kg_s, 0.0);
        let known = &slopes * &covariance * slopes.transpose()
            + DMatrix::from_fn(2, 2, |i, j| passes.covariance[i][j]);
        let gain = &covariance * slopes.transpose() * known.try_inverse()?;
        at += &gain * DVector::from_column_slice(off.as_slice());
        covariance -= &gain * &slopes * &covariance;
        Some((at, 0.5 * (&covariance + covariance.transpose())))
    }

    /// Rate and vertical spread by the passes, above the background of the corrected model, at the scenario's wind speed. None
    /// where too few passes cross the plume. The prior of the height is that of the corrected plume, about which passes
    /// are flown; the prior of the spread is the scenario's.
    pub(super) fn pass_rate(&self) -> Option<PassRate> {
        let base = &self.base;
        let (samples, background_sd_ppm) = self.excess_samples()?;
        let turned = base.wind.turned(self.turn_deg());
        let wind = |height_agl_m: f64| -> WindVector { turned.at(height_agl_m) };
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
        };
        rate_by_passes(&samples, &study::site(base), plume, &wind, weighing)
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

/// Whether two rates agree.
fn agree(a: Interval, b: Interval) -> bool {
    agreement_p(a, b).is_some_and(|p| p >= AGREEMENT_P)
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
