//! `summary.json`: what a mission found, built from its messages in bounded memory.

use crate::intervals::positive_interval_95;
use air::geo::{Enu, Geodetic, LocalFrame, wrap_signed_deg};
use plume::{Gas, Unit};
use protocol::key::Name;
use protocol::message::{
    Estimate, Flux, FluxMethod, GapCause, MechanismSetting, Message, Model, Peak, PeakStatus,
    Reading, State, VehicleKind,
};
use protocol::{Envelope, SimTime, Topic};
use scenario::Scenario;
use scenario::contradiction::{Contradiction, Corrected, Evidence, Read};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The schema that `summary.json` names.
pub const SCHEMA: &str = "plumage.summary/1";

/// A vehicle must have moved this far before the way counts: the jitter of positions is no way, m.
const MIN_LEG_M: f64 = 10.0;

/// A plume was read where a reading is so many standard deviations of the sensor's noise above the background.
const READ_SD: f64 = 5.0;
/// The plume may be within so many standard deviations of its direction and height: 95 % of a normal distribution.
const MAY_BE_SD: f64 = 2.0;
/// … and within its own half width, degrees: two σ_y of class D are .16 of the distance.
const PLUME_DEG: f64 = 9.0;

/// The numbers of a plume model, each with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ModelNumbers<E = Estimate> {
    /// Background, ppm.
    pub background_ppm: E,
    /// Height of the axis above ground at the first source, m.
    pub effective_height_agl_m: E,
    /// Direction towards which the axis runs, degrees.
    pub axis_deg: E,
    /// Concentration above background on the axis at `c_max_distance_m`, ppm.
    pub c_max_ppm: E,
    /// Distance from the source at which `c_max_ppm` holds, m.
    pub c_max_distance_m: E,
    /// Scale of the lateral spread.
    pub sigma_y_scale: E,
    /// Scale of the vertical spread.
    pub sigma_z_scale: E,
}

impl From<&Model> for ModelNumbers {
    fn from(model: &Model) -> Self {
        Self {
            background_ppm: model.background_ppm,
            effective_height_agl_m: model.effective_height_agl_m,
            axis_deg: model.axis_deg,
            c_max_ppm: model.c_max_ppm,
            c_max_distance_m: model.c_max_distance_m,
            sigma_y_scale: model.sigma_y_scale,
            sigma_z_scale: model.sigma_z_scale,
        }
    }
}

impl ModelNumbers {
    /// The same as a scenario is compared with it, of which c_MAX is `stated`.
    fn corrected(&self, stated: Estimate) -> Corrected {
        let values = [
            self.background_ppm,
            self.effective_height_agl_m,
            self.axis_deg,
            self.c_max_ppm,
            self.sigma_y_scale,
            self.sigma_z_scale,
        ];
        Corrected::new(values.map(|e| (e.value, e.sd)), stated.value)
    }
}

/// A number of a plume model: its name for people, its unit, its place, and whether it turns.
pub struct ModelNumber {
    /// Name for people.
    pub name: &'static str,
    /// Unit; empty for a ratio.
    unit: &'static str,
    /// Digits after the point that are worth showing of CO2.
    digits: usize,
    /// Where it stands.
    pub of: fn(&ModelNumbers) -> Estimate,
    turns: bool,
}

/// A ppm of a gas in words; of CO2, where nothing else is said, it is plain.
pub fn ppm_of(gas: Gas) -> String {
    match gas {
        Gas::Co2 => PPM.to_owned(),
        _ => format!("{PPM} {}", gas.formula()),
    }
}

/// The unit of mole fractions.
const PPM: &str = "ppm";

impl ModelNumber {
    /// Its unit, with the gas where it is a mole fraction of another gas than CO2; empty for a ratio.
    pub fn unit_of(&self, gas: Gas) -> String {
        match self.unit {
            PPM => ppm_of(gas),
            unit => unit.to_owned(),
        }
    }

    /// Whether it is an angle, which goes round.
    pub fn turns(&self) -> bool {
        self.turns
    }

