//! Who rises first: real vehicles as soon as they are ready, simulated ones after them and out of their way.

use crate::common::{Miniature, as_pontes, assert_apart, assert_safe};
use protocol::message::{PathKind, Phase};

const REAL: usize = 5;

/// When a vehicle was ordered to take off; none before.
fn ordered_s(mini: &Miniature, vehicle: usize) -> Option<f64> {
    let orders = mini.sent.iter();
    let mut take_offs = orders.filter(|t| t.vehicle == vehicle && t.path == PathKind::TakeOff);
    take_offs.next().map(|t| t.time_s)
}

/// The reference mission, whose real vehicle is ready on the ground at `ready_s`, flown to `until_s`.
fn ready_at(ready_s: f64, until_s: f64) -> Miniature {
    let mut mini = Miniature::new(as_pontes(1));
    mini.pilot(REAL, true);
    while mini.time_s < until_s {
        if mini.time_s == ready_s {
            mini.pilot(REAL, false);
        }
        mini.second();
    }
    mini
}

/// Fails where another vehicle in the air is nearer to the real one than the scenario allows.
fn assert_flown_apart(mini: &Miniature) {
    let (fence, real) = (&mini.scenario.fence, &mini.team[REAL]);
    for other in mini.team[..REAL].iter().filter(|p| p.airborne) {
        let far = other.at.at.distance_m(real.at.at) >= fence.separation_m;
        let gap_m = (other.at.height_m - real.at.height_m).abs();
        assert!(
            !real.airborne || far || gap_m >= fence.separation_height_m,
            "{} s: {:?} and {:?}",
            mini.time_s,
            real.at,
            other.at
        );
    }
}

#[test]
fn simulated_vehicles_wait_for_a_real_one_that_is_ready_after_its_checklist() {
    let mini = ready_at(12.0, 200.0);
    let real_s = ordered_s(&mini, REAL).unwrap();
    assert!(real_s <= 14.0, "the real one is ordered at {real_s} s");
    for simulated in 0..REAL {
        let after_s = ordered_s(&mini, simulated).unwrap() - real_s;
        assert!((8.0..150.0).contains(&after_s), "{simulated}: {after_s} s");
    }
    assert_safe(&mini);
    assert_apart(&mini);
}

#[test]
fn they_do_not_wait_longer_than_a_minute_and_then_make_room_for_its_climb() {
    for ready_s in [100.0, 300.0] {
        let mut mini = ready_at(ready_s, ready_s);
        let first_s = (0..REAL)
            .filter_map(|k| ordered_s(&mini, k))
            .min_by(f64::total_cmp);
        assert_eq!(first_s, Some(60.0));
        assert_eq!(ordered_s(&mini, REAL), None);
        // The highest layer is that of the real one: the others circle below it, above the same field.
        let home = mini.home_of(REAL).at;
        let over_home = |mini: &Miniature| {
            let up = mini.team[..REAL].iter().filter(|p| p.airborne);
            up.filter(|p| p.at.at.distance_m(home) < 250.0).count()
        };
        let before = over_home(&mini);
        mini.pilot(REAL, false);
        while ordered_s(&mini, REAL).is_none() && mini.time_s < ready_s + 60.0 {
            mini.second();
        }
        let waited_s = ordered_s(&mini, REAL).map(|s| s - ready_s);
        assert!(
            waited_s.is_some(),
            "{before} over its home at {ready_s} s: no take-off within 60 s"
        );
        assert_eq!(over_home(&mini), 0);
        // It climbs through nobody.
        while !matches!(mini.team[REAL].order.as_ref().unwrap().path, PathKind::GoTo) {
            mini.second();
            assert_flown_apart(&mini);
        }
        assert_safe(&mini);
        assert_apart(&mini);
    }
}

#[test]
fn one_that_is_never_ready_keeps_nobody_on_the_ground() {
    let mini = ready_at(f64::INFINITY, 400.0);
    assert_eq!(ordered_s(&mini, REAL), None);
    for simulated in 0..REAL {
        assert!(ordered_s(&mini, simulated).unwrap() < 200.0);
    }
    assert_eq!(mini.phases.last().unwrap().1, Phase::Search);
}

/// Where nobody is real nobody waits, and a real vehicle at another field is no neighbour.
#[test]
fn nobody_waits_for_a_real_vehicle_elsewhere() {
    let mut scenario = as_pontes(1);
    // 0.012 degrees of latitude are 1.3 km.
    scenario.vehicles[REAL].home.as_mut().unwrap().lat_deg += 0.012;
    let mut mini = Miniature::new(scenario);
    mini.pilot(REAL, true);
    while mini.time_s < 20.0 {
        mini.second();
    }
    assert!((0..REAL).any(|k| ordered_s(&mini, k).is_some_and(|s| s < 3.0)));
}
