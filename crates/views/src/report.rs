//! `report.html` of a mission: what was flown, learned and found, and what remains, in the form
//! of a short paper. It is filled from messages as they come, in bounded memory.

mod figures;

use crate::html::{Document, number};
use crate::site::{MapPoint, SiteMap};
use air::geo::Enu;
use formats::number::{plus_minus, significant, value_and_sd};
use protocol::message::{
    ControlLevel, Flux, Message, Model, Peak, PeakStatus, Phase, Severity, VehicleKind,
};
use protocol::{Envelope, SimTime, Topic};
use record::colour::Shown;
use record::summary::{CORRECTED, FluxSummary, MissionSummary, ModelNumbers, Outcome, ppm_of};
use record::text;
use record::tracks::{DecimatedSeries, Tracks, VehicleTrack};
use scenario::airspace::SETPOINT_MARGIN_M;
use std::sync::Arc;

/// Points of one track in the report.
const TRACK_POINTS: usize = 1200;
/// Points of the history of a model's numbers.
const HISTORY_POINTS: usize = 400;
/// Passes that are listed.
const MOST_PASSES: usize = 40;
/// A vehicle is in the plume where the model predicts this part of the highest excess along its track.
const IN_PLUME: f64 = 0.1;
/// Events that are listed.
const EVENTS: usize = 30;

/// Collects what the report shows.
#[derive(Clone)]
pub struct Report {
    site: Arc<SiteMap>,
    tracks: Tracks,
    history: DecimatedSeries<(f64, Box<Model>)>,
    before: Option<Box<Model>>,
    after: Option<Box<Model>>,
    phases: Vec<(SimTime, Phase)>,
    events: Vec<String>,
    more_events: u64,
    /// The status of the peak, whenever it changed.
    statuses: Vec<String>,
    pilot_times: u64,
    /// Whether anybody outside the scenario said where vehicles go.
    steered: bool,
    real_time: bool,
}

/// What one real vehicle read, and what the model expected there before and after the mission.
pub(crate) struct Expected<'a> {
    pub(crate) id: &'a str,
    pub(crate) points: Vec<MapPoint>,
    pub(crate) time_s: Vec<f64>,
    pub(crate) read_ppm: Vec<f64>,
    pub(crate) before_ppm: Vec<f64>,
    pub(crate) after_ppm: Vec<f64>,
}

impl Report {
    /// A report that has heard nothing yet.
    pub fn new(site: Arc<SiteMap>) -> Self {
        Self {
            site,
            tracks: Tracks::new(TRACK_POINTS, 0.5),
            history: DecimatedSeries::new(HISTORY_POINTS, 1.0),
            before: None,
            after: None,
            phases: Vec::new(),
            events: Vec::new(),
            more_events: 0,
            statuses: Vec::new(),
            pilot_times: 0,
            steered: false,
            real_time: false,
        }
    }

    /// The mission is flown in real time: another run of it goes a little differently.
    pub fn is_in_real_time(&mut self) {
        self.real_time = true;
    }

