//! A search strategy of one's own against those of the house.
//!
//! ```sh
//! cargo run --release --example own_search_strategy
//! ```
//!
//! Three samplers look for the highest concentration of a plume that the strategies do not know.
//! They fly straight at 18 m/s and choose anew every ten seconds; no aircraft, wind or rules of the
//! air are simulated, so that a strategy is tried in milliseconds. For `search.strategy` of a
//! scenario to take a strategy by its name, it goes into `crates/csea` (ARCHITECTURE.md says where).

use air::geo::Enu;
use anyhow::Result;
use csea::{
    Archive, ArchiveOptions, CsEaOptions, Domain, Position, PromisingPoint, Sample, SearchStrategy,
    choose_within_cone, strategy_by_name,
};
use plume::{Place, World};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use scenario::Scenario;

const SPEED_M_S: f64 = 18.0;
const STEP_S: usize = 10;
const STEPS: usize = 90;
const SAMPLERS: usize = 3;
const SEEDS: u64 = 10;

/// Points on rings about the best sample: half of them near it, the others up to 2 km away.
struct Rings {
    domain: Domain,
    points: Vec<PromisingPoint>,
}

impl SearchStrategy for Rings {
    fn name(&self) -> &'static str {
        "rings"
    }

    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        let centre = match archive.best() {
            Some(best) => best.position,
            None => self.domain.draw(rng),
        };
        self.points.clear();
        for k in 0..40 {
            let reach_m = if k % 2 == 0 { 150.0 } else { 2000.0 };
            let distance_m = reach_m * rng.random::<f64>();
            let at = centre.at.displaced(360.0 * rng.random::<f64>(), distance_m);
            let height_m = centre.height_m + 200.0 * (rng.random::<f64>() - 0.5);
            // Every point has to lie inside the domain, whatever its shape.
            let position = self.domain.close(Position { at, height_m }, centre, rng);
            // Whatever grows with what is hoped of the place; here, nearer the best is better.
            let fitness = -position.at.distance_m(centre.at);
            self.points.push(PromisingPoint { position, fitness });
        }
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }
}

fn concentration_ppm(world: &World, position: Position) -> f64 {
    let place = Place {
        east_m: position.at.east_m,
        north_m: position.at.north_m,
        height_agl_m: position.height_m,
    };
    world.mean_ppm(&place, 0.0)
}

/// The highest concentration that the samplers have flown through, ppm.
fn search(strategy: &mut dyn SearchStrategy, world: &World, seed: u64) -> Result<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut archive = Archive::new(ArchiveOptions::default())?;
    let mut team = [(Position::new(1700.0, -1300.0, 300.0), 0.0); SAMPLERS];
    let mut highest_ppm = 0.0_f64;
    for _ in 0..STEPS {
        let points = strategy.step(&archive, &mut rng);
        for (position, heading_deg) in &mut team {
            // 45°: a fast sampler takes what lies ahead of it.
            let Some(goal) = choose_within_cone(points, *position, *heading_deg, 45.0, &mut rng)
            else {
                continue;
            };
            *heading_deg = position.at.bearing_deg(goal.position.at);
            let climb_m_s = (goal.position.height_m - position.height_m).clamp(-20.0, 20.0) / 10.0;
            for _ in 0..STEP_S {
                position.at = position.at.displaced(*heading_deg, SPEED_M_S);
                position.height_m += climb_m_s;
                let value = concentration_ppm(world, *position);
                highest_ppm = highest_ppm.max(value);
                archive.push(Sample {
                    position: *position,
                    value,
                })?;
            }
        }
    }
    Ok(highest_ppm)
}

fn main() -> Result<()> {
    let text = std::fs::read_to_string("scenarios/as-pontes.toml")?;
    let world = Scenario::parse("as-pontes.toml", &text)?.world()?;
    let (low, high) = (
        Position::new(-3000.0, -3000.0, 120.0),
        Position::new(4000.0, 4000.0, 900.0),
    );
    let stack = Enu::default();
    let clear = move |p: Position| p.at.distance_m(stack) > 1000.0;
    let domain = Domain::new(low, high, clear, &mut ChaCha8Rng::seed_from_u64(0))?;

    println!("mean of the highest concentration met in 15 min, {SAMPLERS} samplers:");
    for name in ["rings", "cs-ea", "sweep", "random"] {
        let mut sum_ppm = 0.0;
        for seed in 1..=SEEDS {
            let mut strategy: Box<dyn SearchStrategy> = match name {
                "rings" => Box::new(Rings {
                    domain: domain.clone(),
                    points: Vec::new(),
                }),
                of_the_house => {
                    strategy_by_name(of_the_house, domain.clone(), CsEaOptions::default())?
                }
            };
            sum_ppm += search(strategy.as_mut(), &world, seed)?;
        }
        println!("  {name:8} {:6.0} ppm", sum_ppm / SEEDS as f64);
    }
    Ok(())
}
