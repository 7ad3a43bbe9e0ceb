//! The reality gap in flight: what the readings of real vehicles so far show of the model.
//!
//! At the start of the search and of the way home, and of each phase between them where what is found is to be
//! adopted, the readings are analysed as `plumage gap plume` would analyse them from a file, only lighter. Where
//! nothing was found, the next look goes on from there. A look takes seconds, so the controller has it computed beside
//! its ticks. The verdict is published, and, where the mission is to adopt what is found, handed to the world simulator.

use gap::plume::{Analysis, Begun, Options, Setup, analyse_from};
use gap::verdict::Verdict;
use protocol::SimTime;
use protocol::message::{Extension, GapCause, MechanismSetting, Reading, verdict_text};
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations};

/// Rows that are kept; when there are more, every second one goes and from then on only half as
/// many are taken, until they are so far apart that the air between them would be unknown. Then the
/// oldest go.
const MOST_ROWS: usize = 1800;
/// A look is worth its time when there are more readings by this factor: fewer show little that was not
/// seen before.
const GROWN: f64 = 1.25;
/// Time between two rows of a platform at first, and the longest, s.
const ROW_S: f64 = 1.0;
const LONGEST_ROW_S: f64 = 4.0;

/// Collects readings of real vehicles and analyses them.
pub struct LiveGap {
    setup: Setup,
    adopt: bool,
    observations: Observations,
    interval_s: f64,
    last_s: Vec<f64>,
    begun: Option<Begun>,
    /// Readings taken in, and how many there were at the last look, with what it said.
    taken: usize,
    said: Option<(usize, (Extension, String))>,
    /// Whether a look is under way.
    looks: bool,
    /// Whether one was asked for meanwhile.
    asked_again: bool,
}

impl LiveGap {
    /// The live gap of a mission; none where the scenario wants none.
    ///
    /// # Errors
    /// A scenario that describes no world.
    pub fn new(scenario: &Scenario) -> Result<Option<Self>, gap::GapError> {
        if !scenario.gap.live {
            return Ok(None);
        }
        Ok(Some(Self {
            setup: Setup::new(scenario)?,
            adopt: scenario.gap.adopt,
            observations: Observations {
                gas: scenario.gas(),
                ..Observations::default()
            },
            interval_s: ROW_S,
            last_s: Vec::new(),
            begun: None,
            taken: 0,
            said: None,
            looks: false,
            asked_again: false,
        }))
    }

    /// Whether what is found is to be adopted.
    pub fn adopts(&self) -> bool {
        self.adopt
    }

    /// Takes in a reading of the real vehicle `platform`.
    pub fn take(&mut self, platform: &str, time: SimTime, reading: &Reading) {
        let known = self
            .observations
            .platforms
            .iter()
            .position(|p| p == platform);
        let platform = known.unwrap_or_else(|| {
            self.observations.platforms.push(platform.to_owned());
            self.last_s.push(f64::NEG_INFINITY);
            self.last_s.len() - 1
        });
        if time.s() - self.last_s[platform] < self.interval_s - 1e-6 {
            return;
        }
        self.last_s[platform] = time.s();
        self.taken += 1;
        self.observations.rows.push(ObservationRow {
            time_s: time.s(),
            platform,
            lat_deg: reading.lat_deg,
            lon_deg: reading.lon_deg,
            alt_amsl_m: reading.alt_amsl_m,
            co2_ppm: Some(reading.co2_ppm),
            wind_speed_m_s: reading.wind_speed_m_s,
            wind_from_deg: reading.wind_from_deg,
            temperature_c: reading.temperature_c,
            relative_humidity_pct: None,
            pressure_hpa: reading.pressure_hpa,
            sd_ppm: None,
            averaging_s: None,
            line_end: None,
        });
        if self.observations.rows.len() > MOST_ROWS {
            self.thin_out();
        }
    }

    fn thin_out(&mut self) {
        let rows = &mut self.observations.rows;
        // Thinning keeps the whole history at half the rate; once the rows are too far apart the
        // oldest go instead.
        if 2.0 * self.interval_s > LONGEST_ROW_S {
            rows.drain(..rows.len() - MOST_ROWS);
            return;
        }
        self.interval_s *= 2.0;
        let mut track = vec![0usize; self.observations.platforms.len()];
        rows.retain(|row| {
            track[row.platform] += 1;
            track[row.platform] % 2 == 1
        });
    }

