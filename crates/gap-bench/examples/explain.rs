//! What the finder says of single cases, at length: `explain FIRST_SEED SEED...`, with the first seed
//! that the benchmark was given and the seeds that it prints beside its cases.

use gap::plume::{Analysis, Options, analyse};
use gap_bench::{Task, plan, tune};

/// Seeds a case that the plan is made for; those of a smaller benchmark are among them.
const SEEDS: u64 = 100;
/// Rows of the ranking that are shown.
const SHOWN: usize = 10;
/// What the truth beats by more than this on average is not shown as like it, nats.
const LIKE_NATS: f64 = 20.0;

fn main() {
    let mut seeds = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse::<u64>().ok());
    let Some(first) = seeds.next() else {
        eprintln!("usage: explain FIRST_SEED SEED...");
        return;
    };
    let tasks = plan(SEEDS, first);
    for seed in seeds {
        match tasks.iter().find(|t| t.seed == seed) {
            Some(task) => {
                if let Err(error) = explain(task) {
                    eprintln!("{seed}: {error}");
                }
            }
            None => eprintln!("no case has the seed {seed}"),
        }
    }
}

fn explain(task: &Task) -> Result<(), String> {
    println!("== {} seed {}", task.row(), task.seed);
    let Some(tuned) = tune::tune(task)? else {
        println!("no scene shows it so strongly");
        return Ok(());
    };
    println!("D = {:.1}, {:?}", tuned.nats, tuned.case.truth);
    let read = tune::read(&tuned.case.scenario_toml, &tuned.case.observations)?;
    let options = Options {
        seed: task.seed,
        ..Options::default()
    };
    let analysis = analyse(&read.setup, &read.observations, &options, &mut |_| {})
        .map_err(|e| e.to_string())?;
    show(&analysis);
    show_likenesses(&tuned);
    Ok(())
}

/// What each hidden effect of the catalogue could be mistaken for on the tracks of the case.
fn show_likenesses(tuned: &tune::Tuned) {
    let (Ok(mechanisms), Some(fitted)) = (tune::mechanisms(&tuned.case.truth), &tuned.fitted)
    else {
        return;
    };
    for (k, mechanism) in mechanisms.iter().enumerate() {
        let near: Vec<String> = fitted
            .likenesses(&mechanisms, k)
            .iter()
            .filter(|l| l.nats < LIKE_NATS)
            .map(|l| format!("{} {:.1}", l.id.as_str(), l.nats))
            .collect();
        println!("  {} is like {}", mechanism.id().as_str(), near.join(", "));
    }
}

fn show(analysis: &Analysis) {
    let json = &analysis.json;
    println!("{:?}: {}", json.verdict, json.summary);
    for r in json.ranking.iter().take(SHOWN) {
        println!(
            "  {:?} {:?}: score {:.1}, evidence {:.1}, p {:.3}",
            r.mechanisms, r.platform, r.delta_log_score, r.log_evidence, r.probability
        );
    }
    for c in &json.causes {
        println!(
            "  cause {:?}, p {:.3}: {:?}",
            c.mechanisms, c.probability, c.parameters
        );
    }
    for b in &json.base {
        println!(
            "  base {} = {:.4} +/- {:.4} (prior +/- {:.4})",
            b.name, b.value, b.sd, b.prior
        );
    }
    println!("  rest {:?}", json.unexplained);
    let n = analysis.noise;
    println!(
        "  noise: white {:.2} ppm, slow {:.2?}, gust {:.3?}, swing {:.2?}, shared {:.2} deg",
        n.white_ppm(),
        n.slow(),
        n.gust(),
        n.swing(),
        n.shared_swing_deg()
    );
    println!("  {:?}", json.notices);
}
