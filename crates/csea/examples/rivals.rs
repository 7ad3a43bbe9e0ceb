//! All strategies against the straight flight to the known peak.
//!
//! ```sh
//! cargo run --release -p csea --example rivals            # 20 seeds
//! cargo run --release -p csea --example rivals -- 5 posterior cs-ea
//! ```
//!
//! Six samplers at 18 m/s look for the peak of a plume: the highest mean concentration outside a keep-out of 1,120 m about its
//! source. They turn with a radius of 60 m and climb at 3 m/s, read every second with 3 ppm of noise, and get new orders every
//! ten seconds. What is printed is the time until one of them is within 100 m of the peak, height included; a search that
//! takes 1,800 s has not found it.
//!
//! - *sector*: the direction is known to 12° and the search is confined to 60° on both sides of what is supposed;
//! - *whole*: the plume lies as there, but nothing is known of its direction, and an airspace of 8.2 km square is searched;
//! - *meandering*: the same in a plume whose axis wanders by 5° over two minutes and that is now strong and now weak;
//! - *anywhere*: nothing is known, and the plume may lie in any direction.
//!
//! Its height is known to 50 m, its strength to 30 %, its spread to 20 %.

use air::geo::{Enu, Position, wrap_signed_deg};
use air::isa::Atmosphere;
use air::wind::WindProfile;
use csea::{
    Archive, ArchiveOptions, CsEaOptions, Domain, Estimate, PlumePrior, STRATEGIES, Sample,
    Sampler, strategy_by_name,
};
use plume::sigma::Setting;
use plume::stability::Stability;
use plume::{DispersionModel, DispersionSpec, Gas, Place, SensorSpec, SourceSpec, Strength};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

const SEEDS: u64 = 20;
const SAMPLERS: usize = 6;
const SPEED_M_S: f64 = 18.0;
const TURN_RADIUS_M: f64 = 60.0;
const CLIMB_M_S: f64 = 3.0;
const STEP_S: usize = 10;
const LONGEST_S: usize = 1800;
const FOUND_M: f64 = 100.0;
const CONE_DEG: f64 = 45.0;
const HALF_AIRSPACE_M: f64 = 4100.0;
const KEEP_OUT_M: f64 = 1120.0;
const SECTOR_DEG: f64 = 60.0;
const BACKGROUND_PPM: f64 = 446.0;
const NOISE_PPM: f64 = 3.0;
const MEANDER: (f64, f64) = (5.0, 120.0);
const FLUCTUATION: (f64, f64) = (0.5, 5.0);

type Error = Box<dyn std::error::Error>;

#[derive(Clone, Copy, PartialEq)]
enum Case {
    Sector,
    Whole,
    Meandering,
    Anywhere,
}

/// The plume as it is supposed to be.
fn supposed() -> Result<DispersionSpec, Error> {
    Ok(DispersionSpec {
        ground_amsl_m: 0.0,
        atmosphere: Atmosphere::through(486.0, 15.0, 950.0)?,
        wind: WindProfile::new(7.0, 486.0, 240.0, 0.15)?,
        stability: Stability::D,
        setting: Setting::Rural,
        ground_reflection: false,
        mixing_height_m: None,
        lid_edge_m: 0.0,
        background_ppm: BACKGROUND_PPM,
        sources: vec![SourceSpec {
            name: "stack".to_owned(),
            gas: Gas::Co2,
            place: Enu::default(),
            area: None,
            stack_height_m: 356.0,
            effective_height_agl_m: 486.0,
            schedule: None,
            strength: Strength::CMax {
                excess_ppm: 450.0,
                distance_m: 2400.0,
            },
        }],
        sigma_y_scale: 1.0,
        sigma_z_scale: 1.0,
        mechanisms: Vec::new(),
        sensor: SensorSpec::default(),
    })
}

/// The plume as it is.
struct Truth {
    model: DispersionModel,
    peak: Position,
}

