//! Scenarios that users write: what is read, what is refused and where it points.

use plume::Gas;
use scenario::Scenario;
use scenario::tables::VehicleKind;
use scenario::uncertain::Uncertain;

const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");

/// Nothing but what may not be left out.
const LEAST: &str = "\
[site]
lat_deg = 43.4417
lon_deg = -7.8631
ground_amsl_m = 340.0

[[source]]
lat_deg = 43.4417
lon_deg = -7.8631
emission_kg_s = 352.0
";

fn refused(text: &str) -> String {
    Scenario::parse("s.toml", text)
        .expect_err("must be refused")
        .to_string()
}

#[test]
fn the_least_scenario_has_a_team_and_a_world() {
    let s = Scenario::parse("s.toml", LEAST).unwrap();
    assert_eq!(s.vehicles.len(), 6);
    assert_eq!(
        s.vehicles
            .iter()
            .filter(|v| v.kind == VehicleKind::StandIn)
            .count(),
        1
    );
    assert!(s.dispersion_model().is_ok());
    assert_eq!(s.in_reality().background, s.background);
}

#[test]
fn homes_of_a_large_team_are_apart_and_fit_into_a_usual_fence() {
    let vehicles: String = (0..1000)
        .map(|k| format!("[[vehicle]]\nid = \"{k}\"\nkind = \"simulated\"\n"))
        .collect();
    let s = Scenario::parse("s.toml", &format!("{LEAST}{vehicles}")).unwrap();
    let frame = s.frame().unwrap();
    let homes: Vec<_> = (0..1000)
        .map(|k| frame.to_enu(s.home(k).unwrap()))
        .collect();
    for (k, home) in homes.iter().enumerate() {
        for other in &homes[..k] {
            let apart_m = home.distance_m(*other);
            assert!((59.0..8300.0).contains(&apart_m), "{apart_m} m");
        }
    }
}

#[test]
fn as_pontes_has_the_numbers_of_the_power_plant() {
    let s = Scenario::parse("as-pontes.toml", AS_PONTES).unwrap();
    // The paper's flight: 859 ppm at 2.4 km with a background of 449 ppm, axis at 486 m.
    let world = s.dispersion_model().unwrap();
    let (east, north) = 60f64.to_radians().sin_cos();
    let at = plume::Place {
        east_m: 2400.0 * east,
        north_m: 2400.0 * north,
        height_agl_m: 486.0,
    };
    assert!((world.mean_ppm(&at, 0.0) - 859.0).abs() < 0.5);
    let air = s.atmosphere().unwrap().at(340.0 + 486.0);
    assert!((air.pressure_pa / 100.0 - 920.0).abs() < 0.5, "{air:?}");
    assert!((air.temperature_k - 288.15).abs() < 0.1);
    assert_eq!(s.prior_sd(Uncertain::EffectiveHeight), Some(50.0));
}

#[test]
fn reality_changes_only_what_it_names() {
    let s = Scenario::parse("as-pontes.toml", AS_PONTES).unwrap();
    let reality = s.in_reality();
    assert_eq!(reality.weather.wind_from_deg, 252.0);
    assert_eq!(reality.weather.stability, s.weather.stability);
    assert_eq!(reality.sources[0].effective_height_m, Some(540.0));
    assert_eq!(reality.sources[0].c_max_distance_m, Some(2400.0));
    assert_eq!(reality.fence, s.fence);
}

#[test]
fn reality_may_give_the_source_by_its_emission() {
    let text = format!("{LEAST}\n[[reality.source]]\nc_max_ppm = 300\nc_max_distance_m = 2000\n");
    let reality = Scenario::parse("s.toml", &text).unwrap().in_reality();
    assert_eq!(reality.sources[0].emission_kg_s, None);
    assert_eq!(reality.sources[0].c_max_ppm, Some(300.0));
}

