//! The next flight of the whole analysis on small made cases.

use crate::bar;
use crate::made::{normal, observe, setup};
use ::plume::field::{DispersionModel, Place};
use ::plume::{Mechanism, Sensor};
use air::geo::Geodetic;
use gap::plume::{Options, analyse};
use gap::verdict::{GapJson, NextFlight, Verdict};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::observations::{ObservationRow, Observations};

/// The rows that platform "a" logs on its way along the waypoints, in the wind of the scenario.
fn flown(next: &NextFlight, (id, p): (&str, &[(&str, f64)]), seed: u64) -> Vec<ObservationRow> {
    let setup = setup();
    let mut spec = setup.base.clone();
    spec.mechanisms.push(Mechanism::new(id, p).unwrap());
    let world = DispersionModel::new(spec.clone()).unwrap();
    let mut sensor = Sensor::new(&spec.sensor, &spec.mechanisms, "a");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut gust = normal(&mut rng);
    let mut rows = Vec::new();
    for leg in next.waypoints.windows(2) {
        let (from, to) = (&leg[0], &leg[1]);
        let seconds = (to.time_s - from.time_s).floor() as usize;
        for k in 0..seconds {
            let part = k as f64 / (to.time_s - from.time_s);
            let between = |a: f64, b: f64| a + part * (b - a);
            let lat_deg = between(from.lat_deg, to.lat_deg);
            let lon_deg = between(from.lon_deg, to.lon_deg);
            let alt_amsl_m = between(from.alt_amsl_m, to.alt_amsl_m);
            let at = setup.frame.to_enu(Geodetic { lat_deg, lon_deg });
            let place = Place {
                east_m: at.east_m,
                north_m: at.north_m,
                height_agl_m: alt_amsl_m - 340.0,
            };
            let time_s = from.time_s + k as f64;
            gust = 0.85 * gust + 0.53 * normal(&mut rng);
            let mean = world.mean_ppm(&place, time_s);
            let turbulent = mean + 0.12 * gust * (mean - 449.0);
            rows.push(ObservationRow {
                time_s,
                platform: 0,
                lat_deg,
                lon_deg,
                alt_amsl_m,
                co2_ppm: Some(sensor.read(turbulent, 1.0, &mut rng)),
                wind_speed_m_s: Some(7.0 + 0.3 * normal(&mut rng)),
                wind_from_deg: Some(250.0 + 1.5 * normal(&mut rng)),
                ..ObservationRow::default()
            });
        }
    }
    rows
}

fn run(observations: &Observations, complete: bool) -> GapJson {
    let options = Options {
        complete,
        ..Options::default()
    };
    let found = analyse(&setup(), observations, &options, &mut |_| ());
    found.unwrap().json
}

/// By how much the first of two mechanisms, alone, explains more than the second does.
fn odds_nats(json: &GapJson, of: &[String]) -> f64 {
    let alone = |id: &String| {
        let sets = json.ranking.iter();
        let own = sets.filter(|r| r.mechanisms.len() == 1 && r.mechanisms[0] == *id);
        own.map(|r| r.log_evidence)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    alone(&of[0]) - alone(&of[1])
}

// Meander widens the plume by an angle, a factor on σy by a part: near the source they differ little.
#[test]
#[ignore = "second tier: two analyses"]
fn an_ambiguous_answer_proposes_a_flight_that_keeps_its_promise() {
    let hidden = ("sigma-y-scale", &[("factor", 1.5)][..]);
    let mut o = observe(&[(hidden.0, hidden.1, &[])], 20);
    let before = run(&o, true);
    let promised = before
        .next_flight
        .clone()
        .filter(|_| before.verdict == Verdict::Ambiguous);
    let what = "after an ambiguous answer the proposed flight separates as promised";
    let goal = "off by less than 3 sd";
    let Some(next) = promised else {
        return bar::report(what, goal, "no flight proposed", false);
    };
    assert_eq!(next.separates, before.causes[0].mechanisms);
    assert!(next.expected_nats > 0.0 && next.settles_probability > 0.5);
    assert!(next.waypoints[0].time_s > 600.0);
    let times = next.waypoints.windows(2).map(|w| w[1].time_s - w[0].time_s);
    assert!(next.waypoints.len() > 2 && times.clone().all(|s| s > 0.0));
    o.rows.extend(flown(&next, hidden, 1));
    let after = run(&o, false);
    // What it promised is a normal law with mean m and variance 2 m.
    let shift = odds_nats(&after, &next.separates) - odds_nats(&before, &next.separates);
    let off = (shift - next.expected_nats).abs() / (2.0 * next.expected_nats).sqrt();
    let figure = format!(
        "{off:.1} sd ({:.1} nats promised, {shift:.1} flown)",
        next.expected_nats
    );
    bar::report(what, goal, figure, off < 3.0);
}

#[test]
fn what_is_light_proposes_none() {
    let o = observe(&[("sigma-y-scale", &[("factor", 1.5)], &[])], 22);
    let light = run(&o, false);
    assert_eq!(light.verdict, Verdict::Ambiguous, "{}", light.summary);
    assert!(light.next_flight.is_none());
}
