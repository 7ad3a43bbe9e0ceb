//! The figures of a mission report.

use super::Expected;
use crate::figure::{
    Axis, BASE, Band, ColourScale, Column, Dash, Detail, Field, FieldGrid, Figure, INK, Layer,
    Line, MEASURED, MODEL, OUTLINE, Panel, Points, Symbol, Text, Wind,
};
use crate::site::{Area, Grid, MapPoint, SiteMap};
use air::geo::{Enu, wrap_deg, wrap_signed_deg};
use protocol::message::{Model, VehicleKind};
use record::colour::{Shown, stops};
use record::summary::{CORRECTED, MissionSummary, ModelNumber, ModelNumbers};
use record::tracks::{TrackPoint, Tracks, VehicleTrack};

/// Columns of the grid of a contour.
const COLUMNS: usize = 110;
/// Greatest height of the map, pixels.
const MAP_HEIGHT: u32 = 620;
/// Steps of a place on the map in a kilometre: a tenth of a metre.
const PER_KM: f64 = 1e4;

fn km(values_m: impl IntoIterator<Item = f64>) -> Column {
    Column::new(values_m.into_iter().map(|m| m / 1000.0), PER_KM)
}

fn places(at: &[Enu]) -> (Column, Column) {
    (
        km(at.iter().map(|p| p.east_m)),
        km(at.iter().map(|p| p.north_m)),
    )
}

/// The map of tracks with the plume of the model and of reality.
pub(super) fn map(
    site: &SiteMap,
    tracks: &Tracks,
    after: Option<&Model>,
    summary: &MissionSummary,
    shown: &Shown,
) -> Figure {
    let area = site.area(tracks).widened(400.0);
    let mut layers = Vec::new();
    if let Some(model) = after {
        layers.extend(plumes(site, model, area));
        layers.push(axis(site, model, area));
    }
    layers.extend(surroundings(site));
    layers.extend(track_layers(site, tracks));
    let found = summary.peak.estimate.as_ref();
    let found = found.map(|p| (site.enu(p.lat_deg, p.lon_deg), p.co2_ppm));
    layers.extend(found.map(|p| peak(site, p, "peak found", Symbol::Ring, MEASURED)));
    let truth = summary.peak.truth.as_ref();
    let truth = truth.map(|p| (site.enu(p.lat_deg, p.lon_deg), p.co2_ppm));
    layers.extend(truth.map(|p| peak(site, p, "true peak", Symbol::Cross, INK)));
    layers.push(names(site, tracks));
    let range = |low_m: f64, high_m: f64| Some([low_m / 1000.0, high_m / 1000.0]);
    let panel = Panel {
        height: Some(MAP_HEIGHT),
        equal: true,
        wind: after.map(wind),
        x: Axis {
            range: range(area.low.east_m, area.high.east_m),
            ..Axis::new("east", "km")
        },
        y: Axis {
            range: range(area.low.north_m, area.high.north_m),
            ..Axis::new("north", "km")
        },
        layers,
        ..Panel::default()
    };
    Figure {
        columns: 1,
        panels: vec![panel],
        scale: Some(readings_scale(shown)),
    }
}

fn peak(
    site: &SiteMap,
    (at, ppm): (Enu, f64),
    name: &str,
    symbol: Symbol,
    colour: &'static str,
) -> Layer {
    let (x, y) = places(&[at]);
    Layer::Points(Points {
        name: name.to_owned(),
        colour: Some(colour),
        symbol,
        size: 15.0,
        x,
        y,
        details: vec![reading(&site.shown, [ppm])],
        ..Points::default()
    })
}

/// Mole fractions for a reader who points at a place.
fn reading(shown: &Shown, ppm: impl IntoIterator<Item = f64>) -> Detail {
    Detail {
        name: shown.gas.formula().to_owned(),
        unit: "ppm".to_owned(),
        values: Some(Column::new(ppm, 10.0 * shown.steps_per_ppm())),
        texts: None,
    }
}

/// The colours of readings: those below its foot and above its head have the colours of these.
fn readings_scale(shown: &Shown) -> ColourScale {
    let (low, high) = (shown.grey_ppm, shown.red_ppm);
    let signs = ["≤ ", "", "", "≥ "];
    let tick = |(i, sign): (usize, &str)| {
        let ppm = low + i as f64 / 3.0 * (high - low);
        (ppm, format!("{sign}{}", shown.number(ppm)))
    };
    ColourScale {
        title: shown.axis(),
        low,
        high,
        colours: stops(),
        ticks: signs.into_iter().enumerate().map(tick).collect(),
        both: false,
    }
}

