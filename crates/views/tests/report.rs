//! The mission report as a reader gets it.
#![allow(clippy::unwrap_used)]

mod made_up;

#[test]
fn it_is_one_page_that_needs_no_network() {
    let (page, summary) = made_up::report(6000);
    assert!(page.starts_with("<!doctype html>"));
    let own = page.split("plotly.js v3").next().unwrap();
    assert!(!own.contains("src=") && !own.contains("href=") && !own.contains("@import"));
    for heading in [
        "The mission",
        "Where they flew",
        "What the model learned",
        "What was read and what was expected",
        "The peak",
        "What remains",
        "To repeat this",
    ] {
        assert!(own.contains(heading), "{heading}");
    }
    assert!(own.contains(&summary.digest));
    assert_eq!(own.matches("class=\"plot\"").count(), 3);
    let data = page.split("const PLOTS = ").nth(1).unwrap();
    let data = data.split(";\n").next().unwrap();
    let plots: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(plots.as_array().unwrap().len(), 3);
    assert!(!page.contains("NaN ppm") && !own.contains(">NaN"));
}

#[test]
fn a_mission_that_did_nothing_still_has_a_report() {
    let (page, _) = made_up::report(0);
    assert!(page.contains("no peak") && page.contains("No real vehicle flew"));
}
