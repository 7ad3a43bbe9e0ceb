//! The wind that the world follows: constant, a measured series, or what real vehicles report.

use air::wind::{WindProfile, WindSeries, WindVector};
use protocol::message::Estimate;

/// Time constant with which reported winds are averaged, s.
const AVERAGING_S: f64 = 60.0;
/// Errors of a reported wind, and the eddies in it, are independent after about this time, s.
const MEMORY_S: f64 = 180.0;
/// One standard deviation of what the law of wind with height is off from where vehicles flew to the plume's
/// axis, as a part of the speed.
const LAW: f64 = 0.03;

/// The world's mean wind over time.
#[derive(Debug, Clone)]
pub struct WorldWind {
    scenario: WindProfile,
    /// At the profile's reference height.
    slow: WindSeries,
    known_by: KnownBy,
    /// What vehicles report, and what of it is of the reference's layer.
    reports: Reports,
    of_layer: Reports,
}

/// Mean and scatter of the reported speeds at the reference height (Welford 1962).
#[derive(Debug, Clone, Copy, Default)]
struct Reports {
    count: f64,
    mean_m_s: f64,
    squares: f64,
    first_s: f64,
    last_s: f64,
}

impl Reports {
    fn take(&mut self, time_s: f64, speed_m_s: f64) {
        if self.count == 0.0 {
            self.first_s = time_s;
        }
        self.last_s = self.last_s.max(time_s);
        self.count += 1.0;
        let off = speed_m_s - self.mean_m_s;
        self.mean_m_s += off / self.count;
        self.squares += off * (speed_m_s - self.mean_m_s);
    }

