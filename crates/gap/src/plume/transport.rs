//! Which wind carries the plume: the scenario's, or the logged one, smoothed; at once or by its
//! history.
//!
//! Logged wind is noisy and local, and a plume at a distance remembers the wind of the minutes
//! before. Several treatments are made; the data choose among them ([`super::start`]).

use ::plume::WindHistory;
use ::plume::field::{DispersionModel, Transport};
use ::plume::track::Track;

use super::data::Data;
use super::shown::Shown;
use super::wind_series::{Grid, Line, towards};

/// How the wind becomes that of the transport.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Treatment {
    /// The scenario's, where none is logged.
    Scenario,
    /// The same; puffs that it carries, which reach along the wind too.
    ScenarioPuffs,
    /// The scenario's, turned as the plume itself shows ([`super::shown`]), in the mean over its way.
    Shown,
    /// The same; puffs that its history carries.
    ShownPuffs,
    /// The straight line in time through all logs. What the log drifts by stays in it: a wind that
    /// hardly turns must not hide that its log does.
    Line,
    /// Each platform's own log, smoothed over this time, s.
    Own(f64),
    /// All logs together, smoothed over this time, s.
    Pooled(f64),
    /// The same, and the plume as dilute as the wind of the moment makes it, also where its
    /// strength is stated as a concentration.
    Diluted(f64),
    /// All logs together, smoothed over this time, s; puffs that their history carries.
    Puffs(f64),
    /// The same; puffs that grow with the time that they have been under way, not with their path.
    AgedPuffs(f64),
}

impl Treatment {
    /// The treatments that are tried where no wind is logged …
    pub const UNLOGGED: [Treatment; 2] = [Treatment::Scenario, Treatment::ScenarioPuffs];
    /// … and where one is.
    pub const LOGGED: [Treatment; 13] = [
        Treatment::Line,
        Treatment::Pooled(3.0),
        Treatment::Pooled(8.0),
        Treatment::Pooled(25.0),
        Treatment::Pooled(80.0),
        Treatment::Diluted(8.0),
        Treatment::Diluted(25.0),
        Treatment::Own(20.0),
        Treatment::Puffs(8.0),
        Treatment::Puffs(40.0),
        Treatment::Puffs(120.0),
        Treatment::AgedPuffs(8.0),
        Treatment::AgedPuffs(40.0),
    ];

    /// The one in which the plume is looked for first, where there is a log.
    pub const FIRST: Treatment = Treatment::Pooled(25.0);

    /// Log of its prior against the others, nats: air far away does not turn at once; where the
    /// log is noisy a wind that hardly turns may still fit by chance; and spread is stated by
    /// distance.
    pub fn ln_prior(self) -> f64 {
        match self {
            Treatment::Line => -8.0,
            Treatment::Pooled(s) if s > 50.0 => -4.0,
            Treatment::AgedPuffs(_) => -4.0,
            _ => 0.0,
        }
    }

    /// In words.
    pub fn describe(self) -> String {
        match self {
            Treatment::Scenario => "the scenario's wind".to_string(),
            Treatment::ScenarioPuffs => "the scenario's wind, as puffs".to_string(),
            Treatment::Shown => "the scenario's wind, turned as the plume itself shows".to_string(),
            Treatment::ShownPuffs => format!("{}, as puffs", Treatment::Shown.describe()),
            Treatment::Line => {
                "the straight line through the logged wind of all platforms".to_string()
            }
            Treatment::Own(s) => format!("each platform's logged wind, smoothed over {s:.0} s"),
            Treatment::Pooled(s) => {
                format!("the logged wind of all platforms together, smoothed over {s:.0} s")
            }
            Treatment::Diluted(s) => format!(
                "the logged wind of all platforms together, smoothed over {s:.0} s, and diluted \
                 by its speed of the moment"
            ),
            Treatment::Puffs(s) => format!(
                "the history of the logged wind of all platforms, smoothed over {s:.0} s, which \
                 took the plume's puffs to where they are"
            ),
            Treatment::AgedPuffs(s) => format!(
                "{}, grown with the time that they took",
                Treatment::Puffs(s).describe()
            ),
        }
    }
}

/// The transport of every row, and what it does to the plume's strength.
#[derive(Clone)]
pub(crate) struct Carried {
    pub transport: Vec<Transport>,
    pub treatment: Treatment,
    /// Standard deviation of what gusts may have made of the direction's trend, degrees an hour.
    pub chance_deg_per_h: f64,
    /// Standard deviation of a swing that nobody logged and that the plume shows, degrees.
    pub shown_swing_deg: Option<f64>,
    /// Mean logged speed over the scenario's, where a c_MAX cannot have been met in the latter.
    stronger: f64,
    history: Option<WindHistory>,
}

impl Carried {
    /// The scenario's wind, which stands in `data`, turned as a plume shows: as it carries a straight
    /// plume and as it carries puffs.
    pub fn shown(data: &Data, distance_m: &[f64], shown: &Shown) -> Vec<Self> {
        let Some(stated) = data.track.transport().first() else {
            return Vec::new();
        };
        let turned = &shown.turned_deg;
        let wind = |[deg]: [f64; 1]| {
            let wind = stated.turned(deg);
            [wind.east, wind.north].map(|c| c * wind.speed_m_s)
        };
        let winds: Vec<[f64; 2]> = turned.each_second().map(wind).collect();
        let history = WindHistory::new(turned.start_s, 1.0, &winds);
        let times = data.track.time_s();
        let mean = |i: usize| history.mean_transport(times[i], distance_m[i]);
        let transport: Vec<Transport> = (0..data.len()).map(mean).collect();
        let with = |treatment, history| Self {
            transport: transport.clone(),
            treatment,
            chance_deg_per_h: 0.0,
            shown_swing_deg: Some(shown.swing_deg),
            stronger: 1.0,
            history,
        };
        let straight = with(Treatment::Shown, None);
        vec![straight, with(Treatment::ShownPuffs, Some(history))]
    }