    /// Takes in a message.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        self.tracks.take(topic, envelope);
        match (topic, &envelope.message) {
            (Topic::Model, Message::Model(model)) => {
                if self.before.is_none() {
                    self.before = Some(model.clone());
                }
                if self.history.wants(envelope.time) {
                    self.history
                        .push(envelope.time, (envelope.time.s(), model.clone()));
                }
                self.after = Some(model.clone());
            }
            (Topic::Plan, Message::Plan(plan)) => {
                let changed = self
                    .phases
                    .last()
                    .is_none_or(|(_, phase)| *phase != plan.phase);
                // A mission has few phases; one that flickers between two must not fill memory.
                if changed && self.phases.len() < 100 {
                    self.phases.push((envelope.time, plan.phase));
                }
            }
            (Topic::Mode(_), Message::Mode(mode)) if mode.level != ControlLevel::Automatic => {
                self.pilot_times += 1;
            }
            (Topic::Control(_) | Topic::Swap(_) | Topic::Destination(_), _) => self.steered = true,
            (Topic::Event(_), Message::Event(event))
                if event.code == "peak-status" && self.statuses.len() < EVENTS =>
            {
                let at = text::duration(envelope.time.s());
                self.statuses.push(format!("{at}: {}", event.text));
            }
            (Topic::Event(agent), Message::Event(event)) if event.severity > Severity::Info => {
                if self.events.len() < EVENTS {
                    let at = text::duration(envelope.time.s());
                    self.events.push(format!("{at}, {agent}: {}", event.text));
                } else {
                    self.more_events += 1;
                }
            }
            _ => {}
        }
    }

    /// The report.
    pub fn page(&self, summary: &MissionSummary) -> Document {
        let mut page = Document::new("Plumage mission report", &self.site.mission);
        let expected = self.expected();
        page.lead(&self.lead(summary));
        if let Some(said) = text::not_landed(summary) {
            page.paragraph(&said);
        }
        page.cards(&cards(summary));
        self.mission(&mut page, summary);
        self.map(&mut page, summary);
        self.peak(&mut page, summary);
        emission(&mut page, summary);
        self.height_section(&mut page, summary);
        self.passes(&mut page, summary, &expected);
        self.learned(&mut page, summary);
        self.readings(&mut page, &expected);
        self.remains(&mut page, summary, &expected);
        self.repeat(&mut page, summary);
        page
    }

    /// What was done, what came out, and how far to rely on it.
    fn lead(&self, summary: &MissionSummary) -> [String; 3] {
        let real = summary.vehicles.iter();
        let real = real.filter(|v| v.kind == VehicleKind::Real).count();
        let simulated = summary.vehicles.len() - real;
        let gas = summary.gas.formula();
        let done = format!(
            "{simulated} simulated and {real} real vehicles searched for the highest concentration of {gas} in the plume \
             for {}.",
            text::duration(summary.sim_s)
        );
        if !summary.contradictions.is_empty() {
            let found = text::contradictions(&summary.contradictions[..1]);
            let worth =
                "Rely on no number of this mission before that value of the scenario is checked.";
            return [done, found, worth.to_owned()];
        }
        let found = summary
            .peak
            .estimate
            .map_or("No peak was found.".to_owned(), |peak| {
                let rate: String = rates(summary)
                    .map(|f| {
                        let rate = text::emission_rate(f.kg_s);
                        format!(", and {} emits {rate}", f.source)
                    })
                    .collect();
                format!(
                    "The highest concentration where vehicles may fly is{} {} {}{}{rate}.{}",
                    match peak.status {
                        PeakStatus::Doubtful => " doubtfully",
                        _ => "",
                    },
                    plus_minus(peak.co2_ppm, peak.sd_ppm),
                    ppm_of(summary.gas),
                    self.peak_distance_m(&peak)
                        .map_or(String::new(), |m| format!(", {m:.0} m from the source")),
                    text::added_sources(summary)
                        .iter()
                        .map(|source| format!(" {source}"))
                        .collect::<String>(),
                )
            });
        let worth = match summary.peak.status {
            PeakStatus::NotFound => text::peak(summary),
            PeakStatus::Confirmed => {
                "Readings of real crossings near it confirm this; each ± is one standard deviation."
                    .to_owned()
            }
            PeakStatus::Supported => format!(
                "Real readings support this, but do not confirm it: {}. Each ± is one standard deviation.",
                text::NOT_CONFIRMED
            ),
            PeakStatus::Doubtful => {
                "Do not rely on this yet: real readings contradict it or constrain it too little."
                    .to_owned()
            }
        };
        let gap = summary.gap.as_ref().filter(|gap| gap.verdict != "none");
        let gap = gap.map_or(String::new(), |gap| format!(" {}", text::gap(gap)));
        [done, found, format!("{worth}{gap} {}", next(summary))]
    }

    /// Distance of a place from the first source, m.
    fn distance_m(&self, at: Enu) -> Option<f64> {
        let source = self.site.stacks.first()?;
        Some(self.site.enu(source.lat_deg, source.lon_deg).distance_m(at))
    }

    /// The same of a peak.
    fn peak_distance_m(&self, peak: &Peak) -> Option<f64> {
        self.distance_m(self.site.enu(peak.lat_deg, peak.lon_deg))
    }

    /// The plume in the vertical plane of its axis, with what was read near it.
    fn height_section(&self, page: &mut Document, summary: &MissionSummary) {
        let Some(model) = &self.after else { return };
        page.section("Vertical section");
        page.figure(
            figures::section(&self.site, &self.tracks, model, &self.shown(summary)),
            &format!(
                "The plume of the final model in the vertical plane of its axis, with lines at {} ppm above background, \
                 and the readings of real vehicles whose distance from that plane is at most {:.0} % of that from the \
                 source.",
                self.levels(),
                100.0 * figures::ASIDE
            ),
        );
    }

    /// Crossings of the plume by real vehicles.
    fn passes(&self, page: &mut Document, summary: &MissionSummary, expected: &[Expected<'_>]) {
        let Some(model) = &self.after else { return };
        let passes: Vec<Pass> = expected.iter().flat_map(|e| e.passes(model)).collect();
        if passes.is_empty() {
            return;
        }
        page.section("Passes through the plume");
        let shown = |ppm: f64| number(ppm, summary.gas.digits());
        let row = |p: &Pass| {
            let at = &p.at;
            let distance_m = self.distance_m(at.at);
            vec![
                p.vehicle.clone(),
                format!("{} to {}", clock(p.from_s), clock(p.to_s)),
                distance_m.map_or(String::new(), |m| number(m, 0)),
                number(at.alt_amsl_m - self.site.frame.ground_amsl_m, 0),
                shown(p.read_ppm),
                shown(p.predicted_ppm),
            ]
        };
        let rows: Vec<Vec<String>> = passes.iter().take(MOST_PASSES).map(row).collect();
        let caption = format!(
            "Passes of real vehicles where the final model predicts at least a tenth of its highest excess along their \
             tracks, with the place of the highest reading: the first {} of {}. Points of a track are some seconds apart, \
             so the highest reading of the mission may lie between them.",
            rows.len(),
            passes.len()
        );
        let head = [
            "vehicle",
            "time, min",
            "distance, m",
            "height AGL, m",
            "highest read, ppm",
            "highest predicted, ppm",
        ];
        page.table(&caption, &head, &rows);
    }

    /// Colours that reach as far as the peak and the readings of each vehicle, but for one that stands alone: a puff that
    /// one vehicle read, or a peak that nobody did.
    fn shown(&self, summary: &MissionSummary) -> Shown {
        let read = summary.vehicles.iter().filter_map(|v| v.peak_ppm);
        let peak = summary.peak.estimate.as_ref().map(|p| p.co2_ppm);
        let mut highest: Vec<f64> = read.chain(peak).collect();
        highest.sort_by(|a, b| b.total_cmp(a));
        let reach = highest.get(1).or(highest.first());
        self.site
            .shown
            .reaching(reach.copied().unwrap_or(f64::NEG_INFINITY))
    }

    fn mission(&self, page: &mut Document, summary: &MissionSummary) {
        page.section("The mission");
        let conditions = self.site.conditions.iter();
        let conditions: Vec<Vec<String>> = conditions
            .map(|(what, how)| vec![what.clone(), how.clone()])
            .collect();
        page.table(
            "Conditions of the mission.",
            &["what", "as planned"],
            &conditions,
        );
        let starts: Vec<String> = self
            .phases
            .iter()
            .map(|(time, phase)| {
                format!("{} from {}", phase_name(*phase), text::duration(time.s()))
            })
            .collect();
        if !starts.is_empty() {
            page.paragraph(&format!(
                "The team went through these phases: {}.",
                starts.join("; ")
            ));
        }
        let rows: Vec<Vec<String>> = summary
            .vehicles
            .iter()
            .map(|v| {
                vec![
                    v.id.clone(),
                    text::vehicle_kind(v.kind).to_owned(),
                    number(v.distance_m / 1000.0, 1),
                    number(v.peak_ppm.unwrap_or(f64::NAN), summary.gas.digits()),
                    v.peak_time_s.map_or_else(|| "–".to_owned(), text::duration),
                    number(
                        v.peak_alt_amsl_m.unwrap_or(f64::NAN) - self.site.frame.ground_amsl_m,
                        0,
                    ),
                ]
            })
            .collect();
        let highest = format!("highest reading, ppm {}", summary.gas.formula());
        let head = [
            "vehicle",
            "kind",
            "distance, km",
            &highest,
            "measured at",
            "height AGL, m",
        ];
        let caption = "The vehicles and their highest single readings, sensor noise included.";
        page.table(caption, &head, &rows);
    }

    fn map(&self, page: &mut Document, summary: &MissionSummary) {
        page.section("Where they flew");
        let shown = self.shown(summary);
        let figure = figures::map(
            &self.site,
            &self.tracks,
            self.after.as_deref(),
            summary,
            &shown,
        );
        let reality = if self.site.reality.is_some() {
            " Dashed lines: the stand-in's reality at the same height, unknown to the team."
        } else {
            ""
        };
        page.figure(
            figure,
            &format!(
                "Tracks coloured by the {} readings, in km from the site's origin. Blue: the plume of the final \
                 model at the height of its axis, with lines at {} ppm above background.{reality}",
                self.site.shown.gas.formula(),
                self.levels()
            ),
        );
    }

    /// The contour lines, ppm, in words.
    fn levels(&self) -> String {
        let shown = &self.site.shown;
        shown.levels_ppm().map(|l| shown.number(l)).join(", ")
    }

    fn learned(&self, page: &mut Document, summary: &MissionSummary) {
        page.section("Correction of the model");
        let taken = self.after.as_ref().map_or(0, |m| m.observations);
        page.paragraph(&format!(
            "The world simulator corrected its plume model with {taken} readings of real vehicles as they \
             arrived. The simulated vehicles flew in the corrected plume."
        ));
        let model = &summary.model;
        if let Some(gap) = &summary.gap {
            page.paragraph(&text::gap(gap));
        }
        let rows: Vec<Vec<String>> = CORRECTED
            .iter()
            .map(|n| {
                let (before, after) = ((n.of)(&model.before), (n.of)(&model.after));
                let unit = n.unit_of(summary.gas);
                let name = if unit.is_empty() {
                    n.name.to_owned()
                } else {
                    format!("{}, {unit}", n.name)
                };
                let mut row = vec![
                    name,
                    plus_minus(before.value, before.sd),
                    plus_minus(after.value, after.sd),
                ];
                if let Some(reality) = &model.reality {
                    let truth = (n.of)(reality).value;
                    row.push(significant(truth));
                    row.extend([before, after].map(|found| text::error(n, found, truth)));
                }
                row
            })
            .collect();
        let mut head = vec!["", "before", "after"];
        if model.reality.is_some() {
            head.extend(["reality", "error before", "error after"]);
        }
        let caption =
            "Parameters of the model with one standard deviation. Before: as in the scenario.";
        page.table(caption, &head, &rows);
        if self.history.items().len() > 1 {
            let figure = figures::history(
                self.history.items(),
                model.reality.as_ref(),
                &self.site.shown,
            );
            let caption = "Parameters of the model during the mission, with a band of two standard deviations. \
                           Dashed: the stand-in's reality, where it is known.";
            page.figure(figure, caption);
        }
    }

    fn readings(&self, page: &mut Document, expected: &[Expected<'_>]) {
        if expected.is_empty() {
            return;
        }
        page.section("Readings and predictions");
        page.figure(
            figures::readings(expected, &self.site.shown),
            &format!(
                "Above: {} readings of the real vehicles, and the predictions of the model along their tracks \
                 before and after the mission. Below: reading minus prediction. The model predicts a mean field, \
                 about which gusts move the real plume; the sensor's lag is not removed here.",
                self.site.shown.gas.formula()
            ),
        );
        let tenths = self.site.shown.gas.digits() + 1;
        let rows: Vec<Vec<String>> = expected
            .iter()
            .map(|e| {
                let (before, after) = (e.rms(&e.before_ppm), e.rms(&e.after_ppm));
                vec![
                    e.id.to_owned(),
                    e.read_ppm.len().to_string(),
                    number(before, tenths),
                    number(after, tenths),
                ]
            })
            .collect();
        let head = [
            "vehicle",
            "readings shown",
            "rms before, ppm",
            "rms after, ppm",
        ];
        let caption = "Root mean square of reading minus prediction along the tracks of real vehicles. The model \
                       after the mission was fitted to these readings, so this measures the fit, not the skill \
                       elsewhere.";
        page.table(caption, &head, &rows);
    }

    fn peak(&self, page: &mut Document, summary: &MissionSummary) {
        page.section("The peak");
        page.paragraph(&text::peak(summary));
        let distance_m = summary
            .peak
            .estimate
            .and_then(|found| self.peak_distance_m(&found));
        if let Some(distance) = distance_m {
            let keep_out_m = self.site.keep_out_radius_m;
            let near = if keep_out_m > 0.0 {
                format!(
                    " Setpoints keep {SETPOINT_MARGIN_M:.0} m from the keep-out cylinder of {keep_out_m:.0} \
                         m. Nearer the source the concentration on the axis is higher, but no vehicle may fly \
                         there."
                )
            } else {
                String::new()
            };
            page.paragraph(&format!("It lies {distance:.0} m from the source.{near}"));
        }
        if !self.statuses.is_empty() {
            page.paragraph("Its status during the mission, and why:");
            page.list(&self.statuses);
        }
    }

    fn remains(&self, page: &mut Document, summary: &MissionSummary, expected: &[Expected<'_>]) {
        page.section("Limits of this result");
        let mut items = Vec::new();
        if let Some(reality) = &summary.model.reality {
            items.extend(outside(summary, reality));
        }
        for e in expected {
            let rms = number(e.rms(&e.after_ppm), summary.gas.digits() + 1);
            items.push(format!(
                "Vehicle {}: the model's mean field leaves {rms} ppm (rms) of its readings unexplained: \
                 turbulence, noise and lag of the sensor, and errors of the model. Run plumage gap plume on this \
                 mission's recording to separate these.",
                e.id
            ));
        }
        if expected.is_empty() {
            let text = "No real vehicle flew, so nothing here was compared with a measurement.";
            items.push(text.to_owned());
        }
        if self.pilot_times > 0 {
            items.push(
                "A pilot or the Guardian flew for a part of the mission and ignored setpoints then."
                    .to_owned(),
            );
        }
        if !self.events.is_empty() {
            let more = match self.more_events {
                0 => String::new(),
                n => format!(" and {n} more, listed in the recording"),
            };
            items.push(format!("Warnings: {}{more}.", self.events.join("; ")));
        }
        page.list(&items);
    }

    /// Readings of real vehicles beside what the model expects at their places.
    fn expected(&self) -> Vec<Expected<'_>> {
        let (Some(before), Some(after)) = (&self.before, &self.after) else {
            return Vec::new();
        };
        let real = |(_, track): &(&String, &VehicleTrack)| track.kind == VehicleKind::Real;
        let tracks = self.tracks.by_vehicle().iter().filter(real);
        tracks
            .map(|(id, track)| {
                let readings = track.points.items();
                let points: Vec<MapPoint> = readings
                    .iter()
                    .map(|p| MapPoint {
                        at: self.site.enu(p.lat_deg, p.lon_deg),
                        alt_amsl_m: p.alt_amsl_m,
                    })
                    .collect();
                Expected {
                    id,
                    points: points.clone(),
                    time_s: readings.iter().map(|p| p.time_s).collect(),
                    read_ppm: readings.iter().map(|p| p.co2_ppm).collect(),
                    before_ppm: (self.site.field)(before, &points),
                    after_ppm: (self.site.field)(after, &points),
                }
            })
            .collect()
    }

    fn repeat(&self, page: &mut Document, summary: &MissionSummary) {
        page.section("How to repeat this");
        if self.real_time {
            page.paragraph(&format!(
                "This mission was flown in real time by processes that do not wait for each other, so another \
                 run ends a little differently. Watch the recording with plumage replay mission.mcap --serve. \
                 Its digest is {}.",
                summary.digest
            ));
            return;
        }
        let (seed, digest) = (summary.seed, &summary.digest);
        let verify = "plumage replay mission.mcap --verify does this and compares the digests";
        page.paragraph(&if self.steered {
            format!(
                "Vehicles received commands from outside the scenario, which a new run lacks. The recording has \
                 these commands: plumage replay mission.mcap --verify re-simulates the mission with them and \
                 compares with the digest {digest}."
            )
        } else {
            format!(
                "Run the scenario.toml next to this report with seed {seed}: plumage run scenario.toml --seed \
                 {seed} --out again. The same program gives the same messages, with the digest {digest}. \
                 {verify}{}.",
                fed_in(summary)
            )
        });
    }
}

/// Mission time as minutes and seconds.
fn clock(time_s: f64) -> String {
    let whole = time_s.max(0.0).round() as u64;
    format!("{}:{:02}", whole / 60, whole % 60)
}

/// A stretch of a track within the plume.
struct Pass {
    vehicle: String,
    from_s: f64,
    to_s: f64,
    /// Where the most was read.
    at: MapPoint,
    read_ppm: f64,
    predicted_ppm: f64,
}

impl Expected<'_> {
    /// The stretches where `model`, that after the mission, predicts at least a part of its highest excess.
    fn passes(&self, model: &Model) -> Vec<Pass> {
        let excess = |k: usize| self.after_ppm[k] - model.background_ppm.value;
        let highest = (0..self.time_s.len()).map(excess).fold(0.0, f64::max);
        let is_within = |k: &usize| highest > 0.0 && excess(*k) >= IN_PLUME * highest;
        let mut passes: Vec<Pass> = Vec::new();
        let mut last: Option<usize> = None;
        for k in (0..self.time_s.len()).filter(is_within) {
            let (time_s, read_ppm) = (self.time_s[k], self.read_ppm[k]);
            let goes_on = last.is_some_and(|l| l + 1 == k);
            last = Some(k);
            match passes.last_mut().filter(|_| goes_on) {
                Some(pass) => {
                    pass.to_s = time_s;
                    pass.predicted_ppm = pass.predicted_ppm.max(self.after_ppm[k]);
                    if read_ppm > pass.read_ppm {
                        (pass.read_ppm, pass.at) = (read_ppm, self.points[k]);
                    }
                }
                None => passes.push(Pass {
                    vehicle: self.id.to_owned(),
                    from_s: time_s,
                    to_s: time_s,
                    at: self.points[k],
                    read_ppm,
                    predicted_ppm: self.after_ppm[k],
                }),
            }
        }
        passes
    }

    /// Root mean square of reading minus `expected_ppm`, ppm.
    fn rms(&self, expected_ppm: &[f64]) -> f64 {
        let squares = self
            .read_ppm
            .iter()
            .zip(expected_ppm)
            .map(|(r, e)| (r - e).powi(2));
        (squares.sum::<f64>() / self.read_ppm.len() as f64).sqrt()
    }
}

fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::TakeOff => "take-off",
        Phase::Preliminary => "preliminary flight",
        Phase::Search => "search",
        Phase::Characterise => "characterisation",
        Phase::Flux => "flux measurement",
        Phase::Home => "return",
    }
}

/// The recommended next step after this answer.
fn next(summary: &MissionSummary) -> String {
    let real = summary.vehicles.iter().any(|v| v.kind == VehicleKind::Real);
    let asks = "plumage gap plume mission.mcap --scenario scenario.toml --out gap, in this folder, tests the \
                model with all readings";
    let explained = summary.gap.as_ref().is_none_or(|gap| gap.verdict == "none");
    let text = match summary.peak.status {
        _ if !real => {
            "fly a real vehicle or a stand-in, since nothing here was measured".to_owned()
        }
        PeakStatus::NotFound => {
            "check the scenario's wind and the source's effective height, and increase their uncertainty in \
             [uncertain], or the mission's length, to search more of the site"
                .to_owned()
        }
        PeakStatus::Doubtful => format!("do not rely on the peak yet; {asks}"),
        _ if !explained => asks.to_owned(),
        PeakStatus::Supported => {
            "fly a longer mission or more real vehicles, so that more crossings confirm the \
                                  peak"
                .to_owned()
        }
        PeakStatus::Confirmed => {
            "fly a longer mission or more real vehicles to reduce the uncertainty".to_owned()
        }
    };
    format!("Next: {text}.")
}

