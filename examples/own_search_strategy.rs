//! Compares a search strategy of your own with those of `csea`.
//!
//! ```sh
//! cargo run --release --example own_search_strategy
//! ```
//!
//! Six samplers search for the highest concentration of an unknown plume. They fly straight at 18 m/s
//! and select a new target every ten seconds. No aircraft, wind or rules of the air are simulated, so
//! a trial takes milliseconds. To make a strategy available to `search.strategy` of a scenario, add it
//! to `crates/csea` (ARCHITECTURE.md shows where).

use air::geo::Enu;
use anyhow::{Context, Result};
use csea::{
    Archive, ArchiveOptions, Ascent, CsEa, CsEaOptions, Domain, Position, PromisingPoint,
    RandomPoints, Sample, Sampler, SearchStrategy,
};
use plume::{DispersionModel, Place};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use scenario::Scenario;

const SCENARIO: &str = "scenarios/as-pontes.toml";
const SPEED_M_S: f64 = 18.0;
const STEP_S: usize = 10;
const STEPS: usize = 90;
const SAMPLERS: usize = 6;
const SEEDS: u64 = 10;

/// Half of the points lie about the best sample, the other half anywhere.
struct NearTheBest {
    domain: Domain,
    points: Vec<PromisingPoint>,
}

impl SearchStrategy for NearTheBest {
    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        self.points.clear();
        for k in 0..40 {
            let (position, fitness) = match archive.best() {
                Some(best) if k % 2 == 0 => {
                    let (turn_deg, away_m) =
                        (360.0 * rng.random::<f64>(), 200.0 * rng.random::<f64>());
                    let at = best.position.at.displaced(turn_deg, away_m);
                    let height_m = best.position.height_m + 100.0 * (rng.random::<f64>() - 0.5);
                    let wanted = Position { at, height_m };
                    // Every point has to lie inside the domain, whatever its shape.
                    (self.domain.repair(wanted, best.position, rng), best.value)
                }
                // Expected value of an unsampled place.
                _ => (self.domain.draw(rng), archive.mean()),
            };
            self.points.push(PromisingPoint { position, fitness });
        }
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }
}

fn concentration_ppm(model: &DispersionModel, position: Position) -> f64 {
    let place = Place {
        east_m: position.at.east_m,
        north_m: position.at.north_m,
        height_agl_m: position.height_m,
    };
    model.mean_ppm(&place, 0.0)
}

fn sampler(id: usize, position: Position) -> Sampler {
    Sampler {
        id,
        position,
        heading_deg: 0.0,
        speed_m_s: SPEED_M_S,
        turn_radius_m: 60.0,
        climb_m_s: 3.0,
    }
}

/// The highest concentration that the samplers have measured in the domain, ppm.
fn search(
    strategy: &mut dyn SearchStrategy,
    domain: &Domain,
    model: &DispersionModel,
    seed: u64,
) -> Result<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut archive = Archive::new(ArchiveOptions::default())?;
    let home = Position::new(1700.0, -1300.0, 300.0);
    let mut team: Vec<Sampler> = (0..SAMPLERS).map(|id| sampler(id, home)).collect();
    let mut highest_ppm = 0.0_f64;
    for step in 0..STEPS {
        strategy.step(&archive, &mut rng);
        // 45°: a fast sampler selects points ahead of it.
        let orders: Vec<Position> = team
            .iter()
            .map(|member| strategy.direct(member, 45.0, &mut rng))
            .collect();
        for second in 0..STEP_S {
            for (member, goal) in team.iter_mut().zip(&orders) {
                let position = &mut member.position;
                member.heading_deg = position.at.bearing_deg(goal.at);
                let way_m = SPEED_M_S.min(position.at.distance_m(goal.at));
                position.at = position.at.displaced(member.heading_deg, way_m);
                position.height_m += (goal.height_m - position.height_m).clamp(-3.0, 3.0);
                if !domain.contains(*position) {
                    continue;
                }
                let value = concentration_ppm(model, *position);
                highest_ppm = highest_ppm.max(value);
                let sample = Sample {
                    position: *position,
                    value,
                };
                archive.push(sample)?;
                let time_s = (step * STEP_S + second) as f64;
                strategy.sense(time_s, member.id, &sample, &mut rng);
            }
        }
    }
    Ok(highest_ppm)
}

fn main() -> Result<()> {
    let text = std::fs::read_to_string(SCENARIO).context(SCENARIO)?;
    let model = Scenario::parse("as-pontes.toml", &text)?.dispersion_model()?;
    // A box, restricted by a closure: here, to places not too close to the stack.
    let (low, high) = (
        Position::new(-500.0, -1500.0, 120.0),
        Position::new(3500.0, 2500.0, 900.0),
    );
    let stack = Enu::default();
    let clear = move |p: Position| p.at.distance_m(stack) > 1000.0;
    let domain = Domain::new(low, high, clear, &mut ChaCha8Rng::seed_from_u64(0))?;

    println!(
        "mean of the highest concentration met in 15 min, {SEEDS} searches by {SAMPLERS} samplers:"
    );
    for name in ["near-the-best", "cs-ea", "ascent", "random"] {
        let mut sum_ppm = 0.0;
        for seed in 1..=SEEDS {
            let mut strategy: Box<dyn SearchStrategy> = match name {
                "near-the-best" => Box::new(NearTheBest {
                    domain: domain.clone(),
                    points: Vec::new(),
                }),
                "cs-ea" => Box::new(CsEa::new(domain.clone(), CsEaOptions::default())?),
                "ascent" => Box::new(Ascent::new(domain.clone(), 100, 100.0)?),
                _ => Box::new(RandomPoints::new(domain.clone(), 100)?),
            };
            sum_ppm += search(strategy.as_mut(), &domain, &model, seed)?;
        }
        println!("  {name:14} {:6.0} ppm", sum_ppm / SEEDS as f64);
    }
    Ok(())
}
