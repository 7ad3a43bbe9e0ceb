//! What moves when a number of the finder's [`Policy`] is halved and doubled.

use gap::plume::Options;
use infer::{Noise, Policy};

use crate::judge::{Judging, Outcome, judge_made};
use crate::made::{Made, make};
use crate::plan::{Kind, Task, share_of};
use crate::rates::Rate;
use crate::summary::Summary;

/// A number of the policy.
struct Number {
    name: &'static str,
    /// Multiplies it.
    scale: fn(&mut Policy, f64),
    value: fn(&Policy) -> f64,
}

/// Multiplies a number; of a probability near one what it lacks, of a count at least one is left.
trait Scaled: Copy {
    fn scaled(self, by: f64) -> Self;
}

impl Scaled for f64 {
    fn scaled(self, by: f64) -> Self {
        self * by
    }
}

impl Scaled for usize {
    fn scaled(self, by: f64) -> Self {
        (self as f64 * by).round().max(1.0) as Self
    }
}

fn lacks(probability: f64, by: f64) -> f64 {
    1.0 - (1.0 - probability) * by
}

macro_rules! numbers {
    ($($($field:ident).+ $([$k:literal])?),+ $(,)?) => {
        [$(Number {
            name: concat!($(".", stringify!($field)),+ $(, "[", stringify!($k), "]")?),
            scale: |p, by| p.$($field).+ $([$k])? = p.$($field).+ $([$k])?.scaled(by),
            value: |p| p.$($field).+ $([$k])? as f64,
        }),+]
    };
}

/// All that are finite.
fn numbers() -> Vec<Number> {
    let plain = numbers![
        discrepancy_width_ln_distance,
        discrepancy_width_sigmas,
        discrepancy_width_s,
        axis_drift_width_s,
        most_basis_functions_in_time,
        discrepancy_reach_sigmas,
        discrepancy_most_basis_functions,
        discrepancy_sizes[0],
        discrepancy_sizes[1],
        discrepancy_least,
        axis_drift_sizes_deg[0],
        axis_drift_sizes_deg[1],
        axis_drift_sizes_deg[2],
        upward_over_sideways,
        axis_drift_mean_deg,
        noise_median.white,
        noise_median.slow,
        noise_median.slow_s,
        noise_median.fluctuation,
        noise_median.fluctuation_s,
        noise_median.wander_deg,
        noise_median.wander_s,
        noise_median.wander_sigma_z,
        noise_tolerated.white,
        noise_tolerated.slow,
        noise_tolerated.fluctuation,
        noise_tolerated.wander_deg,
        noise_tolerated.wander_sigma_z,
        passes,
        spike_sd,
        spike_part_of_crossing,
        ln_name,
        most_names,
        beam_fits,
        beam_width,
        beam_causes,
        beam_nats,
        doubted,
        departs_sd,
        rest_nats,
        rest_alone_nats,
        most_candidates,
        longest_step_sd,
        most_steps,
        settled_nats,
        least_weight,
    ];
    let near_one = [
        Number {
            name: "1 - .named",
            scale: |p, by| p.named = lacks(p.named, by),
            value: |p| 1.0 - p.named,
        },
        Number {
            name: ".stated",
            scale: |p, by| p.stated = (p.stated * by).min(p.named),
            value: |p| p.stated,
        },
        Number {
            name: "1 - .form_none",
            scale: |p, by| p.discrepancy_none = lacks(p.discrepancy_none, by),
            value: |p| 1.0 - p.discrepancy_none,
        },
        Number {
            name: ".noise_ln_sd, all",
            scale: |p, by| p.noise_ln_sd = p.noise_ln_sd.map(|sd| sd * by),
            value: |p| p.noise_ln_sd.iter().sum::<f64>() / Noise::PARAMETERS as f64,
        },
    ];
    near_one.into_iter().chain(plain).collect()
}

/// Judges `count` cases from `first_seed` on with each number halved and doubled, and tells the table line
/// by line, in Markdown.
pub fn sensitivity(count: usize, first_seed: u64, tell: &mut dyn FnMut(&str)) {
    let tasks = share_of(count, first_seed);
    let cases: Vec<_> = tasks
        .iter()
        .filter_map(|task| Some((task, make(task)?)))
        .collect();
    let under = |policy: &Policy| -> Vec<Outcome> {
        let judging = Judging {
            clock_s: || 0.0,
            fly_on: false,
        };
        let options = |seed| Options {
            seed,
            policy: policy.clone(),
            ..Options::default()
        };
        let of =
            |(task, made): &(&Task, Made)| judge_made(task, made, &judging, &options(task.seed));
        cases.iter().map(of).collect()
    };
    let usual = Policy::default();
    let known = under(&usual);
    tell(
        "| number | value | verdict or causes change | false alarms | detected | truth in sets or candidates | intervals that cover |",
    );
    tell("|---|---|---|---|---|---|---|");
    let [alarms, detected, told, covered] = rates(&known);
    tell(&format!(
        "| as they are | | of {} | {alarms} | {detected} | {told} | {covered} |",
        known.len()
    ));
    for number in numbers() {
        let tried = [0.5, 2.0].map(|by| {
            let mut policy = usual.clone();
            (number.scale)(&mut policy, by);
            under(&policy)
        });
        let both = |of: &dyn Fn(&[Outcome]) -> String| {
            let [less, more] = tried.each_ref().map(|t| of(t));
            if less == more {
                less
            } else {
                format!("{less}, {more}")
            }
        };
        let changed = both(&|t| changes(&known, t).to_string());
        let [alarms, detected, told, covered] =
            std::array::from_fn(|k| both(&|t| rates(t)[k].clone()));
        tell(&format!(
            "| `{}` | {:.3} | {changed} | {alarms} | {detected} | {told} | {covered} |",
            number.name.trim_start_matches('.'),
            (number.value)(&usual)
        ));
    }
}

/// Outcomes that say something else.
fn changes(known: &[Outcome], now: &[Outcome]) -> usize {
    let said = |o: &Outcome| {
        let causes = o.said.iter().flat_map(|s| &s.causes);
        let names: Vec<_> = causes.map(|c| c.mechanisms.clone()).collect();
        (o.verdict().to_owned(), names)
    };
    let pairs = known.iter().zip(now);
    pairs.filter(|(a, b)| said(a) != said(b)).count()
}

/// False alarms, detected, truth in sets or candidates and intervals that cover, as counts.
fn rates(outcomes: &[Outcome]) -> [String; 4] {
    let is_nothing = |o: &&Outcome| o.task.kind == Kind::Nothing;
    let (nothing, something): (Vec<&Outcome>, Vec<&Outcome>) =
        outcomes.iter().partition(is_nothing);
    [
        Summary::detected(&nothing),
        Summary::detected(&something),
        Summary::said_at_all(&something),
        Summary::coverage(&something),
    ]
    .map(|rate: Rate| format!("{}/{}", rate.hits, rate.of))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_moves_and_none_beyond_sense() {
        for number in numbers() {
            for by in [0.5, 2.0] {
                let mut policy = Policy::default();
                (number.scale)(&mut policy, by);
                assert_ne!(policy, Policy::default(), "{}", number.name);
                assert!((number.value)(&policy).is_finite());
            }
        }
    }
}
