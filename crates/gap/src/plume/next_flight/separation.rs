//! How far apart two rivals are on a flight that is yet to be flown.

use std::ops::AddAssign;

use ::plume::field::DispersionModel;
use ::plume::track::Track;
use nalgebra::{DMatrix, DVector};

use super::plans::{self, Flier, Plan, PlumeAxis};
use crate::plume::data::Data;
use crate::plume::fit::{Context, Fitted, moved_to_better};
use crate::plume::linear::{self, Posterior, dot, posterior, scores};
use crate::plume::model::{Model, Prediction};
use crate::plume::noise::{Loading, Whitener};
use crate::plume::nuisance::Nuisance;

/// Gauss–Newton steps of the rival that are tried, and what less than which is not worth one, nats.
const STEPS: usize = 8;
const WORTH_A_STEP_NATS: f64 = 0.1;

/// A flight that is yet to be flown, as the first rival predicts it.
pub(super) struct Flown<'a> {
    first: &'a Fitted,
    /// Places and air, and readings of nothing.
    data: Data,
    prediction: Prediction,
    loading: Vec<Loading>,
    whitener: Whitener,
}

/// How far the first rival is from another at certain parameters.
struct Apart {
    /// Nats, with nuisance at its best.
    nats: f64,
    /// The same once the other has made `step`, if readings were linear in it.
    nats_after: f64,
    step: DVector<f64>,
}

/// What a rival knows of its parameters from the data so far.
struct Known {
    at: DVector<f64>,
    precision: DMatrix<f64>,
}

impl<'a> Flown<'a> {
    /// The flight `plan`, flown by `flier`.
    pub fn new(
        ctx: &Context<'_>,
        first: &'a Fitted,
        plan: &Plan,
        axis: PlumeAxis,
        world: &DispersionModel,
        flier: Flier,
    ) -> Option<Self> {
        let rows = plans::rows(ctx, axis, plan, flier);
        let n = rows.len();
        let mut track = Track::new(world, ctx.data.track.platforms(), &rows).ok()?;
        track.transport_mut().fill(axis.wind);
        let data = Data {
            track,
            reading_ppm: vec![0.0; n],
            used: vec![true; n],
            sd_ppm: vec![f64::NAN; n],
            wind: vec![None; n],
            notices: Vec::new(),
            ceiling_ppm: Vec::new(),
            shown_swing_deg: ctx.data.shown_swing_deg,
            on_board_wind: ctx.data.on_board_wind,
            c_max_wind_m_s: ctx.data.c_max_wind_m_s,
        };
        let there = there(ctx, &data);
        let prediction = there.predict(&first.model);
        let loading = there.loading(&first.model, &prediction);
        let whitener = Whitener::new(&there.rows(&loading), &first.noise, &vec![0.0; n]);
        Some(Self {
            first,
            data,
            prediction,
            loading,
            whitener,
        })
    }

    /// Nats by which the flight separates the second rival from the first, once the second has
    /// moved its parameters to where they answer best for the data so far and the flight.
    pub fn separation(&self, ctx: &Context<'_>, second: &Fitted) -> Option<f64> {
        let d = second.model.dimension();
        let covariance = second.posterior.covariance.view((0, 0), (d, d));
        let known = Known {
            at: second.model.coordinates(),
            precision: covariance.into_owned().try_inverse()?,
        };
        let mut model = second.model.clone();
        let mut here = self.apart(ctx, &model, &known)?;
        for _ in 0..STEPS {
            if here.nats - here.nats_after < WORTH_A_STEP_NATS {
                break;
            }
            let nearer = moved_to_better(&model, &here.step, |moved| {
                let there = self.apart(ctx, moved, &known)?;
                (there.nats < here.nats).then_some(there)
            });
            let Some(found) = nearer else { break };
            (model, here) = found;
        }
        Some(here.nats)
    }

    fn apart(&self, ctx: &Context<'_>, model: &Model, known: &Known) -> Option<Apart> {
        let there = there(ctx, &self.data);
        let second = there.predict(model);
        let readings = self.prediction.reading.iter().zip(&second.reading);
        let mut apart: Vec<f64> = readings.map(|(x, y)| x - y).collect();
        let mut columns = there.derivatives(model, &second.reading);
        let d = columns.len();
        // The flight has swings and small departures of its own.
        let noise = &self.first.noise;
        let nuisance = Nuisance::new(&there, model, &second, &self.loading, noise);
        columns.extend(nuisance.raw);
        let mut all: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        all.push(&mut apart);
        self.whitener.whiten(&mut all);
        let departed = model.coordinates() - &known.at;
        let pull = &known.precision * &departed;
        let mut gram = linear::gram(&columns);
        gram.view_mut((0, 0), (d, d)).add_assign(&known.precision);
        let mut score = scores(&columns, &apart);
        score.rows_mut(0, d).add_assign(-&pull);
        let whole = 0.5 * (dot(&apart, &apart) + departed.dot(&pull));
        let least = |from: usize| -> Option<(f64, Posterior)> {
            let n = columns.len() - from;
            let gram = gram.view((from, from), (n, n)).into_owned();
            let score = score.rows(from, n).into_owned();
            let precision = DVector::from_fn(n, |k, _| match (from + k).checked_sub(d) {
                Some(own) => nuisance.sd[own].powi(-2),
                None => 0.0,
            });
            let taken = posterior(&gram, &score, &DVector::zeros(n), &precision)?;
            Some((whole - 0.5 * score.dot(&taken.mean), taken))
        };
        let (nats_after, all) = least(0)?;
        Some(Apart {
            nats: least(d)?.0,
            nats_after,
            step: all.mean.rows(0, d).into_owned(),
        })
    }
}

fn there<'a>(ctx: &Context<'a>, data: &'a Data) -> Context<'a> {
    Context {
        setup: ctx.setup,
        data,
        threads: 1,
    }
}
