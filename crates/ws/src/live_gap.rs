//! The reality gap in a mission: what the readings of real vehicles so far show of the model.
//!
//! When the plume is located, and at each further phase where what is found is to be adopted, the readings are analysed
//! as `plumage gap plume` would analyse them from a file, only lighter. Such a look takes seconds, so it is computed
//! beside the ticks. At the end of the mission all of them are analysed just as from the recording, with what was named
//! before among what is judged.

use gap::plume::{Analysis, Averaging, NamedSet, Options, Setup, analyse_from};
use gap::verdict::Verdict;
use protocol::SimTime;
use protocol::message::{Extension, GapCause, MechanismSetting, Reading, verdict_text};
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations};

/// A look is worth its time when there are more readings by this factor: fewer show little that was not
/// seen before.
const GROWN: f64 = 1.25;

/// Collects readings of real vehicles and analyses them.
pub struct LiveGap {
    setup: Setup,
    adopt: bool,
    observations: Observations,
    averaging: Averaging,
    /// Readings that there were at the last look.
    looked_at: usize,
    taken: usize,
    looks: bool,
    /// What the last look has named.
    named: Option<NamedSet>,
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
            averaging: Averaging::default(),
            looked_at: 0,
            taken: 0,
            looks: false,
            named: None,
        }))
    }

    /// Whether what is found is to be adopted.
    pub fn adopts(&self) -> bool {
        self.adopt
    }

    /// Takes in a reading of the real vehicle `platform`.
    pub fn take(&mut self, platform: &str, time: SimTime, reading: &Reading) {
        let platforms = &mut self.observations.platforms;
        let known = platforms.iter().position(|p| p == platform);
        let platform = known.unwrap_or_else(|| {
            platforms.push(platform.to_owned());
            platforms.len() - 1
        });
        self.taken += 1;
        let row = ObservationRow {
            time_s: time.s(),
            platform,
            lat_deg: reading.lat_deg,
            lon_deg: reading.lon_deg,
            alt_amsl_m: reading.alt_amsl_m,
            co2_ppm: Some(reading.co2_ppm),
            wind_speed_m_s: reading.wind_speed_m_s,
            wind_from_deg: reading.wind_from_deg,
            temperature_c: reading.temperature_c,
            pressure_hpa: reading.pressure_hpa,
            ..ObservationRow::default()
        };
        self.averaging.take(&row, &mut self.observations.rows);
    }

    /// A look at the readings so far; none while one is under way, or where there are few more readings than at the last.
    pub fn look(&mut self) -> Option<Look> {
        if self.looks || self.taken as f64 <= GROWN * self.looked_at as f64 {
            return None;
        }
        self.looks = true;
        self.looked_at = self.taken;
        Some(self.look_with(Options::live()))
    }

    /// The look at the end of a mission, after which no reading comes; none where there were no readings.
    pub fn last_look(&mut self) -> Option<Look> {
        self.averaging.finish(&mut self.observations.rows);
        (self.taken > 0).then(|| self.look_with(Options::default()))
    }

    fn look_with(&self, options: Options) -> Look {
        Look {
            setup: self.setup.clone(),
            adopt: self.adopt,
            observations: self.observations.clone(),
            named_before: self.named.clone(),
            options,
        }
    }

    /// A look that was under way has been computed.
    pub fn has_looked(&mut self, found: &LookResult) {
        self.looks = false;
        self.named.clone_from(&found.named);
    }
}

/// A look at readings, which takes seconds.
pub struct Look {
    setup: Setup,
    adopt: bool,
    observations: Observations,
    named_before: Option<NamedSet>,
    options: Options,
}

/// What it has found: the extension as it goes over the bus, and a text for people.
pub struct LookResult {
    /// Verdict, causes and mechanisms.
    pub extension: Extension,
    /// The verdict in words.
    pub words: String,
    named: Option<NamedSet>,
}

impl Look {
    /// Analyses the readings.
    pub fn compute(self) -> LookResult {
        let named = self.named_before.as_ref();
        let (setup, observations) = (&self.setup, &self.observations);
        match analyse_from(named, setup, observations, &self.options, &mut |_| {}) {
            Ok(analysis) => self.said(&analysis),
            Err(e) => LookResult {
                extension: Extension {
                    verdict: name(Verdict::Insufficient).to_owned(),
                    causes: Vec::new(),
                    mechanisms: Vec::new(),
                    adopt: false,
                },
                words: format!("reality gap: the readings so far cannot be analysed: {e}"),
                named: None,
            },
        }
    }

    fn said(&self, analysis: &Analysis) -> LookResult {
        let setting = |m: &plume::Mechanism| {
            MechanismSetting::new(m.id().as_str(), m.platforms(), m.parameters())
        };
        let causes = analysis.json.causes.iter().map(|c| GapCause {
            mechanisms: c.mechanisms.clone(),
            probability: c.probability,
        });
        LookResult {
            extension: Extension {
                verdict: name(analysis.json.verdict).to_owned(),
                causes: causes.collect(),
                mechanisms: analysis.extension.iter().map(setting).collect(),
                // Nothing found is adopted too: what was adopted before may have been wrong.
                adopt: self.adopt,
            },
            words: summary(analysis, self.observations.rows.len()),
            named: analysis.named.clone(),
        }
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
    format!("reality gap after {rows} s of real readings: {verdict}")
}
