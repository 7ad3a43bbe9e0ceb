//! The emission rate of one source from passes across its plume: those of a car on a road downwind, or of an aircraft at
//! several heights.
//!
//! A pass carries ∫ excess · speed dl through each metre of height at its own; divided by the plume's vertical density
//! there it is a rate. The gas moves from the source to where the pass meets it, so that the logged direction of the wind
//! only tells which ways lie across it. Rate, σz and height of the plume are common to all passes, and the plume's axis
//! wanders up and down meanwhile (`wander.rs`). The posterior of the rate is computed on a grid.

use crate::grid::{mean, normal_grid, weighted_quantile};
use crate::pass_rate::{LEAST_PASSES, Posterior, is_met};
use crate::position;
use crate::profile::DIRECTION_SD_DEG;
use crate::tracks::{ALWAYS, MeanWind, Winds, mean_height_agl_m, samples, site};
use crate::vertical::{MeanPlume, Vertical};
use crate::wander::Crossing;
use crate::{PassFlux, PlumeFlux, StudyError, Term, not_calm};
use air::geo::{Enu, wrap_signed_deg};
use air::wind::WindVector;
use plume::curtain::{CleanAir, Pass, RejectedPass, Sample, covering, passes};
use scenario::Scenario;
use scenario::observations::{Observations, checks};

/// Readings are averaged until the platform has moved so far, m: positions of a vehicle that stands scatter by a few
/// metres, and show no way.
const STEP_M: f64 = 5.0;
/// A pass says something of the rate by itself where the plume's density is at least this part of that on its axis: two
/// standard deviations off.
const LEAST_PART: f64 = 0.135;
/// Steps of the grids of σz and height.
const GRID_STEPS: usize = 13;

/// Estimates the rate of the source of `scenario` from the passes of `observations`.
///
/// # Errors
/// [`StudyError::Refused`] where the observations do not meet the method's conditions; a scenario that describes no
/// world.
pub fn estimate(scenario: &Scenario, observations: &Observations) -> Result<PlumeFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let checked = checks::check(observations, &spec, &frame).observations;
    if spec.sources.len() != 1 {
        let refusal = format!("{} sources; expected one", spec.sources.len());
        return Err(StudyError::Refused(refusal));
    }
    let read = samples(&frame, &checked);
    let samples = moving(&read);
    let averaged = read.len() as f64 / samples.len() as f64;
    let transects = Transects {
        vertical: Vertical::new(scenario, &spec),
        winds: Winds::new((scenario, &spec), &frame, &checked),
        noise_sd_ppm: spec.sensor.noise_sd_ppm / averaged.max(1.0).sqrt(),
    };
    not_calm(
        transects
            .winds
            .at(mean_height_agl_m(&samples), ALWAYS)
            .speed_m_s,
    )?;
    let wind = |height_agl_m: f64| transects.winds.at(height_agl_m, ALWAYS).vector;
    let clean = CleanAir::AtEnds {
        noise_sd_ppm: transects.noise_sd_ppm,
    };
    let (passes, rejected) = passes(&samples, &site(&spec), clean, &wind);
    let is_met = passes.iter().any(|p| transects.is_met(p));
    let used = if is_met {
        let strongest = passes.iter().max_by(|a, b| a.kg_s_m.total_cmp(&b.kg_s_m));
        let towards_deg = strongest.and_then(|p| transects.bearing_deg(p));
        let there = |p: &&Pass| transects.lies_towards(p, towards_deg);
        covering(passes.iter().filter(there).collect())
    } else {
        passes
            .iter()
            .filter(|p| transects.lies_downwind(p))
            .collect()
    };
    if used.len() < LEAST_PASSES {
        let found = used.len();
        return Err(StudyError::Refused(if is_met {
            format!(
                "{found} passes cross the whole plume, with clean air at both ends; expected {LEAST_PASSES}"
            )
        } else {
            format!(
                "no pass meets the plume, and {found} cross the direction in which the wind carries it; expected {LEAST_PASSES} for an upper limit"
            )
        }));
    }
    let mut flux = transects.flux(&used, is_met);
    flux.passes = transects.listed(&passes, &used, &rejected);
    Ok(flux)
}

/// What passes are weighed by.
struct Transects<'a> {
    vertical: Vertical<'a>,
    winds: Winds<'a>,
    /// Noise of the averaged readings.
    noise_sd_ppm: f64,
}

