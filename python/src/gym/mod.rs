//! Searches by the thousand, for those who learn to search.

mod information;
mod scene;
mod search;

use crate::error::InputError;
use crate::flight::Aircraft;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use search::{ACTED, Goal, OBSERVED, Outcome, Rules, Search};

/// Searches side by side, one team and one scene each.
#[pyclass(module = "plumage._plumage")]
pub(crate) struct Searches {
    rules: Rules,
    searches: Vec<Slot>,
    /// Whether a search that is over begins anew in the same step.
    goes_on: bool,
}

/// One search, and how it goes on when it is over.
struct Slot {
    seed: u64,
    /// How many searches there were of this seed.
    episode: u64,
    search: Search,
    outcomes: Vec<Outcome>,
    over: bool,
}

/// Scenes of one seed, one after another.
const EPISODES: u64 = 0x9e37_79b9_7f4a_7c15;

impl Slot {
    fn new(rules: &Rules, seed: u64) -> PyResult<Self> {
        Ok(Self {
            seed,
            episode: 0,
            search: Search::new(rules, seed)?,
            outcomes: vec![Outcome::default(); rules.agents],
            over: false,
        })
    }

    fn begin_anew(&mut self, rules: &Rules) -> PyResult<()> {
        self.episode += 1;
        let seed = self.seed.wrapping_add(self.episode.wrapping_mul(EPISODES));
        self.search = Search::new(rules, seed)?;
        Ok(())
    }
}

/// What a step gives: observations, rewards, whether they terminated and were truncated, and the last observations of
/// what was over.
type Stepped<'py> = (
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<f32>>,
);

/// Searches that a thread takes at once: enough that handing over costs nothing.
const AT_ONCE: usize = 16;

#[pymethods]
impl Searches {
    #[classattr]
    const OBSERVED: usize = OBSERVED;
    #[classattr]
    const ACTED: usize = ACTED;

    #[new]
    #[pyo3(signature = (count, *, agents, step_s, duration_s, goal, air, aircraft, goes_on))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        count: usize,
        agents: usize,
        step_s: f64,
        duration_s: f64,
        goal: &str,
        air: &str,
        aircraft: &Aircraft,
        goes_on: bool,
    ) -> PyResult<Self> {
        let wrong = |what: String| Err(InputError::new_err(what));
        if !(0.02..=60.0).contains(&step_s) {
            return wrong(format!("step_s {step_s}: expected 0.02 to 60 s"));
        }
        if !(duration_s >= step_s && duration_s <= 1e5) {
            return wrong(format!(
                "duration_s {duration_s}: expected step_s to 100000 s"
            ));
        }
        if !(1..=16).contains(&agents) {
            return wrong(format!("agents {agents}: expected 1 to 16"));
        }
        let goal = match goal {
            "peak" => Goal::Peak,
            "information" => Goal::Information,
            other => return wrong(format!("reward '{other}': expected peak or information")),
        };
        let unsteady = match air {
            "steady" => false,
            "unsteady" => true,
            other => return wrong(format!("air '{other}': expected steady or unsteady")),
        };
        let rules = Rules {
            aircraft: aircraft.aircraft.clone(),
            agents,
            step_s,
            duration_s,
            goal,
            unsteady,
        };
        let slots = (0..count as u64).map(|seed| Slot::new(&rules, seed));
        let searches = slots.collect::<PyResult<_>>()?;
        Ok(Self {
            rules,
            searches,
            goes_on,
        })
    }

    /// Begins the searches of these numbers in the scenes of these seeds.
    fn reset(&mut self, py: Python<'_>, numbers: Vec<usize>, seeds: Vec<u64>) -> PyResult<()> {
        let Self {
            rules, searches, ..
        } = self;
        py.detach(|| {
            for (number, seed) in numbers.into_iter().zip(seeds) {
                let count = searches.len();
                let slot = searches.get_mut(number).ok_or_else(|| {
                    InputError::new_err(format!("search {number}: expected 0 to {}", count - 1))
                })?;
                *slot = Slot::new(rules, seed)?;
            }
            Ok(())
        })
    }

    /// Begins the search of this number in the next scene of its seed.
    fn reset_next(&mut self, number: usize) -> PyResult<()> {
        let Self {
            rules, searches, ..
        } = self;
        match searches.get_mut(number) {
            Some(slot) => {
                slot.over = false;
                slot.begin_anew(rules)
            }
            None => Err(InputError::new_err(format!(
                "search {number} does not exist"
            ))),
        }
    }

    /// What everybody observes now.
    fn observe<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        let width = self.rules.agents * OBSERVED;
        let mut seen = vec![0.0; self.searches.len() * width];
        for (slot, out) in self.searches.iter().zip(seen.chunks_exact_mut(width)) {
            slot.search.observe(&self.rules, out);
        }
        PyArray1::from_vec(py, seen)
    }

    /// Everybody acts.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: PyReadonlyArray1<'_, f32>,
    ) -> PyResult<Stepped<'py>> {
        let Self {
            rules,
            searches,
            goes_on,
        } = self;
        let (agents, count) = (rules.agents, searches.len());
        let actions = actions.as_slice()?;
        if actions.len() != count * agents * ACTED {
            return Err(InputError::new_err(format!(
                "{} numbers of actions: expected {ACTED} for each of {agents} aircraft in {count} searches",
                actions.len()
            )));
        }
        let width = agents * OBSERVED;
        let mut seen = vec![0.0_f32; count * width];
        let mut last = vec![0.0_f32; count * width];
        let outcome = py.detach(|| -> PyResult<()> {
            searches
                .par_iter_mut()
                .with_min_len(AT_ONCE)
                .zip(actions.par_chunks_exact(agents * ACTED))
                .zip(seen.par_chunks_exact_mut(width))
                .zip(last.par_chunks_exact_mut(width))
                .try_for_each(|(((slot, actions), seen), last)| {
                    let Slot {
                        search, outcomes, ..
                    } = slot;
                    search.step(rules, actions, outcomes);
                    search.observe(rules, seen);
                    slot.over = search.is_over(outcomes);
                    last.copy_from_slice(seen);
                    if slot.over && *goes_on {
                        slot.begin_anew(rules)?;
                        slot.search.observe(rules, seen);
                    }
                    Ok(())
                })
        });
        outcome?;
        let outcomes = || searches.iter().flat_map(|slot| &slot.outcomes);
        Ok((
            PyArray1::from_vec(py, seen),
            PyArray1::from_iter(py, outcomes().map(|o| o.reward)),
            PyArray1::from_iter(py, outcomes().map(|o| o.terminated)),
            PyArray1::from_iter(py, outcomes().map(|o| o.truncated)),
            PyArray1::from_vec(py, last),
        ))
    }

    /// What a search flies in, and whether it has found the peak; none of it is observed.
    fn truth<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyDict>> {
        let truth = PyDict::new(py);
        let Some(slot) = self.searches.get(number) else {
            return Err(InputError::new_err(format!(
                "search {number} does not exist"
            )));
        };
        let (scene, peak) = (&slot.search.scene, &slot.search.scene.peak);
        truth.set_item("found", slot.search.found)?;
        truth.set_item("wind_from_deg", scene.wind.from_deg())?;
        truth.set_item("wind_speed_m_s", scene.wind.reference_speed_m_s())?;
        truth.set_item("peak_east_m", peak.east_m)?;
        truth.set_item("peak_north_m", peak.north_m)?;
        truth.set_item("peak_height_agl_m", peak.height_agl_m)?;
        truth.set_item("peak_ppm", scene.peak_ppm)?;
        Ok(truth)
    }
}
