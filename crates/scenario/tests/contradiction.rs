//! What readings say against the values of a scenario.

use scenario::Scenario;
use scenario::contradiction::{Corrected, Evidence, Known, Read};

const SITE: &str = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n[weather]\nwind_from_deg=240\nwind_speed_m_s=7\n\
    [background]\nco2_ppm=BACKGROUND\n[[source]]\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=300\neffective_height_m=486\n\
    [uncertain]\n\"background.co2_ppm\"=4\n\"weather.wind_from_deg\"=12\n";

fn evidence(background: &str) -> Evidence {
    slipped(background, "", "")
}

/// The scenario with a text in it replaced.
fn slipped(background: &str, right: &str, wrong: &str) -> Evidence {
    let text = SITE.replace("BACKGROUND", background).replace(right, wrong);
    Evidence::new(&Scenario::parse("s.toml", &text).unwrap())
}

fn keys(evidence: &Evidence) -> Vec<String> {
    evidence
        .contradictions()
        .into_iter()
        .map(|c| c.key)
        .collect()
}

/// Clean air of 446 ppm with a plume in every tenth reading, 2 km from the source in a direction, at a height.
fn read_at(evidence: &mut Evidence, wind: Option<(f64, f64)>, plume_deg: f64, height_m: f64) {
    let frame = air::geo::LocalFrame::new(43.4, -7.8, 340.0).unwrap();
    let at = frame.to_geodetic(air::geo::Enu::new(0.0, 0.0).displaced(plume_deg, 2000.0));
    for k in 0..1000 {
        let noise = [-3.0, 0.0, 3.0][k % 3];
        let plume = if k % 10 == 0 { 500.0 } else { 0.0 };
        evidence.read(&Read {
            vehicle: "1",
            ppm: 446.0 + noise + plume,
            at,
            alt_amsl_m: 340.0 + height_m,
            wind,
        });
    }
}

fn read(evidence: &mut Evidence, wind: Option<(f64, f64)>) {
    read_at(evidence, wind, wind.map_or(60.0, |w| w.1 + 180.0), 500.0);
}

#[test]
fn a_background_that_no_reading_comes_near_is_contradicted() {
    for (background, expected) in [
        ("449", 0),
        ("4.49", 1),
        ("4490", 1),
        ("549", 1),
        ("0.449", 1),
    ] {
        let mut evidence = evidence(background);
        read(&mut evidence, Some((8.0, 252.0)));
        let found = evidence.contradictions();
        assert_eq!(found.len(), expected, "{background}: {found:?}");
        assert!(
            found.iter().all(|c| c.key == "background.co2_ppm"),
            "{found:?}"
        );
    }
    let mut slipped = evidence("4.49");
    read(&mut slipped, None);
    let says = &slipped.contradictions()[0].says;
    assert!(
        says.contains("background.co2_ppm is 4.5 ± 4.0, and they show 443"),
        "{says}"
    );
}

#[test]
fn a_wind_from_the_other_side_is_contradicted_by_what_vehicles_report() {
    let mut evidence = evidence("449");
    read(&mut evidence, Some((8.0, 60.0)));
    assert_eq!(keys(&evidence), ["weather.wind_from_deg"]);
}

#[test]
fn a_posterior_far_from_its_prior_is_contradicted_and_a_usual_one_is_not() {
    let mut evidence = evidence("449");
    // Clean air alone would contradict no plume.
    read_at(&mut evidence, Some((8.0, 252.0)), 72.0, 540.0);
    let known = |value, sd| Known { value, sd };
    let usual = Corrected {
        background_ppm: known(446.0, 0.3),
        effective_height_agl_m: known(540.0, 12.0),
        axis_deg: known(72.0, 1.0),
        strength: known(1.3, 0.2),
        sigma_y_scale: known(1.25, 0.1),
        sigma_z_scale: known(0.85, 0.1),
    };
    evidence.correct(usual, None);
    assert_eq!(keys(&evidence), Vec::<String>::new());
    evidence.correct(
        Corrected {
            sigma_y_scale: known(15.2, 1.0),
            ..usual
        },
        None,
    );
    assert_eq!(keys(&evidence), ["plume.sigma_y_scale"]);
    // A tenth of the stated emission, and the background beside it.
    evidence.correct(usual, None);
    evidence.name([("emission-scale", 0.1), ("background-offset", 440.0)].into_iter());
    assert_eq!(
        keys(&evidence),
        ["background.co2_ppm", "source.emission_kg_s"]
    );
}

#[test]
fn a_plume_that_is_read_elsewhere_contradicts_place_and_height_of_its_source() {
    let mut evidence = evidence("449");
    read_at(&mut evidence, Some((8.0, 252.0)), 72.0, 540.0);
    assert_eq!(keys(&evidence), Vec::<String>::new());
    // The nearest place upwind of where the plume is read lies 1.8 km north and 0.6 km west of the stated one.
    let mut aside = slipped("449", "", "");
    read_at(&mut aside, Some((8.0, 252.0)), 0.0, 540.0);
    assert_eq!(keys(&aside), ["source.lat_deg"]);
    // 486 m in feet.
    let mut feet = slipped("449", "effective_height_m=486", "effective_height_m=1594");
    read_at(&mut feet, Some((8.0, 252.0)), 72.0, 540.0);
    assert_eq!(keys(&feet), ["source.effective_height_m"]);
}

#[test]
fn an_emission_that_passes_weigh_otherwise_is_contradicted_whatever_the_fit_makes_of_it() {
    let known = |value, sd| Known { value, sd };
    // In g/s.
    let mut evidence = slipped("449", "emission_kg_s=300", "emission_kg_s=300000");
    let fit = Corrected {
        background_ppm: known(449.0, 0.3),
        effective_height_agl_m: known(486.0, 12.0),
        axis_deg: known(60.0, 1.0),
        strength: known(1.0, 0.4),
        sigma_y_scale: known(1.0, 0.1),
        sigma_z_scale: known(1.0, 0.1),
    };
    evidence.correct(fit, Some((280.0, 60.0)));
    let found = evidence.contradictions();
    assert_eq!(found[0].key, "source.emission_kg_s");
    assert!((found[0].posterior.value - 280.0).abs() < 1.0, "{found:?}");
}

#[test]
fn a_noise_that_readings_do_not_have_is_contradicted() {
    for (stated, expected) in [("3", 0), ("300", 1)] {
        let noise = format!("[sensor]\nnoise_sd_ppm={stated}\n[background]");
        let mut evidence = slipped("449", "[background]", &noise);
        read(&mut evidence, None);
        let found = keys(&evidence);
        assert_eq!(found.len(), expected, "{found:?}");
        assert!(found.iter().all(|key| key == "sensor.noise_sd_ppm"));
    }
}