    /// What the readings so far show. The same as the last time where there are few more of them.
    pub fn judge(&mut self) -> Judgement {
        if self.observations.rows.is_empty() {
            return Judgement::Nothing;
        }
        if let Some((taken, said)) = &self.said
            && (self.taken as f64) < GROWN * *taken as f64
        {
            return Judgement::Known(said.clone());
        }
        if self.looks {
            self.asked_again = true;
            return Judgement::Nothing;
        }
        self.looks = true;
        Judgement::ToCompute(Box::new(Look {
            setup: self.setup.clone(),
            adopt: self.adopt,
            observations: self.observations.clone(),
            begun: self.begun.clone(),
            taken: self.taken,
        }))
    }

    /// Takes in what a look has found: the extension as it goes over the bus, a text for people, and another look where
    /// one was asked for meanwhile and there are enough new readings.
    pub fn learn(&mut self, found: LookResult) -> ((Extension, String), Option<Box<Look>>) {
        self.looks = false;
        self.begun = found.begun;
        self.said = Some((found.taken, found.said.clone()));
        let again = std::mem::take(&mut self.asked_again).then(|| self.judge());
        let look = match again {
            Some(Judgement::ToCompute(look)) => Some(look),
            _ => None,
        };
        (found.said, look)
    }
}

/// What is known of the gap at a moment.
pub enum Judgement {
    /// Nothing: there are no readings, or a look at them is under way.
    Nothing,
    /// The extension as it goes over the bus, and a text for people.
    Known((Extension, String)),
    /// A look at the readings is due.
    ToCompute(Box<Look>),
}

/// A look at the readings so far, which takes seconds.
pub struct Look {
    setup: Setup,
    adopt: bool,
    observations: Observations,
    begun: Option<Begun>,
    taken: usize,
}

/// What it has found.
pub struct LookResult {
    begun: Option<Begun>,
    taken: usize,
    said: (Extension, String),
}

impl Look {
    /// Analyses the readings.
    pub fn compute(self) -> LookResult {
        let options = Options::live();
        let before = self.begun.as_ref();
        let analysed = analyse_from(
            before,
            &self.setup,
            &self.observations,
            &options,
            &mut |_| {},
        );
        let (begun, said) = match analysed {
            Ok(analysis) => (analysis.begun.clone(), self.said(&analysis)),
            Err(e) => {
                let nothing = Extension {
                    verdict: name(Verdict::Insufficient).to_owned(),
                    causes: Vec::new(),
                    mechanisms: Vec::new(),
                    adopt: false,
                };
                let words = format!("reality gap: the readings so far cannot be analysed: {e}");
                (self.begun, (nothing, words))
            }
        };
        LookResult {
            begun,
            taken: self.taken,
            said,
        }
    }

    fn said(&self, analysis: &Analysis) -> (Extension, String) {
        let mechanisms: Vec<MechanismSetting> = analysis
            .extension
            .iter()
            .map(|m| MechanismSetting::new(m.id().as_str(), m.platforms(), m.parameters()))
            .collect();
        let causes = analysis.json.causes.iter().map(|c| GapCause {
            mechanisms: c.mechanisms.clone(),
            probability: c.probability,
        });
        let extension = Extension {
            verdict: name(analysis.json.verdict).to_owned(),
            causes: causes.collect(),
            mechanisms,
            // Nothing found is adopted too: what was adopted before may have been wrong.
            adopt: self.adopt,
        };
        (extension, summary(analysis, self.observations.rows.len()))
    }
}

/// The verdict as `gap.json` writes it.
fn name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::None => "none",
        Verdict::Named => "named",
        Verdict::Ambiguous => "ambiguous",
        Verdict::Unexplained => "unexplained",
        Verdict::Insufficient => "insufficient",
    }
}

fn summary(analysis: &Analysis, rows: usize) -> String {
    let causes: Vec<String> = analysis
        .json
        .causes
        .iter()
        .map(|c| {
            format!(
                "{} (probability {:.2})",
                c.mechanisms.join(" or "),
                c.probability
            )
        })
        .collect();
    let verdict = verdict_text(name(analysis.json.verdict), &causes);
    format!("reality gap after {rows} real readings: {verdict}")
}