impl Truth {
    fn drawn(case: Case, rng: &mut ChaCha8Rng) -> Result<Self, Error> {
        let mut normal = |sd: f64| -> f64 {
            let draw: f64 = rng.sample(StandardNormal);
            sd * draw
        };
        let mut spec = supposed()?;
        spec.sources[0].effective_height_agl_m += normal(50.0);
        spec.sigma_y_scale = normal(0.2).exp();
        spec.sigma_z_scale = normal(0.2).exp();
        spec.sources[0].strength = Strength::CMax {
            excess_ppm: 450.0 * normal(0.3).exp(),
            distance_m: 2400.0,
        };
        let off_deg = normal(12.0);
        let anywhere_deg = 360.0 * rng.random::<f64>();
        spec.wind = spec.wind.turned(match case {
            Case::Anywhere => anywhere_deg,
            _ => off_deg,
        });
        let towards_deg = air::wind::towards_deg(spec.wind.from_deg());
        let peak = Position {
            at: Enu::default().displaced(towards_deg, KEEP_OUT_M),
            height_m: spec.sources[0].effective_height_agl_m,
        };
        Ok(Self {
            model: DispersionModel::new(spec)?,
            peak,
        })
    }

    fn read(&self, at: Position, air: &Air, rng: &mut ChaCha8Rng) -> f64 {
        let bearing_deg = Enu::default().bearing_deg(at.at) - air.meander_deg;
        let turned = Enu::default().displaced(bearing_deg, at.at.distance_m(Enu::default()));
        let place = Place {
            east_m: turned.east_m,
            north_m: turned.north_m,
            height_agl_m: at.height_m,
        };
        let excess = (self.model.mean_ppm(&place, 0.0) - BACKGROUND_PPM) * air.factor();
        let noise: f64 = rng.sample(StandardNormal);
        BACKGROUND_PPM + excess + NOISE_PPM * noise
    }
}

/// How the plume meanders and fluctuates: Ornstein-Uhlenbeck processes.
#[derive(Default)]
struct Air {
    meander_deg: f64,
    ln_factor: f64,
}

impl Air {
    fn step(&mut self, rng: &mut ChaCha8Rng) {
        let mut process = |value: &mut f64, (sd, lasts_s): (f64, f64)| {
            let kept = (-1.0 / lasts_s).exp();
            let draw: f64 = rng.sample(StandardNormal);
            *value = kept * *value + sd * (1.0 - kept * kept).sqrt() * draw;
        };
        process(&mut self.meander_deg, MEANDER);
        process(&mut self.ln_factor, FLUCTUATION);
    }

    /// Of mean one.
    fn factor(&self) -> f64 {
        if self.ln_factor == 0.0 {
            return 1.0;
        }
        (self.ln_factor - 0.5 * FLUCTUATION.0 * FLUCTUATION.0).exp()
    }
}

fn domain(case: Case, rng: &mut ChaCha8Rng) -> Result<Domain, Error> {
    let (low_m, high_m) = match case {
        Case::Sector => (286.0, 686.0),
        _ => (120.0, 900.0),
    };
    let corner = |side: f64, height_m: f64| {
        Position::new(side * HALF_AIRSPACE_M, side * HALF_AIRSPACE_M, height_m)
    };
    let supposed_deg = air::wind::towards_deg(supposed()?.wind.from_deg());
    let allowed = move |p: Position| {
        let off_deg = wrap_signed_deg(Enu::default().bearing_deg(p.at) - supposed_deg).abs();
        p.at.distance_m(Enu::default()) >= KEEP_OUT_M - 1e-6
            && (case != Case::Sector || off_deg <= SECTOR_DEG)
    };
    Ok(Domain::new(
        corner(-1.0, low_m),
        corner(1.0, high_m),
        allowed,
        rng,
    )?)
}

fn prior(case: Case) -> Result<PlumePrior, Error> {
    let base = supposed()?;
    let towards_deg = air::wind::towards_deg(base.wind.from_deg());
    let axis_sd_deg = if case == Case::Sector { 12.0 } else { 180.0 };
    Ok(PlumePrior {
        axis_deg: Estimate {
            value: towards_deg,
            sd: axis_sd_deg,
        },
        height_amsl_m: Estimate {
            value: base.sources[0].effective_height_agl_m,
            sd: 50.0,
        },
        base,
        ln_strength_sd: 0.3,
        ln_spread_sd: 0.2,
        background_ppm: Estimate {
            value: BACKGROUND_PPM,
            sd: 1.0,
        },
        noise_ppm: NOISE_PPM,
        // What meteorologists expect of class D within ten minutes, whatever the air really does.
        meander: match case {
            Case::Meandering => MEANDER,
            _ => (1.0, 60.0),
        },
    })
}

