//! The models that are tried on the trials of unstable and of stable air, vertical and lateral.

use super::arcs::{Arc, TrialArcs};
use super::evidence::{self, Datum, Fit, Model};
use super::model::{self, Lateral, PIVOT_M, Prior, Vertical};

/// Standard deviation of ln σ_z from towers: some tens of samplers, and a profile that is not
/// quite normal.
const TOWER_SD: f64 = 0.25;

/// Releases are metered: one experiment in three hundred is taken to have a wrong one.
const WRONG_RELEASE: f64 = 0.003;

/// Prior of the logarithm of a factor on the arcs at one distance.
const OFFSET: Prior = Prior {
    name: "ln_factor",
    sd: 0.5,
    positive: false,
};

/// Whether arcs of different trials count as at one distance.
pub fn same_distance(a_m: f64, b_m: f64) -> bool {
    (a_m / b_m).ln().abs() < 0.1
}

/// Of which trials' widths a lateral model speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Widths {
    /// Those of trials that measured the deviation of azimuth.
    WithAzimuth,
    /// Those of the others; of all where too few measured it.
    WithoutAzimuth,
}

/// Trials of one kind of air, as data of the vertical and of the lateral question.
pub struct Group<'a> {
    /// The trials.
    pub trials: Vec<&'a TrialArcs>,
    vertical: Vec<evidence::Trial>,
    with_azimuth: Vec<evidence::Trial>,
    without_azimuth: Vec<evidence::Trial>,
}

/// The whole arcs of a trial as data, with what is measured of each.
fn data(trial: &TrialArcs, measured: impl Fn(&Arc) -> f64) -> evidence::Trial {
    let whole = trial.arcs.iter().filter(|a| a.whole);
    whole
        .map(|a| Datum {
            value: measured(a).ln(),
            log_distance: (a.distance_m / PIVOT_M).ln(),
            own_sd: None,
        })
        .collect()
}

impl<'a> Group<'a> {
    /// The data of `trials`. With fewer than `least` trials that measured the deviation of
    /// azimuth the widths of all are taken together, with fewer that did not theirs are not asked.
    pub fn new(trials: Vec<&'a TrialArcs>, least: usize) -> Self {
        let vertical = |t: &TrialArcs| {
            let mut data = data(t, |a| a.integrated_mg_m2);
            data.extend(t.tower_spreads_m.iter().map(|(x, sigma)| Datum {
                value: sigma.ln(),
                log_distance: (x / PIVOT_M).ln(),
                own_sd: Some(TOWER_SD),
            }));
            data
        };
        let known = |t: &TrialArcs| t.weather.sigma_azimuth_rad.is_some();
        let measured = trials.iter().filter(|t| known(t)).count();
        let widths = |used: &dyn Fn(&TrialArcs) -> bool| -> Vec<evidence::Trial> {
            let of = |t: &&TrialArcs| match used(t) {
                true => data(t, |a| a.width_m),
                false => Vec::new(),
            };
            trials.iter().map(of).collect()
        };
        let together = measured < least;
        let enough = trials.len() - measured >= least;
        Self {
            vertical: trials.iter().map(|t| vertical(t)).collect(),
            with_azimuth: widths(&|t| !together && known(t)),
            without_azimuth: widths(&|t| together || (enough && !known(t))),
            trials,
        }
    }

    fn widths(&self, of: Widths) -> &[evidence::Trial] {
        match of {
            Widths::WithAzimuth => &self.with_azimuth,
            Widths::WithoutAzimuth => &self.without_azimuth,
        }
    }

    /// Whether there are widths of that kind to ask about.
    pub fn asks(&self, of: Widths) -> bool {
        self.widths(of).iter().any(|t| !t.is_empty())
    }

