//! The reality gap, calibration, emission rates and plans.

use crate::convert;
use crate::error;
use crate::flight::Aircraft;
use crate::mission::LOOK_UP;
use crate::scenario::Scenario;
use ::gap::applied::Earlier;
use ::gap::flight::log::FlightLog;
use ::gap::tracer::{self, table::Tables};
use plume::Gas;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use tasks::flux::{Input, Method, Tracer};
use tasks::gap::Question;
use tasks::measured::{self, Text};
use tasks::{TaskError, calibration, flights, flux as rates};

/// Something measured: a file, or a text of some name.
#[derive(FromPyObject)]
pub(crate) enum Source {
    /// Name and CSV.
    Text(String, String),
    /// A file.
    File(PathBuf),
}

impl Source {
    fn observations(self) -> Result<Text, TaskError> {
        match self {
            Self::File(path) => Text::of_file(&path),
            Self::Text(name, text) => Ok(Text {
                name,
                text,
                notices: Vec::new(),
            }),
        }
    }

    fn table(self) -> Result<(String, String), TaskError> {
        match self {
            Self::File(path) => Ok((path.display().to_string(), measured::read(&path, "table")?)),
            Self::Text(name, text) => Ok((name, text)),
        }
    }

    fn flight(self) -> Result<FlightLog, TaskError> {
        match self {
            Self::File(path) => measured::flight(&path),
            Self::Text(name, text) => Ok(FlightLog::parse(&name, &text)?),
        }
    }
}

fn texts(sources: Vec<Source>) -> PyResult<Vec<Text>> {
    let texts = sources.into_iter().map(Source::observations);
    texts.collect::<Result<_, _>>().map_err(error::of_task)
}

/// Whether all are recordings of missions.
fn recorded(texts: &[Text]) -> bool {
    texts.iter().all(|t| t.name.ends_with(".mcap"))
}

/// An earlier finding: the text of a `gap.json`.
fn earlier(json: Option<&str>) -> PyResult<Option<Earlier>> {
    let earlier = json.map(|text| Earlier::parse("apply", text));
    earlier.transpose().map_err(|e| error::input(&e))
}

/// Tells Python how far something is; what it raises ends nothing, and is shown as unraisable.
fn tell(progress: Option<&Py<PyAny>>, part: f64, doing: &str) {
    if let Some(progress) = progress {
        Python::attach(|py| {
            if let Err(error) = progress.call1(py, (part, doing)) {
                error.write_unraisable(py, None);
            }
        });
    }
}

type Answer<'py> = Bound<'py, PyAny>;

/// Readings against the plume of a scenario.
#[pyfunction]
pub(crate) fn gap_plume<'py>(
    py: Python<'py>,
    sources: Vec<Source>,
    scenario: &Scenario,
    apply: Option<&str>,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Answer<'py>, Scenario, Vec<String>)> {
    let (texts, earlier) = (texts(sources)?, earlier(apply)?);
    let setup = &scenario.setup;
    let found = py.detach(|| -> Result<_, TaskError> {
        let mut observations = measured::of_texts(&texts, setup.scenario.gas())?;
        let setup = &measured::weather_over(setup.clone(), &mut observations, recorded(&texts))?;
        let by_series = measured::fill_wind(&mut observations, setup)?;
        let question = Question {
            setup,
            observations: &observations,
            by_series,
            earlier: earlier.as_ref(),
            seed,
        };
        let mut progress = |at: ::gap::plume::Progress| tell(progress.as_ref(), at.part, at.doing);
        let found = tasks::gap::of_plume(&question, &mut progress)?;
        Ok((found, observations.notices))
    });
    let ((analysis, extended), notices) = found.map_err(error::of_task)?;
    let extended = scenario.with(&extended)?;
    Ok((
        convert::said(py, analysis.json.to_json())?,
        extended,
        notices,
    ))
}

/// A tracer experiment.
#[pyfunction]
pub(crate) fn gap_tracer<'py>(
    py: Python<'py>,
    receptors: Source,
    trials: Source,
    towers: Option<Source>,
    apply: Option<&str>,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Answer<'py>, String)> {
    let earlier = earlier(apply)?;
    let found = py.detach(|| -> Result<_, TaskError> {
        let (receptors, trials) = (receptors.table()?, trials.table()?);
        let towers = towers.map(Source::table).transpose()?;
        let tables = Tables::parse(
            (&receptors.0, &receptors.1),
            (&trials.0, &trials.1),
            towers.as_ref().map(|t| (t.0.as_str(), t.1.as_str())),
        )?;
        let mut progress = |part: f64| tell(progress.as_ref(), part, "");
        Ok(match &earlier {
            Some(earlier) => tracer::apply(&tables, earlier, seed)?,
            None => tracer::analyse(&tables, seed, &mut progress)?,
        })
    });
    let report = found.map_err(error::of_task)?;
    Ok((convert::said(py, report.to_json())?, report.extended_toml))
}

