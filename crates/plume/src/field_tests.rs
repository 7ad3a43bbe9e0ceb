use super::*;
use crate::mechanism::Mechanism;

/// The reference site: one stack, class D, wind from the west, 7 m/s at H.
pub(crate) fn spec(strength: Strength) -> DispersionSpec {
    DispersionSpec {
        ground_amsl_m: 340.0,
        atmosphere: Atmosphere::through(340.0, 15.0, 970.0).unwrap(),
        wind: WindProfile::new(7.0, 486.0, 270.0, 0.0).unwrap(),
        stability: Stability::D,
        setting: Setting::Rural,
        ground_reflection: false,
        mixing_height_m: None,
        lid_edge_m: 0.0,
        background_ppm: 449.0,
        sources: vec![SourceSpec {
            name: "stack".into(),
            gas: Gas::Co2,
            place: Enu::default(),
            area: None,
            stack_height_m: 356.0,
            effective_height_agl_m: 486.0,
            schedule: None,
            strength,
        }],
        sigma_y_scale: 1.0,
        sigma_z_scale: 1.0,
        mechanisms: Vec::new(),
        sensor: SensorSpec::default(),
    }
}

fn model(id: &str, p: &[(&str, f64)]) -> DispersionModel {
    let mut s = spec(Strength::EmissionKgS(352.0));
    s.mechanisms.push(Mechanism::new(id, p).unwrap());
    DispersionModel::new(s).unwrap()
}

fn plain() -> DispersionModel {
    DispersionModel::new(spec(Strength::EmissionKgS(352.0))).unwrap()
}

fn at(east_m: f64, north_m: f64, height_agl_m: f64) -> Place {
    Place {
        east_m,
        north_m,
        height_agl_m,
    }
}

fn excess(model: &DispersionModel, place: Place) -> f64 {
    model.mean_ppm(&place, 0.0) - model.background_ppm(&place, 0.0)
}

// The reference case: 352 kg/s of CO2, class D, 7 m/s: 410 ppm on the axis at 2.4 km with air
// at 920 hPa and 15 °C (python3: 352/(2 pi 7 sy sz)/.044009*8.314463*288.15/92000*1e6, with
// sy = 192/sqrt(1.24), sz = 144/sqrt(4.6), gives 410.4).
#[test]
fn reference_axis_maximum() {
    let mut s = spec(Strength::EmissionKgS(352.0));
    s.ground_amsl_m = 0.0;
    s.atmosphere = Atmosphere::through(486.0, 15.0, 920.0).unwrap();
    let model = DispersionModel::new(s).unwrap();
    let (sy, sz) = (192.0 / 1.24f64.sqrt(), 144.0 / 4.6f64.sqrt());
    let kg = 352.0 / (std::f64::consts::TAU * 7.0 * sy * sz);
    let expected = kg / 0.044_009 * 8.314_463 * 288.15 / 92_000.0 * 1e6;
    let axis = excess(&model, at(2400.0, 0.0, 486.0));
    assert!(
        (axis / expected - 1.0).abs() < 1e-6 && (axis - 410.0).abs() < 4.0,
        "{axis}"
    );
    // Off the axis by one sigma each: exp(-1).
    let off = excess(&model, at(2400.0, sy, 486.0));
    assert!((off / axis - (-0.5f64).exp()).abs() < 1e-9);
}

#[test]
fn both_forms_agree_where_they_were_tied() {
    let q = plain();
    let tie = excess(&q, at(2400.0, 0.0, 486.0));
    let c = DispersionModel::new(spec(Strength::CMax {
        excess_ppm: tie,
        distance_m: 2400.0,
    }))
    .unwrap();
    for place in [
        at(2400.0, 0.0, 486.0),
        at(1200.0, 80.0, 486.0),
        at(5000.0, -90.0, 486.0),
    ] {
        assert!((excess(&c, place) / excess(&q, place) - 1.0).abs() < 1e-9);
    }
    // The c_MAX form needs no wind speed.
    let mut calm = spec(Strength::CMax {
        excess_ppm: tie,
        distance_m: 2400.0,
    });
    calm.wind = WindProfile::new(0.0, 10.0, 270.0, 0.0).unwrap();
    let calm = DispersionModel::new(calm).unwrap();
    assert!((excess(&calm, at(2400.0, 0.0, 486.0)) - tie).abs() < 1e-9);
    assert!(calm.notices()[0].contains("calm"));
}

#[test]
fn calm_is_carried_at_the_least_speed() {
    let mut s = spec(Strength::EmissionKgS(352.0));
    s.wind = WindProfile::new(0.0, 10.0, 270.0, 0.0).unwrap();
    let model = DispersionModel::new(s).unwrap();
    let ratio = excess(&model, at(2400.0, 0.0, 486.0)) / excess(&plain(), at(2400.0, 0.0, 486.0));
    assert!((ratio - 7.0 / LEAST_TRANSPORT_M_S).abs() < 1e-9);
}

