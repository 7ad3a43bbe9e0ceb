//! What a mission could find, before it is flown.
//!
//! The team flies some realities that may be for all that it knows, drawn from the scenario's `[uncertain]`, in
//! virtual time. What these missions state of themselves, and how far they are off, is what to expect: with the
//! search, the turns and the correction as they are, and with no second theory beside that of the correction. What
//! could be detected follows from where the real vehicles came: a plume counts as read when it explains the
//! squares of [`READ_SD`] standard deviations of the sensor's noise, as in flight.

use crate::{MissionError, Run, Setup, campaign};
use air::geo::Geodetic;
use plume::effects::SensorAir;
use plume::track::{Row, Track};
use plume::{DispersionModel, Gas, Place};
use protocol::message::{Estimate, Message, PeakStatus, Reading, VehicleKind as Kind};
use protocol::{SimTime, Topic};
use record::campaign::stated_number;
use record::summary::{CORRECTED, MissionSummary, Outcome, Summariser};
use scenario::random::stream;
use scenario::tables::VehicleKind;
use scenario::world::WorldError;
use serde::Serialize;
use std::collections::BTreeMap;
use study::median;
use ws::READ_SD;

/// The schema that `plan.json` names.
pub const SCHEMA: &str = "plumage.plan/1";
/// Chance with which the least emission is detected.
pub const CHANCE: f64 = 0.95;
/// Standard deviations above the threshold that make this chance: of the normal distribution, Φ⁻¹(0.95).
const CHANCE_SD: f64 = 1.645;
/// Median absolute deviation of a normal distribution, over its standard deviation.
const MEDIAN_OF_SD: f64 = 0.6745;
/// Edges of the bands of distance from the source, m.
const BANDS_M: [f64; 6] = [0.0, 500.0, 1000.0, 2000.0, 4000.0, f64::INFINITY];
/// Fewer readings than this make no band.
const LEAST_READINGS: usize = 20;

/// A mission flown in a reality that may be.
#[derive(Debug, Clone)]
pub struct Flight {
    summary: MissionSummary,
    background_ppm: f64,
    /// Strength of the first source in this reality, kg/s.
    emission_kg_s: f64,
    /// When the last vehicle was in the air, s.
    last_up_s: f64,
    plume_readings: Vec<PlumeReading>,
}

/// What one reading of a real vehicle held of the plume.
#[derive(Debug, Clone, Copy)]
struct PlumeReading {
    distance_m: f64,
    height_agl_m: f64,
    /// The plume's part, over the sensor's noise.
    snr: f64,
}

/// What may be expected of one number.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Expected {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation that missions state in the median.
    pub sd: f64,
    /// Standard deviation by which they are off, from the median error.
    pub error: f64,
}

/// Least emission that is detected from one band of distance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Detectable {
    /// Nearest distance from the source, m.
    pub from_m: f64,
    /// Farthest, m; none for what is beyond all bands.
    pub to_m: Option<f64>,
    /// Heights between which nine of ten readings were made, m above the site's ground.
    pub heights_agl_m: (f64, f64),
    /// Readings of real vehicles there, in the median.
    pub readings: f64,
    /// Least emission detected from them, kg/s; none where nothing could be.
    pub least_kg_s: Option<f64>,
}

/// What a mission could find.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Forecast {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Missions flown.
    pub missions: usize,
    /// Chance with which the least emission is detected.
    pub chance: f64,
    /// Least emission detected by the whole mission, kg/s; none where nothing could be.
    pub least_kg_s: Option<f64>,
    /// The same from readings at some distances alone.
    pub detectable: Vec<Detectable>,
    /// Missions by their peak's status.
    pub status: BTreeMap<String, usize>,
    /// Distance of the peak found from the true one, m, in the median; none where none was found.
    pub peak_off_m: Option<f64>,
    /// Peak and flux in % of their excess and size, then the model's numbers.
    pub expected: Vec<Expected>,
    /// When the peak is first confirmed or supported, s, in the median of those missions in which it is.
    pub known_s: Option<f64>,
    /// When the last vehicle is down, s, at the latest.
    pub down_s: f64,
    /// Missions in which all vehicles landed.
    pub all_landed: usize,
}

/// Flies the mission in the `number`-th of the realities that may be. A real aircraft's place is taken by a stand-in;
/// nobody looks for the gap.
///
/// # Errors
/// A team without a real vehicle, or a mission that cannot be flown.
pub fn fly(setup: &Setup, number: u64) -> Result<Flight, MissionError> {
    let setup = in_a_reality(setup, number)?;
    let mut run = Run::new(&setup)?.on_one_thread();
    let mut summariser = Summariser::new(campaign::summary_context(&setup)?);
    let mut watch = Watch::default();
    while !run.ended() {
        for (topic, envelope) in run.step() {
            summariser.take(topic, envelope);
            watch.take(topic, &envelope.message, envelope.time);
        }
    }
    let model = setup.scenario.in_reality().dispersion_model()?;
    let emission_kg_s = model.emissions_kg_s()[0].1;
    if emission_kg_s <= 0.0 {
        return Err(MissionError::Request(
            "the source emits nothing; expected emission_kg_s or c_max_ppm above 0, since the detection limit is \
             a fraction of it"
                .to_owned(),
        ));
    }
    Ok(Flight {
        background_ppm: model.spec().background_ppm,
        emission_kg_s,
        plume_readings: plume_readings(&setup, &model, &watch.readings)?,
        summary: summariser.summary(&run.digest(), 0.0),
        last_up_s: watch.last_up_s,
    })
}

