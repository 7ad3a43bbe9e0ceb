//! How visible a known effect is, and what it could be mistaken for: for benchmarks, which know
//! the truth.

use std::collections::BTreeMap;

use ::plume::mechanism::{Mechanism, MechanismId};
use scenario::observations::Observations;

use super::data::{Data, Setup};
use super::explore;
use super::fit::{Context, Fitted};
use super::gate;
use super::held_out;
use super::model::{self, Model};
use super::start;
use super::{FEWEST_READINGS, GapError};

/// What an effect is known by.
#[derive(Debug, Clone, Copy)]
pub enum Known<'a> {
    /// The mechanisms of the catalogue that it is, at their true parameters.
    Mechanisms(&'a [Mechanism]),
    /// What it does to the plume of each row; nothing at rows that are not among them.
    Plume(&'a [PlumeChange]),
    /// The same readings without the effect.
    Twin(&'a Observations),
}

/// What an effect does to the plume of one row.
#[derive(Debug, Clone, PartialEq)]
pub struct PlumeChange {
    /// The row's platform.
    pub platform: String,
    /// Its time, s.
    pub time_s: f64,
    /// What the plume is multiplied by.
    pub factor: f64,
    /// By how much it is turned about its source, degrees clockwise.
    pub turned_deg: f64,
}

/// A mechanism beside the true one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likeness {
    /// The mechanism.
    pub id: MechanismId,
    /// By how much the truth beats it on average, nats.
    pub nats: f64,
}

/// Observations of which the truth is known, with the base and the noise that are fitted to
/// them.
pub struct Visibility {
    setup: Setup,
    data: Data,
    fitted: Fitted,
}

impl Visibility {
    /// Fits base and noise; `None` where too few readings are usable for anything to be told from
    /// them, as after an effect that leaves none.
    ///
    /// # Errors
    /// As [`super::analyse`].
    pub fn new(setup: &Setup, observations: &Observations) -> Result<Option<Self>, GapError> {
        let (passed, _) = gate::passed(setup, observations)?;
        let enough = |data: &Data| data.used_count() >= FEWEST_READINGS;
        let Some(mut data) = passed.filter(enough) else {
            return Ok(None);
        };
        let fitted = start::start(setup, &mut data, 1).fitted;
        Ok(Some(Self {
            setup: setup.clone(),
            data,
            fitted,
        }))
    }

    fn context<'b>(&'b self, data: &'b Data) -> Context<'b> {
        Context {
            setup: &self.setup,
            data,
            threads: 1,
        }
    }

    /// The log score by which the true extension beats the base under the fitted noise, nats;
    /// where only a twin of the readings is known, what the effect costs the base.
    ///
    /// # Errors
    /// A twin whose rows do not correspond.
    pub fn nats(&self, known: Known<'_>) -> Result<f64, GapError> {
        let other = match known {
            Known::Mechanisms(mechanisms) => return Ok(self.gain(mechanisms, &[])),
            Known::Plume(changes) => self.changed(changes),
            Known::Twin(twin) => self.twin(twin)?,
        };
        let score = |data: &Data| self.settled(data, &self.fitted.model).score_with_prior();
        Ok(score(&other) - score(&self.data))
    }

    /// What the mechanism `which` of the true ones adds to the log score beside the others, nats.
    pub fn nats_beside(&self, mechanisms: &[Mechanism], which: usize) -> f64 {
        let others = (0..mechanisms.len()).filter(|k| *k != which);
        let others: Vec<&Mechanism> = others.map(|k| &mechanisms[k]).collect();
        self.gain(mechanisms, &others)
    }

    /// Log scores on blocks left out, nats, as in [`crate::verdict::HeldOut`]: of the base, and of
    /// the true extension at its true parameters, which is what a finder can hope for that names
    /// and measures without error. Each has the noise that is fitted to it; of the truth's, the
    /// base's among them, the one under which it predicts best.
    pub fn held_out_scores(&self, mechanisms: &[Mechanism]) -> (f64, f64) {
        let ctx = self.context(&self.data);
        let score = |f: &Fitted| held_out::log_score(&ctx, f);
        let start = self.settled(&self.data, &self.with(mechanisms.iter().collect()));
        let once = ctx.refine(&start.model, self.fitted.noise);
        let twice = ctx.refine(&once.model, once.noise);
        // The base may fit better from where the truth has its parameters.
        let there = self.fitted.model.clone().placed_as(&twice.model);
        let there = ctx.refine(&there, self.fitted.noise);
        let base = if there.score_with_prior() > self.fitted.score_with_prior() {
            &there
        } else {
            &self.fitted
        };
        // Where the wind is not known a noise that is fitted anew may run away with the plume.
        let truth = [&start, &once, &twice].map(score);
        (score(base), truth.into_iter().fold(f64::MIN, f64::max))
    }

    /// The log score by which all `mechanisms` beat the base with only `some` of them, nats.
    fn gain(&self, mechanisms: &[Mechanism], some: &[&Mechanism]) -> f64 {
        let truth = self.settled(&self.data, &self.with(mechanisms.iter().collect()));
        let with_some = self.with(some.to_vec());
        // The smaller model may fit better from where the truth has its parameters.
        let there = with_some.clone().placed_as(&truth.model);
        let fits = [with_some, there].map(|m| self.settled(&self.data, &m).score_with_prior());
        truth.score_with_prior() - fits[0].max(fits[1])
    }

    /// The base with mechanisms at their values.
    fn with(&self, mechanisms: Vec<&Mechanism>) -> Model {
        let mut model = self.fitted.model.clone();
        for m in mechanisms {
            let parts = model::parts_of(m, self.data.track.platforms());
            model.parts.extend(parts);
        }
        model
    }

    fn settled(&self, data: &Data, model: &Model) -> Fitted {
        self.context(data)
            .settle(model, &self.fitted.metric, &self.fitted, 8)
    }

    /// The data with a plume that has `changes`.
    fn changed(&self, changes: &[PlumeChange]) -> Data {
        // Milliseconds: times are logged to a tenth of a second at best.
        let milliseconds = |time_s: f64| (1e3 * time_s).round() as i64;
        let of = |c: &PlumeChange| ((c.platform.clone(), milliseconds(c.time_s)), c.clone());
        let known: BTreeMap<(String, i64), PlumeChange> = changes.iter().map(of).collect();
        let mut data = self.data.clone();
        let track = &self.data.track;
        for (range, name) in data.ranges().to_vec().into_iter().zip(track.platforms()) {
            for i in range {
                let key = (name.clone(), milliseconds(track.time_s()[i]));
                if let Some(change) = known.get(&key) {
                    data.track.plume_factor_mut()[i] *= change.factor;
                    let wind = &mut data.track.transport_mut()[i];
                    *wind = wind.turned(change.turned_deg);
                }
            }
        }
        data
    }

    /// The twin's readings on the rows of the data.
    fn twin(&self, twin: &Observations) -> Result<Data, GapError> {
        let other = Data::new(&self.setup, twin)?;
        if self.data.len() != other.len() {
            return Err(GapError::Data {
                what: "twin".to_string(),
                problem: format!("{} rows", other.len()),
                expected: format!("{}, as in the observations", self.data.len()),
            });
        }
        let mut data = self.data.clone();
        for (own, other) in data.reading_ppm.iter_mut().zip(&other.reading_ppm) {
            if own.is_finite() && other.is_finite() {
                *own = *other;
            }
        }
        Ok(data)
    }

    /// What the mechanism `which` of the true ones could be mistaken for, the most alike first:
    /// readings as the truth predicts them, without noise, put to a round of naming on top of
    /// the base and the other true mechanisms. Only what is near enough to be tried is in it.
    pub fn likenesses(&self, mechanisms: &[Mechanism], which: usize) -> Vec<Likeness> {
        let own = self.context(&self.data);
        let truth = self.settled(&self.data, &self.with(mechanisms.iter().collect()));
        let mut clean = self.data.clone();
        for (i, reading) in clean.reading_ppm.iter_mut().enumerate() {
            if clean.used[i] {
                *reading = truth.prediction.reading[i];
            }
        }
        let others = mechanisms.iter().enumerate().filter(|(k, _)| *k != which);
        let null = self.with(others.map(|(_, m)| m).collect());
        let null = null.placed_as(&truth.model);
        let ctx = Context {
            data: &clean,
            ..own
        };
        let null = ctx.settle(&null, &self.fitted.metric, &self.fitted, 8);
        // The prior costs the truth what it costs it in the data.
        let best = null.log_score_of_nothing() + truth.model.ln_departure(|_| true);
        let floor = null.log_score + null.model.ln_departure(|_| true);
        let round = explore::names(&ctx, &null, 1, None);
        let mut out: Vec<Likeness> = Vec::new();
        for tried in &round.tried {
            let nats = (best - (floor + tried.log_score)).max(0.0);
            match out.iter_mut().find(|l| l.id == tried.id) {
                Some(l) => l.nats = l.nats.min(nats),
                None => out.push(Likeness { id: tried.id, nats }),
            }
        }
        out.sort_by(|a, b| a.nats.total_cmp(&b.nats).then(a.id.cmp(&b.id)));
        out
    }
}
