//! The made-up mission of crate `record`'s tests as a site and a filled report.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

pub mod gap;
#[path = "../../../record/tests/synthetic/mod.rs"]
pub mod synthetic;

use record::kml::StackMarker;
use record::summary::{
    MissionSummary, ModelNumbers, PlaceOfPeak, Summariser, SummaryContext, TruePeak,
};
use std::sync::Arc;
use views::site::SiteMap;

/// Those of the reference mission's first vehicle: its fence reaches 4 km north and 5 km east.
fn bounds() -> scenario::bounds::Bounds {
    let text = include_str!("../../../../scenarios/as-pontes-steady.toml");
    let scenario = scenario::Scenario::parse("as-pontes-steady.toml", text).unwrap();
    scenario::bounds::Bounds::of(&scenario, 0).unwrap()
}

pub fn site() -> Arc<SiteMap> {
    let frame = synthetic::frame();
    let origin = frame.origin();
    let corners = [
        (-1200.0, -3200.0),
        (3600.0, -3200.0),
        (3600.0, 1300.0),
        (-1200.0, 1300.0),
    ];
    Arc::new(SiteMap {
        mission: "as-pontes".to_owned(),
        shown: record::colour::Shown::CO2,
        conditions: vec![("wind".to_owned(), "7 m/s from 240°".to_owned())],
        duration_s: 600.0,
        frame,
        stacks: vec![StackMarker {
            name: "As Pontes".to_owned(),
            lat_deg: origin.lat_deg,
            lon_deg: origin.lon_deg,
            height_m: 356.0,
        }],
        fence: corners
            .map(|(east_m, north_m)| {
                let g = frame.to_geodetic(air::geo::Enu { east_m, north_m });
                (g.lat_deg, g.lon_deg)
            })
            .to_vec(),
        height_band_amsl_m: (400.0, 1200.0),
        bounds: vec![("1".to_owned(), bounds())],
        keep_out_radius_m: 1200.0,
        known_ground_amsl_m: Arc::new(move |_| Some(frame.ground_amsl_m)),
        has_terrain: false,
        field: Arc::new(|model, points| {
            let ppm = |s: &views::site::MapPoint| synthetic::field(model, s.at, s.alt_amsl_m);
            points.iter().map(ppm).collect()
        }),
        reality: Some(Arc::new(|points| {
            let reality = synthetic::model(118.0, 486.0, 410.0, 0);
            let ppm = |s: &views::site::MapPoint| synthetic::field(&reality, s.at, s.alt_amsl_m);
            points.iter().map(ppm).collect()
        })),
        true_peak: None,
    })
}

pub fn known() -> SummaryContext {
    let numbers =
        |axis, height, c_max| ModelNumbers::from(&synthetic::model(axis, height, c_max, 0));
    SummaryContext {
        source_deg: (43.4417, -7.8631),
        noise_ppm: 3.0,
        gas: record::colour::Shown::CO2.gas,
        scenario: synthetic::scenario(449.0),
        seed: 7,
        team: (1..=6).map(|k| k.to_string()).collect(),
        frame: synthetic::frame(),
        before: numbers(130.0, 450.0, 330.0),
        reality: Some(numbers(118.0, 486.0, 410.0)),
        true_peak: Some(TruePeak(Arc::new(|_| {
            Some(PlaceOfPeak {
                lat_deg: 43.4362,
                lon_deg: -7.8503,
                alt_amsl_m: 826.0,
                co2_ppm: 1025.0,
            })
        }))),
        true_flux: Vec::new(),
    }
}

/// Report and summary of the first `ticks` ticks.
pub fn report(ticks: u64) -> (String, MissionSummary) {
    let mut report = views::report::Report::new(site());
    let mut summariser = Summariser::new(known());
    for (topic, envelope) in synthetic::mission(ticks) {
        report.take(&topic, &envelope);
        summariser.take(&topic, &envelope);
    }
    let summary = summariser.summary("5f3c0000000000000000000000000000", 1.2);
    (
        report.page(&summary).html(&views::Origin::default()),
        summary,
    )
}
