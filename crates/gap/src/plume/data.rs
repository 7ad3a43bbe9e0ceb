//! Observations in the order and frame that the forward model wants.

use std::ops::Range;

use ::plume::effects::SensorAir;
use ::plume::field::{DispersionModel, DispersionSpec, Place, Strength, Transport};
use ::plume::mechanism::{Coordinate, Mechanism, MechanismId};
use ::plume::stability::Stability;
use ::plume::track::{Row, Track};
use ::plume::{Gas, Span};
use air::geo::{Enu, Geodetic, LocalFrame};
use infer::InferError;
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations};
use scenario::uncertain::Uncertain;

use super::fixes;
use super::known_noise::KnownNoise;
use super::logged::{self, WindLog};
use super::model::{LEVELS, PlumeModel, Scale, Unknown};
use super::rest::AtRest;
use super::sensor_calibration::{self, HELD};
use crate::GapError;

/// How well logged heights are known, m: where a track touches a lid, one reading would otherwise
/// tell the lid's height exactly.
const HEIGHT_SD_M: f64 = 1.0;

/// So many readings above the end of a sensor's range are strays, and so many standard deviations of its noise are
/// noise.
const STRAY: usize = 2;
const READ_SDS: f64 = 4.0;

/// Smallest standard deviation of a logged wind direction, degrees. A vane can be aligned to north within 1° with care, and an
/// installed one is up to 5° off (US EPA 2000, EPA-454/R-99-005). The prior of a scenario may be narrower, for example after
/// a former flight has corrected it.
const VANE_SD_DEG: f64 = 1.0;

/// Most platforms of one analysis.
const MOST_PLATFORMS: usize = 64;

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

impl Prior {
    /// The same in the coordinate of the catalogue.
    pub(crate) fn unknown(&self) -> Unknown {
        let coordinate = self.id.spec().parameters[0].coordinate;
        let (mean, sd) = match (coordinate, self.id) {
            (Coordinate::Log, _) => (0.0, self.sd / self.value.abs().max(f64::MIN_POSITIVE)),
            (Coordinate::Linear, MechanismId::SensorLag) => (self.value, self.sd),
            (Coordinate::Linear, _) => (0.0, self.sd),
        };
        Unknown {
            id: self.id,
            platform: None,
            setting: None,
            prior: infer::Prior { mean, sd },
        }
    }
}

/// The base model: what a scenario says, and how sure it is.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The scenario's world.
    pub base: DispersionSpec,
    /// The scenario's local frame.
    pub frame: LocalFrame,
    /// What it marks uncertain.
    pub priors: Vec<Prior>,
    /// Stability classes with the times from which they hold, s; the first holds before them too. Empty: the base's own.
    pub classes: Vec<(f64, Stability)>,
    /// Whether the scenario is to be corrected rather than causes to be named.
    pub(crate) corrects: bool,
    /// The platform whose sensor the others are compared with.
    pub reference: Option<String>,
    /// What is unknown beside the scenario's keys, once readings are known: zeros and gains of single sensors, and how
    /// far the plume meanders about a wind that is logged at sensors at rest.
    pub own: Vec<Unknown>,
    /// Whether the zeros of single sensors hold what is known of the levels of all.
    pub(crate) levels_held: bool,
    /// What the sensor of each platform has read, ppm, once that is known: its range ends no lower.
    pub(crate) has_read: Vec<f64>,
    /// What is known of the sensor's noise.
    pub(crate) noise: KnownNoise,
    /// Where it lets aircraft fly.
    pub airspace: Airspace,
}

impl Setup {
    /// The gas that is read: that of the first source.
    pub fn gas(&self) -> Gas {
        self.base.sources.first().map_or(Gas::Co2, |s| s.gas)
    }
}