/// Readings that are drawn in a section lie within this part of their distance from the source beside its plane: about two
/// widths of the plume on either side.
pub(super) const ASIDE: f64 = 0.15;
/// Rows of the grid of a section: near the source a plume is not as thick as a column is wide.
const SECTION_ROWS: usize = 160;
/// Height of a section, pixels.
const SECTION_HEIGHT: u32 = 260;
/// Height above the highest track up to which a section goes, m.
const ABOVE_TRACKS_M: f64 = 50.0;

/// The plume of the model in the vertical plane of its axis through the first source.
pub(super) fn section(site: &SiteMap, tracks: &Tracks, model: &Model, shown: &Shown) -> Figure {
    let source = site.stacks.first();
    let from = source.map_or(Enu::default(), |s| site.enu(s.lat_deg, s.lon_deg));
    let (sin, cos) = model.axis_deg.value.to_radians().sin_cos();
    let real = tracks
        .by_vehicle()
        .values()
        .filter(|t| t.kind == VehicleKind::Real);
    // Distance along the axis, distance beside it and height above ground, m, and what was read.
    let read = real.flat_map(|t| t.points.items()).map(|p| {
        let at = site.enu(p.lat_deg, p.lon_deg);
        let (east_m, north_m) = (at.east_m - from.east_m, at.north_m - from.north_m);
        let aside_m = east_m * cos - north_m * sin;
        (
            east_m * sin + north_m * cos,
            aside_m,
            p.alt_amsl_m - site.frame.ground_amsl_m,
            p.co2_ppm,
        )
    });
    let near: Vec<(f64, f64, f64, f64)> = read
        .filter(|(along_m, aside_m, ..)| *along_m > 0.0 && aside_m.abs() <= ASIDE * along_m)
        .collect();
    let most = |of: fn(&(f64, f64, f64, f64)) -> f64, least: f64| {
        near.iter().map(of).fold(least, f64::max)
    };
    let far_m = most(|p| p.0, 2.0 * site.keep_out_radius_m.max(500.0));
    let top_m = most(|p| p.2, 1.5 * model.effective_height_agl_m.value) + ABOVE_TRACKS_M;
    let step_m = far_m / COLUMNS as f64;
    let up_m = top_m / SECTION_ROWS as f64;
    let points: Vec<MapPoint> = (0..=SECTION_ROWS)
        .flat_map(|row| {
            (0..=COLUMNS).map(move |column| MapPoint {
                at: from.displaced(model.axis_deg.value, step_m * column as f64),
                alt_amsl_m: site.frame.ground_amsl_m + up_m * row as f64,
            })
        })
        .collect();
    let excess = (site.field)(model, &points)
        .into_iter()
        .map(|p| p - model.background_ppm.value);
    let plume = Field {
        name: "model".to_owned(),
        grid: FieldGrid {
            x: 0.0,
            y: 0.0,
            step: step_m,
            up: Some(up_m),
            columns: COLUMNS + 1,
            rows: SECTION_ROWS + 1,
        },
        values: Column::new(excess, 10.0 * site.shown.steps_per_ppm()),
        darkest: Some(site.shown.darkest_ppm()),
        levels: levels(site).to_vec(),
        colour: MODEL,
        dash: Dash::Solid,
    };
    let steps = 10.0 * shown.steps_per_ppm();
    let readings = Points {
        name: "real readings".to_owned(),
        values: Some(Column::new(near.iter().map(|p| p.3), steps)),
        symbol: Symbol::Diamond,
        size: 2.6,
        grow: 3.2,
        x: Column::new(near.iter().map(|p| p.0), 1.0),
        y: Column::new(near.iter().map(|p| p.2), 1.0),
        details: vec![reading(shown, near.iter().map(|p| p.3))],
        ..Points::default()
    };
    let range = |high: f64| Some([0.0, high]);
    let panel = Panel {
        height: Some(SECTION_HEIGHT),
        x: Axis {
            range: range(far_m),
            ..Axis::new("distance along the axis", "m")
        },
        y: Axis {
            range: range(top_m),
            ..Axis::new("height above ground", "m")
        },
        layers: vec![Layer::Field(plume), Layer::Points(readings)],
        ..Panel::default()
    };
    Figure {
        columns: 1,
        panels: vec![panel],
        scale: Some(readings_scale(shown)),
    }
}

