//! Mean wind: its profile with height, and its series in time.

use crate::geo::wrap_deg;
use crate::{AirError, in_range};

/// Lowest height at which the power law is used, m: below, the wind of this height. The law goes to
/// zero at the ground, where the roughness sublayer begins well above it.
const LOWEST_HEIGHT_AGL_M: f64 = 1.0;

/// A horizontal wind as a vector *towards* which the air moves.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WindVector {
    /// Component towards east, m/s.
    pub east_m_s: f64,
    /// Component towards north, m/s.
    pub north_m_s: f64,
}

impl WindVector {
    /// The vector of a wind of `speed_m_s` *from* `from_deg`.
    pub fn from_speed_and_direction(speed_m_s: f64, from_deg: f64) -> Self {
        let (sin, cos) = from_deg.to_radians().sin_cos();
        Self {
            east_m_s: -speed_m_s * sin,
            north_m_s: -speed_m_s * cos,
        }
    }

    /// Speed, m/s.
    pub fn speed_m_s(self) -> f64 {
        self.east_m_s.hypot(self.north_m_s)
    }

    /// Direction *from* which it blows, degrees in `[0, 360)`; 0 for calm.
    pub fn from_deg(self) -> f64 {
        from_deg(self.east_m_s, self.north_m_s)
    }
}

/// Direction *from* which a wind with these components blows, degrees in `[0, 360)`; 0 for calm.
pub fn from_deg(east_m_s: f64, north_m_s: f64) -> f64 {
    if east_m_s == 0.0 && north_m_s == 0.0 {
        0.0
    } else {
        wrap_deg((-east_m_s).atan2(-north_m_s).to_degrees())
    }
}

/// Direction *towards* which a wind from `from_deg` blows, degrees in `[0, 360)`.
pub fn towards_deg(from_deg: f64) -> f64 {
    wrap_deg(from_deg + 180.0)
}

/// Wind by the power law u(z) = u_ref (z / z_ref)^p, with one direction at all heights. Rather than the
/// logarithmic law with its stability functions, since that holds in the surface layer only, some
/// tens of metres, and plumes of tall stacks are at several hundred.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindProfile {
    speed_m_s: f64,
    height_agl_m: f64,
    from_deg: f64,
    exponent: f64,
}

impl WindProfile {
    /// A profile with `speed_m_s` at `height_agl_m`, blowing from `from_deg`; `exponent` 0 means
    /// the same wind at all heights (0.07 to 0.55 in practice, Irwin 1979).
    ///
    /// # Errors
    /// A speed outside 0…80 m/s, a height not positive, an exponent outside 0…1.
    pub fn new(
        speed_m_s: f64,
        height_agl_m: f64,
        from_deg: f64,
        exponent: f64,
    ) -> Result<Self, AirError> {
        in_range("wind_speed_m_s", speed_m_s, 0.0, 80.0, "0 to 80 m/s")?;
        in_range(
            "wind_height_agl_m",
            height_agl_m,
            0.1,
            5000.0,
            "0.1 to 5000 m",
        )?;
        in_range(
            "wind_from_deg",
            from_deg,
            -720.0,
            720.0,
            "degrees, 0 to 360",
        )?;
        in_range("wind_exponent", exponent, 0.0, 1.0, "0 to 1")?;
        Ok(Self {
            speed_m_s,
            height_agl_m,
            from_deg: wrap_deg(from_deg),
            exponent,
        })
    }

    /// Speed at the reference height, m/s.
    pub fn reference_speed_m_s(&self) -> f64 {
        self.speed_m_s
    }

    /// The reference height, m above ground.
    pub fn reference_height_agl_m(&self) -> f64 {
        self.height_agl_m
    }

    /// Direction from which it blows, degrees in `[0, 360)`.
    pub fn from_deg(&self) -> f64 {
        self.from_deg
    }

    /// Exponent of the power law.
    pub fn exponent(&self) -> f64 {
        self.exponent
    }

    /// Speed at `height_agl_m`, m/s.
    pub fn speed_at_m_s(&self, height_agl_m: f64) -> f64 {
        if self.exponent == 0.0 {
            return self.speed_m_s;
        }
        let ratio = height_agl_m.max(LOWEST_HEIGHT_AGL_M) / self.height_agl_m;
        self.speed_m_s * ratio.powf(self.exponent)
    }

    /// The wind vector at `height_agl_m`.
    pub fn at(&self, height_agl_m: f64) -> WindVector {
        WindVector::from_speed_and_direction(self.speed_at_m_s(height_agl_m), self.from_deg)
    }

    /// The same profile with its direction turned clockwise; as it is for an angle that is not finite.
    #[must_use]
    pub fn turned(&self, clockwise_deg: f64) -> Self {
        if !clockwise_deg.is_finite() {
            return *self;
        }
        Self {
            from_deg: wrap_deg(self.from_deg + clockwise_deg),
            ..*self
        }
    }

