//! Flight patterns of aircraft that can stop, laid out for a source and a wind: where each passes, in order.

use air::geo::Enu;
use csea::Position;
use plume::DispersionSpec;
use scenario::Scenario;
use scenario::airspace::Airspace;
use scenario::pattern::Pattern;
use scenario::uncertain::Uncertain;

use crate::error::ScError;
use crate::plume_estimate::PlumeEstimate;
use crate::route_graph::RouteGraph;

/// Distance that patterns keep from fence and keep-outs, m: some times the error with which a multirotor follows its path in
/// gusts.
pub const PATTERN_MARGIN_M: f64 = 10.0;
/// Half width of a transect beyond the plume, in σy: out to 1 % of the axis.
const PLUME_SIGMAS: f64 = 3.0;
/// Standard deviations of the axis that a transect reaches beyond that.
const AXIS_SDS: f64 = 2.0;
/// Shortest half width of a transect, m.
const LEAST_HALF_WIDTH_M: f64 = 40.0;
/// Height of the top of a pattern above the plume's axis, in σz.
const TOP_SIGMAS: f64 = 3.0;
/// Step between the heights of a curtain and of a profile, in σz, and its range, m. The sum of a normal distribution over
/// steps of 2 σ is its integral to 2 %, and the mass balance joins passes that are less than 15 m apart in height.
const STEP_SIGMAS: f64 = 1.2;
const STEP_M: (f64, f64) = (16.0, 40.0);
/// Most heights of a curtain: more take longer than the wind stays the same.
const MOST_HEIGHTS: usize = 12;
/// Distance of a curtain, and of a profile, in heights of the plume: there it has its shape, and is not yet wide.
const DISTANCE_OF_HEIGHT: f64 = 4.0;
/// Points of one turn of a spiral, and its rise, m.
const SPIRAL_POINTS: usize = 24;
const SPIRAL_RISE_M: f64 = 10.0;
/// Smallest radius of a spiral, m.
const SPIRAL_RADIUS_M: f64 = 25.0;
/// Distances of the transects over that of the curtain.
const TRANSECT_DISTANCES: [f64; 4] = [0.6, 1.0, 1.6, 2.4];
/// Steps by which a transect is shortened to fit the airspace, m.
const SHORTEN_M: f64 = 5.0;

/// The way to a place: level at the height of the higher end, around what stands in the way, then up or down.
pub fn way_to(
    airspace: &Airspace,
    routes: &RouteGraph,
    here: Position,
    to: Position,
) -> Vec<Position> {
    let corners = routes
        .route(airspace, here.at, to.at)
        .unwrap_or_else(|| vec![to.at]);
    let height_m = airspace.clamp_height_m(here.height_m.max(to.height_m));
    let level = corners.into_iter().map(|at| Position { at, height_m });
    level.chain([to]).collect()
}

/// A flight for one aircraft: from above its home along `patterns` and back above home.
///
/// # Errors
/// [`ScError`] for a scenario that describes no world.
pub fn whole_flight(
    scenario: &Scenario,
    home: Position,
    patterns: &[Pattern],
) -> Result<Vec<(Waypoint, &'static str)>, ScError> {
    let airspace = Airspace::of(scenario)?;
    let base = scenario.dispersion_spec()?;
    let mut site = PatternSite::of(&base, &airspace);
    if let Some(sd_deg) = scenario.prior_sd(Uncertain::WindFrom) {
        site.estimate.axis_sd_deg = sd_deg;
    }
    let routes = RouteGraph::of(&airspace, PATTERN_MARGIN_M);
    let mut here = home;
    let mut flight = Vec::new();
    for &pattern in patterns {
        let places = site.waypoints(pattern, 0, 0.0);
        let (Some(first), Some(last)) = (places.first(), places.last()) else {
            continue;
        };
        let mut way = way_to(&airspace, &routes, here, first.position);
        way.pop();
        flight.extend(
            way.into_iter()
                .map(|position| (Waypoint::stop(position), TRANSIT)),
        );
        here = last.position;
        flight.extend(places.into_iter().map(|place| (place, pattern.name())));
    }
    if !flight.is_empty() {
        let way = way_to(&airspace, &routes, here, home);
        flight.extend(
            way.into_iter()
                .map(|position| (Waypoint::stop(position), TRANSIT)),
        );
    }
    Ok(flight)
}

/// Purpose of a place between patterns.
const TRANSIT: &str = "transit";

/// A place of a pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Where; height above mean sea level.
    pub position: Position,
    /// Whether the vehicle stops there before it goes on.
    pub stops: bool,
}

impl Waypoint {
    /// A place at which the vehicle stops.
    pub fn stop(position: Position) -> Self {
        Self {
            position,
            stops: true,
        }
    }
}

/// What a pattern is laid out for.
#[derive(Debug, Clone, Copy)]
pub struct PatternSite<'a> {
    /// Where the plume is supposed to be.
    pub estimate: PlumeEstimate,
    /// The plume's model.
    pub base: &'a DispersionSpec,
    /// Where vehicles may fly.
    pub airspace: &'a Airspace,
}

impl<'a> PatternSite<'a> {
    /// The site as the scenario supposes it before any reading.
    pub fn of(base: &'a DispersionSpec, airspace: &'a Airspace) -> Self {
        Self {
            estimate: PlumeEstimate::of_base(base),
            base,
            airspace,
        }
    }

