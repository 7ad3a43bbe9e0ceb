//! A second generator of other physics: a fluctuating plume of puffs (Gifford 1959).
//!
//! Puffs leave the source twice a second. The wind carries their centres, and the eddies that are larger than a puff
//! move them about: the velocities obey a Langevin equation (Thomson 1987) whose random forces are correlated from
//! puff to puff. Eddies that are smaller spread each puff about its centre. Both together have the variance of
//! Taylor (1921); near the ground layer's usual classes this is within some per cent of Briggs' curves, which the
//! scenario states. So a reading is made of moving puffs, each with a width of its own, and not of a mean plume with
//! noise. Sensors lag, their zero walks at random, and their steps are finite.
//!
//! It shares scene, tracks, sensors and strengths with nothing else in this crate.

mod effects;
mod sensors;
mod tracks;
mod worth;

use crate::case::{Case, CaseSpec, Truth};
use crate::instrument::NoiseForm;
use crate::physics::Forward;
use crate::random::{between, between_log, normal, pick, stream};
use rand::RngExt;
use std::collections::VecDeque;
use std::f64::consts::PI;

use effects::Changes;
pub use effects::shows;
pub use worth::tuned;

/// Time between two puffs, and between two steps of all else, s.
const STEP_S: f64 = 0.5;
/// Steps from row to row.
const STEPS_PER_ROW: usize = 2;
/// A puff is forgotten once it is so much farther than the farthest sensor.
const BEYOND: f64 = 1.3;

/// Turbulence of the classes B to E: intensity and length scale, m, across and up.
const AIR: [(f64, f64, f64, f64); 4] = [
    (0.16, 3300.0, 0.12, 1e5),
    (0.11, 3300.0, 0.08, 1700.0),
    (0.08, 3300.0, 0.06, 280.0),
    (0.06, 3300.0, 0.03, 550.0),
];

/// All that is the same with and without effects.
struct World {
    seed: u64,
    origin_deg: (f64, f64),
    ground_amsl_m: f64,
    class: usize,
    speed_m_s: f64,
    from_deg: f64,
    /// Slow turns of the wind: standard deviation, degrees, and correlation time, s.
    turns: (f64, f64),
    has_wind_log: bool,
    axis_m: f64,
    emission_kg_s: f64,
    background_ppm: f64,
    temperature_c: f64,
    pressure_hpa: f64,
    /// Part of the variance that is due to motions of whole puffs, and how long an eddy takes to pass, s.
    meander: (f64, f64),
    sensor: sensors::Sensor,
    rows: usize,
    /// Places of each platform at every step: m downwind, to the right of the axis, and above ground.
    tracks: Vec<Vec<[f64; 3]>>,
    /// Keys that are uncertain, with one standard deviation and truth less scenario.
    uncertain: Vec<(&'static str, f64, f64)>,
}

impl World {
    fn draw(spec: &CaseSpec) -> Self {
        let mut rng = stream(spec.seed, "puffs/world");
        let class = pick(&mut rng, &[0, 1, 2, 2, 3]);
        let speed_m_s = between(&mut rng, 3.0, 9.0);
        let axis_m = between_log(&mut rng, 20.0, 250.0);
        let near_m = between(&mut rng, 250.0, 600.0);
        let far_m = near_m * between(&mut rng, 2.0, 5.0);
        let meander = match spec.noise {
            NoiseForm::Meandering => (between(&mut rng, 0.5, 0.8), between(&mut rng, 20.0, 60.0)),
            NoiseForm::Intermittent => (between(&mut rng, 0.6, 0.85), between(&mut rng, 2.0, 6.0)),
            _ => (between(&mut rng, 0.1, 0.35), between(&mut rng, 3.0, 10.0)),
        };
        let rows = pick(&mut rng, &[300, 400, 500]);
        let (temperature_c, pressure_hpa) = (between(&mut rng, 0.0, 30.0), 1013.25);
        let mut world = Self {
            seed: spec.seed,
            origin_deg: (
                between(&mut rng, -50.0, 60.0),
                between(&mut rng, -170.0, 170.0),
            ),
            ground_amsl_m: 0.0,
            class,
            speed_m_s,
            from_deg: between(&mut rng, 0.0, 360.0),
            turns: (
                between(&mut rng, 0.3, 3.0),
                between(&mut rng, 300.0, 1500.0),
            ),
            has_wind_log: rng.random_bool(0.8),
            axis_m,
            emission_kg_s: 1.0,
            background_ppm: between(&mut rng, 405.0, 450.0),
            temperature_c,
            pressure_hpa,
            meander,
            sensor: sensors::Sensor::draw(&mut rng),
            rows,
            tracks: Vec::new(),
            uncertain: Vec::new(),
        };
        if !world.has_wind_log {
            world.turns.0 = 0.3;
        }
        // So strong that the axis shows a clear plume halfway.
        let middle_m = (near_m * far_m).sqrt();
        let (y_m, z_m) = world.spread_m(middle_m);
        let peak_ppm = between_log(&mut rng, 40.0, 600.0);
        world.emission_kg_s =
            peak_ppm * 2.0 * PI * y_m * z_m * speed_m_s / world.ppm_per_kg_m3(axis_m);
        world.tracks = tracks::team(&world, near_m, far_m, &mut rng);
        world.draw_uncertain(spec);
        world
    }