/// Where a scenario lets aircraft fly.
#[derive(Debug, Clone, PartialEq)]
pub struct Airspace {
    /// Corners of the fence, m.
    pub polygon: Vec<Enu>,
    /// Lowest height above ground, m.
    pub floor_agl_m: f64,
    /// Highest height above ground, m.
    pub ceiling_agl_m: f64,
    /// Stacks, m.
    pub stacks: Vec<Enu>,
    /// Distance that every leg keeps from them, m.
    pub keep_out_m: f64,
}

impl Setup {
    /// The base of a scenario.
    ///
    /// # Errors
    /// A world that the plume model refuses.
    pub fn new(scenario: &Scenario) -> Result<Self, GapError> {
        Self::with_priors(scenario, |which| scenario.prior_sd(which))
    }

    /// The base of a scenario that is to be corrected: what it does not mark is unknown as well, as far as it usually
    /// is. With a `reference` platform the sensors of the others are compared with its own.
    ///
    /// # Errors
    /// A world that the plume model refuses.
    pub fn to_correct(scenario: &Scenario, reference: Option<&str>) -> Result<Self, GapError> {
        Ok(Self {
            corrects: true,
            reference: reference.map(str::to_owned),
            ..Self::with_priors(scenario, |which| scenario.corrected_sd(which))?
        })
    }

    fn with_priors(
        scenario: &Scenario,
        sd: impl Fn(Uncertain) -> Option<f64>,
    ) -> Result<Self, GapError> {
        let wrong = |e: scenario::world::WorldError| GapError::Data {
            what: "scenario".to_string(),
            problem: e.to_string(),
            expected: "a world that the plume model can run".to_string(),
        };
        let frame = scenario.frame().map_err(wrong)?;
        let mut base = scenario.dispersion_spec().map_err(wrong)?;
        let mut priors = Vec::new();
        for which in Uncertain::ALL {
            if let Some(sd) = sd(which) {
                priors.extend(prior(&base, which, sd));
            }
        }
        // An uncertain time constant is fitted as a whole, from none.
        if priors.iter().any(|p| p.id == MechanismId::SensorLag) {
            base.sensor.time_constant_s = 0.0;
        }
        base.lid_edge_m = HEIGHT_SD_M;
        let airspace = Airspace {
            polygon: scenario.fence_polygon().map_err(wrong)?,
            floor_agl_m: scenario.fence.floor_agl_m,
            ceiling_agl_m: scenario.fence.ceiling_agl_m,
            stacks: base.sources.iter().map(|s| s.place).collect(),
            keep_out_m: scenario.fence.keep_out_radius_m,
        };
        Ok(Self {
            airspace,
            noise: KnownNoise::of(scenario.sensor()),
            base,
            frame,
            priors,
            classes: Vec::new(),
            corrects: false,
            reference: None,
            own: Vec::new(),
            levels_held: false,
            has_read: Vec::new(),
        })
    }

    /// Whether what all sensors share of a level is held, because the zero of each is unknown.
    pub fn is_held(&self, id: MechanismId) -> bool {
        self.levels_held && LEVELS.contains(&id)
    }

    /// What is unknown of the base: what the scenario marks uncertain, then what the readings ask for beside that.
    pub fn unknowns(&self) -> Vec<Unknown> {
        let stated = self.priors.iter().map(|p| {
            let mut unknown = p.unknown();
            if self.is_held(unknown.id) {
                unknown.prior.sd *= HELD;
            }
            unknown
        });
        stated.chain(self.own.iter().copied()).collect()
    }

    /// The same with what happens by a schedule counted from `zero_s`.
    pub(crate) fn counted_from(&self, zero_s: f64) -> Self {
        let mut out = self.clone();
        for schedule in out.base.sources.iter_mut().flat_map(|s| &mut s.schedule) {
            *schedule = schedule.counted_from(zero_s);
        }
        out.classes.iter_mut().for_each(|c| c.0 -= zero_s);
        out
    }

    /// Standard deviation of what a sensor's readings may be off all along beforehand, ppm: background and zero.
    pub(crate) fn level_sd(&self, scale: Scale) -> f64 {
        let stated = self.priors.iter().filter(|p| LEVELS.contains(&p.id));
        scale.level_sd(stated.map(|p| p.unknown().prior.sd))
    }

