//! The emission rate of one source from passes at one height, such as those of a car on a road downwind.
//!
//! A pass carries ∫ excess · speed dl through each metre of height at its own; divided by the plume's vertical density
//! there it is a rate. The gas moves from the source to where the pass meets it, so that the logged direction of the wind
//! only tells which ways lie across it. The mean of the passes is the rate, their scatter is that of the turbulence.

use crate::grid::normal_grid;
use crate::tracks::{ALWAYS, mean_wind, samples, site};
use crate::vertical::Vertical;
use crate::{
    GAIN_LN_SD, Interval, LOGGED_SPEED_LN_SD, PassFlux, PlumeFlux, SCENARIO_SPEED_LN_SD,
    StudyError, Term, budget,
};
use air::geo::Enu;
use air::wind::WindVector;
use plume::curtain::{PASS_SCATTER, Pass, RejectedPass, Sample, passes};
use scenario::Scenario;
use scenario::observations::{Observations, checks};

/// Fewest passes: the scatter of two says nothing of turbulence.
const LEAST_PASSES: usize = 3;
/// Passes of one height lie within this, m, as an aircraft holds its height.
const SAME_LEVEL_M: f64 = 15.0;
/// Readings are averaged until the platform has moved so far, m: positions of a vehicle that stands scatter by a few
/// metres, and show no way.
const STEP_M: f64 = 5.0;
/// How many passes the scatter beforehand counts for, as in [`plume::curtain`].
const BEFOREHAND_PASSES: f64 = 3.0;
/// A pass that carries less than this part of the median pass met the edge of the plume, or none.
const LEAST_PART: f64 = 0.05;
const GRID_STEPS: usize = 21;

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
    let transects = Transects {
        vertical: Vertical::new(scenario, &spec),
        logged: mean_wind(&checked, ALWAYS),
        observations: &checked,
    };
    let samples = moving(&samples(&frame, &checked));
    let (passes, rejected) = passes(&samples, &site(&spec), &|h| transects.wind(h));
    one_level(&passes)?;
    let met = transects.met(&passes);
    let used: Vec<&Pass> = met.iter().filter(|m| m.2).map(|m| m.0).collect();
    if used.len() < LEAST_PASSES {
        return Err(StudyError::Refused(format!(
            "{} passes across the wind meet the plume between clean air at both ends; expected {LEAST_PASSES}",
            used.len()
        )));
    }
    let mut flux = transects.flux(&used, scenario.sources[0].position_sd_m);
    flux.passes = listed(&met, &rejected);
    Ok(flux)
}

/// Passes of one height.
fn one_level(passes: &[Pass]) -> Result<(), StudyError> {
    let heights = || passes.iter().map(|p| p.height_agl_m);
    let (low_m, high_m) = (
        heights().fold(f64::INFINITY, f64::min),
        heights().fold(f64::NEG_INFINITY, f64::max),
    );
    if high_m - low_m > SAME_LEVEL_M {
        return Err(StudyError::Refused(format!(
            "passes lie at heights from {low_m:.0} to {high_m:.0} m; expected one height"
        )));
    }
    Ok(())
}

/// What passes are weighed by.
struct Transects<'a> {
    vertical: Vertical<'a>,
    /// Mean wind and mean speed, m/s, of the log.
    logged: Option<(WindVector, f64)>,
    observations: &'a Observations,
}