/// The team on its way from its homes.
fn team() -> Vec<Sampler> {
    let of = |k: usize| Sampler {
        id: k,
        position: Position::new(
            1700.0 + 80.0 * (k % 3) as f64,
            -1300.0 - 70.0 * (k / 3) as f64,
            411.0 + 30.0 * k as f64,
        ),
        heading_deg: 330.0,
        speed_m_s: SPEED_M_S,
        turn_radius_m: TURN_RADIUS_M,
        climb_m_s: CLIMB_M_S,
    };
    (0..SAMPLERS).map(of).collect()
}

/// A second of flight towards a place.
fn fly(sampler: &mut Sampler, to: Position) {
    let here = sampler.position;
    let off_deg = wrap_signed_deg(here.at.bearing_deg(to.at) - sampler.heading_deg);
    let most_deg = (SPEED_M_S / TURN_RADIUS_M).to_degrees();
    sampler.heading_deg += off_deg.clamp(-most_deg, most_deg);
    let up_m = (to.height_m - here.height_m).clamp(-CLIMB_M_S, CLIMB_M_S);
    sampler.position = Position {
        at: here.at.displaced(sampler.heading_deg, SPEED_M_S),
        height_m: here.height_m + up_m,
    };
}

/// When one of the team is at the peak, s; none within the longest time. Nobody's strategy is the straight flight.
fn search(name: Option<&str>, case: Case, seed: u64) -> Result<Option<usize>, Error> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let truth = Truth::drawn(case, &mut rng)?;
    let domain = domain(case, &mut rng)?;
    let prior = prior(case)?;
    let mut archive = Archive::new(ArchiveOptions::default())?;
    let mut strategy = match name {
        None => None,
        Some(name) => {
            let options = CsEaOptions::default();
            Some(strategy_by_name(name, domain, options, &prior, &mut rng)?)
        }
    };
    let mut team = team();
    let mut orders = vec![truth.peak; SAMPLERS];
    let mut air = Air::default();
    for second in 0..LONGEST_S {
        if case == Case::Meandering {
            air.step(&mut rng);
        }
        if let Some(strategy) = &mut strategy {
            for (k, sampler) in team.iter().enumerate() {
                let position = sampler.position;
                let value = truth.read(position, &air, &mut rng);
                let sample = Sample { position, value };
                archive.push(sample)?;
                strategy.sense(second as f64, k, &sample, &mut rng);
            }
            if second % STEP_S == 0 {
                strategy.step(&archive, &mut rng);
                for (order, sampler) in orders.iter_mut().zip(&team) {
                    *order = strategy.direct(sampler, CONE_DEG, &mut rng);
                }
            }
        }
        for (sampler, order) in team.iter_mut().zip(&orders) {
            fly(sampler, *order);
            if sampler.position.distance_m(truth.peak) < FOUND_M {
                return Ok(Some(second + 1));
            }
        }
    }
    Ok(None)
}

fn cell(name: Option<&str>, case: Case, seeds: u64) -> Result<String, Error> {
    let mut times = Vec::new();
    for seed in 1..=seeds {
        times.push(search(name, case, seed)?.unwrap_or(LONGEST_S));
    }
    let found = times.iter().filter(|t| **t < LONGEST_S).count();
    times.sort_unstable();
    Ok(format!("{} ({found})", times[times.len() / 2]))
}

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let seeds = arguments.next().map_or(Ok(SEEDS), |s| s.parse())?;
    let asked: Vec<String> = arguments.collect();
    println!(
        "Median time to within {FOUND_M} m of the peak, s (found of {seeds}), seeds 1 to {seeds}\n"
    );
    println!("| strategy | sector | whole | meandering | anywhere |\n|---|---|---|---|---|");
    let known = STRATEGIES
        .iter()
        .filter(|s| asked.is_empty() || asked.iter().any(|a| a == *s));
    for name in std::iter::once(None).chain(known.map(|s| Some(*s))) {
        let cases = [Case::Sector, Case::Whole, Case::Meandering, Case::Anywhere];
        let cells = cases.map(|case| cell(name, case, seeds));
        let cells = cells.into_iter().collect::<Result<Vec<_>, _>>()?;
        println!(
            "| {} | {} |",
            name.unwrap_or("straight flight"),
            cells.join(" | ")
        );
    }
    Ok(())
}