    /// Digits after the point that are worth showing.
    pub fn digits(&self, gas: Gas) -> usize {
        let more = if self.unit == PPM { gas.digits() } else { 0 };
        self.digits + more
    }

    /// How far `value` is from `truth`, signed; angles the short way round.
    pub fn error(&self, value: f64, truth: f64) -> f64 {
        if self.turns {
            wrap_signed_deg(value - truth)
        } else {
            value - truth
        }
    }
}

/// The numbers that calibration corrects, in the order in which they are shown.
pub const CORRECTED: [ModelNumber; 6] = [
    ModelNumber {
        name: "axis (towards)",
        unit: "°",
        digits: 1,
        of: |m| m.axis_deg,
        turns: true,
    },
    ModelNumber {
        name: "effective height",
        unit: "m",
        digits: 0,
        of: |m| m.effective_height_agl_m,
        turns: false,
    },
    ModelNumber {
        name: "c_MAX",
        unit: PPM,
        digits: 0,
        of: |m| m.c_max_ppm,
        turns: false,
    },
    ModelNumber {
        name: "sigma-y scale",
        unit: "",
        digits: 2,
        of: |m| m.sigma_y_scale,
        turns: false,
    },
    ModelNumber {
        name: "sigma-z scale",
        unit: "",
        digits: 2,
        of: |m| m.sigma_z_scale,
        turns: false,
    },
    ModelNumber {
        name: "background",
        unit: PPM,
        digits: 1,
        of: |m| m.background_ppm,
        turns: false,
    },
];

/// A vehicle that was in the air and has not been heard for this long at the end is lost, s: the
/// squadron controller counts on it no more.
const LOST_S: f64 = 10.0;

/// How a vehicle's mission ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// On the ground after a flight.
    Landed,
    /// Still in the air.
    Airborne,
    /// In the air when it was last heard, and not heard at the end.
    Lost,
    /// Never in the air.
    NeverFlew,
    /// Not of the team: it was fed in, and how it ends is not this mission's.
    Fed,
}

/// What one vehicle did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleSummary {
    /// Its id.
    pub id: String,
    /// Simulated or real.
    pub kind: VehicleKind,
    /// How its mission ended.
    pub outcome: Outcome,
    /// Way flown, m.
    pub distance_m: f64,
    /// Highest reading, ppm; none without a reading.
    pub peak_ppm: Option<f64>,
    /// When it was read, s.
    pub peak_time_s: Option<f64>,
    /// Latitude where it was read, degrees.
    pub peak_lat_deg: Option<f64>,
    /// Longitude where it was read, degrees.
    pub peak_lon_deg: Option<f64>,
    /// Altitude where it was read, m above mean sea level.
    pub peak_alt_amsl_m: Option<f64>,
}

/// The peak: found, true, and how far apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PeakSummary<E = Peak> {
    /// How far readings stand behind the estimate.
    pub status: PeakStatus,
    /// The last estimate; none where the readings follow no plume.
    pub estimate: Option<E>,
    /// Its 95 % interval, ppm: the excess over the background is positive; none without an estimate.
    #[serde(skip)]
    pub interval_95_ppm: Option<[f64; 2]>,
    /// The highest reading of a real vehicle; none without one.
    pub highest_reading: Option<HighestReading>,
    /// The maximum of the reality's mean field where set-points may go, in its slow wind at the
    /// estimate's time, where it is known.
    pub truth: Option<PlaceOfPeak>,
    /// Distance between estimate and truth, m.
    pub error_m: Option<f64>,
    /// Mission time at which the peak was first confirmed or supported, s; none where it never was.
    pub known_s: Option<f64>,
    /// Whether a real vehicle took a reading where the plume could be, by the model of that time.
    pub came_near: bool,
}

/// A place and the mole fraction there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaceOfPeak {
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Mole fraction there, background included, ppm; `<gas>_ppm` of a mission of another gas.
    pub co2_ppm: f64,
}