    /// The same law through another speed and direction measured at `height_agl_m`.
    ///
    /// # Errors
    /// As [`WindProfile::new`].
    pub fn through(&self, wind: WindVector, height_agl_m: f64) -> Result<Self, AirError> {
        Self::new(
            wind.speed_m_s(),
            height_agl_m.max(LOWEST_HEIGHT_AGL_M),
            wind.from_deg(),
            self.exponent,
        )
    }
}

/// Wind measured over time at one height: speed and direction between the rows by linear
/// interpolation of the vector, constant before the first and after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct WindSeries {
    rows: Vec<(f64, WindVector)>,
    /// Way of the air from the first row to each.
    ways: Vec<Way>,
}

/// The way that air took.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Way {
    /// Metres east of where it was.
    pub east_m: f64,
    /// Metres north of where it was.
    pub north_m: f64,
    /// Length of the way, m: more than the distance where the wind turned.
    pub length_m: f64,
}

impl Way {
    /// The way of air that moves with `wind` for a time; negative: back.
    fn with(wind: WindVector, for_s: f64) -> Self {
        Self {
            east_m: wind.east_m_s * for_s,
            north_m: wind.north_m_s * for_s,
            length_m: wind.speed_m_s() * for_s,
        }
    }

    /// This way and then another.
    #[must_use]
    pub fn and(self, then: Self) -> Self {
        Self {
            east_m: self.east_m + then.east_m,
            north_m: self.north_m + then.north_m,
            length_m: self.length_m + then.length_m,
        }
    }

    /// This way made with another speed and turned clockwise, as (cos, sin) of the turn.
    #[must_use]
    pub fn turned(self, (cos, sin): (f64, f64)) -> Self {
        Self {
            east_m: self.east_m * cos + self.north_m * sin,
            north_m: self.north_m * cos - self.east_m * sin,
            ..self
        }
    }
}

impl WindSeries {
    /// A series of (time in s, speed in m/s, from-direction in degrees).
    ///
    /// # Errors
    /// No rows, times not increasing, or a speed outside 0…80 m/s.
    pub fn new(rows: &[(f64, f64, f64)]) -> Result<Self, AirError> {
        in_range(
            "rows of the wind series",
            rows.len() as f64,
            1.0,
            1e9,
            "at least one",
        )?;
        let mut last = f64::NEG_INFINITY;
        let mut out = Vec::with_capacity(rows.len());
        for &(time_s, speed_m_s, direction_deg) in rows {
            in_range(
                "time_s of the wind series",
                time_s,
                last.max(-1e12),
                1e12,
                "increasing times",
            )?;
            in_range("wind_speed_m_s", speed_m_s, 0.0, 80.0, "0 to 80 m/s")?;
            in_range(
                "wind_from_deg",
                direction_deg,
                -720.0,
                720.0,
                "degrees, 0 to 360",
            )?;
            // The next time must be greater, not equal: two winds of one moment have no mean.
            last = time_s.next_up();
            out.push((
                time_s,
                WindVector::from_speed_and_direction(speed_m_s, direction_deg),
            ));
        }
        let mut series = Self {
            rows: Vec::with_capacity(out.len()),
            ways: Vec::with_capacity(out.len()),
        };
        for (time_s, wind) in out {
            series.push(time_s, wind);
        }
        Ok(series)
    }

    /// A wind that is always the same, until more is known.
    pub fn constant(wind: WindVector) -> Self {
        Self {
            rows: vec![(0.0, wind)],
            ways: vec![Way::default()],
        }
    }

    /// Appends the wind of a later time; one that is not later is left out.
    pub fn push(&mut self, time_s: f64, wind: WindVector) {
        let Some(&(last_s, last)) = self.rows.last() else {
            self.rows.push((time_s, wind));
            self.ways.push(Way::default());
            return;
        };
        if time_s > last_s {
            let on = Way::with(midway(last, wind), time_s - last_s);
            self.ways.push(self.ways[self.ways.len() - 1].and(on));
            self.rows.push((time_s, wind));
        }
    }

    /// The rows: times in s and the wind then.
    pub fn rows(&self) -> &[(f64, WindVector)] {
        &self.rows
    }

    /// A series of rows in order of time; none of no rows. A row that is not later than the one before is
    /// left out.
    pub fn of_rows(rows: impl IntoIterator<Item = (f64, WindVector)>) -> Option<Self> {
        let mut series = Self {
            rows: Vec::new(),
            ways: Vec::new(),
        };
        for (time_s, wind) in rows {
            series.push(time_s, wind);
        }
        (!series.rows.is_empty()).then_some(series)
    }

    /// What is known now: of the times before the first row of `newer` what was known before, and from there
    /// on what it says.
    #[must_use]
    pub fn followed_by(&self, newer: &Self) -> Self {
        let from_s = newer.rows[0].0;
        let before = self.rows.iter().take_while(|row| row.0 < from_s);
        let all = before.chain(&newer.rows).copied();
        Self::of_rows(all).unwrap_or_else(|| newer.clone())
    }

