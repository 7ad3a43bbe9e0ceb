//! One team that searches one plume.

use super::information::Information;
use super::scene::{ARENA_M, BACKGROUND_PPM, HEIGHTS_M, KEEP_OUT_M, NOISE_PPM, Scene, sensor};
use crate::error;
use air::isa::Atmosphere;
use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::{AirAround, Aircraft, FlightSim, FlightState};
use plume::{Place, Puffs, Sensor};
use pyo3::PyResult;
use rand::RngExt as _;
use rand::rngs::ChaCha8Rng;
use scenario::random::stream;
use std::sync::Arc;

/// Numbers of an observation.
pub(crate) const OBSERVED: usize = 16;
/// Numbers of an action: turn, height, airspeed.
pub(crate) const ACTED: usize = 3;
/// Largest turn that can be asked for at once, degrees.
const TURN_DEG: f64 = 90.0;
/// Part of the aircraft's greatest airspeed that can be asked for: the rest is the autopilot's.
const SPEED_SHARE: f64 = 0.9;
/// Time between two looks of the autopilot, s.
const TICK_S: f64 = 0.02;
/// Puffs are carried on this often, s: they move by less than their spread in that time.
const PUFFS_S: f64 = 1.0;
/// The peak is found within this distance on the map and in height, m: the plume's own standard deviations there, about.
const FOUND_M: [f64; 2] = [60.0, 40.0];
/// What finding the peak is worth, and what leaving the arena or entering the keep-out costs.
const FOUND: f64 = 10.0;
const LEFT: f64 = -10.0;
/// Nearer than this to another of the team costs [`NEAR_COST`] a second, m.
const NEAR_M: f64 = 50.0;
const NEAR_COST: f64 = -1.0;
/// The arena's ceiling and floor are this far beyond what can be asked for, m.
const BEYOND_M: f64 = 60.0;
/// Begins upwind of the stack, at these distances, m.
const START_UPWIND_M: [f64; 2] = [1300.0, 1900.0];
/// Aircraft begin beside each other, this far apart, m.
const START_APART_M: f64 = 100.0;
/// Logarithms of readings over noise are observed in parts of this: that of 3,000 ppm.
const LOG_SCALE: f64 = 7.0;

/// What is rewarded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Goal {
    /// Reading more than before, and being at the peak.
    Peak,
    /// Learning the plume's direction, height and strength.
    Information,
}

/// What all searches of a fleet have in common.
#[derive(Debug, Clone)]
pub(crate) struct Rules {
    pub(crate) aircraft: Arc<Aircraft>,
    pub(crate) agents: usize,
    /// Time between two actions, s.
    pub(crate) step_s: f64,
    /// Length of an episode, s.
    pub(crate) duration_s: f64,
    pub(crate) goal: Goal,
    pub(crate) unsteady: bool,
}

/// One of the team.
#[derive(Debug)]
struct Searcher {
    sim: FlightSim,
    autopilot: Autopilot,
    demand: Demand,
    sensor: Sensor,
    /// As it flies now: asked for once, since it costs a fifth of a tick.
    state: FlightState,
    reading_ppm: f64,
    flies: bool,
}

/// What became of one of the team in a step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Outcome {
    pub(crate) reward: f32,
    pub(crate) terminated: bool,
    pub(crate) truncated: bool,
}

/// One team in one scene.
#[derive(Debug)]
pub(crate) struct Search {
    pub(crate) scene: Scene,
    team: Vec<Searcher>,
    rng: ChaCha8Rng,
    time_s: f64,
    /// Signal over noise of the best reading, in logarithms, and where it was read.
    best: f64,
    best_at: Place,
    information: Information,
    puffs: Option<(f64, Puffs)>,
    pub(crate) found: bool,
}

fn place(state: &FlightState) -> Place {
    Place {
        east_m: state.east_m,
        north_m: state.north_m,
        height_agl_m: state.alt_amsl_m,
    }
}

/// A reading over the noise, in logarithms.
fn signal(reading_ppm: f64) -> f64 {
    ((reading_ppm - BACKGROUND_PPM).max(0.0) / NOISE_PPM).ln_1p()
}

/// A height in −1 to 1 of those that can be asked for.
fn part_of_heights(height_agl_m: f64) -> f64 {
    let [low, high] = HEIGHTS_M;
    2.0 * (height_agl_m - low) / (high - low) - 1.0
}

/// What a part of −1 to 1 is between two bounds.
fn between(part: f32, [low, high]: [f64; 2]) -> f64 {
    low + 0.5 * (f64::from(part).clamp(-1.0, 1.0) + 1.0) * (high - low)
}

