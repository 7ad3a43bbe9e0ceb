//! What is logged beside the readings, wind and air, where it is logged less often than they are.

use ::plume::effects::SensorAir;
use ::plume::track::{Row, Track};
use air::geo::Enu;

/// A row this near in time to a logged wind knows it, s: the smoothing of the log bridges that.
const WIND_KNOWN_S: f64 = 30.0;
/// Part of the rows that must know their wind for it to be followed.
const KNOWN_PART: f64 = 0.3;

/// Where the wind is logged.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum WindLog {
    /// Too rarely to follow it: it is taken from all rows, and the scenario's stands.
    Absent,
    /// Often enough: whether each row knows it.
    Followed(Vec<bool>),
}

/// Where the wind is logged; it is taken from all `rows` where that is too rarely, and a notice says
/// so, or that some rows do not know it.
pub(crate) fn wind_log(rows: &mut [Row], notices: &mut Vec<String>) -> WindLog {
    let logged = rows.iter().filter(|r| r.wind.is_some());
    let mut times_s: Vec<f64> = logged.map(|r| r.time_s).collect();
    times_s.sort_by(f64::total_cmp);
    let knows = |row: &Row| {
        let next = times_s.partition_point(|t| *t < row.time_s);
        let near = |k: usize| {
            let at = times_s.get(k);
            at.is_some_and(|t| (t - row.time_s).abs() <= WIND_KNOWN_S)
        };
        near(next) || next.checked_sub(1).is_some_and(near)
    };
    let known: Vec<bool> = rows.iter().map(knows).collect();
    let count = known.iter().filter(|k| **k).count();
    if count as f64 > KNOWN_PART * rows.len() as f64 {
        if count < rows.len() {
            notices.push(format!(
                "{} readings are ignored: no wind is logged within {WIND_KNOWN_S:.0} s of them",
                rows.len() - count
            ));
        }
        return WindLog::Followed(known);
    }
    notices.push(if times_s.is_empty() {
        "no wind columns: the scenario's wind is used for the whole time".to_string()
    } else {
        format!(
            "the wind is logged in {} rows only, too few to follow it: the scenario's wind is used for the whole \
             time",
            times_s.len()
        )
    });
    rows.iter_mut().for_each(|r| r.wind = None);
    WindLog::Absent
}

/// Standard deviation of the direction on the air's way beyond which no way is straight, degrees: more than in the
/// most unsteady air (25° in class A, US EPA 2000, table 6-8a) by so much that the air may as well have come back.
const STRAIGHT_DEG: f64 = 60.0;
/// Fewest logged winds on a way that tell their scatter.
const FEWEST_ON_WAY: usize = 3;

/// Which rows have air that is on no straight way from `source`: while it was under way, the wind as all platforms log
/// it blew from anywhere.
pub(crate) fn on_no_straight_way(track: &Track, rows: &[Row], source: Enu) -> Vec<bool> {
    let logged = |i: &usize| rows[*i].wind.is_some();
    let mut order: Vec<usize> = (0..rows.len()).filter(logged).collect();
    order.sort_by(|a, b| track.time_s()[*a].total_cmp(&track.time_s()[*b]));
    let times_s: Vec<f64> = order.iter().map(|i| track.time_s()[*i]).collect();
    let mut sums = vec![[0.0; 2]];
    for &i in &order {
        let [east, north] = sums[sums.len() - 1];
        let wind = track.transport()[i];
        sums.push([east + wind.east, north + wind.north]);
    }
    let scatters = |i: usize| {
        let time_s = track.time_s()[i];
        let from = times_s.partition_point(|t| *t < time_s - track.under_way_s(i, source));
        let end = times_s.partition_point(|t| *t <= time_s);
        if end.saturating_sub(from) < FEWEST_ON_WAY {
            return false;
        }
        let [east, north] = [0, 1].map(|k| sums[end][k] - sums[from][k]);
        // Mardia and Jupp (2000), equation 2.3.11: the circular standard deviation.
        let length = east.hypot(north) / (end - from) as f64;
        let sd = (-2.0 * length.clamp(1e-9, 1.0).ln()).sqrt();
        sd.to_degrees() > STRAIGHT_DEG
    };
    (0..rows.len()).map(scatters).collect()
}

/// Fills in the air at rows without it, straight in time between those of the platform that have it
/// and level beyond them: a cross-sensitivity does not come and go with its log.
pub(crate) fn bridge_air(rows: &mut [Row]) {
    let fields: [fn(&mut SensorAir) -> &mut f64; 3] = [
        |air| &mut air.temperature_c,
        |air| &mut air.relative_humidity_pct,
        |air| &mut air.pressure_hpa,
    ];
    for own in rows.chunk_by_mut(|a, b| a.platform == b.platform) {
        for field in fields {
            let known: Vec<(f64, f64)> = own
                .iter_mut()
                .map(|r| (r.time_s, *field(&mut r.air)))
                .filter(|(_, value)| value.is_finite())
                .collect();
            for row in own.iter_mut() {
                let value = field(&mut row.air);
                if !value.is_finite() {
                    *value = between(&known, row.time_s);
                }
            }
        }
    }
}

