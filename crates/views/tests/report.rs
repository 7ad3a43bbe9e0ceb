//! The mission report as a reader gets it.

/// The descriptions of a page's figures.
fn figures(page: &str) -> Vec<serde_json::Value> {
    let from = "<script type=\"application/json\" id=\"figures\">";
    let text = page.split(from).nth(1).unwrap();
    serde_json::from_str(text.split("</script>").next().unwrap()).unwrap()
}

#[test]
fn it_is_one_page_that_needs_no_network() {
    let (page, summary) = crate::made_up::report(6000);
    assert!(page.starts_with("<!doctype html>"));
    let own = page.split("<script").next().unwrap();
    assert!(!own.contains("src=") && !own.contains("href=") && !own.contains("@import"));
    for heading in [
        "The mission",
        "Where they flew",
        "Correction of the model",
        "Readings and predictions",
        "The peak",
        "Vertical section",
        "Passes through the plume",
        "Limits of this result",
        "How to repeat this",
    ] {
        assert!(own.contains(heading), "{heading}");
    }
    assert!(own.contains(&summary.digest));
    assert_eq!(own.matches("class=\"plot\"").count(), 4);
    assert_eq!(figures(&page).len(), 4);
    assert!(!page.lines().any(|line| line.starts_with("import ")));
    assert!(!page.contains("NaN ppm") && !own.contains(">NaN"));
}

#[test]
fn a_report_names_what_made_it_and_begins_with_three_sentences() {
    let document = views::gap_report::verdict("flight", "made up", &crate::made_up::gap::json());
    let page = document.html(&views::Origin {
        version: "1.2.3".to_owned(),
        made: "2026-11-29T10:00:00Z".to_owned(),
        command: "plumage gap plume <log>".to_owned(),
        inputs: vec![("log.csv".to_owned(), "ab12".to_owned())],
    });
    let origin = "Plumage 1.2.3, made 2026-11-29T10:00:00Z, by plumage gap plume &lt;log&gt;<br>log.csv: SHA-256 ab12";
    assert!(page.contains(origin), "{page}");
    let lead = page.split("<section class=\"lead\">").nth(1).unwrap();
    let lead = lead.split("</section>").next().unwrap();
    assert_eq!(lead.matches("<p").count(), 3);
}

#[test]
fn a_mission_that_did_nothing_still_has_a_report() {
    let (page, _) = crate::made_up::report(0);
    assert!(page.contains("there is no peak") && page.contains("No real vehicle flew"));
}

#[test]
fn a_gap_report_shows_names_extends_gains_and_says_what_remains() {
    let page = views::gap_report::plume(
        "made up",
        &crate::made_up::gap::json(),
        &crate::made_up::gap::report(),
    )
    .html(&views::Origin::default());
    let own = page.split("<script").next().unwrap();
    for words in [
        "Where the simulation deviates from the data",
        "Causes",
        "The extended model",
        "Gain",
        "Remaining deviation",
        "A flight that would decide",
        "sensor-lag.time_constant_s",
        "stands still at &lt;449&gt; ppm",
        "gain 31.0 to 66.0",
    ] {
        assert!(own.contains(words), "{words}");
    }
    let figures = figures(&page);
    assert_eq!(figures.len(), own.matches("class=\"plot\"").count());
    // A reading that is missing is a hole in the line, not a zero.
    let read = &figures[0]["panels"][0]["layers"][0];
    assert!(read["name"] == "read" && read["y"][100].is_null() && read["y"][99].is_number());
}

#[test]
fn a_verdict_alone_has_a_report_too() {
    let page = views::gap_report::verdict("flight", "made up", &crate::made_up::gap::json());
    let page = page.html(&views::Origin::default());
    assert!(page.contains("Causes") && page.contains("made up"));
}

#[test]
fn means_of_visits_and_estimated_aircraft_have_reports() {
    use study::combine::{SourceMean, Visit, site_mean};
    let visit = |value: f64| Visit {
        kg_s: study::Interval::of_mean(value, 0.1 * value),
        budget: Vec::new(),
    };
    let combined = |rates: &[f64]| {
        let visits: Vec<Visit> = rates.iter().map(|rate| visit(*rate)).collect();
        let names = (1..).map(|k| format!("visit {k}"));
        let source = SourceMean {
            name: "vent".to_owned(),
            gas: plume::Gas::Ch4,
            mean: site_mean(&visits).unwrap(),
            visits: names.zip(visits).collect(),
            notes: vec!["a note".to_owned()],
        };
        let page = views::flux_report::combined(&[source]).html(&views::Origin::default());
        page.split("<script").next().unwrap().to_owned()
    };
    let alike = combined(&[1e-3, 1.1e-3]);
    for words in ["vent emits 1.0", "The visits agree", "visit 2", "a note"] {
        assert!(alike.contains(words), "{words}");
    }
    assert!(combined(&[1e-3, 3e-3]).contains("differ by more than their intervals"));

    let aircraft = include_str!("../../../aircraft/x8.toml");
    let estimate = gap::flight::estimate::Estimate {
        schema: gap::flight::estimate::SCHEMA,
        summary: String::new(),
        coefficients: vec![gap::flight::estimate::Coefficient {
            name: "lift.alpha".to_owned(),
            unit: "1",
            start: 4.02,
            prior_sd: 1.0,
            value: 4.318,
            sd: 0.0417,
            told: true,
        }],
        widened: 1.3,
        motion: Vec::new(),
        data_quality: Vec::new(),
        notices: vec!["held".to_owned()],
        aircraft: fdm::Aircraft::from_toml("x8.toml", aircraft).unwrap(),
    };
    let page = views::gap_report::estimate("flight.csv", &estimate).html(&views::Origin::default());
    for words in [
        "determine 1 of 1 coefficients",
        "lift.alpha",
        "4.318",
        "0.042",
        "held",
    ] {
        assert!(page.contains(words), "{words}");
    }
}