    /// Time constant of the sensors as the scenario has it, s.
    pub(crate) fn time_constant_s(&self) -> f64 {
        let prior = self.priors.iter().find(|p| p.id == MechanismId::SensorLag);
        prior.map_or(self.base.sensor.time_constant_s, |p| p.value)
    }
}

fn prior(base: &DispersionSpec, which: Uncertain, sd: f64) -> Option<Prior> {
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
        key: which.key(base.sources.first()?.gas).to_string(),
        id,
        value,
        sd,
    })
}

/// Observations as columns, platform by platform.
#[derive(Debug, Clone)]
pub(crate) struct Data {
    pub track: Track,
    rows: Vec<Row>,
    /// What each reading is the mean over.
    spans: Vec<Span>,
    /// Readings, ppm; not a number where missing.
    pub reading_ppm: Vec<f64>,
    /// Rows that the fit uses.
    pub used: Vec<bool>,
    /// Stated white noise, ppm; not a number where not stated.
    pub sd_ppm: Vec<f64>,
    /// Logged wind (speed m/s, from degrees) where there is one.
    pub wind: Vec<Option<(f64, f64)>>,
    pub notices: Vec<String>,
    /// Whether the wind is logged, often enough to follow it. Else no row has one.
    pub on_board_wind: bool,
    /// The air at sensors that all stand still, where its wind is logged.
    pub rest: Option<AtRest>,
}

impl Data {
    /// Rows of `observations` in the frame of `setup`; rows without a place are ignored.
    pub fn new(setup: &Setup, observations: &Observations) -> Result<Self, GapError> {
        let mut notices = observations.notices.clone();
        let mut order: Vec<&ObservationRow> = observations.rows.iter().collect();
        order.sort_by(|a, b| {
            a.platform
                .cmp(&b.platform)
                .then(a.time_s.total_cmp(&b.time_s))
        });
        let before = order.len();
        order.dedup_by(|b, a| a.platform == b.platform && a.time_s == b.time_s);
        if order.len() < before {
            notices.push(format!(
                "{} rows that repeat a time of their platform were skipped",
                before - order.len()
            ));
        }
        if order.is_empty() {
            return Err(nothing("no rows"));
        }
        notices.extend(absent_platforms(&setup.base, &observations.platforms));
        few_enough(observations.platforms.len())?;
        let mut rows: Vec<Row> = order.iter().map(|o| row(setup, o)).collect();
        fixes::without_jitter(&mut rows);
        logged::bridge_air(&mut rows);
        let wind_log = logged::wind_log(&mut rows, &mut notices);
        if order.iter().all(|o| o.co2_ppm.is_none()) {
            return Err(nothing("all readings are missing"));
        }
        let world = DispersionModel::new(setup.base.clone())?;
        let spans: Vec<Span> = order.iter().map(|o| o.span(&setup.frame)).collect();
        notices.extend(means_said(&spans));
        let track = Track::of_means(&world, &observations.platforms, &rows, &spans)?;
        let track = in_classes(track, &setup.classes);
        let wind: Vec<_> = rows.iter().map(|r| r.wind).collect();
        let reading_ppm: Vec<f64> = order
            .iter()
            .map(|o| o.co2_ppm.unwrap_or(f64::NAN))
            .collect();
        let mut used: Vec<bool> = reading_ppm.iter().map(|c| c.is_finite()).collect();
        if let WindLog::Followed(known) = &wind_log {
            used.iter_mut().zip(known).for_each(|(u, k)| *u &= *k);
            let source = setup.base.sources[0].place;
            let astray = logged::on_no_straight_way(&track, &rows, source);
            let lost = used.iter().zip(&astray).filter(|(u, a)| **u && **a).count();
            used.iter_mut().zip(&astray).for_each(|(u, a)| *u &= !*a);
            if lost > 0 {
                notices.push(format!(
                    "{lost} readings are ignored: the logged wind varied so much while their air travelled from \
                     the source that no straight path leads there"
                ));
            }
        }
        let reads = |i: &usize| order[*i].co2_ppm.is_some();
        let on_board_wind = wind_log != WindLog::Absent;
        let rest = (on_board_wind && setup.corrects).then(|| {
            let read: Vec<Row> = (0..rows.len()).filter(reads).map(|i| rows[i]).collect();
            AtRest::of(observations.platforms.len(), &read)
        });
        Ok(Self {
            on_board_wind,
            rest: rest.flatten(),
            used,
            sd_ppm: order.iter().map(|o| o.sd_ppm.unwrap_or(f64::NAN)).collect(),
            reading_ppm,
            track,
            rows,
            spans,
            wind,
            notices,
        })
    }

