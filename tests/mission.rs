//! The reference mission finds the plume: a fixed share of what `plumage campaign` measures. One mission
//! in the first tier, more in the second.

use crate::bar;
use air::geo::Geodetic;
use mission::campaign;
use mission::{Run, Setup};
use plume::Place;
use protocol::SimTime;
use protocol::message::{Estimate, FluxMethod, Message, Observation, PeakStatus};
use record::campaign::{FOUND_WITHIN_M, stated_number};
use record::summary::{CORRECTED, MissionSummary, Summariser};
use scenario::observations::{ObservationRow, Observations};
use study::median;
use ws::calibration::Calibrated;

const AS_PONTES: &str = include_str!("../scenarios/as-pontes-steady.toml");

fn no_files(_: &str) -> Result<Vec<u8>, String> {
    Err("no such file".to_owned())
}

fn as_pontes(seed: u64, stand_ins: usize) -> Setup {
    let mut setup = Setup::load("as-pontes-steady.toml", AS_PONTES, &no_files)
        .unwrap()
        .with_stand_ins(stand_ins)
        .unwrap();
    setup.scenario.mission.seed = seed;
    setup
}

/// A mission's summary, what the team said of the gap in it, the last verdict last, and what real
/// vehicles read, once a second.
struct Flown {
    summary: MissionSummary,
    verdicts: Vec<String>,
    readings: Vec<Observation>,
}

fn fly(setup: &Setup) -> Flown {
    let mut run = Run::new(setup).unwrap();
    let mut summariser = Summariser::new(campaign::summary_context(setup).unwrap());
    let (mut verdicts, mut readings) = (Vec::new(), Vec::<Observation>::new());
    while !run.ended() {
        for (topic, envelope) in run.step() {
            match &envelope.message {
                Message::Extension(extension) => verdicts.push(extension.verdict.clone()),
                Message::Observation(o) => {
                    let last = readings.iter().rev().find(|l| l.vehicle == o.vehicle);
                    if last.is_none_or(|l| o.time_ns - l.time_ns >= 1_000_000_000) {
                        readings.push(o.clone());
                    }
                }
                _ => {}
            }
            summariser.take(topic, envelope);
        }
    }
    let summary = summariser.summary(&run.digest(), 0.0);
    Flown {
        summary,
        verdicts,
        readings,
    }
}

/// The readings as a file would have them.
fn observations(readings: &[Observation]) -> Observations {
    let mut platforms: Vec<String> = Vec::new();
    let row = |o: &Observation| {
        let known = platforms.iter().position(|p| *p == o.vehicle);
        let platform = known.unwrap_or_else(|| {
            platforms.push(o.vehicle.clone());
            platforms.len() - 1
        });
        ObservationRow {
            time_s: SimTime::from_ns(o.time_ns).s(),
            platform,
            lat_deg: o.reading.lat_deg,
            lon_deg: o.reading.lon_deg,
            alt_amsl_m: o.reading.alt_amsl_m,
            co2_ppm: Some(o.reading.co2_ppm),
            ..ObservationRow::default()
        }
    };
    Observations {
        rows: readings.iter().map(row).collect(),
        platforms,
        ..Observations::default()
    }
}

/// What the correction in flight, `calibrate` and the gap say of what is uncertain, by the same readings,
/// each with its standard deviation.
fn thrice(setup: &Setup, readings: &[Observation]) -> Vec<(&'static str, [(f64, f64); 3])> {
    let scenario = &setup.scenario;
    let observed = observations(readings);
    let mut flown = ws::Calibrator::new(scenario, &observed.platforms, None).unwrap();
    let frame = scenario.frame().unwrap();
    let mut next_s = 0.0;
    for row in &observed.rows {
        if row.time_s >= next_s && flown.is_due() {
            flown.update().unwrap();
            next_s = row.time_s + 10.0;
        }
        let at = Geodetic {
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
        };
        let place = Place::from_geodetic(&frame, at, row.alt_amsl_m);
        flown.observe(row.platform, row.time_s, place, None, row.co2_ppm.unwrap());
    }
    flown.finish();
    flown
        .conclude(scenario.fence.keep_out_radius_m + scenario::airspace::SETPOINT_MARGIN_M)
        .unwrap();
    let filed = ws::calibration::offline::calibrate(scenario, &observed, None).unwrap();
    let gap = gap::plume::analyse(
        &gap::plume::Setup::new(scenario).unwrap(),
        &observed,
        &gap::plume::Options::default(),
        &mut |_| {},
    )
    .unwrap();
    let of_gap = |key: &str| {
        let base = gap.base.iter().find(|b| b.0 == key).unwrap();
        (base.1, base.2)
    };
    let (a, b) = (flown.calibrated(), filed.calibrated);
    let pair = |e: Estimate| (e.value, e.sd);
    let ground = |of: fn(&Calibrated) -> Estimate| [pair(of(&a)), pair(of(&b))];
    [
        ("weather.wind_from_deg", ground(|c| c.axis_deg)),
        (
            "source.effective_height_m",
            ground(|c| c.effective_height_agl_m),
        ),
        ("source.c_max_ppm", ground(|c| c.c_max_ppm)),
        ("background.co2_ppm", ground(|c| c.background_ppm)),
        ("plume.sigma_y_scale", ground(|c| c.sigma_y_scale)),
        ("plume.sigma_z_scale", ground(|c| c.sigma_z_scale)),
        ("sensor.time_constant_s", ground(|c| c.time_constant_s)),
    ]
    .map(|(key, [flown, filed])| {
        let (value, sd) = of_gap(key);
        // The axis runs towards where the wind does not come from.
        let turn = if key == "weather.wind_from_deg" {
            180.0
        } else {
            0.0
        };
        (key, [flown, filed, (value - turn, sd)])
    })
    .to_vec()
}