    fn draw_uncertain(&mut self, spec: &CaseSpec) {
        let mut rng = stream(spec.seed, "puffs/uncertain");
        let certain = effects::certain(&spec.hidden);
        for (key, sd) in [
            ("weather.wind_from_deg", between(&mut rng, 1.0, 5.0)),
            (
                "source.effective_height_m",
                self.axis_m * between(&mut rng, 0.02, 0.1),
            ),
            (
                "source.emission_kg_s",
                self.emission_kg_s * between(&mut rng, 0.1, 0.4),
            ),
            ("background.co2_ppm", between(&mut rng, 0.5, 5.0)),
        ] {
            let (here, off) = (rng.random_bool(0.8), normal(&mut rng).clamp(-2.0, 2.0));
            if here && !certain.contains(&key) {
                self.uncertain.push((key, sd, off * sd));
            }
        }
    }

    fn off(&self, key: &str) -> f64 {
        let known = self.uncertain.iter().find(|u| u.0 == key);
        known.map_or(0.0, |u| u.2)
    }

    /// Standard deviations of the whole plume at `x_m`, m: Taylor (1921).
    fn spread_m(&self, x_m: f64) -> (f64, f64) {
        let (iy, ly, iz, lz) = AIR[self.class];
        (taylor_m(iy, ly, x_m), taylor_m(iz, lz, x_m))
    }

    /// ppm that one kg/m³ of CO2 makes, in air of the scenario's gradient of temperature.
    fn ppm_per_kg_m3(&self, z_m: f64) -> f64 {
        let kelvin = self.temperature_c + 273.15;
        let moles = self.pressure_hpa * 100.0 / (8.314_463 * kelvin);
        1e6 / (0.044_009_5 * moles * (1.0 - 0.0065 * z_m / kelvin).powf(4.2559))
    }