    /// Mean with its standard deviation; none before two reports.
    fn mean(&self) -> Option<Estimate> {
        let independent = ((self.last_s - self.first_s) / MEMORY_S).max(1.0);
        let variance = self.squares / (self.count - 1.0) / independent;
        (self.count >= 2.0).then(|| Estimate {
            value: self.mean_m_s,
            sd: variance.sqrt().hypot(LAW * self.mean_m_s),
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum KnownBy {
    /// The scenario's own numbers.
    Scenario,
    /// A measured series.
    Series,
    /// Reports, of which the last came at a time; none yet.
    Reports(Option<f64>),
}

impl WorldWind {
    /// The scenario's wind, its series if it has one, and whether reports override both.
    pub fn new(scenario: WindProfile, series: Option<WindSeries>, follow_reports: bool) -> Self {
        let known_by = match &series {
            _ if follow_reports => KnownBy::Reports(None),
            Some(_) => KnownBy::Series,
            None => KnownBy::Scenario,
        };
        let own = || WindSeries::constant(scenario.at(scenario.reference_height_agl_m()));
        Self {
            scenario,
            slow: series.unwrap_or_else(own),
            known_by,
            reports: Reports::default(),
            of_layer: Reports::default(),
        }
    }

    /// From now on the series is this one; says whether it counts, as it does where it was a series before.
    pub fn set_series(&mut self, series: WindSeries) -> bool {
        let counts = self.known_by == KnownBy::Series;
        if counts {
            self.slow = series;
        }
        counts
    }

    /// Takes in a wind that a real vehicle reports at `height_agl_m`.
    pub fn report(&mut self, time_s: f64, height_agl_m: f64, wind: WindVector) {
        // Averaged at the reference height, so that vehicles at different heights agree.
        let there = self.scenario.speed_at_m_s(height_agl_m);
        let carried = if there > 0.0 {
            self.scenario.reference_speed_m_s() / there
        } else {
            1.0
        };
        let wind = WindVector {
            east_m_s: wind.east_m_s * carried,
            north_m_s: wind.north_m_s * carried,
        };
        self.reports.take(time_s, wind.speed_m_s());
        let ratio = height_agl_m / self.scenario.reference_height_agl_m();
        if study::is_same_layer(ratio) {
            self.of_layer.take(time_s, wind.speed_m_s());
        }
        let KnownBy::Reports(last_s) = self.known_by else {
            return;
        };
        match last_s {
            // What blew before nobody has said: as now.
            None => self.slow = WindSeries::constant(wind),
            Some(last_s) => {
                let share = 1.0 - (-(time_s - last_s).max(0.0) / AVERAGING_S).exp();
                let old = self.slow.at(last_s);
                let averaged = WindVector {
                    east_m_s: old.east_m_s + share * (wind.east_m_s - old.east_m_s),
                    north_m_s: old.north_m_s + share * (wind.north_m_s - old.north_m_s),
                };
                self.slow.push(time_s, averaged);
            }
        }
        self.known_by = KnownBy::Reports(Some(time_s.max(last_s.unwrap_or(time_s))));
    }

    /// Speed at the scenario's reference height as vehicles have reported it, in its layer if any has; the scenario's, with the
    /// standard deviation `unknown_m_s`, where none has.
    pub(crate) fn reported_speed(&self, unknown_m_s: f64) -> Estimate {
        let mean = self.of_layer.mean().or_else(|| self.reports.mean());
        mean.unwrap_or(Estimate {
            value: self.scenario.reference_speed_m_s(),
            sd: unknown_m_s,
        })
    }

    /// Whether it is one wind for all times, so that a correction of the plume's axis corrects the wind.
    pub(crate) fn is_constant(&self) -> bool {
        matches!(self.known_by, KnownBy::Scenario | KnownBy::Reports(None))
    }

    /// The wind over time at the scenario's reference height.
    pub(crate) fn slow(&self) -> &WindSeries {
        &self.slow
    }

    /// The wind profile at `time_s`, turned clockwise by `turn_deg`.
    pub fn at(&self, time_s: f64, turn_deg: f64) -> WindProfile {
        let base = if self.is_constant() {
            self.scenario
        } else {
            let reference_m = self.scenario.reference_height_agl_m();
            let measured = self.scenario.through(self.slow.at(time_s), reference_m);
            measured.unwrap_or(self.scenario)
        };
        if turn_deg == 0.0 {
            return base;
        }
        base.turned(turn_deg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile() -> WindProfile {
        WindProfile::new(5.0, 10.0, 270.0, 0.2).unwrap()
    }

    #[test]
    fn constant_and_turned() {
        let wind = WorldWind::new(profile(), None, false);
        assert_eq!(wind.at(100.0, 0.0), profile());
        assert!((wind.at(0.0, 100.0).from_deg() - 10.0).abs() < 1e-9);
    }

    #[test]
    fn follows_the_series() {
        let series = WindSeries::new(&[(0.0, 4.0, 200.0), (60.0, 8.0, 200.0)]).unwrap();
        let wind = WorldWind::new(profile(), Some(series), false);
        assert!((wind.at(30.0, 0.0).speed_at_m_s(10.0) - 6.0).abs() < 1e-9);
        assert!((wind.at(30.0, 0.0).from_deg() - 200.0).abs() < 1e-9);
    }

    #[test]
    fn a_newer_series_counts_where_a_series_did() {
        let series = |speed| WindSeries::new(&[(0.0, speed, 200.0)]).unwrap();
        let mut wind = WorldWind::new(profile(), Some(series(4.0)), false);
        assert!(wind.set_series(series(8.0)));
        assert!((wind.at(30.0, 0.0).speed_at_m_s(10.0) - 8.0).abs() < 1e-9);
        let mut own = WorldWind::new(profile(), None, false);
        assert!(!own.set_series(series(8.0)) && own.at(0.0, 0.0) == profile());
    }

    /// A vehicle that stands at its home for the second half of the mission, and reports gusts, does not make the plume's wind
    /// faster; where nobody flies in the plume's layer, what is reported counts.
    #[test]
    fn the_speed_is_that_of_reports_from_the_layer() {
        let scenario = WindProfile::new(8.0, 486.0, 270.0, 0.15).unwrap();
        let report = |wind: &mut WorldWind, from_s: i32, height_agl_m: f64, factor: f64| {
            for t in from_s..from_s + 600 {
                let speed = factor * scenario.speed_at_m_s(height_agl_m);
                let there = WindVector::from_speed_and_direction(speed, 270.0);
                wind.report(f64::from(t), height_agl_m, there);
            }
        };
        let mut wind = WorldWind::new(scenario, None, false);
        report(&mut wind, 0, 2.0, 1.5);
        assert!((wind.reported_speed(1.0).value - 12.0).abs() < 1e-6);
        report(&mut wind, 600, 500.0, 1.0);
        report(&mut wind, 1200, 2.0, 1.5);
        assert!((wind.reported_speed(1.0).value - 8.0).abs() < 1e-6);
    }

    #[test]
    fn follows_reports_carried_to_the_reference_height() {
        let mut wind = WorldWind::new(profile(), None, true);
        let aloft = profile().speed_at_m_s(400.0) * 2.0;
        for t in 0..600 {
            wind.report(
                f64::from(t),
                400.0,
                WindVector::from_speed_and_direction(aloft, 300.0),
            );
        }
        let now = wind.at(600.0, 0.0);
        assert!((now.speed_at_m_s(10.0) - 10.0).abs() < 1e-6, "{now:?}");
        assert!((now.from_deg() - 300.0).abs() < 1e-6);
    }
}