/// Mass through a plane across the wind per Q: 1 without losses.
fn flux(model: &DispersionModel, x: f64, top: f64) -> f64 {
    let (step_y, step_z) = (10.0, 4.0);
    let mut sum = 0.0;
    for j in 0..(top / step_z) as i32 {
        let z = (f64::from(j) + 0.5) * step_z;
        for i in -150..=150 {
            let (molar, _) =
                model.excess(&at(x, f64::from(i) * step_y, z), 0.0, model.scenario_wind);
            sum += molar * step_y * step_z;
        }
    }
    sum * 0.044_009 * 7.0 / 352.0
}

// Conservation of mass: all of the plume goes through any plane, whatever sends it back.
#[test]
fn mass_is_conserved() {
    assert!((flux(&plain(), 2000.0, 1600.0) - 1.0).abs() < 1e-4);
    let low = |id: &str, p: &[(&str, f64)], sz: f64| {
        let mut s = spec(Strength::EmissionKgS(352.0));
        s.sources[0].effective_height_agl_m = 100.0;
        s.ground_reflection = true;
        s.sigma_z_scale = sz;
        s.mechanisms.push(Mechanism::new(id, p).unwrap());
        DispersionModel::new(s).unwrap()
    };
    for sz in [1.0, 3.0, 6.0] {
        let bounded = low("mixing-lid", &[("height_m", 240.0)], sz);
        assert!(
            (flux(&bounded, 3000.0, 240.0) - 1.0).abs() < 2e-3,
            "sigma_z times {sz}"
        );
    }
    let open = low("sigma-y-scale", &[("factor", 1.3)], 1.0);
    assert!((flux(&open, 3000.0, 1200.0) - 1.0).abs() < 1e-4);
}

// Chamberlain's depletion against the loss it is made of: d(flux)/dx = -v c(ground) width.
#[test]
fn deposited_mass_is_what_the_ground_took() {
    let make = |velocity: f64| {
        let mut s = spec(Strength::EmissionKgS(352.0));
        s.sources[0].effective_height_agl_m = 60.0;
        s.ground_reflection = true;
        let p = [("velocity_m_s", velocity)];
        s.mechanisms
            .push(Mechanism::new("dry-deposition", &p).unwrap());
        DispersionModel::new(s).unwrap()
    };
    let model = make(0.05);
    let line = |x: f64| -> f64 {
        (-200..=200)
            .map(|i| {
                let p = at(x, f64::from(i) * 5.0, 0.0);
                model.excess(&p, 0.0, model.scenario_wind).0 * 5.0
            })
            .sum()
    };
    let taken: f64 = (0..400)
        .map(|i| 0.05 * line(1000.0 + (f64::from(i) + 0.5) * 5.0) * 5.0 * 0.044_009 / 352.0)
        .sum();
    let lost = flux(&model, 1000.0, 1200.0) - flux(&model, 3000.0, 1200.0);
    assert!((taken / lost - 1.0).abs() < 0.01, "{taken} {lost}");
}

#[test]
fn mechanisms_do_what_their_sign_says() {
    let axis = at(2400.0, 0.0, 486.0);
    // From-direction 270 + 10 = 280: the plume turns towards 100 degrees, that is to the south.
    let turned = model("wind-direction-offset", &[("offset_deg", 10.0)]);
    let there = Enu::default().displaced(100.0, 2400.0);
    let moved = excess(&turned, at(there.east_m, there.north_m, 486.0));
    assert!((moved / excess(&plain(), axis) - 1.0).abs() < 1e-9);
    let drift = model("wind-direction-drift", &[("rate_deg_per_h", 10.0)]);
    let place = at(there.east_m, there.north_m, 486.0);
    assert!((drift.mean_ppm(&place, 3600.0) / turned.mean_ppm(&place, 0.0) - 1.0).abs() < 1e-9);
    let veer = model("wind-veer-with-height", &[("rate_deg_per_100m", 10.0)]);
    assert!(
        excess(&veer, at(2400.0, -200.0, 536.0)) > excess(&veer, at(2400.0, 200.0, 536.0)) * 2.0
    );
    for (id, p, factor) in [
        ("emission-scale", ("factor", 1.2), 1.2),
        ("wind-speed-scale", ("factor", 2.0), 0.5),
        ("sigma-y-scale", ("factor", 2.0), 0.5),
        ("sigma-z-scale", ("factor", 0.5), 2.0),
        ("sigma-z-growth", ("exponent", 1.0), 1.0 / 2.4),
        (
            "first-order-decay",
            ("rate_per_s", 1e-3),
            (-2.4f64 / 7.0).exp(),
        ),
    ] {
        let ratio = excess(&model(id, &[p]), axis) / excess(&plain(), axis);
        assert!((ratio / factor - 1.0).abs() < 1e-9, "{id} {ratio}");
    }
    let higher = model("effective-height-offset", &[("offset_m", 30.0)]);
    let up = at(2400.0, 0.0, 516.0);
    let air = plain().ppm_per_mol_m3(516.0) / plain().ppm_per_mol_m3(486.0);
    assert!((excess(&higher, up) / excess(&plain(), axis) / air - 1.0).abs() < 1e-9);
    let moved = model(
        "source-position-offset",
        &[("east_m", 100.0), ("north_m", 40.0)],
    );
    let there = at(2500.0, 40.0, 486.0);
    assert!((excess(&moved, there) / excess(&plain(), axis) - 1.0).abs() < 1e-9);
}