/// Contour lines with their names, ppm above background.
fn levels(site: &SiteMap) -> [(f64, String); 3] {
    site.shown
        .levels_ppm()
        .map(|l| (l, format!("+{}", site.shown.number(l))))
}

/// The model's axis from the first source to beyond the map.
fn axis(site: &SiteMap, model: &Model, area: Area) -> Layer {
    let source = site.stacks.first();
    let from = source.map_or(Enu::default(), |s| site.enu(s.lat_deg, s.lon_deg));
    let far = from.displaced(model.axis_deg.value, area.low.distance_m(area.high));
    let (x, y) = places(&[from, far]);
    Layer::Line(Line {
        name: "the model's axis".to_owned(),
        colour: MODEL,
        width: 1.2,
        dash: Dash::Mixed,
        silent: true,
        x,
        y,
        ..Line::default()
    })
}

fn wind(model: &Model) -> Wind {
    let from_deg = wrap_deg(model.axis_deg.value + 180.0);
    Wind {
        text: format!("wind {:.1} m/s from {from_deg:.0}°", model.wind_speed_m_s),
        towards_deg: model.axis_deg.value,
    }
}

/// The plume of the model as shade and lines, and that of reality as lines.
fn plumes(site: &SiteMap, model: &Model, area: Area) -> Vec<Layer> {
    let alt = site.axis_amsl_m(model);
    let of_model = Grid::fill(area, COLUMNS, alt, |s| (site.field)(model, s));
    let of_reality = site
        .reality
        .as_ref()
        .map(|reality| Grid::fill(area, COLUMNS, alt, |s| reality(s)));
    let field = |grid: Grid, name: &str, colour, dash, darkest| {
        let excess = grid.ppm.iter().map(|p| p - model.background_ppm.value);
        Layer::Field(Field {
            name: name.to_owned(),
            grid: FieldGrid {
                x: grid.east_m[0] / 1000.0,
                y: grid.north_m[0] / 1000.0,
                step: (grid.east_m[1] - grid.east_m[0]) / 1000.0,
                up: None,
                columns: grid.east_m.len(),
                rows: grid.north_m.len(),
            },
            values: Column::new(excess, 10.0 * site.shown.steps_per_ppm()),
            darkest,
            levels: levels(site).to_vec(),
            colour,
            dash,
        })
    };
    let darkest = Some(site.shown.darkest_ppm());
    let mut layers = vec![field(of_model, "model", MODEL, Dash::Solid, darkest)];
    layers.extend(of_reality.map(|grid| field(grid, "reality", INK, Dash::Dashed, None)));
    layers
}

/// Simulated vehicles below, real ones above.
fn track_layers(site: &SiteMap, tracks: &Tracks) -> Vec<Layer> {
    let kinds = [
        (
            VehicleKind::Simulated,
            "simulated vehicles",
            Symbol::Dot,
            1.8,
        ),
        (VehicleKind::Real, "real vehicles", Symbol::Diamond, 2.6),
    ];
    let layer = |(kind, name, symbol, size): (VehicleKind, &str, Symbol, f64)| {
        let of_kind = |(_, track): &(&String, &VehicleTrack)| track.kind == kind;
        let flown: Vec<(&String, &TrackPoint)> = tracks
            .by_vehicle()
            .iter()
            .filter(of_kind)
            .flat_map(|(id, track)| track.points.items().iter().map(move |p| (id, p)))
            .collect();
        let at: Vec<Enu> = flown
            .iter()
            .map(|(_, p)| site.enu(p.lat_deg, p.lon_deg))
            .collect();
        let (x, y) = places(&at);
        let number = |name: &str, unit: &str, of: fn(&TrackPoint) -> f64| Detail {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values: Some(Column::new(flown.iter().map(|(_, p)| of(p)), 1.0)),
            texts: None,
        };
        let vehicle = Detail {
            name: "vehicle".to_owned(),
            texts: Some(flown.iter().map(|(id, _)| (*id).clone()).collect()),
            ..Detail::default()
        };
        let ppm = || flown.iter().map(|(_, p)| p.co2_ppm);
        Layer::Points(Points {
            name: name.to_owned(),
            values: Some(Column::new(ppm(), 10.0 * site.shown.steps_per_ppm())),
            symbol,
            // Clean air must not hide the plume.
            size,
            grow: 3.2,
            x,
            y,
            details: vec![
                vehicle,
                reading(&site.shown, ppm()),
                number("time", "s", |p| p.time_s),
                number("height", "m AMSL", |p| p.alt_amsl_m),
            ],
            ..Points::default()
        })
    };
    let is_flown = |layer: &Layer| !matches!(layer, Layer::Points(points) if points.x.is_empty());
    kinds.into_iter().map(layer).filter(is_flown).collect()
}