    pub fn len(&self) -> usize {
        self.reading_ppm.len()
    }

    /// Every so many rows of each platform, and its last: about `most` in all. None where there are no
    /// more.
    pub fn thinned(&self, setup: &Setup, most: usize) -> Result<Option<Self>, GapError> {
        let Some(kept) = every(self.ranges(), most) else {
            return Ok(None);
        };
        let rows: Vec<Row> = kept.iter().map(|i| self.rows[*i]).collect();
        let spans: Vec<Span> = kept.iter().map(|i| self.spans[*i]).collect();
        let world = DispersionModel::new(setup.base.clone())?;
        let track = Track::of_means(&world, self.track.platforms(), &rows, &spans)?;
        let mut track = in_classes(track, &setup.classes);
        for (transport, i) in track.transport_mut().iter_mut().zip(&kept) {
            *transport = self.track.transport()[*i];
        }
        let pick = |of: &[f64]| kept.iter().map(|i| of[*i]).collect();
        Ok(Some(Self {
            track,
            rows,
            spans,
            reading_ppm: pick(&self.reading_ppm),
            used: kept.iter().map(|i| self.used[*i]).collect(),
            sd_ppm: pick(&self.sd_ppm),
            wind: kept.iter().map(|i| self.wind[*i]).collect(),
            ..self.clone()
        }))
    }

    /// The same setup with what the readings of sensors of this noise say before any fit: how high each has read, what
    /// single sensors of a network have of their own, and how far the plume meanders at sensors at rest. `in_flight`
    /// vehicles that wait on the ground are neither.
    pub fn told_of(
        &self,
        setup: &Setup,
        sensor_sd: f64,
        scale: Scale,
        in_flight: bool,
    ) -> Result<Setup, InferError> {
        let network = if in_flight {
            Vec::new()
        } else {
            self.network_zeros(setup, sensor_sd, scale)?
        };
        let has_read = self.ranges().iter().map(|range| {
            let mut read: Vec<f64> = range
                .clone()
                .filter(|i| self.used[*i])
                .map(|i| self.reading_ppm[i])
                .collect();
            read.sort_by(|a, b| b.total_cmp(a));
            read.get(STRAY)
                .map_or(f64::NEG_INFINITY, |c| c - READ_SDS * sensor_sd)
        });
        let platforms = self.track.platforms();
        let of_name = |name: &String| platforms.iter().position(|p| p == name);
        let reference = setup.reference.as_ref().and_then(of_name);
        let mut own = match reference {
            Some(k) => sensor_calibration::against(&setup.base, network, k, platforms.len()),
            None => network,
        };
        let levels_held = reference.is_none() && !own.is_empty();
        own.extend(self.rest.filter(|_| !in_flight).map(AtRest::meander));
        let mut priors = setup.priors.clone();
        if self.on_board_wind {
            let of_direction = |p: &&mut Prior| p.id == MechanismId::WindDirectionOffset;
            for prior in priors.iter_mut().filter(of_direction) {
                prior.sd = prior.sd.max(VANE_SD_DEG);
            }
        }
        Ok(Setup {
            priors,
            own,
            levels_held,
            has_read: has_read.collect(),
            ..setup.clone()
        })
    }

