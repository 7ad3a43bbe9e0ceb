//! A search strategy in Python: what it is shown, and what it says.

use crate::convert;
use crate::error::{self, InputError};
use mission::Run;
use protocol::message::{Destination, Message, Model, Phase, Reading, State};
use protocol::{Envelope, SimTime, Topic};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use std::collections::BTreeMap;

/// A strategy in Python, and what it has not been shown yet.
pub(crate) struct Leader {
    strategy: Py<PyAny>,
    /// Time between two questions, s.
    step_s: f64,
    next_s: f64,
    /// Part of what a phase before the search tells is lost on a strategy: it is asked from then on.
    situation: Situation,
}

/// What a strategy is shown, as JSON: messages as on the bus.
#[derive(Serialize)]
struct Situation {
    time_s: f64,
    phase: Option<Phase>,
    vehicles: BTreeMap<String, State>,
    readings: Vec<Read>,
    model: Option<Model>,
}

/// A reading since the last question.
#[derive(Serialize)]
struct Read {
    vehicle: String,
    time_s: f64,
    #[serde(flatten)]
    reading: Reading,
}

impl Leader {
    /// Asks `strategy` every `step_s`.
    pub(crate) fn new(strategy: Py<PyAny>, step_s: f64) -> Self {
        Self {
            strategy,
            step_s,
            next_s: 0.0,
            situation: Situation {
                time_s: 0.0,
                phase: None,
                vehicles: BTreeMap::new(),
                readings: Vec::new(),
                model: None,
            },
        }
    }

    /// Takes in a message.
    pub(crate) fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        let seen = &mut self.situation;
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => {
                seen.vehicles.insert(id.to_string(), state.clone());
            }
            (Topic::Reading(id), Message::Reading(reading)) => seen.readings.push(Read {
                vehicle: id.to_string(),
                time_s: reading.read_at(envelope.time).s(),
                reading: reading.clone(),
            }),
            (Topic::Model, Message::Model(model)) => seen.model = Some(Model::clone(model)),
            (Topic::Plan, Message::Plan(plan)) => seen.phase = Some(plan.phase),
            _ => {}
        }
    }

    /// Asks the strategy, if it is time, and tells the vehicles what it says.
    pub(crate) fn lead(&mut self, run: &mut Run, now: SimTime) -> PyResult<()> {
        let searches = self.situation.phase == Some(Phase::Search);
        if !searches || now.s() < self.next_s {
            return Ok(());
        }
        self.next_s = now.s() + self.step_s;
        self.situation.time_s = now.s();
        let text = serde_json::to_string(&self.situation).map_err(|e| error::run(&e))?;
        self.situation.readings.clear();
        let said = Python::attach(|py| {
            let situation = convert::json(py, &text)?;
            let said = self.strategy.bind(py).call1((situation,))?;
            match said.is_none() {
                true => PyResult::Ok(Vec::new()),
                false => destinations(&said),
            }
        })?;
        for (vehicle, place) in said {
            let known = self.situation.vehicles.contains_key(&vehicle);
            if !known {
                let known: Vec<&str> = self.situation.vehicles.keys().map(String::as_str).collect();
                return Err(InputError::new_err(format!(
                    "strategy: vehicle '{vehicle}': expected one of {}",
                    known.join(", ")
                )));
            }
            run.send_to(&vehicle, place).map_err(|e| error::input(&e))?;
        }
        Ok(())
    }
}

/// Places by vehicle, as a strategy says them.
fn destinations(said: &Bound<'_, PyAny>) -> PyResult<Vec<(String, Destination)>> {
    let wrong = || {
        InputError::new_err(
            "strategy: expected None, or a dict of (lat_deg, lon_deg, alt_amsl_m) by vehicle",
        )
    };
    let said = said.cast::<PyDict>().map_err(|_| wrong())?;
    let one = |(vehicle, place): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let vehicle: String = vehicle.extract().map_err(|_| wrong())?;
        let place: (f64, f64, f64) = place.extract().map_err(|_| wrong())?;
        let (lat_deg, lon_deg, alt_amsl_m) = place;
        if ![lat_deg, lon_deg, alt_amsl_m].iter().all(|v| v.is_finite()) {
            return Err(InputError::new_err(format!(
                "strategy: vehicle '{vehicle}': expected finite numbers"
            )));
        }
        let place = Destination {
            lat_deg,
            lon_deg,
            alt_amsl_m,
        };
        Ok((vehicle, place))
    };
    said.iter().map(one).collect()
}