/// Every one of the missions found the peak, most left little of the errors before, and nothing was
/// found that is not there: what the reality differs by here is within what the scenario states as
/// uncertain, and its gusts must not pass for a cause.
fn good(missions: Vec<Flown>) {
    for flown in &missions {
        let seed = flown.summary.seed;
        // Looked at when the search begins and on the way home.
        assert_eq!(flown.verdicts, ["none"; 2], "seed {seed}");
    }
    let count = missions.len();
    let off_m: Vec<Option<f64>> = missions.iter().map(|f| f.summary.peak.error_m).collect();
    let found = off_m.iter().flatten().filter(|m| **m <= FOUND_WITHIN_M);
    assert_eq!(
        found.count(),
        count,
        "peak within {FOUND_WITHIN_M} m: {off_m:?}"
    );
    for name in ["axis (towards)", "effective height", "c_MAX"] {
        let number = CORRECTED.iter().find(|n| n.name == name).unwrap();
        let stated = missions
            .iter()
            .filter_map(|f| stated_number(&f.summary, number));
        let left = median(stated.filter_map(|s| s.left()).collect()).unwrap();
        assert!(
            left <= 1.0 / 3.0,
            "{name}: {left} of the error before is left"
        );
    }
}

fn the_reference_mission_finds_the_peak_corrects_the_model_and_raises_no_alarm() {
    let setup = as_pontes(1, 1);
    let flown = fly(&setup);
    let readings = flown.readings.clone();
    let (peak, flux) = (&flown.summary.peak, &flown.summary.flux);
    assert_eq!(peak.status, PeakStatus::Confirmed);
    let methods: Vec<FluxMethod> = flux.iter().map(|f| f.found.method).collect();
    assert_eq!(
        methods,
        [
            FluxMethod::Combined,
            FluxMethod::Inference,
            FluxMethod::MassBalance
        ]
    );
    for flux in flux {
        let (found, truth) = (flux.found.kg_s, flux.truth_kg_s.unwrap());
        assert!((found.value - truth).abs() < 2.0 * found.sd, "{flux:?}");
    }
    good(vec![flown]);
    agree(&setup, &readings);
}

/// How far the stated peak is from the truth, in its standard deviations.
fn z(summary: &MissionSummary) -> f64 {
    let (found, truth) = (summary.peak.estimate.unwrap(), summary.peak.truth.unwrap());
    (found.co2_ppm - truth.co2_ppm) / found.sd_ppm
}

fn in_unsteady_air_the_peak_is_found_within_what_is_said_of_it() {
    let unsteady = include_str!("../scenarios/as-pontes.toml");
    let setup = Setup::load("as-pontes.toml", unsteady, &no_files).unwrap();
    let summary = fly(&setup).summary;
    assert_ne!(summary.peak.status, PeakStatus::NotFound);
    assert!(
        summary.peak.error_m.unwrap() < FOUND_WITHIN_M,
        "{:?}",
        summary.peak
    );
    assert!(z(&summary).abs() < 3.0, "{:?}", summary.peak);
}

/// The reference mission in a reality in which one line is another.
fn with_reality(line: &str, by: &str) -> Setup {
    assert!(AS_PONTES.contains(line));
    Setup::load("other.toml", &AS_PONTES.replace(line, by), &no_files).unwrap()
}