/// The highest reading of all real vehicles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HighestReading {
    /// Who read it.
    pub vehicle: String,
    /// Mission time, s.
    pub time_s: f64,
    /// Where, and what.
    #[serde(flatten)]
    pub place: PlaceOfPeak,
}

/// What the readings show of the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GapSummary {
    /// none, named, ambiguous, unexplained or insufficient.
    pub verdict: String,
    /// What may be the cause, the likeliest first.
    pub causes: Vec<GapCause>,
}

/// What a source emits, and where it is known what it really does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FluxSummary {
    /// What was found.
    #[serde(flatten, serialize_with = "crate::intervals::flux")]
    pub found: Flux,
    /// Emission of the stand-in's reality, kg/s, where it is known.
    pub truth_kg_s: Option<f64>,
}

/// The model before and after the mission, and the stand-in's reality where it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ModelSummary {
    /// As the scenario had it before the preliminary flight.
    pub before: ModelNumbers,
    /// As the mission left it.
    #[serde(serialize_with = "crate::intervals::model")]
    pub after: ModelNumbers,
    /// The stand-in's reality; none when only real aircraft measured or nothing did.
    pub reality: Option<ModelNumbers>,
}

/// `summary.json`. What is not finite is null.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MissionSummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// The gas that was read.
    pub gas: Gas,
    /// Seed of the run.
    pub seed: u64,
    /// Digest of the run.
    pub digest: String,
    /// Simulated time, s.
    pub sim_s: f64,
    /// Wall time, s.
    pub wall_s: f64,
    /// `sim_s / wall_s`.
    pub real_time_factor: f64,
    /// The vehicles, in the order of their ids.
    pub vehicles: Vec<VehicleSummary>,
    /// The peak.
    #[serde(serialize_with = "crate::intervals::peak")]
    pub peak: PeakSummary,
    /// What the sources emit; empty where the readings follow no plume.
    pub flux: Vec<FluxSummary>,
    /// Analysis of the model by real readings; none if not done.
    pub gap: Option<GapSummary>,
    /// The model.
    pub model: ModelSummary,
    /// Extensions in force at the end, further sources that were found among them.
    pub mechanisms: Vec<MechanismSetting>,
    /// Values of the scenario that readings contradict, the strongest contradiction first.
    pub contradictions: Vec<Contradiction>,
}

impl MissionSummary {
    /// The text of `summary.json`.
    pub fn to_json(&self) -> String {
        // Plain structs, numbers and text: serde_json has nothing to refuse here.
        let text = serde_json::to_string_pretty(self).unwrap_or_default() + "\n";
        with_gas(&text, self.gas)
    }
}

/// The text of a JSON document in which the field `co2_ppm` has the name of the gas that it is of.
pub fn with_gas(json: &str, gas: Gas) -> String {
    // Quotes and colon make it a field's name: within a text the quotes would be escaped.
    let field = |gas: Gas| format!("\"{}\":", gas.column(Unit::Ppm));
    json.replace(&field(Gas::Co2), &field(gas))
}

/// What a summary needs and no message says.
#[derive(Debug, Clone)]
pub struct SummaryContext {
    /// The gas that is read.
    pub gas: Gas,
    /// The scenario.
    pub scenario: Scenario,
    /// Seed of the run.
    pub seed: u64,
    /// Ids of the team's vehicles.
    pub team: Vec<String>,
    /// The site's frame.
    pub frame: LocalFrame,
    /// Latitude and longitude of the first source, degrees.
    pub source_deg: (f64, f64),
    /// White noise of a reading, one standard deviation, ppm.
    pub noise_ppm: f64,
    /// The model as the scenario has it before the preliminary flight.
    pub before: ModelNumbers,
    /// The stand-in's reality, if there is one.
    pub reality: Option<ModelNumbers>,
    /// The maximum of the reality's mean field where set-points may go, at a time, if it is known.
    pub true_peak: Option<TruePeak>,
    /// What the sources of the reality emit, kg/s, by name.
    pub true_flux: Vec<(String, f64)>,
}