    /// Excess at each platform at every step, ppm, in the turbulence of a `realisation`.
    fn excess_ppm(&self, changes: &Changes, realisation: u64) -> Vec<Vec<f64>> {
        let mut rng = stream(self.seed ^ realisation.rotate_left(40), "puffs/air");
        let farthest_m = self.farthest_m();
        let speed_m_s = self.speed_m_s * changes.ln_speed.exp();
        let before = (farthest_m / speed_m_s / STEP_S) as usize;
        let (iy, ly, iz, lz) = AIR[self.class];
        let (iy, iz) = (iy * changes.ln_across.exp(), iz * changes.ln_up.exp());
        // Each width follows the mean wind's time, as an anemometer's log would have it.
        let keeps = [ly, lz].map(|l| (-STEP_S * self.speed_m_s / l).exp());
        let sds = [iy, iz].map(|i| i * self.speed_m_s * self.meander.0.sqrt());
        let own = (1.0 - self.meander.0).sqrt();
        let alike = (-STEP_S / self.meander.1).exp();
        let mut released = [normal(&mut rng), normal(&mut rng)];
        let turns = self.turns_deg();
        let mut puffs: VecDeque<Puff> = VecDeque::new();
        let mut out = vec![Vec::with_capacity(self.rows * STEPS_PER_ROW); self.tracks.len()];
        let steps = self.rows * STEPS_PER_ROW;
        for k in 0..before + steps {
            let time_s = (k as f64 - before as f64) * STEP_S;
            let turn_deg = if k < before {
                turns[0]
            } else {
                turns[k - before]
            };
            let turn = changes.turn_deg
                + self.off("weather.wind_from_deg")
                + changes.turn_deg_per_h * time_s / 3600.0
                + changes.swing_deg * effects::wave(time_s)
                + turn_deg;
            // Clockwise from the axis is to its right.
            let (right, along) = turn.to_radians().sin_cos();
            for r in &mut released {
                *r = alike * *r + (1.0 - alike * alike).sqrt() * normal(&mut rng);
            }
            let mut force = [normal(&mut rng), normal(&mut rng)];
            for puff in puffs.iter_mut().rev() {
                for (c, force) in force.iter_mut().enumerate() {
                    *force = alike * *force + (1.0 - alike * alike).sqrt() * normal(&mut rng);
                    let noise = (1.0 - keeps[c] * keeps[c]).sqrt() * sds[c] * *force;
                    puff.drift_m_s[c] = keeps[c] * puff.drift_m_s[c] + noise;
                }
                let [across, up] = puff.drift_m_s;
                puff.place_m[0] += STEP_S * (speed_m_s * along - across * right);
                puff.place_m[1] += STEP_S * (speed_m_s * right + across * along);
                puff.place_m[2] += STEP_S * up;
                puff.age_s += STEP_S;
            }
            while puffs.front().is_some_and(|p| p.place_m[0] > farthest_m) {
                puffs.pop_front();
            }
            for (place_m, part) in
                changes.sources(self.axis_m + self.off("source.effective_height_m"))
            {
                let rate = changes.emission_factor(time_s)
                    * (1.0 + self.off("source.emission_kg_s") / self.emission_kg_s);
                puffs.push_back(Puff {
                    place_m,
                    drift_m_s: [released[0] * sds[0], released[1] * sds[1]],
                    age_s: 0.0,
                    mass_kg: self.emission_kg_s * rate.max(0.0) * part * STEP_S,
                });
            }
            if k < before {
                continue;
            }
            let shapes: Vec<Shape> = puffs
                .iter()
                .filter(|p| p.age_s > 0.0)
                .map(|p| {
                    let way_m = p.age_s * self.speed_m_s;
                    let y_m = own * taylor_m(iy, ly, way_m);
                    let z_m = own * taylor_m(iz, lz, way_m);
                    let left = (-changes.loss_per_s * p.age_s).exp();
                    Shape {
                        place_m: p.place_m,
                        spread_m: (y_m, z_m),
                        kg_m3: p.mass_kg * left / ((2.0 * PI).powf(1.5) * y_m * y_m * z_m),
                    }
                })
                .collect();
            for (p, out) in out.iter_mut().enumerate() {
                let at = changes.seen_m(self, p, k - before);
                let sum: f64 = shapes.iter().map(|s| s.kg_m3_at(&at)).sum();
                out.push(sum * self.ppm_per_kg_m3(at[2]));
            }
        }
        out
    }

