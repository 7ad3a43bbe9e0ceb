//! The models that were tried on tracer trials, as `gap.json` lists them.

use crate::verdict::{Parameter, number_or_null};
use serde::{Deserialize, Serialize};

/// A model that was tried on a group of trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriedModel {
    /// Its changes; empty for Briggs with the wind as measured.
    pub mechanisms: Vec<String>,
    /// Gain of the log score over the base, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub delta_log_score: f64,
    /// Gain of the log evidence over the base, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub delta_log_evidence: f64,
    /// Probability among the models tried.
    pub probability: f64,
    /// Gain over the base on trials left out, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub held_out_gain: f64,
    /// Its standard error over trials, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub held_out_gain_se: f64,
    /// Fitted parameters.
    pub parameters: Vec<Parameter>,
}

/// One kind of air.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroupDetail {
    /// "unstable" or "stable".
    pub group: String,
    /// Its trials.
    pub trials: Vec<String>,
    /// Models of the crosswind-integrated concentration, the most probable first.
    pub vertical: Vec<TriedModel>,
    /// Models of the width, the most probable first: of the trials with a deviation of azimuth.
    pub lateral: Vec<TriedModel>,
    /// The same of the trials without, or of all where too few measured it.
    pub lateral_without_azimuth: Vec<TriedModel>,
}