    fn network_zeros(
        &self,
        setup: &Setup,
        sensor_sd: f64,
        scale: Scale,
    ) -> Result<Vec<Unknown>, InferError> {
        let clean = PlumeModel::of(setup, &self.track, scale).clean_beforehand()?;
        let excess = |i: usize| {
            if self.used[i] {
                self.reading_ppm[i] - clean[i]
            } else {
                f64::NAN
            }
        };
        let excess: Vec<f64> = (0..self.len()).map(excess).collect();
        let platforms = self.track.platforms().len();
        let level_sd = setup.level_sd(scale);
        let rows = self.middles();
        Ok(sensor_calibration::own_zeros(
            &setup.base,
            platforms,
            &rows,
            &excess,
            sensor_sd,
            level_sd,
        ))
    }

    /// The rows in the middle of what they are means over.
    fn middles(&self) -> Vec<Row> {
        let middle = |(i, row): (usize, &Row)| Row {
            place: self.track.place(i),
            ..*row
        };
        self.rows.iter().enumerate().map(middle).collect()
    }

    pub fn used_count(&self) -> usize {
        self.used.iter().filter(|u| **u).count()
    }

    /// The time of which each reading is the mean, s.
    pub fn averaging_s(&self) -> Vec<f64> {
        self.spans.iter().map(|s| s.averaging_s).collect()
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
}

/// What a row adds to a mean of winds: east and north, in m/s, speed, and itself.
pub(crate) fn summand(t: &Transport) -> [f64; 4] {
    [
        t.east * t.speed_m_s,
        t.north * t.speed_m_s,
        t.speed_m_s,
        1.0,
    ]
}

/// The wind that carries the plume to the rows of a track in the mean, each row with its `weight`; over all
/// alike where none has one.
pub(crate) fn mean_transport(of: &[Transport], weight: &[f64]) -> Transport {
    let weighted = |weight: &dyn Fn(usize) -> f64| {
        let [east, north, speed, count] = of.iter().enumerate().fold([0.0; 4], |sum, (i, t)| {
            let own = summand(t);
            std::array::from_fn(|k| sum[k] + weight(i) * own[k])
        });
        Transport::towards(east, north, speed / count)
    };
    weighted(&|i| weight[i])
        .or_else(|| weighted(&|_| 1.0))
        .unwrap_or(of[0])
}

/// Every so many rows of each platform's range, and its last: about `most` in all. None where there are no
/// more.
pub fn every(ranges: &[Range<usize>], most: usize) -> Option<Vec<usize>> {
    let rows: usize = ranges.iter().map(ExactSizeIterator::len).sum();
    let every = rows.div_ceil(most.max(1));
    if every < 2 {
        return None;
    }
    let of = |r: &Range<usize>| {
        let last = r
            .end
            .checked_sub(1)
            .filter(|l| r.contains(l) && !(l - r.start).is_multiple_of(every));
        r.clone().step_by(every).chain(last)
    };
    Some(ranges.iter().flat_map(of).collect())
}

/// What is to be said of mechanisms of platforms that are not among `platforms`.
fn absent_platforms<'a>(
    base: &'a DispersionSpec,
    platforms: &'a [String],
) -> impl Iterator<Item = String> + 'a {
    let named = |m: &'a Mechanism| m.platforms().iter().map(move |name| (m.id(), name));
    let absent = base.mechanisms.iter().flat_map(named);
    let absent = absent.filter(|(_, name)| !platforms.contains(name));
    absent.map(|(id, name)| {
        format!(
            "the scenario has {} for platform {name}, which is not in the observations: they have {}",
            id.as_str(),
            platforms.join(", ")
        )
    })
}

/// Refuses more platforms than there are teams: each brings a sensor with faults of its own.
fn few_enough(platforms: usize) -> Result<(), GapError> {
    if platforms <= MOST_PLATFORMS {
        return Ok(());
    }
    Err(GapError::Data {
        what: "observations".to_string(),
        problem: format!("{platforms} platforms"),
        expected: format!(
            "at most {MOST_PLATFORMS}: the column platform names the aircraft or the instrument, not the single \
             row"
        ),
    })
}