    /// Turn of the wind at every step, degrees: the same in all realisations, since it is logged.
    fn turns_deg(&self) -> Vec<f64> {
        let mut rng = stream(self.seed, "puffs/turns");
        let mut turn = crate::random::OrnsteinUhlenbeck::new(self.turns.1, &mut rng);
        let steps = self.rows * STEPS_PER_ROW;
        (0..steps)
            .map(|_| self.turns.0 * turn.step(STEP_S, &mut rng))
            .collect()
    }
}

/// Taylor's standard deviation for a turbulence intensity and a length scale, m.
fn taylor_m(intensity: f64, length_m: f64, x_m: f64) -> f64 {
    let x = x_m.max(1.0) / length_m;
    let factor = if x < 1e-3 {
        x * x / 2.0
    } else {
        x - 1.0 + (-x).exp()
    };
    intensity * length_m * (2.0 * factor).sqrt()
}

struct Puff {
    place_m: [f64; 3],
    drift_m_s: [f64; 2],
    age_s: f64,
    mass_kg: f64,
}

/// A puff as it is at one moment.
struct Shape {
    place_m: [f64; 3],
    spread_m: (f64, f64),
    kg_m3: f64,
}

impl Shape {
    fn kg_m3_at(&self, place_m: &[f64; 3]) -> f64 {
        let (y_m, z_m) = self.spread_m;
        let d = |k: usize| place_m[k] - self.place_m[k];
        let across = (d(0).powi(2) + d(1).powi(2)) / (y_m * y_m);
        if across > 40.0 {
            return 0.0;
        }
        self.kg_m3 * (-0.5 * (across + (d(2) / z_m).powi(2))).exp()
    }
}

/// The case of `spec` by this generator; effects that it does not know stay out.
pub fn make(spec: &CaseSpec) -> Case {
    let world = World::draw(spec);
    let peak_ppm = worth::peak_ppm(&world);
    let (changes, effects) = effects::hide(&world, &spec.hidden, peak_ppm);
    let excess = world.excess_ppm(&changes, 0);
    Case {
        scenario_toml: world.to_toml(),
        observations: vec![(
            "flight.csv".to_owned(),
            sensors::csv(&world, &changes, &excess),
        )],
        truth: Truth {
            effects,
            forward: Forward::Puffs,
            noise: spec.noise,
            other_laws: false,
            damage: None,
        },
    }
}

impl World {
    fn to_toml(&self) -> String {
        let mut toml = format!(
            "[site]\nlat_deg = {:.8}\nlon_deg = {:.8}\nground_amsl_m = {:.1}\n\n[weather]\n\
             wind_speed_m_s = {:.4}\nwind_height_agl_m = 10.0\nwind_from_deg = {:.3}\nwind_exponent = 0.0\n\
             stability = \"{}\"\nsetting = \"rural\"\ntemperature_c = {:.2}\npressure_hpa = {:.2}\n\n\
             [[source]]\nname = \"vent\"\ngas = \"co2\"\nlat_deg = {:.8}\nlon_deg = {:.8}\n\
             effective_height_m = {:.2}\nemission_kg_s = {:.5}\n\n[background]\nco2_ppm = {:.2}\n\n\
             [sensor]\ntime_constant_s = {}\nnoise_sd_ppm = {:.3}\n\n[uncertain]\n",
            self.origin_deg.0,
            self.origin_deg.1,
            self.ground_amsl_m,
            self.speed_m_s,
            self.from_deg,
            ["B", "C", "D", "E"][self.class],
            self.temperature_c,
            self.pressure_hpa,
            self.origin_deg.0,
            self.origin_deg.1,
            self.axis_m,
            self.emission_kg_s,
            self.background_ppm,
            self.sensor.lag_s,
            self.sensor.white_ppm,
        );
        for (key, sd, _) in &self.uncertain {
            toml.push_str(&format!("\"{key}\" = {sd:.5}\n"));
        }
        toml
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::PlumeEffect;

    // The oracle is the Gaussian plume of the whole spread: a fluctuating plume has it in the mean.
    #[test]
    fn the_mean_of_many_puffs_is_the_gaussian_plume() {
        let mut world = World::draw(&CaseSpec::none(3));
        world.turns.0 = 0.0;
        world.uncertain.clear();
        let (x_m, rows) = (500.0, world.rows);
        world.tracks = vec![vec![[x_m, 0.0, world.axis_m]; rows * STEPS_PER_ROW]];
        let excess = (1..=10).map(|r| world.excess_ppm(&Changes::none(&world), r));
        let all: Vec<f64> = excess.flat_map(|mut e| e.remove(0)).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let (y_m, z_m) = world.spread_m(x_m);
        let gaussian = world.emission_kg_s / (2.0 * PI * world.speed_m_s * y_m * z_m)
            * world.ppm_per_kg_m3(world.axis_m);
        assert!((mean / gaussian - 1.0).abs() < 0.1, "{mean} {gaussian}");
    }

    // Briggs (1973), rural, class D: 80 m/sqrt(1.1) across and 60 m/sqrt(2.5) up at 1 km.
    #[test]
    fn the_spread_is_about_that_of_the_class() {
        let (_, _, iz, lz) = AIR[2];
        assert!((taylor_m(AIR[2].0, AIR[2].1, 1000.0) / 76.28 - 1.0).abs() < 0.05);
        assert!((taylor_m(iz, lz, 1000.0) / 37.95 - 1.0).abs() < 0.05);
    }

    #[test]
    fn cases_are_reproduced_and_effects_show() {
        let effect = PlumeEffect::SigmaYScale;
        let tuned = tuned(&CaseSpec::one(1, effect, 0.0), &[20.0]).unwrap();
        assert!((tuned.nats[0] / 20.0 - 1.0).abs() < 0.3, "{:?}", tuned.nats);
        let case = make(&tuned.spec);
        assert_eq!(case, make(&tuned.spec));
        assert_eq!(case.truth.effects[0].effect, effect);
        assert_ne!(case.observations, make(&CaseSpec::none(1)).observations);
    }
}