/// Measured flights against an aircraft.
#[pyfunction]
pub(crate) fn gap_flight<'py>(
    py: Python<'py>,
    flights: Vec<Source>,
    aircraft: &Aircraft,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Answer<'py>, Aircraft)> {
    let found = py.detach(|| -> Result<_, TaskError> {
        let logs: Result<Vec<FlightLog>, TaskError> =
            flights.into_iter().map(Source::flight).collect();
        let mut progress = |part: f64| tell(progress.as_ref(), part, ::gap::flight::doing(part));
        Ok(::gap::flight::analyse(
            &logs?,
            &aircraft.aircraft,
            &mut progress,
        )?)
    });
    let report = found.map_err(error::of_task)?;
    let json = convert::said(py, report.to_json())?;
    Ok((json, Aircraft::of(report.extended)))
}

/// A scenario corrected by readings.
#[pyfunction]
pub(crate) fn calibrate<'py>(
    py: Python<'py>,
    sources: Vec<Source>,
    scenario: &Scenario,
    reference: Option<&str>,
) -> PyResult<(Answer<'py>, Scenario, Vec<String>)> {
    let texts = texts(sources)?;
    let setup = &scenario.setup;
    let found = py.detach(|| -> Result<_, TaskError> {
        let mut observations = measured::of_texts(&texts, setup.scenario.gas())?;
        let setup = &measured::weather_over(setup.clone(), &mut observations, recorded(&texts))?;
        measured::fill_wind(&mut observations, setup)?;
        let found = calibration::of(setup, &observations, reference)?;
        Ok((found, observations.notices))
    });
    let (found, notices) = found.map_err(error::of_task)?;
    let corrected = scenario.with(&found.offline.scenario)?;
    Ok((convert::json(py, &found.json)?, corrected, notices))
}

/// An emission rate; with a gas that is released beside the source and its rate in kg/s.
#[pyfunction]
pub(crate) fn flux<'py>(
    py: Python<'py>,
    sources: Vec<Source>,
    scenario: &Scenario,
    method: &str,
    tracer: Option<(String, f64)>,
) -> PyResult<(Answer<'py>, Vec<String>)> {
    let texts = texts(sources)?;
    let named = Method::ALL.into_iter().find(|m| m.name() == method);
    let methods = match (method, named) {
        ("auto", _) => Method::ALL.to_vec(),
        (_, Some(one)) => vec![one],
        (other, None) => {
            let expected = "expected auto, curtain, point, network or inversion";
            return Err(error::InputError::new_err(format!(
                "method '{other}': {expected}"
            )));
        }
    };
    let tracer = tracer
        .map(|(name, kg_s)| Ok::<_, PyErr>((crate::scenario::gas(Some(&name))?, kg_s)))
        .transpose()?;
    let found = py.detach(|| -> Result<_, TaskError> {
        let prepared = |gas: Gas| -> Result<_, TaskError> {
            let mut observations = measured::of_texts(&texts, gas)?;
            let setup = scenario.setup.clone();
            let setup = measured::weather_over(setup, &mut observations, recorded(&texts))?;
            Ok((setup, observations))
        };
        let of_tracer = |(gas, kg_s): (Option<Gas>, f64)| {
            let (_, observations) = prepared(gas.unwrap_or_default())?;
            Ok::<_, TaskError>(Tracer { observations, kg_s })
        };
        let tracer = tracer.map(of_tracer).transpose()?;
        let (setup, mut observations) = prepared(scenario.setup.scenario.gas())?;
        measured::fill_wind(&mut observations, &setup)?;
        let inputs = texts
            .iter()
            .map(|t| Input::new(t.name.clone(), t.text.as_bytes()));
        let report = rates::of(
            &setup,
            &observations,
            &methods,
            tracer.as_ref(),
            inputs.collect(),
        )?;
        Ok((report, observations.notices))
    });
    let (report, notices) = found.map_err(error::of_task)?;
    Ok((convert::json(py, &report.json)?, notices))
}

/// What missions of a scenario would find.
#[pyfunction]
pub(crate) fn plan<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    missions: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Answer<'py>> {
    let setup = &scenario.setup;
    let (count, stop) = (AtomicU64::new(0), AtomicBool::new(false));
    let flown = || {
        let count = 1 + count.fetch_add(1, Ordering::Relaxed);
        tell(progress.as_ref(), count as f64 / missions as f64, "flying");
    };
    let fly_all = || -> Result<_, TaskError> {
        tasks::preflight::check(setup)?;
        let fly = |number| Ok(mission::plan::fly(setup, number)?);
        flights::fly_all(missions, fly, flown, || stop.load(Ordering::Relaxed))
    };
    // Python hears of interrupts on this thread alone.
    let (flights, interrupt) = py.detach(|| {
        std::thread::scope(|scope| {
            let flying = scope.spawn(fly_all);
            let mut interrupt = Ok(());
            while !flying.is_finished() {
                std::thread::sleep(LOOK_UP);
                if interrupt.is_ok() {
                    interrupt = Python::attach(|py| py.check_signals());
                    stop.store(interrupt.is_err(), Ordering::Relaxed);
                }
            }
            (flying.join(), interrupt)
        })
    });
    interrupt?;
    let flights = flights.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let forecast = mission::plan::forecast(&flights.map_err(error::of_task)?);
    convert::said(py, serde_json::to_string(&forecast))
}
