//! The wind that carried the plume: a log is noisy, but the wind it shows may also really change.

use ::plume::field::{LEAST_TRANSPORT_M_S, Transport};
use ::plume::track::Track;
use infer::{AXIS_DRIFT, FittedSet, ForwardModel, InferError, Question};

use super::catalogue;
use super::data::{Data, Setup, summand};
use super::elsewhere;
use super::model::{DriftResponse, PlumeModel, Scale};

/// What of a log carries the plume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Carried {
    /// The mean within this time before and after each row, s.
    About(f64),
    /// That of the way that the air took from the source, the log averaged over this time before and
    /// after, s.
    OnItsWay(f64),
}

/// What is tried: as it is logged, over the noise of a vane, over gusts, over minutes, over the time of a mean, over the whole
/// record, and on the air's way.
const TRIED: [Carried; 10] = [
    Carried::About(0.0),
    Carried::About(4.0),
    Carried::About(12.0),
    Carried::About(30.0),
    Carried::About(120.0),
    Carried::About(600.0),
    Carried::About(f64::INFINITY),
    Carried::OnItsWay(0.0),
    Carried::OnItsWay(30.0),
    Carried::OnItsWay(120.0),
];
/// The same where little time is to be had.
const TRIED_IN_FLIGHT: [Carried; 4] = [
    Carried::About(30.0),
    Carried::About(120.0),
    Carried::About(f64::INFINITY),
    Carried::OnItsWay(30.0),
];
/// Before the log begins the wind was as in this time of it, s.
const BEGINNING_S: f64 = 60.0;
/// Steps of the air's way back to the source, s, and the most of them: an hour.
const STEP_S: f64 = 4.0;
const MOST_STEPS: usize = 900;
/// The air has come back when it is this near, m.
const ARRIVED_M: f64 = 1.0;
/// The speed at which air left the source is the mean over this before and after, s: longer than one
/// anemometer's noise.
const DILUTED_OVER_S: f64 = 12.0;

/// The wind of a log in the order of time, all platforms together: means over what lies next to each
/// time.
struct History {
    time_s: Vec<f64>,
    /// Sums of east and north, in m/s, of speed and of the number of rows before each.
    sums: Vec<[f64; 4]>,
}

impl History {
    fn of(data: &Data) -> Self {
        let (track, times) = (&data.track, data.track.time_s());
        let mut order: Vec<usize> = (0..track.len())
            .filter(|i| data.wind[*i].is_some())
            .collect();
        order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
        let mut sums = vec![[0.0; 4]];
        for &i in &order {
            let own = summand(&track.transport()[i]);
            let last = sums[sums.len() - 1];
            sums.push(std::array::from_fn(|k| last[k] + own[k]));
        }
        Self {
            time_s: order.iter().map(|i| times[*i]).collect(),
            sums,
        }
    }

    /// Means of east, north and speed from `from_s` to `to_s`, m/s; of the row before where there is none,
    /// and of the record's beginning before it.
    fn mean(&self, from_s: f64, to_s: f64) -> [f64; 3] {
        let begins_s = self.time_s.first().filter(|t| from_s < **t);
        let to_s = begins_s.map_or(to_s, |t| to_s.max(t + BEGINNING_S));
        let end = self.time_s.partition_point(|t| *t <= to_s).max(1);
        let first = self.time_s.partition_point(|t| *t < from_s).min(end - 1);
        let [east, north, speed, count] =
            std::array::from_fn(|k| self.sums[end][k] - self.sums[first][k]);
        [east, north, speed].map(|sum| sum / count)
    }

    /// The wind that is the mean of what was logged from `half_s` before a time to `half_s` after it.
    fn about(&self, time_s: f64, half_s: f64) -> Option<Transport> {
        let [east, north, speed_m_s] = self.mean(time_s - half_s, time_s + half_s);
        Transport::towards(east, north, speed_m_s)
    }

    /// The wind that carried air from a source `far_m` away to where it is at `time_s`: towards where it
    /// has come from there, with the speed at which it left, which says how much of the emission is in a
    /// metre of the plume. The log is averaged over `half_s` before and after.
    fn on_its_way(&self, time_s: f64, far_m: f64, half_s: f64) -> Option<Transport> {
        let (mut east_m, mut north_m, mut left_s) = (0.0, 0.0, time_s);
        for _ in 0..MOST_STEPS {
            let [east, north, speed] = self.mean(left_s - STEP_S - half_s, left_s + half_s);
            let step_s =
                STEP_S.min((far_m - f64::hypot(east_m, north_m)) / speed.max(LEAST_TRANSPORT_M_S));
            east_m += step_s * east;
            north_m += step_s * north;
            left_s -= step_s;
            if far_m - f64::hypot(east_m, north_m) < ARRIVED_M {
                break;
            }
        }
        let half_s = half_s.max(DILUTED_OVER_S);
        let [_, _, speed_m_s] = self.mean(left_s - half_s, left_s + half_s);
        Transport::towards(east_m, north_m, speed_m_s)
    }
}

