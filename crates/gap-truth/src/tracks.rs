//! Where the platforms fly, in plume axes: metres downwind of the source, metres to the right
//! of the mean axis (looking downwind) and metres above ground.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt};

use crate::law;
use crate::random::{between, pick, sign};

/// A point in plume axes: along, across, above ground, m.
pub type PlumePoint = [f64; 3];

/// What the tracks are to see of the plume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Class number of the spread.
    pub class: f64,
    /// Height of the axis, m above ground.
    pub axis_m: f64,
    /// Nearest and farthest distance, m.
    pub distance_m: (f64, f64),
    /// Lowest and highest flight, m above ground.
    pub height_m: (f64, f64),
    /// Heights of the tracks about the axis reach this many σ_z.
    pub sigmas_up: f64,
}

impl Reach {
    fn distance<R: Rng>(&self, rng: &mut R) -> f64 {
        between(rng, self.distance_m.0.sqrt(), self.distance_m.1.sqrt()).powi(2)
    }

    fn half_width_m(&self, x_m: f64) -> f64 {
        3.2 * law::sigma_y_m(self.class, x_m) + 40.0
    }

    fn height_m(&self, x_m: f64, sigmas: f64) -> f64 {
        let height = self.axis_m + sigmas * law::sigma_z_m(self.class, x_m).min(self.axis_m + 60.0);
        height.clamp(self.height_m.0, self.height_m.1)
    }
}

/// Kinds of track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackKind {
    /// To and fro across the plume at one distance, heights changing from pass to pass.
    Transects,
    /// To and fro at two distances by turns.
    TwoDistances,
    /// Across the plume while going downwind and back.
    ZigZag,
    /// A circle about a point on the axis, climbing and sinking.
    Orbit,
    /// Along the axis at small distances from it.
    Along,
    /// Circles that widen and narrow again while climbing and sinking.
    Spiral,
    /// None: a sensor that stands.
    Fixed,
}

/// The usual kinds.
pub const KINDS: [TrackKind; 5] = [
    TrackKind::Transects,
    TrackKind::TwoDistances,
    TrackKind::ZigZag,
    TrackKind::Orbit,
    TrackKind::Along,
];

/// The corners of a track of `kind` that is long enough for `length_m`.
pub fn corners(
    kind: TrackKind,
    reach: &Reach,
    length_m: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<PlumePoint> {
    let flight = Flight {
        kind,
        reach: *reach,
        side: sign(rng),
        near: reach.distance(rng),
        far: reach.distance(rng),
        off: between(rng, -0.4, 0.4),
        first_level: rng.random_range(0..LEVELS.len()),
    };
    if kind == TrackKind::Fixed {
        return vec![flight.stand()];
    }
    let mut points: Vec<PlumePoint> = Vec::new();
    let mut length = 0.0;
    let mut turn = 0;
    while length < length_m {
        for point in flight.leg(turn) {
            if let Some(last) = points.last() {
                length += distance_m(last, &point);
            }
            points.push(point);
        }
        turn += 1;
    }
    points
}

/// Heights of successive legs, in parts of [`Reach::sigmas_up`].
const LEVELS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];

/// What is drawn once a track.
struct Flight {
    kind: TrackKind,
    reach: Reach,
    /// Side on which the first leg begins.
    side: f64,
    near: f64,
    far: f64,
    /// Distance from the axis, in parts of the track's own width.
    off: f64,
    first_level: usize,
}

impl Flight {
    /// Where a fixed sensor stands: about the axis, on a mast, a slope or a tethered balloon.
    fn stand(&self) -> PlumePoint {
        let level = LEVELS[self.first_level] * self.reach.sigmas_up;
        let width_m = law::sigma_y_m(self.reach.class, self.near);
        let across = 3.0 * self.off * width_m;
        [self.near, across, self.reach.height_m(self.near, level)]
    }

