//! Two sources that have changed places. A search that took the plume of one source for that of the other turns
//! the wind until it fits, and then finds the other source mirrored, on the wrong side and with the inverse ratio:
//! a valley of its own, out of which no small step leads. Hence a step that changes all of these together.

use ::plume::mechanism::MechanismId;
use air::geo::Enu;
use infer::{ForwardModel, InferError};

use super::data::mean_transport;
use super::model::PlumeModel;

impl PlumeModel<'_> {
    /// The unknowns `at` with the roles of the first source and of a second one, the last cause, exchanged: the
    /// first one's plume lies where that of the second was met, and the other way round. None where the last
    /// cause is another, or where the wind or the strength is not unknown.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub(crate) fn exchanged_sources(&self, at: &[f64]) -> Result<Option<Vec<f64>>, InferError> {
        let parts = self.parts(at);
        let Some(last) = parts.len().checked_sub(1) else {
            return Ok(None);
        };
        let own: Vec<usize> = self.unknowns_of(last).collect();
        let (Some(wind), Some(strength), &[east, north, ratio], MechanismId::SecondSource) = (
            self.unknown(MechanismId::WindDirectionOffset),
            self.ln_strength(),
            &own[..],
            parts[last].id,
        ) else {
            return Ok(None);
        };
        if at[ratio] <= 0.0 {
            return Ok(None);
        }
        let Some((met_m, towards_deg)) = self.met(at)? else {
            return Ok(None);
        };
        let second = Enu {
            east_m: at[east],
            north_m: at[north],
        };
        let (along_m, right_m) = seen_along(second, towards_deg);
        let turn_deg = right_m.atan2(met_m).to_degrees();
        // The place where the first plume was met, seen from the first source; the second now lies upwind of it, as
        // far as it lay along the wind before.
        let first_met = Enu::default().displaced(towards_deg, met_m);
        let place = first_met.displaced(towards_deg + turn_deg + 180.0, met_m + along_m);
        let mut out = at.to_vec();
        out[wind] += turn_deg;
        out[strength] += at[ratio].ln();
        (out[east], out[north]) = (place.east_m, place.north_m);
        out[ratio] = 1.0 / at[ratio];
        Ok(Some(out))
    }

    /// Where the two last causes are a second source and another place of the first one, and the second lies nearer to
    /// where the scenario has the first: the unknowns of the same two sources with their names exchanged, which need the
    /// second source alone. None elsewhere, or where the strength is not unknown.
    pub(crate) fn second_alone(&self, at: &[f64]) -> Option<Vec<f64>> {
        let parts = self.parts(at);
        let two_last = parts.len().saturating_sub(2)..parts.len();
        let of = |id: MechanismId| {
            let part = two_last.clone().find(|k| parts[*k].id == id)?;
            Some(self.unknowns_of(part).collect::<Vec<usize>>())
        };
        let strength = self.ln_strength()?;
        let (second, moved) = (
            of(MechanismId::SecondSource)?,
            of(MechanismId::SourcePositionOffset)?,
        );
        let (&[east, north, ratio], &[by_east, by_north]) = (&second[..], &moved[..]) else {
            return None;
        };
        let first_off_m = at[by_east].hypot(at[by_north]);
        let second_off_m = (at[by_east] + at[east]).hypot(at[by_north] + at[north]);
        if at[ratio] <= 0.0 || second_off_m >= first_off_m {
            return None;
        }
        let mut out = at.to_vec();
        out[strength] += at[ratio].ln();
        (out[east], out[north]) = (at[by_east], at[by_north]);
        out[ratio] = 1.0 / at[ratio];
        let kept = (0..out.len()).filter(|k| !moved.contains(k));
        Some(kept.map(|k| out[k]).collect())
    }

    /// How far from the first source its plume was met in the mean, m, and the direction towards which it lies,
    /// degrees; none where nobody met it downwind.
    fn met(&self, at: &[f64]) -> Result<Option<(f64, f64)>, InferError> {
        let track = self.track();
        let weight: Vec<f64> = self.still_plume(at)?.iter().map(|p| p.abs()).collect();
        let wind = mean_transport(track.transport(), &weight);
        let towards_deg = air::wind::from_deg(wind.east, wind.north) + 180.0 + self.turned_deg(at);
        let source = self.world(at)?.spec().sources[0].place;
        let (mut sum_m, mut all) = (0.0, 0.0);
        for (i, weight) in weight.iter().enumerate() {
            let place = track.place(i);
            let offset = Enu {
                east_m: place.east_m - source.east_m,
                north_m: place.north_m - source.north_m,
            };
            sum_m += weight * seen_along(offset, towards_deg).0;
            all += weight;
        }
        let met_m = sum_m / all;
        Ok((met_m > 0.0).then_some((met_m, towards_deg)))
    }
}

/// How far a place lies along a direction, and to the right of it, m.
fn seen_along(place: Enu, towards_deg: f64) -> (f64, f64) {
    let (sin, cos) = towards_deg.to_radians().sin_cos();
    (
        place.east_m * sin + place.north_m * cos,
        place.east_m * cos - place.north_m * sin,
    )
}