impl Search {
    /// A team at its start in the scene of a seed.
    pub(crate) fn new(rules: &Rules, seed: u64) -> PyResult<Self> {
        let scene = Scene::new(seed, rules.unsteady).map_err(|e| error::input(&e))?;
        let mut rng = stream(seed, "gym/team");
        let [e, n] = scene.downwind;
        let along_m = -rng.random_range(START_UPWIND_M[0]..START_UPWIND_M[1]);
        let across_m = rng.random_range(-0.5 * ARENA_M..0.5 * ARENA_M);
        let height_m = rng.random_range(HEIGHTS_M[0]..HEIGHTS_M[1]);
        let heading_deg = air::geo::wrap_deg(e.atan2(n).to_degrees());
        let limits = &rules.aircraft.limits;
        let mut team = Vec::with_capacity(rules.agents);
        for k in 0..rules.agents {
            let beside_m = (k as f64 - 0.5 * (rules.agents as f64 - 1.0)) * START_APART_M;
            let across_m = across_m + beside_m;
            let (east_m, north_m) = (along_m * e - across_m * n, along_m * n + across_m * e);
            let airspeed_m_s = limits.airspeed_cruise_m_s;
            let sim = FlightSim::airborne(
                &rules.aircraft,
                north_m,
                east_m,
                height_m,
                heading_deg,
                airspeed_m_s,
            )
            .map_err(|e| error::input(&e))?;
            team.push(Searcher {
                state: sim.state(),
                sim,
                autopilot: Autopilot::new(&rules.aircraft),
                demand: Demand {
                    path: Path::Course { deg: heading_deg },
                    alt_amsl_m: height_m,
                    airspeed_m_s,
                },
                sensor: Sensor::new(&sensor(), &[], ""),
                reading_ppm: BACKGROUND_PPM,
                flies: true,
            });
        }
        Ok(Self {
            best: 0.0,
            best_at: Place::default(),
            information: Information::prior(),
            puffs: None,
            found: false,
            time_s: 0.0,
            scene,
            team,
            rng,
        })
    }

    /// Takes what each of the team shall do, flies a step, and tells what became of each.
    pub(crate) fn step(&mut self, rules: &Rules, actions: &[f32], outcomes: &mut [Outcome]) {
        self.carry_puffs();
        self.time_s += rules.step_s;
        let ticks = (rules.step_s / TICK_S - 1e-9).ceil().max(1.0);
        let dt_s = rules.step_s / ticks;
        let atmosphere = Atmosphere::standard();
        let over = self.time_s >= rules.duration_s - 0.5 * rules.step_s;
        for (k, outcome) in outcomes.iter_mut().enumerate() {
            *outcome = Outcome::default();
            let one = &mut self.team[k];
            if !one.flies {
                continue;
            }
            one.obey(rules, &actions[k * ACTED..][..ACTED]);
            let state = &one.state;
            let wind_m_s = self.scene.wind.speed_at_m_s(state.alt_amsl_m);
            let [to_east, to_north] = self.scene.downwind;
            let eddies = self.scene.unsteady.as_mut();
            let [east, north, up] =
                eddies.map_or([0.0; 3], |air| air.wind_m_s(self.time_s, state.alt_amsl_m));
            let air = AirAround {
                wind_ned_m_s: [wind_m_s * to_north + north, wind_m_s * to_east + east, -up],
                density_kg_m3: atmosphere.at(state.alt_amsl_m).density_kg_m3(),
            };
            for _ in 0..ticks as u64 {
                let sensed = Sensed::perfect(&one.state, air.density_kg_m3);
                let command = one.autopilot.command(dt_s, &sensed, &one.demand);
                one.sim.step(dt_s, &air, &command);
                one.state = one.sim.state();
            }
            let at = place(&one.state);
            let ppm = match &self.puffs {
                Some((_, puffs)) => self.scene.model.ppm_among(puffs, &at),
                None => self.scene.model.mean_ppm(&at, self.time_s),
            };
            one.reading_ppm = one.sensor.read(ppm, rules.step_s, &mut self.rng);
            outcome.reward = self.reward(rules, k, &at) as f32;
            outcome.truncated = over;
            if is_outside(&at) {
                outcome.terminated = true;
                outcome.reward += LEFT as f32;
                self.team[k].flies = false;
            }
        }
        self.keep_apart(rules, outcomes);
        if self.found && rules.goal == Goal::Peak {
            for (one, outcome) in self.team.iter().zip(outcomes) {
                outcome.terminated |= one.flies;
            }
        }
    }

    /// Whether no vehicle of the team is flying.
    pub(crate) fn is_over(&self, outcomes: &[Outcome]) -> bool {
        let flies_on = |(one, outcome): (&Searcher, &Outcome)| {
            one.flies && !outcome.terminated && !outcome.truncated
        };
        !self.team.iter().zip(outcomes).any(flies_on)
    }

    fn carry_puffs(&mut self) {
        if self.scene.unsteady.is_none() {
            return;
        }
        let now = &self.puffs;
        if now
            .as_ref()
            .is_some_and(|(at_s, _)| self.time_s - at_s < PUFFS_S)
        {
            return;
        }
        let unsteady = self.scene.unsteady.as_mut();
        let puffs = self
            .scene
            .model
            .puffs(&self.scene.slow, 0.0, unsteady, self.time_s);
        self.puffs = Some((self.time_s, puffs));
    }