/// The true peak at a mission time in s.
#[derive(Clone)]
pub struct TruePeak(pub Arc<dyn Fn(f64) -> Option<PlaceOfPeak> + Send + Sync>);

impl std::fmt::Debug for TruePeak {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("TruePeak(..)")
    }
}

/// Builds a [`MissionSummary`] from the messages of a run as they come.
#[derive(Debug, Clone)]
pub struct Summariser {
    context: SummaryContext,
    last: SimTime,
    vehicles: BTreeMap<Name, Vehicle>,
    peak: Option<Peak>,
    flux: Vec<Flux>,
    mechanisms: Vec<MechanismSetting>,
    known_s: Option<f64>,
    came_near: bool,
    gap: Option<GapSummary>,
    after: ModelNumbers,
    evidence: Evidence,
}

#[derive(Debug, Clone)]
struct Vehicle {
    kind: VehicleKind,
    distance_m: f64,
    last_counted: Option<(Enu, f64)>,
    peak: Option<(SimTime, Reading)>,
    flew: bool,
    /// Whether it was in the air when its state was last heard, and when that was.
    airborne: (bool, SimTime),
}

impl Summariser {
    /// A summariser that has heard nothing yet.
    pub fn new(context: SummaryContext) -> Self {
        Self {
            last: SimTime::ZERO,
            vehicles: BTreeMap::new(),
            peak: None,
            flux: Vec::new(),
            mechanisms: Vec::new(),
            known_s: None,
            came_near: false,
            gap: None,
            after: context.before,
            evidence: Evidence::new(&context.scenario),
            context,
        }
    }

    /// Takes in a message.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        self.last = self.last.max(envelope.time);
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => {
                let frame = self.context.frame;
                let vehicle = self.vehicle(id, state.kind);
                vehicle.moved(&frame, state);
                vehicle.flew |= state.airborne;
                vehicle.airborne = (state.airborne, envelope.time);
            }
            (Topic::Reading(id), Message::Reading(reading)) => {
                let flies = self.vehicles.get(id).is_some_and(|v| v.airborne.0);
                if reading.kind == VehicleKind::Real {
                    self.came_near |= flies && self.is_near(reading);
                    self.evidence.read(&Read {
                        vehicle: id.as_str(),
                        ppm: reading.co2_ppm,
                        at: Geodetic::new(reading.lat_deg, reading.lon_deg),
                        alt_amsl_m: reading.alt_amsl_m,
                        wind: reading.wind_speed_m_s.zip(reading.wind_from_deg),
                    });
                }
                self.vehicle(id, reading.kind)
                    .read(reading.read_at(envelope.time), reading);
            }
            (Topic::Model, Message::Model(model)) => {
                self.after = model.as_ref().into();
                if model.observations > 0 {
                    let corrected = self.after.corrected(self.context.before.c_max_ppm);
                    let balance = Flux::by(FluxMethod::MassBalance, &model.flux);
                    self.evidence.correct(corrected, balance);
                }
                self.peak = model.peak.or(self.peak);
                self.flux.clone_from(&model.flux);
                self.mechanisms.clone_from(&model.mechanisms);
                let stands = model.peak.is_some_and(|p| p.status.stands());
                if self.known_s.is_none() && stands {
                    self.known_s = Some(envelope.time.s());
                }
            }
            (Topic::Extension, Message::Extension(said)) => {
                let beside_model = said.mechanisms.iter().filter(|_| !said.adopt);
                self.evidence
                    .name(beside_model.filter_map(MechanismSetting::only_parameter));
                self.gap = Some(GapSummary {
                    verdict: said.verdict.clone(),
                    causes: said.causes.clone(),
                });
            }
            _ => {}
        }
    }

    fn vehicle(&mut self, id: &Name, kind: VehicleKind) -> &mut Vehicle {
        let vehicle = self.vehicles.entry(id.clone()).or_insert(Vehicle {
            kind,
            distance_m: 0.0,
            last_counted: None,
            peak: None,
            flew: false,
            airborne: (false, SimTime::ZERO),
        });
        vehicle.kind = kind;
        vehicle
    }

    /// What all vehicles together have flown so far, m.
    pub fn flown_m(&self) -> f64 {
        self.vehicles.values().map(|v| v.distance_m).sum()
    }

    /// When the peak was first confirmed or supported, s.
    pub fn known_s(&self) -> Option<f64> {
        self.known_s
    }

    /// The summary of what was taken in so far.
    pub fn summary(&self, digest: &str, wall_s: f64) -> MissionSummary {
        let sim_s = self.last.s();
        MissionSummary {
            schema: SCHEMA,
            gas: self.context.gas,
            seed: self.context.seed,
            digest: digest.to_owned(),
            sim_s,
            wall_s,
            real_time_factor: sim_s / wall_s,
            vehicles: self
                .vehicles
                .iter()
                .map(|(id, v)| v.summary(id.as_str(), self.outcome(id.as_str(), v)))
                .collect(),
            peak: self.peak_summary(),
            flux: self.flux.iter().map(|f| self.flux_summary(f)).collect(),
            gap: self.gap.clone(),
            model: ModelSummary {
                before: self.context.before,
                after: self.after,
                reality: self.context.reality,
            },
            mechanisms: self.mechanisms.clone(),
            contradictions: self.evidence.contradictions(),
        }
    }
}