    /// Way of the air from the series' beginning to `time_s`: of two times the difference counts.
    pub fn way(&self, time_s: f64) -> Way {
        let after = self.rows.partition_point(|row| row.0 <= time_s);
        let (from_s, from) = self.rows[after.max(1) - 1];
        let mean = if after == 0 || after == self.rows.len() {
            from
        } else {
            midway(from, self.at(time_s))
        };
        self.ways[after.max(1) - 1].and(Way::with(mean, time_s - from_s))
    }

    /// The wind at `time_s`.
    pub fn at(&self, time_s: f64) -> WindVector {
        let after = self.rows.partition_point(|row| row.0 <= time_s);
        if after == 0 {
            return self.rows[0].1;
        }
        let (t0, a) = self.rows[after - 1];
        let Some(&(t1, b)) = self.rows.get(after) else {
            return a;
        };
        let part = (time_s - t0) / (t1 - t0);
        WindVector {
            east_m_s: a.east_m_s + part * (b.east_m_s - a.east_m_s),
            north_m_s: a.north_m_s + part * (b.north_m_s - a.north_m_s),
        }
    }
}

fn midway(a: WindVector, b: WindVector) -> WindVector {
    WindVector {
        east_m_s: 0.5 * (a.east_m_s + b.east_m_s),
        north_m_s: 0.5 * (a.north_m_s + b.north_m_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_the_integral_of_the_series() {
        let series =
            WindSeries::new(&[(0.0, 4.0, 270.0), (60.0, 8.0, 270.0), (120.0, 8.0, 180.0)]).unwrap();
        let between = |from_s: f64, to_s: f64| {
            let (a, b) = (series.way(from_s), series.way(to_s));
            [b.east_m - a.east_m, b.north_m - a.north_m]
        };
        // 4 m/s before, 4 to 8 m/s over a minute, then from west to south, both ends 8 m/s.
        let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
        assert!(near(between(-10.0, 0.0), [40.0, 0.0]));
        assert!(near(between(0.0, 60.0), [360.0, 0.0]));
        assert!(near(between(0.0, 30.0), [150.0, 0.0]));
        assert!(near(between(60.0, 120.0), [240.0, 240.0]));
        assert!(near(between(120.0, 130.0), [0.0, 80.0]));
    }

    #[test]
    fn westerly_blows_east() {
        let wind = WindVector::from_speed_and_direction(7.0, 270.0);
        assert!((wind.east_m_s - 7.0).abs() < 1e-12 && wind.north_m_s.abs() < 1e-12);
        assert!((wind.from_deg() - 270.0).abs() < 1e-9);
        assert_eq!(towards_deg(270.0), 90.0);
    }

    #[test]
    fn power_law() {
        // 4 m/s at 10 m with p = 1/7 is 4 * 10^(1/7) = 5.5580 m/s at 100 m.
        let profile = WindProfile::new(4.0, 10.0, 0.0, 1.0 / 7.0).unwrap();
        assert!((profile.speed_at_m_s(100.0) - 5.557_98).abs() < 1e-4);
        assert_eq!(profile.speed_at_m_s(10.0), 4.0);
    }

    #[test]
    fn a_turn_is_clockwise_and_keeps_the_speed() {
        let profile = WindProfile::new(4.0, 10.0, 350.0, 0.2).unwrap();
        assert_eq!(profile.turned(20.0).from_deg(), 10.0);
        assert_eq!(
            profile.turned(20.0).speed_at_m_s(90.0),
            profile.speed_at_m_s(90.0)
        );
        assert_eq!(profile.turned(f64::NAN), profile);
    }

    #[test]
    fn series_interpolates_through_north() {
        let series = WindSeries::new(&[(0.0, 5.0, 350.0), (10.0, 5.0, 10.0)]).unwrap();
        let from = series.at(5.0).from_deg();
        assert!(!(0.001..=359.999).contains(&from), "{from}");
        assert_eq!(series.at(-5.0), series.at(0.0));
        assert_eq!(series.at(99.0), series.at(10.0));
    }

    #[test]
    fn a_newer_series_stands_from_its_first_row_on() {
        let old = WindSeries::new(&[(-600.0, 4.0, 270.0), (0.0, 5.0, 270.0), (600.0, 9.0, 270.0)])
            .unwrap();
        let newer = WindSeries::new(&[(300.0, 6.0, 180.0), (900.0, 6.0, 180.0)]).unwrap();
        let now = old.followed_by(&newer);
        assert_eq!(now.rows().len(), 4);
        assert_eq!(now.at(-600.0), old.at(-600.0));
        assert_eq!(now.at(600.0), newer.at(600.0));
        // Half of 5 m/s from west and half of 6 m/s from south: hypot(2.5, 3) m/s.
        assert!((now.at(150.0).speed_m_s() - 2.5_f64.hypot(3.0)).abs() < 1e-9);
        assert_eq!(old.followed_by(&old), old);
    }

    #[test]
    fn bad_series_is_refused() {
        assert!(WindSeries::new(&[]).is_err());
        assert!(WindSeries::new(&[(1.0, 5.0, 0.0), (1.0, 5.0, 0.0)]).is_err());
        assert!(WindSeries::new(&[(1.0, -5.0, 0.0)]).is_err());
    }
}
