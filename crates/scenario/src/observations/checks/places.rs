//! Rows that were not where they say: before a position fix, at another site, or beside a jump.

use air::geo::LocalFrame;
use plume::{DispersionSpec, Place};

use super::{Flaw, OfPlatform, middle, quantile};

/// Rows farther than this from the first source cannot belong to the scenario, m; nor heights above
/// ground outside of these, m.
const FARTHEST_M: f64 = 40_000.0;
const LOWEST_AGL_M: f64 = -500.0;
const HIGHEST_AGL_M: f64 = 20_000.0;
/// Latitudes and longitudes this near to zero are zero, degrees: a tenth of a metre.
const ZERO_DEG: f64 = 1e-6;
/// An aircraft whose rows lie this far below the site's ground in the middle logs another height, m.
const UNDERGROUND_M: f64 = 50.0;
/// Speeds over ground that none has, m/s: the fast one in the middle of its track; the slow one where not even the fastest
/// tenth of a long way, m, is covered faster. A car that stands most of the time covers its way while it drives.
const TOO_FAST_M_S: f64 = 340.0;
const TOO_SLOW_M_S: f64 = 0.3;
const LONG_TRACK_M: f64 = 1000.0;
const FASTEST_PART: f64 = 0.1;
/// A step is a jump from so many times the speed that a tenth of the steps exceeds, or a quarter of those
/// on the move; no step is that is slower than a bicycle, m/s.
const JUMP_TIMES: f64 = 4.0;
const FAST_PART: f64 = 0.9;
const FAST_PART_MOVING: f64 = 0.75;
const SLOWEST_JUMP_M_S: f64 = 10.0;
/// What goes faster than this is on the move, m/s, and part of the steps from which on that is no jump.
const MOVING_M_S: f64 = 2.0;
const MOVING_PART: f64 = 0.02;
/// Part of the rows that a stretch beside the track has at most, and all such stretches together: more may be
/// a pass of its own, and nobody knows which is the track.
const STRAY_PART: f64 = 0.03;
const ALL_STRAY_PART: f64 = 0.1;

impl OfPlatform<'_> {
    /// Ignores rows without a valid position and reports them.
    pub(super) fn places(&mut self, base: &DispersionSpec, frame: &LocalFrame) {
        self.far(base, frame);
        self.underground(base, frame);
        self.speeds(frame);
        self.jumps(frame);
    }

    fn far(&mut self, base: &DispersionSpec, frame: &LocalFrame) {
        let source = base.sources[0].place;
        let elsewhere = |i: &usize| {
            let p = self.log.rows[*i].place(frame);
            let away_m = (p.east_m - source.east_m).hypot(p.north_m - source.north_m);
            // Not a number, too.
            let near = away_m <= FARTHEST_M;
            !near || !(LOWEST_AGL_M..=HIGHEST_AGL_M).contains(&p.height_agl_m)
        };
        let far: Vec<usize> = self.at.iter().copied().filter(elsewhere).collect();
        let zero = |i: &usize| {
            let row = &self.log.rows[*i];
            row.lat_deg.abs() < ZERO_DEG || row.lon_deg.abs() < ZERO_DEG
        };
        let (no_fix, far): (Vec<usize>, Vec<usize>) = far.into_iter().partition(zero);
        self.drop_rows(&no_fix);
        self.drop_rows(&far);
        let message = format!(
            "{} rows without a position fix (lat_deg or lon_deg 0) are ignored",
            no_fix.len()
        );
        self.say(Flaw::Outlier, &no_fix, message);
        let message = format!(
            "{} rows lie over {:.0} km from the source (or far from its height) and are ignored; check whether \
             lat_deg and lon_deg are swapped, or whether this is another site",
            far.len(),
            FARTHEST_M / 1000.0
        );
        self.say(Flaw::Unit, &far, message);
    }

    /// Leaves out all rows and says why.
    fn drop_all(&mut self, message: String) {
        let all = self.at.clone();
        self.say(Flaw::Unit, &all, message);
        self.drop_rows(&all);
    }

    /// Heights below the ground.
    fn underground(&mut self, base: &DispersionSpec, frame: &LocalFrame) {
        let height_m = |i: &usize| self.log.rows[*i].place(frame).height_agl_m;
        let mut heights: Vec<f64> = self.at.iter().map(height_m).collect();
        let height_m = middle(&mut heights).unwrap_or(0.0);
        if height_m < -UNDERGROUND_M {
            self.drop_all(format!(
                "half of the rows lie {:.0} m or more below the site's ground ({} m above sea level); check \
                 whether alt_amsl_m is in another unit (km?) or a height above ground",
                -height_m, base.ground_amsl_m
            ));
        }
    }

    /// Times in which nothing flies so fast or so slowly.
    fn speeds(&mut self, frame: &LocalFrame) {
        let fixes = self.fixes(frame);
        let steps = fixes.windows(2).filter_map(|pair| {
            let lasted_s = pair[1].time_s - pair[0].time_s;
            let way_m = pair[0].level_m(&pair[1]);
            (lasted_s > 0.0).then(|| (way_m / lasted_s, way_m))
        });
        let mut steps: Vec<(f64, f64)> = steps.collect();
        let mut speeds: Vec<f64> = steps.iter().map(|(speed_m_s, _)| *speed_m_s).collect();
        let speed_m_s = middle(&mut speeds);
        let length_m: f64 = steps.iter().map(|(_, way_m)| way_m).sum();
        let wrong = match speed_m_s {
            Some(v) if v > TOO_FAST_M_S => "(minutes or hours?)",
            Some(_) if length_m > LONG_TRACK_M && fastest_m_s(&mut steps) < TOO_SLOW_M_S => {
                "(ms or ns?)"
            }
            _ => return,
        };
        self.drop_all(format!(
            "the track moves at a median of {:.3} m/s; check whether time_s is in another unit {wrong}",
            speed_m_s.unwrap_or_default()
        ));
    }

    /// Stretches beside the track that no vehicle of this speed gets to and back from.
    fn jumps(&mut self, frame: &LocalFrame) {
        let fixes = self.fixes(frame);
        let limit_m_s = jump_m_s(&fixes);
        let stretches: Vec<&[Fix]> = fixes.chunk_by(|a, b| a.speed_to(b) <= limit_m_s).collect();
        if stretches.len() < 2 {
            return;
        }
        let rows = self.at.len() as f64;
        let stray = stray(&stretches, limit_m_s, STRAY_PART * rows);
        let of_fix = |fix: &&Fix| self.at[fix.rows.clone()].to_vec();
        let own: Vec<usize> = stray.iter().flat_map(of_fix).collect();
        if own.is_empty() || own.len() as f64 > ALL_STRAY_PART * rows {
            return;
        }
        let message = format!(
            "{} rows are ignored: their position jumps there and back at more than {limit_m_s:.0} m/s, faster \
             than this log's vehicle flies",
            own.len()
        );
        self.say(Flaw::Outlier, &own, message);
        self.drop_rows(&own);
    }

    /// The places one after the other; one that is held is one.
    fn fixes(&self, frame: &LocalFrame) -> Vec<Fix> {
        let mut fixes: Vec<Fix> = Vec::new();
        for (k, i) in self.at.iter().enumerate() {
            let row = &self.log.rows[*i];
            let place = row.place(frame);
            match fixes.last_mut() {
                Some(last) if last.place == place => last.rows.end = k + 1,
                _ => fixes.push(Fix {
                    place,
                    time_s: row.time_s,
                    rows: k..k + 1,
                }),
            }
        }
        fixes
    }
}