/// `before`, changed in all that a finding may set.
fn extended(before: &Scenario) -> Scenario {
    let mut after = before.clone();
    after.weather.series = None;
    for key in Uncertain::ALL {
        if let Some(value) = before.value(key) {
            after.set_with_sd(key, 1.1 * value + 0.1, 0.1);
        }
    }
    let sensor = after.sensor_mut();
    sensor.noise_sd_ppm = Some(7.0);
    sensor.slow_sd_ppm = Some(8.0);
    sensor.slow_time_s = Some(9.0);
    let class = plume::Mechanism::from_values(plume::MechanismId::StabilityClass, &[1.0]);
    after.extend(&[class]);
    after.with_reality_of(before)
}

/// What stand-ins meet: the air, the sources, and what their sensors do. As text, since a parameter that a mechanism
/// does not have is no number.
fn world(scenario: &Scenario) -> String {
    let reality = scenario.in_reality();
    let sensors = reality.sensor.0.iter().map(|sensor| {
        let slow = (
            sensor.slow_sd_ppm.unwrap_or(0.0),
            sensor.slow_time_s.unwrap_or(100.0),
        );
        let noise_sd_ppm = sensor.noise_sd_ppm(sensor.gas.unwrap_or(Gas::Co2));
        let gain = (sensor.gain, sensor.offset_ppm, sensor.drift_ppm_per_h);
        (sensor.gas, sensor.time_constant_s, noise_sd_ppm, slow, gain)
    });
    format!(
        "{:#?} {:?} {:?} {:?}",
        reality.dispersion_spec().unwrap(),
        reality.weather.series,
        reality.mechanisms,
        sensors.collect::<Vec<_>>(),
    )
}

#[test]
fn what_is_found_changes_no_reality() {
    let with = |more: &str| format!("{LEAST}{more}");
    let texts = [
        AS_PONTES.to_owned(),
        with("[reality.weather]\nwind_from_deg = 250.0\n"),
        with("[reality]\nmechanism = [{ id = \"sensor-lag\", time_constant_s = 9.0 }]\n"),
        with(
            "[[mechanism]]\nid = \"sensor-offset\"\noffset_ppm = 3.0\n[reality.plume]\nsigma_y_scale = 2.0\n",
        ),
        with("[[reality.source]]\nc_max_ppm = 300\nc_max_distance_m = 2000\n"),
        with("[weather]\nseries = \"w.csv\"\n[reality.sensor]\ngain = 1.2\n"),
        with("[reality.weather]\nseries = \"w.csv\"\n"),
        with("[background]\nco2_ppb = 450000.0\n[reality.plume]\nsigma_y_scale = 2.0\n"),
        with(
            "[[sensor]]\ngas = \"ch4\"\ntime_constant_s = 4.0\n[[sensor]]\ntime_constant_s = 2.0\n\
              [reality]\nsensor = [{ gas = \"co2\", gain = 1.3 }]\n",
        ),
    ];
    for text in texts {
        let before = Scenario::parse("s.toml", &text).unwrap();
        let after = extended(&before);
        assert_eq!(world(&before), world(&after), "{}", after.to_toml());
        let read = Scenario::parse("extended.toml", &after.to_toml()).unwrap();
        assert_eq!(world(&before), world(&read), "{}", after.to_toml());
    }
    // Without a reality, the stand-ins fly in the world that is stated.
    let none = extended(&Scenario::parse("s.toml", LEAST).unwrap());
    assert_eq!(none.reality, None);
}

#[test]
fn an_unchanged_reality_states_no_more() {
    let before = Scenario::parse("s.toml", &with_class_b()).unwrap();
    let mut after = before.clone();
    let lag = plume::Mechanism::from_values(plume::MechanismId::SensorLag, &[2.0]);
    after.extend(&[lag]);
    let after = after.with_reality_of(&before);
    assert!(
        after.to_toml().contains("[reality]\nmechanism = []\n"),
        "{}",
        after.to_toml()
    );
    assert!(
        !after.to_toml().contains("[reality.sensor]"),
        "{}",
        after.to_toml()
    );
}

fn with_class_b() -> String {
    format!("{LEAST}\n[reality.weather]\nstability = \"B\"\n")
}

