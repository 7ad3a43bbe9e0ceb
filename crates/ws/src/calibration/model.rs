//! The plume model with its unknowns, as the inference asks for it.

use super::parameters::{CalibrationParameter, Unknowns};
use infer::{ForwardModel, InferError, PlumePlace, Prediction, Prior};
use plume::track::Track;
use plume::{DispersionModel, DispersionSpec};

/// Coarse search: reach in prior standard deviations and number of points on each side. In direction
/// the points must lie closer than the plume is wide, in height the plume is felt from far.
const SEARCH_REACH: f64 = 3.0;
const SEARCH_DIRECTIONS: i32 = 18;
const SEARCH_HEIGHTS: i32 = 3;

/// A plume model of a track of readings.
#[derive(Debug)]
pub(super) struct PlumeModel<'a> {
    base: &'a DispersionSpec,
    unknowns: &'a Unknowns,
    track: &'a Track,
    priors: Vec<Prior>,
}

impl<'a> PlumeModel<'a> {
    pub fn new(base: &'a DispersionSpec, unknowns: &'a Unknowns, track: &'a Track) -> Self {
        let (mean, sd) = (unknowns.prior_mean(), unknowns.prior_sd());
        let priors = mean.iter().zip(sd.iter());
        Self {
            priors: priors.map(|(&mean, &sd)| Prior { mean, sd }).collect(),
            base,
            unknowns,
            track,
        }
    }

    fn world(&self, at: &[f64]) -> Result<DispersionModel, InferError> {
        let spec = self.unknowns.spec(self.base, at);
        DispersionModel::new(spec).map_err(|error| InferError::Model(error.to_string()))
    }
}

impl ForwardModel for PlumeModel<'_> {
    fn priors(&self) -> &[Prior] {
        &self.priors
    }

    fn ln_strength(&self) -> Option<usize> {
        self.unknowns.index(CalibrationParameter::LnStrength)
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        let index = |parameter| self.unknowns.index(parameter);
        let (Some(direction), Some(height)) = (
            index(CalibrationParameter::Direction),
            index(CalibrationParameter::Height),
        ) else {
            return Vec::new();
        };
        let offset = |k: usize, step: i32, steps: i32| {
            SEARCH_REACH * self.priors[k].sd * f64::from(step) / f64::from(steps)
        };
        let mut out = Vec::new();
        for i in -SEARCH_DIRECTIONS..=SEARCH_DIRECTIONS {
            for j in -SEARCH_HEIGHTS..=SEARCH_HEIGHTS {
                let mut at: Vec<f64> = self.priors.iter().map(|p| p.mean).collect();
                at[direction] += offset(direction, i, SEARCH_DIRECTIONS);
                at[height] = (at[height] + offset(height, j, SEARCH_HEIGHTS)).max(1.0);
                out.push(at);
            }
        }
        out
    }

    fn predict(&self, at: &[f64], turn_deg: &[f64]) -> Result<Prediction, InferError> {
        let world = self.world(at)?;
        let n = self.track.len();
        let mut out = Prediction {
            reading: vec![0.0; n],
            plume: vec![0.0; n],
        };
        let mut fill = |track: &Track| {
            track.predict_parts(&world, &mut out.reading, Some(&mut out.plume));
        };
        if turn_deg.iter().all(|t| *t == 0.0) {
            fill(self.track);
        } else {
            fill(&self.track.turned(turn_deg));
        }
        Ok(out)
    }

    fn places(&self, at: &[f64]) -> Result<Vec<PlumePlace>, InferError> {
        let world = self.world(at)?;
        let places = self.track.in_first_plume(&world).into_iter();
        let of = |(place, time_s): (Option<plume::InPlume>, &f64)| plume_place(place, *time_s);
        Ok(places.zip(self.track.time_s()).map(of).collect())
    }
}

/// A place in the plume as the inference has it; not a number upwind of the source.
pub(super) fn plume_place(place: Option<plume::InPlume>, time_s: f64) -> PlumePlace {
    let none = PlumePlace {
        ln_distance: f64::NAN,
        above_sigmas: f64::NAN,
        across_sigmas: f64::NAN,
        time_s,
    };
    place.map_or(none, |p| PlumePlace {
        ln_distance: p.distance_m.ln(),
        above_sigmas: p.above_sigmas,
        across_sigmas: p.across_sigmas,
        time_s,
    })
}