fn in_a_reality(setup: &Setup, number: u64) -> Result<Setup, MissionError> {
    let mut setup = setup.clone();
    let seed = setup.scenario.mission.seed.wrapping_add(number);
    let mut rng = stream(seed, "plan/reality");
    setup.scenario = setup.scenario.with_drawn_reality(&mut rng);
    let scenario = &mut setup.scenario;
    scenario.mission.seed = seed;
    scenario.gap.live = false;
    let real = scenario.vehicles.iter_mut();
    let real = real.filter(|v| v.kind != VehicleKind::Simulated);
    let count = real.map(|v| {
        v.kind = VehicleKind::StandIn;
        v.forget_link();
    });
    if count.count() == 0 {
        return Err(MissionError::Request(
            "the team has no real vehicle to measure the reality; expected kind = \"stand-in\" or \"mavlink\" \
             for at least one vehicle"
                .to_owned(),
        ));
    }
    setup.reality_wind_series = setup.wind_series.clone();
    Ok(setup)
}

/// What a plan wants to know of a mission beside its summary.
#[derive(Default)]
struct Watch {
    readings: BTreeMap<String, Vec<(f64, Reading)>>,
    last_up_s: f64,
}

impl Watch {
    fn take(&mut self, topic: &Topic, message: &Message, time: SimTime) {
        match (topic, message) {
            (Topic::Reading(name), Message::Reading(reading)) if reading.kind == Kind::Real => {
                let of = self.readings.entry(name.to_string()).or_default();
                of.push((time.s(), reading.clone()));
            }
            (_, Message::State(state)) if state.airborne => self.last_up_s = time.s(),
            _ => {}
        }
    }
}

/// What the readings held of the plumes in a reality, by its mean field and through the sensor.
fn plume_readings(
    setup: &Setup,
    model: &DispersionModel,
    readings: &BTreeMap<String, Vec<(f64, Reading)>>,
) -> Result<Vec<PlumeReading>, MissionError> {
    let frame = setup.frame()?;
    let names: Vec<String> = readings.keys().cloned().collect();
    let mut rows: Vec<Row> = Vec::new();
    for (platform, of) in readings.values().enumerate() {
        for (time_s, r) in of {
            let at = Geodetic::new(r.lat_deg, r.lon_deg);
            let row = Row {
                platform,
                time_s: *time_s,
                place: Place::from_geodetic(&frame, at, r.alt_amsl_m),
                wind: None,
                air: SensorAir::UNKNOWN,
            };
            let last = rows.last().filter(|last| last.platform == platform);
            if last.is_none_or(|last| last.time_s < *time_s) {
                rows.push(row);
            }
        }
    }
    let track = Track::new(model, &names, &rows).map_err(WorldError::from)?;
    let (mut reading, mut part) = (vec![0.0; rows.len()], vec![0.0; rows.len()]);
    track.predict_parts(model, &mut reading, Some(&mut part));
    let sensor = &model.spec().sensor;
    // A rounded reading has the step's uniform error.
    let noise_ppm = sensor
        .noise_sd_ppm
        .hypot(sensor.resolution_ppm / 12f64.sqrt());
    let source = model.spec().sources[0].place;
    let each = rows.iter().zip(part).map(|(row, part_ppm)| PlumeReading {
        distance_m: (row.place.east_m - source.east_m).hypot(row.place.north_m - source.north_m),
        height_agl_m: row.place.height_agl_m,
        snr: part_ppm / noise_ppm.max(f64::MIN_POSITIVE),
    });
    Ok(each.collect())
}

/// Least emission that these readings detect, beside a background that they have to tell too: the strength at which
/// the plume's matched filter stands [`READ_SD`] and [`CHANCE_SD`] above nothing.
fn least_kg_s<'a>(
    emission_kg_s: f64,
    readings: impl Iterator<Item = &'a PlumeReading> + Clone,
) -> Option<f64> {
    let count = readings.clone().count() as f64;
    let mean = readings.clone().map(|m| m.snr).sum::<f64>() / count;
    let squares: f64 = readings.map(|m| (m.snr - mean).powi(2)).sum();
    let least = emission_kg_s * (READ_SD + CHANCE_SD) / squares.sqrt();
    least.is_finite().then_some(least)
}