#[test]
fn the_resolved_scenario_reads_back_as_itself() {
    for text in [LEAST, AS_PONTES, TWO_GASES] {
        let s = Scenario::parse("s.toml", text).unwrap();
        assert_eq!(Scenario::parse("again.toml", &s.to_toml()).unwrap(), s);
    }
}

/// Methane beside CO2, each with a sensor of its own and a background in its own unit.
const TWO_GASES: &str = "\
[site]
lat_deg = 43.4417
lon_deg = -7.8631
ground_amsl_m = 340.0

[[source]]
name = \"stack\"
lat_deg = 43.4417
lon_deg = -7.8631
emission_kg_s = 352.0

[[source]]
name = \"leak\"
gas = \"ch4\"
lat_deg = 43.4427
lon_deg = -7.8631
emission_kg_s = 0.02

[background]
co2_ppm = 430
ch4_ppb = 1950

[[sensor]]
gas = \"co2\"
time_constant_s = 2.0

[[sensor]]
gas = \"ch4\"
noise_sd_ppm = 0.001

[uncertain]
\"background.ch4_ppb\" = 20

[[reality.source]]
emission_kg_s = 300.0

[[reality.source]]
emission_kg_s = 0.03

[reality.background]
ch4_ppm = 1.97

[[reality.sensor]]
gas = \"ch4\"
offset_ppm = 0.01
";

#[test]
fn a_scenario_is_read_for_one_of_its_gases() {
    let co2 = Scenario::parse("s.toml", TWO_GASES).unwrap();
    assert_eq!(co2.gas(), Gas::Co2);
    let ch4 = co2.of_gas(Gas::Ch4).unwrap();
    let spec = ch4.dispersion_spec().unwrap();
    assert_eq!(spec.sources[0].name, "leak");
    // The stack keeps its keep-out, but emits nothing that is read.
    assert_eq!(spec.sources[1].gas, Gas::Co2);
    assert_eq!(
        (spec.background_ppm, spec.sensor.noise_sd_ppm),
        (1.95, 0.001)
    );
    assert_eq!(ch4.sensor.noise_sd_ppm, Some(0.001));
    assert_eq!(ch4.prior_sd(Uncertain::Background), Some(0.02));
    assert_eq!(co2.prior_sd(Uncertain::Background), None);
    let stated = co2.dispersion_spec().unwrap();
    assert_eq!(
        (stated.background_ppm, stated.sensor.noise_sd_ppm),
        (430.0, 3.0)
    );
    let reality = ch4.in_reality();
    assert_eq!(reality.sources[0].emission_kg_s, Some(0.03));
    let spec = reality.dispersion_spec().unwrap();
    assert_eq!((spec.background_ppm, spec.sensor.offset_ppm), (1.97, 0.01));
    assert_eq!(spec.sensor.noise_sd_ppm, 0.001);
    assert_eq!(co2.in_reality().sources[0].emission_kg_s, Some(300.0));
    assert!(co2.of_gas(Gas::So2).unwrap_err().contains("gas = \"so2\""));
}

#[test]
fn what_a_gas_leaves_out_is_as_usual_for_it() {
    for gas in Gas::ALL {
        let text = LEAST.replace(
            "[[source]]",
            &format!("[[source]]\ngas = \"{}\"", gas.as_str()),
        );
        let s = Scenario::parse("s.toml", &text).unwrap();
        let spec = s.dispersion_spec().unwrap();
        assert!(spec.background_ppm > 0.0 && spec.sensor.noise_sd_ppm > 0.0);
        let written = s.to_toml();
        assert!(written.contains(gas.column(plume::Unit::Ppm)), "{written}");
        assert!(written.contains("noise_sd_ppm"), "{written}");
        // What is shown of the background tells it from none.
        let shown = format!("{:.*}", gas.digits(), spec.background_ppm);
        assert!(shown.parse::<f64>().unwrap() > 0.0, "{gas:?}: {shown}");
    }
}

#[test]
fn a_reality_may_single_out_a_sensor() {
    let text = format!(
        "{LEAST}\n[sensor]\ntime_constant_s = 2\n[[reality.sensor]]\ngas = \"co2\"\ngain = 1.1\n"
    );
    let s = Scenario::parse("s.toml", &text).unwrap();
    assert_eq!(s.sensor().gain, 1.0);
    let real = s.in_reality();
    assert_eq!(
        (real.sensor().gain, real.sensor().time_constant_s),
        (1.1, 2.0)
    );
}

