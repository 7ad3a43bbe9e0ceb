//! The world in truth: what carries, spreads, makes and loses the gas, with the hidden effects
//! in it; and the mean excess at a place and time by a plain Gaussian plume or by puffs.

use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

use crate::law::{self, ReflectingBoundaries};
use crate::random::{OrnsteinUhlenbeck, stream};
use crate::scene::Scene;
use crate::wind::WindTruth;

/// How the mean excess is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Forward {
    /// A straight Gaussian plume along the wind of the moment.
    Gaussian,
    /// Puffs that the gusty wind carries, one a second; they grow with their way.
    Puffs,
    /// The same; they grow with the time that they have been under way, as in the mean wind.
    AgedPuffs,
}

/// A place where the plume is thinned: an obstacle and its lee, in plume axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wake {
    /// Distance of the obstacle, m.
    pub along_m: f64,
    /// Its place across, m to the right.
    pub across_m: f64,
    /// Half width of the lee, m.
    pub width_m: f64,
    /// Length of the lee, m.
    pub length_m: f64,
    /// Part taken away right behind it.
    pub depth: f64,
}

/// All that the effects may change. The default changes nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Physics {
    /// The effects follow laws that differ a little from the catalogue's.
    pub other_laws: bool,
    /// Added to the logged direction to get that of the transport, degrees.
    pub direction_offset_deg: f64,
    /// The same, growing with time, degrees an hour.
    pub direction_drift_deg_per_h: f64,
    /// A swing that no log shows: amplitude, degrees, and period, s.
    pub unlogged_oscillation: Option<(f64, f64)>,
    /// A wander that no log shows: standard deviation, degrees, and correlation time, s.
    pub unlogged_wander: Option<(f64, f64)>,
    /// Logarithm of the transport speed over the logged one.
    pub log_speed: f64,
    /// Turning of the direction with height above the axis, degrees in 100 m.
    pub veer_deg_per_100m: f64,
    /// Standard deviation of fast swings of the axis, degrees.
    pub meander_deg: f64,
    /// Added to the class.
    pub class_shift: f64,
    /// Logarithm of the factor on σ_y.
    pub log_sigma_y: f64,
    /// Logarithm of the factor on σ_z.
    pub log_sigma_z: f64,
    /// Exponent of (x / 1 km) on σ_z.
    pub sigma_z_exponent: f64,
    /// Added to the height of the axis, m.
    pub axis_offset_m: f64,
    /// Part of the plume that the ground sends back.
    pub reflection: f64,
    /// A lid, m above ground.
    pub lid_agl_m: Option<f64>,
    /// Logarithm of the factor on the emission.
    pub log_emission: f64,
    /// Growth of the emission, 1/h.
    pub trend_per_h: f64,
    /// Pulses of the emission: amplitude and period, s.
    pub pulses: Option<(f64, f64)>,
    /// An emission that is on and off by turns: amplitude and mean length of a turn, s.
    pub on_off: Option<(f64, f64)>,
    /// Growth of both spreads with distance that levels off: logarithms of the factors far away.
    pub spread_growth: Option<(f64, f64)>,
    /// Part of the plume that is moved from the left of its axis to the right.
    pub skew: f64,
    /// A second source: east, north of the first, m; emission over the first's; height above it.
    pub second: Option<([f64; 2], f64, f64)>,
    /// Displacement of the source, m east and north.
    pub shift_m: [f64; 2],
    /// Decay, 1/s.
    pub decay_per_s: f64,
    /// Deposition velocity, m/s.
    pub deposition_m_s: f64,
    /// Frontal area of a building at the source, m².
    pub building_m2: f64,
    /// A hump of excess in travel time: relative height and time, s.
    pub transient_production: Option<(f64, f64)>,
    /// An obstacle's lee.
    pub wake: Option<Wake>,
    /// Added to the background, ppm.
    pub background_ppm: f64,
    /// Growth of the background, ppm/h.
    pub background_ppm_per_h: f64,
    /// Gradient of the background, ppm/km east and north.
    pub gradient_ppm_per_km: [f64; 2],
    /// Waves of the background: amplitude, ppm, and period, s.
    pub background_waves: Option<(f64, f64)>,
    /// A layer of other air: amplitude, ppm, middle and half depth, m above ground.
    pub layer: Option<(f64, f64, f64)>,
}

