//! Patterns that are flown whatever is read: lines that a team shares out.
//!
//! A lawnmower flies parallel legs across the wind over the whole box, as survey flights do; arcs lie about the source
//! across the wind, near ones first, as plumes of known sources are sampled from roads and aircraft.

use air::geo::{Enu, Position};
use rand::rngs::ChaCha8Rng;

use crate::archive::Archive;
use crate::belief::PlumePrior;
use crate::domain::Domain;
use crate::strategy::{PromisingPoint, Sampler, SearchStrategy};

/// Places along a line are this far apart, m.
const ALONG_M: f64 = 100.0;
/// A place is reached within this distance, m.
const REACHED_M: f64 = 80.0;
/// Legs of a lawnmower and arcs are this far apart, m: down the axis a plume changes over as much.
const APART_M: f64 = 300.0;
/// Heights are this many σz apart, so that a plume between two of them is met at 88 % of its axis.
const HEIGHTS_APART_SIGMAS: f64 = 1.0;
/// Arcs reach so many standard deviations of the direction to both sides.
const ARC_SD: f64 = 2.5;
/// Most lines of a pattern.
const MOST_LINES: usize = 2000;
/// Beginnings of lines that a step shows.
const SHOWN: usize = 12;
/// Shortest line that is flown, places.
const LEAST_PLACES: usize = 2;

/// Lines shared out in a team.
#[derive(Debug)]
pub struct PatternFlight {
    lines: Vec<Vec<Position>>,
    next: usize,
    /// What each sampler still has before it, the next place last.
    before: Vec<Vec<Position>>,
    points: Vec<PromisingPoint>,
}

impl PatternFlight {
    /// A lawnmower: legs over `domain` across the axis that `prior` supposes, at the heights between floor and ceiling
    /// that the spread at the middle of the box asks for.
    pub fn lawnmower(domain: &Domain, prior: &PlumePrior) -> Self {
        Self::new(legs(domain, prior), domain)
    }

    /// Arcs over `domain` about the source of `prior`, as far to both sides of its axis as that may be off, near ones
    /// first, and of one distance the height that is likeliest.
    pub fn arcs(domain: &Domain, prior: &PlumePrior) -> Self {
        Self::new(arcs(domain, prior), domain)
    }

    fn new(mut lines: Vec<Vec<Position>>, domain: &Domain) -> Self {
        lines.retain(|line| line.len() >= LEAST_PLACES);
        lines.truncate(MOST_LINES);
        if lines.is_empty() {
            lines.push(vec![domain.inside()]);
        }
        Self {
            lines,
            next: 0,
            before: Vec::new(),
            points: Vec::new(),
        }
    }

    /// The next line, begun at the end that is nearer.
    fn line_from(&mut self, here: Enu) -> Vec<Position> {
        let mut line = self.lines[self.next % self.lines.len()].clone();
        self.next += 1;
        let far = |p: Option<&Position>| p.map_or(0.0, |p| p.at.distance_m(here));
        // The next place stands last.
        if far(line.first()) < far(line.last()) {
            line.reverse();
        }
        line
    }
}

impl SearchStrategy for PatternFlight {
    /// The beginnings of the next lines.
    fn step(&mut self, _archive: &Archive, _rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        let next = self.lines.iter().cycle().skip(self.next % self.lines.len());
        let shown = next.take(self.lines.len().min(SHOWN));
        self.points.clear();
        self.points.extend(shown.map(|line| PromisingPoint {
            position: line[0],
            fitness: 0.0,
        }));
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }

    fn direct(&mut self, sampler: &Sampler, _cone_deg: f64, _rng: &mut ChaCha8Rng) -> Position {
        let (k, here) = (sampler.id, sampler.position);
        if self.before.len() <= k {
            self.before.resize(k + 1, Vec::new());
        }
        let reached = |p: &Position| here.at.distance_m(p.at) < REACHED_M;
        while self.before[k].last().is_some_and(reached) {
            self.before[k].pop();
        }
        if self.before[k].is_empty() {
            self.before[k] = self.line_from(here.at);
        }
        self.before[k].last().copied().unwrap_or(here)
    }
}

/// Legs across the supposed wind over the whole box.
fn legs(domain: &Domain, prior: &PlumePrior) -> Vec<Vec<Position>> {
    let (low, high) = (domain.low(), domain.high());
    let centre = Enu::new(
        0.5 * (low.at.east_m + high.at.east_m),
        0.5 * (low.at.north_m + high.at.north_m),
    );
    let reach_m = domain.reach_m(centre);
    let axis_deg = prior.axis_deg.value;
    let count = (2.0 * reach_m / APART_M).ceil() as usize;
    let places = (2.0 * reach_m / ALONG_M).ceil() as usize;
    let mut lines = Vec::new();
    for height_m in heights(domain, prior, 0.5 * reach_m) {
        for leg in 0..=count {
            let middle = centre.displaced(axis_deg, leg as f64 * APART_M - reach_m);
            let at = |k: usize| Position {
                at: middle.displaced(axis_deg + 90.0, k as f64 * ALONG_M - reach_m),
                height_m,
            };
            lines.extend(inside(domain, (0..=places).map(at)));
        }
    }
    lines
}

/// Arcs about the source.
fn arcs(domain: &Domain, prior: &PlumePrior) -> Vec<Vec<Position>> {
    let first = prior.base.sources.first();
    let source = first.map_or(Enu::default(), |s| s.place);
    let half_deg = (ARC_SD * prior.axis_deg.sd).clamp(5.0, 180.0);
    let from_deg = prior.axis_deg.value - half_deg;
    let mut lines = Vec::new();
    for ring in 1..=(domain.reach_m(source) / APART_M) as usize {
        let radius_m = ring as f64 * APART_M;
        let step_deg = (ALONG_M / radius_m).to_degrees();
        let places = (2.0 * half_deg / step_deg).ceil() as usize;
        for height_m in heights(domain, prior, radius_m) {
            let at = |k: usize| Position {
                at: source.displaced(from_deg + k as f64 * step_deg, radius_m),
                height_m,
            };
            lines.extend(inside(domain, (0..=places).map(at)));
        }
    }
    lines
}

/// Heights of a pattern, the likeliest first: within two standard deviations of the plume's height, and in the domain.
fn heights(domain: &Domain, prior: &PlumePrior, distance_m: f64) -> Vec<f64> {
    let base = &prior.base;
    let sigma_m =
        base.sigma_z_scale * plume::sigma::sigma_z_m(distance_m, base.stability, base.setting);
    let apart_m = (HEIGHTS_APART_SIGMAS * sigma_m).max(1.0);
    let (low_m, high_m) = (domain.low().height_m, domain.high().height_m);
    let likeliest_m = prior.height_amsl_m.value.clamp(low_m, high_m);
    let steps = (2.0 * prior.height_amsl_m.sd / apart_m).ceil() as i32;
    let mut all = vec![likeliest_m];
    for n in 1..=steps {
        for side in [1.0, -1.0] {
            let height_m = likeliest_m + side * f64::from(n) * apart_m;
            if (low_m..=high_m).contains(&height_m) {
                all.push(height_m);
            }
        }
    }
    all
}

/// The stretches of a line that lie in the domain.
fn inside(domain: &Domain, line: impl Iterator<Item = Position>) -> Vec<Vec<Position>> {
    let mut out = vec![Vec::new()];
    for place in line {
        match (domain.contains(place), out.last_mut()) {
            (true, Some(stretch)) => stretch.push(place),
            (false, Some(stretch)) if !stretch.is_empty() => out.push(Vec::new()),
            _ => {}
        }
    }
    out
}