#[test]
fn wrong_keys_and_types_point_at_their_line() {
    let wrong = LEAST.replace("emission_kg_s", "emission_kgs");
    let message = refused(&wrong);
    assert!(message.starts_with("s.toml:9:1"), "{message}");
    assert!(message.contains("emission_kgs"), "{message}");
    assert!(refused("[site]\nlat_deg = \"north\"").starts_with("s.toml:2:11"));
    assert!(refused("[site\n").starts_with("s.toml:1"));
    assert!(refused("").contains("site"));
}

#[test]
fn values_that_cannot_be_point_at_their_line_and_say_what_can() {
    let cases = [
        (
            "[weather]\nwind_speed_m_s = -3",
            "s.toml:12:18: weather.wind_speed_m_s = -3",
            "0 to 60",
        ),
        (
            "[weather]\nwind_speed_m_s = nan",
            "weather.wind_speed_m_s = NaN",
            "0 to 60",
        ),
        (
            "[weather]\npressure_hpa = 92000",
            "weather.pressure_hpa = 92000",
            "hPa",
        ),
        (
            "[plume]\nsigma_y_scale = -1.0",
            "s.toml:12:17: plume.sigma_y_scale = -1",
            "positive",
        ),
        (
            "[sensor]\nnoise_sd_ppm = -2",
            "sensor.noise_sd_ppm = -2",
            "zero or more",
        ),
        (
            "[background]\nch5_ppm = 2",
            "s.toml:12:11: background.ch5_ppm = 2",
            "ch4_ppm",
        ),
        (
            "[background]\nco2_ppm = 450\nco2_ppb = 450000",
            "background.co2_ppb = 450000",
            "not both",
        ),
        (
            "[background]\nch4_ppm = 1.95",
            "s.toml:12:11: background.ch4_ppm = 1.95",
            "background.co2_ppm, or gas = \"ch4\" in a [[source]]",
        ),
        (
            "[uncertain]\n\"background.ch4_ppb\" = 20",
            "s.toml:12:24: uncertain.background.ch4_ppb = 20",
            "background.co2_ppb",
        ),
        (
            "[[sensor]]\ngas = \"ch4\"",
            "sensor = none for co2",
            "gas = \"co2\"",
        ),
        (
            "[[sensor]]\ngas = \"co2\"\n[[sensor]]\ngas = \"co2\"",
            "sensor.1 = co2",
            "no other",
        ),
        (
            "[[sensor]]\ngas = \"co2\"\n[[sensor]]\ngain = 0",
            "sensor.1.gain = 0",
            "positive",
        ),
        (
            "[mission]\ntick_s = 0",
            "mission.tick_s = 0",
            "0.001 to 0.1",
        ),
        ("[mission]\nname = \"a/b\"", "mission.name = a/b", "letters"),
        (
            "[uncertain]\n\"weather.wind\" = 3",
            "uncertain.weather.wind",
            "weather.wind_from_deg",
        ),
        (
            "[uncertain]\n\"background.co2_ppm\" = 0",
            "background.co2_ppm = 0",
            "positive",
        ),
        (
            "[fence]\npolygon = [[43.0, -7.0]]",
            "fence.polygon = 1",
            "three corners",
        ),
        (
            "[[vehicle]]\nid = \"1\"\n[[vehicle]]\nid = \"1\"",
            "vehicle.1.id = 1",
            "no other",
        ),
        (
            "[[vehicle]]\nid = \"1\"\nkind = \"mavlink\"",
            "without link",
            "udpin",
        ),
        (
            "[[vehicle]]\nid = \"1\"\nkind = \"mavlink\"\nlink = \"udpin:a:1\"\nsystem_id = 1\n\
             [[vehicle]]\nid = \"2\"\nkind = \"mavlink\"\nlink = [\"udpin:b:1\", \"udpin:a:1\"]",
            "vehicle.1.system_id = none",
            "share a link",
        ),
        (
            "[[vehicle]]\nid = \"1\"\nkind = \"mavlink\"\nlink = \"udpin:a:1\"\nsystem_id = 255",
            "vehicle.0.system_id = 255",
            "ground station's",
        ),
        (
            "[[vehicle]]\nid = \"1\"\nsystem_id = 4",
            "vehicle.0 = system_id",
            "kind = \"mavlink\"",
        ),
        (
            "[[vehicle]]\nid = \"1\"\nkind = \"mavlink\"\nlink = \"udpin:a:1\"\n\
             [vehicle.gas]\nname = \"CO2\"\nscale = 0",
            "vehicle.0.gas.scale = 0",
            "not 0",
        ),
        (
            "[[mechanism]]\nid = \"sensor-lag\"\nlag = 3",
            "mechanism",
            "time_constant_s",
        ),
        (
            "[reality.weather]\nwind_speed_m_s = -1",
            "s.toml:12:18: weather.wind_speed_m_s = -1",
            "0 to 60",
        ),
        (
            "[reality.fence]\nfloor_agl_m = 1",
            "reality.fence",
            "weather",
        ),
    ];
    for (addition, place, right) in cases {
        let message = refused(&format!("{LEAST}\n{addition}\n"));
        assert!(message.contains(place), "{addition:?}: {message}");
        assert!(message.contains(right), "{addition:?}: {message}");
    }
}