/// Longest path that a puff is followed, m.
const MAX_TRAVEL_M: f64 = 16000.0;
/// Step of the tables over the way, m.
const TABLE_M: f64 = 5.0;
/// Puffs farther from a place than this many σ are left out: exp(−4.5²/2) is 4e-5.
const CUT_SIGMAS: f64 = 4.5;

/// A world ready to be asked.
#[derive(Debug)]
pub struct TruthModel<'a> {
    scene: &'a Scene,
    physics: &'a Physics,
    wind: &'a WindTruth,
    forward: Forward,
    sources: Vec<Stack>,
    sigma_y_m: Vec<f64>,
    sigma_z_m: Vec<f64>,
    boundaries: ReflectingBoundaries,
    /// Sideways angle of each second's puff, radians.
    meander_rad: Vec<f64>,
    /// +1 or -1 of each second, where the emission is on and off by turns.
    on_off: Vec<f64>,
    history_s: f64,
}

#[derive(Debug)]
struct Stack {
    place_m: [f64; 2],
    axis_m: f64,
    emission_kg_s: f64,
    airborne: Vec<f64>,
}

impl<'a> TruthModel<'a> {
    /// The world of `scene` with `physics`; `history_s` is how far back `wind` goes.
    pub fn new(
        scene: &'a Scene,
        physics: &'a Physics,
        wind: &'a WindTruth,
        forward: Forward,
        history_s: f64,
        seed: u64,
    ) -> Self {
        let steps = (MAX_TRAVEL_M / TABLE_M) as usize;
        let mut world = Self {
            scene,
            physics,
            wind,
            forward,
            sources: Vec::new(),
            sigma_y_m: Vec::with_capacity(steps + 1),
            sigma_z_m: Vec::with_capacity(steps + 1),
            boundaries: ReflectingBoundaries {
                ground: physics.reflection,
                lid_agl_m: physics.lid_agl_m,
                // The other law's lid lets a part through.
                lid: if physics.other_laws { 0.8 } else { 1.0 },
            },
            meander_rad: Vec::new(),
            on_off: Vec::new(),
            history_s,
        };
        for k in 0..=steps {
            let (y, z) = world.spread_m(k as f64 * TABLE_M);
            world.sigma_y_m.push(y);
            world.sigma_z_m.push(z);
        }
        world.place_sources(steps);
        let mut rng = stream(seed, "swings");
        // Fast beside the travel time, so that the mean over puffs is a wider plume (Gifford 1959).
        let mut angle = OrnsteinUhlenbeck::new(4.0, &mut rng);
        let until_s = history_s + scene.duration_s + 2.0 * crate::scene::MARGIN_S;
        let sd = physics.meander_deg.to_radians();
        world.meander_rad = (0..until_s as usize + 2)
            .map(|_| sd * angle.step(1.0, &mut rng))
            .collect();
        if let Some((_, turn_s)) = physics.on_off {
            // A telegraph signal: its turns have no memory.
            let mut state = 1.0;
            let mut rng = stream(seed, "on and off");
            world.on_off = (0..until_s as usize + 2)
                .map(|_| {
                    state *= if rng.random_bool(1.0 / turn_s) {
                        -1.0
                    } else {
                        1.0
                    };
                    state
                })
                .collect();
        }
        world
    }