/// What of a log carries the plume where the base fits its readings best; none without a log.
pub(crate) fn chosen(
    setup: &Setup,
    data: &Data,
    question: &Question<'_>,
    scale: Scale,
    in_flight: bool,
) -> Result<Option<Carried>, InferError> {
    if !data.on_board_wind {
        return Ok(None);
    }
    // Where the readings lie elsewhere, a plume that is turned there tells which wind carried it.
    let still = PlumeModel::of(setup, &data.track, scale);
    let prior: Vec<f64> = still.priors().iter().map(|p| p.mean).collect();
    let contact = question.contact(&still, &prior)?;
    let aim_deg = contact.filter(elsewhere).map(|c| c.turn_deg.value);
    let tried = if in_flight {
        &TRIED_IN_FLIGHT[..]
    } else {
        &TRIED
    };
    // Sensors at rest see the plume only as the wind turns: its mean over a record says nothing of that.
    let is_possible = |c: &Carried| data.rest.is_none() || *c != Carried::About(f64::INFINITY);
    let tried: Vec<Carried> = tried.iter().copied().filter(is_possible).collect();
    let evidences = infer::parallel_map(&tried, |carried| {
        let track = carrying(setup, data, Some(*carried));
        let model = PlumeModel::of(setup, &track, scale);
        let model = aim_deg.map_or_else(
            || model.clone(),
            |deg| model.aimed(&catalogue::aimed(deg, scale).part, deg),
        );
        question.quick(&model)
    });
    let mut best: Option<(f64, Carried)> = None;
    for (carried, evidence) in tried.iter().zip(evidences) {
        let evidence = evidence?;
        if best.is_none_or(|b| evidence > b.0) {
            best = Some((evidence, *carried));
        }
    }
    Ok(best.map(|b| b.1))
}

/// The base, and how its plume follows an axis drift that no log shows: as air does where the logged wind is
/// seen to carry it so; else as the readings are explained best. In flight, where little time is to be had,
/// all of it turns at once unless they ask for an axis drift.
pub(crate) fn swinging<'a>(
    question: &Question<'_>,
    model: &PlumeModel<'a>,
    carried: Option<Carried>,
    in_flight: bool,
) -> Result<(FittedSet<PlumeModel<'a>>, DriftResponse), InferError> {
    let base = |axis_drift| question.base(&model.clone().following(axis_drift));
    if in_flight && !matches!(carried, Some(Carried::OnItsWay(_))) {
        let at_once = base(DriftResponse::AtOnce)?;
        let drifts = &at_once.likeliest_sizes()[AXIS_DRIFT..];
        if drifts.iter().all(|size| *size == 0.0) {
            return Ok((at_once, DriftResponse::AtOnce));
        }
    }
    let possible = match carried {
        Some(Carried::OnItsWay(_)) => &[DriftResponse::Carried][..],
        _ => &[DriftResponse::AtOnce, DriftResponse::Carried],
    };
    let found = infer::parallel_map(possible, |axis_drift| Ok((base(*axis_drift)?, *axis_drift)));
    let found = found.into_iter().collect::<Result<Vec<_>, InferError>>()?;
    let best = found
        .into_iter()
        .max_by(|a, b| a.0.ln_evidence().total_cmp(&b.0.ln_evidence()));
    best.ok_or(InferError::NoPosterior)
}

/// The track of `data` in what of its log carries the plume; in the scenario's wind where that is
/// none.
pub(crate) fn carrying(setup: &Setup, data: &Data, carried: Option<Carried>) -> Track {
    match carried {
        None | Some(Carried::About(0.0)) => data.track.clone(),
        Some(carried) => {
            let history = History::of(data);
            let source = setup.base.sources[0].place;
            let mut track = data.track.clone();
            track.carry(&mut |place, time_s, own| {
                let far_m = (place.east_m - source.east_m).hypot(place.north_m - source.north_m);
                let wind = match carried {
                    Carried::About(half_s) => history.about(time_s, half_s),
                    Carried::OnItsWay(half_s) => history.on_its_way(time_s, far_m, half_s),
                };
                wind.unwrap_or(own)
            });
            track
        }
    }
}

/// A wind in words.
pub(crate) fn describe(carried: Option<Carried>) -> String {
    match carried {
        None => "the scenario's wind".to_string(),
        Some(Carried::About(0.0)) => "the logged wind of each row".to_string(),
        Some(Carried::About(s)) if s.is_finite() => {
            format!("the logged wind, averaged over {s:.0} s before and after each row")
        }
        Some(Carried::About(_)) => "the mean of the logged wind".to_string(),
        Some(Carried::OnItsWay(s)) => {
            format!(
                "the logged wind on the air's way from the source, averaged over {s:.0} s before and after"
            )
        }
    }
}