#[test]
fn a_source_needs_one_strength() {
    let none = LEAST.replace("emission_kg_s = 352.0", "");
    assert!(refused(&none).contains("either emission_kg_s or emission_series, or c_max_ppm"));
    let half = LEAST.replace("emission_kg_s = 352.0", "c_max_ppm = 400.0");
    assert!(refused(&half).contains("c_max_distance_m"));
}

#[test]
fn calm_wind_is_a_world() {
    let s = Scenario::parse(
        "s.toml",
        &format!("{LEAST}\n[weather]\nwind_speed_m_s = 0\n"),
    )
    .unwrap();
    let world = s.dispersion_model().unwrap();
    let at = plume::Place {
        east_m: 1000.0,
        north_m: 0.0,
        height_agl_m: 0.0,
    };
    assert!(world.mean_ppm(&at, 0.0).is_finite());
}

proptest::proptest! {
    #[test]
    fn garbage_never_panics(text in ".{0,400}") {
        let _ = Scenario::parse("s.toml", &text);
    }

    #[test]
    fn a_cut_scenario_never_panics(keep in 0usize..4000) {
        let keep = (0..=keep.min(AS_PONTES.len())).rev().find(|&k| AS_PONTES.is_char_boundary(k));
        let _ = Scenario::parse("s.toml", &AS_PONTES[..keep.unwrap_or(0)]);
    }
}

#[test]
fn an_area_is_refused_with_what_would_be_right() {
    let text = include_str!("../../../scenarios/area-source.toml");
    let scenario = Scenario::parse("a.toml", text).unwrap();
    let area = scenario.sources[0].area().unwrap();
    assert_eq!(
        (area.length_m, area.width_m, area.axis_deg),
        (400.0, 250.0, 30.0)
    );
    // A reality changes the emission and keeps the area.
    assert_eq!(scenario.in_reality().sources[0].area(), Some(area));
    for (from, to, words) in [
        (
            "emission_kg_s = 5.0 ",
            "c_max_ppm = 5.0\nc_max_distance_m = 300.0 #",
            "emission_kg_s of the whole area",
        ),
        ("shape = \"area\"\n", "", "shape = \"area\" with this key"),
        (
            "width_m = 250.0\n",
            "",
            "differ by less than a factor of 100",
        ),
        (
            "width_m = 250.0",
            "width_m = 2.0",
            "differ by less than a factor of 100",
        ),
        ("outline = \"ellipse\"", "outline = \"disc\"", "ellipse"),
    ] {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from}");
        let refused = Scenario::parse("a.toml", &broken).unwrap_err().to_string();
        assert!(
            refused.contains(words) && refused.contains("a.toml"),
            "{refused}"
        );
    }
}

