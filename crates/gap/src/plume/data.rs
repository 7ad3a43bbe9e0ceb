//! Observations in the order and frame that the forward model wants.

use std::ops::Range;

use ::plume::effects::Ambient;
use ::plume::field::{Place, World, WorldSpec};
use ::plume::mechanism::MechanismId;
use ::plume::track::{Row, Track};
use air::geo::{Enu, Geodetic, LocalFrame};
use scenario::Scenario;
use scenario::observations::{Observation, Observations};
use scenario::uncertain::Uncertain;

use crate::GapError;

/// How well logged heights are known, m: where a track touches a lid, one reading would otherwise
/// tell the lid's height exactly.
const HEIGHT_SD_M: f64 = 1.0;

/// What the scenario says about one parameter of the base that it marks uncertain.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Dotted key of the scenario.
    pub key: String,
    /// The mechanism that moves it.
    pub id: MechanismId,
    /// The scenario's value, in the key's unit.
    pub value: f64,
    /// One standard deviation, in the key's unit.
    pub sd: f64,
}

/// The base model: what a scenario says, and how sure it is.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The scenario's world.
    pub base: WorldSpec,
    /// The scenario's local frame.
    pub frame: LocalFrame,
    /// What it marks uncertain.
    pub priors: Vec<Prior>,
}

impl Setup {
    /// The base of a scenario.
    ///
    /// # Errors
    /// A world that the plume model refuses.
    pub fn new(scenario: &Scenario) -> Result<Self, GapError> {
        let wrong = |e: scenario::world::WorldError| GapError::Data {
            what: "scenario".to_string(),
            problem: e.to_string(),
            expected: "a world that the plume model can run".to_string(),
        };
        let frame = scenario.frame().map_err(wrong)?;
        let mut base = scenario.world_spec().map_err(wrong)?;
        let mut priors = Vec::new();
        for which in Uncertain::ALL {
            if let Some(sd) = scenario.prior_sd(which) {
                priors.extend(prior(&base, which, sd));
            }
        }
        // An uncertain time constant is fitted as a whole, from none.
        if priors.iter().any(|p| p.id == MechanismId::SensorLag) {
            base.sensor.time_constant_s = 0.0;
        }
        base.lid_edge_m = HEIGHT_SD_M;
        Ok(Self {
            base,
            frame,
            priors,
        })
    }

    /// Time constant of the sensors as the scenario has it, s.
    pub(crate) fn time_constant_s(&self) -> f64 {
        let prior = self.priors.iter().find(|p| p.id == MechanismId::SensorLag);
        prior.map_or(self.base.sensor.time_constant_s, |p| p.value)
    }
}

fn prior(base: &WorldSpec, which: Uncertain, sd: f64) -> Option<Prior> {
    use ::plume::field::Strength;
    use MechanismId as M;
    let (id, value) = match which {
        Uncertain::WindSpeed => (M::WindSpeedScale, base.wind.reference_speed_m_s()),
        Uncertain::WindFrom => (M::WindDirectionOffset, base.wind.from_deg()),
        Uncertain::EffectiveHeight => (
            M::EffectiveHeightOffset,
            base.sources.first()?.effective_height_agl_m,
        ),
        Uncertain::Emission | Uncertain::CMax => {
            let value = match base.sources.first()?.strength {
                Strength::EmissionKgS(q) if which == Uncertain::Emission => q,
                Strength::CMax { excess_ppm, .. } if which == Uncertain::CMax => excess_ppm,
                _ => return None,
            };
            (M::EmissionScale, value)
        }
        Uncertain::Background => (M::BackgroundOffset, base.background_ppm),
        Uncertain::SigmaYScale => (M::SigmaYScale, base.sigma_y_scale),
        Uncertain::SigmaZScale => (M::SigmaZScale, base.sigma_z_scale),
        Uncertain::SensorTimeConstant => (M::SensorLag, base.sensor.time_constant_s),
        Uncertain::SensorOffset => (M::SensorOffset, base.sensor.offset_ppm),
        Uncertain::SensorGain => (M::SensorGain, base.sensor.gain),
    };
    Some(Prior {
        key: which.key().to_string(),
        id,
        value,
        sd,
    })
}

/// Observations as columns, platform by platform.
#[derive(Debug, Clone)]
pub(crate) struct Data {
    pub track: Track,
    /// Readings, ppm; not a number where missing.
    pub reading_ppm: Vec<f64>,
    /// Rows that the fit uses.
    pub used: Vec<bool>,
    /// Stated white noise, ppm; not a number where not stated.
    pub sd_ppm: Vec<f64>,
    /// Logged wind (speed m/s, from degrees) where there is one.
    pub wind: Vec<Option<(f64, f64)>>,
    pub notices: Vec<String>,
    /// Rows whose readings were clipped, and at what, ppm.
    pub ceiling_ppm: Vec<(Range<usize>, f64)>,
    /// Whether most rows have a logged wind.
    pub on_board_wind: bool,
}