/// A place, since when, and the rows (among those left) that have it.
#[derive(Debug, Clone)]
struct Fix {
    place: Place,
    time_s: f64,
    rows: std::ops::Range<usize>,
}

impl Fix {
    /// Horizontal distance of another fix, m.
    fn level_m(&self, other: &Self) -> f64 {
        let (a, b) = (self.place, other.place);
        (b.east_m - a.east_m).hypot(b.north_m - a.north_m)
    }

    /// Speed of the straight way to another fix, m/s; zero where no time passes.
    fn speed_to(&self, other: &Self) -> f64 {
        let up_m = other.place.height_agl_m - self.place.height_agl_m;
        let way_m = self.level_m(other).hypot(up_m);
        let lasted_s = other.time_s - self.time_s;
        if lasted_s > 0.0 {
            way_m / lasted_s
        } else {
            0.0
        }
    }
}

/// The speed above which the fastest tenth of the way is covered, m/s, of steps of a speed and a length; sorts them.
fn fastest_m_s(steps: &mut [(f64, f64)]) -> f64 {
    steps.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left_m = FASTEST_PART * steps.iter().map(|(_, way_m)| way_m).sum::<f64>();
    let step = steps.iter().find(|(_, way_m)| {
        left_m -= way_m;
        left_m <= 0.0
    });
    step.map_or(0.0, |(speed_m_s, _)| *speed_m_s)
}

/// The speed from which on a step is a jump, m/s.
fn jump_m_s(fixes: &[Fix]) -> f64 {
    let mut speeds: Vec<f64> = fixes.windows(2).map(|w| w[0].speed_to(&w[1])).collect();
    let mut moving: Vec<f64> = speeds.iter().copied().filter(|v| *v > MOVING_M_S).collect();
    let mut fast = quantile(&mut speeds, FAST_PART).unwrap_or(0.0);
    // What mostly hovers may also dash.
    if moving.len() as f64 > MOVING_PART * speeds.len() as f64 {
        fast = fast.max(quantile(&mut moving, FAST_PART_MOVING).unwrap_or(0.0));
    }
    (JUMP_TIMES * fast).max(SLOWEST_JUMP_M_S)
}

/// The fixes of short stretches that cannot be reached from the track on either side, which is followed
/// from the longest stretch outwards.
fn stray<'f>(stretches: &[&'f [Fix]], limit_m_s: f64, most_rows: f64) -> Vec<&'f Fix> {
    let rows = |s: &[Fix]| s.iter().map(|f| f.rows.len()).sum::<usize>();
    let longest = (0..stretches.len()).max_by_key(|k| rows(stretches[*k]));
    let longest = longest.unwrap_or(0);
    let short = |s: &[Fix]| rows(s) as f64 <= most_rows;
    let mut stray: Vec<&Fix> = Vec::new();
    let mut at = stretches[longest];
    for &next in &stretches[longest + 1..] {
        let reached = at[at.len() - 1].speed_to(&next[0]) <= limit_m_s;
        if reached || !short(next) {
            at = next;
        } else {
            stray.extend(next);
        }
    }
    at = stretches[longest];
    for &next in stretches[..longest].iter().rev() {
        let reached = next[next.len() - 1].speed_to(&at[0]) <= limit_m_s;
        if reached || !short(next) {
            at = next;
        } else {
            stray.extend(next);
        }
    }
    stray.sort_by_key(|f| f.rows.start);
    stray
}
