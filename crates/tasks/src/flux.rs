//! Emission rates from observations, as `flux.json` states them.

use crate::TaskError;
use mission::Setup;
use protocol::digest::sha256_hex;
use scenario::observations::Observations;
use serde_json::json;
use study::flux::{self, Fluxes, Method};

/// A file that was read, for the record.
#[derive(Debug, Clone)]
pub struct Input {
    /// Its name.
    pub file: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// Rates by every method whose conditions are met.
#[derive(Debug, Clone)]
pub struct FluxReport {
    /// Estimates and refusals.
    pub fluxes: Fluxes,
    /// The text of `flux.json`.
    pub json: String,
}

/// Estimates the rate of the scenario's source from `observations`, which were read from `inputs`.
///
/// # Errors
/// A scenario that describes no world.
pub fn of(
    setup: &Setup,
    observations: &Observations,
    methods: &[Method],
    inputs: &[Input],
) -> Result<FluxReport, TaskError> {
    let fluxes = flux::estimate(&setup.scenario, observations, methods)
        .map_err(|e| TaskError::Argument(e.to_string()))?;
    let files: Vec<serde_json::Value> = inputs
        .iter()
        .map(|input| {
            let rows = input.bytes.iter().filter(|b| **b == b'\n').count();
            json!({"file": input.file, "sha256": sha256_hex(&input.bytes), "rows": rows.saturating_sub(1)})
        })
        .collect();
    let document = json!({
        "schema": "plumage.flux/1",
        "version": env!("CARGO_PKG_VERSION"),
        "inputs": files,
        "sources": headline(&fluxes).into_iter().collect::<Vec<_>>(),
        "refused": fluxes.refused,
    });
    Ok(FluxReport {
        json: format!("{document:#}\n"),
        fluxes,
    })
}

/// The preferred estimate with the others beside it.
fn headline(fluxes: &Fluxes) -> Option<serde_json::Value> {
    let (first, others) = fluxes.estimates.split_first()?;
    let mut entry = json!(first);
    entry["alternatives"] = json!(others);
    entry["agreement_p"] = json!(others.first().and_then(|other| first.agreement_p(other)));
    entry["refused"] = json!(fluxes.refused);
    Some(entry)
}
