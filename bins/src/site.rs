//! What stands on the map of a mission, for the page, the report and KML.

use anyhow::Result;
use mission::{Setup, truth};
use plume::{DispersionModel, Place};
use protocol::message::Model;
use record::colour::Shown;
use record::kml::{MapFeatures, StackMarker};
use scenario::Scenario;
use scenario::airspace::Airspace;
use scenario::bounds::Bounds;
use std::sync::Arc;
use views::site::{MapPoint, SiteMap};

fn place(site_ground_amsl_m: f64, point: &MapPoint) -> Place {
    Place {
        east_m: point.at.east_m,
        north_m: point.at.north_m,
        height_agl_m: point.alt_amsl_m - site_ground_amsl_m,
    }
}

fn fence(setup: &Setup) -> Result<Vec<(f64, f64)>> {
    let frame = setup.frame()?;
    let corners = setup.scenario.fence_polygon()?.into_iter().map(|c| {
        let at = frame.to_geodetic(c);
        (at.lat_deg, at.lon_deg)
    });
    Ok(corners.collect())
}

fn stacks(setup: &Setup) -> Vec<StackMarker> {
    setup
        .scenario
        .sources
        .iter()
        .map(|s| StackMarker {
            name: s.name.clone(),
            lat_deg: s.lat_deg,
            lon_deg: s.lon_deg,
            height_m: s.stack_height_m,
        })
        .collect()
}

/// Under what conditions a mission is flown, as far as the scenario says.
fn conditions(scenario: &Scenario) -> Vec<(String, String)> {
    let (site, weather) = (&scenario.site, &scenario.weather);
    let mut told = vec![
        (
            "place",
            format!(
                "{} (ground){}",
                record::text::place(site.lat_deg, site.lon_deg, site.ground_amsl_m),
                site.terrain
                    .as_ref()
                    .map_or(String::new(), |file| format!(", terrain of {file}")),
            ),
        ),
        (
            "wind, as in the scenario",
            format!(
                "{} m/s from {}° at {} m AGL",
                weather.wind_speed_m_s, weather.wind_from_deg, weather.wind_height_agl_m
            ),
        ),
        (
            "air",
            format!(
                "stability {:?}, {} °C at the ground",
                weather.stability, weather.temperature_c
            ),
        ),
    ];
    if let Some(start) = &scenario.mission.start {
        told.push(("start", start.clone()));
    }
    if let Some(series) = &weather.series {
        told.push(("weather over time", series.clone()));
    }
    let sources = scenario.sources.iter().map(|s| s.name.as_str());
    told.push(("sources", sources.collect::<Vec<_>>().join(", ")));
    told.push(("program", format!("Plumage {}", env!("CARGO_PKG_VERSION"))));
    let owned = told.into_iter().map(|(what, how)| (what.to_owned(), how));
    owned.collect()
}

/// Where each vehicle may be sent.
fn bounds(scenario: &Scenario) -> Result<Vec<(String, Bounds)>> {
    let team = scenario.vehicles.iter().enumerate();
    let each = team.map(|(k, vehicle)| Ok((vehicle.id.clone(), Bounds::of(scenario, k)?)));
    each.collect()
}

/// The site of a mission.
///
/// # Errors
/// A scenario that describes no world.
pub fn of(setup: &Setup) -> Result<SiteMap> {
    let scenario = &setup.scenario;
    let base = scenario.dispersion_spec()?;
    let ground = scenario.site.ground_amsl_m;
    let field = move |model: &Model, points: &[MapPoint]| -> Vec<f64> {
        let corrected: Option<DispersionModel> = ws::model::corrected(&base, model);
        let ppm = |point| {
            corrected
                .as_ref()
                .map_or(f64::NAN, |w| w.mean_ppm(&place(ground, point), 0.0))
        };
        points.iter().map(ppm).collect()
    };
    let has_reality = truth::has_stand_in(scenario);
    let reality = if has_reality {
        let model = scenario.in_reality().dispersion_model()?;
        let of = move |points: &[MapPoint]| -> Vec<f64> {
            points
                .iter()
                .map(|s| model.mean_ppm(&place(ground, s), 0.0))
                .collect()
        };
        Some(Arc::new(of) as views::site::RealityField)
    } else {
        None
    };
    let frame = setup.frame()?;
    let terrain = setup.terrain.clone();
    Ok(SiteMap {
        mission: scenario.mission.name.clone(),
        shown: Shown::of(scenario)?,
        conditions: conditions(scenario),
        duration_s: scenario.mission.duration_s,
        frame,
        stacks: stacks(setup),
        fence: fence(setup)?,
        height_band_amsl_m: Airspace::of(scenario)?
            .over(&setup.terrain)
            .height_band_amsl_m(),
        bounds: bounds(scenario)?,
        keep_out_radius_m: scenario.fence.keep_out_radius_m,
        known_ground_amsl_m: Arc::new(move |at| terrain.known_amsl_m(frame.to_geodetic(at))),
        has_terrain: scenario.site.terrain.is_some(),
        field: Arc::new(field),
        reality,
        true_peak: has_reality
            .then(|| truth::true_peak(setup))
            .transpose()?
            .and_then(|truth| truth.0(0.0)),
    })
}

/// What stands on the map of Google Earth beside the tracks.
///
/// # Errors
/// A scenario that describes no world.
pub fn surroundings(setup: &Setup) -> Result<MapFeatures> {
    let scenario = &setup.scenario;
    Ok(MapFeatures {
        mission: scenario.mission.name.clone(),
        shown: Shown::of(scenario)?,
        stacks: stacks(setup),
        fence: fence(setup)?,
        fence_top_amsl_m: scenario.fence_top_amsl_m(),
        peak: None,
    })
}