    fn reward(&mut self, rules: &Rules, k: usize, at: &Place) -> f64 {
        let signal = signal(self.team[k].reading_ppm);
        let more = (signal - self.best).max(0.0);
        if more > 0.0 {
            self.best = signal;
            self.best_at = *at;
        }
        let peak = &self.scene.peak;
        let off_m = (at.east_m - peak.east_m).hypot(at.north_m - peak.north_m);
        let off_height_m = (at.height_agl_m - peak.height_agl_m).abs();
        let is_there = off_m <= FOUND_M[0] && off_height_m <= FOUND_M[1];
        let first = is_there && !self.found;
        self.found |= is_there;
        match rules.goal {
            Goal::Peak => more + if first { FOUND } else { 0.0 },
            Goal::Information => self.information.take(&self.scene, at, rules.step_s),
        }
    }

    fn keep_apart(&self, rules: &Rules, outcomes: &mut [Outcome]) {
        for (k, outcome) in outcomes.iter_mut().enumerate() {
            if self
                .nearest(k)
                .is_some_and(|(distance_m, _)| distance_m < NEAR_M)
            {
                outcome.reward += (NEAR_COST * rules.step_s) as f32;
            }
        }
    }

    /// How far the nearest other one is that flies, m, and where, as seen from the `k`-th, m east, north and up.
    fn nearest(&self, k: usize) -> Option<(f64, [f64; 3])> {
        if self.team.len() < 2 || !self.team[k].flies {
            return None;
        }
        let here = place(&self.team[k].state);
        let others = self.team.iter().enumerate();
        let others = others.filter(|(other, one)| *other != k && one.flies);
        let off = others.map(|(_, one)| {
            let there = place(&one.state);
            let off = [
                there.east_m - here.east_m,
                there.north_m - here.north_m,
                there.height_agl_m - here.height_agl_m,
            ];
            (off[0].hypot(off[1]).hypot(off[2]), off)
        });
        off.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// What each of the team observes, [`OBSERVED`] numbers of −1 to 1 each.
    pub(crate) fn observe(&self, rules: &Rules, out: &mut [f32]) {
        let limits = &rules.aircraft.limits;
        let best = self
            .scene
            .along_across(self.best_at.east_m, self.best_at.north_m);
        for (k, out) in out.chunks_exact_mut(OBSERVED).enumerate() {
            let one = &self.team[k];
            let state = &one.state;
            let at = self.scene.along_across(state.east_m, state.north_m);
            let [north, east, down] = state.vel_ned_m_s;
            let over_ground = self.scene.along_across(east, north);
            let speed = over_ground[0].hypot(over_ground[1]).max(1.0);
            let wind_m_s = self.scene.wind.speed_at_m_s(state.alt_amsl_m);
            let other = self
                .nearest(k)
                .map_or([0.0; 2], |(_, off)| self.scene.along_across(off[0], off[1]));
            let observed = [
                at[0] / ARENA_M,
                at[1] / ARENA_M,
                part_of_heights(state.alt_amsl_m),
                over_ground[0] / speed,
                over_ground[1] / speed,
                state.airspeed_m_s / limits.airspeed_max_m_s,
                -down / 5.0,
                wind_m_s / 15.0,
                signal(one.reading_ppm) / LOG_SCALE,
                self.best / LOG_SCALE,
                best[0] / ARENA_M,
                best[1] / ARENA_M,
                if self.best > 0.0 {
                    part_of_heights(self.best_at.height_agl_m)
                } else {
                    0.0
                },
                1.0 - self.time_s / rules.duration_s,
                other[0] / ARENA_M,
                other[1] / ARENA_M,
            ];
            for (out, value) in out.iter_mut().zip(observed) {
                *out = value.clamp(-1.0, 1.0) as f32;
            }
        }
    }
}

/// Whether a place is outside the arena, or in the keep-out around the stack.
fn is_outside(at: &Place) -> bool {
    let [low, high] = HEIGHTS_M;
    let inside = (KEEP_OUT_M..=ARENA_M).contains(&at.east_m.hypot(at.north_m))
        && (low - BEYOND_M..=high + BEYOND_M).contains(&at.height_agl_m);
    !inside
}

impl Searcher {
    fn obey(&mut self, rules: &Rules, action: &[f32]) {
        let limits = &rules.aircraft.limits;
        let [north, east, _] = self.state.vel_ned_m_s;
        let course_deg = east.atan2(north).to_degrees();
        let turn_deg = f64::from(action[0]).clamp(-1.0, 1.0) * TURN_DEG;
        let fastest_m_s = SPEED_SHARE * limits.airspeed_max_m_s;
        self.demand = Demand {
            path: Path::Course {
                deg: air::geo::wrap_deg(course_deg + turn_deg),
            },
            alt_amsl_m: between(action[1], HEIGHTS_M),
            airspeed_m_s: between(action[2], [limits.airspeed_min_m_s, fastest_m_s]),
        };
    }
}