/// The rates of all sources by the method that knows one of them best.
fn rates(summary: &MissionSummary) -> impl Iterator<Item = &Flux> {
    let relative_sd = |flux: &Flux| flux.kg_s.sd / flux.kg_s.value;
    let rates = summary.flux.iter().map(|f| &f.found);
    let best = rates
        .clone()
        .min_by(|a, b| relative_sd(a).total_cmp(&relative_sd(b)));
    rates.filter(move |f| best.is_some_and(|best| f.method == best.method))
}

/// What the sources emit, by each method.
fn emission(page: &mut Document, summary: &MissionSummary) {
    if summary.flux.is_empty() {
        return;
    }
    page.section("Emission rate");
    let row = |f: &FluxSummary| {
        let kg_s = f.found.kg_s;
        vec![
            f.found.source.clone(),
            text::flux_method(f.found.method).to_owned(),
            significant(kg_s.value),
            text::interval_of_rate(kg_s),
            f.truth_kg_s.map_or("unknown".to_owned(), significant),
        ]
    };
    let rows: Vec<Vec<String>> = summary.flux.iter().map(row).collect();
    page.table(
        "Emission rates by each method that applies.",
        &[
            "source",
            "method",
            "rate, kg/s",
            "95 % interval, kg/s",
            "reality, kg/s",
        ],
        &rows,
    );
    let mut notes = text::added_sources(summary);
    notes.extend(text::flux_notes(summary));
    if !notes.is_empty() {
        page.list(&notes);
    }
}