fn without_a_plume_in_reality_nothing_is_found() {
    let summary = fly(&with_reality("c_max_ppm = 500.0", "c_max_ppm = 0.0")).summary;
    assert_eq!(summary.peak.status, PeakStatus::NotFound);
    assert_eq!((summary.peak.estimate, summary.flux.len()), (None, 0));
}

/// Realities of another form than the model's: what is said of the peak holds within two standard
/// deviations, or is said to be doubtful, in nine of ten.
fn a_second_source_is_found_and_weighed_beside_the_first() {
    let second = "\n[[reality.mechanism]]\nid = \"second-source\"\neast_m = 300.0\nnorth_m = -250.0\nratio = 0.5\n";
    let text = format!("{AS_PONTES}{second}");
    let mut setup = Setup::load("two.toml", &text, &no_files).unwrap();
    setup.scenario.mission.seed = 2;
    let summary = fly(&setup).summary;
    let [found] = &summary.mechanisms[..] else {
        panic!("{:?}", summary.mechanisms)
    };
    for (name, truth, within) in [
        ("east_m", 300.0, 30.0),
        ("north_m", -250.0, 30.0),
        ("ratio", 0.5, 0.05),
    ] {
        let off = found.parameters[name] - truth;
        assert!(off.abs() < within, "{name} is {off} off");
    }
    let weighed: Vec<_> = summary.flux.iter().collect();
    let of = |source: &str| weighed.iter().find(|f| f.found.source == source).unwrap();
    let (first, second) = (of("stack"), of("second-source"));
    // Half as much, by the reality's own number.
    let truth = [first, second].map(|f| f.truth_kg_s.unwrap());
    assert!((truth[1] / truth[0] - 0.5).abs() < 1e-9);
    for flux in [first, second] {
        let Estimate { value, sd } = flux.found.kg_s;
        let off = (value - flux.truth_kg_s.unwrap()).abs();
        assert!(off < 2.0 * sd && sd < 0.2 * value, "{flux:?}");
    }
    let axis = summary.model.after.axis_deg;
    assert!((axis.value - 72.0).abs() < 0.2, "{axis:?}");
}

fn in_realities_of_another_form_the_peak_holds_or_is_doubtful() {
    let mechanism = |id: &str, parameter: &str| {
        let text = format!("{AS_PONTES}\n[[reality.mechanism]]\nid = \"{id}\"\n{parameter}\n");
        Setup::load("other.toml", &text, &no_files).unwrap()
    };
    let class_b = "wind_from_deg = 252.0\nstability = \"B\"";
    let realities = [
        mechanism("sigma-z-growth", "exponent = 0.3"),
        mechanism("emission-trend", "rate_per_h = 1.5"),
        mechanism(
            "second-source",
            "east_m = 300.0\nnorth_m = -250.0\nratio = 0.5",
        ),
        mechanism("building-downwash", "area_m2 = 20000.0"),
        mechanism("sensor-gain", "factor = 1.2"),
        mechanism("wind-veer-with-height", "rate_deg_per_100m = 5.0"),
        mechanism("first-order-decay", "rate_per_s = 0.003"),
        mechanism("wind-direction-drift", "rate_deg_per_h = 30.0"),
        with_reality("wind_from_deg = 252.0", class_b),
    ];
    let of = |setup: &Setup| {
        let summary = fly(setup).summary;
        let claimed = summary.peak.status.stands();
        (claimed, summary.peak.estimate.map(|_| z(&summary)))
    };
    let said: Vec<_> = realities.iter().map(of).collect();
    let wrong = said
        .iter()
        .filter(|(claimed, z)| *claimed && z.is_none_or(|z| z.abs() > 2.0));
    assert!(wrong.count() <= 1, "{said:?}");
    assert!(
        said.iter().filter(|(claimed, _)| !claimed).count() <= 4,
        "{said:?}"
    );
}

/// The correction in flight, `calibrate` and the gap give the same values for the same readings, within half a standard
/// deviation.
fn agree(setup: &Setup, readings: &[Observation]) {
    for (key, estimates) in thrice(setup, readings) {
        for (k, a) in estimates.iter().enumerate() {
            for b in &estimates[..k] {
                let apart = (a.0 - b.0).abs() / a.1.min(b.1);
                assert!(apart < 0.5, "{key}: {estimates:?}");
            }
        }
    }
}