    fn place_sources(&mut self, steps: usize) {
        let (scene, p) = (self.scene, self.physics);
        let axis_m = scene.axis_m + scene.off("source.effective_height_m") + p.axis_offset_m;
        let place = [
            scene.source_m[0] + p.shift_m[0],
            scene.source_m[1] + p.shift_m[1],
        ];
        let mut emission = scene.emission_kg_s * scene.emission_ratio() * p.log_emission.exp();
        if let Some(x_m) = scene.c_max_at_m {
            // A concentration stated for the axis was measured there, whatever the spread.
            let class = scene.class as f64;
            let stated = law::sigma_y_m(class, x_m) * law::sigma_z_m(class, x_m);
            let (y, z) = self.spread_m(x_m);
            emission *= y * z / stated;
        }
        let mut stacks = vec![(place, axis_m, emission)];
        if let Some((away, ratio, up)) = p.second {
            let there = [place[0] + away[0], place[1] + away[1]];
            stacks.push((there, (axis_m + up).max(5.0), emission * ratio));
        }
        for (place_m, axis_m, emission_kg_s) in stacks {
            let ratio = p.deposition_m_s / (scene.wind.speed_m_s * p.log_speed.exp());
            // The catalogue's law lets half of a reflected plume reach the ground; the other law
            // counts the concentration right at the ground and a surface that saturates.
            let at_ground = |x: f64| {
                let all = 1.0 + p.reflection;
                if p.other_laws {
                    all * 0.8 * (x / 1500.0).clamp(0.05, 1.5).powf(0.25)
                } else {
                    all
                }
            };
            let sigma_z = |x: f64| self.table(&self.sigma_z_m, x);
            let airborne = law::airborne_share(ratio, axis_m, TABLE_M, steps, at_ground, sigma_z);
            self.sources.push(Stack {
                place_m,
                axis_m,
                emission_kg_s,
                airborne,
            });
        }
    }

    /// (σ_y, σ_z) at `x_m`, m, with every effect but the swings of puffs.
    fn spread_m(&self, x_m: f64) -> (f64, f64) {
        let p = self.physics;
        let class = self.scene.class as f64 + p.class_shift;
        let km = (x_m.max(1.0) / 1000.0).max(0.05);
        let other = |log: f64| {
            if p.other_laws {
                log * km.powf(0.15)
            } else {
                log
            }
        };
        let near_or_far = (km / self.middle_km()).ln().tanh();
        let growth_of = |log: f64| (log * near_or_far).exp();
        let (y_growth, z_growth) = p
            .spread_growth
            .map_or((1.0, 1.0), |(y, z)| (growth_of(y), growth_of(z)));
        let mut y = law::sigma_y_m(class, x_m) * other(p.log_sigma_y).exp() * y_growth;
        let growth = if p.other_laws {
            // The same slope at 1 km, but levelling off.
            let (a, b) = (0.5 + km, 1.5);
            (a / b).powf(1.5 * p.sigma_z_exponent)
        } else {
            km.powf(p.sigma_z_exponent)
        };
        let z = law::sigma_z_m(class, x_m) * other(p.log_sigma_z).exp() * growth * z_growth;
        if self.forward == Forward::Gaussian {
            y = y.hypot(x_m * p.meander_deg.to_radians());
        }
        let wake = if p.other_laws { (-km).exp() * 1.3 } else { 1.0 };
        let added = p.building_m2 / (2.0 * PI) * wake;
        ((y * y + added).sqrt(), (z * z + added).sqrt())
    }

    /// Middle of the distances that are flown, km.
    fn middle_km(&self) -> f64 {
        let (near, far) = self.scene.reach.distance_m;
        (near * far).sqrt() / 1000.0
    }

    /// The profile across over the normal one; its mean over a normal plume is 1.
    fn skewed(&self, sigmas_right: f64) -> f64 {
        1.0 + self.physics.skew * sigmas_right.tanh()
    }

    fn table(&self, table: &[f64], way_m: f64) -> f64 {
        let place = (way_m / TABLE_M).clamp(0.0, (table.len() - 1) as f64 - 1e-9);
        let index = place as usize;
        let share = place - index as f64;
        table[index] + share * (table[(index + 1).min(table.len() - 1)] - table[index])
    }

