//! A team that senses only where it flies: who finds the peak of a known field?

use crate::common;
use air::geo::wrap_signed_deg;
use csea::{
    Archive, ArchiveOptions, CsEaOptions, Domain, Position, Sample, Sampler, SearchStrategy,
    strategy_by_name,
};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

const SPEED_M_S: f64 = 18.0;
const TURN_DEG_S: f64 = 20.0;
const CLIMB_M_S: f64 = 2.5;
const STEP_S: f64 = 20.0;

fn domain() -> Domain {
    let stack = Position::default();
    Domain::new(
        Position::new(-2500.0, -2500.0, 350.0),
        Position::new(2500.0, 2500.0, 650.0),
        move |p| p.at.distance_m(stack.at) > 800.0,
        &mut ChaCha8Rng::seed_from_u64(0),
    )
    .unwrap()
}

/// A class D plume from the origin along `axis_deg` at `height_m`: the peak that can be reached
/// lies on the axis at the edge of the keep-out circle. Briggs (1973) rural sigmas.
struct Plume {
    axis_deg: f64,
    height_m: f64,
}

impl Plume {
    fn at(&self, p: Position) -> f64 {
        let (sin, cos) = self.axis_deg.to_radians().sin_cos();
        let along = p.at.east_m * sin + p.at.north_m * cos;
        let across = p.at.east_m * cos - p.at.north_m * sin;
        if along < 1.0 {
            return 0.0;
        }
        let sy = 0.08 * along / (1.0 + 1e-4 * along).sqrt();
        let sz = 0.06 * along / (1.0 + 1.5e-3 * along).sqrt();
        let z = p.height_m - self.height_m;
        2.5e7 / (sy * sz) * (-0.5 * ((across / sy).powi(2) + (z / sz).powi(2))).exp()
    }

    fn peak(&self) -> f64 {
        let top = Position {
            at: Position::default().at.displaced(self.axis_deg, 800.1),
            height_m: self.height_m,
        };
        self.at(top)
    }
}

/// Six samplers for `duration_s`; returns the best true value flown through over the true peak.
fn fly(strategy: &mut dyn SearchStrategy, seed: u64, duration_s: f64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let plume = Plume {
        axis_deg: rng.random_range(0.0..360.0),
        height_m: rng.random_range(420.0..580.0),
    };
    let mut archive = Archive::new(ArchiveOptions::default()).unwrap();
    let mut team: Vec<_> = (0..6)
        .map(|i| {
            let at = Position::new(-1500.0 + 50.0 * f64::from(i), -1500.0, 400.0);
            (at, 60.0 * f64::from(i), at)
        })
        .collect();
    let mut best = 0.0f64;
    for second in 0..duration_s as usize {
        if second % STEP_S as usize == 0 {
            strategy.step(&archive, &mut rng);
            let of =
                |(id, (position, heading_deg, _)): (usize, &(Position, f64, Position))| Sampler {
                    id,
                    position: *position,
                    heading_deg: *heading_deg,
                    speed_m_s: SPEED_M_S,
                    turn_radius_m: SPEED_M_S / TURN_DEG_S.to_radians(),
                    climb_m_s: CLIMB_M_S,
                };
            let samplers: Vec<Sampler> = team.iter().enumerate().map(of).collect();
            for (member, sampler) in team.iter_mut().zip(&samplers) {
                member.2 = strategy.direct(sampler, 45.0, &mut rng);
            }
        }
        for (id, (at, heading_deg, goal)) in team.iter_mut().enumerate() {
            let wanted = at.at.bearing_deg(goal.at);
            let turn = wrap_signed_deg(wanted - *heading_deg);
            *heading_deg += turn.clamp(-TURN_DEG_S, TURN_DEG_S);
            at.at = at.at.displaced(*heading_deg, SPEED_M_S);
            at.height_m += (goal.height_m - at.height_m).clamp(-CLIMB_M_S, CLIMB_M_S);
            let truth = plume.at(*at);
            if domain().contains(*at) {
                best = best.max(truth);
            }
            let noise: f64 = rng.sample(StandardNormal);
            let value = 449.0 + truth + 3.0 * noise;
            let sample = Sample {
                position: *at,
                value,
            };
            archive.push(sample).unwrap();
            strategy.sense(second as f64, id, &sample, &mut rng);
        }
    }
    best / plume.peak()
}

fn scores(name: &str, seeds: std::ops::Range<u64>, duration_s: f64) -> Vec<f64> {
    let mut out: Vec<f64> = seeds
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let options = CsEaOptions::default();
            let prior = common::prior(180.0);
            let mut strategy = strategy_by_name(name, domain(), options, &prior, &mut rng).unwrap();
            fly(strategy.as_mut(), seed, duration_s)
        })
        .collect();
    out.sort_by(f64::total_cmp);
    out
}

#[test]
fn cs_ea_finds_the_peak_better_than_its_rivals() {
    // Twenty fields, ten minutes, six samplers: the share of the peak that was flown through.
    // Forty fields gave 0.79 for CS-EA and 0.50 for random points in the mean (see `the_stated_shares_hold`).
    let mean = |name| scores(name, 0..20, 600.0).iter().sum::<f64>() / 20.0;
    let cs_ea = mean("cs-ea");
    assert!(cs_ea > 0.65, "CS-EA flew through {cs_ea} of the peak");
    for rival in ["random", "lawnmower", "ascent"] {
        let other = mean(rival);
        assert!(cs_ea > other + 0.1, "CS-EA {cs_ea}, {rival} {other}");
    }
}

/// All but `missed` of the searches with these seeds fly through 0.8 of the peak in five minutes. The plume of these
/// tests differs by 3 % from the belief's, Briggs', and lies in any direction.
fn the_belief_finds_all_but(missed: usize, seeds: std::ops::Range<u64>) {
    let all = scores("posterior", seeds, 300.0);
    let far = all.iter().filter(|share| **share <= 0.8).count();
    assert!(far <= missed, "{all:?}");
}

#[test]
fn the_belief_finds_what_it_does_not_know_the_direction_of() {
    the_belief_finds_all_but(2, 0..10);
}

#[test]
#[ignore = "second tier: twenty searches"]
fn the_belief_finds_the_peak_in_nine_of_ten_directions() {
    the_belief_finds_all_but(2, 0..20);
}

#[test]
fn the_same_seed_repeats_the_search_bit_for_bit() {
    for name in csea::STRATEGIES {
        assert_eq!(scores(name, 3..5, 60.0), scores(name, 3..5, 60.0), "{name}");
    }
}

// The shares that `cs_ea.rs` states; forty fields give the mean to about 0.03.
#[test]
#[ignore = "second tier: 160 searches"]
fn the_stated_shares_hold() {
    for (duration_s, name, stated) in [
        (600.0, "cs-ea", 0.80),
        (600.0, "random", 0.50),
        (1200.0, "cs-ea", 0.96),
        (1200.0, "random", 0.61),
    ] {
        let mean = scores(name, 0..40, duration_s).iter().sum::<f64>() / 40.0;
        println!("{duration_s} s {name}: {mean:.3}, stated {stated}");
        assert!(
            (mean - stated).abs() < 0.05,
            "{duration_s} s {name}: {mean}"
        );
    }
}