impl Data {
    /// Rows of `observations` in the frame of `setup`; rows without place are left out.
    pub fn new(setup: &Setup, observations: &Observations) -> Result<Self, GapError> {
        let mut notices = observations.notices.clone();
        let mut order: Vec<&Observation> = observations.rows.iter().collect();
        order.sort_by(|a, b| {
            a.platform
                .cmp(&b.platform)
                .then(a.time_s.total_cmp(&b.time_s))
        });
        let before = order.len();
        order.dedup_by(|b, a| a.platform == b.platform && a.time_s == b.time_s);
        if order.len() < before {
            notices.push(format!(
                "{} rows repeat a time of their platform and were left out",
                before - order.len()
            ));
        }
        if order.is_empty() {
            return Err(nothing("no rows"));
        }
        let rows: Vec<Row> = order.iter().map(|o| row(setup, o)).collect();
        if order.iter().all(|o| o.co2_ppm.is_none()) {
            return Err(nothing("all readings (co2_ppm) are missing"));
        }
        let world = World::new(setup.base.clone())?;
        let track = Track::new(&world, &observations.platforms, &rows)?;
        let wind: Vec<_> = rows.iter().map(|r| r.wind).collect();
        if wind.iter().all(Option::is_none) {
            notices
                .push("no wind columns: the scenario's wind stands for the whole time".to_string());
        }
        let reading_ppm: Vec<f64> = order
            .iter()
            .map(|o| o.co2_ppm.unwrap_or(f64::NAN))
            .collect();
        let on_board_wind = 2 * wind.iter().flatten().count() > wind.len();
        Ok(Self {
            on_board_wind,
            used: reading_ppm.iter().map(|c| c.is_finite()).collect(),
            sd_ppm: order.iter().map(|o| o.sd_ppm.unwrap_or(f64::NAN)).collect(),
            reading_ppm,
            track,
            wind,
            notices,
            ceiling_ppm: Vec::new(),
        })
    }

    pub fn len(&self) -> usize {
        self.reading_ppm.len()
    }

    pub fn used_count(&self) -> usize {
        self.used.iter().filter(|u| **u).count()
    }

    pub fn ranges(&self) -> &[Range<usize>] {
        self.track.ranges()
    }

    pub fn platform_of(&self, row: usize) -> usize {
        self.ranges()
            .iter()
            .position(|r| r.contains(&row))
            .unwrap_or(0)
    }

    /// Time that air takes from a place to that of every row in the row's transport, s.
    pub fn way_s(&self, from: Enu) -> impl Iterator<Item = f64> {
        let transport = self.track.transport().iter();
        self.distance_m(from)
            .zip(transport)
            .map(|(far, wind)| far / wind.speed_m_s.max(0.5))
    }

    /// Mean age, at every row, of the logged wind that carried the air from a place, s. Of the part
    /// of the way that lies before the record nothing is logged that could be off: what the log is
    /// off by there is taken to be what it is off by at the record's beginning.
    pub fn logged_age_s(&self, from: Enu) -> impl Iterator<Item = f64> {
        let (start_s, _) = self.span_s();
        let times = self.track.time_s();
        self.way_s(from).zip(times).map(move |(way_s, time_s)| {
            let logged_s = way_s.min(time_s - start_s);
            (way_s - 0.5 * logged_s) * logged_s / way_s.max(1e-9)
        })
    }

    /// Horizontal distance of every row from a place, m.
    pub fn distance_m(&self, from: Enu) -> impl Iterator<Item = f64> {
        (0..self.len()).map(move |i| {
            let p = self.track.place(i);
            (p.east_m - from.east_m).hypot(p.north_m - from.north_m)
        })
    }

    /// First and last time of all rows, s.
    pub fn span_s(&self) -> (f64, f64) {
        let times = self.track.time_s();
        let low = times.iter().copied().fold(f64::INFINITY, f64::min);
        let high = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (low, high)
    }

    /// Measured minus `predicted`, zero where not used.
    pub fn residual(&self, predicted: &[f64]) -> Vec<f64> {
        (0..self.len())
            .map(|i| {
                if self.used[i] {
                    self.reading_ppm[i] - predicted[i]
                } else {
                    0.0
                }
            })
            .collect()
    }
}

fn nothing(problem: &str) -> GapError {
    GapError::Data {
        what: "observations".to_string(),
        problem: problem.to_string(),
        expected: "rows with time_s, platform, lat_deg, lon_deg, alt_amsl_m and co2_ppm"
            .to_string(),
    }
}

fn row(setup: &Setup, o: &Observation) -> Row {
    let at = setup.frame.to_enu(Geodetic {
        lat_deg: o.lat_deg,
        lon_deg: o.lon_deg,
    });
    let wind = match (o.wind_speed_m_s, o.wind_from_deg) {
        (Some(speed), Some(from)) => Some((speed, from)),
        _ => None,
    };
    Row {
        platform: o.platform,
        time_s: o.time_s,
        place: Place {
            east_m: at.east_m,
            north_m: at.north_m,
            height_agl_m: o.alt_amsl_m - setup.base.ground_amsl_m,
        },
        wind,
        air: Ambient {
            temperature_c: o.temperature_c.unwrap_or(f64::NAN),
            relative_humidity_pct: o.relative_humidity_pct.unwrap_or(f64::NAN),
            pressure_hpa: o.pressure_hpa.unwrap_or(f64::NAN),
        },
    }
}