#[test]
fn spread_and_source_mechanisms_act() {
    let axis = at(2400.0, 0.0, 486.0);
    let lower = |id: &str, p: &[(&str, f64)]| {
        assert!(
            excess(&model(id, p), axis) < 0.97 * excess(&plain(), axis),
            "{id}"
        );
    };
    lower("meander", &[("sigma_deg", 3.0)]);
    lower("stability-class", &[("shift", -1.0)]);
    lower("building-downwash", &[("area_m2", 8000.0)]);
    let b = model("emission-trend", &[("rate_per_h", 0.5)]);
    let ratio = (b.mean_ppm(&axis, 3600.0) - 449.0) / (b.mean_ppm(&axis, 0.0) - 449.0);
    assert!((ratio - 0.5f64.exp()).abs() < 1e-9);
    // Air that was emitted earlier is as much weaker as if it had decayed since.
    let decay = model("first-order-decay", &[("rate_per_s", 0.5 / 3600.0)]);
    for x in [300.0, 2400.0, 9000.0] {
        let place = at(x, 40.0, 400.0);
        let ratio = excess(&b, place) / excess(&decay, place);
        assert!((ratio - 1.0).abs() < 1e-9, "{x} m: {ratio}");
    }
    let second = model(
        "second-source",
        &[
            ("east_m", 0.0),
            ("north_m", 800.0),
            ("ratio", 0.5),
            ("height_offset_m", 0.0),
        ],
    );
    let ratio = excess(&second, at(2400.0, 800.0, 486.0)) / excess(&plain(), axis);
    assert!((ratio - 0.5).abs() < 1e-3, "{ratio}");
    let place = at(2000.0, 3000.0, 100.0);
    for (id, p, ppm) in [
        ("background-offset", vec![("offset_ppm", 4.0)], 4.0),
        ("background-drift", vec![("rate_ppm_per_h", 8.0)], 4.0),
        (
            "background-gradient",
            vec![("east_ppm_per_km", 2.0), ("north_ppm_per_km", 1.0)],
            7.0,
        ),
    ] {
        assert!(
            (model(id, &p).mean_ppm(&place, 1800.0) - 449.0 - ppm).abs() < 1e-6,
            "{id}"
        );
    }
}

#[test]
fn lid_alone_sends_back_and_holds_off() {
    let lid = model("mixing-lid", &[("height_m", 520.0)]);
    let ratio = excess(&lid, at(2400.0, 0.0, 519.999)) / excess(&plain(), at(2400.0, 0.0, 519.999));
    assert!((ratio - 2.0).abs() < 1e-4, "{ratio}");
    assert_eq!(excess(&lid, at(2400.0, 0.0, 530.0)), 0.0);
    // A plume that levels off above the lid does not feel it.
    let above = model("mixing-lid", &[("height_m", 300.0)]);
    let p = at(2400.0, 0.0, 486.0);
    assert_eq!(excess(&above, p), excess(&plain(), p));
}

// The logistic distribution has its median at the edge, and at one standard deviation below it
// 1 / (1 + exp(-pi / sqrt 3)) = .8598 of the cases.
#[test]
fn a_lid_whose_height_is_not_exact_ends_the_plume_gradually() {
    let lid = |edge_m: f64| {
        let mut s = spec(Strength::EmissionKgS(352.0));
        s.mixing_height_m = Some(520.0);
        s.lid_edge_m = edge_m;
        DispersionModel::new(s).unwrap()
    };
    let (sharp, smeared) = (lid(0.0), lid(2.0));
    let part = |z: f64| excess(&smeared, at(2400.0, 0.0, z)) / excess(&sharp, at(2400.0, 0.0, z));
    assert!((part(520.0) - 0.5).abs() < 1e-9);
    assert!((part(518.0) - 0.8598).abs() < 1e-4);
    assert!((part(480.0) - 1.0).abs() < 1e-9);
    assert!(excess(&smeared, at(2400.0, 0.0, 522.0)) > 0.0);
}