    /// Which question speaks of the width of trial `i`.
    pub fn widths_of(&self, i: usize) -> Widths {
        let known = self.trials[i].weather.sigma_azimuth_rad.is_some();
        let with = self.asks(Widths::WithAzimuth);
        if with && (known || !self.asks(Widths::WithoutAzimuth)) {
            Widths::WithAzimuth
        } else {
            Widths::WithoutAzimuth
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
    /// Distance, m, of the arcs that have an offset of their own, the last parameter.
    offset_at_m: Option<f64>,
}

/// A lateral model.
#[derive(Debug, Clone, PartialEq)]
pub struct LateralModel {
    /// Its changes.
    pub changes: Vec<Lateral>,
    of: Widths,
    priors: Vec<Prior>,
}

impl VerticalModel {
    /// Briggs with `changes`.
    pub fn new(changes: &[Vertical]) -> Self {
        let priors = changes.iter().flat_map(|c| c.priors()).copied().collect();
        Self {
            changes: changes.to_vec(),
            priors,
            offset_at_m: None,
        }
    }

    /// The same with a factor of its own on all arcs at one distance: a flexible term that
    /// describes a misfit without naming it.
    pub fn with_offset_at(&self, distance_m: f64) -> Self {
        let mut model = self.clone();
        model.priors.push(OFFSET);
        model.offset_at_m = Some(distance_m);
        model
    }

    /// All that are tried: each change alone and deposition with a change of spread, with the
    /// wind at either height, and with spread by class or between classes.
    pub fn all() -> Vec<Self> {
        use Vertical::{Continuum, Decay, Deposition, Emission, Growth, PlumeWind, Scale};
        let sets: [&[Vertical]; 8] = [
            &[],
            &[Scale],
            &[Growth],
            &[Deposition],
            &[Decay],
            &[Emission],
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
    pub fn new(changes: &[Lateral], of: Widths) -> Self {
        let priors = changes.iter().flat_map(|c| c.priors()).copied().collect();
        Self {
            changes: changes.to_vec(),
            of,
            priors,
        }
    }

    /// All that are tried: Briggs' or, where it is measured, the azimuth's width, as it is,
    /// scaled, or growing otherwise.
    pub fn all(of: Widths) -> Vec<Self> {
        use Lateral::{Azimuth, Growth, Scale};
        let sets: [&[Lateral]; 6] = [
            &[],
            &[Scale],
            &[Growth],
            &[Azimuth],
            &[Azimuth, Scale],
            &[Azimuth, Growth],
        ];
        let measured = |set: &&&[Lateral]| of == Widths::WithAzimuth || !set.contains(&Azimuth);
        let sets = sets.iter().filter(measured);
        sets.map(|set| Self::new(set, of)).collect()
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
        let offset = |x: f64| match (self.0.offset_at_m, theta.last()) {
            (Some(at), Some(offset)) if same_distance(x, at) => *offset,
            _ => 0.0,
        };
        let mut out: Vec<f64> = whole
            .map(|a| model::log_integrated(weather, a, changes, theta) + offset(a.distance_m))
            .collect();
        let towers = trial.tower_spreads_m.iter();
        out.extend(towers.map(|(x, _)| model::log_sigma_z(weather, *x, changes, theta)));
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
            .take(self.1.widths(self.0.of)[i].len())
            .collect()
    }
}

impl Tried for VerticalModel {
    fn ids(&self) -> Vec<&'static str> {
        self.changes.iter().map(|c| c.id()).collect()
    }

    fn fit(&self, group: &Group<'_>, used: &[usize], of_all: Option<&Fit>) -> Option<Fit> {
        let mut fit = evidence::fit(&VerticalOn(self, group), &group.vertical, used, of_all)?;
        if self.changes.contains(&Vertical::Emission) {
            fit.log_evidence += WRONG_RELEASE.ln();
        }
        Some(fit)
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
        evidence::fit(&LateralOn(self, group), group.widths(self.of), used, of_all)
    }

    fn held_out(&self, group: &Group<'_>, i: usize, fit: &Fit) -> f64 {
        evidence::held_out(&LateralOn(self, group), group.widths(self.of), i, fit)
    }
}