    /// Emission at `time_s` over its mean.
    fn emission_factor(&self, time_s: f64) -> f64 {
        let p = self.physics;
        let change = p.trend_per_h * time_s / 3600.0;
        let trend = if p.other_laws {
            (1.0 + change).max(0.0)
        } else {
            change.exp()
        };
        let pulse = p.pulses.map_or(1.0, |(a, period)| {
            1.0 + a * (2.0 * PI * time_s / period).sin()
        });
        let on_off = p.on_off.map_or(1.0, |(a, _)| {
            let second = (time_s + self.history_s).max(0.0) as usize;
            1.0 + a * self.on_off[second.min(self.on_off.len() - 1)]
        });
        trend * pulse.max(0.0) * on_off.max(0.0)
    }

    /// What is left, or made, after `age_s` of travel.
    fn transformed_share(&self, age_s: f64) -> f64 {
        let p = self.physics;
        // The other law's decay starts slowly.
        let rate_age = if p.other_laws {
            (age_s - 40.0).max(0.0)
        } else {
            age_s
        };
        let decay = (-p.decay_per_s * rate_age).exp();
        let transient_production = p.transient_production.map_or(1.0, |(height, at)| {
            let log = (age_s.max(1.0) / at).ln();
            (1.0 + height * (-0.5 * (log / 0.3).powi(2)).exp()).max(0.0)
        });
        decay * transient_production
    }

    /// Mean excess at metres east and north of the origin and `z_m` above ground, ppm.
    pub fn excess_ppm(&self, place: [f64; 2], z_m: f64, time_s: f64) -> f64 {
        // Superposition: the transport equation is linear in the concentration.
        let kg_m3: f64 = self
            .sources
            .iter()
            .map(|stack| match self.forward {
                Forward::Gaussian => self.gaussian_plume(stack, place, z_m, time_s),
                Forward::Puffs | Forward::AgedPuffs => self.puffs(stack, place, z_m, time_s),
            })
            .sum();
        kg_m3 * self.scene.air.ppm_per_kg_m3(z_m) * self.lee(place)
    }

    /// Angle by which the transport at `z_m` is turned clockwise against that at the axis.
    fn veer_rad(&self, z_m: f64, axis_m: f64) -> f64 {
        let up = (z_m - axis_m) / 100.0;
        // The other law's wind turns less and less with height, as in an Ekman spiral.
        let up = if self.physics.other_laws {
            1.5 * (up / 1.5).tanh()
        } else {
            up
        };
        (self.physics.veer_deg_per_100m * up).to_radians()
    }

    fn gaussian_plume(&self, stack: &Stack, place: [f64; 2], z_m: f64, time_s: f64) -> f64 {
        let (towards, speed) = self.wind.transport(time_s);
        let towards = turned(towards, self.veer_rad(z_m, stack.axis_m));
        let d = [place[0] - stack.place_m[0], place[1] - stack.place_m[1]];
        let x = d[0] * towards[0] + d[1] * towards[1];
        if x <= 1.0 || x > MAX_TRAVEL_M {
            return 0.0;
        }
        let y = d[0] * towards[1] - d[1] * towards[0];
        let (sy, sz) = (
            self.table(&self.sigma_y_m, x),
            self.table(&self.sigma_z_m, x),
        );
        if y.abs() > 7.0 * sy {
            return 0.0;
        }
        let speed = speed * self.physics.log_speed.exp();
        let age_s = x / speed;
        let strength = stack.emission_kg_s
            * self.emission_factor(time_s - age_s)
            * self.table(&stack.airborne, x)
            * self.transformed_share(age_s);
        strength / (2.0 * PI * speed * sy * sz)
            * (-0.5 * (y / sy).powi(2)).exp()
            * self.skewed(y / sy)
            * law::vertical(z_m, stack.axis_m, sz, &self.boundaries)
    }