fn correction_and_gap_agree_in_their_standard_deviations() {
    let setup = as_pontes(1, 1);
    let readings = fly(&setup).readings;
    let mut worst = (1.0, "");
    for (key, estimates) in thrice(&setup, &readings) {
        for (k, a) in estimates.iter().enumerate() {
            for b in &estimates[..k] {
                let ratio = a.1.max(b.1) / a.1.min(b.1);
                if ratio > worst.0 {
                    worst = (ratio, key);
                }
            }
        }
    }
    bar::report(
        "standard deviations of correction in flight, calibrate and gap plume, largest ratio",
        "< 1.2",
        format!("{:.2} ({})", worst.0, worst.1),
        worst.0 < 1.2,
    );
}

fn so_do_other_seeds() {
    good((1..=3).map(|seed| fly(&as_pontes(seed, 1))).collect());
}

fn a_reality_whose_wind_turns_is_no_finding() {
    const TURNING: &str = "time_s,wind_speed_m_s,wind_from_deg\n0,8,249\n1800,8,255\n3600,8,261\n";
    let constant = "wind_speed_m_s = 8.0\nwind_from_deg = 252.0\n";
    let series = "series = \"turning.csv\"\n";
    assert!(AS_PONTES.contains(constant));
    let text = AS_PONTES.replace(constant, series);
    let read = |file: &str| match file {
        "turning.csv" => Ok(TURNING.as_bytes().to_vec()),
        other => no_files(other),
    };
    for seed in 1..=3 {
        let mut setup = Setup::load("turning.toml", &text, &read).unwrap();
        setup.scenario.mission.seed = seed;
        let said = fly(&setup).verdicts;
        assert_eq!(said.last().unwrap(), "none", "seed {seed}: {said:?}");
    }
}

fn three_real_vehicles_do_as_well() {
    let summary = campaign::fly(&as_pontes(1, 3)).unwrap();
    assert!(
        summary.peak.error_m.unwrap() <= FOUND_WITHIN_M,
        "{:?}",
        summary.peak
    );
    assert_eq!(summary.vehicles.len(), 6);
}

fn with_no_real_vehicle_the_model_stays_as_it_was() {
    let summary = campaign::fly(&as_pontes(1, 0)).unwrap();
    assert_eq!(summary.model.before, summary.model.after);
    assert_eq!(summary.model.reality, None);
    assert_eq!(summary.peak.status, PeakStatus::NotFound);
    assert_eq!(summary.peak.estimate, None);
}

fn one_vehicle_alone_flies_a_mission() {
    let mut setup = as_pontes(1, 1);
    setup.scenario.vehicles.drain(..5);
    setup.scenario.mission.duration_s = 900.0;
    let summary = campaign::fly(&setup).unwrap();
    assert_eq!(summary.vehicles.len(), 1);
    assert!(
        summary.vehicles[0].distance_m > 5_000.0,
        "{:?}",
        summary.vehicles
    );
}

fn calm_wind_is_flown_in() {
    let text = AS_PONTES
        .replace("wind_speed_m_s = 7.0", "wind_speed_m_s = 0.0")
        .replace("wind_speed_m_s = 8.0", "wind_speed_m_s = 0.0");
    let mut setup = Setup::load("calm.toml", &text, &no_files).unwrap();
    setup.scenario.mission.duration_s = 1500.0;
    let summary = campaign::fly(&setup).unwrap();
    assert!(
        summary.vehicles.iter().all(|v| v.distance_m > 1_000.0),
        "{:?}",
        summary.vehicles
    );
}

crate::runner::tests! {
    Cores {
        the_reference_mission_finds_the_peak_corrects_the_model_and_raises_no_alarm,
        in_unsteady_air_the_peak_is_found_within_what_is_said_of_it,
        without_a_plume_in_reality_nothing_is_found,
        a_second_source_is_found_and_weighed_beside_the_first,
        #[ignore = "second tier: a whole mission"]
        correction_and_gap_agree_in_their_standard_deviations,
        #[ignore = "second tier: nine missions"]
        in_realities_of_another_form_the_peak_holds_or_is_doubtful,
        #[ignore = "second tier: three missions"]
        so_do_other_seeds,
        #[ignore = "second tier: three missions"]
        a_reality_whose_wind_turns_is_no_finding,
        #[ignore = "second tier: a whole mission"]
        three_real_vehicles_do_as_well,
        #[ignore = "second tier: a whole mission"]
        with_no_real_vehicle_the_model_stays_as_it_was,
        one_vehicle_alone_flies_a_mission,
        calm_wind_is_flown_in,
    }
}