/// What the missions show together.
pub fn forecast(flights: &[Flight]) -> Forecast {
    let of =
        |each: &dyn Fn(&Flight) -> Option<f64>| median(flights.iter().filter_map(each).collect());
    let mut status = BTreeMap::new();
    for flight in flights {
        let word = match flight.summary.peak.status {
            PeakStatus::Confirmed => "confirmed",
            PeakStatus::Supported => "supported",
            PeakStatus::Doubtful => "doubtful",
            PeakStatus::NotFound => "not-found",
        };
        *status.entry(word.to_owned()).or_insert(0) += 1;
    }
    let landed = |f: &&Flight| {
        let grounded = |o: Outcome| matches!(o, Outcome::Landed | Outcome::NeverFlew);
        f.summary.vehicles.iter().all(|v| grounded(v.outcome))
    };
    Forecast {
        schema: SCHEMA,
        missions: flights.len(),
        chance: CHANCE,
        least_kg_s: of(&|f| least_kg_s(f.emission_kg_s, f.plume_readings.iter())),
        detectable: BANDS_M
            .windows(2)
            .filter_map(|b| band(flights, b[0], b[1]))
            .collect(),
        status,
        peak_off_m: of(&|f| f.summary.peak.error_m),
        expected: expected(flights),
        known_s: of(&|f| f.summary.peak.known_s),
        down_s: flights.iter().map(|f| f.last_up_s).fold(0.0, f64::max),
        all_landed: flights.iter().filter(landed).count(),
    }
}

fn band(flights: &[Flight], from_m: f64, to_m: f64) -> Option<Detectable> {
    let inside = |m: &&PlumeReading| (from_m..to_m).contains(&m.distance_m);
    let readings = median(
        flights
            .iter()
            .map(|f| f.plume_readings.iter().filter(inside).count() as f64)
            .collect(),
    )?;
    if readings < LEAST_READINGS as f64 {
        return None;
    }
    let read = flights
        .iter()
        .flat_map(|f| f.plume_readings.iter().filter(inside));
    let mut heights: Vec<f64> = read.map(|m| m.height_agl_m).collect();
    heights.sort_by(f64::total_cmp);
    // On the ground a barometer may be a little below it.
    let at = |share: f64| heights[(share * (heights.len() - 1) as f64) as usize].max(0.0);
    let least = |f: &Flight| least_kg_s(f.emission_kg_s, f.plume_readings.iter().filter(inside));
    Some(Detectable {
        from_m,
        to_m: to_m.is_finite().then_some(to_m),
        heights_agl_m: (at(0.05), at(0.95)),
        readings,
        least_kg_s: median(flights.iter().filter_map(least).collect()),
    })
}

/// One number of each mission with its truth, in the unit in which it is told.
fn expected(flights: &[Flight]) -> Vec<Expected> {
    let mut out = Vec::new();
    let mut add = |name: &str, unit: &str, of: &dyn Fn(&Flight) -> Option<(f64, f64)>| {
        let pairs: Vec<(f64, f64)> = flights.iter().filter_map(of).collect();
        let sd = median(pairs.iter().map(|p| p.0).collect());
        let error = median(pairs.iter().map(|p| p.1.abs()).collect());
        if let (Some(sd), Some(error)) = (sd, error) {
            let (name, unit, error) = (name.to_owned(), unit.to_owned(), error / MEDIAN_OF_SD);
            out.push(Expected {
                name,
                unit,
                sd,
                error,
            });
        }
    };
    add("peak", "%", &|f| {
        let (found, truth) = (f.summary.peak.estimate?, f.summary.peak.truth?);
        let percent = |ppm: f64, of: f64| 100.0 * ppm / (of - f.background_ppm);
        Some((
            percent(found.sd_ppm, found.co2_ppm),
            percent(found.co2_ppm - truth.co2_ppm, truth.co2_ppm),
        ))
    });
    add("flux", "%", &|f| {
        let flux = f.summary.flux.first()?;
        let (Estimate { value, sd }, truth) = (flux.found.kg_s, flux.truth_kg_s?);
        Some((100.0 * sd / value, 100.0 * (value - truth) / truth))
    });
    let gas = flights.first().map_or(Gas::Co2, |f| f.summary.gas);
    for number in &CORRECTED {
        add(number.name, &number.unit_of(gas), &|f| {
            let stated = stated_number(&f.summary, number)?;
            Some((stated.sd.unwrap_or(f64::INFINITY), stated.error))
        });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_emission_stands_above_the_threshold_with_its_chance() {
        // 100 readings of noise, half of them in a plume of 2 standard deviations: the matched filter of ±1 about
        // the mean has a standard deviation of 10, so 6.645 of it are .6645 of the emission
        // (python3: (5+1.645)/(100*1**2)**.5).
        let plume_readings: Vec<PlumeReading> = (0..100)
            .map(|k| PlumeReading {
                distance_m: 100.0,
                height_agl_m: 50.0,
                snr: if k < 50 { 2.0 } else { 0.0 },
            })
            .collect();
        let least = least_kg_s(10.0, plume_readings.iter()).unwrap();
        assert!((least - 6.645).abs() < 1e-9, "{least}");
        assert_eq!(least_kg_s(10.0, plume_readings[..50].iter()), None);
    }
}