    fn puffs(&self, stack: &Stack, place: [f64; 2], z_m: f64, time_s: f64) -> f64 {
        let d = [place[0] - stack.place_m[0], place[1] - stack.place_m[1]];
        let far = d[0].hypot(d[1]);
        let now = self.wind.moved_at(time_s);
        let veer = self.veer_rad(z_m, stack.axis_m);
        let factor = self.physics.log_speed.exp();
        // Paths of the puffs that may reach the place; a meandering path is longer than the distance.
        let reach = CUT_SIGMAS * self.table(&self.sigma_y_m, far * 1.3);
        let ways = ((far - reach) / factor, (far * 1.12 + reach) / factor);
        let (first, last) = self.wind.emitted_between(time_s, ways.0, ways.1);
        let mut sum = 0.0;
        for k in first..=last {
            let emitted_s = k as f64;
            let then = self.wind.moved_at(emitted_s);
            let way = (now.path_m - then.path_m) * factor;
            if way <= 1.0 || way > MAX_TRAVEL_M {
                continue;
            }
            let meander = self.meander_rad[(emitted_s + self.history_s) as usize];
            let towards = [
                (now.east_m - then.east_m) * factor,
                (now.north_m - then.north_m) * factor,
            ];
            let centre = turned(towards, veer + meander);
            let away_sq = (d[0] - centre[0]).powi(2) + (d[1] - centre[1]).powi(2);
            let age_s = time_s - emitted_s;
            let grown = match self.forward {
                Forward::AgedPuffs => age_s * self.scene.wind.speed_m_s * factor,
                _ => way,
            };
            let sy = self.table(&self.sigma_y_m, grown);
            if away_sq > (CUT_SIGMAS * sy).powi(2) {
                continue;
            }
            let sz = self.table(&self.sigma_z_m, grown);
            let mass = self.emission_factor(emitted_s)
                * self.table(&stack.airborne, way)
                * self.transformed_share(age_s);
            let right_m = (d[0] - centre[0]) * centre[1] - (d[1] - centre[1]) * centre[0];
            let right_m = right_m / centre[0].hypot(centre[1]).max(1e-9);
            sum += mass
                * (-0.5 * away_sq / (sy * sy)).exp()
                * self.skewed(right_m / sy)
                * law::vertical(z_m, stack.axis_m, sz, &self.boundaries)
                / (sy * sy * sz);
        }
        // One puff a second holds the emission of that second, Q · 1 s, and has
        // Q / ((2π)^(3/2) σy² σz) in its centre (Seinfeld and Pandis 2016, section 18.9).
        stack.emission_kg_s * sum / (2.0 * PI).powf(1.5)
    }

    /// What an obstacle's lee leaves at a place.
    fn lee(&self, place: [f64; 2]) -> f64 {
        let Some(wake) = self.physics.wake else {
            return 1.0;
        };
        let (sin, cos) = self.scene.wind.from_deg.to_radians().sin_cos();
        let d = [
            place[0] - self.scene.source_m[0],
            place[1] - self.scene.source_m[1],
        ];
        let (x, y) = (-sin * d[0] - cos * d[1], -cos * d[0] + sin * d[1]);
        if x < wake.along_m {
            return 1.0;
        }
        let across = (-0.5 * ((y - wake.across_m) / wake.width_m).powi(2)).exp();
        1.0 - wake.depth * across * (-(x - wake.along_m) / wake.length_m).exp()
    }

