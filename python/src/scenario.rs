//! Scenarios.

use crate::convert;
use crate::error::{self, InputError};
use ::scenario::Scenario as Checked;
use air::geo::{Enu, Geodetic};
use mission::Setup;
use plume::Gas;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use tasks::scenario_files;

/// A checked scenario with the files that it names: docs/scenario.md describes its tables.
///
/// Scenario(path) reads a file (TOML). Files that it names are searched next to it, in the folder above and in the
/// working folder. Raises InputError with file, line and what was expected.
#[pyclass(frozen, module = "plumage")]
pub(crate) struct Scenario {
    pub(crate) setup: Setup,
    /// Beside which the files are that it names.
    pub(crate) folder: PathBuf,
}

impl Scenario {
    /// The same scenario with what was found about it, beside the same files.
    pub(crate) fn with(&self, found: &Checked) -> PyResult<Self> {
        Self::read("scenario", &found.to_toml(), &self.folder)
    }

    fn read(name: &str, text: &str, folder: &Path) -> PyResult<Self> {
        let setup = scenario_files::from_text(name, text, folder).map_err(error::of_task)?;
        let folder = folder.to_owned();
        Ok(Self { setup, folder })
    }

    fn of(&self, setup: Setup) -> Self {
        let folder = self.folder.clone();
        Self { setup, folder }
    }
}

/// A gas by its name.
pub(crate) fn gas(name: Option<&str>) -> PyResult<Option<Gas>> {
    let gas = name.map(str::parse::<Gas>).transpose();
    gas.map_err(|why| InputError::new_err(format!("gas {}: {why}", name.unwrap_or_default())))
}

#[pymethods]
impl Scenario {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let setup = scenario_files::load(&path).map_err(error::of_task)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { setup, folder })
    }

    /// Reads the text of a scenario, which is called `name` in messages; files that it names are looked for in `folder`.
    #[staticmethod]
    #[pyo3(signature = (text, *, name = "scenario", folder = PathBuf::new()))]
    #[expect(clippy::needless_pass_by_value, reason = "as PyO3 hands over paths")]
    fn from_text(text: &str, name: &str, folder: PathBuf) -> PyResult<Self> {
        Self::read(name, text, &folder)
    }

    /// Creates a scenario from its tables as dicts and lists; entries that are None are ignored.
    #[staticmethod]
    #[pyo3(signature = (tables, *, folder = PathBuf::new()))]
    #[expect(clippy::needless_pass_by_value, reason = "as PyO3 hands over paths")]
    fn from_dict(tables: &Bound<'_, PyAny>, folder: PathBuf) -> PyResult<Self> {
        let json = tables.py().import("plumage._scenario")?;
        let json: String = json.call_method1("as_json", (tables,))?.extract()?;
        let value: serde_json::Value = serde_json::from_str(&json).map_err(|e| error::input(&e))?;
        let text = toml::to_string(&value).map_err(|e| error::input(&e))?;
        Self::read("scenario", &text, &folder)
    }

    /// Name of the mission.
    #[getter]
    fn name(&self) -> &str {
        &self.setup.scenario.mission.name
    }

    /// Seed of all random numbers of a run.
    #[getter]
    fn seed(&self) -> u64 {
        self.setup.scenario.mission.seed
    }

    /// Length of the mission, simulated s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.setup.scenario.mission.duration_s
    }

    /// Gas that the sensors measure, such as "co2".
    #[getter]
    fn gas(&self) -> &str {
        self.setup.scenario.gas().as_str()
    }

    /// Ids of the team's vehicles.
    #[getter]
    fn vehicles(&self) -> Vec<String> {
        let vehicles = &self.setup.scenario.vehicles;
        vehicles.iter().map(|v| v.id.clone()).collect()
    }

    /// Beside which files are looked for that the scenario names.
    #[getter]
    fn folder(&self) -> &Path {
        &self.folder
    }

    /// The text of its file, with all defaults.
    fn to_toml(&self) -> String {
        self.setup.scenario.to_toml()
    }

    /// Its tables as dicts and lists, with all defaults.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let value: toml::Table = toml::from_str(&self.to_toml()).map_err(|e| error::run(&e))?;
        convert::said(py, serde_json::to_string(&value))
    }

    /// Returns a copy with another seed, length (simulated s) or gas, or with the last `stand_ins` vehicles of the team as
    /// stand-ins for real ones and the others simulated.
    #[pyo3(signature = (*, seed = None, duration_s = None, gas = None, stand_ins = None))]
    fn changed(
        &self,
        seed: Option<u64>,
        duration_s: Option<f64>,
        gas: Option<&str>,
        stand_ins: Option<usize>,
    ) -> PyResult<Self> {
        let setup = self.setup.clone();
        let setup = scenario_files::changed(setup, seed, duration_s).map_err(error::of_task)?;
        let gas = self::gas(gas)?;
        let mut setup = scenario_files::for_gas(setup, gas).map_err(error::of_task)?;
        if let Some(count) = stand_ins {
            setup = setup.with_stand_ins(count).map_err(|e| error::input(&e))?;
        }
        Ok(self.of(setup))
    }

    /// The stand-ins' world, as a scenario.
    fn reality(&self) -> Self {
        let scenario = self.setup.scenario.in_reality();
        let setup = self.setup.clone();
        self.of(Setup { scenario, ..setup })
    }

    /// East and north of the site's origin, m.
    fn to_local(&self, lat_deg: f64, lon_deg: f64) -> PyResult<(f64, f64)> {
        let frame = self.setup.frame().map_err(|e| error::input(&e))?;
        let Enu { east_m, north_m } = frame.to_enu(Geodetic::new(lat_deg, lon_deg));
        Ok((east_m, north_m))
    }

    /// Latitude and longitude, degrees.
    fn to_geodetic(&self, east_m: f64, north_m: f64) -> PyResult<(f64, f64)> {
        let frame = self.setup.frame().map_err(|e| error::input(&e))?;
        let at = frame.to_geodetic(Enu::new(east_m, north_m));
        Ok((at.lat_deg, at.lon_deg))
    }

    fn __repr__(&self) -> String {
        let mission = &self.setup.scenario.mission;
        format!(
            "Scenario('{}', seed={}, duration_s={})",
            mission.name, mission.seed, mission.duration_s
        )
    }
}