#[test]
fn refuses_nonsense_by_name() {
    let broken = |change: &dyn Fn(&mut DispersionSpec)| {
        let mut s = spec(Strength::EmissionKgS(352.0));
        change(&mut s);
        DispersionModel::new(s).unwrap_err().to_string()
    };
    assert!(broken(&|s| s.sources.clear()).contains("no source"));
    assert!(broken(&|s| s.sigma_y_scale = -1.0).contains("sigma_y_scale"));
    assert!(broken(&|s| s.background_ppm = f64::NAN).contains("background"));
    assert!(broken(&|s| s.sources[0].strength = Strength::EmissionKgS(-3.0)).contains("stack"));
    assert!(broken(&|s| s.sensor.noise_sd_ppm = -1.0).contains("noise"));
}

proptest::proptest! {
    #[test]
    fn never_negative_never_nan(e in -3e4f64..3e4, n in -3e4f64..3e4, z in -100.0f64..3000.0,
                                u in 0.0f64..30.0, class in 0usize..6, ground: bool,
                                lid in proptest::option::of(20.0f64..2000.0)) {
        let mut s = spec(Strength::EmissionKgS(352.0));
        s.wind = WindProfile::new(u, 10.0, 33.0, 0.15).unwrap();
        s.stability = Stability::ALL[class];
        s.ground_reflection = ground;
        s.mixing_height_m = lid;
        let c = DispersionModel::new(s).unwrap().mean_ppm(&at(e, n, z), 100.0);
        proptest::prop_assert!((449.0..=1e6 + 449.0).contains(&c), "{}", c);
    }

    #[test]
    fn turning_site_and_wind_together_changes_nothing(angle in 0.0f64..360.0,
            x in 100.0f64..5000.0, y in -200.0f64..200.0) {
        let mut s = spec(Strength::EmissionKgS(352.0));
        s.wind = WindProfile::new(7.0, 486.0, 270.0 + angle, 0.0).unwrap();
        let turned = DispersionModel::new(s).unwrap();
        let (sin, cos) = angle.to_radians().sin_cos();
        let place = at(x * cos + y * sin, y * cos - x * sin, 486.0);
        let (a, b) = (turned.mean_ppm(&place, 0.0), plain().mean_ppm(&at(x, y, 486.0), 0.0));
        proptest::prop_assert!((a - b).abs() < 1e-8 * b);
    }
}

#[test]
fn c_max_is_what_is_on_the_axis_whatever_sends_the_plume_back() {
    // 400 ppm at 2400 m, 50 m above a ground that reflects: the image adds a third there, and c_MAX has it.
    let mut s = spec(Strength::CMax {
        excess_ppm: 400.0,
        distance_m: 2400.0,
    });
    s.sources[0].effective_height_agl_m = 50.0;
    s.ground_reflection = true;
    for lid_m in [None, Some(120.0)] {
        s.mixing_height_m = lid_m;
        let model = DispersionModel::new(s.clone()).unwrap();
        let axis = excess(&model, at(2400.0, 0.0, 50.0));
        assert!((axis - 400.0).abs() < 1e-9, "{axis}");
        assert!((model.axis_excess_ppm(2400.0) - 400.0).abs() < 1e-9);
    }
}

#[test]
fn the_stated_c_max_makes_the_same_model_with_any_mechanism() {
    for (id, p) in [
        ("wind-direction-offset", &[("offset_deg", 12.0)][..]),
        ("sigma-y-scale", &[("factor", 1.6)]),
        ("first-order-decay", &[("rate_per_s", 0.002)]),
        ("emission-scale", &[("factor", 1.4)]),
        ("effective-height-offset", &[("offset_m", 40.0)]),
    ] {
        let emission = model(id, p);
        let mut s = emission.spec().clone();
        s.sources[0].strength = Strength::CMax {
            excess_ppm: emission.stated_c_max_ppm(1000.0),
            distance_m: 1000.0,
        };
        let stated = DispersionModel::new(s).unwrap();
        assert!(
            (stated.stated_c_max_ppm(1000.0) / emission.stated_c_max_ppm(1000.0) - 1.0).abs()
                < 1e-12
        );
        // Along the axis where the mechanism has it, where the air is as dense.
        for x_m in [500.0, 1000.0, 3000.0] {
            let (a, b) = (stated.axis_excess_ppm(x_m), emission.axis_excess_ppm(x_m));
            assert!((a / b - 1.0).abs() < 1e-9, "{id} at {x_m} m: {a} for {b}");
        }
    }
}