    /// The corners of leg `turn`.
    fn leg(&self, turn: usize) -> Vec<PlumePoint> {
        let reach = &self.reach;
        let (near, off) = (self.near, self.off);
        let side = if turn.is_multiple_of(2) {
            self.side
        } else {
            -self.side
        };
        let level = LEVELS[(self.first_level + turn) % LEVELS.len()] * reach.sigmas_up;
        match self.kind {
            TrackKind::Transects | TrackKind::TwoDistances => {
                let other = self.kind == TrackKind::TwoDistances && (turn / 3) % 2 == 1;
                let x = if other { self.far } else { near };
                let (w, z) = (reach.half_width_m(x), reach.height_m(x, level));
                vec![[x, side * w, z], [x, -side * w, z]]
            }
            TrackKind::ZigZag => {
                let share = triangle(turn as f64 / 7.0);
                let x = reach.distance_m.0 + share * (reach.distance_m.1 - reach.distance_m.0);
                vec![[
                    x,
                    side * reach.half_width_m(x),
                    reach.height_m(x, level * 0.6),
                ]]
            }
            TrackKind::Orbit => {
                let radius = (1.6 * law::sigma_y_m(reach.class, near)).clamp(90.0, 400.0);
                let angle = turn as f64 * std::f64::consts::PI / 8.0;
                let up = 2.0 * triangle(turn as f64 / 43.0) - 1.0;
                let z = reach.height_m(near, up * reach.sigmas_up);
                let across = radius * (angle.sin() + off);
                vec![[(near + radius * angle.cos()).max(50.0), across, z]]
            }
            TrackKind::Spiral => {
                let widest = 2.5 * law::sigma_y_m(reach.class, near) + 40.0;
                let radius = 40.0 + (widest - 40.0) * triangle(turn as f64 / 64.0);
                let angle = turn as f64 * std::f64::consts::PI / 8.0;
                let up = 2.0 * triangle(turn as f64 / 150.0) - 1.0;
                let z = reach.height_m(near, up * reach.sigmas_up);
                let across = radius * angle.sin();
                vec![[(near + radius * angle.cos()).max(50.0), across, z]]
            }
            TrackKind::Fixed => vec![self.stand()],
            TrackKind::Along => {
                let y = off + 0.8 * (triangle(turn as f64 / 5.0) - 0.5);
                let (a, b) = reach.distance_m;
                let at = |x: f64| {
                    let across = y * 2.0 * law::sigma_y_m(reach.class, x);
                    [x, across, reach.height_m(x, level * 0.5)]
                };
                let mut run = vec![at(a), at((a * b).sqrt()), at(b)];
                if turn % 2 == 1 {
                    run.reverse();
                }
                run
            }
        }
    }
}

/// 0 to 1 and back within a period of 2.
fn triangle(turns: f64) -> f64 {
    let phase = turns.rem_euclid(2.0);
    if phase < 1.0 { phase } else { 2.0 - phase }
}

fn distance_m(a: &PlumePoint, b: &PlumePoint) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
}

/// Flies the corners at `speed_m_s`, one point every `step_s`, `count` points.
pub fn fly(corners: &[PlumePoint], speed_m_s: f64, step_s: f64, count: usize) -> Vec<PlumePoint> {
    let mut out = Vec::with_capacity(count);
    let mut leg = 0;
    let mut gone = 0.0;
    while out.len() < count {
        let Some(end) = corners.get(leg + 1) else {
            // The corners are long enough by construction; hold the last point otherwise.
            out.push(corners.last().copied().unwrap_or([0.0; 3]));
            continue;
        };
        let start = &corners[leg];
        let length = distance_m(start, end);
        if gone >= length {
            gone -= length;
            leg += 1;
            continue;
        }
        let share = gone / length.max(1e-9);
        out.push([0, 1, 2].map(|k| start[k] + share * (end[k] - start[k])));
        gone += speed_m_s * step_s;
    }
    out
}

/// Kinds for a team of `count`, at least one of which crosses the plume.
pub fn team(count: usize, rng: &mut ChaCha8Rng) -> Vec<TrackKind> {
    let mut kinds: Vec<TrackKind> = (0..count).map(|_| pick(rng, &KINDS)).collect();
    if count < 3 {
        kinds[0] = pick(rng, &[TrackKind::TwoDistances, TrackKind::ZigZag]);
    } else {
        kinds[0] = TrackKind::Transects;
        kinds[1] = TrackKind::TwoDistances;
        kinds[2] = TrackKind::ZigZag;
    }
    kinds
}

/// Sensors that stand for one platform that flies.
const FIXED_FOR_ONE: usize = 3;

/// The kinds of a team of `count` all of whose members are of one `kind`; sensors that stand are more.
pub fn all_alike(kind: TrackKind, count: usize) -> Vec<TrackKind> {
    let count = if kind == TrackKind::Fixed {
        FIXED_FOR_ONE * count
    } else {
        count
    };
    vec![kind; count]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    const REACH: Reach = Reach {
        class: 3.0,
        axis_m: 200.0,
        distance_m: (500.0, 3000.0),
        height_m: (40.0, 500.0),
        sigmas_up: 1.2,
    };

    #[test]
    fn every_kind_meets_the_plume_and_keeps_its_speed() {
        for kind in KINDS {
            let mut rng = stream(3, "t");
            let corners = corners(kind, &REACH, 12_000.0, &mut rng);
            let path = fly(&corners, 18.0, 1.0, 600);
            assert_eq!(path.len(), 600);
            let inside = path.iter().filter(|p| {
                let (y, z) = (law::sigma_y_m(3.0, p[0]), law::sigma_z_m(3.0, p[0]));
                p[1].abs() < 2.0 * y && (p[2] - 200.0).abs() < 2.0 * z
            });
            assert!(inside.count() > 100, "{kind:?}");
            for w in path.windows(2) {
                assert!(distance_m(&w[0], &w[1]) < 18.0 + 1e-6);
                assert!(w[0][2] >= 40.0 && w[0][2] <= 500.0);
            }
        }
    }
}
