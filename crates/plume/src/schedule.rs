//! A source whose emission changes over time as somebody has written it down: a release by a schedule, or a
//! measured rate.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::PlumeError;

/// What holds between two rows of a schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// A row holds until the next.
    #[default]
    Steps,
    /// The straight line to the next.
    Linear,
}

/// Emission over time as a factor on a source's emission, whose mean over the schedule's own time is 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    time_s: Arc<[f64]>,
    factor: Arc<[f64]>,
    between: Between,
}

impl Schedule {
    /// The schedule of rows of time, s, and emission, kg/s. The first row's holds before it, the last row's after it.
    ///
    /// # Errors
    /// No rows; times that do not grow; an emission that is negative or not finite; none in the mean.
    pub fn new(rows: &[(f64, f64)], between: Between) -> Result<Self, PlumeError> {
        let wrong = |problem: String| PlumeError::Shape {
            what: "emission schedule",
            problem,
        };
        if let Some((k, row)) = rows.iter().enumerate().find(|(_, r)| !is_a_rate(r)) {
            return Err(wrong(format!(
                "row {} has {} kg/s at {} s; expected a finite time and a rate of 0 or more",
                k + 1,
                row.1,
                row.0
            )));
        }
        if let Some(k) = rows.windows(2).position(|w| w[1].0 <= w[0].0) {
            return Err(wrong(format!(
                "row {} at {} s must come after {} s",
                k + 2,
                rows[k + 1].0,
                rows[k].0
            )));
        }
        let mean = mean_kg_s(rows, between);
        if mean.is_nan() || mean <= 0.0 {
            return Err(wrong("the mean emission over its time is zero".to_owned()));
        }
        Ok(Self {
            time_s: rows.iter().map(|r| r.0).collect(),
            factor: rows.iter().map(|r| r.1 / mean).collect(),
            between,
        })
    }

    /// The factor at a time.
    pub fn at(&self, time_s: f64) -> f64 {
        let next = self.time_s.partition_point(|t| *t <= time_s);
        let Some(k) = next.checked_sub(1) else {
            return self.factor[0];
        };
        match (self.between, self.time_s.get(next)) {
            (Between::Linear, Some(end)) => {
                let share = (time_s - self.time_s[k]) / (end - self.time_s[k]);
                self.factor[k] + share * (self.factor[next] - self.factor[k])
            }
            _ => self.factor[k],
        }
    }

    /// The same counted from `zero_s`.
    #[must_use]
    pub fn counted_from(&self, zero_s: f64) -> Self {
        Self {
            time_s: self.time_s.iter().map(|t| t - zero_s).collect(),
            ..self.clone()
        }
    }
}

fn is_a_rate((time_s, kg_s): &(f64, f64)) -> bool {
    time_s.is_finite() && kg_s.is_finite() && *kg_s >= 0.0
}

