//! The models that are tried on the trials of unstable and of stable air, vertical and lateral.

use super::arcs::TrialArcs;
use super::evidence::{self, Datum, Fit, Model};
use super::model::{self, Lateral, PIVOT_M, Prior, Vertical};

/// Standard deviation of ln σ_z from towers: some tens of samplers, and a profile that is not
/// quite normal.
const TOWER_SD: f64 = 0.25;

/// Trials of one kind of air, as data of the vertical and of the lateral question.
pub struct Group<'a> {
    /// The trials.
    pub trials: Vec<&'a TrialArcs>,
    vertical: Vec<evidence::Trial>,
    lateral: Vec<evidence::Trial>,
}

impl<'a> Group<'a> {
    /// The data of `trials`.
    pub fn new(trials: Vec<&'a TrialArcs>) -> Self {
        let log_distance = |x: f64| (x / PIVOT_M).ln();
        let vertical = trials
            .iter()
            .map(|t| {
                let mut data: evidence::Trial = t
                    .arcs
                    .iter()
                    .filter(|a| a.whole)
                    .map(|a| Datum {
                        value: a.integrated_mg_m2.ln(),
                        log_distance: log_distance(a.distance_m),
                        own_sd: None,
                    })
                    .collect();
                data.extend(t.tower_spread_m.map(|(x, sigma)| Datum {
                    value: sigma.ln(),
                    log_distance: log_distance(x),
                    own_sd: Some(TOWER_SD),
                }));
                data
            })
            .collect();
        let lateral = trials
            .iter()
            .map(|t| {
                let known = t.weather.sigma_azimuth_rad.is_some();
                t.arcs
                    .iter()
                    .filter(|a| a.whole && known)
                    .map(|a| Datum {
                        value: a.width_m.ln(),
                        log_distance: log_distance(a.distance_m),
                        own_sd: None,
                    })
                    .collect()
            })
            .collect();
        Self {
            trials,
            vertical,
            lateral,
        }
    }
}

/// Something that can be fitted to the trials of a group.
pub trait Tried {
    /// Ids of its changes.
    fn ids(&self) -> Vec<&'static str>;
    /// Fits it to the trials `used` of `group`; see [`evidence::fit`] for `of_all`.
    fn fit(&self, group: &Group<'_>, used: &[usize], of_all: Option<&Fit>) -> Option<Fit>;
    /// Score of a trial left out.
    fn held_out(&self, group: &Group<'_>, i: usize, fit: &Fit) -> f64;
}

/// A vertical model.
#[derive(Debug, Clone, PartialEq)]
pub struct VerticalModel {
    /// Its changes.
    pub changes: Vec<Vertical>,
    priors: Vec<Prior>,
}

/// A lateral model.
#[derive(Debug, Clone, PartialEq)]
pub struct LateralModel {
    /// Its changes.
    pub changes: Vec<Lateral>,
    priors: Vec<Prior>,
}

impl VerticalModel {
    /// Briggs with `changes`.
    pub fn new(changes: &[Vertical]) -> Self {
        let priors = changes.iter().flat_map(|c| c.priors()).copied().collect();
        Self {
            changes: changes.to_vec(),
            priors,
        }
    }

    /// All that are tried: each change alone and deposition with a change of spread, with the
    /// wind at either height, and with spread by class or between classes.
    pub fn all() -> Vec<Self> {
        use Vertical::{Continuum, Decay, Deposition, Growth, PlumeWind, Scale};
        let sets: [&[Vertical]; 7] = [
            &[],
            &[Scale],
            &[Growth],
            &[Deposition],
            &[Decay],
            &[Scale, Deposition],
            &[Growth, Deposition],
        ];
        let mut all = Vec::new();
        let inputs: [&[Vertical]; 4] = [&[], &[PlumeWind], &[Continuum], &[PlumeWind, Continuum]];
        for set in sets {
            for input in inputs {
                all.push(Self::new(&[input, set].concat()));
            }
        }
        all
    }
}

impl LateralModel {
    /// Briggs with `changes`.
    pub fn new(changes: &[Lateral]) -> Self {
        let priors = changes.iter().flat_map(|c| c.priors()).copied().collect();
        Self {
            changes: changes.to_vec(),
            priors,
        }
    }

    /// All that are tried: Briggs' or the azimuth's width, as it is, scaled, or growing otherwise.
    pub fn all() -> Vec<Self> {
        use Lateral::{Azimuth, Growth, Scale};
        let sets: [&[Lateral]; 6] = [
            &[],
            &[Scale],
            &[Growth],
            &[Azimuth],
            &[Azimuth, Scale],
            &[Azimuth, Growth],
        ];
        sets.iter().map(|set| Self::new(set)).collect()
    }
}

struct VerticalOn<'a>(&'a VerticalModel, &'a Group<'a>);
struct LateralOn<'a>(&'a LateralModel, &'a Group<'a>);

impl Model for VerticalOn<'_> {
    fn priors(&self) -> &[Prior] {
        &self.0.priors
    }

    fn predict(&self, i: usize, theta: &[f64]) -> Vec<f64> {
        let (changes, trial) = (&self.0.changes, self.1.trials[i]);
        let weather = &trial.weather;
        let whole = trial.arcs.iter().filter(|a| a.whole);
        let mut out: Vec<f64> = whole
            .map(|a| model::log_integrated(weather, a, changes, theta))
            .collect();
        let tower = trial.tower_spread_m;
        out.extend(tower.map(|(x, _)| model::log_sigma_z(weather, x, changes, theta)));
        out
    }
}

impl Model for LateralOn<'_> {
    fn priors(&self) -> &[Prior] {
        &self.0.priors
    }

    fn predict(&self, i: usize, theta: &[f64]) -> Vec<f64> {
        let trial = self.1.trials[i];
        trial
            .arcs
            .iter()
            .filter(|a| a.whole)
            .filter_map(|a| model::log_width(&trial.weather, a.distance_m, &self.0.changes, theta))
            .take(self.1.lateral[i].len())
            .collect()
    }
}

impl Tried for VerticalModel {
    fn ids(&self) -> Vec<&'static str> {
        self.changes.iter().map(|c| c.id()).collect()
    }

    fn fit(&self, group: &Group<'_>, used: &[usize], of_all: Option<&Fit>) -> Option<Fit> {
        evidence::fit(&VerticalOn(self, group), &group.vertical, used, of_all)
    }

    fn held_out(&self, group: &Group<'_>, i: usize, fit: &Fit) -> f64 {
        evidence::held_out(&VerticalOn(self, group), &group.vertical, i, fit)
    }
}

impl Tried for LateralModel {
    fn ids(&self) -> Vec<&'static str> {
        self.changes.iter().map(|c| c.id()).collect()
    }

    fn fit(&self, group: &Group<'_>, used: &[usize], of_all: Option<&Fit>) -> Option<Fit> {
        evidence::fit(&LateralOn(self, group), &group.lateral, used, of_all)
    }

    fn held_out(&self, group: &Group<'_>, i: usize, fit: &Fit) -> f64 {
        evidence::held_out(&LateralOn(self, group), &group.lateral, i, fit)
    }
}
