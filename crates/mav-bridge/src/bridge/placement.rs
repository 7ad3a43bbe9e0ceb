//! Whether the vehicle flies to where the bridge has sent it, or another ground station has sent it
//! elsewhere: in GUIDED the mode does not tell.

use crate::dialect::POSITION_TARGET_GLOBAL_INT_DATA;
use crate::telemetry::distance_m;
use air::geo::Geodetic;
use protocol::SimTime;

/// After a place was taken this long is left for it to be shown, s.
const SETTLES_S: f64 = 2.0;
/// A target further than this from the place sent is another, m; the vehicle repeats the place bit by bit.
const ELSEWHERE_M: f64 = 30.0;
/// Targets elsewhere, one after the other, that count: they come twice a second.
const TARGETS: u32 = 3;
/// A target is heard if it came within this, s; then distances do not count.
const TARGET_LASTS_S: f64 = 5.0;
/// It flies away if it was nearer by this, m: more than an orbit's width in wind.
const AWAY_M: f64 = 300.0;
/// Time for which it has to fly away, s.
const AWAY_S: f64 = 20.0;

/// Finding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Astray {
    /// It reports another target.
    To(Geodetic),
    /// It moves away from its place.
    Away,
}

/// The place that was sent and accepted.
#[derive(Debug, Clone, Copy)]
struct Placed {
    at: Geodetic,
    since: SimTime,
    nearest_m: f64,
    away_since: Option<SimTime>,
}

/// The commanded and the reported target.
#[derive(Debug, Clone, Default)]
pub(super) struct Placement {
    placed: Option<Placed>,
    elsewhere: u32,
    target_at: Option<SimTime>,
}

impl Placement {
    /// The vehicle has accepted a place, in 1e-7 degrees.
    pub(super) fn taken(&mut self, lat_1e7: i32, lon_1e7: i32, now: SimTime) {
        self.elsewhere = 0;
        self.placed = Some(Placed {
            at: degrees(lat_1e7, lon_1e7),
            since: now,
            nearest_m: f64::INFINITY,
            away_since: None,
        });
    }

    /// Another place is on its way, or somebody else flies.
    pub(super) fn forget(&mut self) {
        (self.placed, self.elsewhere) = (None, 0);
    }

    /// Receives the target that the vehicle reports.
    pub(super) fn target(
        &mut self,
        m: &POSITION_TARGET_GLOBAL_INT_DATA,
        now: SimTime,
    ) -> Option<Astray> {
        self.target_at = Some(now);
        let placed = self.placed.filter(|p| now.since_s(p.since) > SETTLES_S)?;
        let target = degrees(m.lat_int, m.lon_int);
        let is_place = (m.lat_int, m.lon_int) != (0, 0);
        if !is_place || distance_m(placed.at, target) <= ELSEWHERE_M {
            self.elsewhere = 0;
            return None;
        }
        self.elsewhere += 1;
        (self.elsewhere >= TARGETS).then_some(Astray::To(target))
    }

    /// Checks the vehicle's position, if it reports no target.
    pub(super) fn look(&mut self, here: Geodetic, now: SimTime) -> Option<Astray> {
        let told = |at: SimTime| now.since_s(at) <= TARGET_LASTS_S;
        if self.target_at.is_some_and(told) {
            return None;
        }
        let placed = self.placed.as_mut()?;
        let distance = distance_m(placed.at, here);
        placed.nearest_m = placed.nearest_m.min(distance);
        if distance <= placed.nearest_m + AWAY_M {
            placed.away_since = None;
            return None;
        }
        let since = *placed.away_since.get_or_insert(now);
        if now.since_s(since) <= AWAY_S {
            return None;
        }
        (placed.away_since, placed.nearest_m) = (None, distance);
        Some(Astray::Away)
    }
}

fn degrees(lat_1e7: i32, lon_1e7: i32) -> Geodetic {
    Geodetic::new(f64::from(lat_1e7) / 1e7, f64::from(lon_1e7) / 1e7)
}
