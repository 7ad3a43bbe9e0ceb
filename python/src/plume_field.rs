//! The mean concentration field on arrays.

use crate::error::{self, InputError};
use crate::scenario::Scenario;
use air::geo::{Geodetic, LocalFrame};
use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use plume::{DispersionModel, PlaceColumns};
use pyo3::prelude::*;

/// Numbers for Python.
type Array<'py> = Bound<'py, PyArray1<f64>>;

/// The mean plume of a scenario.
#[pyclass(frozen, module = "plumage._plumage")]
pub(crate) struct Plume {
    model: DispersionModel,
    frame: LocalFrame,
}

type Numbers<'py> = PyReadonlyArray1<'py, f64>;

/// The numbers of an array that lies in one piece.
fn slice<'a>(array: &'a Numbers<'_>, name: &str) -> PyResult<&'a [f64]> {
    let why = || InputError::new_err(format!("{name}: expected a contiguous array"));
    array.as_slice().map_err(|_| why())
}

#[pymethods]
impl Plume {
    #[new]
    fn new(scenario: &Scenario) -> PyResult<Self> {
        let scenario = &scenario.setup.scenario;
        Ok(Self {
            model: scenario.dispersion_model().map_err(|e| error::input(&e))?,
            frame: scenario.frame().map_err(|e| error::input(&e))?,
        })
    }

    #[getter]
    fn notices(&self) -> Vec<String> {
        self.model.notices().to_vec()
    }

    /// Mole fraction at places in columns, ppm, into `out`.
    fn fill_ppm(
        &self,
        py: Python<'_>,
        east_m: Numbers<'_>,
        north_m: Numbers<'_>,
        height_agl_m: Numbers<'_>,
        time_s: f64,
        mut out: PyReadwriteArray1<'_, f64>,
    ) -> PyResult<()> {
        let places = PlaceColumns {
            east_m: slice(&east_m, "east_m")?,
            north_m: slice(&north_m, "north_m")?,
            height_agl_m: slice(&height_agl_m, "height_agl_m")?,
        };
        let out = out.as_slice_mut();
        let out = out.map_err(|_| InputError::new_err("out: expected a contiguous array"))?;
        py.detach(|| self.model.write_mean_ppm(places, time_s, out))
            .map_err(|e| error::input(&e))
    }

    /// East and north of the site's origin and height above its ground, m, of places.
    fn local<'py>(
        &self,
        py: Python<'py>,
        lat_deg: Numbers<'_>,
        lon_deg: Numbers<'_>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let lat_deg = slice(&lat_deg, "lat_deg")?;
        let lon_deg = slice(&lon_deg, "lon_deg")?;
        let at = lat_deg.iter().zip(lon_deg).map(|(&lat_deg, &lon_deg)| {
            let at = self.frame.to_enu(Geodetic::new(lat_deg, lon_deg));
            (at.east_m, at.north_m)
        });
        let (east_m, north_m): (Vec<f64>, Vec<f64>) = at.unzip();
        Ok((
            PyArray1::from_vec(py, east_m),
            PyArray1::from_vec(py, north_m),
        ))
    }

    #[getter]
    fn ground_amsl_m(&self) -> f64 {
        self.frame.ground_amsl_m
    }
}
