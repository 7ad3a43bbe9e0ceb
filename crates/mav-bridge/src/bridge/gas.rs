//! Readings of the gas sensor among the named values.

use crate::dialect::NAMED_VALUE_FLOAT_DATA;
use plume::{Gas, Unit};
use protocol::SimTime;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// After a gas' formula where its reading is in ppb.
const IN_PPB: &str = "_PPB";
/// Readings kept of each name to know those that come again: 6 s of them at 10 Hz.
const KEPT: usize = 64;
/// Silence of the sensor that is reported, s.
const SILENT_S: f64 = 10.0;
/// Names kept of values that are no readings.
const NAMES: usize = 20;

/// By which clock a reading has its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GasClock {
    /// That of the vehicle: its autopilot's script, or a component that is set by it.
    #[default]
    Vehicle,
    /// None that counts: it was read when it comes.
    Arrival,
}

/// Names of the gas readings, and their units.
#[derive(Debug, Clone, PartialEq)]
pub struct GasInput {
    /// Name of the NAMED_VALUE_FLOAT, 10 letters at most.
    pub name: String,
    /// Component that sends it; none: any component of the vehicle.
    pub component_id: Option<u8>,
    /// ppm for 1 of its unit.
    pub scale: f64,
    /// Added after that, ppm.
    pub offset_ppm: f64,
    /// By which clock it has its time.
    pub clock: GasClock,
}

impl GasInput {
    /// Default names for a gas: its formula in ppm, or with the suffix `_PPB` in ppb.
    pub fn of_formula(gas: Gas) -> Vec<Self> {
        let named = |after: &str, scale: f64| Self {
            name: format!("{}{after}", gas.formula()),
            component_id: None,
            scale,
            offset_ppm: 0.0,
            clock: GasClock::Vehicle,
        };
        vec![named("", 1.0), named(IN_PPB, Unit::Ppb.to_ppm(1.0))]
    }
}

/// One reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Read {
    pub ppm: f64,
    /// The sensor's time, ms since its start; none if that does not count.
    pub time_boot_ms: Option<u32>,
}

/// State of the gas sensor.
#[derive(Debug, Clone)]
pub(super) struct GasHeard {
    inputs: Vec<GasInput>,
    least_ppm: f64,
    /// Time and bits of the last readings of each name and component.
    known: BTreeMap<(String, u8), VecDeque<(u32, u32)>>,
    others: BTreeSet<String>,
    silent_since: Option<SimTime>,
    told: bool,
}

impl GasHeard {
    /// Of the readings of `gas` called `inputs`; of its formula if there are none.
    pub(super) fn new(gas: Gas, inputs: &[GasInput]) -> Self {
        let inputs = match inputs {
            [] => GasInput::of_formula(gas),
            inputs => inputs.to_vec(),
        };
        Self {
            inputs,
            // Air holds so much CO2 that no noise takes a reading below zero; of other gases it may.
            least_ppm: if gas == Gas::Co2 { 0.0 } else { -1.0 },
            known: BTreeMap::new(),
            others: BTreeSet::new(),
            silent_since: None,
            told: false,
        }
    }

    /// Takes in a named value of the vehicle's component `component`: the reading, if it is one that is new.
    pub(super) fn take(
        &mut self,
        m: &NAMED_VALUE_FLOAT_DATA,
        component: u8,
        now: SimTime,
    ) -> Option<Read> {
        let name = super::texts::text(&m.name[..]);
        let of = |i: &&GasInput| i.name == name && i.component_id.is_none_or(|c| c == component);
        let Some(input) = self.inputs.iter().find(of) else {
            if self.others.len() < NAMES {
                self.others.insert(name);
            }
            return None;
        };
        (self.silent_since, self.told) = (Some(now), false);
        let clocked = input.clock == GasClock::Vehicle && m.time_boot_ms != 0;
        let ppm = f64::from(m.value) * input.scale + input.offset_ppm;
        if clocked {
            let known = self.known.entry((name, component)).or_default();
            let this = (m.time_boot_ms, m.value.to_bits());
            if known.contains(&this) {
                return None;
            }
            known.push_back(this);
            if known.len() > KEPT {
                known.pop_front();
            }
        }
        (self.least_ppm..=1e6).contains(&ppm).then_some(Read {
            ppm,
            time_boot_ms: clocked.then_some(m.time_boot_ms),
        })
    }

    /// The host has paused.
    pub(super) fn pause(&mut self, pause_ns: i64, now: SimTime) {
        self.silent_since = self.silent_since.map(|at| at.later(pause_ns).min(now));
    }

    /// Words for a sensor that has been silent for too long, once; the link is up since `connected`.
    pub(super) fn silence(&mut self, connected: SimTime, now: SimTime) -> Option<String> {
        let since = *self.silent_since.get_or_insert(connected);
        if self.told || now.since_s(since.max(connected)) <= SILENT_S {
            return None;
        }
        self.told = true;
        let wanted: Vec<&str> = self.inputs.iter().map(|i| i.name.as_str()).collect();
        let others: Vec<&str> = self.others.iter().map(String::as_str).collect();
        let heard = if others.is_empty() {
            "no NAMED_VALUE_FLOAT was received".to_owned()
        } else {
            format!("NAMED_VALUE_FLOAT names received: {}", others.join(", "))
        };
        Some(format!(
            "no gas reading for {SILENT_S:.0} s; expected NAMED_VALUE_FLOAT {}; {heard}",
            wanted.join(" or ")
        ))
    }
}