/// Most vehicles of which each has its own name on the map: more names than these cover the plume.
const NAMED_VEHICLES: usize = 12;

/// The stacks' names and those of the vehicles, each where it was farthest from its first place: at home they all stand
/// together.
fn names(site: &SiteMap, tracks: &Tracks) -> Layer {
    let stacks = site.stacks.iter();
    let stacks = stacks.map(|s| (site.enu(s.lat_deg, s.lon_deg), s.name.clone()));
    let all = tracks.by_vehicle().len() <= NAMED_VEHICLES;
    let farthest = |(id, track): (&String, &VehicleTrack)| {
        if !all && track.kind == VehicleKind::Simulated {
            return None;
        }
        let flown = track.points.items().iter();
        let places = flown.map(|p| site.enu(p.lat_deg, p.lon_deg));
        let home = places.clone().next()?;
        let at = places.max_by(|a, b| home.distance_m(*a).total_cmp(&home.distance_m(*b)))?;
        Some((at, id.clone()))
    };
    let vehicles = tracks.by_vehicle().iter().filter_map(farthest);
    let (at, texts): (Vec<Enu>, Vec<String>) = stacks.chain(vehicles).unzip();
    let (x, y) = places(&at);
    Layer::Text(Text { x, y, texts })
}

fn surroundings(site: &SiteMap) -> Vec<Layer> {
    let mut layers = Vec::new();
    let mut stacks = Vec::new();
    for stack in &site.stacks {
        let at = site.enu(stack.lat_deg, stack.lon_deg);
        let circle: Vec<Enu> = (0..=72)
            .map(|i| at.displaced(5.0 * f64::from(i), site.keep_out_radius_m))
            .collect();
        layers.push(outline(&circle, "keep-out cylinder", Dash::Dotted));
        stacks.push(at);
    }
    let (x, y) = places(&stacks);
    layers.push(Layer::Points(Points {
        colour: Some(INK),
        symbol: Symbol::Square,
        size: 8.0,
        silent: true,
        x,
        y,
        ..Points::default()
    }));
    if site.fence.len() > 2 {
        let corners = site.fence.iter().chain(site.fence.first());
        let fence: Vec<Enu> = corners.map(|&(lat, lon)| site.enu(lat, lon)).collect();
        layers.push(outline(&fence, "fence", Dash::Dashed));
    }
    layers
}

fn outline(points: &[Enu], name: &str, dash: Dash) -> Layer {
    let (x, y) = places(points);
    Layer::Line(Line {
        name: name.to_owned(),
        colour: OUTLINE,
        width: 1.3,
        dash,
        silent: true,
        x,
        y,
        ..Line::default()
    })
}

/// Minutes of mission time.
fn minutes<'a>(time_s: impl IntoIterator<Item = &'a f64>) -> Column {
    Column::new(time_s.into_iter().map(|t| t / 60.0), 1e3)
}

/// The axis of a number goes beyond what it is before and after the mission by this part of the way between.
const BESIDE_ENDS: f64 = 0.5;

/// The model's numbers along the mission, a panel each.
pub(super) fn history(
    history: &[(f64, Box<Model>)],
    reality: Option<&ModelNumbers>,
    shown: &Shown,
) -> Figure {
    let time = minutes(history.iter().map(|(t, _)| t));
    let numbers: Vec<ModelNumbers> = history.iter().map(|(_, m)| m.as_ref().into()).collect();
    let panel = |n: &ModelNumber| number_panel(n, &time, &numbers, reality, shown);
    Figure {
        columns: 3,
        panels: CORRECTED.iter().map(panel).collect(),
        scale: None,
    }
}

