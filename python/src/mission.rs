//! Missions flown, and read back.

use crate::convert::{self, Columns};
use crate::error;
use crate::leading::Leader;
use crate::scenario::Scenario;
use mission::{Run, Setup, campaign};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use record::export::{Flown as Told, FlownBuilder, columns};
use record::summary::Summariser;
use record::{Recording, ThreadedRecorder};
use std::ffi::CString;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tasks::{TaskError, mission_record, preflight, scenario_files};

/// Python is asked for interrupts, and told of progress, this often.
pub(crate) const LOOK_UP: Duration = Duration::from_millis(50);

/// What a mission left.
#[pyclass(frozen, module = "plumage._plumage")]
pub(crate) struct Flown {
    summary: String,
    digest: String,
    scenario: String,
    told: Told,
}

#[pymethods]
impl Flown {
    #[getter]
    fn digest(&self) -> &str {
        &self.digest
    }

    #[getter]
    fn scenario_toml(&self) -> &str {
        &self.scenario
    }

    #[getter]
    fn notices(&self) -> Vec<String> {
        self.told.notices.clone()
    }

    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::json(py, &self.summary)
    }

    fn readings<'py>(&self, py: Python<'py>) -> PyResult<Columns<'py>> {
        convert::columns(py, columns::columns(&self.told))
    }

    fn tracks<'py>(&self, py: Python<'py>) -> PyResult<Columns<'py>> {
        convert::columns(py, columns::of_motions(&self.told))
    }

    fn model<'py>(&self, py: Python<'py>) -> PyResult<Columns<'py>> {
        convert::columns(py, columns::of_models(&self.told))
    }
}

/// Why a mission stopped before its end.
enum Stopped {
    /// The input was wrong, or an output cannot be written.
    Task(TaskError),
    /// Python was interrupted, or what it was asked to do failed.
    Python(PyErr),
}

impl From<TaskError> for Stopped {
    fn from(error: TaskError) -> Self {
        Self::Task(error)
    }
}

impl From<Stopped> for PyErr {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::Task(error) => error::of_task(error),
            Stopped::Python(error) => error,
        }
    }
}

/// Flies a mission in one process as fast as possible; a `strategy` chooses the search points.
#[pyfunction]
#[pyo3(signature = (scenario, *, progress = None, record = None, strategy = None))]
pub(crate) fn run(
    py: Python<'_>,
    scenario: &Scenario,
    progress: Option<Py<PyAny>>,
    record: Option<PathBuf>,
    strategy: Option<Py<PyAny>>,
) -> PyResult<Flown> {
    let mut setup = scenario.setup.clone();
    let leader = strategy.map(|strategy| {
        let search = &mut setup.scenario.search;
        search.strategy = sc::OUTSIDE.to_owned();
        Leader::new(strategy, search.step_s)
    });
    let setup = &setup;
    for warning in preflight::check(setup).map_err(error::of_task)? {
        let text = CString::new(format!("before take-off: {warning}"))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)?;
    }
    let look_up = |sim_s: f64| -> Result<(), Stopped> {
        Python::attach(|py| {
            py.check_signals()?;
            if let Some(progress) = &progress {
                progress.call1(py, (sim_s, setup.scenario.mission.duration_s))?;
            }
            Ok(())
        })
        .map_err(Stopped::Python)
    };
    Ok(py.detach(|| fly(setup, record, leader, look_up))?)
}

fn fly(
    setup: &Setup,
    record: Option<PathBuf>,
    mut leader: Option<Leader>,
    look_up: impl Fn(f64) -> Result<(), Stopped>,
) -> Result<Flown, Stopped> {
    let started = Instant::now();
    let run = match leader {
        Some(_) => Run::led(setup),
        None => Run::new(setup),
    };
    let mut run = run.map_err(TaskError::from)?;
    let context = campaign::summary_context(setup).map_err(TaskError::from)?;
    let (mut summariser, mut heard) = (Summariser::new(context), heard(setup));
    let recorder = record.map(|path| -> Result<ThreadedRecorder, TaskError> {
        Ok(ThreadedRecorder::create(
            &path,
            &mission_record::run_info(setup)?,
        )?)
    });
    let mut recorder = recorder.transpose()?;
    let mut looked_up = Instant::now();
    while !run.ended() {
        for (topic, envelope) in run.step() {
            summariser.take(topic, envelope);
            heard.take(topic, envelope);
            if let Some(leader) = &mut leader {
                leader.take(topic, envelope);
            }
            if let Some(recorder) = &mut recorder {
                recorder.record(topic, envelope).map_err(TaskError::from)?;
            }
        }
        if let Some(leader) = &mut leader {
            let now = run.now();
            leader.lead(&mut run, now).map_err(Stopped::Python)?;
        }
        if looked_up.elapsed() >= LOOK_UP {
            let end_s = setup.scenario.mission.duration_s;
            look_up(run.now().s().min(end_s))?;
            looked_up = Instant::now();
        }
    }
    look_up(setup.scenario.mission.duration_s)?;
    let digest = run.digest();
    if let Some(recorder) = recorder {
        recorder.finish(Some(&digest)).map_err(TaskError::from)?;
    }
    let wall_s = started.elapsed().as_secs_f64();
    Ok(Flown {
        summary: summariser.summary(&digest, wall_s).to_json(),
        digest,
        scenario: setup.scenario.to_toml(),
        told: heard.flown(),
    })
}

fn heard(setup: &Setup) -> FlownBuilder {
    let mission = &setup.scenario.mission;
    let start_unix_ns = mission.start_unix_ns();
    FlownBuilder::new(&mission.name, setup.scenario.gas(), start_unix_ns)
}

/// Reads a recording (MCAP).
#[pyfunction]
pub(crate) fn read_recording(py: Python<'_>, path: PathBuf) -> PyResult<Flown> {
    py.detach(|| read(&path)).map_err(error::of_task)
}

fn read(path: &std::path::Path) -> Result<Flown, TaskError> {
    let recording: Recording = record::read_mcap(path)?;
    let setup = scenario_files::load_recorded(&recording)?;
    let (digest, ending) = recording.digest()?;
    let mut summariser = Summariser::new(campaign::summary_context(&setup)?);
    let mut heard = heard(&setup);
    for message in recording.in_order()? {
        let (topic, envelope) = message?;
        summariser.take(&topic, &envelope);
        heard.take(&topic, &envelope);
    }
    let mut told = heard.flown();
    told.notices.extend(ending.loss());
    Ok(Flown {
        // How long it took is not recorded: what is not finite is null.
        summary: summariser.summary(&digest, f64::NAN).to_json(),
        digest,
        scenario: setup.scenario.to_toml(),
        told,
    })
}