fn nothing(problem: &str) -> GapError {
    GapError::Data {
        what: "observations".to_string(),
        problem: problem.to_string(),
        expected: "rows with time_s, platform, lat_deg, lon_deg, alt_amsl_m and readings"
            .to_string(),
    }
}

/// A track in air of these stability classes, each from its time on; in the model's own where there are none.
pub fn in_classes(track: Track, classes: &[(f64, Stability)]) -> Track {
    let Some(first) = classes.first() else {
        return track;
    };
    track.in_classes(&|time_s| {
        let next = classes.partition_point(|c| c.0 <= time_s);
        next.checked_sub(1).map_or(first.1, |k| classes[k].1)
    })
}

/// What is to be said of readings that are means.
fn means_said(spans: &[Span]) -> Vec<String> {
    let over = spans.iter().map(|s| s.averaging_s).filter(|s| *s > 0.0);
    let (mut least_s, mut most_s, mut count) = (f64::INFINITY, 0.0, 0);
    for averaging_s in over {
        (least_s, most_s) = (averaging_s.min(least_s), averaging_s.max(most_s));
        count += 1;
    }
    let mut said = Vec::new();
    if count > 0 {
        let time = if least_s == most_s {
            format!("{most_s} s")
        } else {
            format!("{least_s} to {most_s} s")
        };
        said.push(format!(
            "{count} rows are means over the {time} before them, as are their winds"
        ));
    }
    let lines = spans.iter().filter(|s| s.to.is_some()).count();
    if lines > 0 {
        said.push(format!("{lines} rows are means along straight lines"));
    }
    said
}

fn row(setup: &Setup, o: &ObservationRow) -> Row {
    let at = setup.frame.to_enu(Geodetic {
        lat_deg: o.lat_deg,
        lon_deg: o.lon_deg,
    });
    let height_agl_m = o.alt_amsl_m - setup.base.ground_amsl_m;
    // A vane without an anemometer: the scenario's speed.
    let speed_m_s = || setup.base.wind.speed_at_m_s(height_agl_m);
    let wind = |from_deg| (o.wind_speed_m_s.unwrap_or_else(speed_m_s), from_deg);
    Row {
        platform: o.platform,
        time_s: o.time_s,
        place: Place {
            east_m: at.east_m,
            north_m: at.north_m,
            height_agl_m,
        },
        wind: o.wind_from_deg.map(wind),
        air: SensorAir {
            temperature_c: o.temperature_c.unwrap_or(f64::NAN),
            relative_humidity_pct: o.relative_humidity_pct.unwrap_or(f64::NAN),
            pressure_hpa: o.pressure_hpa.unwrap_or(f64::NAN),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use air::wind::WindVector;

    #[test]
    fn the_mean_wind_is_that_of_the_weighted_vectors() {
        let mean_from_deg = |winds: [(f64, f64); 2], weight: [f64; 2]| {
            let of = winds.map(|(speed, from)| {
                let wind = WindVector::from_speed_and_direction(speed, from);
                Transport::towards(wind.east_m_s, wind.north_m_s, speed).unwrap()
            });
            let mean = mean_transport(&of, &weight);
            air::wind::from_deg(mean.east, mean.north).rem_euclid(360.0)
        };
        // 6 m/s from 350° and 6 m/s from 20°: the mean blows from 5°, not from 185°.
        assert!((mean_from_deg([(6.0, 350.0), (6.0, 20.0)], [0.0; 2]) - 5.0).abs() < 1e-9);
        // The stronger counts for more: atan2(10, 5) = 63.43°.
        assert!((mean_from_deg([(5.0, 0.0), (10.0, 90.0)], [2.0; 2]) - 63.434_948_8).abs() < 1e-6);
        assert!((mean_from_deg([(5.0, 0.0), (10.0, 90.0)], [0.0, 1.0]) - 90.0).abs() < 1e-9);
    }
}