impl Transects<'_> {
    fn wind(&self, height_agl_m: f64) -> WindVector {
        self.logged
            .map_or_else(|| self.vertical.spec.wind.at(height_agl_m), |w| w.0)
    }

    fn source(&self) -> Enu {
        self.vertical.spec.sources[0].place
    }

    /// The rate of a source at `source` by a pass, kg/s, and its distance there, m; none of a pass without excess.
    fn weigh(&self, pass: &Pass, source: Enu) -> Option<(f64, f64)> {
        let centroid = pass.centroid?;
        let speed_m_s = mean_wind(self.observations, pass.time_s).map_or_else(
            || self.wind(pass.height_agl_m).speed_m_s(),
            |(_, speed)| speed,
        );
        let from_deg = source.bearing_deg(centroid) + 180.0;
        let wind = WindVector::from_speed_and_direction(speed_m_s, from_deg);
        let [east, north] = pass.along_kg_m2;
        let kg_s_m = (east * wind.north_m_s - north * wind.east_m_s).abs();
        let distance_m = source.distance_m(centroid);
        let at = (distance_m, pass.height_agl_m);
        let class = self.vertical.spec.stability;
        let density_1_m = self.vertical.density_1_m(at, class, [0.0; 2]);
        Some((kg_s_m / density_1_m, distance_m))
    }

    /// Passes with their rates, kg/s, and whether they met the plume.
    fn met<'p>(&self, passes: &'p [Pass]) -> Vec<(&'p Pass, f64, bool)> {
        let weighed: Vec<(&Pass, f64)> = passes
            .iter()
            .filter_map(|p| Some((p, self.weigh(p, self.source())?.0)))
            .collect();
        let mut sorted: Vec<f64> = weighed.iter().map(|w| w.1).collect();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        weighed
            .into_iter()
            .map(|(pass, kg_s)| (pass, kg_s, kg_s > LEAST_PART * median))
            .collect()
    }

    /// Mean rate, kg/s, mean distance, m, and all rates of a source at `source`.
    fn mean(&self, passes: &[&Pass], source: Enu) -> (f64, f64, Vec<f64>) {
        let weighed: Vec<(f64, f64)> = passes
            .iter()
            .filter_map(|p| self.weigh(p, source))
            .collect();
        let n = weighed.len() as f64;
        (
            weighed.iter().map(|w| w.0).sum::<f64>() / n,
            weighed.iter().map(|w| w.1).sum::<f64>() / n,
            weighed.iter().map(|w| w.0).collect(),
        )
    }

    fn flux(&self, used: &[&Pass], position_sd_m: f64) -> PlumeFlux {
        let source = self.source();
        let (kg_s, distance_m, rates) = self.mean(used, source);
        let n = used.len() as f64;
        let at = (distance_m, used[0].height_agl_m);
        let seen: f64 = rates.iter().map(|r| (r / kg_s - 1.0).powi(2)).sum();
        let scatter_sq =
            (seen + BEFOREHAND_PASSES * PASS_SCATTER.powi(2)) / (n - 1.0 + BEFOREHAND_PASSES);
        let [sigma_z, height] = self.vertical.variances(at, GRID_STEPS);
        let position = position_variance(position_sd_m, &|east_m, north_m| {
            let moved = Enu::new(source.east_m + east_m, source.north_m + north_m);
            self.mean(used, moved).0.ln()
        });
        let speed_ln_sd = if self.logged.is_some() {
            LOGGED_SPEED_LN_SD
        } else {
            SCENARIO_SPEED_LN_SD
        };
        let terms = [
            (Term::Turbulence, scatter_sq / n),
            (Term::Dispersion, sigma_z),
            (Term::Height, height),
            (Term::WindDirection, position),
            (Term::WindSpeed, speed_ln_sd.powi(2)),
            (Term::Sensor, GAIN_LN_SD.powi(2)),
        ];
        let ln_sd = terms.iter().map(|t| t.1).sum::<f64>().sqrt();
        let there = self.wind(at.1);
        PlumeFlux {
            kg_s: Some(Interval::of_ln_normal(kg_s, ln_sd)),
            budget: budget(&terms),
            distance_m,
            from_deg: there.from_deg(),
            speed_m_s: self.logged.map_or_else(|| there.speed_m_s(), |w| w.1),
            one_class_off_kg_s: self.vertical.one_class_off(at, kg_s),
            notes: vec![format!(
                "{} passes at {:.0} m above ground, each by its plume integral and the class's σz",
                used.len(),
                at.1
            )],
            ..PlumeFlux::default()
        }
    }
}

/// All passes in order of time.
fn listed(met: &[(&Pass, f64, bool)], rejected: &[RejectedPass]) -> Vec<PassFlux> {
    let mut out: Vec<PassFlux> = met
        .iter()
        .map(|(pass, kg_s, used)| PassFlux {
            from_s: pass.time_s[0],
            to_s: pass.time_s[1],
            kg_s: Some(*kg_s),
            distance_m: pass.distance_m,
            used: *used,
            reason: (!used).then(|| "did not meet the plume".to_owned()),
        })
        .collect();
    out.extend(rejected.iter().map(PassFlux::rejected));
    out.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    out
}

/// Variance of ln rate by the place of the source, which is known to `sd_m` in each direction.
fn position_variance(sd_m: f64, ln_rate: &dyn Fn(f64, f64) -> f64) -> f64 {
    if sd_m <= 0.0 {
        return 0.0;
    }
    let along = |east: f64, north: f64| {
        let values: Vec<(f64, f64)> = normal_grid(5)
            .into_iter()
            .map(|(z, w)| (ln_rate(z * sd_m * east, z * sd_m * north), w))
            .collect();
        crate::grid::variance(&values)
    };
    along(1.0, 0.0) + along(0.0, 1.0)
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
