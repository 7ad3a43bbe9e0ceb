//! Least-squares line through the axis's direction at the crossings of a plume, to distinguish a steady change of the wind from a
//! meander.

use super::peak::AtCrossing;

/// A slope beyond this many standard deviations counts as a change of the wind.
const TURNS_SD: f64 = 3.0;

/// The straight line through the turns of the axis at crossings, by least squares.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    mean_s: f64,
    mean_deg: f64,
    deg_s: f64,
    deg_s_sd: f64,
    /// Number of crossings, and the sum of the squares of the residuals.
    count: f64,
    off_sq_deg2: f64,
}

impl Line {
    pub fn through(crossings: &[AtCrossing]) -> Self {
        let n = crossings.len() as f64;
        let mean = |of: fn(&AtCrossing) -> f64| crossings.iter().map(of).sum::<f64>() / n;
        let (mean_s, mean_deg) = (mean(|c| c.time_s), mean(|c| c.turn_deg));
        let sum = |of: &dyn Fn(&AtCrossing) -> f64| crossings.iter().map(of).sum::<f64>();
        let square = sum(&|c| (c.time_s - mean_s).powi(2)).max(f64::MIN_POSITIVE);
        let deg_s = sum(&|c| (c.time_s - mean_s) * (c.turn_deg - mean_deg)) / square;
        let mut line = Self {
            mean_s,
            mean_deg,
            deg_s,
            deg_s_sd: 0.0,
            count: n,
            off_sq_deg2: 0.0,
        };
        line.off_sq_deg2 = sum(&|c| line.off_deg(c).powi(2));
        line.deg_s_sd = (line.off_sq_deg2 / (n - 2.0).max(1.0) / square).sqrt();
        line
    }

    /// Turn of the line from its mean time to `time_s`, degrees.
    pub fn turned_deg(&self, time_s: f64) -> f64 {
        self.deg_s * (time_s - self.mean_s)
    }

    /// Whether the slope is significant.
    pub fn is_a_turn(&self) -> bool {
        self.deg_s.abs() > TURNS_SD * self.deg_s_sd
    }

    fn off_deg(&self, crossing: &AtCrossing) -> f64 {
        crossing.turn_deg - self.mean_deg - self.turned_deg(crossing.time_s)
    }

    /// Root mean square of the residuals, degrees.
    pub fn rms_off_deg(&self) -> f64 {
        (self.off_sq_deg2 / self.count).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crossings(turns_deg: &[f64]) -> Vec<AtCrossing> {
        let of = |(k, turn_deg): (usize, &f64)| AtCrossing {
            time_s: 60.0 * k as f64,
            turn_deg: *turn_deg,
        };
        turns_deg.iter().enumerate().map(of).collect()
    }

    #[test]
    fn a_steady_turn_is_told_from_a_meander() {
        let meander = [3.0, -2.0, 1.0, -3.0, 2.0, 0.0, -1.0, 2.0];
        let all = crossings(&meander);
        assert!(!Line::through(&all).is_a_turn());
        let turning: Vec<f64> = (0..8).map(|k| meander[k] + 4.0 * k as f64).collect();
        let all = crossings(&turning);
        let line = Line::through(&all);
        assert!(line.is_a_turn());
        assert!((line.turned_deg(420.0) - line.turned_deg(0.0) - 28.0).abs() < 3.0);
    }
}