    /// Background at a place and time, ppm.
    pub fn background_ppm(&self, place: [f64; 2], z_m: f64, time_s: f64) -> f64 {
        let (scene, p) = (self.scene, self.physics);
        let hours = time_s / 3600.0;
        let mut b = scene.background_ppm + scene.off("background.co2_ppm") + p.background_ppm;
        let curved = if p.other_laws {
            hours * (1.0 + 0.5 * hours)
        } else {
            hours
        };
        b += p.background_ppm_per_h * curved;
        b += (p.gradient_ppm_per_km[0] * place[0] + p.gradient_ppm_per_km[1] * place[1]) / 1000.0;
        if let Some((amplitude, period)) = p.background_waves {
            b += amplitude * (2.0 * PI * time_s / period).sin();
        }
        if let Some((amplitude, middle, half)) = p.layer {
            b += amplitude * (-0.5 * ((z_m - middle) / half).powi(4)).exp();
        }
        b
    }
}

/// A vector turned clockwise (seen from above, east then north) by `angle` radians.
fn turned(v: [f64; 2], angle: f64) -> [f64; 2] {
    if angle == 0.0 {
        return v;
    }
    let (sin, cos) = angle.sin_cos();
    [v[0] * cos + v[1] * sin, v[1] * cos - v[0] * sin]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Need;
    use crate::wind::WindLaw;

    /// Mean excess by both models in a steady wind, at (x, y, z - axis).
    fn both(physics: &Physics, at: [f64; 3]) -> (f64, f64) {
        let mut scene = Scene::draw(
            11,
            &[Need::Any],
            &["emission", "source.effective_height_m"],
            1,
        );
        let steady = WindLaw {
            slow_meander: (0.0, 100.0),
            direction_gust: (0.0, 10.0),
            speed_gust: (0.0, 10.0),
            ..scene.wind
        };
        scene.wind = steady;
        let mut rng = stream(1, "w");
        let history_s = 2500.0;
        let wind = WindTruth::draw(
            &steady,
            history_s,
            700.0,
            physics.direction_offset_deg,
            &mut rng,
        );
        let place = scene.east_north_m(&at);
        let z = scene.axis_m + at[2];
        let ask = |forward| {
            TruthModel::new(&scene, physics, &wind, forward, history_s, 1)
                .excess_ppm(place, z, 300.0)
        };
        (ask(Forward::Gaussian), ask(Forward::Puffs))
    }

    // Two models written apart agree where they should: a steady wind.
    #[test]
    fn puffs_in_a_steady_wind_make_the_gaussian_plume() {
        for x in [500.0, 1500.0, 3000.0] {
            for y in [0.0, 40.0, -80.0] {
                let (straight, puffs) = both(&Physics::default(), [x, y, 15.0]);
                assert!(straight > 0.0);
                assert!(
                    (puffs / straight - 1.0).abs() < 0.03,
                    "{x} {y}: {straight} {puffs}"
                );
            }
        }
    }

    #[test]
    fn effects_act_alike_in_both_models() {
        let cases = [
            Physics {
                veer_deg_per_100m: 8.0,
                ..Physics::default()
            },
            Physics {
                decay_per_s: 2e-3,
                ..Physics::default()
            },
            Physics {
                class_shift: 1.0,
                ..Physics::default()
            },
            Physics {
                log_speed: 0.3,
                ..Physics::default()
            },
            Physics {
                direction_offset_deg: 2.0,
                ..Physics::default()
            },
            Physics {
                building_m2: 20_000.0,
                ..Physics::default()
            },
            Physics {
                second: Some(([100.0, 50.0], 0.5, 20.0)),
                ..Physics::default()
            },
        ];
        let at = [1200.0, 60.0, 40.0];
        let none = both(&Physics::default(), at);
        for physics in cases {
            let (straight, puffs) = both(&physics, at);
            assert!((straight / none.0 - 1.0).abs() > 0.03, "{physics:?}");
            assert!(
                (puffs / straight - 1.0).abs() < 0.06,
                "{physics:?}: {straight} {puffs}"
            );
        }
    }

    #[test]
    fn clockwise_is_clockwise() {
        let v = turned([0.0, 1.0], 90_f64.to_radians());
        assert!((v[0] - 1.0).abs() < 1e-12 && v[1].abs() < 1e-12);
    }
}