impl Transects<'_> {
    fn source(&self) -> Enu {
        self.vertical.spec.sources[0].place
    }

    fn is_met(&self, pass: &Pass) -> bool {
        is_met(pass, self.noise_sd_ppm)
    }

    /// Whether a pass crosses where the wind carries the plume, and so much to both sides as the vane may be wrong.
    fn lies_downwind(&self, pass: &Pass) -> bool {
        let to_deg = self.winds.at(pass.height_agl_m, ALWAYS).vector.from_deg() + 180.0;
        pass.covers(to_deg, DIRECTION_SD_DEG) && self.lies_towards(pass, Some(to_deg))
    }

    /// Direction of what a pass reads from the source, degrees.
    fn bearing_deg(&self, pass: &Pass) -> Option<f64> {
        Some(self.source().bearing_deg(pass.centroid?))
    }

    /// Whether a pass is on the side of the source to which a direction leads.
    fn lies_towards(&self, pass: &Pass, to_deg: Option<f64>) -> bool {
        let off_deg = self
            .bearing_deg(pass)
            .zip(to_deg)
            .map(|(a, b)| wrap_signed_deg(a - b));
        off_deg.is_none_or(|off| off.abs() < 90.0)
    }

    /// The wind that carried the gas that a pass meets: from when it left the source.
    fn wind_of(&self, pass: &Pass) -> MeanWind {
        let [from_s, to_s] = pass.time_s;
        let mean = self.winds.at(pass.height_agl_m, ALWAYS);
        let travel_s = pass.distance_m / mean.speed_m_s;
        self.winds.at(pass.height_agl_m, [from_s - travel_s, to_s])
    }

    /// What a pass carries if the gas comes from `source`, and its distance there, m.
    fn crossing(&self, pass: &Pass, source: Enu) -> (Crossing, f64) {
        let wind = self.wind_of(pass);
        let meets = pass.centroid.filter(|_| self.is_met(pass));
        let from_deg = meets.map_or(wind.vector.from_deg(), |c| source.bearing_deg(c) + 180.0);
        let carries = WindVector::from_speed_and_direction(wind.speed_m_s, from_deg);
        let [east, north] = pass.along_kg_m2;
        let kg_s_m = (east * carries.north_m_s - north * carries.east_m_s).abs();
        let crossing = Crossing {
            time_s: 0.5 * (pass.time_s[0] + pass.time_s[1]),
            height_agl_m: pass.height_agl_m,
            kg_s_m: kg_s_m.copysign(pass.kg_s_m),
            noise_kg_s_m: pass.noise_kg_s_m_ppm * self.noise_sd_ppm,
        };
        let distance_m = meets.map_or(pass.distance_m, |c| source.distance_m(c));
        (crossing, distance_m.max(STEP_M))
    }

    fn plume(&self, distance_m: f64, off: [f64; 2]) -> MeanPlume {
        let class = self.vertical.spec.stability;
        self.vertical.plume(distance_m, class, off)
    }

    /// The rate by a pass alone, kg/s; none of one beside the plume.
    fn own_kg_s(&self, pass: &Pass) -> Option<f64> {
        let (crossing, distance_m) = self.crossing(pass, self.source());
        let plume = self.plume(distance_m, [0.0; 2]);
        let density_1_m = plume.density_1_m(crossing.height_agl_m);
        let on_axis_1_m = plume.density_1_m(plume.axis_agl_m);
        (density_1_m > LEAST_PART * on_axis_1_m).then(|| crossing.kg_s_m / density_1_m)
    }

    fn flux(&self, used: &[&Pass], is_met: bool) -> PlumeFlux {
        let n = used.len() as f64;
        let height_agl_m = used.iter().map(|p| p.height_agl_m).sum::<f64>() / n;
        let there = self.winds.at(height_agl_m, ALWAYS);
        let distances_m = used.iter().map(|p| self.crossing(p, self.source()).1);
        let mut out = PlumeFlux {
            distance_m: distances_m.sum::<f64>() / n,
            from_deg: there.vector.from_deg(),
            speed_m_s: there.speed_m_s,
            ..PlumeFlux::default()
        };
        let posterior = self.posterior(used, [0.0; 2]);
        if !is_met {
            out.upper_limit_kg_s = Some(upper_limit_kg_s(posterior.ln_rate));
            out.notes.push("the plume was not met".into());
            return out;
        }
        let position_sd_m = self.vertical.position_sd_m;
        let position = position::variance(position_sd_m, out.distance_m, &|displaced| {
            mean(&self.posterior(used, displaced).ln_rate)
        });
        let inside = [
            (Term::Turbulence, posterior.turbulence_variance),
            (Term::Dispersion, posterior.sigma_z_variance),
            (Term::Height, posterior.height_variance),
        ];
        let beside = [
            (Term::SourcePosition, position),
            (Term::WindSpeed, there.speed_ln_sd().powi(2)),
            (Term::Sensor, self.vertical.gain_ln_sd.powi(2)),
        ];
        let rate = out.state(posterior.ln_rate, &inside, &beside);
        let at = (out.distance_m, height_agl_m);
        out.one_class_off_kg_s = self.vertical.one_class_off(at, rate.value);
        out.notes.push(format!(
            "{} passes at {}, each by its plume integral and the class's σz",
            used.len(),
            heights(used)
        ));
        out
    }

    /// The posterior of a source that is displaced by so many metres east and north.
    fn posterior(&self, used: &[&Pass], [east_m, north_m]: [f64; 2]) -> Posterior {
        let stated = self.source();
        let source = Enu::new(stated.east_m + east_m, stated.north_m + north_m);
        let mut seen: Vec<(Crossing, f64)> =
            used.iter().map(|p| self.crossing(p, source)).collect();
        seen.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
        let plume = |distance_m: f64, off: [f64; 2]| vec![(1.0, self.plume(distance_m, off))];
        let grids = [
            normal_grid(GRID_STEPS),
            self.vertical.height_steps(GRID_STEPS),
        ];
        Posterior::of(&seen, &plume, grids)
    }

    /// All passes in order of time.
    fn listed(&self, passes: &[Pass], used: &[&Pass], rejected: &[RejectedPass]) -> Vec<PassFlux> {
        let is_used = |pass: &Pass| used.iter().any(|u| std::ptr::eq(*u, pass));
        let of = |pass: &Pass| {
            let unused = (!is_used(pass)).then_some("does not cross the whole plume");
            PassFlux::of(pass, self.own_kg_s(pass), unused)
        };
        PassFlux::in_order(passes.iter().map(of), rejected)
    }
}