impl Summariser {
    fn outcome(&self, id: &str, vehicle: &Vehicle) -> Outcome {
        if self.context.team.iter().any(|own| own == id) {
            vehicle.outcome(self.last)
        } else {
            Outcome::Fed
        }
    }

    /// Whether a reading was taken where the plume may be by the model so far.
    fn is_near(&self, reading: &Reading) -> bool {
        let frame = &self.context.frame;
        let enu = |lat_deg, lon_deg| frame.to_enu(Geodetic { lat_deg, lon_deg });
        let source = enu(self.context.source_deg.0, self.context.source_deg.1);
        let here = enu(reading.lat_deg, reading.lon_deg);
        let (axis, height) = (&self.after.axis_deg, &self.after.effective_height_agl_m);
        let off_deg = wrap_signed_deg(source.bearing_deg(here) - axis.value).abs();
        let off_m = (reading.alt_amsl_m - frame.ground_amsl_m - height.value).abs();
        let plume_m = source.distance_m(here) * PLUME_DEG.to_radians();
        off_deg <= MAY_BE_SD * axis.sd + PLUME_DEG && off_m <= MAY_BE_SD * height.sd + plume_m
    }

    /// How far readings stand behind the peak. A plume that was read is never none, whatever the model makes of it.
    fn status(&self) -> PeakStatus {
        let status = self.peak.map_or(PeakStatus::NotFound, |p| p.status);
        let highest = self.highest_reading();
        let excess_ppm = highest.map(|h| h.place.co2_ppm - self.after.background_ppm.value);
        match status {
            PeakStatus::NotFound
                if excess_ppm.is_some_and(|e| e > READ_SD * self.context.noise_ppm) =>
            {
                PeakStatus::Doubtful
            }
            status => status,
        }
    }

    fn peak_summary(&self) -> PeakSummary {
        let found = self.peak;
        let estimate = found.filter(|p| p.status != PeakStatus::NotFound);
        let time_s = found.map_or(self.last.s(), |p| p.time_s);
        let truth = self.context.true_peak.as_ref().and_then(|t| t.0(time_s));
        let error_m = estimate
            .zip(truth)
            .map(|(found, truth)| distance_m(&self.context.frame, &found, &truth));
        let interval = |p: Peak| {
            let above_ppm = self.after.background_ppm.value;
            let excess = Estimate {
                value: p.co2_ppm - above_ppm,
                sd: p.sd_ppm,
            };
            let interval = positive_interval_95(excess)?;
            Some(interval.map(|end| above_ppm + end))
        };
        PeakSummary {
            status: self.status(),
            estimate,
            interval_95_ppm: estimate.and_then(interval),
            highest_reading: self.highest_reading(),
            truth,
            error_m,
            known_s: self.known_s,
            came_near: self.came_near,
        }
    }