/// The value at `time_s` on the straight line between its neighbours of `known`, which are in order
/// of time; not a number where nothing is known.
fn between(known: &[(f64, f64)], time_s: f64) -> f64 {
    let next = known.partition_point(|k| k.0 < time_s);
    match (next.checked_sub(1).map(|k| known[k]), known.get(next)) {
        (Some((t0, a)), Some((t1, b))) => a + (b - a) * (time_s - t0) / (t1 - t0),
        (Some((_, level)), None) | (None, Some(&(_, level))) => level,
        (None, None) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::plume::field::Place;

    fn row(time_s: f64, wind: Option<(f64, f64)>, pressure_hpa: f64) -> Row {
        Row {
            platform: 0,
            time_s,
            place: Place {
                east_m: 0.0,
                north_m: 0.0,
                height_agl_m: 100.0,
            },
            wind,
            air: SensorAir {
                pressure_hpa,
                ..SensorAir::UNKNOWN
            },
        }
    }

    #[test]
    fn a_wind_logged_every_second_row_is_followed_and_one_seen_once_is_not() {
        let with = |every: usize| -> Vec<Row> {
            let wind = |k: usize| k.is_multiple_of(every).then_some((5.0, 270.0));
            (0..400).map(|k| row(k as f64, wind(k), 1000.0)).collect()
        };
        let mut notices = Vec::new();
        for every in [1, 2, 20] {
            let all = WindLog::Followed(vec![true; 400]);
            assert_eq!(wind_log(&mut with(every), &mut notices), all);
        }
        assert!(notices.is_empty());
        let mut rows = with(400);
        assert_eq!(wind_log(&mut rows, &mut notices), WindLog::Absent);
        assert!(rows.iter().all(|r| r.wind.is_none()));
        assert!(notices[0].contains("1 rows only"), "{notices:?}");
        // Half of the record: what came later than half a minute after it is not known.
        let mut half = with(1);
        half[200..].iter_mut().for_each(|r| r.wind = None);
        let WindLog::Followed(known) = wind_log(&mut half, &mut notices) else {
            panic!("{notices:?}");
        };
        assert_eq!(known.iter().filter(|k| **k).count(), 230);
        assert!(notices[1].starts_with("170 readings"), "{notices:?}");
    }

    // 600 m in 2 m/s are five minutes: of a wind that turns by 2° a minute they are straight, of one that blows from
    // anywhere they are not, and 60 m still are.
    #[test]
    fn a_way_in_a_wind_from_anywhere_is_not_straight() {
        let text = "[site]\nlat_deg=40\nlon_deg=-105\nground_amsl_m=0\n[weather]\nwind_exponent=0.0\n\
            [[source]]\nlat_deg=40\nlon_deg=-105\nemission_kg_s=1\neffective_height_m=2\n";
        let spec = scenario::Scenario::parse("s", text)
            .unwrap()
            .dispersion_spec()
            .unwrap();
        let source = spec.sources[0].place;
        let model = ::plume::DispersionModel::new(spec).unwrap();
        let told = |far_m: f64, turn_deg: f64| {
            let wind = |k: usize| Some((2.0, turn_deg * k as f64));
            let at = |k: usize| Row {
                place: Place {
                    east_m: far_m,
                    north_m: 0.0,
                    height_agl_m: 2.0,
                },
                ..row(60.0 * k as f64, wind(k), 1000.0)
            };
            let rows: Vec<Row> = (0..100).map(at).collect();
            let track = Track::new(&model, &["a".to_owned()], &rows).unwrap();
            let none = on_no_straight_way(&track, &rows, source);
            none.iter().filter(|n| **n).count()
        };
        assert_eq!([told(600.0, 2.0), told(60.0, 80.0)], [0, 0]);
        assert!(told(600.0, 80.0) > 90);
    }

    #[test]
    fn missing_air_is_bridged() {
        let nan = f64::NAN;
        let pressures = [nan, 1000.0, nan, nan, 994.0, nan];
        let mut rows: Vec<Row> = (0..6).map(|k| row(k as f64, None, pressures[k])).collect();
        bridge_air(&mut rows);
        let filled: Vec<f64> = rows.iter().map(|r| r.air.pressure_hpa).collect();
        assert_eq!(filled, [1000.0, 1000.0, 998.0, 996.0, 994.0, 994.0]);
        assert!(rows.iter().all(|r| r.air.temperature_c.is_nan()));
    }
}
