//! Adds a mechanism of your own to those of the catalogue.
//!
//! ```sh
//! cargo run --release --example own_mechanism
//! ```
//!
//! A *mechanism* is a named extension of the model: an id, parameters with units, an equation.
//! Those of the catalogue (docs/mechanisms.md) are data: a `[[mechanism]]` table of a scenario adds
//! one. The catalogue is closed to other crates, so try a missing effect from outside first, as
//! here: a furnace works in batches, and the stack emits for part of the time only. If the effect is
//! worth keeping, give it an entry in the file of its family,
//! `crates/plume/src/mechanism/source.rs`; scenario files, the simulator and the gap analysis then
//! use it. ARCHITECTURE.md lists the parts of an entry.

use air::wind::towards_deg;
use anyhow::{Context, Result};
use plume::{DispersionModel, DispersionSpec, Mechanism, Place, Sensor};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;

const SCENARIO: &str = "scenarios/as-pontes.toml";

/// The source emits during the first part of every period only, and more then, so that its mean is
/// unchanged.
#[derive(Clone, Copy)]
struct BatchEmission {
    period_s: f64,
    part_on: f64,
}

impl BatchEmission {
    /// Factor on the emission at `emitted_s`.
    fn factor(self, emitted_s: f64) -> f64 {
        let phase = (emitted_s / self.period_s).rem_euclid(1.0);
        if phase < self.part_on {
            1.0 / self.part_on
        } else {
            0.0
        }
    }

    /// The field of `model` with this effect, ppm: air at x was emitted x/u ago.
    fn mean_ppm(self, model: &DispersionModel, place: &Place, time_s: f64) -> f64 {
        let wind = &model.spec().wind;
        let (east, north) = towards_deg(wind.from_deg()).to_radians().sin_cos();
        let downwind_m = place.east_m * east + place.north_m * north;
        let speed_m_s = wind.speed_at_m_s(model.spec().sources[0].effective_height_agl_m);
        let background_ppm = model.background_ppm(place, time_s);
        let excess_ppm = model.mean_ppm(place, time_s) - background_ppm;
        background_ppm + excess_ppm * self.factor(time_s - downwind_m / speed_m_s)
    }
}

/// Root mean square of measured minus predicted, ppm.
fn misfit_ppm(measured: &[f64], predicted: impl Fn(f64) -> f64) -> f64 {
    let squares = measured
        .iter()
        .enumerate()
        .map(|(t, read)| (read - predicted(t as f64)).powi(2));
    (squares.sum::<f64>() / measured.len() as f64).sqrt()
}

fn main() -> Result<()> {
    let base = std::fs::read_to_string(SCENARIO).context(SCENARIO)?;

    // One of the catalogue, read from a scenario file.
    let extended = format!("[[mechanism]]\nid = \"meander\"\nsigma_deg = 6.0\n\n{base}");
    let wider = Scenario::parse("as-pontes.toml", &extended)?.dispersion_model()?;
    let model = Scenario::parse("as-pontes.toml", &base)?.dispersion_model()?;
    for (name, model) in [("base", &model), ("with meander", &wider)] {
        let (sigma_y_m, _) = model.sigmas_m(1500.0);
        println!("{name}: sigma-y at 1500 m is {sigma_y_m:.0} m");
    }

    // A sensor held on the plume's axis, where a source works in batches.
    let truth = BatchEmission {
        period_s: 600.0,
        part_on: 0.4,
    };
    let wind_towards_deg = towards_deg(model.spec().wind.from_deg());
    let at = air::geo::Enu::default().displaced(wind_towards_deg, 1500.0);
    let place = Place {
        east_m: at.east_m,
        north_m: at.north_m,
        height_agl_m: 486.0,
    };
    let mut sensor = Sensor::new(&model.spec().sensor, &[], "1");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let measured: Vec<f64> = (0..1800)
        .map(|t| sensor.read(truth.mean_ppm(&model, &place, f64::from(t)), 1.0, &mut rng))
        .collect();

    // The base, the closest mechanism of the catalogue fitted by trial, and the new one likewise.
    let base_ppm = misfit_ppm(&measured, |t| model.mean_ppm(&place, t));
    let mut by_trend_ppm = f64::INFINITY;
    for step in -20..=20 {
        let rate_per_h = 0.1 * f64::from(step);
        let trend = Mechanism::new("emission-trend", &[("rate_per_h", rate_per_h)])?;
        let spec = DispersionSpec {
            mechanisms: vec![trend],
            ..model.spec().clone()
        };
        let trended = DispersionModel::new(spec)?;
        by_trend_ppm = by_trend_ppm.min(misfit_ppm(&measured, |t| trended.mean_ppm(&place, t)));
    }
    let mut best = (f64::INFINITY, truth);
    for tenth in 1..=10 {
        for period_s in [300.0, 400.0, 500.0, 600.0, 700.0, 800.0] {
            let part_on = f64::from(tenth) / 10.0;
            let tried = BatchEmission { period_s, part_on };
            let misfit = misfit_ppm(&measured, |t| tried.mean_ppm(&model, &place, t));
            if misfit < best.0 {
                best = (misfit, tried);
            }
        }
    }
    let (misfit, found) = best;
    println!("misfit of the base: {base_ppm:.0} ppm");
    println!("with emission-trend of the catalogue: {by_trend_ppm:.0} ppm");
    println!(
        "with batches, on for {:.1} of {} s: {misfit:.0} ppm",
        found.part_on, found.period_s
    );
    Ok(())
}