/// The mean emission of rows of time and emission over the time from the first to the last of them; of one row its own,
/// of none not a number.
pub fn mean_kg_s(rows: &[(f64, f64)], between: Between) -> f64 {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return f64::NAN;
    };
    if rows.len() == 1 {
        return first.1;
    }
    let emitted = rows.windows(2).map(|w| {
        let rate = match between {
            Between::Steps => w[0].1,
            Between::Linear => 0.5 * (w[0].1 + w[1].1),
        };
        rate * (w[1].0 - w[0].0)
    });
    emitted.sum::<f64>() / (last.0 - first.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PlaceColumns;
    use crate::field::tests::spec;
    use crate::field::{DispersionModel, DispersionSpec, Place, Strength};
    use crate::track::{Row, Track};

    const ON_AND_OFF: [(f64, f64); 4] = [(0.0, 8.0), (600.0, 0.0), (1200.0, 4.0), (1800.0, 0.0)];

    #[test]
    fn steps_hold_and_lines_lead_to_the_next() {
        // (8 + 0 + 4) / 3 = 4 kg/s in the mean of half an hour.
        let steps = Schedule::new(&ON_AND_OFF, Between::Steps).unwrap();
        let read: Vec<f64> = [-1.0, 0.0, 599.0, 600.0, 1500.0, 9e9]
            .into_iter()
            .map(|t| steps.at(t))
            .collect();
        assert_eq!(read, [2.0, 2.0, 2.0, 0.0, 1.0, 0.0]);
        // Lines: (4 + 2 + 2) / 3.
        assert!((mean_kg_s(&ON_AND_OFF, Between::Linear) - 8.0 / 3.0).abs() < 1e-12);
        let lines = Schedule::new(&ON_AND_OFF, Between::Linear).unwrap();
        assert!((lines.at(300.0) - 1.5).abs() < 1e-12);
        assert_eq!(steps.counted_from(600.0).at(0.0), 0.0);
    }

    #[test]
    fn what_is_no_schedule_is_refused() {
        let refused =
            |rows: &[(f64, f64)]| Schedule::new(rows, Between::Steps).unwrap_err().to_string();
        assert!(refused(&[]).contains("mean emission over its time is zero"));
        assert!(refused(&[(0.0, 0.0), (1.0, 0.0)]).contains("mean emission over its time is zero"));
        assert!(refused(&[(0.0, 1.0), (0.0, 2.0)]).contains("row 2 at 0 s"));
        assert!(refused(&[(0.0, -1.0)]).contains("row 1 has -1 kg/s"));
    }

    // Air at x left the source x/u before: what is read there is the plume of a steady source times the factor of then,
    // in every way of asking.
    #[test]
    fn a_schedule_comes_with_the_air() {
        let steady = spec(Strength::EmissionKgS(352.0));
        let mut scheduled = steady.clone();
        scheduled.sources[0].schedule = Some(Schedule::new(&ON_AND_OFF, Between::Steps).unwrap());
        let [steady, scheduled] =
            [steady, scheduled].map(|s: DispersionSpec| DispersionModel::new(s).unwrap());
        let source = &steady.spec().sources[0];
        let towards_deg = air::wind::towards_deg(steady.spec().wind.from_deg());
        let speed = steady
            .spec()
            .wind
            .speed_at_m_s(source.effective_height_agl_m);
        let at = source.place.displaced(towards_deg, 1400.0);
        let place = Place {
            east_m: at.east_m,
            north_m: at.north_m,
            height_agl_m: source.effective_height_agl_m,
        };
        let delay_s = 1400.0 / speed;
        let after_s = [-5.0, 300.0, 595.0, 605.0, 900.0, 1300.0];
        let times = after_s.map(|s| delay_s + s);
        let factors = [2.0, 2.0, 2.0, 0.0, 0.0, 1.0];
        let names = ["a".to_owned()];
        let rows: Vec<Row> = times
            .iter()
            .map(|t| Row {
                platform: 0,
                time_s: *t,
                place,
                wind: None,
                air: crate::effects::SensorAir::UNKNOWN,
            })
            .collect();
        let mut along = [0.0; 6];
        Track::new(&scheduled, &names, &rows)
            .unwrap()
            .predict(&scheduled, &mut along);
        let slow = air::wind::WindSeries::constant(
            steady
                .spec()
                .wind
                .at(steady.spec().wind.reference_height_agl_m()),
        );
        for ((time_s, factor), along) in times.into_iter().zip(factors).zip(along) {
            let background = steady.background_ppm(&place, time_s);
            let expected = background + factor * (steady.mean_ppm(&place, time_s) - background);
            let is = |read: f64, what: &str| {
                assert!(
                    (read - expected).abs() < 1e-6 * expected,
                    "{what} {time_s}: {read} {expected}"
                )
            };
            is(scheduled.mean_ppm(&place, time_s), "place");
            is(along, "track");
            let mut map = Vec::new();
            let columns = PlaceColumns {
                east_m: &[place.east_m],
                north_m: &[place.north_m],
                height_agl_m: &[place.height_agl_m],
            };
            scheduled.fill_mean_ppm(columns, time_s, &mut map).unwrap();
            is(map[0], "map");
            // Puffs are long: far from an edge only.
            if (time_s - delay_s).rem_euclid(600.0) < 50.0
                || (time_s - delay_s).rem_euclid(600.0) > 550.0
            {
                continue;
            }
            let by_puffs = |model: &DispersionModel| {
                let puffs = model.puffs(&slow, 0.0, None, time_s);
                model.ppm_among(&puffs, &place)
            };
            let puffs = background + factor * (by_puffs(&steady) - background);
            assert!(
                (by_puffs(&scheduled) - puffs).abs() < 0.02 * puffs,
                "puffs {time_s}"
            );
        }
    }
}