/// One number of the model along the mission, with a band of two standard deviations.
fn number_panel(
    n: &ModelNumber,
    time: &Column,
    numbers: &[ModelNumbers],
    reality: Option<&ModelNumbers>,
    shown: &Shown,
) -> Panel {
    let steps = 1e3 * shown.steps_per_ppm();
    // An angle is drawn around the last one, so that north is no cliff.
    let last = numbers.last().map_or(0.0, |m| (n.of)(m).value);
    let turned = |v: f64| match n.turns() {
        true => last + wrap_signed_deg(v - last),
        false => v,
    };
    let line = |sds: f64| {
        let value = |m: &ModelNumbers| turned((n.of)(m).value) + sds * (n.of)(m).sd;
        Column::new(numbers.iter().map(value), steps)
    };
    let mut layers = vec![
        Layer::Band(Band {
            colour: MODEL,
            x: time.clone(),
            low: line(-2.0),
            high: line(2.0),
        }),
        Layer::Line(Line {
            name: "model".to_owned(),
            colour: MODEL,
            width: 2.0,
            x: time.clone(),
            y: line(0.0),
            ..Line::default()
        }),
    ];
    // What a fit of the first minutes says must not hide how the mission ends.
    let ends = numbers.first().into_iter().chain(numbers.last());
    let ends =
        ends.flat_map(|m| [-2.0, 2.0].map(|sds| turned((n.of)(m).value) + sds * (n.of)(m).sd));
    let ends = ends.chain(reality.map(|m| turned((n.of)(m).value)));
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    let part = BESIDE_ENDS * (high - low);
    if let Some(reality) = reality {
        let truth = turned((n.of)(reality).value);
        layers.push(Layer::Line(Line {
            name: "reality".to_owned(),
            colour: INK,
            width: 1.5,
            dash: Dash::Dashed,
            x: time.clone(),
            y: Column::new(vec![truth; numbers.len()], steps),
            ..Line::default()
        }));
    }
    Panel {
        title: n.name.to_owned(),
        height: Some(150),
        linked: Some("time"),
        x: Axis::new("mission time", "min"),
        y: Axis {
            // None but an angle is below zero, whatever its standard deviation.
            floor: (!n.turns()).then_some(0.0),
            limits: Some([low - part, high + part]),
            ..Axis::new("", &n.unit_of(shown.gas))
        },
        layers,
        ..Panel::default()
    }
}

/// Readings of real vehicles with predictions, and the difference: two panels a vehicle.
pub(super) fn readings(expected: &[Expected<'_>], shown: &Shown) -> Figure {
    let panels = expected.iter().flat_map(|e| vehicle_panels(e, shown));
    Figure {
        columns: 1,
        panels: panels.collect(),
        scale: None,
    }
}

fn vehicle_panels(e: &Expected<'_>, shown: &Shown) -> [Panel; 2] {
    let steps = 10.0 * shown.steps_per_ppm();
    let time = minutes(&e.time_s);
    let line = |name: &str, values: Column, colour: &'static str, width: f64| {
        Layer::Line(Line {
            name: name.to_owned(),
            colour,
            width,
            x: time.clone(),
            y: values,
            ..Line::default()
        })
    };
    let ppm = |of: &[f64]| Column::new(of.iter().copied(), steps);
    let rest = |of: &[f64]| Column::new(e.read_ppm.iter().zip(of).map(|(r, x)| r - x), steps);
    let above = vec![
        line("read", ppm(&e.read_ppm), MEASURED, 1.4),
        line("predicted before", ppm(&e.before_ppm), BASE, 1.4),
        line("predicted after", ppm(&e.after_ppm), MODEL, 1.6),
    ];
    let below = vec![
        line("predicted before", rest(&e.before_ppm), BASE, 1.2),
        line("predicted after", rest(&e.after_ppm), MODEL, 1.4),
    ];
    let panel = |title: &str, height, x: Axis, y: Axis, layers| Panel {
        title: title.to_owned(),
        height: Some(height),
        linked: Some("time"),
        x,
        y,
        layers,
        ..Panel::default()
    };
    let time_axis = |hidden| Axis {
        hidden,
        ..Axis::new("mission time", "min")
    };
    let vehicle = format!("vehicle {}", e.id);
    let gas = Axis::new(shown.gas.formula(), "ppm");
    let difference = Axis::new("reading minus prediction", "ppm");
    [
        panel(&vehicle, 210, time_axis(true), gas, above),
        panel("", 120, time_axis(false), difference, below),
    ]
}