/// The rate that is not exceeded with 95 % probability, if all rates are as probable beforehand.
fn upper_limit_kg_s(mut ln_rate: Vec<(f64, f64)>) -> f64 {
    // The posterior is that of a uniform ln rate.
    for (ln, weight) in &mut ln_rate {
        *weight *= ln.exp();
    }
    weighted_quantile(ln_rate, 0.95).exp()
}

/// Heights of passes in words.
fn heights(passes: &[&Pass]) -> String {
    let of = || passes.iter().map(|p| p.height_agl_m);
    let (low_m, high_m) = (of().fold(f64::INFINITY, f64::min), of().fold(0.0, f64::max));
    if high_m - low_m < STEP_M {
        format!("{high_m:.0} m above ground")
    } else {
        format!("{low_m:.0} to {high_m:.0} m above ground")
    }
}

/// Samples averaged until their platform has moved by [`STEP_M`].
fn moving(samples: &[Sample]) -> Vec<Sample> {
    let mut out = Vec::new();
    let mut first = 0;
    for k in 1..=samples.len() {
        let stays = samples.get(k).is_some_and(|next| {
            let from = &samples[first].place;
            let moved_m =
                (next.place.east_m - from.east_m).hypot(next.place.north_m - from.north_m);
            next.platform == samples[first].platform && moved_m < STEP_M
        });
        if !stays {
            let group = &samples[first..k];
            let n = group.len() as f64;
            let mean = |of: fn(&Sample) -> f64| group.iter().map(of).sum::<f64>() / n;
            out.push(Sample {
                platform: samples[first].platform,
                time_s: mean(|s| s.time_s),
                place: plume::Place {
                    east_m: mean(|s| s.place.east_m),
                    north_m: mean(|s| s.place.north_m),
                    height_agl_m: mean(|s| s.place.height_agl_m),
                },
                ppm: mean(|s| s.ppm),
            });
            first = k;
        }
    }
    out
}