fn cards(summary: &MissionSummary) -> Vec<(String, String, String)> {
    let mut cards = Vec::new();
    if let Some(peak) = summary.peak.estimate {
        let label = format!("peak, {}", summary.peak.status.words());
        let unit = ppm_of(summary.gas);
        cards.push((plus_minus(peak.co2_ppm, peak.sd_ppm), unit, label));
    }
    if let Some(error_m) = summary.peak.error_m {
        cards.push((
            number(error_m, 0),
            "m".to_owned(),
            "from the true peak".to_owned(),
        ));
    }
    for f in rates(summary) {
        let interval = text::interval_of_rate(f.kg_s);
        let label = format!("emitted by {}, 95 % interval {interval}", f.source);
        cards.push((significant(f.kg_s.value), "kg/s".to_owned(), label));
    }
    let others = if summary.flux.is_empty() { 3 } else { 1 };
    for n in CORRECTED.iter().take(others) {
        let after = (n.of)(&summary.model.after);
        cards.push((
            plus_minus(after.value, after.sd),
            n.unit_of(summary.gas),
            n.name.to_owned(),
        ));
    }
    cards
}

/// Numbers of the model after the mission that are further from `reality` than two standard deviations.
fn outside(summary: &MissionSummary, reality: &ModelNumbers) -> Vec<String> {
    let after = &summary.model.after;
    CORRECTED
        .iter()
        .filter_map(|n| {
            let (found, truth) = ((n.of)(after), (n.of)(reality));
            let error = n.error(found.value, truth.value).abs();
            (error > 2.0 * found.sd).then(|| {
                let [off, sd] = value_and_sd(error, found.sd);
                format!(
                    "The {} is off by {}, {:.1} of its standard deviations of {sd}.",
                    n.name,
                    format!("{off} {}", n.unit_of(summary.gas)).trim_end(),
                    error / found.sd
                )
            })
        })
        .collect()
}

/// What a new run needs besides, where rows were fed in.
fn fed_in(summary: &MissionSummary) -> String {
    let fed = summary
        .vehicles
        .iter()
        .filter(|v| v.outcome == Outcome::Fed);
    let fed: Vec<&str> = fed.map(|v| v.id.as_str()).collect();
    if fed.is_empty() {
        String::new()
    } else {
        format!(
            ", with observations fed in as {}; a new run needs them with --feed",
            fed.join(", ")
        )
    }
}