#[test]
fn links_and_gas_sensors_are_one_or_several() {
    let text = |link: &str, gas: &str| {
        format!(
            "{LEAST}\n[[vehicle]]\nid = \"1\"\nkind = \"mavlink\"\nlink = {link}\nsystem_id = 7\n{gas}"
        )
    };
    let parse = |text: &str| Scenario::parse("s.toml", text).unwrap();
    let one = parse(&text(
        "\"udpin:a:1\"",
        "[vehicle.gas]\nname = \"GAS\"\nscale = 0.1",
    ));
    assert_eq!(one.vehicles[0].link, ["udpin:a:1"]);
    assert_eq!(one.vehicles[0].gas[0].scale, 0.1);
    let several = "[[vehicle.gas]]\nname = \"A\"\ngas = \"ch4\"\n[[vehicle.gas]]\nname = \"B\"\ntime = \"arrival\"";
    let two = parse(&text("[\"udpin:a:1\", \"tcp:b:2\"]", several));
    assert_eq!(two.vehicles[0].link, ["udpin:a:1", "tcp:b:2"]);
    assert_eq!(two.vehicles[0].gas[0].gas, Some(Gas::Ch4));
    // What is written out is read in as the same.
    for scenario in [one, two] {
        let again = toml::to_string(&scenario).unwrap();
        assert_eq!(parse(&again).vehicles, scenario.vehicles);
    }
    let wrong = refused(&text(
        "\"udpin:a:1\"",
        "[vehicle.gas]\nname = \"A\"\nfactor = 2",
    ));
    assert!(
        wrong.contains("factor") && wrong.contains("scale"),
        "{wrong}"
    );
}

#[test]
fn a_start_in_flight_has_its_ranges_and_is_a_simulated_vehicle_s() {
    let text = |kind: &str, place: &str| {
        format!("{LEAST}\n[[vehicle]]\nid = \"1\"\nkind = \"{kind}\"\nairborne = {{ {place} }}\n")
    };
    let place = "lat_deg = 43.43, lon_deg = -7.87, alt_amsl_m = 800.0, heading_deg = 90.0";
    let read = Scenario::parse("s.toml", &text("simulated", place)).unwrap();
    let start = read.vehicles[0].airborne.unwrap();
    assert_eq!((start.alt_amsl_m, start.heading_deg), (800.0, 90.0));
    // Written out and read again it is the same.
    let again = Scenario::parse("s.toml", &read.to_toml()).unwrap();
    assert_eq!(again.vehicles[0].airborne, Some(start));
    for (from, to, key) in [
        ("43.43", "95.0", "vehicle.0.airborne.lat_deg"),
        ("-7.87", "200.0", "vehicle.0.airborne.lon_deg"),
        ("800.0", "40000.0", "vehicle.0.airborne.alt_amsl_m"),
        ("90.0", "1000.0", "vehicle.0.airborne.heading_deg"),
    ] {
        let error = refused(&text("simulated", &place.replace(from, to)));
        assert!(error.contains(key), "{error}");
    }
    let error = refused(&text("stand-in", place));
    assert!(error.contains("kind = \"simulated\""), "{error}");
    let error = refused(&text("simulated", "lat_deg = 43.43, lon_deg = -7.87"));
    assert!(error.contains("alt_amsl_m"), "{error}");
}

#[test]
fn the_rate_of_recorded_states_has_its_range() {
    let text = |hz: &str| format!("{LEAST}\n[record]\nstate_hz = {hz}\n");
    let read = Scenario::parse("s.toml", &text("0.5")).unwrap();
    assert_eq!(read.record.state_hz, Some(0.5));
    let again = Scenario::parse("s.toml", &read.to_toml()).unwrap();
    assert_eq!(again.record, read.record);
    assert!(
        !Scenario::parse("s.toml", LEAST)
            .unwrap()
            .to_toml()
            .contains("[record]")
    );
    for hz in ["0.0", "-1.0", "nan", "1e9"] {
        let error = refused(&text(hz));
        assert!(error.contains("record.state_hz"), "{error}");
    }
}