    /// Whether puffs are carried by the wind's history.
    pub fn has_history(&self) -> bool {
        self.history.is_some()
    }

    /// Puts the transport into `track`, and what it makes of the straight plumes of `world`.
    pub fn put(&self, track: &mut Track, world: &DispersionModel) {
        track.transport_mut().copy_from_slice(&self.transport);
        for (factor, wind) in track.plume_factor_mut().iter_mut().zip(&self.transport) {
            *factor = match self.treatment {
                Treatment::Diluted(_) => self.stronger * world.dilution_of_moment(*wind),
                Treatment::Puffs(_) | Treatment::AgedPuffs(_) => self.stronger,
                _ => 1.0,
            };
        }
        match &self.history {
            Some(history) => {
                track.set_puff_ratios(world.plume_count(), |plume, place, time_s, wind| {
                    world.puffs_over_plume(history, plume, place, time_s, wind)
                });
            }
            None => track.set_puff_ratios(0, |_, _, _, _| 1.0),
        }
    }
}

/// Logarithm of the ratio beyond which the logged speed is another than the scenario's.
const OTHER_WIND_LN: f64 = 0.15;

/// How far back a plume's way may begin before the record, s.
const LEAD_S: f64 = 1200.0;

/// The least surge with which puffs that grow with time are others than those that grow with their
/// path.
const LEAST_SURGE: f64 = 0.01;

/// The transport of every row under `treatment`; `None` without the wind that it needs, or where
/// another treatment is the same.
/// `distance_m` is each row's distance from the first source.
pub(crate) fn carried(data: &Data, distance_m: &[f64], treatment: Treatment) -> Option<Carried> {
    let times = data.track.time_s();
    let vector = |i: usize| data.logged_wind(i);
    let span = data.span_s();
    let all = || Grid::new((0..data.len()).filter_map(vector), span);
    let mut history = None;
    let mut chance_deg_per_h = 0.0;
    let transport = match treatment {
        Treatment::Scenario => data.track.transport().to_vec(),
        // These hang on the plume, too ([`Carried::shown`]).
        Treatment::Shown | Treatment::ShownPuffs => return None,
        Treatment::ScenarioPuffs => {
            let own = data.track.transport().to_vec();
            let steady = own.first()?;
            let wind = [steady.east, steady.north].map(|c| c * steady.speed_m_s);
            history = Some(WindHistory::new(span.0, 1.0, &[wind]));
            own
        }
        Treatment::Line => {
            let samples: Vec<_> = (0..data.len()).filter_map(vector).collect();
            let line = Line::through(samples.iter().copied())?;
            chance_deg_per_h = line.chance_deg_per_h(&samples);
            times.iter().map(|t| towards(line.at(*t))).collect()
        }
        Treatment::Pooled(width) | Treatment::Diluted(width) => {
            let mut grid = all()?;
            grid.smooth(width);
            times.iter().map(|t| towards(grid.at(*t))).collect()
        }
        Treatment::Own(width) => {
            let mut out = Vec::with_capacity(data.len());
            for range in data.ranges() {
                let own = Grid::new(range.clone().filter_map(vector), span);
                let mut grid = own.or_else(all)?;
                grid.smooth(width);
                out.extend(range.clone().map(|i| towards(grid.at(times[i]))));
            }
            out
        }
        Treatment::Puffs(width) | Treatment::AgedPuffs(width) => {
            let mut grid = all()?;
            grid.smooth(width);
            grid.lead_in(LEAD_S);
            let own = WindHistory::new(grid.start_s, grid.step_s, &grid.values);
            let mean = |i: usize| own.mean_transport(times[i], distance_m[i]);
            let out: Vec<Transport> = (0..data.len()).map(mean).collect();
            history = Some(match treatment {
                Treatment::AgedPuffs(_) if surge(&out) < LEAST_SURGE => return None,
                Treatment::AgedPuffs(_) => own.growing_with_time(),
                _ => own,
            });
            out
        }
    };
    Some(Carried {
        stronger: stronger_than_stated(data, &transport),
        transport,
        treatment,
        chance_deg_per_h,
        shown_swing_deg: None,
        history,
    })
}

/// By how much the speed of the ways differs from row to row: standard deviation over the mean.
fn surge(ways: &[Transport]) -> f64 {
    let n = ways.len().max(1) as f64;
    let mean = ways.iter().map(|t| t.speed_m_s).sum::<f64>() / n;
    let square = ways
        .iter()
        .map(|t| (t.speed_m_s - mean).powi(2))
        .sum::<f64>()
        / n;
    square.sqrt() / mean.max(1e-9)
}

/// How much more the wind blows in the mean than the scenario's, where its source is stated by a
/// c_MAX and that is so much that it cannot be the wind of that: then c_MAX is taken to hold in the
/// wind that was logged. One elsewhere.
fn stronger_than_stated(data: &Data, transport: &[Transport]) -> f64 {
    let Some(stated_m_s) = data.c_max_wind_m_s else {
        return 1.0;
    };
    let sum: f64 = transport.iter().map(|t| t.speed_m_s).sum();
    let ratio = sum / transport.len().max(1) as f64 / stated_m_s;
    if ratio.is_finite() && ratio.ln().abs() > OTHER_WIND_LN {
        ratio
    } else {
        1.0
    }
}