    fn highest_reading(&self) -> Option<HighestReading> {
        let real = self
            .vehicles
            .iter()
            .filter(|(_, v)| v.kind == VehicleKind::Real);
        let read = real.filter_map(|(id, v)| Some((id, v.peak.as_ref()?)));
        let highest = read.max_by(|a, b| a.1.1.co2_ppm.total_cmp(&b.1.1.co2_ppm));
        highest.map(|(id, (time, reading))| HighestReading {
            vehicle: id.to_string(),
            time_s: time.s(),
            place: PlaceOfPeak {
                lat_deg: reading.lat_deg,
                lon_deg: reading.lon_deg,
                alt_amsl_m: reading.alt_amsl_m,
                co2_ppm: reading.co2_ppm,
            },
        })
    }

    fn flux_summary(&self, found: &Flux) -> FluxSummary {
        let known = &self.context.true_flux;
        let truth_kg_s = match found.method {
            FluxMethod::Inference => known.iter().find(|k| k.0 == found.source).map(|k| k.1),
            // Passes weigh what goes through them, whatever the model knows of.
            FluxMethod::MassBalance | FluxMethod::Combined => {
                (!known.is_empty()).then(|| known.iter().map(|k| k.1).sum())
            }
        };
        FluxSummary {
            truth_kg_s,
            found: found.clone(),
        }
    }
}

impl Vehicle {
    fn moved(&mut self, frame: &LocalFrame, state: &State) {
        let here = frame.to_enu(Geodetic {
            lat_deg: state.lat_deg,
            lon_deg: state.lon_deg,
        });
        // Legs of a fixed least length: the sum over all positions would grow with their noise even
        // while a vehicle stands (as coastlines do with the scale, Richardson 1961).
        match self.last_counted {
            None => self.last_counted = Some((here, state.alt_amsl_m)),
            Some((there, alt)) => {
                let flat = here.distance_m(there);
                let way = flat.hypot(state.alt_amsl_m - alt);
                if way >= MIN_LEG_M {
                    self.distance_m += way;
                    self.last_counted = Some((here, state.alt_amsl_m));
                }
            }
        }
    }

    fn read(&mut self, time: SimTime, reading: &Reading) {
        let highest = self.peak.as_ref().map(|(_, peak)| peak.co2_ppm);
        if highest.is_none_or(|highest| reading.co2_ppm > highest) {
            self.peak = Some((time, reading.clone()));
        }
    }

    fn outcome(&self, end: SimTime) -> Outcome {
        match self.airborne {
            _ if !self.flew => Outcome::NeverFlew,
            (true, heard) if end.since_s(heard) > LOST_S => Outcome::Lost,
            (true, _) => Outcome::Airborne,
            (false, _) => Outcome::Landed,
        }
    }

    fn summary(&self, id: &str, outcome: Outcome) -> VehicleSummary {
        let peak = self.peak.as_ref();
        VehicleSummary {
            id: id.to_owned(),
            kind: self.kind,
            outcome,
            distance_m: self.distance_m,
            peak_ppm: peak.map(|(_, r)| r.co2_ppm),
            peak_time_s: peak.map(|(t, _)| t.s()),
            peak_lat_deg: peak.map(|(_, r)| r.lat_deg),
            peak_lon_deg: peak.map(|(_, r)| r.lon_deg),
            peak_alt_amsl_m: peak.map(|(_, r)| r.alt_amsl_m),
        }
    }
}

/// Distance from a peak to the true one, height included, m.
fn distance_m(frame: &LocalFrame, found: &Peak, truth: &PlaceOfPeak) -> f64 {
    let enu = |lat_deg: f64, lon_deg: f64| frame.to_enu(Geodetic { lat_deg, lon_deg });
    enu(found.lat_deg, found.lon_deg)
        .distance_m(enu(truth.lat_deg, truth.lon_deg))
        .hypot(found.alt_amsl_m - truth.alt_amsl_m)
}