    /// The places of a pattern, in the order in which they are flown; a `lane` above 0 lies farther out, by `lane_m` each, so that
    /// several vehicles fly it at once. Empty where the airspace leaves no room for it.
    pub fn waypoints(&self, pattern: Pattern, lane: usize, lane_m: f64) -> Vec<Waypoint> {
        let out_m = lane as f64 * lane_m;
        match pattern {
            Pattern::Curtain => self.curtain(self.distance_m() + out_m),
            Pattern::Profile => self.profile(self.distance_m() + out_m),
            Pattern::Spiral => self.spiral(out_m),
            Pattern::Transects => TRANSECT_DISTANCES
                .into_iter()
                .enumerate()
                .flat_map(|(k, part)| {
                    let distance_m = (part * self.distance_m()).max(self.nearest_m()) + out_m;
                    self.transect(distance_m, self.estimate.height_amsl_m, k)
                })
                .collect(),
        }
    }

    /// The distance of a curtain and of a profile, m.
    pub fn distance_m(&self) -> f64 {
        let height_m = self.estimate.height_amsl_m - self.base.ground_amsl_m;
        self.nearest_m().max(DISTANCE_OF_HEIGHT * height_m)
    }

    fn nearest_m(&self) -> f64 {
        self.airspace.keep_out_m() + 2.0 * PATTERN_MARGIN_M
    }

    /// Heights from the floor to above the plume at a distance, m above mean sea level.
    fn heights_amsl_m(&self, distance_m: f64) -> Vec<f64> {
        let (floor_m, ceiling_m) = self.airspace.height_band_amsl_m();
        let sigma_z_m = self.estimate.sigmas_m(self.base, distance_m).1;
        let top_m = (self.estimate.height_amsl_m + TOP_SIGMAS * sigma_z_m).min(ceiling_m);
        let wanted_m = (STEP_SIGMAS * sigma_z_m).clamp(STEP_M.0, STEP_M.1);
        let span_m = (top_m - floor_m).max(0.0);
        let steps = ((span_m / wanted_m).floor() as usize).clamp(1, MOST_HEIGHTS - 1);
        (0..=steps)
            .map(|k| floor_m + span_m * k as f64 / steps as f64)
            .collect()
    }

    fn curtain(&self, distance_m: f64) -> Vec<Waypoint> {
        let heights = self.heights_amsl_m(distance_m);
        let transects = heights.into_iter().enumerate();
        transects
            .flat_map(|(k, height_m)| self.transect(distance_m, height_m, k))
            .collect()
    }

    /// A transect from the left, or with an odd number from the right.
    fn transect(&self, distance_m: f64, height_amsl_m: f64, number: usize) -> Vec<Waypoint> {
        let axis_sd_m = distance_m * self.estimate.axis_sd_deg.to_radians();
        let sigma_y_m = self.estimate.sigmas_m(self.base, distance_m).0;
        let half_m = (PLUME_SIGMAS * sigma_y_m + AXIS_SDS * axis_sd_m).max(LEAST_HALF_WIDTH_M);
        let end = |side: f64| {
            let mut out_m = half_m;
            while out_m > 0.0 {
                let at = self.estimate.place(distance_m, side * out_m);
                if self.airspace.clearance_m(at) >= PATTERN_MARGIN_M {
                    return Some(at);
                }
                out_m -= SHORTEN_M;
            }
            None
        };
        let (Some(left), Some(right)) = (end(-1.0), end(1.0)) else {
            return Vec::new();
        };
        if !self.airspace.leg_is_clear(left, right, PATTERN_MARGIN_M) {
            return Vec::new();
        }
        let ends = if number.is_multiple_of(2) {
            [left, right]
        } else {
            [right, left]
        };
        ends.map(|at| self.stop_at(at, height_amsl_m)).to_vec()
    }

    fn stop_at(&self, at: Enu, height_amsl_m: f64) -> Waypoint {
        Waypoint::stop(Position {
            at,
            height_m: self.airspace.clamp_at_m(at, height_amsl_m),
        })
    }

    fn profile(&self, distance_m: f64) -> Vec<Waypoint> {
        let at = self.estimate.place(distance_m, 0.0);
        if self.airspace.clearance_m(at) < PATTERN_MARGIN_M {
            return Vec::new();
        }
        let heights = self.heights_amsl_m(distance_m).into_iter();
        heights.map(|height_m| self.stop_at(at, height_m)).collect()
    }

    fn spiral(&self, out_m: f64) -> Vec<Waypoint> {
        let radius_m = (self.airspace.keep_out_m() + PATTERN_MARGIN_M).max(SPIRAL_RADIUS_M) + out_m;
        // Chords come nearer than their ends.
        let radius_m = radius_m / (std::f64::consts::PI / SPIRAL_POINTS as f64).cos();
        let heights = self.heights_amsl_m(radius_m);
        let (Some(&low_m), Some(&high_m)) = (heights.first(), heights.last()) else {
            return Vec::new();
        };
        let turns = ((high_m - low_m) / SPIRAL_RISE_M).ceil().max(1.0);
        let count = turns as usize * SPIRAL_POINTS;
        // It begins upwind, in clean air.
        let start_deg = self.estimate.axis_deg + 180.0;
        let place = |k: usize| {
            let share = k as f64 / count as f64;
            let bearing_deg = start_deg + 360.0 * turns * share;
            Waypoint {
                stops: k == 0 || k == count,
                ..self.stop_at(
                    self.estimate.source.displaced(bearing_deg, radius_m),
                    low_m + share * (high_m - low_m),
                )
            }
        };
        let all: Vec<Waypoint> = (0..=count).map(place).collect();
        let fits =
            |w: &Waypoint| self.airspace.clearance_m(w.position.at) >= PATTERN_MARGIN_M - 0.5;
        if all.iter().all(fits) {
            all
        } else {
            Vec::new()
        }
    }
}
